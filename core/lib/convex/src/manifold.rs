//! Contact manifolds of convex polyhedra.
//!
//! Parry's generator uses the first four vertices of a face. On the round bottom of a can, they span a sliver, so the
//! can rests on one side only, tilts, and never falls asleep. Here, whole faces are clipped against each other, and the
//! result is reduced to the four points that matter (as in Bullet and Box2D). The normal comes from the
//! Gilbert-Johnson-Keerthi (GJK) and expanding polytope algorithms of parry. For intersecting bodies, it is verified,
//! and the normal of [`minimum_translation`] replaces it where it is wrong.

use crate::depth::{minimum_translation, separation_along};
use crate::shapes::{Polyhedron, Wall};
use parry3d::math::{Pose, Vector};
use parry3d::query::details::{ShapeCastOptions, contact_support_map_support_map_with_params};
use parry3d::query::gjk::{GJKResult, VoronoiSimplex};
use parry3d::query::{
    ClosestPoints, Contact, ContactManifold, ContactManifoldsWorkspace, NonlinearRigidMotion,
    PersistentQueryDispatcher, QueryDispatcher, ShapeCastHit, TrackedContact, Unsupported,
};
use parry3d::shape::{ConvexPolyhedron, HalfSpace, PackedFeatureId, Shape};

/// Contacts are recomputed when the normals have rotated against each other by more than this, cos 0.2°. With 1°, round
/// bodies keep rocking.
const MAX_ROTATION_COS: f32 = 0.999_994;

/// Contacts are recomputed when they have slid by more than this, meters.
const MAX_SLIDE_M: f32 = 0.001;

/// Impulses are carried over to new contacts within this distance, meters.
const MATCH_DISTANCE_M: f32 = 0.002;

/// A whole face takes part if its normal is this close to the contact normal, cos 20°.
const MIN_FACE_COS: f32 = 0.94;

/// The normal of the last step stays unless a different normal is better by more than this, meters.
const NORMAL_HYSTERESIS_M: f32 = 5e-5;

/// Points that do not touch yet take part while the surfaces diverge by at most this slope: 14°.
const MAX_SLOPE: f32 = 0.25;

/// Query dispatcher for contacts of polyhedra with polyhedra and half-spaces. Other pairs are unsupported, and the next
/// dispatcher of the chain handles them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PolyhedronContacts {
    /// Units of the shapes per meter. The tolerances are physical lengths.
    pub units_per_meter: f32,
}

impl<M: Default + Clone, C: Default + Copy> PersistentQueryDispatcher<M, C> for PolyhedronContacts {
    fn contact_manifolds(
        &self,
        pos12: &Pose,
        g1: &dyn Shape,
        g2: &dyn Shape,
        prediction: f32,
        manifolds: &mut Vec<ContactManifold<M, C>>,
        _: &mut Option<ContactManifoldsWorkspace>,
    ) -> Result<(), Unsupported> {
        let hysteresis = NORMAL_HYSTERESIS_M * self.units_per_meter;
        let (polyhedron1, polyhedron2) = (Polyhedron::of(g1), Polyhedron::of(g2));
        let find: &dyn Fn(Option<Vector>) -> Contacts = match (polyhedron1, polyhedron2, Wall::of(g1), Wall::of(g2)) {
            (Some(one), Some(two), ..) => {
                &|previous| polyhedron_contacts(pos12, one, two, prediction, previous, hysteresis)
            }
            (_, Some(two), Some(plane), _) => &|_| half_space_contacts(pos12, plane, two, prediction),
            (Some(one), _, _, Some(plane)) => {
                &|_| half_space_contacts(&pos12.inverse(), plane, one, prediction).swapped(pos12)
            }
            _ => return Err(Unsupported),
        };
        if manifolds.is_empty() {
            manifolds.push(ContactManifold::new());
        }
        let manifold = &mut manifolds[0];
        let max_slide = MAX_SLIDE_M * self.units_per_meter;
        if manifold.try_update_contacts_eps(pos12, MAX_ROTATION_COS, max_slide * max_slide) {
            return Ok(());
        }
        let old = std::mem::take(&mut manifold.points);
        let contacts = find(manifold.local_n1.try_normalize());
        let two_from_one = pos12.rotation.inverse();
        manifold.local_n1 = contacts.normal;
        manifold.local_n2 = two_from_one * -contacts.normal;
        manifold.points.extend(contacts.points.iter().map(|point| {
            let p2 = pos12.inverse_transform_point(point.p2);
            TrackedContact::new(point.p1, p2, PackedFeatureId::UNKNOWN, PackedFeatureId::UNKNOWN, point.separation)
        }));
        manifold.match_contacts_using_positions(&old, MATCH_DISTANCE_M * self.units_per_meter);
        Ok(())
    }

    fn contact_manifold_convex_convex(
        &self,
        _: &Pose,
        _: &dyn Shape,
        _: &dyn Shape,
        _: Option<&dyn parry3d::query::details::NormalConstraints>,
        _: Option<&dyn parry3d::query::details::NormalConstraints>,
        _: f32,
        _: &mut ContactManifold<M, C>,
    ) -> Result<(), Unsupported> {
        Err(Unsupported)
    }
}

/// Contacts of two shapes, in the frame of the first.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct Contacts {
    /// Unit vector from the first to the second shape. Without points, a separating direction if one is known.
    pub normal: Vector,
    /// At most four contact points.
    pub points: Vec<ContactPoint>,
}

/// A pair of points, one on each shape, on a line along the normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactPoint {
    /// Point on the first shape.
    pub p1: Vector,
    /// Point on the second shape.
    pub p2: Vector,
    /// Signed distance from `p1` to `p2` along the normal; negative where the shapes penetrate.
    pub separation: f32,
}

impl Contacts {
    /// The same contacts with the shapes swapped. `pos12` is the pose of the new second shape in the new first one.
    fn swapped(self, pos12: &Pose) -> Self {
        let swap = |point: ContactPoint| ContactPoint { p1: *pos12 * point.p2, p2: *pos12 * point.p1, ..point };
        Self { normal: pos12.rotation * -self.normal, points: self.points.into_iter().map(swap).collect() }
    }
}

/// Contacts of a half-space with a polyhedron.
fn half_space_contacts(
    pos12: &Pose,
    half_space: &HalfSpace,
    polyhedron: &ConvexPolyhedron,
    prediction: f32,
) -> Contacts {
    let normal = half_space.normal;
    let contact = |p: &Vector| {
        let p2 = *pos12 * *p;
        let separation = p2.dot(normal);
        ContactPoint { p1: p2 - normal * separation, p2, separation }
    };
    let near = polyhedron.points().iter().map(contact).filter(|point| point.separation <= prediction).collect();
    Contacts { normal, points: reduced(near, normal) }
}

/// Contacts of two polyhedra that are closer than `prediction`. `pos12` is the pose of the second in the frame of the
/// first.
///
/// `previous` is the normal of the last step, if any. It is kept unless a different normal is better by more than
/// `hysteresis`, so that contacts do not flicker between two directions of equal depth.
pub fn polyhedron_contacts(
    pos12: &Pose,
    one: &ConvexPolyhedron,
    two: &ConvexPolyhedron,
    prediction: f32,
    previous: Option<Vector>,
    hysteresis: f32,
) -> Contacts {
    let separation = |normal: Vector| separation_along(&Pose::IDENTITY, one, pos12, two, normal);
    let mut simplex = VoronoiSimplex::new();
    let closest = contact_support_map_support_map_with_params(pos12, one, two, prediction, &mut simplex, previous);
    let (mut normal, mut witness) = match closest {
        GJKResult::ClosestPoints(p1, p2, normal) => {
            (normal, Some(ContactPoint { p1, p2, separation: (p2 - p1).dot(normal) }))
        }
        GJKResult::NoIntersection(direction) if separation(direction) > 0.0 => {
            return Contacts { normal: direction, points: Vec::new() };
        }
        _ => (Vector::ZERO, None),
    };
    if witness.is_none_or(|witness| witness.separation < 0.0) {
        // Intersecting: take the best of parry's direction, the previous one, and, if parry's does not reach the
        // separation that it claims, the exact one.
        let claimed = witness.map_or(f32::NEG_INFINITY, |witness| witness.separation);
        let mut best = if normal == Vector::ZERO { f32::NEG_INFINITY } else { separation(normal) };
        let is_wrong = best < claimed - hysteresis || claimed == f32::NEG_INFINITY;
        let mut consider = |candidate: Vector, margin: f32| {
            let separation = separation(candidate);
            if separation > best + margin {
                (normal, best, witness) = (candidate, separation, None);
            }
        };
        if let Some(previous) = previous {
            consider(previous, -hysteresis);
        }
        if is_wrong && let Some(exact) = minimum_translation(&Pose::IDENTITY, one, pos12, two) {
            consider(exact.normal, 0.0);
        }
        if normal == Vector::ZERO {
            return Contacts::default();
        }
        if best > prediction {
            return Contacts { normal, points: Vec::new() };
        }
    }
    let mut points = face_contacts(pos12, one, two, normal, prediction);
    if points.is_empty() {
        // Edge against edge, or a vertex.
        points.extend(witness.or_else(|| {
            let p2 = *pos12 * support(two, pos12.rotation.inverse() * -normal);
            let separation = separation(normal);
            (separation <= prediction).then_some(ContactPoint { p1: p2 - normal * separation, p2, separation })
        }));
    }
    Contacts { normal, points: reduced(points, normal) }
}

fn support(polyhedron: &ConvexPolyhedron, direction: Vector) -> Vector {
    let farther = |a: &&Vector, b: &&Vector| a.dot(direction).total_cmp(&b.dot(direction));
    polyhedron.points().iter().max_by(farther).copied().unwrap_or_default()
}

/// A face of a polyhedron.
struct FacePolygon {
    /// Outward normal.
    normal: Vector,
    center: Vector,
    vertices: Vec<Vector>,
    /// Cosine between the normal and the direction that it was searched for.
    cos: f32,
}

impl FacePolygon {
    /// The face whose normal is closest to a direction, transformed by a pose.
    fn facing(polyhedron: &ConvexPolyhedron, pose: &Pose, direction: Vector) -> Option<Self> {
        let local = pose.rotation.inverse() * direction;
        let face = polyhedron.faces().iter().max_by(|a, b| a.normal.dot(local).total_cmp(&b.normal.dot(local)))?;
        let first = face.first_vertex_or_edge as usize;
        let ids = polyhedron.vertices_adj_to_face().get(first..first + face.num_vertices_or_edges as usize)?;
        let vertices: Vec<Vector> = ids.iter().map(|&i| *pose * polyhedron.points()[i as usize]).collect();
        // Parry merges faces of nearly the same direction, so the vertices may not be coplanar. Newell's normal handles
        // this.
        let center = vertices.iter().sum::<Vector>() / vertices.len() as f32;
        let next = vertices.iter().cycle().skip(1);
        let doubled = vertices.iter().zip(next).map(|(p, q)| (*p - center).cross(*q - center)).sum::<Vector>();
        let along = pose.rotation * face.normal;
        let normal = doubled.try_normalize().map_or(along, |mean| if mean.dot(along) < 0.0 { -mean } else { mean });
        Some(Self { normal, center, vertices, cos: normal.dot(direction) })
    }

    /// Distance from a point to the plane of the face along a direction.
    fn distance_along(&self, from: Vector, direction: Vector) -> f32 {
        (self.center - from).dot(self.normal) / direction.dot(self.normal)
    }
}

/// Contacts of the two faces that face each other, clipped against each other; none if they are too oblique.
fn face_contacts(
    pos12: &Pose,
    one: &ConvexPolyhedron,
    two: &ConvexPolyhedron,
    normal: Vector,
    prediction: f32,
) -> Vec<ContactPoint> {
    let faces = FacePolygon::facing(one, &Pose::IDENTITY, normal).zip(FacePolygon::facing(two, pos12, -normal));
    let Some((face1, face2)) = faces else { return Vec::new() };
    if face1.cos.max(face2.cos) < MIN_FACE_COS || face1.cos.min(face2.cos) < 0.1 {
        return Vec::new();
    }
    // The face closer to perpendicular is the reference face; the other, incident one is clipped.
    let first_is_reference = face1.cos >= face2.cos - 1e-3;
    let (reference, incident) = if first_is_reference { (&face1, &face2) } else { (&face2, &face1) };
    // No contact point is deeper than the shapes along the normal.
    let lowest = separation_along(&Pose::IDENTITY, one, pos12, two, normal);
    let contact = |p: Vector| {
        let distance = reference.distance_along(p, normal);
        let separation = if first_is_reference { -distance } else { distance }.max(lowest);
        if first_is_reference {
            ContactPoint { p1: p - normal * separation, p2: p, separation }
        } else {
            ContactPoint { p1: p, p2: p + normal * separation, separation }
        }
    };
    clip(&incident.vertices, &reference.vertices, normal)
        .into_iter()
        .map(contact)
        .filter(|point| point.separation <= prediction)
        .collect()
}

/// Clips a polygon against the sides of a convex one, both projected along a normal (Sutherland and Hodgman).
fn clip(subject: &[Vector], convex: &[Vector], normal: Vector) -> Vec<Vector> {
    let doubled_area: f32 = (1..convex.len().saturating_sub(1))
        .map(|i| (convex[i] - convex[0]).cross(convex[i + 1] - convex[0]).dot(normal))
        .sum();
    let up = if doubled_area >= 0.0 { normal } else { -normal };
    let mut clipped = subject.to_vec();
    for (i, &from) in convex.iter().enumerate() {
        let to = convex[(i + 1) % convex.len()];
        let Some(inward) = up.cross(to - from).try_normalize() else { continue };
        let inside = |p: Vector| (p - from).dot(inward);
        let mut next = Vec::with_capacity(clipped.len() + 2);
        for (j, &p) in clipped.iter().enumerate() {
            let q = clipped[(j + 1) % clipped.len()];
            let (a, b) = (inside(p), inside(q));
            if a >= 0.0 {
                next.push(p);
            }
            if (a >= 0.0) != (b >= 0.0) {
                next.push(p + (q - p) * (a / (a - b)));
            }
        }
        clipped = next;
    }
    clipped
}

/// At most four of the points: the deepest, the one farthest from it, and the outermost on either side of these two.
///
/// Points that do not touch yet count less the farther away they are. With a long prediction, most vertices of a lying
/// can are near the table, but it rests on the lowest vertices at both of its ends.
fn reduced(points: Vec<ContactPoint>, normal: Vector) -> Vec<ContactPoint> {
    if points.len() <= 4 {
        return points;
    }
    let most = |measure: &dyn Fn(&ContactPoint) -> f32| {
        points.iter().max_by(|a, b| measure(a).total_cmp(&measure(b))).copied()
    };
    let Some(deepest) = most(&|point| -point.separation) else { return points };
    let away = |point: &ContactPoint| (point.separation - deepest.separation) / MAX_SLOPE;
    let Some(far) = most(&|point| (point.p1 - deepest.p1).length() - away(point)) else { return points };
    let mut chosen = vec![deepest];
    let Some(side) = normal.cross(far.p1 - deepest.p1).try_normalize() else { return chosen };
    chosen.push(far);
    for side in [side, -side] {
        let reach = |point: &ContactPoint| (point.p1 - deepest.p1).dot(side) - away(point);
        chosen.extend(most(&reach).filter(|point| reach(point) > 0.0));
    }
    chosen
}

impl QueryDispatcher for PolyhedronContacts {
    fn intersection_test(
        &self,
        _: &Pose,
        _: &dyn Shape,
        _: &dyn Shape,
    ) -> Result<parry3d::query::ShapeIntersection, Unsupported> {
        Err(Unsupported)
    }
    fn distance(&self, _: &Pose, _: &dyn Shape, _: &dyn Shape) -> Result<parry3d::query::ShapeDistance, Unsupported> {
        Err(Unsupported)
    }
    fn contact(&self, _: &Pose, _: &dyn Shape, _: &dyn Shape, _: f32) -> Result<Option<Contact>, Unsupported> {
        Err(Unsupported)
    }
    fn closest_points(&self, _: &Pose, _: &dyn Shape, _: &dyn Shape, _: f32) -> Result<ClosestPoints, Unsupported> {
        Err(Unsupported)
    }
    fn cast_shapes(
        &self,
        _: &Pose,
        _: Vector,
        _: &dyn Shape,
        _: &dyn Shape,
        _: ShapeCastOptions,
    ) -> Result<Option<ShapeCastHit>, Unsupported> {
        Err(Unsupported)
    }
    fn cast_shapes_nonlinear(
        &self,
        _: &NonlinearRigidMotion,
        _: &dyn Shape,
        _: &NonlinearRigidMotion,
        _: &dyn Shape,
        _: f32,
        _: f32,
        _: bool,
    ) -> Result<Option<ShapeCastHit>, Unsupported> {
        Err(Unsupported)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hull::{ConvexHull, HullOptions};
    use parry3d::math::Rotation;
    use syntable_model::random::Stream;

    const HYSTERESIS: f32 = NORMAL_HYSTERESIS_M * 8.0;

    fn polyhedron(points: &[[f32; 3]]) -> ConvexPolyhedron {
        ConvexHull::new(points, &HullOptions::METERS).expect("a hull").polyhedron(1.0).expect("closed")
    }

    fn cuboid(size: [f32; 3]) -> ConvexPolyhedron {
        let corner = |i: usize| std::array::from_fn(|k| size[k] * if i >> k & 1 == 0 { -0.5 } else { 0.5 });
        polyhedron(&(0..8).map(corner).collect::<Vec<_>>())
    }

    fn cylinder(radius: f32, height: f32, sides: usize) -> ConvexPolyhedron {
        let points: Vec<[f32; 3]> = (0..sides)
            .map(|i| (i as f32 / sides as f32 * std::f32::consts::TAU).sin_cos())
            .flat_map(|(y, x)| [-0.5, 0.5].map(|z| [radius * x, radius * y, height * z]))
            .collect();
        polyhedron(&points)
    }

    fn contacts_of(pos12: &Pose, one: &ConvexPolyhedron, two: &ConvexPolyhedron) -> Contacts {
        polyhedron_contacts(pos12, one, two, 0.05, None, HYSTERESIS)
    }

    fn at(x: f32, y: f32, z: f32) -> Pose {
        Pose::from_parts(Vector::new(x, y, z), Rotation::IDENTITY)
    }

    /// Area of the bounding rectangle of the points, projected along z.
    fn spread(contacts: &Contacts) -> f32 {
        let mut points: Vec<[f64; 2]> =
            contacts.points.iter().map(|p| [f64::from(p.p1.x), f64::from(p.p1.y)]).collect();
        points.dedup();
        let [mut low, mut high] = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for p in points {
            for axis in 0..2 {
                low[axis] = low[axis].min(p[axis]);
                high[axis] = high[axis].max(p[axis]);
            }
        }
        ((high[0] - low[0]) * (high[1] - low[1])) as f32
    }

    #[test]
    fn a_can_rests_on_its_whole_bottom() {
        let (table, can) = (cuboid([12.0, 8.0, 1.0]), cylinder(0.35, 1.0, 40));
        for depth in [-0.01, 0.0, 0.002, 0.02] {
            for (x, y) in [(0.0, 0.0), (2.0, -1.5), (5.0, 3.0)] {
                let contacts = contacts_of(&at(x, y, 1.0 - depth), &table, &can);
                assert!((contacts.normal - Vector::Z).length() < 1e-4, "{contacts:?}");
                assert!(contacts.points.iter().all(|point| (point.separation + depth).abs() < 1e-4), "{contacts:?}");
                assert!(contacts.points.len() == 4 && spread(&contacts) > 0.9 * 0.7 * 0.7 / 2.0, "{contacts:?}");
            }
        }
    }

    #[test]
    fn a_lying_can_rests_on_both_ends() {
        // Nearly half of its vertices are within the prediction.
        let (plane, can) = (HalfSpace::new(Vector::Y), cylinder(0.2, 1.0, 60));
        for tilt in [-0.002_f32, 0.0, 0.002] {
            let rotation = Rotation::from_xyzw((tilt / 2.0).sin(), 0.0, 0.0, (tilt / 2.0).cos());
            let contacts = half_space_contacts(&Pose::from_parts(Vector::Y * 0.199, rotation), &plane, &can, 0.15);
            for end in [-0.5, 0.5] {
                let lowest = |p: &&ContactPoint| (p.p1.z - end).abs() < 0.01 && p.p1.x.abs() < 0.03;
                assert!(contacts.points.iter().any(|p| lowest(&p)), "{tilt}: no contact at {end}: {contacts:?}");
            }
        }
    }

    #[test]
    fn a_box_on_a_round_table_rests_on_four_vertices() {
        let (table, cube) = (cylinder(5.0, 1.0, 64), cuboid([0.6; 3]));
        for (x, y) in [(0.0, 0.0), (3.0, 3.0), (-4.0, 1.0)] {
            for (one, two, sign) in [(&table, &cube, 1.0), (&cube, &table, -1.0)] {
                let pose = at(sign * x, sign * y, sign * (0.8 - 0.001));
                let contacts = contacts_of(&pose, one, two);
                assert!((contacts.normal - Vector::Z * sign).length() < 1e-3, "{contacts:?}");
                assert!(contacts.points.len() == 4 && (spread(&contacts) - 0.36).abs() < 1e-3, "{contacts:?}");
            }
        }
    }

    #[test]
    fn boxes_overhang_and_edges_cross() {
        let cube = cuboid([1.0; 3]);
        let contacts = contacts_of(&at(0.7, 0.2, 0.999), &cube, &cube);
        assert!((spread(&contacts) - 0.3 * 0.8).abs() < 1e-3, "{contacts:?}");
        // Two bars on their edges, crossing: one point, straight up.
        let bar = cuboid([4.0, 0.5, 0.5]);
        let (half, quarter) = (std::f32::consts::FRAC_PI_8, std::f32::consts::FRAC_PI_4);
        let rolled = Rotation::from_xyzw(half.sin(), 0.0, 0.0, half.cos());
        let across = Rotation::from_xyzw(0.0, 0.0, quarter.sin(), quarter.cos());
        let lower = Pose::from_parts(Vector::ZERO, rolled);
        let upper = Pose::from_parts(Vector::new(0.0, 0.0, 0.5_f32.sqrt() - 0.01), across * rolled);
        let contacts = contacts_of(&lower.inv_mul(&upper), &bar, &bar);
        assert_eq!(contacts.points.len(), 1, "{contacts:?}");
        assert!((rolled * contacts.normal - Vector::Z).length() < 1e-2, "{contacts:?}");
        assert!((contacts.points[0].separation + 0.01).abs() < 1e-3, "{contacts:?}");
    }

    #[test]
    fn a_half_space_touches_the_lowest_vertices() {
        let (plane, can) = (HalfSpace::new(Vector::Z), cylinder(0.35, 1.0, 40));
        let contacts = half_space_contacts(&at(3.0, 0.0, 0.499), &plane, &can, 0.05);
        assert!(contacts.points.len() == 4 && spread(&contacts) > 0.2, "{contacts:?}");
        let pos12 = at(3.0, 0.0, 0.499).inverse();
        let other = half_space_contacts(&pos12.inverse(), &plane, &can, 0.05).swapped(&pos12);
        assert!((other.normal + Vector::Z).length() < 1e-6, "{other:?}");
        for point in &other.points {
            assert!((point.p1.z + 0.5).abs() < 1e-5 && (point.separation + 0.001).abs() < 1e-5, "{other:?}");
            assert!(((point.p2 - point.p1).dot(other.normal) - point.separation).abs() < 1e-6, "{other:?}");
        }
    }

    #[test]
    fn points_are_on_both_shapes_and_bound_the_depth() {
        let mut stream = Stream::root(5);
        let mut random = |radius: f64| <[f64; 3]>::from(stream.direction() * radius).map(|x| x as f32);
        for round in 0..200 {
            let one = polyhedron(&(0..30).map(|_| random(0.5)).collect::<Vec<_>>());
            let two = polyhedron(&(0..30).map(|_| random(0.5)).collect::<Vec<_>>());
            let toward = Vector::from(random(1.0));
            let pose = Pose::from_parts(toward * (0.8 + 0.001 * round as f32), Rotation::IDENTITY);
            let contacts = contacts_of(&pose, &one, &two);
            let depth = crate::penetration_depth(&Pose::IDENTITY, &one, &pose, &two);
            if contacts.points.is_empty() {
                assert_eq!(depth, 0.0, "round {round}");
            }
            for point in &contacts.points {
                assert!(((point.p2 - point.p1).dot(contacts.normal) - point.separation).abs() < 1e-4, "{contacts:?}");
                // No point is deeper than the overlap along the normal.
                let overlap = -separation_along(&Pose::IDENTITY, &one, &pose, &two, contacts.normal);
                assert!(-point.separation <= overlap + 1e-4, "{contacts:?}, overlap {overlap}");
            }
            if depth > 0.0 {
                let overlap = -separation_along(&Pose::IDENTITY, &one, &pose, &two, contacts.normal);
                assert!(overlap <= 1.05 * depth + 0.002, "round {round}: along the normal {overlap}, depth {depth}");
            }
        }
    }
}
