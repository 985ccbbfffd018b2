//! Compares hulls, penetration depths and contacts with parry, and with exhaustive search in f64, which is exact even
//! where parry is not.

use nalgebra::Vector3;
use parry3d::math::{Pose, Rotation, Vector};
use parry3d::query::{self, ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher};
use parry3d::shape::ConvexPolyhedron;
use parry3d::transformation::try_convex_hull;
use std::collections::BTreeSet;
use std::f64::consts::TAU;
use syntable_convex::{ConvexHull, HullOptions, minimum_translation, penetration_depth, polyhedron_contacts};
use syntable_model::random::Stream;

const OPTIONS: HullOptions = HullOptions::METERS;

fn direction(stream: &mut Stream) -> Vector3<f64> {
    Vector3::from(<[f64; 3]>::from(stream.direction()))
}

fn rotation(stream: &mut Stream) -> Rotation {
    let [x, y, z, w] = <[f64; 4]>::from(stream.rotation().coords).map(|x| x as f32);
    Rotation::from_xyzw(x, y, z, w).normalize()
}

fn on_sphere(stream: &mut Stream, count: usize, radius: f64) -> Vec<[f32; 3]> {
    (0..count).map(|_| <[f64; 3]>::from(direction(stream) * radius).map(|x| x as f32)).collect()
}

fn in_box(stream: &mut Stream, count: usize, size: [f64; 3]) -> Vec<[f32; 3]> {
    (0..count).map(|_| size.map(|edge| (edge * stream.uniform(-0.5, 0.5)) as f32)).collect()
}

fn lattice(n: i32, pitch: f32) -> Vec<[f32; 3]> {
    (0..n * n * n).map(|i| [i % n, i / n % n, i / n / n].map(|x| x as f32 * pitch)).collect()
}

fn cuboid(size: [f32; 3]) -> Vec<[f32; 3]> {
    lattice(2, 1.0).into_iter().map(|p| std::array::from_fn(|k| (p[k] - 0.5) * size[k])).collect()
}

fn prism(radius: f32, height: f32, sides: usize) -> Vec<[f32; 3]> {
    (0..sides)
        .map(|i| (i as f64 / sides as f64 * TAU).sin_cos())
        .flat_map(|(y, x)| [-0.5, 0.5].map(|z| [radius * x as f32, radius * y as f32, height * z]))
        .collect()
}

fn vector(p: [f32; 3]) -> Vector3<f64> {
    Vector3::from(p.map(f64::from))
}

/// Volume and area of a closed triangle mesh.
fn volume_and_area(points: &[[f32; 3]], triangles: &[[u32; 3]]) -> (f64, f64) {
    let corners = |t: &[u32; 3]| t.map(|i| vector(points[i as usize]));
    let volume = |t: &[u32; 3]| {
        let [a, b, c] = corners(t);
        a.dot(&b.cross(&c)) / 6.0
    };
    let area = |t: &[u32; 3]| {
        let [a, b, c] = corners(t);
        (b - a).cross(&(c - a)).norm() / 2.0
    };
    (triangles.iter().map(volume).sum(), triangles.iter().map(area).sum())
}

fn support(points: &[[f32; 3]], direction: Vector3<f64>) -> f64 {
    points.iter().map(|&p| vector(p).dot(&direction)).fold(f64::NEG_INFINITY, f64::max)
}

#[test]
fn hulls_agree_with_parry() {
    let mut stream = Stream::root(11);
    let exact = HullOptions { tolerance: 0.0, max_vertices: usize::MAX, ..OPTIONS };
    for round in 0..120 {
        let size = stream.uniform(0.02, 0.4);
        let count = stream.integer(6, 400) as usize;
        let points = match round % 3 {
            0 => on_sphere(&mut stream, count, size),
            1 => in_box(&mut stream, count, [size, 0.5 * size, 0.2 * size]),
            _ => [on_sphere(&mut stream, 40, 0.6 * size), in_box(&mut stream, count, [size; 3])].concat(),
        };
        let vectors: Vec<Vector> = points.iter().map(|&p| Vector::from(p)).collect();
        let (theirs, their_triangles) = try_convex_hull(&vectors).expect("points in general position");
        let theirs: Vec<[f32; 3]> = theirs.iter().map(|p| p.to_array()).collect();
        let (their_volume, area) = volume_and_area(&theirs, &their_triangles);
        let grid = f64::from(OPTIONS.grid);

        // The whole hull: vertices move by at most half a grid diagonal.
        let hull = ConvexHull::new(&points, &exact).expect("a hull");
        let (volume, _) = volume_and_area(&hull.points, &hull.triangles);
        assert!(
            (volume - their_volume).abs() <= area * grid + 1e-6 * their_volume,
            "{volume} m³, parry {their_volume}"
        );
        assert!((f64::from(hull.volume()) / volume - 1.0).abs() < 1e-4);
        for _ in 0..100 {
            let d = direction(&mut stream);
            let (ours, parrys) = (support(&hull.points, d), support(&theirs, d));
            assert!((ours - parrys).abs() <= grid, "support {ours}, parry {parrys}");
        }

        // The simplified hull is inside, and loses at most the tolerance.
        let hull = ConvexHull::new(&points, &OPTIONS).expect("a hull");
        let (volume, _) = volume_and_area(&hull.points, &hull.triangles);
        assert!(volume <= their_volume + area * grid, "{volume} m³, parry {their_volume}");
        if hull.points.len() < OPTIONS.max_vertices {
            let farthest = theirs.iter().map(|&p| hull.max_plane_distance(p)).fold(0.0, f32::max);
            assert!(farthest <= OPTIONS.tolerance + OPTIONS.grid, "{farthest} m outside");
        }
    }
}

#[test]
fn hulls_of_degenerate_points_agree_with_brute_force() {
    let mut stream = Stream::root(12);
    let noisy = |points: Vec<[f32; 3]>, noise: f64, stream: &mut Stream| -> Vec<[f32; 3]> {
        points.into_iter().map(|p| p.map(|x| x + stream.uniform(-noise, noise) as f32)).collect()
    };
    let disk: Vec<[f32; 3]> = prism(0.1, 0.02, 90);
    let repeated: Vec<[f32; 3]> = (0..40).flat_map(|_| cuboid([0.1, 0.2, 0.05])).collect();
    // (points, volume if known)
    let cases = [
        (lattice(5, 0.03125), Some(0.125_f64.powi(3))),
        (noisy(lattice(5, 0.03125), 1e-6, &mut stream), Some(0.125_f64.powi(3))),
        (noisy(lattice(6, 0.01), 1e-7, &mut stream), Some(0.05_f64.powi(3))),
        (repeated, Some(0.1 * 0.2 * 0.05)),
        (disk.clone(), Some(0.02 * 45.0 * 0.01 * (TAU / 90.0).sin())),
        (noisy([disk.clone(), disk].concat(), 1e-6, &mut stream), None),
        (noisy(cuboid([0.3, 0.2, 0.0015]), 1e-5, &mut stream), None),
    ];
    let exact = HullOptions { tolerance: 0.0, max_vertices: usize::MAX, ..OPTIONS };
    for (case, (points, known)) in cases.into_iter().enumerate() {
        let hull = ConvexHull::new(&points, &exact).expect("a hull");
        for _ in 0..500 {
            let d = direction(&mut stream);
            let (ours, brute) = (support(&hull.points, d), support(&points, d));
            assert!((ours - brute).abs() <= f64::from(OPTIONS.grid), "case {case}: support {ours}, not {brute}");
        }
        let (volume, area) = volume_and_area(&hull.points, &hull.triangles);
        if let Some(known) = known {
            assert!((volume - known).abs() <= area * f64::from(OPTIONS.grid), "case {case}: {volume} m³, not {known}");
        }
        let edges: Vec<(u32, u32)> = hull.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).collect();
        assert!(edges.iter().all(|&(a, b)| edges.iter().filter(|&&edge| edge == (b, a)).count() == 1), "case {case}");
    }
}

/// A hull with its exact geometry for exhaustive search.
struct HullCase {
    hull: ConvexHull,
    shape: ConvexPolyhedron,
}

impl HullCase {
    fn new(points: &[[f32; 3]]) -> Self {
        let hull = ConvexHull::new(points, &OPTIONS).expect("a hull");
        Self { shape: hull.polyhedron(1.0).expect("closed"), hull }
    }

    fn points(&self, pose: &Pose) -> Vec<Vector3<f64>> {
        let (shift, turn) = (vector(pose.translation.to_array()), turn(pose));
        self.hull.points.iter().map(|&p| turn * vector(p) + shift).collect()
    }

    fn normals(&self, pose: &Pose) -> Vec<Vector3<f64>> {
        let points = self.points(pose);
        let corners = |t: &[u32; 3]| t.map(|i| points[i as usize]);
        self.hull.triangles.iter().map(corners).map(|[a, b, c]| (b - a).cross(&(c - a)).normalize()).collect()
    }

    fn edges(&self, pose: &Pose) -> Vec<Vector3<f64>> {
        let points = self.points(pose);
        let pairs: BTreeSet<(u32, u32)> = self
            .hull
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
            .map(|(a, b)| (a.min(b), a.max(b)))
            .collect();
        pairs.into_iter().map(|(a, b)| points[b as usize] - points[a as usize]).collect()
    }
}

fn turn(pose: &Pose) -> nalgebra::UnitQuaternion<f64> {
    let [x, y, z, w] = pose.rotation.to_array().map(f64::from);
    nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z))
}

/// Overlap of the projections along a unit vector from the first to the second.
fn overlap(one: &[Vector3<f64>], two: &[Vector3<f64>], normal: Vector3<f64>) -> f64 {
    let highest = one.iter().map(|p| p.dot(&normal)).fold(f64::NEG_INFINITY, f64::max);
    let lowest = two.iter().map(|p| p.dot(&normal)).fold(f64::INFINITY, f64::min);
    highest - lowest
}

/// The exact penetration depth of two polytopes, 0 if separated: the minimum overlap along all normals of their
/// Minkowski difference, which are normals of faces and cross products of edges.
fn exact_depth(one: &HullCase, pose1: &Pose, two: &HullCase, pose2: &Pose) -> f64 {
    let (points1, points2) = (one.points(pose1), two.points(pose2));
    let edges2 = two.edges(pose2);
    let crosses = one.edges(pose1).into_iter().flat_map(|a| edges2.iter().map(move |b| a.cross(b)).collect::<Vec<_>>());
    let crosses = crosses.filter_map(|cross| cross.try_normalize(1e-9));
    let normals = one.normals(pose1).into_iter().chain(two.normals(pose2)).chain(crosses);
    let least = normals.map(|n| overlap(&points1, &points2, n).min(overlap(&points1, &points2, -n)));
    least.fold(f64::INFINITY, f64::min).max(0.0)
}

/// Results of a comparison: number of intersecting pairs, and number of these pairs for which parry gives the exact
/// depth.
#[derive(Debug, Default)]
struct DepthTally {
    intersecting: u32,
    parry_exact: u32,
}

/// Compares depth and normal of a pair with exhaustive search and with parry.
fn compare(one: &HullCase, pose1: &Pose, two: &HullCase, pose2: &Pose, tally: &mut DepthTally) {
    let exact = exact_depth(one, pose1, two, pose2);
    let (points1, points2) = (one.points(pose1), two.points(pose2));
    let extent = points1.iter().chain(&points2).map(|p| (p - points1[0]).norm()).fold(0.0, f64::max);
    let tolerance = 1e-5 * extent;
    let depth = f64::from(penetration_depth(pose1, &one.shape, pose2, &two.shape));
    assert!((depth - exact).abs() <= tolerance, "depth {depth}, exact {exact}, extent {extent}");
    let Some(found) = minimum_translation(pose1, &one.shape, pose2, &two.shape) else {
        return assert!(exact <= tolerance, "separated, but the exact depth is {exact}");
    };
    assert!((f64::from(found.depth) - exact).abs() <= tolerance, "{found:?}, exact {exact}, extent {extent}");
    let normal = vector(found.normal.to_array());
    assert!((normal.norm() - 1.0).abs() < 1e-6);
    assert!(overlap(&points1, &points2, normal) <= exact + tolerance, "{found:?} does not separate: {exact}");
    if exact <= tolerance {
        return;
    }
    tally.intersecting += 1;
    let Ok(Some(contact)) = query::contact(pose1, &one.shape, pose2, &two.shape, 0.0) else { return };
    if (f64::from(-contact.dist) - exact).abs() > 1e-3 * extent {
        return;
    }
    tally.parry_exact += 1;
    // If two directions are nearly equally short, either may be found.
    let theirs = vector(contact.normal1.to_array());
    let is_tie = overlap(&points1, &points2, theirs) <= exact + 2e-3 * extent;
    assert!(normal.angle(&theirs) < 0.02 || is_tie, "{normal:?}, parry {theirs:?}, exact {exact}");
}

#[test]
fn depths_and_normals_of_random_polytopes_agree_with_exhaustive_search_and_parry() {
    let mut stream = Stream::root(13);
    let body = |stream: &mut Stream| {
        let size = stream.uniform(0.2, 1.0);
        HullCase::new(&match stream.integer(0, 4) {
            0 => on_sphere(stream, 24, size / 2.0),
            1 => in_box(stream, 40, [size, 0.3 * size, 0.6 * size]),
            2 => prism(0.4 * size as f32, size as f32, 24),
            3 => cuboid([size as f32, 0.7 * size as f32, 0.008]),
            _ => cuboid([size as f32, 0.02, 0.02]),
        })
    };
    let mut tally = DepthTally::default();
    for _ in 0..400 {
        let (one, two) = (body(&mut stream), body(&mut stream));
        let anywhere = Vector::from(<[f64; 3]>::from(direction(&mut stream)).map(|x| x as f32));
        let pose1 = Pose::from_parts(anywhere * 0.5, rotation(&mut stream));
        let toward = Vector::from(<[f64; 3]>::from(direction(&mut stream)).map(|x| x as f32));
        let pose2 =
            Pose::from_parts(pose1.translation + toward * stream.uniform(0.0, 0.6) as f32, rotation(&mut stream));
        compare(&one, &pose1, &two, &pose2, &mut tally);
    }
    println!("{tally:?}");
    assert!(tally.intersecting >= 150, "{tally:?}");
    assert!(f64::from(tally.parry_exact) >= 0.8 * f64::from(tally.intersecting), "{tally:?}");
}

#[test]
fn depths_of_degenerate_pairs_are_exact() {
    let at = |x: f32, y: f32, z: f32| Pose::from_parts(Vector::new(x, y, z), Rotation::IDENTITY);
    let (cube, plate, slab) = (cuboid([0.5; 3]), cuboid([0.5, 0.5, 0.01]), cuboid([12.0, 8.0, 1.0]));
    let (needle, can, bead) = (cuboid([1.0, 0.01, 0.01]), prism(0.25, 0.5, 40), cuboid([0.05; 3]));
    let cases = [
        ("the same cube twice", &cube, &cube, at(0.0, 0.0, 0.0), 0.5),
        ("faces aligned", &cube, &cube, at(0.0, 0.0, 0.496), 0.004),
        ("faces touching", &cube, &cube, at(0.0, 0.0, 0.5), 0.0),
        ("edges touching", &cube, &cube, at(0.5, 0.0, 0.5), 0.0),
        ("vertices touching", &cube, &cube, at(0.5, 0.5, 0.5), 0.0),
        ("one inside the other", &cube, &bead, at(0.1, 0.0, 0.0), 0.175),
        ("plates in one plane", &plate, &plate, at(0.1, 0.1, 0.0), 0.01),
        ("plates side by side", &plate, &plate, at(0.498, 0.0, 0.0), 0.002),
        ("needles in a line", &needle, &needle, at(0.999, 0.0, 0.0), 0.001),
        ("a can on a slab", &slab, &can, at(2.0, -1.0, 0.749), 0.001),
        ("a plate in a slab", &slab, &plate, at(1.0, 1.0, 0.5), 0.005),
        ("apart", &slab, &can, at(2.0, -1.0, 0.751), 0.0),
    ];
    for (name, one, two, pose, expected) in cases {
        let (one, two) = (HullCase::new(one), HullCase::new(two));
        let exact = exact_depth(&one, &Pose::IDENTITY, &two, &pose);
        assert!((exact - expected).abs() < 2e-5, "{name}: exhaustive search gives {exact}, not {expected}");
        let mut stream = Stream::root(14);
        for _ in 0..5 {
            let world = Pose::from_parts(Vector::new(0.3, -0.2, 0.1), rotation(&mut stream));
            compare(&one, &world, &two, &(world * pose), &mut DepthTally::default());
            compare(&two, &(world * pose), &one, &world, &mut DepthTally::default());
        }
        compare(&one, &Pose::IDENTITY, &two, &pose, &mut DepthTally::default());
    }
}

#[test]
fn contacts_of_resting_boxes_agree_with_parry() {
    let mut stream = Stream::root(15);
    for _ in 0..200 {
        let size = |stream: &mut Stream| [0; 3].map(|_| stream.uniform(0.3, 1.5) as f32);
        let (size1, size2) = (size(&mut stream), size(&mut stream));
        let (one, two) = (HullCase::new(&cuboid(size1)), HullCase::new(&cuboid(size2)));
        // Tilted by up to 3°, and 0.1 % to 1 % deep or apart.
        let (axis, angle) = (direction(&mut stream), stream.uniform(0.0, 0.05));
        let tilt = nalgebra::UnitQuaternion::from_axis_angle(&nalgebra::Unit::new_normalize(axis), angle);
        let [x, y, z, w] = <[f64; 4]>::from(tilt.coords).map(|x| x as f32);
        let rotation = Rotation::from_xyzw(x, y, z, w).normalize();
        let lowest = two.hull.points.iter().map(|&p| (rotation * Vector::from(p)).z).fold(f32::INFINITY, f32::min);
        let gap = stream.uniform(-0.01, 0.01) as f32;
        let shift = [0, 1].map(|k| stream.uniform(-0.2, 0.2) as f32 * (size1[k] + size2[k]));
        let pose = Pose::from_parts(Vector::new(shift[0], shift[1], size1[2] / 2.0 - lowest + gap), rotation);
        let prediction = 0.05;
        let ours = polyhedron_contacts(&pose, &one.shape, &two.shape, prediction, None, 4e-4);
        let mut manifolds: Vec<ContactManifold<(), ()>> = Vec::new();
        DefaultQueryDispatcher
            .contact_manifolds(&pose, &one.shape, &two.shape, prediction, &mut manifolds, &mut None)
            .expect("supported");
        let exact = exact_depth(&one, &Pose::IDENTITY, &two, &pose);
        let deepest = ours.points.iter().map(|point| point.separation).fold(f32::INFINITY, f32::min);
        let points1 = one.points(&Pose::IDENTITY);
        let along = -overlap(&points1, &two.points(&pose), vector(ours.normal.to_array()));
        if exact > 1e-4 {
            // The normal is the direction of the minimum translation, and the deepest point has its depth.
            assert!((-along - exact).abs() < 1e-3, "{ours:?}: {along} along the normal, exact depth {exact}");
        }
        assert!(!ours.points.is_empty() && ours.points.len() <= 4, "{ours:?}");
        assert!((f64::from(deepest) - along).abs() < 2e-3, "{ours:?}: deepest {deepest}, along the normal {along}");
        let theirs = manifolds.iter().flat_map(|m| m.points.iter().map(move |point| (m.local_n1, point.dist)));
        let Some((their_normal, their_deepest)) = theirs.min_by(|a, b| a.1.total_cmp(&b.1)) else {
            panic!("parry finds no contact where there is one: {ours:?}");
        };
        assert!(ours.normal.dot(their_normal) > 0.998, "{ours:?}, parry {their_normal:?}");
        assert!((deepest - their_deepest).abs() < 5e-3, "{ours:?}, parry {their_deepest}");
    }
}

#[test]
fn the_hulls_of_this_version_are_pinned() {
    let mut stream = Stream::root(16);
    let mut hasher = syntable_model::digest::Hasher::new("hulls");
    for round in 0..40 {
        let points = match round % 4 {
            0 => on_sphere(&mut stream, 600, 0.1),
            1 => in_box(&mut stream, 80, [0.3, 0.1, 0.02]),
            2 => in_box(&mut stream, 20, [0.1, 0.1, 0.0]),
            _ => lattice(4, 0.01),
        };
        let hull = ConvexHull::new(&points, &OPTIONS).expect("a hull");
        let points: Vec<f32> = hull.points.iter().flatten().copied().collect();
        let indices: Vec<u8> = hull.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
        hasher = hasher.floats(points.into_iter()).bytes(&indices);
    }
    let found = (syntable_convex::HULL_VERSION, hasher.finish().to_string());
    assert_eq!(
        (found.0, &found.1[..]),
        (1, "b7d83197a20644bf0f2c0da19ca8e38a"),
        "other hulls than before: raise HULL_VERSION and pin them"
    );
}
