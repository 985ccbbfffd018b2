//! Things that never move: supports, and floor, walls and ceiling.
//!
//! - A part of the room that is flat becomes a half-space on the far side of the face that looks at the objects, so
//!   that nothing passes through. If the objects are not all on one side of it, it becomes a box.
//! - The ground, z = 0, is always closed, whether there is a floor or not.
//! - A support becomes convex parts as objects do. Where its top is flat, a slab below the outline of the top stands in
//!   for whatever thin boards are there: a body that is pressed into it always finds the nearest way out upwards.

use crate::engine::friction;
use crate::hull::Hull;
use crate::shape::CollisionShape;
use crate::units;
use parry3d::math::{Pose as EnginePose, Rotation, Vector};
use parry3d::shape::{Compound, HalfSpace, SharedShape, TriMesh, TriMeshFlags};
use syntable_model::geometry::{Aabb, Point3, Vector3};
use syntable_model::scene::{BodyDraft, Tabletop};

/// A room part is flat if one side is at most this fraction of the next longer.
const FLAT: f64 = 0.05;

/// Least thickness of a room part that is not a half-space, metres.
const WALL_M: f64 = 0.05;

/// Thickness of the slab under a flat top, metres.
const SLAB_M: f32 = 0.1;

/// Faces this close to the height of the tabletop belong to it, metres.
const LEVEL_M: f64 = 0.001;

/// A top is flat if its level faces cover this fraction of their outline.
const COVERED: f64 = 0.97;

/// A thing that never moves.
pub struct Fixed {
    /// Pose of its shape.
    pub pose: EnginePose,
    /// Its shape; a compound is taken apart for the engine.
    pub whole: SharedShape,
    /// Coulomb friction coefficient.
    pub friction: f32,
}

impl Fixed {
    /// The parts and where they are in the shape's frame.
    pub fn parts(&self) -> Vec<(EnginePose, SharedShape)> {
        match self.whole.as_shape::<Compound>() {
            Some(compound) => compound.shapes().to_vec(),
            None => vec![(EnginePose::IDENTITY, self.whole.clone())],
        }
    }
}

/// The ground at a height.
pub fn ground(height: f64) -> Fixed {
    half_space(Point3::new(0.0, 0.0, height), Vector3::z(), 0.5)
}

/// A part of the room. `inside` are points where objects are: none may end up behind it.
pub fn room_part(body: &BodyDraft, inside: &[Point3<f64>]) -> Option<Fixed> {
    let bounds = body.object.mesh.bounds();
    let (size, centre) = (bounds.size(), bounds.centre());
    let mut axes = [0, 1, 2];
    axes.sort_by(|&a, &b| size[a].total_cmp(&size[b]));
    let thin = axes[0];
    let pose = body.world_from_body;
    let friction = friction(body.object.friction);
    if size[thin] <= FLAT * size[axes[1]] {
        let axis = pose * Vector3::ith(thin, 1.0);
        for normal in [axis, -axis] {
            let face = pose * centre + normal * (size[thin] / 2.0);
            if inside.iter().all(|p| (p - face).dot(&normal) >= 0.0) {
                return Some(half_space(face, normal, friction));
            }
        }
        // Objects on both sides: a wall of finite size.
        let half = Vector3::from_fn(|i, _| size[i].max(WALL_M) / 2.0);
        let corners = Aabb { min: centre - half, max: centre + half }.corners();
        let points: Vec<[f32; 3]> = corners.iter().map(|p| <[f64; 3]>::from(*p).map(|x| x as f32)).collect();
        let wall = Hull::around(&points)?.polyhedron(units::PER_METRE)?;
        return Some(Fixed { pose: units::pose(&pose), whole: SharedShape::new(wall), friction });
    }
    // Something else, perhaps a whole room in one mesh: its faces, as they are.
    let data = body.object.mesh.data();
    let points = data.positions.iter().map(|&p| Vector::from(p) * units::PER_METRE).collect();
    let mesh = TriMesh::with_flags(points, data.triangles.clone(), TriMeshFlags::DELETE_DEGENERATE_TRIANGLES).ok()?;
    Some(Fixed { pose: units::pose(&pose), whole: SharedShape::new(mesh), friction })
}

/// A support with its collision shape: the slab under its top, if that is flat, and its parts.
pub fn support(body: &BodyDraft, shape: &CollisionShape, tabletop: Option<&Tabletop>) -> Vec<Fixed> {
    let friction = friction(body.object.friction);
    let pose = units::pose(&body.world_from_body);
    let slab = tabletop.and_then(|tabletop| slab(body, tabletop));
    let mut parts: Vec<SharedShape> = shape.parts.clone();
    let mut fixed = Vec::new();
    if let Some(slab) = slab {
        parts = parts.into_iter().filter_map(|part| below_slab(part, &pose, &slab)).collect();
        if let Some(shape) = slab.polyhedron(units::PER_METRE) {
            fixed.push(Fixed { pose: EnginePose::IDENTITY, whole: SharedShape::new(shape), friction });
        }
    }
    if !parts.is_empty() {
        let whole = SharedShape::new(Compound::new(parts.into_iter().map(|p| (EnginePose::IDENTITY, p)).collect()));
        fixed.push(Fixed { pose, whole, friction });
    }
    fixed
}

fn half_space(point: Point3<f64>, normal: Vector3<f64>, friction: f32) -> Fixed {
    let [i, j, k]: [f64; 3] = normal.normalize().into();
    Fixed {
        pose: EnginePose::from_parts(units::point(&point), Rotation::IDENTITY),
        whole: SharedShape::new(HalfSpace::new(Vector::new(i as f32, j as f32, k as f32).normalize())),
        friction,
    }
}

/// The slab under a flat top, world frame; none if the top is not flat, or has gaps or a hole.
fn slab(body: &BodyDraft, tabletop: &Tabletop) -> Option<Hull> {
    let mesh = &body.object.mesh;
    let mut covered = 0.0;
    let mut rim: Vec<[f64; 2]> = Vec::new();
    for triangle in 0..mesh.data().triangles.len() {
        let corners = mesh.corners(triangle).map(|p| body.world_from_body * p);
        if corners.iter().all(|p| (p.z - tabletop.height()).abs() <= LEVEL_M) {
            let [a, b, c] = corners;
            covered += (b - a).cross(&(c - a)).z.abs() / 2.0;
            rim.extend(corners.map(|p| [p.x, p.y]));
        }
    }
    let outline = convex_outline(rim);
    if outline.len() < 3 || covered < COVERED * area(&outline) {
        return None;
    }
    let top = tabletop.height() as f32;
    let points: Vec<[f32; 3]> =
        outline.iter().flat_map(|&[x, y]| [top, top - SLAB_M].map(|z| [x as f32, y as f32, z])).collect();
    Hull::around(&points)
}

/// A part of a support without what the slab covers; none if nothing is left.
fn below_slab(part: SharedShape, pose: &EnginePose, slab: &Hull) -> Option<SharedShape> {
    let hull = part.as_convex_polyhedron()?;
    let top = slab.points.iter().map(|p| p[2]).fold(f32::NEG_INFINITY, f32::max);
    // The slab's sides reach down without end here, so that only its outline counts.
    let lowered = |p: [f32; 3]| [p[0], p[1], top - SLAB_M / 2.0];
    let world: Vec<[f32; 3]> = hull.points().iter().map(|p| (*pose * *p / units::PER_METRE).to_array()).collect();
    let within = |p: &[f32; 3]| slab.outside(lowered(*p)) <= 0.002;
    if world.iter().all(|p| within(p) && p[2] >= top - SLAB_M - 0.002) {
        return None;
    }
    if world.iter().all(within) {
        // A leg: it ends inside the slab instead of level with the top.
        let points: Vec<[f32; 3]> = world
            .iter()
            .map(|p| Vector::new(p[0], p[1], p[2].min(top - SLAB_M / 2.0)) * units::PER_METRE)
            .map(|p| (pose.inverse() * p / units::PER_METRE).to_array())
            .collect();
        return Some(SharedShape::new(Hull::around(&points)?.polyhedron(units::PER_METRE)?));
    }
    Some(part)
}

/// Convex hull of points in the plane, counter-clockwise (Andrew's monotone chain).
fn convex_outline(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    let turn = |o: [f64; 2], a: [f64; 2], b: [f64; 2]| (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
    let chain = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while chain.len() >= 2 && turn(chain[chain.len() - 2], chain[chain.len() - 1], p) <= 0.0 {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut outline = chain(&mut points.iter().copied());
    outline.extend(chain(&mut points.iter().rev().copied()));
    outline
}

fn area(outline: &[[f64; 2]]) -> f64 {
    let next = outline.iter().cycle().skip(1);
    outline.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>() / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outlines_of_points_in_the_plane() {
        let square = vec![[0.0, 0.0], [1.0, 0.0], [0.5, 0.5], [1.0, 1.0], [0.0, 1.0], [0.5, 0.0], [0.0, 0.0]];
        let outline = convex_outline(square);
        assert_eq!(outline, [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        assert_eq!(area(&outline), 1.0);
        assert!(convex_outline(vec![[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]).len() < 3);
        assert!(convex_outline(Vec::new()).is_empty());
    }
}
