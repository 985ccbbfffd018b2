//! Contact points between convex polyhedra.
//!
//! The engine's own generator looks at four vertices of a face, the first four: on the round bottom of a can they span
//! a sliver, so that the can stands on one side only, tilts, and trembles for good. Here whole faces are clipped
//! against each other and the points are thinned to the four that matter (as in Bullet and Box2D). The normal comes
//! from the Gilbert-Johnson-Keerthi and expanding polytope algorithms; when bodies are in each other it is checked, and
//! replaced by a dependable one where it is bad.

use crate::depth::{gap, way_out};
use crate::units;
use parry3d::math::{Pose, Vector};
use parry3d::query::details::{ShapeCastOptions, contact_support_map_support_map_with_params};
use parry3d::query::gjk::{GJKResult, VoronoiSimplex};
use parry3d::query::{
    ClosestPoints, Contact, ContactManifold, ContactManifoldsWorkspace, NonlinearRigidMotion,
    PersistentQueryDispatcher, QueryDispatcher, ShapeCastHit, TrackedContact, Unsupported,
};
use parry3d::shape::{ConvexPolyhedron, HalfSpace, PackedFeatureId, Shape};

/// Contacts are recomputed when the normals have turned against each other by more than this, cos 1°.
const TURNED: f32 = 0.999_848;

/// Contacts are recomputed when they have slid by more than this, engine units (1 mm).
const SLID: f32 = 0.001 * units::PER_METRE;

/// Old impulses go to new contacts this close, engine units (2 mm).
const SAME: f32 = 0.002 * units::PER_METRE;

/// A face takes part as a whole if its normal is this close to the contact normal, cos 20°.
const FACING: f32 = 0.94;

/// The normal of the last step stays if it is worse by less than this, engine units (0.05 mm).
const LOYALTY: f32 = 5e-5 * units::PER_METRE;

/// Makes the contacts of polyhedra with polyhedra and half-spaces; leaves all else to the engine.
pub struct Polyhedra;

impl<M: Default + Clone, C: Default + Copy> PersistentQueryDispatcher<M, C> for Polyhedra {
    fn contact_manifolds(
        &self,
        pos12: &Pose,
        g1: &dyn Shape,
        g2: &dyn Shape,
        prediction: f32,
        manifolds: &mut Vec<ContactManifold<M, C>>,
        _: &mut Option<ContactManifoldsWorkspace>,
    ) -> Result<(), Unsupported> {
        let (solid1, solid2) = (g1.as_convex_polyhedron(), g2.as_convex_polyhedron());
        let find: &dyn Fn(Option<Vector>) -> Found = match (solid1, solid2, g1.as_halfspace(), g2.as_halfspace()) {
            (Some(one), Some(two), ..) => &|before| between(pos12, one, two, prediction, before),
            (_, Some(two), Some(plane), _) => &|_| on_plane(pos12, plane, two, prediction),
            (Some(one), _, _, Some(plane)) => {
                &|_| on_plane(&pos12.inverse(), plane, one, prediction).seen_from_the_other(pos12)
            }
            _ => return Err(Unsupported),
        };
        if manifolds.is_empty() {
            manifolds.push(ContactManifold::new());
        }
        let manifold = &mut manifolds[0];
        if manifold.try_update_contacts_eps(pos12, TURNED, SLID * SLID) {
            return Ok(());
        }
        let old = std::mem::take(&mut manifold.points);
        let found = find(manifold.local_n1.try_normalize());
        let turn_back = pos12.rotation.inverse();
        manifold.local_n1 = found.normal;
        manifold.local_n2 = turn_back * -found.normal;
        manifold.points.extend(found.points.iter().map(|point| {
            let p2 = pos12.inverse_transform_point(point.p2);
            TrackedContact::new(point.p1, p2, PackedFeatureId::UNKNOWN, PackedFeatureId::UNKNOWN, point.gap)
        }));
        manifold.match_contacts_using_positions(&old, SAME);
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

/// Contacts of two bodies in the frame of the first.
#[derive(Debug, Default)]
struct Found {
    /// From the first to the second. Without points: a direction that parts them, to start from the next time.
    normal: Vector,
    points: Vec<Touch>,
}

/// A pair of points, one on each body, on a line along the normal.
#[derive(Debug, Clone, Copy)]
struct Touch {
    p1: Vector,
    p2: Vector,
    /// From p1 to p2 along the normal; negative where the bodies are in each other.
    gap: f32,
}

impl Found {
    /// The same contacts with the bodies swapped. `pos12` is the pose of the new second body in the new first one.
    fn seen_from_the_other(self, pos12: &Pose) -> Self {
        let swap = |touch: Touch| Touch { p1: *pos12 * touch.p2, p2: *pos12 * touch.p1, gap: touch.gap };
        Self { normal: pos12.rotation * -self.normal, points: self.points.into_iter().map(swap).collect() }
    }
}

/// Contacts of a polyhedron with a half-space.
fn on_plane(pos12: &Pose, plane: &HalfSpace, solid: &ConvexPolyhedron, prediction: f32) -> Found {
    let normal = plane.normal;
    let touch = |p: &Vector| {
        let p2 = *pos12 * *p;
        let gap = p2.dot(normal);
        Touch { p1: p2 - normal * gap, p2, gap }
    };
    let near = solid.points().iter().map(touch).filter(|touch| touch.gap <= prediction).collect();
    Found { normal, points: thinned(near, normal) }
}

/// Contacts of two polyhedra. `before` is the normal of the last step.
fn between(
    pos12: &Pose,
    one: &ConvexPolyhedron,
    two: &ConvexPolyhedron,
    prediction: f32,
    before: Option<Vector>,
) -> Found {
    let gap_along = |normal: Vector| gap(&Pose::IDENTITY, one, pos12, two, normal);
    let mut simplex = VoronoiSimplex::new();
    let nearest = contact_support_map_support_map_with_params(pos12, one, two, prediction, &mut simplex, before);
    let (mut normal, mut witness) = match nearest {
        GJKResult::ClosestPoints(p1, p2, normal) => (normal, Some(Touch { p1, p2, gap: (p2 - p1).dot(normal) })),
        GJKResult::NoIntersection(apart) if gap_along(apart) > 0.0 => {
            return Found { normal: apart, points: Vec::new() };
        }
        _ => (Vector::ZERO, None),
    };
    if witness.is_none_or(|witness| witness.gap < 0.0) {
        // In each other: the best of the direction that was found, the last one, and, if the former is not even what
        // it claims to be, the dependable one.
        let claimed = witness.map_or(f32::NEG_INFINITY, |witness| witness.gap);
        let mut best = if normal == Vector::ZERO { f32::NEG_INFINITY } else { gap_along(normal) };
        let is_bad = best < claimed - LOYALTY || claimed == f32::NEG_INFINITY;
        let mut take = |candidate: Vector, margin: f32| {
            let gap = gap_along(candidate);
            if gap > best + margin {
                (normal, best, witness) = (candidate, gap, None);
            }
        };
        if let Some(before) = before {
            take(before, -LOYALTY);
        }
        if is_bad && let Some((_, direction)) = way_out(&Pose::IDENTITY, one, pos12, two) {
            take(direction, 0.0);
        }
        if normal == Vector::ZERO {
            return Found::default();
        }
        if best > prediction {
            return Found { normal, points: Vec::new() };
        }
    }
    let mut points = clipped(pos12, one, two, normal, prediction);
    if points.is_empty() {
        // An edge on an edge, or a corner.
        points.extend(witness.or_else(|| {
            let p2 = *pos12 * support(two, pos12.rotation.inverse() * -normal);
            let gap = gap_along(normal);
            (gap <= prediction).then_some(Touch { p1: p2 - normal * gap, p2, gap })
        }));
    }
    Found { normal, points: thinned(points, normal) }
}

fn support(solid: &ConvexPolyhedron, direction: Vector) -> Vector {
    let farther = |a: &&Vector, b: &&Vector| a.dot(direction).total_cmp(&b.dot(direction));
    solid.points().iter().max_by(farther).copied().unwrap_or_default()
}

/// A face: its outward normal, its middle and its corners.
struct Polygon {
    normal: Vector,
    middle: Vector,
    corners: Vec<Vector>,
    /// Cosine between its normal and the direction it was asked for.
    facing: f32,
}

impl Polygon {
    /// The face of a polyhedron that looks most along a direction, moved to a pose.
    fn of(solid: &ConvexPolyhedron, pose: &Pose, direction: Vector) -> Option<Self> {
        let local = pose.rotation.inverse() * direction;
        let face = solid.faces().iter().max_by(|a, b| a.normal.dot(local).total_cmp(&b.normal.dot(local)))?;
        let first = face.first_vertex_or_edge as usize;
        let ids = solid.vertices_adj_to_face().get(first..first + face.num_vertices_or_edges as usize)?;
        let corners: Vec<Vector> = ids.iter().map(|&i| *pose * solid.points()[i as usize]).collect();
        // Faces of nearly the same direction were merged, so that the corners need not lie in one plane (Newell).
        let middle = corners.iter().sum::<Vector>() / corners.len() as f32;
        let next = corners.iter().cycle().skip(1);
        let doubled = corners.iter().zip(next).map(|(p, q)| (*p - middle).cross(*q - middle)).sum::<Vector>();
        let along = pose.rotation * face.normal;
        let normal = doubled.try_normalize().map_or(along, |mean| if mean.dot(along) < 0.0 { -mean } else { mean });
        Some(Self { normal, middle, corners, facing: normal.dot(direction) })
    }

    /// Distance from a point to the plane of the face along a direction.
    fn distance_along(&self, from: Vector, direction: Vector) -> f32 {
        (self.middle - from).dot(self.normal) / direction.dot(self.normal)
    }
}

/// The facing faces clipped against each other; nothing if they do not face each other.
fn clipped(
    pos12: &Pose,
    one: &ConvexPolyhedron,
    two: &ConvexPolyhedron,
    normal: Vector,
    prediction: f32,
) -> Vec<Touch> {
    let faces = Polygon::of(one, &Pose::IDENTITY, normal).zip(Polygon::of(two, pos12, -normal));
    let Some((face1, face2)) = faces else { return Vec::new() };
    if face1.facing.max(face2.facing) < FACING || face1.facing.min(face2.facing) < 0.1 {
        return Vec::new();
    }
    // The one that looks straight at the other cuts; corners of the other are what touches.
    let first_cuts = face1.facing >= face2.facing - 1e-3;
    let (cutting, cut) = if first_cuts { (&face1, &face2) } else { (&face2, &face1) };
    // No two points of the bodies are deeper than the bodies.
    let least = gap(&Pose::IDENTITY, one, pos12, two, normal);
    let touch = |p: Vector| {
        let away = cutting.distance_along(p, normal);
        let gap = if first_cuts { -away } else { away }.max(least);
        if first_cuts { Touch { p1: p - normal * gap, p2: p, gap } } else { Touch { p1: p, p2: p + normal * gap, gap } }
    };
    clip(&cut.corners, &cutting.corners, normal)
        .into_iter()
        .map(touch)
        .filter(|touch| touch.gap <= prediction)
        .collect()
}

/// Sutherland and Hodgman: what is left of a polygon inside the sides of a convex one, both seen along a normal.
fn clip(subject: &[Vector], convex: &[Vector], normal: Vector) -> Vec<Vector> {
    let doubled_area: f32 = (1..convex.len().saturating_sub(1))
        .map(|i| (convex[i] - convex[0]).cross(convex[i + 1] - convex[0]).dot(normal))
        .sum();
    let up = if doubled_area >= 0.0 { normal } else { -normal };
    let mut left = subject.to_vec();
    for (i, &from) in convex.iter().enumerate() {
        let to = convex[(i + 1) % convex.len()];
        let Some(inward) = up.cross(to - from).try_normalize() else { continue };
        let inside = |p: Vector| (p - from).dot(inward);
        let mut next = Vec::with_capacity(left.len() + 2);
        for (j, &p) in left.iter().enumerate() {
            let q = left[(j + 1) % left.len()];
            let (a, b) = (inside(p), inside(q));
            if a >= 0.0 {
                next.push(p);
            }
            if (a >= 0.0) != (b >= 0.0) {
                next.push(p + (q - p) * (a / (a - b)));
            }
        }
        left = next;
    }
    left
}

/// At most four of the points: the deepest, the one farthest from it, and the outermost on either side of these two.
fn thinned(points: Vec<Touch>, normal: Vector) -> Vec<Touch> {
    if points.len() <= 4 {
        return points;
    }
    let most =
        |measure: &dyn Fn(&Touch) -> f32| points.iter().max_by(|a, b| measure(a).total_cmp(&measure(b))).copied();
    let Some(deepest) = most(&|touch| -touch.gap) else { return points };
    let Some(far) = most(&|touch| (touch.p1 - deepest.p1).length_squared()) else { return points };
    let side = normal.cross(far.p1 - deepest.p1);
    let aside = |touch: &Touch| (touch.p1 - deepest.p1).dot(side);
    let mut chosen = vec![deepest, far];
    chosen.extend(most(&aside).filter(|touch| aside(touch) > 0.0));
    chosen.extend(most(&|touch| -aside(touch)).filter(|touch| aside(touch) < 0.0));
    chosen
}

impl QueryDispatcher for Polyhedra {
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
    use crate::hull::Hull;
    use parry3d::math::Rotation;
    use syntable_model::random::Stream;

    fn polyhedron(points: &[[f32; 3]]) -> ConvexPolyhedron {
        Hull::around(points).expect("a hull").polyhedron(1.0).expect("closed")
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

    fn found(pos12: &Pose, one: &ConvexPolyhedron, two: &ConvexPolyhedron) -> Found {
        between(pos12, one, two, 0.05, None)
    }

    fn at(x: f32, y: f32, z: f32) -> Pose {
        Pose::from_parts(Vector::new(x, y, z), Rotation::IDENTITY)
    }

    /// Half the area spanned by the points, seen along z.
    fn spread(found: &Found) -> f32 {
        let mut points: Vec<[f64; 2]> = found.points.iter().map(|p| [f64::from(p.p1.x), f64::from(p.p1.y)]).collect();
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
    fn a_can_stands_on_its_whole_bottom() {
        let (table, can) = (cuboid([12.0, 8.0, 1.0]), cylinder(0.35, 1.0, 40));
        for depth in [-0.01, 0.0, 0.002, 0.02] {
            for (x, y) in [(0.0, 0.0), (2.0, -1.5), (5.0, 3.0)] {
                let found = found(&at(x, y, 1.0 - depth), &table, &can);
                assert!((found.normal - Vector::Z).length() < 1e-4, "{found:?}");
                assert!(found.points.iter().all(|point| (point.gap + depth).abs() < 1e-4), "{found:?}");
                assert!(found.points.len() == 4 && spread(&found) > 0.9 * 0.7 * 0.7 / 2.0, "{found:?}");
            }
        }
    }

    #[test]
    fn a_box_on_a_round_table_stands_on_four_corners() {
        let (table, cube) = (cylinder(5.0, 1.0, 64), cuboid([0.6; 3]));
        for (x, y) in [(0.0, 0.0), (3.0, 3.0), (-4.0, 1.0)] {
            for (one, two, sign) in [(&table, &cube, 1.0), (&cube, &table, -1.0)] {
                let pose = at(sign * x, sign * y, sign * (0.8 - 0.001));
                let found = found(&pose, one, two);
                assert!((found.normal - Vector::Z * sign).length() < 1e-3, "{found:?}");
                assert!(found.points.len() == 4 && (spread(&found) - 0.36).abs() < 1e-3, "{found:?}");
            }
        }
    }

    #[test]
    fn boxes_overhang_and_edges_cross() {
        let cube = cuboid([1.0; 3]);
        let found = found(&at(0.7, 0.2, 0.999), &cube, &cube);
        assert!((spread(&found) - 0.3 * 0.8).abs() < 1e-3, "{found:?}");
        // Two bars on their edges, crossing: one point, straight up.
        let bar = cuboid([4.0, 0.5, 0.5]);
        let (half, quarter) = (std::f32::consts::FRAC_PI_8, std::f32::consts::FRAC_PI_4);
        let rolled = Rotation::from_xyzw(half.sin(), 0.0, 0.0, half.cos());
        let across = Rotation::from_xyzw(0.0, 0.0, quarter.sin(), quarter.cos());
        let lower = Pose::from_parts(Vector::ZERO, rolled);
        let upper = Pose::from_parts(Vector::new(0.0, 0.0, 0.5_f32.sqrt() - 0.01), across * rolled);
        let found = between(&lower.inv_mul(&upper), &bar, &bar, 0.05, None);
        assert_eq!(found.points.len(), 1, "{found:?}");
        assert!((rolled * found.normal - Vector::Z).length() < 1e-2, "{found:?}");
        assert!((found.points[0].gap + 0.01).abs() < 1e-3, "{found:?}");
    }

    #[test]
    fn a_half_space_sees_the_lowest_corners() {
        let (plane, can) = (HalfSpace::new(Vector::Z), cylinder(0.35, 1.0, 40));
        let found = on_plane(&at(3.0, 0.0, 0.499), &plane, &can, 0.05);
        assert!(found.points.len() == 4 && spread(&found) > 0.2, "{found:?}");
        let pos12 = at(3.0, 0.0, 0.499).inverse();
        let other = on_plane(&pos12.inverse(), &plane, &can, 0.05).seen_from_the_other(&pos12);
        assert!((other.normal + Vector::Z).length() < 1e-6, "{other:?}");
        for point in &other.points {
            assert!((point.p1.z + 0.5).abs() < 1e-5 && (point.gap + 0.001).abs() < 1e-5, "{other:?}");
            assert!(((point.p2 - point.p1).dot(other.normal) - point.gap).abs() < 1e-6, "{other:?}");
        }
    }

    #[test]
    fn points_lie_on_both_bodies_and_bound_the_depth() {
        let mut stream = Stream::root(5);
        let mut random = |radius: f64| <[f64; 3]>::from(stream.direction() * radius).map(|x| x as f32);
        for round in 0..200 {
            let one = polyhedron(&(0..30).map(|_| random(0.5)).collect::<Vec<_>>());
            let two = polyhedron(&(0..30).map(|_| random(0.5)).collect::<Vec<_>>());
            let toward = Vector::from(random(1.0));
            let pose = Pose::from_parts(toward * (0.8 + 0.001 * round as f32), Rotation::IDENTITY);
            let found = between(&pose, &one, &two, 0.05, None);
            let depth = crate::depth::depth(&Pose::IDENTITY, &one, &pose, &two);
            if found.points.is_empty() {
                assert_eq!(depth, 0.0, "round {round}");
            }
            for touch in &found.points {
                assert!(((touch.p2 - touch.p1).dot(found.normal) - touch.gap).abs() < 1e-4, "{found:?}");
                // No point is deeper than the overlap along the normal.
                let overlap = -gap(&Pose::IDENTITY, &one, &pose, &two, found.normal);
                assert!(-touch.gap <= overlap + 1e-4, "{found:?}, overlap {overlap}");
            }
            if depth > 0.0 {
                let overlap = -gap(&Pose::IDENTITY, &one, &pose, &two, found.normal);
                assert!(overlap <= 1.05 * depth + 0.002, "round {round}: along the normal {overlap}, depth {depth}");
            }
        }
    }
}
