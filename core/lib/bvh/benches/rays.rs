//! Speed of the tree by class of rays: `cargo bench -p syntable-bvh --bench rays`.

mod common;

use std::thread;
use syntable_bvh::MeshBvh;
use syntable_testing::figures::Figures;

fn main() {
    let mut figures = Figures::filtered(env!("CARGO_PKG_NAME"), env!("CARGO_CRATE_NAME"));
    let objects = common::objects();
    let scene = common::instanced(&objects);
    for class in common::classes(&scene, &objects, 1) {
        rate(&mut figures, class.name, class.rays.len(), || {
            if class.shadow {
                class.rays.iter().filter(|ray| scene.any(ray, 0.0, 1.0)).count()
            } else {
                let hit = |ray: &&_| scene.closest(ray, 0.0, f32::INFINITY).is_some();
                class.rays.iter().filter(hit).count()
            }
        });
    }
    // Label rays of a 640 × 480 image: the first hit in every instance, by tiles of 8 × 8.
    let rays = common::primary(640, 480, 1);
    let tile = |x: usize, y: usize| (0..64).map(|i| rays[(y * 8 + i / 8) * 640 + x * 8 + i % 8]).collect::<Vec<_>>();
    let tiles: Vec<_> = (0..80 * 60).map(|i| tile(i % 80, i / 80)).collect();
    rate(&mut figures, "labels", rays.len(), || {
        let mut hits = 0;
        for rays in &tiles {
            scene.all_instances_tile(rays, 0.0, f32::INFINITY, |_, _| hits += 1);
        }
        hits
    });
    figures.rate("labels, one by one", rays.len(), || {
        let mut hits = 0;
        rays.iter().for_each(|ray| scene.all_instances(ray, 0.0, f32::INFINITY, |_| hits += 1));
        hits
    });
    let object = &objects[2];
    let name = format!("tree of {} triangles", object.triangles.len());
    figures.time(&name, || MeshBvh::build(&object.positions, &object.triangles));
}

/// Rays per second, on one thread and on two that trace the same rays.
fn rate(figures: &mut Figures, name: &str, rays: usize, trace: impl Fn() -> usize + Sync) {
    figures.rate(name, rays, &trace);
    figures.rate(&format!("{name}, two threads"), 2 * rays, || {
        thread::scope(|scope| [0; 2].map(|_| scope.spawn(&trace)).map(|thread| thread.join().expect("traced")))
    });
}
