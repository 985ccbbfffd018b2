//! Poses in which a body rests on a plane, and their probabilities.

use crate::ConvexHull;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Triangles whose normals differ by less belong to one facet, radians.
const COPLANAR: f64 = 0.002;

/// Poses whose up directions differ by less are one pose, radians.
const SAME_POSE: f64 = 5.0 * PI / 180.0;

/// The least probable poses are left out as long as their probabilities add up to at most this.
const LEFT_OUT: f64 = 0.02;

/// Version of the algorithm: part of the key of cached poses. It rises whenever the same hull gives different poses.
pub const STABLE_VERSION: u32 = 1;

/// A pose in which a body rests on a level plane, up to its yaw.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StablePose {
    /// Unit vector, body frame, that points up in the pose.
    pub up: [f64; 3],
    /// Probability that the body comes to rest in the pose. The probabilities of all poses add up to 1.
    pub probability: f64,
    /// Smallest angle that tips the body over, radians.
    pub tipping: f64,
}

/// The stable poses of a body with a convex hull and a center of mass, most probable first.
///
/// The estimate is quasi-static (Goldberg, Mirtich, Zhuang, Craig, Carlisle and Canny, IEEE Trans. Robotics and Automation 15,
/// 1999): the body starts in a uniformly random orientation and lands on the facet below its center of mass, with the probability
/// of the facet's solid angle seen from there. It rolls over the edge that separates the center of mass from the center of the facet,
/// from facet to facet, until the center of mass is above the facet that it rests on.
///
/// Poses within 5° are one pose, the most probable of them. The least probable poses are left out up to a probability of 2 %, such as the
/// edges of a scanned box. The result is empty only for a hull without a volume.
pub fn stable_poses(hull: &ConvexHull, center_of_mass: [f64; 3]) -> Vec<StablePose> {
    let facets = Facet::all(hull, Vector3::from(center_of_mass));
    let mut resting: BTreeMap<usize, f64> = BTreeMap::new();
    for first in 0..facets.len() {
        let mut at = first;
        // The center of mass falls on the way. Where rounding says otherwise, the body stays.
        while let Some(next) = facets[at].rolls_to.filter(|&next| facets[next].height < facets[at].height) {
            at = next;
        }
        *resting.entry(at).or_default() += facets[first].solid_angle;
    }
    let total: f64 = resting.values().sum();
    let mut found: Vec<StablePose> = resting
        .into_iter()
        .map(|(facet, angle)| StablePose {
            up: (-facets[facet].normal).into(),
            probability: angle / total,
            tipping: facets[facet].tipping,
        })
        .collect();
    found.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    let mut poses: Vec<StablePose> = Vec::new();
    for pose in found {
        let is_same = |other: &&mut StablePose| angle(&Vector3::from(other.up), &Vector3::from(pose.up)) < SAME_POSE;
        match poses.iter_mut().find(is_same) {
            Some(same) => same.probability += pose.probability,
            None => poses.push(pose),
        }
    }
    poses.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    let mut left_out = 0.0;
    while poses.len() > 1 && poses.last().is_some_and(|last| left_out + last.probability <= LEFT_OUT) {
        left_out += poses.pop().map_or(0.0, |last| last.probability);
    }
    poses.iter_mut().for_each(|pose| pose.probability /= 1.0 - left_out);
    poses
}

/// A flat part of the surface of a hull.
struct Facet {
    /// Outward unit normal.
    normal: Vector3<f64>,
    /// Solid angle, seen from the center of mass, sr.
    solid_angle: f64,
    /// Height of the center of mass above it.
    height: f64,
    /// Smallest angle that tips the body over one of its edges, radians. Negative if the body does not rest on it.
    tipping: f64,
    /// The facet behind the edge that separates the center of mass from the center of this facet; none if the body rests on it.
    rolls_to: Option<usize>,
}

impl Facet {
    fn all(hull: &ConvexHull, center: Vector3<f64>) -> Vec<Self> {
        let at = |i: u32| Vector3::from(hull.points[i as usize].map(f64::from)) - center;
        let cross = |t: &[u32; 3]| (at(t[1]) - at(t[0])).cross(&(at(t[2]) - at(t[0])));
        let triangles: Vec<&[u32; 3]> = hull.triangles.iter().filter(|t| cross(t).norm() > 0.0).collect();
        let mut by_edge: BTreeMap<[u32; 2], usize> = BTreeMap::new();
        for (index, t) in triangles.iter().enumerate() {
            for side in 0..3 {
                by_edge.insert([t[side], t[(side + 1) % 3]], index);
            }
        }
        // Facets grow from their largest triangle, so that curved surfaces do not flow together.
        let mut order: Vec<usize> = (0..triangles.len()).collect();
        order.sort_by(|&a, &b| cross(triangles[b]).norm().total_cmp(&cross(triangles[a]).norm()));
        let mut facet_of: Vec<Option<usize>> = vec![None; triangles.len()];
        let mut members: Vec<Vec<usize>> = Vec::new();
        for first in order {
            if facet_of[first].is_some() {
                continue;
            }
            let normal = cross(triangles[first]);
            let (number, mut stack) = (members.len(), vec![first]);
            members.push(Vec::new());
            facet_of[first] = Some(number);
            while let Some(index) = stack.pop() {
                members[number].push(index);
                for side in 0..3 {
                    let (a, b) = (triangles[index][side], triangles[index][(side + 1) % 3]);
                    let Some(&next) = by_edge.get(&[b, a]) else { continue };
                    if facet_of[next].is_none() && angle(&cross(triangles[next]), &normal) < COPLANAR {
                        facet_of[next] = Some(number);
                        stack.push(next);
                    }
                }
            }
        }
        let facet = |(number, triangles_of): (usize, &Vec<usize>)| {
            let normal = triangles_of.iter().map(|&index| cross(triangles[index])).sum::<Vector3<f64>>().normalize();
            let height = at(triangles[triangles_of[0]][0]).dot(&normal);
            let area = |index: &usize| cross(triangles[*index]).norm();
            let middle = |index: &usize| triangles[*index].map(at).iter().sum::<Vector3<f64>>() / 3.0;
            let centroid = triangles_of.iter().map(|index| middle(index) * area(index)).sum::<Vector3<f64>>()
                / triangles_of.iter().map(area).sum::<f64>();
            // The center of mass is the origin: its direction from the centroid, along the facet.
            let towards = normal * height - centroid;
            let (mut distance, mut rolls_to) = (f64::INFINITY, None);
            for &index in triangles_of {
                for side in 0..3 {
                    let (a, b) = (triangles[index][side], triangles[index][(side + 1) % 3]);
                    let other = by_edge.get(&[b, a]).and_then(|&next| facet_of[next]);
                    if other == Some(number) {
                        continue;
                    }
                    let inwards = normal.cross(&(at(b) - at(a))).normalize();
                    distance = distance.min(-at(a).dot(&inwards));
                    // The edge is crossed on the way from the centroid to the center of mass.
                    let is_left_of = |from: Vector3<f64>, to: Vector3<f64>| from.cross(&to).dot(&normal) >= 0.0;
                    if is_left_of(at(a) - centroid, towards) && is_left_of(towards, at(b) - centroid) {
                        rolls_to = other;
                    }
                }
            }
            Self {
                normal,
                solid_angle: triangles_of.iter().map(|&index| solid_angle(triangles[index].map(at))).sum(),
                height,
                tipping: libm::atan2(distance, height),
                rolls_to: rolls_to.filter(|_| distance < 0.0),
            }
        };
        members.iter().enumerate().map(facet).collect()
    }
}

/// Solid angle of a triangle, seen from the origin, sr (Van Oosterom and Strackee, IEEE Trans. Biomedical Engineering 30, 1983).
fn solid_angle([a, b, c]: [Vector3<f64>; 3]) -> f64 {
    let [la, lb, lc] = [a.norm(), b.norm(), c.norm()];
    let below = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
    2.0 * libm::atan2(a.dot(&b.cross(&c)).abs(), below)
}

fn angle(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    libm::atan2(a.cross(b).norm(), a.dot(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::HullOptions;
    use syntable_model::random::Stream;

    fn cuboid(size: [f32; 3]) -> ConvexHull {
        let corners = (0..8).map(|i| std::array::from_fn(|k| size[k] * ((i >> k & 1) as f32 - 0.5)));
        ConvexHull::new(&corners.collect::<Vec<_>>(), &HullOptions::METERS).expect("a hull")
    }

    #[test]
    fn a_cuboid_rests_on_its_six_faces_by_their_solid_angles() {
        let [a, b, c] = [0.2_f64, 0.12, 0.06];
        let poses = stable_poses(&cuboid([a, b, c].map(|x| x as f32)), [0.0; 3]);
        // Solid angle of a rectangle of half sizes x, y at the distance z: 4 atan(x y / (z √(x² + y² + z²))).
        let share = |x: f64, y: f64, z: f64| {
            let corner = (x * x + y * y + z * z).sqrt() * z;
            4.0 * (x * y / corner).atan() / (4.0 * PI)
        };
        let want = [share(a, b, c), share(a, c, b), share(b, c, a)];
        assert_eq!(poses.len(), 6);
        for pose in poses {
            let axis = 2 - Vector3::from(pose.up).iamax().min(2);
            assert!((pose.probability - want[axis]).abs() < 1e-4, "{pose:?}, not {}", want[axis]);
            // It tips over the nearest edge: half the shorter side of the face against half its height.
            let (half, height) = [(b, c), (c, b), (c, a)][axis];
            assert!((pose.tipping - (half / height).atan()).abs() < 1e-3, "{pose:?}");
        }
    }

    #[test]
    fn a_weight_on_one_side_decides_where_a_body_tips() {
        // The center of mass is high and outside the small bottom of a wedge, so it never stands on it.
        let points = [
            [0.0, 0.0, 0.0],
            [0.02, 0.0, 0.0],
            [0.02, 0.1, 0.0],
            [0.0, 0.1, 0.0],
            [0.0, 0.0, 0.1],
            [0.2, 0.0, 0.1],
            [0.2, 0.1, 0.1],
            [0.0, 0.1, 0.1],
        ];
        let hull = ConvexHull::new(&points, &HullOptions::METERS).expect("a hull");
        let poses = stable_poses(&hull, [0.08, 0.05, 0.06]);
        assert!(poses.iter().all(|pose| pose.up[2] < 0.9), "{poses:?}");
        assert!((poses.iter().map(|pose| pose.probability).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(poses.iter().all(|pose| pose.tipping > 0.0));
    }

    /// Where a body ends that starts in a random orientation and always rolls over the edge or corner that lets its center of mass
    /// fall fastest, in small turns: brute force, without facets.
    fn rolled(points: &[Vector3<f64>], start: Vector3<f64>) -> Vector3<f64> {
        let mut down = start;
        // The lowest point carries the body. The body turns about it as long as its center of mass falls.
        for step in [1e-2, 1e-3, 1e-4] {
            loop {
                let height = |down: &Vector3<f64>| points.iter().map(|p| p.dot(down)).fold(f64::MIN, f64::max);
                let (here, side) = (height(&down), down.cross(&Vector3::x()).try_normalize(0.1));
                let side = side.unwrap_or_else(|| down.cross(&Vector3::y()).normalize());
                let other = down.cross(&side);
                let turns = (0..32).map(|i| f64::from(i) * PI / 16.0);
                let best = turns
                    .map(|t| (down + (side * t.cos() + other * t.sin()) * step).normalize())
                    .min_by(|a, b| height(a).total_cmp(&height(b)))
                    .expect("directions");
                if height(&best) >= here {
                    break;
                }
                down = best;
            }
        }
        down
    }

    #[test]
    fn probabilities_agree_with_rolling_random_bodies() {
        let mut stream = Stream::root(5);
        let mut difference = 0.0;
        for _ in 0..6 {
            let points: Vec<[f32; 3]> = (0..9)
                .map(|_| <[f64; 3]>::from(stream.direction()).map(|x| 0.1 * x as f32))
                .map(|[x, y, z]| [x, 0.6 * y, 0.8 * z])
                .collect();
            let hull = ConvexHull::new(&points, &HullOptions::METERS).expect("a hull");
            let all = hull.points.iter().fold(Vector3::zeros(), |sum, p| sum + Vector3::from(p.map(f64::from)));
            let center = all / hull.points.len() as f64;
            let poses = stable_poses(&hull, center.into());
            let corners: Vec<Vector3<f64>> =
                hull.points.iter().map(|p| Vector3::from(p.map(f64::from)) - center).collect();
            let (mut counts, runs) = (vec![0; poses.len()], 400);
            for _ in 0..runs {
                let end = rolled(&corners, Vector3::from(<[f64; 3]>::from(stream.direction())));
                let near = |pose: &StablePose| angle(&-Vector3::from(pose.up), &end);
                let nearest = (0..poses.len()).min_by(|&a, &b| near(&poses[a]).total_cmp(&near(&poses[b])));
                counts[nearest.expect("a pose")] += 1;
            }
            for (pose, count) in poses.iter().zip(counts) {
                difference += (pose.probability - f64::from(count) / f64::from(runs)).abs() / 12.0;
            }
        }
        // Half of the sum of differences is the share that ends elsewhere. The estimate rolls over one edge after the other, and
        // the brute force also over corners.
        assert!(difference < 0.12, "{difference}");
    }
}
