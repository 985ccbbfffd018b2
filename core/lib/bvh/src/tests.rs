//! Results compared with brute force, with closed forms, and with each other.

use std::sync::Arc;
use syntable_simd::{Processor, Simd, Task};

use super::{
    Affine, Hit, IDENTITY, Instance, MeshBvh, Ray, SceneBvh,
    ray::{BAND, Line, columns, invert},
    walk::{self, Candidate, Sink},
    wide::{Leaf, MAX_DEPTH},
};

const FAR: f32 = f32::INFINITY;

/// SplitMix64.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ z >> 31) >> 40) as f32 / (1 << 24) as f32
    }

    fn signed(&mut self) -> f32 {
        2.0 * self.unit() - 1.0
    }

    fn point(&mut self, size: f32) -> [f32; 3] {
        [self.signed() * size, self.signed() * size, self.signed() * size]
    }

    fn ray(&mut self, size: f32) -> Ray {
        let (origin, target) = (self.point(2.0 * size), self.point(size));
        Ray { origin, direction: [0, 1, 2].map(|a| target[a] - origin[a]) }
    }

    /// A random rotation, scale, shear and shift.
    fn affine(&mut self) -> Affine {
        let mut m = IDENTITY;
        for (r, row) in m.iter_mut().enumerate() {
            for (c, x) in row.iter_mut().enumerate() {
                *x = 0.6 * self.signed() + if r == c { 1.2 } else { 0.0 };
            }
        }
        m
    }
}

#[derive(Clone)]
struct Soup {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Soup {
    fn random(random: &mut Random, count: usize, size: f32) -> Self {
        let mut soup = Self { positions: Vec::new(), triangles: Vec::new() };
        for number in 0..count as u32 {
            let center = random.point(1.0);
            for _ in 0..3 {
                let offset = random.point(size);
                soup.positions.push([0, 1, 2].map(|a| center[a] + offset[a]));
            }
            soup.triangles.push([3 * number, 3 * number + 1, 3 * number + 2]);
        }
        soup
    }

    fn tree(&self) -> Arc<MeshBvh> {
        let tree = MeshBvh::build(&self.positions, &self.triangles);
        tree.validate();
        Arc::new(tree)
    }

    fn scene(&self) -> SceneBvh {
        scene(&[(self.clone(), IDENTITY)])
    }
}

fn scene(parts: &[(Soup, Affine)]) -> SceneBvh {
    let scene = SceneBvh::build(parts.iter().zip(100..).map(|((soup, place), id)| Instance {
        world_from_object: *place,
        mesh: soup.tree(),
        id,
    }));
    scene.validate();
    scene
}

struct Best(Option<Candidate>);

impl Sink for Best {
    fn limit(&self) -> f32 {
        FAR
    }
    fn offer(&mut self, hit: Candidate) -> bool {
        if self.0.is_none_or(|best| hit.t < best.t) {
            self.0 = Some(hit);
        }
        false
    }
}

/// The nearest triangle of one instance, by the same triangle test without a tree.
fn brute(soup: &Soup, place: &Affine, ray: &Ray, from: f32) -> Option<Candidate> {
    struct Brute<'a>(&'a Soup, &'a Affine, &'a Ray, f32);
    impl Task for Brute<'_> {
        type Output = Option<Candidate>;
        fn run<S: Simd>(self) -> Option<Candidate> {
            let Self(soup, place, ray, from) = self;
            let line = Line::<S::Wide>::new(ray).seen_from(&columns(&invert(place)?));
            let (_, shear) = line.aim(0.0, BAND)?;
            let mut best = Best(None);
            for (number, triangle) in soup.triangles.iter().enumerate() {
                let mut leaf = Leaf::EMPTY;
                leaf.set(0, &triangle.map(|i| soup.positions[i as usize]), number as u32);
                walk::leaf::<S::Wide>(&leaf, &shear, from, from, &mut best);
            }
            best.0
        }
    }
    Processor::portable().run(Brute(soup, place, ray, from))
}

/// Möller and Trumbore in `f64`: distance, and the distance from the nearest edge as a weight.
fn reference(soup: &Soup, triangle: usize, ray: &Ray) -> (f64, f64) {
    let [a, b, c] = soup.triangles[triangle].map(|i| soup.positions[i as usize].map(f64::from));
    let (o, d) = (ray.origin.map(f64::from), ray.direction.map(f64::from));
    let sub = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|i| a[i] - b[i]);
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let cross =
        |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]);
    let (e1, e2, s) = (sub(b, a), sub(c, a), sub(o, a));
    let (p, q) = (cross(d, e2), cross(s, e1));
    let det = dot(e1, p);
    let (u, v) = (dot(s, p) / det, dot(d, q) / det);
    (dot(e2, q) / det, u.min(v).min(1.0 - u - v))
}

/// A closed ball of `rows × columns` quads, poles welded.
fn ball(rows: u32, columns: u32) -> Soup {
    let mut positions = vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    let mut triangles = Vec::new();
    let at = |row: u32, column: u32| match row {
        0 => 0,
        row if row == rows => 1,
        row => 2 + (row - 1) * columns + column % columns,
    };
    for row in 1..rows {
        for column in 0..columns {
            let (s, z) = (std::f32::consts::PI * row as f32 / rows as f32).sin_cos();
            let (y, x) = (std::f32::consts::TAU * column as f32 / columns as f32).sin_cos();
            positions.push([s * x, s * y, z]);
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let [a, b] = [at(row, column), at(row, column + 1)];
            let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
            triangles.extend([[a, b, d], [a, d, c]].iter().filter(|t| t[0] != t[1] && t[1] != t[2]));
        }
    }
    Soup { positions, triangles }
}

fn one(corners: [[f32; 3]; 3]) -> Soup {
    Soup { positions: corners.to_vec(), triangles: vec![[0, 1, 2]] }
}

fn ray(origin: [f32; 3], direction: [f32; 3]) -> Ray {
    Ray { origin, direction }
}

fn shifted(x: f32, y: f32, z: f32) -> Affine {
    let mut m = IDENTITY;
    (m[0][3], m[1][3], m[2][3]) = (x, y, z);
    m
}

const CORNER: [[f32; 3]; 3] = [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0]];

/// A point moved by the rows of a 3×4 matrix.
fn moved(m: &super::Affine, p: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|r| m[r][0] * p[0] + m[r][1] * p[1] + m[r][2] * p[2] + m[r][3])
}

#[test]
fn one_triangle_on_paper() {
    let scene = one(CORNER).scene();
    let hit = scene.closest(&ray([0.25, 0.5, 0.0], [0.0, 0.0, 2.0]), 0.0, FAR);
    assert_eq!(hit, Some(Hit { t: 1.0, u: 0.25, v: 0.5, primitive: 0, instance: 0 }));
    assert_eq!(scene.closest(&ray([0.75, 0.5, 0.0], [0.0, 0.0, 2.0]), 0.0, FAR), None);
    assert_eq!(scene.closest(&ray([0.25, 0.5, 0.0], [0.0, 0.0, -2.0]), 0.0, FAR), None);
    assert_eq!(scene.id(0), 100);
}

#[test]
fn ranges_are_closed_and_forward() {
    let scene = one(CORNER).scene();
    let up = ray([0.25, 0.5, 0.0], [0.0, 0.0, 1.0]);
    let cases = [
        (0.0, 2.0, true),
        (2.0, 2.0, true),
        (2.0, FAR, true),
        (0.0, 1.999_999, false),
        (2.000_001, FAR, false),
        (3.0, 1.0, false),
        (-5.0, 5.0, true),
        (f32::NAN, FAR, true),
        (0.0, f32::NAN, false),
    ];
    for (from, to, expected) in cases {
        assert_eq!(scene.closest(&up, from, to).is_some(), expected, "closest in [{from}, {to}]");
        assert_eq!(scene.any(&up, from, to), expected, "any in [{from}, {to}]");
    }
    let behind = ray([0.25, 0.5, 3.0], [0.0, 0.0, 1.0]);
    assert!(!scene.any(&behind, -5.0, 5.0));
}

#[test]
fn equal_distances_go_to_the_lower_number() {
    let mut soup = one(CORNER);
    soup.triangles = vec![[0, 1, 2]; 100];
    let twice = scene(&[(soup.clone(), IDENTITY), (soup, IDENTITY)]);
    let up = ray([0.25, 0.5, 0.0], [0.0, 0.0, 1.0]);
    for to in [2.0, FAR] {
        let hit = twice.closest(&up, 0.0, to).unwrap();
        assert_eq!((hit.instance, hit.primitive), (0, 0));
    }
    let hit = twice.closest_where(&up, 0.0, FAR, |h| h.instance == 1 && h.primitive > 41).unwrap();
    assert_eq!((hit.instance, hit.primitive), (1, 42));
    assert!(!twice.any_where(&up, 0.0, FAR, |h| h.primitive == 100));
    assert!(twice.any_where(&up, 0.0, FAR, |h| h.primitive == 99));
}

#[test]
fn soups_agree_with_brute_force() {
    let mut random = Random(1);
    for (count, size) in [(1, 0.5), (7, 0.5), (9, 0.5), (60, 0.3), (400, 0.1), (3000, 0.02)] {
        let soup = Soup::random(&mut random, count, size);
        let scene = soup.scene();
        let (mut hits, mut unclear) = (0, 0);
        for _ in 0..600 {
            let ray = random.ray(1.0);
            let expected = brute(&soup, &IDENTITY, &ray, 0.0);
            let found = scene.closest(&ray, 0.0, FAR);
            assert_eq!(
                found.map(|h| (h.t, h.u, h.v, h.primitive)),
                expected.map(|h| (h.t, h.u, h.v, h.primitive)),
                "{ray:?}"
            );
            let exact = (0..count).map(|i| (reference(&soup, i, &ray), i));
            let exact = exact.filter(|((t, inside), _)| *t >= 0.0 && *inside >= 0.0);
            let exact = exact.min_by(|a, b| a.0.0.total_cmp(&b.0.0));
            match (exact, found) {
                (Some(((t, _), primitive)), Some(hit)) if primitive as u32 == hit.primitive => {
                    assert!((t - f64::from(hit.t)).abs() < 1e-4, "{t} and {hit:?}");
                    hits += 1;
                }
                (None, None) => {}
                _ => unclear += 1,
            }
        }
        assert!(unclear <= 2, "{unclear} of {hits} rays disagree with f64");
    }
}

/// Instances of a few soups, and the parts they are made of.
fn crowd(random: &mut Random, count: usize) -> (SceneBvh, Vec<(Soup, Affine)>) {
    let parts: Vec<_> = (0..count)
        .map(|number| {
            let mut place = random.affine();
            (0..3).for_each(|r| place[r][3] = 3.0 * random.signed());
            (Soup::random(random, 1 + 17 * number % 90, 0.4), place)
        })
        .collect();
    (scene(&parts), parts)
}

#[test]
fn instances_agree_with_brute_force() {
    let mut random = Random(2);
    for count in [1, 2, 9, 40] {
        let (scene, parts) = crowd(&mut random, count);
        for _ in 0..500 {
            let ray = random.ray(4.0);
            let mut best: Option<(f32, u32, u32)> = None;
            let mut each = Vec::new();
            for ((soup, place), instance) in parts.iter().zip(0..) {
                let Some(hit) = brute(soup, place, &ray, 0.25) else { continue };
                each.push((instance, hit.primitive, hit.t));
                if best.is_none_or(|best| hit.t < best.0) {
                    best = Some((hit.t, instance, hit.primitive));
                }
            }
            let found = scene.closest(&ray, 0.25, FAR);
            assert_eq!(found.map(|h| (h.t, h.instance, h.primitive)), best, "{ray:?}");
            let mut all = Vec::new();
            scene.all_instances(&ray, 0.25, FAR, |h| all.push((h.instance, h.primitive, h.t)));
            all.sort_by_key(|h| h.0);
            assert_eq!(all, each, "{ray:?}");
            assert_eq!(scene.any(&ray, 0.25, FAR), best.is_some(), "{ray:?}");
            if let Some((t, ..)) = best {
                assert!(scene.any(&ray, 0.25, t) && !scene.any(&ray, 0.25, t * 0.999_999));
            }
        }
    }
}

#[test]
fn portable_and_native_agree_bit_for_bit() {
    let mut random = Random(3);
    let (native, _) = crowd(&mut random, 30);
    let portable = native.clone().portable();
    for _ in 0..3000 {
        let ray = random.ray(4.0);
        let bits = |h: Hit| (h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.primitive, h.instance);
        let closest = |scene: &SceneBvh| scene.closest(&ray, 0.0, 5.0).map(bits);
        assert_eq!(closest(&native), closest(&portable), "{ray:?}");
        assert_eq!(native.any(&ray, 0.1, 0.5), portable.any(&ray, 0.1, 0.5), "{ray:?}");
        let all = |scene: &SceneBvh| {
            let mut all = Vec::new();
            scene.all_instances(&ray, 0.0, FAR, |h| all.push(bits(h)));
            all
        };
        assert_eq!(all(&native), all(&portable), "{ray:?}");
    }
}

#[test]
fn tiles_agree_with_single_rays() {
    let mut random = Random(4);
    let (scene, _) = crowd(&mut random, 40);
    for case in 0..200 {
        let eye = random.point(6.0);
        let target = random.point(2.0);
        // Narrow, wide, and not a bundle.
        let spread = [0.02, 0.5, 20.0][case % 3];
        let rays: Vec<Ray> = (0..64)
            .map(|_| {
                let off = random.point(spread);
                let origin = if case % 7 == 6 { random.point(6.0) } else { eye };
                ray(origin, [0, 1, 2].map(|a| target[a] + off[a] - eye[a]))
            })
            .collect();
        let (mut tile, mut single) = (Vec::new(), Vec::new());
        let key = |n: usize, h: Hit| (n, h.instance, h.primitive, h.t.to_bits());
        scene.all_instances_tile(&rays, 0.0, FAR, |n, h| tile.push(key(n, h)));
        for (n, ray) in rays.iter().enumerate() {
            scene.all_instances(ray, 0.0, FAR, |h| single.push(key(n, h)));
        }
        tile.sort_unstable();
        single.sort_unstable();
        assert_eq!(tile, single, "case {case}");
    }
    scene.all_instances_tile(&[], 0.0, FAR, |_, _| unreachable!("no ray"));
}

#[test]
fn no_ray_passes_through_a_closed_ball() {
    let mut random = Random(5);
    let ball = ball(24, 37);
    for case in 0..6 {
        let place = if case == 0 { IDENTITY } else { random.affine() };
        let scene = scene(&[(ball.clone(), place)]);
        let world: Vec<[f32; 3]> = ball.positions.iter().map(|&p| moved(&place, p)).collect();
        let center = [0, 1, 2].map(|r| place[r][3]);
        for inside in [center, [0, 1, 2].map(|r| center[r] + 0.1 * random.signed())] {
            let check = |target: [f32; 3]| {
                let out = ray(inside, [0, 1, 2].map(|a| target[a] - inside[a]));
                assert!(scene.any(&out, 0.0, FAR), "{out:?} leaves the ball");
                let direction = out.direction.map(|x| -x);
                let far = [0, 1, 2].map(|a| target[a] + 9.0 * out.direction[a]);
                let into = ray(far, direction);
                assert!(scene.any(&into, 0.0, 9.6), "{into:?} enters the ball");
            };
            for triangle in &ball.triangles {
                let [a, b, c] = triangle.map(|i| world[i as usize]);
                check(a);
                for (p, q) in [(a, b), (b, c), (c, a)] {
                    let s = random.unit();
                    check([0, 1, 2].map(|i| p[i] + s * (q[i] - p[i])));
                    check([0, 1, 2].map(|i| 0.5 * (p[i] + q[i])));
                }
            }
        }
    }
}

#[test]
fn no_ray_falls_through_a_grid_along_an_axis() {
    let n = 16_u32;
    let at = |i: u32| i as f32 / 8.0 - 1.0;
    let positions = (0..(n + 1) * (n + 1)).map(|i| [at(i % (n + 1)), at(i / (n + 1)), 0.0]);
    let cell = |i: u32| {
        let a = i / n * (n + 1) + i % n;
        [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
    };
    let grid = Soup { positions: positions.collect(), triangles: (0..n * n).flat_map(cell).collect() };
    let scene = grid.scene();
    for i in 0..=2 * n {
        for j in 0..=2 * n {
            let (x, y) = (i as f32 / 16.0 - 1.0, j as f32 / 16.0 - 1.0);
            for zero in [0.0, -0.0] {
                let down = ray([x, y, 1.0], [zero, zero, -1.0]);
                let found = scene.closest(&down, 0.0, FAR).map(|h| (h.t, h.primitive));
                let expected = brute(&grid, &IDENTITY, &down, 0.0).map(|h| (h.t, h.primitive));
                assert_eq!(found, expected);
                assert_eq!(found.map(|f| f.0), Some(1.0), "through ({x}, {y})");
            }
        }
    }
    // In the plane of the triangles, a ray hits nothing, and must not cause a NaN.
    assert_eq!(scene.closest(&ray([-2.0, 0.0, 0.0], [1.0, 0.0, 0.0]), 0.0, FAR), None);
}

#[test]
fn nothing_to_hit_is_fine() {
    let up = ray([0.25, 0.5, 0.0], [0.0, 0.0, 1.0]);
    let none = |scene: &SceneBvh, why: &str| {
        scene.validate();
        assert_eq!(scene.closest(&up, 0.0, FAR), None, "{why}");
        assert!(!scene.any(&up, 0.0, FAR), "{why}");
        scene.all_instances(&up, 0.0, FAR, |h| panic!("{why}: {h:?}"));
        scene.all_instances_tile(&[up], 0.0, FAR, |_, h| panic!("{why}: {h:?}"));
    };
    let empty = Soup { positions: vec![], triangles: vec![] };
    none(&scene(&[]), "no instance");
    none(&empty.scene(), "no triangle");
    none(&one([[0.0, 0.0, 2.0]; 3]).scene(), "a point");
    none(&one([[0.0, 0.0, 2.0], [1.0, 1.0, 2.0], [2.0, 2.0, 2.0]]).scene(), "a line");
    none(&one([[0.0, 0.0, f32::NAN], CORNER[1], CORNER[2]]).scene(), "NaN");
    none(&one([[-FAR, 0.0, 2.0], CORNER[1], CORNER[2]]).scene(), "infinite");
    none(&one([[-1e38, -1e38, 2.0], [3e38, 0.0, 2.0], [0.0, 3e38, 2.0]]).scene(), "overflow");
    let squashed = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 2.0]];
    none(&scene(&[(one(CORNER), squashed)]), "singular");
    none(&scene(&[(one(CORNER), shifted(f32::NAN, 0.0, 0.0))]), "NaN transform");

    let mixed = scene(&[(empty, IDENTITY), (one(CORNER), squashed), (one(CORNER), IDENTITY)]);
    assert_eq!(mixed.closest(&up, 0.0, FAR).map(|h| h.instance), Some(2));
    assert_eq!(mixed.len(), 3);
    let solid = one(CORNER).scene();
    for direction in [[0.0; 3], [f32::NAN, 0.0, 1.0], [0.0, FAR, 1.0], [0.0, 0.0, 1e-30]] {
        assert_eq!(solid.closest(&ray([0.25, 0.5, 0.0], direction), 0.0, FAR), None);
    }
    assert_eq!(solid.closest(&ray([0.25, f32::NAN, 0.0], [0.0, 0.0, 1.0]), 0.0, FAR), None);
}

#[test]
fn deep_inputs_stay_within_the_stack() {
    let mut random = Random(6);
    // Exponential spacing, equal triangles, and a fan of needles that all overlap.
    let scaled = |s: f32| CORNER.map(|c| [c[0] * s, c[1] * s, s]);
    let exponential: Vec<_> = (0..200).map(|i| scaled(0.7_f32.powi(i))).collect();
    let needles: Vec<_> = (0..2000).map(|i| [[0.0; 3], [i as f32, 1.0, 1.0], random.point(1e-3)]).collect();
    for corners in [exponential, vec![CORNER; 5000], needles] {
        let soup = Soup {
            positions: corners.concat(),
            triangles: (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        };
        let scene = soup.scene();
        for _ in 0..200 {
            let ray = random.ray(1.0);
            let expected = brute(&soup, &IDENTITY, &ray, 0.0).map(|h| h.t);
            let found = scene.closest(&ray, 0.0, FAR).map(|h| h.t);
            assert_eq!(found.is_some(), expected.is_some(), "{ray:?}");
            if let (Some(a), Some(b)) = (found, expected) {
                assert!((a - b).abs() <= 1e-5 * b.abs(), "{a} and {b} for {ray:?}");
            }
        }
    }
    let halves = super::build::depth_by_halves(100_000);
    assert!(halves <= MAX_DEPTH, "the way out is {halves} deep");
}
