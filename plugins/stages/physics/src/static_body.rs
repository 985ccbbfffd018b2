//! Static bodies: supports, and floor, walls and ceiling.
//!
//! - A flat part of the room becomes a half-space behind the face towards the objects, so that no body tunnels through.
//!   With objects on both sides, it becomes a box.
//! - The ground, z = 0, is always a half-space, with or without a floor.
//! - A support becomes convex parts, like an object. The parts of a support with a rim or recesses keep close to its
//!   mesh. Thin parts are extended downwards if nothing is below them. Under a flat top, a thick slab with the outline
//!   of the top replaces thin boards, so that the minimum translation of a body pressed into it always points upwards.

use crate::collision_shape::CollisionShape;
use crate::hull_cache::Purpose;
use crate::units;
use crate::units::friction;
use parry3d::math::{Pose as EnginePose, Rotation, Vector};
use parry3d::query::{Ray, RayCast};
use parry3d::shape::{Compound, HalfSpace, SharedShape, TriMesh, TriMeshFlags};
use syntable_convex::{ConvexHull, Polyhedron, convex_outline, outline_area};
use syntable_model::geometry::{Aabb, Point3, Vector3};
use syntable_model::scene::{Body, Motion, Region, Role, Support, Supports};

/// A room part is flat if its shortest edge is at most this fraction of the next longer one.
const MAX_FLATNESS: f64 = 0.05;

/// Minimum thickness of a room part that is not a half-space, meters.
const MIN_WALL_M: f64 = 0.05;

/// Maximum thickness of the slab under a flat top, meters.
const SLAB_M: f32 = 0.1;

/// Faces within this distance of the height of a support belong to its surface, meters.
const TOP_TOLERANCE_M: f64 = 0.001;

/// A top is flat if its faces cover at least this fraction of their convex outline.
const MIN_COVERAGE: f64 = 0.97;

/// Parts of a support that are thinner in height are extended downwards by this, meters.
const BACKING_M: f32 = 0.03;

/// Something this far below a part of a support is within it, meters.
const RECESS_M: f64 = 0.2;

/// Maximum depth of a body's center below the surface of a recess that holds it, meters. Heavy bodies press thin ones
/// into it.
const SUNK_M: f64 = 0.005;

/// The upper surface of the supports, by position.
pub struct SupportSurface(Vec<TriMesh>);

impl SupportSurface {
    /// The surface of some bodies.
    pub fn new<'a, Id: 'a>(supports: impl Iterator<Item = &'a Body<Id>>) -> Self {
        let mesh = |body: &Body<Id>| {
            let data = body.object.mesh.data();
            let world = |p: &[f32; 3]| units::point(&(body.world_from_body * Point3::from(p.map(f64::from))));
            TriMesh::new(data.positions.iter().map(world).collect(), data.triangles.clone()).ok()
        };
        Self(supports.filter_map(mesh).collect())
    }

    /// Height of the highest support at or below a point, meters.
    pub fn below(&self, point: &Point3<f64>) -> Option<f64> {
        // A ray that hits an edge may miss both of its faces, so three rays run side by side.
        let rays = [[0.0, 0.0], [1.3e-5, 0.7e-5], [-0.9e-5, 1.1e-5]]
            .map(|[x, y]| Ray::new(units::point(&(point + Vector3::new(x, y, 0.0))), -Vector::Z));
        let hits =
            self.0.iter().flat_map(|mesh| rays.iter().filter_map(|ray| mesh.cast_local_ray(ray, f32::MAX, true)));
        Some(point.z - units::meters(hits.reduce(f32::min)?))
    }

    /// Whether a point is above the region of a support, which may have a rim and recesses: within its outline, and not
    /// below the surface there.
    pub fn is_on(&self, region: &Region, point: &Point3<f64>) -> bool {
        // A ray that starts on the surface may miss it.
        let lifted = Point3::new(point.x, point.y, point.z.max(region.height()) + 0.01);
        region.column_contains(&lifted)
            && (point.z >= region.height()
                || self.below(&lifted).is_some_and(|z| point.z >= z - SUNK_M && region.height() - z <= RECESS_M))
    }
}

/// A body that never moves.
pub struct StaticBody {
    /// Pose of its shape.
    pub pose: EnginePose,
    /// Its shape; the parts of a compound become colliders of their own.
    pub whole: SharedShape,
    /// Coulomb friction coefficient.
    pub friction: f32,
}

impl StaticBody {
    /// The parts and their poses in the frame of the shape.
    pub fn parts(&self) -> Vec<(EnginePose, SharedShape)> {
        match self.whole.as_shape::<Compound>() {
            Some(compound) => compound.shapes().to_vec(),
            None => vec![(EnginePose::IDENTITY, self.whole.clone())],
        }
    }
}

/// The ground: everything below a height, meters.
pub fn ground(height: f64) -> StaticBody {
    half_space(Point3::new(0.0, 0.0, height), Vector3::z(), 0.5)
}

/// A part of the room. `inside` are positions of objects, and none may be behind the part. `None` if it has no usable
/// shape.
pub fn room_part<Id>(body: &Body<Id>, inside: &[Point3<f64>]) -> Option<StaticBody> {
    let bounds = body.object.mesh.bounds();
    let (size, center) = (bounds.size(), bounds.center());
    let mut axes = [0, 1, 2];
    axes.sort_by(|&a, &b| size[a].total_cmp(&size[b]));
    let thin = axes[0];
    let pose = body.world_from_body;
    let friction = friction(body.friction);
    if size[thin] <= MAX_FLATNESS * size[axes[1]] {
        let axis = pose * Vector3::ith(thin, 1.0);
        for normal in [axis, -axis] {
            let face = pose * center + normal * (size[thin] / 2.0);
            if inside.iter().all(|p| (p - face).dot(&normal) >= 0.0) {
                return Some(half_space(face, normal, friction));
            }
        }
        // Objects on both sides: a wall of finite size.
        let half = Vector3::from_fn(|i, _| size[i].max(MIN_WALL_M) / 2.0);
        let corners = Aabb { min: center - half, max: center + half }.corners();
        let points: Vec<[f32; 3]> = corners.iter().map(|p| <[f64; 3]>::from(*p).map(|x| x as f32)).collect();
        let wall = units::shape(&units::hull(&points)?)?;
        return Some(StaticBody { pose: units::pose(&pose), whole: wall, friction });
    }
    // Any other shape, such as a whole room in one mesh: its triangles.
    let data = body.object.mesh.data();
    let points = data.positions.iter().map(|&p| Vector::from(p) * units::PER_METER).collect();
    let mesh = TriMesh::with_flags(points, data.triangles.clone(), TriMeshFlags::DELETE_DEGENERATE_TRIANGLES).ok()?;
    Some(StaticBody { pose: units::pose(&pose), whole: SharedShape::new(mesh), friction })
}

/// The static bodies of a support: the slabs under its flat surfaces, if it has any, and its convex parts.
pub fn support<Id>(
    body: &Body<Id>,
    shape: &CollisionShape,
    supports: &Supports,
    surface: &SupportSurface,
) -> Vec<StaticBody> {
    let friction = friction(body.friction);
    let pose = units::pose(&body.world_from_body);
    // Two areas at one height, such as two bins, are one slab of each body.
    let mut heights: Vec<f64> = Vec::new();
    let is_new = |height: f64, heights: &mut Vec<f64>| {
        let is_new = heights.iter().all(|other| (other - height).abs() > TOP_TOLERANCE_M);
        heights.push(height);
        is_new
    };
    let slabs = supports.iter().filter(|support| is_new(support.height(), &mut heights));
    let slabs: Vec<Slab> = slabs.filter_map(|support| slab(body, support, supports)).collect();
    let mut parts: Vec<SharedShape> = shape.parts.clone();
    if slabs.is_empty() {
        parts = parts.into_iter().map(|part| backed(&part, &pose, surface).unwrap_or(part)).collect();
    }
    let mut bodies = Vec::new();
    for slab in slabs {
        parts = parts.into_iter().filter_map(|part| below_slab(part, &pose, &slab)).collect();
        if let Some(whole) = units::shape(&slab.hull) {
            bodies.push(StaticBody { pose: EnginePose::IDENTITY, whole, friction });
        }
    }
    if !parts.is_empty() {
        let whole = SharedShape::new(Compound::new(parts.into_iter().map(|p| (EnginePose::IDENTITY, p)).collect()));
        bodies.push(StaticBody { pose, whole, friction });
    }
    bodies
}

fn half_space(point: Point3<f64>, normal: Vector3<f64>, friction: f32) -> StaticBody {
    let [i, j, k]: [f64; 3] = normal.normalize().into();
    StaticBody {
        pose: EnginePose::from_parts(units::point(&point), Rotation::IDENTITY),
        whole: SharedShape::new(HalfSpace::new(Vector::new(i as f32, j as f32, k as f32).normalize())),
        friction,
    }
}

/// Whether physics moves a body. Bodies of other motions, known or not, are static.
pub fn is_dynamic<Id>(body: &Body<Id>) -> bool {
    body.motion == Motion::Dynamic
}

/// Use of a body's collision shape.
pub fn purpose<Id>(body: &Body<Id>, supports: &Supports) -> Purpose {
    if body.role != Role::Support || supports.main().is_none() {
        return Purpose::Body;
    }
    // Nothing rests beside a flat top, but the walls of a bin are beside its flat bottom.
    let highest = body.world_bounds().max.z;
    let is_top =
        |support: &Support| highest <= support.height() + TOP_TOLERANCE_M && slab(body, support, supports).is_some();
    if supports.iter().any(is_top) { Purpose::Flat } else { Purpose::Relief }
}

/// A thick board under a flat surface.
struct Slab {
    hull: ConvexHull,
    thickness_m: f32,
}

/// The slab under the flat surface of a support, world frame; `None` if the surface is not flat, not convex, or has a
/// hole. The slab ends above the space of the supports below.
fn slab<Id>(body: &Body<Id>, support: &Support, supports: &Supports) -> Option<Slab> {
    let mesh = &body.object.mesh;
    let mut covered_area = 0.0;
    let mut corners_xy: Vec<[f64; 2]> = Vec::new();
    for triangle in 0..mesh.data().triangles.len() {
        let corners = mesh.corners(triangle).map(|p| body.world_from_body * p);
        let [a, b, c] = corners;
        let area = (b - a).cross(&(c - a)).z / 2.0;
        // The underside of a wall at this height carries no object.
        if area > 0.0 && corners.iter().all(|p| (p.z - support.height()).abs() <= TOP_TOLERANCE_M) {
            covered_area += area;
            corners_xy.extend(corners.map(|p| [p.x, p.y]));
        }
    }
    let outline = convex_outline(corners_xy);
    if outline.len() < 3 || covered_area < MIN_COVERAGE * outline_area(&outline) {
        return None;
    }
    let bounds = body.world_bounds();
    let overlaps = |other: &&Support| {
        let ([w, l], center) = (other.surface.size(), other.center());
        [(w, 0), (l, 1)].into_iter().all(|(size, axis)| {
            bounds.min[axis] < center[axis] + size / 2.0 && center[axis] - size / 2.0 < bounds.max[axis]
        })
    };
    let spaces = supports.iter().filter(overlaps).filter_map(Support::top).filter(|space| *space < support.height());
    let thickness_m = spaces.map(|space| (support.height() - space) as f32).fold(SLAB_M, f32::min);
    let top = support.height() as f32;
    let points: Vec<[f32; 3]> =
        outline.iter().flat_map(|&[x, y]| [top, top - thickness_m].map(|z| [x as f32, y as f32, z])).collect();
    Some(Slab { hull: units::hull(&points)?, thickness_m })
}

/// A part of a support, extended downwards so that no body is pressed through it; `None` if the part is thick, or if
/// more of a support is below it, which may form a recess.
fn backed(part: &SharedShape, pose: &EnginePose, surface: &SupportSurface) -> Option<SharedShape> {
    let hull = Polyhedron::of(&**part)?;
    let world: Vec<Vector> = hull.points().iter().map(|p| *pose * *p).collect();
    let low = world.iter().map(|p| p.z).fold(f32::INFINITY, f32::min);
    let high = world.iter().map(|p| p.z).fold(f32::NEG_INFINITY, f32::max);
    if high - low >= BACKING_M * units::PER_METER {
        return None;
    }
    let sum = world.iter().fold(Vector::ZERO, |sum, p| sum + *p) / world.len() as f32;
    let is_open_below = |p: &Vector| {
        let from = Point3::new(units::meters(p.x), units::meters(p.y), units::meters(low) - 1e-3);
        surface.below(&from).is_none_or(|z| from.z - z > RECESS_M)
    };
    // Looked at from the middle and from halfway to each corner, which are all below the part.
    if !is_open_below(&sum) || !world.iter().all(|p| is_open_below(&((*p + sum) / 2.0))) {
        return None;
    }
    let down = Vector::Z * (BACKING_M * units::PER_METER);
    let points: Vec<[f32; 3]> = world
        .iter()
        .flat_map(|p| [*p, *p - down])
        .map(|p| (pose.inverse() * p / units::PER_METER).to_array())
        .collect();
    units::shape(&units::hull(&points)?)
}

/// The remainder of a support's part below the slab; `None` if the slab covers all of it.
fn below_slab(part: SharedShape, pose: &EnginePose, slab: &Slab) -> Option<SharedShape> {
    let Slab { hull: slab, thickness_m } = slab;
    let hull = Polyhedron::of(&*part)?;
    let top = slab.points.iter().map(|p| p[2]).fold(f32::NEG_INFINITY, f32::max);
    // Points are projected to the slab's mid-height, so that only the outline of the slab matters.
    let projected = |p: [f32; 3]| [p[0], p[1], top - thickness_m / 2.0];
    let world: Vec<[f32; 3]> = hull.points().iter().map(|p| (*pose * *p / units::PER_METER).to_array()).collect();
    let within = |p: &[f32; 3]| slab.max_plane_distance(projected(*p)) <= 0.002;
    if world.iter().all(|p| within(p) && p[2] >= top - thickness_m - 0.002) {
        return None;
    }
    if world.iter().all(within) {
        // A leg: cut off at half the height of the slab.
        let points: Vec<[f32; 3]> = world
            .iter()
            .map(|p| Vector::new(p[0], p[1], p[2].min(top - thickness_m / 2.0)) * units::PER_METER)
            .map(|p| (pose.inverse() * p / units::PER_METER).to_array())
            .collect();
        return units::shape(&units::hull(&points)?);
    }
    Some(part)
}
