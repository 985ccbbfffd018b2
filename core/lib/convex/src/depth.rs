//! Penetration depth of two shapes.
//!
//! The penetration depth of two convex shapes is the length of their minimum translation vector: the distance from the
//! origin to the boundary of their Minkowski difference. The expanding polytope here grows on a fine integer grid.
//!
//! The penetration depth of two compounds is the largest over pairs of their parts. The minimum translation of the
//! unions can be longer.

use crate::polytope::{GridPoint, GridPolytope, HullFace, directions};
use parry3d::bounding_volume::BoundingVolume;
use parry3d::math::{Pose, Vector};
use parry3d::query;
use parry3d::shape::{Compound, HalfSpace, Shape, SupportMap};

/// Grid steps from the origin to the farthest point of a Minkowski difference.
const STEPS: f32 = (1 << 19) as f32;

/// The polytope has reached the boundary when it grows by at most this distance, grid steps.
const CONVERGED: f64 = 2.0;

/// Maximum number of vertices that are added to the polytope.
const MAX_ITERATIONS: usize = 200;

/// Penetration depth of two shapes, in their unit; 0 if they do not touch.
///
/// Supports convex shapes, half-spaces and compounds of these. A triangle mesh has no interior: its depth is the depth
/// of parry's contact.
pub fn penetration_depth(pose1: &Pose, shape1: &dyn Shape, pose2: &Pose, shape2: &dyn Shape) -> f32 {
    match (shape1.as_shape::<Compound>(), shape2.as_shape::<Compound>()) {
        (Some(one), Some(two)) => {
            let two_from_one = pose2.inv_mul(pose1);
            let mut deepest = 0.0_f32;
            for (local, part) in one.shapes() {
                let bounds = part.compute_aabb(&(two_from_one * *local));
                for leaf in two.bvh().intersect_aabb(&bounds) {
                    let (other_local, other) = &two.shapes()[leaf as usize];
                    deepest = deepest.max(of_parts(&(*pose1 * *local), &**part, &(*pose2 * *other_local), &**other));
                }
            }
            deepest
        }
        (Some(one), None) => {
            let parts = one.shapes().iter();
            parts.map(|(local, part)| of_parts(&(*pose1 * *local), &**part, pose2, shape2)).fold(0.0, f32::max)
        }
        (None, Some(_)) => penetration_depth(pose2, shape2, pose1, shape1),
        (None, None) => of_parts(pose1, shape1, pose2, shape2),
    }
}

/// Penetration depth of two shapes that are not compounds.
fn of_parts(pose1: &Pose, shape1: &dyn Shape, pose2: &Pose, shape2: &dyn Shape) -> f32 {
    if !shape1.compute_aabb(pose1).intersects(&shape2.compute_aabb(pose2)) {
        return 0.0;
    }
    for (half_space, pose, other, other_pose) in [(shape1, pose1, shape2, pose2), (shape2, pose2, shape1, pose1)] {
        if let (Some(half_space), Some(map)) = (half_space.as_shape::<HalfSpace>(), other.as_support_map()) {
            let normal = pose.rotation * half_space.normal;
            let lowest = map.support_point(other_pose, -normal);
            return (pose.translation - lowest).dot(normal).max(0.0);
        }
    }
    match (shape1.as_support_map(), shape2.as_support_map()) {
        (Some(map1), Some(map2)) => {
            let separated = query::intersection_test(pose1, shape1, pose2, shape2).is_ok_and(|test| !test.intersecting);
            if separated { 0.0 } else { minimum_translation(pose1, map1, pose2, map2).map_or(0.0, |found| found.depth) }
        }
        _ => match query::contact(pose1, shape1, pose2, shape2, 0.0) {
            Ok(Some(contact)) => (-contact.dist).max(0.0),
            _ => 0.0,
        },
    }
}

/// The shortest translation that separates two intersecting convex shapes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MinimumTranslation {
    /// Length of the translation.
    pub depth: f32,
    /// Unit vector from the first to the second shape. Moving the second shape by `depth · normal` separates the
    /// shapes.
    pub normal: Vector,
}

/// The minimum translation vector of two convex shapes; `None` if they are apart.
pub fn minimum_translation<A, B>(pose1: &Pose, shape1: &A, pose2: &Pose, shape2: &B) -> Option<MinimumTranslation>
where
    A: SupportMap + ?Sized,
    B: SupportMap + ?Sized,
{
    let support_point = |normal: Vector| shape1.support_point(pose1, normal) - shape2.support_point(pose2, -normal);
    let unit = |direction: GridPoint| unit_vector(direction.map(|x| x as f64));
    let largest = directions().map(|d| support_point(unit(d)).abs().max_element()).fold(0.0, f32::max);
    let pitch = largest / STEPS;
    let support =
        |normal: Vector| -> GridPoint { support_point(normal).to_array().map(|x| (x / pitch).round() as i64) };
    let initial: Vec<GridPoint> = directions().map(|direction| support(unit(direction))).collect();
    let mut polytope = GridPolytope::new(&initial)?;
    initial.into_iter().for_each(|point| drop(polytope.insert(point)));
    // Distance from the origin, which is inside, to the plane of a face.
    let depth_of = |face: &HullFace| -face.distance([0; 3]);
    for _ in 0..MAX_ITERATIONS {
        let nearest = polytope.faces.iter().min_by(|a, b| depth_of(a).total_cmp(&depth_of(b)))?;
        let (depth, normal) = (depth_of(nearest), unit_vector(nearest.normal()));
        let next = support(normal);
        let growth = nearest.distance(next);
        if depth + growth <= 0.0 {
            return None;
        }
        if growth <= CONVERGED || polytope.insert(next).is_none() {
            let depth = (depth + growth.max(0.0)) as f32 * pitch;
            return (depth > 0.0).then_some(MinimumTranslation { depth, normal });
        }
    }
    let nearest = polytope
        .faces
        .iter()
        .map(|face| (depth_of(face), unit_vector(face.normal())))
        .min_by(|a, b| a.0.total_cmp(&b.0))?;
    let depth = -separation_along(pose1, shape1, pose2, shape2, nearest.1);
    (depth > 0.0).then_some(MinimumTranslation { depth, normal: nearest.1 })
}

fn unit_vector(direction: [f64; 3]) -> Vector {
    Vector::from(direction.map(|x| x as f32)).normalize()
}

/// Distance between two convex shapes along a unit vector from the first to the second; negative if their projections
/// onto it overlap.
pub fn separation_along<A, B>(pose1: &Pose, shape1: &A, pose2: &Pose, shape2: &B, normal: Vector) -> f32
where
    A: SupportMap + ?Sized,
    B: SupportMap + ?Sized,
{
    (shape2.support_point(pose2, -normal) - shape1.support_point(pose1, normal)).dot(normal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hull::{ConvexHull, HullOptions};
    use parry3d::math::Rotation;
    use parry3d::shape::{Ball, ConvexPolyhedron, SharedShape};
    use syntable_model::random::Stream;

    fn pose(x: f32, y: f32, z: f32) -> Pose {
        Pose::from_parts(Vector::new(x, y, z), Rotation::IDENTITY)
    }

    fn polyhedron(size: [f32; 3]) -> ConvexPolyhedron {
        let corners: Vec<[f32; 3]> =
            (0..8).map(|i| std::array::from_fn(|k| size[k] * if i >> k & 1 == 0 { -0.5 } else { 0.5 })).collect();
        ConvexHull::new(&corners, &HullOptions::METERS).expect("a hull").polyhedron(1.0).expect("closed")
    }

    fn random_pose(stream: &mut Stream) -> Pose {
        let [x, y, z, w] = stream.rotation().coords.into();
        let turn = Rotation::from_xyzw(x as f32, y as f32, z as f32, w as f32).normalize();
        let mut along = || stream.uniform(-0.5, 0.5) as f32;
        Pose::from_parts(Vector::new(along(), along(), along()), turn)
    }

    #[test]
    fn boxes_of_known_depth() {
        let (one, two) = (polyhedron([0.1, 0.1, 0.1]), polyhedron([0.06, 0.3, 0.04]));
        let mut stream = Stream::root(1);
        for _ in 0..50 {
            let wanted = stream.uniform(-0.01, 0.015) as f32;
            let anywhere = random_pose(&mut stream);
            let offset = pose(stream.uniform(-0.03, 0.03) as f32, 0.0, 0.05 + 0.02 - wanted);
            let got = penetration_depth(&anywhere, &one, &(anywhere * offset), &two);
            // The grid of hulls is 8 µm.
            assert!((got - wanted.max(0.0)).abs() < 1e-5, "{got}, not {wanted}");
            let swapped = penetration_depth(&(anywhere * offset), &two, &anywhere, &one);
            assert!((got - swapped).abs() < 2e-6, "{got} one way, {swapped} the other");
        }
    }

    #[test]
    fn crossing_edges() {
        // Two square bars rotated by 45° about their own axes, crossing at right angles: the edges touch,
        // and the minimum translation is vertical.
        let bar = polyhedron([0.4, 0.05, 0.05]);
        let half = std::f32::consts::FRAC_PI_8;
        let quarter = std::f32::consts::FRAC_PI_4;
        let rolled = Rotation::from_xyzw(half.sin(), 0.0, 0.0, half.cos());
        let across = Rotation::from_xyzw(0.0, 0.0, quarter.sin(), quarter.cos());
        let half_diagonal = 0.05 / 2.0_f32.sqrt();
        for wanted in [0.001, 0.004, 0.01] {
            let upper = Pose::from_parts(Vector::new(0.0, 0.0, 2.0 * half_diagonal - wanted), across * rolled);
            let got = penetration_depth(&Pose::from_parts(Vector::ZERO, rolled), &bar, &upper, &bar);
            assert!((got - wanted).abs() < 2e-5, "{got}, not {wanted}");
        }
    }

    #[test]
    fn matches_brute_force_over_many_directions() {
        // Brute force: 20,000 directions bound the depth from above and come close to it.
        let mut stream = Stream::root(2);
        let directions: Vec<Vector> =
            (0..20_000).map(|_| Vector::from(<[f64; 3]>::from(stream.direction()).map(|x| x as f32))).collect();
        let cloud = |stream: &mut Stream| {
            let points: Vec<[f32; 3]> =
                (0..20).map(|_| <[f64; 3]>::from(stream.direction()).map(|x| 0.05 * x as f32)).collect();
            ConvexHull::new(&points, &HullOptions::METERS).expect("a hull").polyhedron(1.0).expect("closed")
        };
        let mut touching = 0;
        for _ in 0..40 {
            let (one, two) = (cloud(&mut stream), cloud(&mut stream));
            let (a, b) = (random_pose(&mut stream), random_pose(&mut stream));
            let distance = stream.uniform(0.06, 0.11) as f32;
            let b = Pose::from_parts(a.translation + directions[touching] * distance, b.rotation);
            let got = penetration_depth(&a, &one, &b, &two);
            let extent = |pose: &Pose, shape: &ConvexPolyhedron, n: Vector| {
                shape.points().iter().map(|p| (*pose * *p).dot(n)).fold(f32::NEG_INFINITY, f32::max)
            };
            let brute =
                directions.iter().map(|&n| extent(&a, &one, n) + extent(&b, &two, -n)).fold(f32::INFINITY, f32::min);
            touching += usize::from(got > 0.0);
            // An angular error of δ costs at most size · δ; the nearest of 20,000 directions is within 0.04 rad.
            assert!(got <= brute.max(0.0) + 1e-6 && got >= brute - 0.003, "{got}, brute force {brute}");
        }
        assert!((10..40).contains(&touching), "{touching} of 40 pairs touch");
    }

    #[test]
    fn a_sphere_that_grazes_a_wide_slab_is_not_deep() {
        let sphere: Vec<[f32; 3]> = {
            let mut stream = Stream::root(3);
            (0..500).map(|_| <[f64; 3]>::from(stream.direction()).map(|x| 0.04 * x as f32)).collect()
        };
        let sphere = ConvexHull::new(&sphere, &HullOptions::METERS).expect("a hull").polyhedron(1.0).expect("closed");
        let slab = polyhedron([1.2, 0.8, 0.1]);
        let mut stream = Stream::root(4);
        for _ in 0..200 {
            let place = random_pose(&mut stream);
            let lowest = sphere.points().iter().map(|p| (place.rotation * *p).z).fold(f32::INFINITY, f32::min);
            let wanted = stream.uniform(-1e-5, 5e-4) as f32;
            let on_top = Pose::from_parts(
                Vector::new(place.translation.x * 0.9, place.translation.y * 0.7, 0.05 - lowest - wanted),
                place.rotation,
            );
            let got = penetration_depth(&on_top, &sphere, &pose(0.0, 0.0, 0.0), &slab);
            assert!((got - wanted.max(0.0)).abs() < 1e-5, "{got}, not {wanted}");
        }
    }

    #[test]
    fn half_spaces_and_compounds() {
        let floor = HalfSpace::new(Vector::Z);
        let cube = polyhedron([0.1; 3]);
        let sunk = penetration_depth(&pose(3.0, 0.0, 0.047), &cube, &pose(0.0, 0.0, 0.0), &floor);
        assert!((sunk - 0.003).abs() < 1e-5, "{sunk}");
        assert_eq!(penetration_depth(&pose(0.0, 0.0, 0.051), &Ball::new(0.05), &pose(0.0, 0.0, 0.0), &floor), 0.0);
        // A fork of two prongs over a bar: only one prong penetrates it.
        let prong = SharedShape::new(polyhedron([0.02, 0.02, 0.1]));
        let fork = Compound::new(vec![(pose(0.1, 0.0, 0.0), prong.clone()), (pose(-0.1, 0.0, 0.01), prong)]);
        let bar = polyhedron([1.0, 0.1, 0.1]);
        for (first, second) in [(true, false), (false, true)] {
            let (a, b) = (pose(0.0, 0.0, 0.1 - 0.004), pose(0.0, 0.0, 0.0));
            let bars = Compound::new(vec![(Pose::IDENTITY, SharedShape::new(bar.clone()))]);
            let other: &dyn Shape = if first { &bar } else { &bars };
            let got =
                if second { penetration_depth(&b, other, &a, &fork) } else { penetration_depth(&a, &fork, &b, other) };
            assert!((got - 0.004).abs() < 1e-5, "{got}");
        }
    }
}
