//! Lengths inside the engine are in eighths of a meter.
//!
//! The engine's geometry code uses absolute thresholds for bodies of about one unit. In meters, edges shorter than 2 cm
//! would be parallel, and the expanding polytope algorithm would fail at contacts of cutlery.

use parry3d::bounding_volume::Aabb;
use parry3d::mass_properties::MassProperties as EngineMass;
use parry3d::math::{Matrix, Pose as EnginePose, Rotation, Vector};
use parry3d::shape::SharedShape;
use syntable_convex::{ConvexHull, HullOptions, Polyhedron};
use syntable_model::geometry::{Point3, Pose, Translation3, UnitQuaternion};
use syntable_model::scene::MassProperties;

/// Engine units per meter: a power of two, so that hull vertices on the grid stay exact.
pub const PER_METER: f32 = 8.0;

/// Accuracy of all collision hulls, which are in meters.
pub const HULL_OPTIONS: HullOptions = HullOptions { engine_scale: PER_METER, ..HullOptions::METERS };

/// The convex hull of points, meters; `None` if no point is finite.
pub fn hull(points: &[[f32; 3]]) -> Option<ConvexHull> {
    ConvexHull::new(points, &HULL_OPTIONS)
}

/// The shape of a hull in meters; `None` if it has no volume.
pub fn shape(hull: &ConvexHull) -> Option<SharedShape> {
    Some(SharedShape::new(Polyhedron::new(hull.polyhedron(PER_METER)?)))
}

/// Converts a length in meters, or a speed in m/s, to engine units.
pub fn length(meters: f64) -> f32 {
    (meters * f64::from(PER_METER)) as f32
}

/// Converts a length or speed of the engine to meters or m/s.
pub fn meters(length: f32) -> f64 {
    f64::from(length) / f64::from(PER_METER)
}

/// Converts a point in meters to engine units.
pub fn point(p: &Point3<f64>) -> Vector {
    Vector::new(length(p.x), length(p.y), length(p.z))
}

/// Converts a pose in meters to engine units.
pub fn pose(pose: &Pose) -> EnginePose {
    let [i, j, k, w]: [f64; 4] = pose.rotation.coords.into();
    let rotation = Rotation::from_xyzw(i as f32, j as f32, k as f32, w as f32).normalize();
    EnginePose::from_parts(point(&pose.translation.vector.into()), rotation)
}

/// Converts a pose of the engine to meters.
pub fn pose_of(pose: &EnginePose) -> Pose {
    let [x, y, z] = pose.translation.to_array().map(meters);
    let [i, j, k, w] = pose.rotation.to_array().map(f64::from);
    let rotation = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, i, j, k));
    Pose::from_parts(Translation3::new(x, y, z), rotation)
}

/// Mass properties in engine units. Bodies are at least as thick as their collision shapes.
pub fn mass(mass: &MassProperties) -> EngineMass {
    let least = mass.kg * f64::from(HULL_OPTIONS.min_thickness).powi(2) / 6.0;
    let (unit, inertia) = (f64::from(PER_METER).powi(2), mass.inertia());
    let at = |row: usize, column: usize| {
        let thickness = if row == column { least } else { 0.0 };
        (unit * (inertia[(row, column)] + thickness)) as f32
    };
    let column = |column: usize| Vector::new(at(0, column), at(1, column), at(2, column));
    EngineMass::with_inertia_matrix(
        point(&mass.center),
        mass.kg as f32,
        Matrix::from_cols(column(0), column(1), column(2)),
    )
}

/// Converts a bounding box of the engine to meters.
pub fn aabb_of(aabb: &Aabb) -> syntable_model::geometry::Aabb {
    let point = |p: Vector| Point3::from(p.to_array().map(meters));
    syntable_model::geometry::Aabb { min: point(aabb.mins), max: point(aabb.maxs) }
}

/// Clamps a friction coefficient to 0–10; 0.5 if it is not finite.
pub fn friction(coefficient: f64) -> f32 {
    if coefficient.is_finite() { coefficient.clamp(0.0, 10.0) as f32 } else { 0.5 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::random::Stream;

    #[test]
    fn poses_survive_the_round_trip_to_the_engine() {
        let mut stream = Stream::root(1);
        for _ in 0..20 {
            let there = Pose::from_parts(Translation3::new(0.1, -2.0, 0.75), stream.rotation());
            let back = pose_of(&pose(&there));
            assert!((back.translation.vector - there.translation.vector).norm() < 1e-6);
            assert!(back.rotation.angle_to(&there.rotation) < 1e-6);
        }
    }
}
