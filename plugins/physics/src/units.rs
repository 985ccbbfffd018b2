//! Lengths inside the engine are eighths of a metre.
//!
//! The engine's geometry code compares with absolute thresholds that suit bodies of about one unit: with metres, edges
//! shorter than 2 cm counted as parallel, and the polytope algorithm lost its way at contacts of cutlery.

use parry3d::bounding_volume::Aabb;
use parry3d::math::{Pose as EnginePose, Rotation, Vector};
use syntable_model::geometry::{Point3, Pose, Translation3, UnitQuaternion};

/// Engine units in a metre: a power of two, so that vertices on the grid of hulls stay exact.
pub const PER_METRE: f32 = 8.0;

/// A length or speed in metres for the engine.
pub fn length(metres: f64) -> f32 {
    (metres * f64::from(PER_METRE)) as f32
}

/// A length or speed of the engine in metres.
pub fn metres(length: f32) -> f64 {
    f64::from(length) / f64::from(PER_METRE)
}

/// A point for the engine.
pub fn point(p: &Point3<f64>) -> Vector {
    Vector::new(length(p.x), length(p.y), length(p.z))
}

/// A pose for the engine.
pub fn pose(pose: &Pose) -> EnginePose {
    let [i, j, k, w]: [f64; 4] = pose.rotation.coords.into();
    let rotation = Rotation::from_xyzw(i as f32, j as f32, k as f32, w as f32).normalize();
    EnginePose::from_parts(point(&pose.translation.vector.into()), rotation)
}

/// A pose of the engine.
pub fn pose_of(pose: &EnginePose) -> Pose {
    let [x, y, z] = pose.translation.to_array().map(metres);
    let [i, j, k, w] = pose.rotation.to_array().map(f64::from);
    let rotation = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, i, j, k));
    Pose::from_parts(Translation3::new(x, y, z), rotation)
}

/// A box of the engine, metres.
pub fn aabb_of(aabb: &Aabb) -> syntable_model::geometry::Aabb {
    let point = |p: Vector| Point3::from(p.to_array().map(metres));
    syntable_model::geometry::Aabb { min: point(aabb.mins), max: point(aabb.maxs) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::random::Stream;

    #[test]
    fn poses_survive_the_way_to_the_engine() {
        let mut stream = Stream::root(1);
        for _ in 0..20 {
            let there = Pose::from_parts(Translation3::new(0.1, -2.0, 0.75), stream.rotation());
            let back = pose_of(&pose(&there));
            assert!((back.translation.vector - there.translation.vector).norm() < 1e-6);
            assert!(back.rotation.angle_to(&there.rotation) < 1e-6);
        }
    }
}
