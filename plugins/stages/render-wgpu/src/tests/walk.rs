//! Hits of rays, compared with all triangles in double precision.

use super::{call, session, show, soups};
use crate::device::Variant;
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::prelude::*;
use syntable_testing::scenes;

/// Rays through each scene.
const RAYS: usize = 3000;

/// Words of a result.
const RESULT: usize = 8;

/// A triangle of a body, in the world.
struct Placed {
    instance: u32,
    primitive: u32,
    corners: [Point3<f64>; 3],
}

fn placed(scene: &Scene) -> Vec<Placed> {
    let of = |(instance, body): (u32, &syntable_model::scene::Body)| {
        let (pose, mesh) = (body.world_from_body, body.object.mesh.clone());
        (0..mesh.data().triangles.len()).map(move |primitive| Placed {
            instance,
            primitive: primitive as u32,
            corners: mesh.corners(primitive).map(|corner| pose * corner),
        })
    };
    (0..).zip(scene.bodies()).flat_map(of).collect()
}

/// Intersection of a ray and a triangle: its distance, and the smallest barycentric weight (Möller and Trumbore, 1997).
fn meets(triangle: &Placed, origin: Point3<f64>, direction: Vector3<f64>) -> Option<(f64, f64)> {
    let [a, b, c] = triangle.corners;
    let (ab, ac) = (b - a, c - a);
    let across = direction.cross(&ac);
    let determinant = ab.dot(&across);
    let to = origin - a;
    let u = to.dot(&across) / determinant;
    let beside = to.cross(&ab);
    let v = direction.dot(&beside) / determinant;
    let t = ac.dot(&beside) / determinant;
    (determinant != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| (t, u.min(v).min(1.0 - u - v)))
}

#[test]
fn walks_find_what_a_search_of_all_triangles_finds() {
    let Some(mut session) = session() else { return };
    for number in 0..2 {
        // Without holes and panes, which have tests of their own.
        let scene = soups::scene(number, false);
        show(&mut session, &scene, &scenes::view([0.0, -2.0, 1.0], [0.0; 3], [8, 8], 60.0));
        let mut random = Stream::root(90 + number);
        let rows: Vec<[f32; 8]> = (0..RAYS)
            .map(|ray| {
                let [x, y, z] = std::array::from_fn(|_| random.uniform(-1.5, 1.5) as f32);
                let length = [1.0, 0.02, 40.0][ray % 3];
                let d = random.direction() * length;
                let to = random.uniform(0.0, 2.0 / length) as f32;
                let from = if ray % 2 == 0 { 0.0 } else { random.uniform(0.0, 0.5 / length) as f32 };
                [x, y, z, d.x as f32, d.y as f32, d.z as f32, from, to]
            })
            .collect();
        let statements = "let ray = Ray(v3(), v3()); let from_ = f(); let to = f();
            let first = walk(FIRST, view.top_level, ray, from_, FAR, 0u, NONE).hit;
            put_u(first.instance); put_u(first.primitive); put(first.t);
            put_b(is_black(walk(PASSAGE_OF_LIGHT, view.top_level, ray, 0.0, to, 0u, NONE).transmittance));
            let members = result + 1u;
            output[members] = 0u; output[members + 1u] = 0u;
            let every = walk(EVERY_BODY, view.top_level, ray, 0.0, FAR, 0u, members);
            put(every.hit.t); result += 2u; put(every.support);";
        let variant = Variant { deep: true, ..Variant::default() };
        let results: Vec<[u32; RESULT]> = call(&mut session, statements, variant, &rows);
        let triangles = placed(&scene);
        let objects = scene.objects().len() as u32;
        let (mut hits, mut occluded, mut slips) = (0, 0, 0);
        for (row, result) in rows.iter().zip(&results) {
            let [x, y, z, dx, dy, dz, from, to] = row.map(f64::from);
            let (origin, direction) = (Point3::new(x, y, z), Vector3::new(dx, dy, dz));
            let all: Vec<(&Placed, f64, f64)> = (triangles.iter())
                .filter_map(|triangle| meets(triangle, origin, direction).map(|(t, edge)| (triangle, t, edge)))
                .collect();
            let nearest = |from: f64| all.iter().filter(|(_, t, _)| *t >= from).min_by(|a, b| a.1.total_cmp(&b.1));
            let near = |got: u32, wanted: Option<f64>| match wanted {
                None => got == u32::MAX || f32::from_bits(got) >= 3e38,
                Some(wanted) => (f64::from(f32::from_bits(got)) - wanted).abs() <= 2e-5 * wanted.abs().max(1e-2),
            };
            let first = nearest(from);
            let names = first.map_or([u32::MAX; 2], |(triangle, ..)| [triangle.instance, triangle.primitive]);
            let blocks = all.iter().any(|(_, t, _)| (0.0..=to).contains(t));
            let mut members = [0_u32; 2];
            for (triangle, t, _) in &all {
                if *t >= 0.0 && triangle.instance < objects {
                    members[triangle.instance as usize / 32] |= 1 << (triangle.instance % 32);
                }
            }
            let support = all.iter().filter(|(triangle, t, _)| *t >= 0.0 && triangle.instance >= objects);
            let support = support.map(|&(_, t, _)| t).min_by(f64::total_cmp);
            hits += usize::from(first.is_some());
            occluded += usize::from(blocks);
            let alike = result[..2] == names
                && near(if first.is_some() { result[2] } else { u32::MAX }, first.map(|&(_, t, _)| t))
                && (f32::from_bits(result[3]) == 1.0) == blocks
                && near(result[4], nearest(0.0).map(|&(_, t, _)| t))
                && result[5..7] == members
                && near(result[7], support);
            if !alike {
                slips += 1;
                println!(
                    "{row:?}: {result:?}, but {names:?} {:?} {blocks} {members:?}",
                    first.map(|hit| (hit.1, hit.2))
                );
            }
        }
        println!("scene {number}: {slips} of {RAYS} rays differ; {hits} hit, {occluded} are occluded");
        assert!(hits > RAYS / 4 && occluded > RAYS / 10, "{hits} {occluded}");
        // A ray grazes an edge, or starts on a surface.
        assert!(slips * 500 <= RAYS, "{slips} of {RAYS}");
    }
}
