//! Speed of the tree by class of rays: `cargo bench -p syntable-render-cpu --bench rays`.

mod common;

use std::sync::LazyLock;

use common::Class;
use divan::{Bencher, counter::ItemsCount};
use syntable_render_cpu::bvh::{MeshBvh, SceneBvh};

static SCENE: LazyLock<(SceneBvh, Vec<Class>)> = LazyLock::new(|| {
    let objects = common::objects();
    let scene = common::instanced(&objects);
    let classes = common::classes(&scene, &objects, 1);
    (scene, classes)
});

fn main() {
    divan::main();
}

/// Item throughput is per thread.
#[divan::bench(args = ["primary", "bounce", "bounce, shuffled", "shadow"], threads = [1, 2], sample_count = 10)]
fn trace(bencher: Bencher, class: &str) {
    let (scene, classes) = &*SCENE;
    let Some(class) = classes.iter().find(|c| c.name == class) else { unreachable!("{class}") };
    bencher.counter(ItemsCount::new(class.rays.len())).bench(|| {
        if class.shadow {
            class.rays.iter().filter(|ray| scene.any(ray, 0.0, 1.0)).count()
        } else {
            let hit = |ray: &&_| scene.closest(ray, 0.0, f32::INFINITY).is_some();
            class.rays.iter().filter(hit).count()
        }
    });
}

/// Label rays of a 640 × 480 image: the first hit in every instance, by tiles of 8 × 8.
#[divan::bench(threads = [1, 2], sample_count = 10)]
fn labels(bencher: Bencher) {
    let scene = &SCENE.0;
    let rays = common::primary(640, 480, 1);
    let tile = |x: usize, y: usize| (0..64).map(|i| rays[(y * 8 + i / 8) * 640 + x * 8 + i % 8]).collect::<Vec<_>>();
    let tiles: Vec<_> = (0..80 * 60).map(|i| tile(i % 80, i / 80)).collect();
    bencher.counter(ItemsCount::new(rays.len())).bench(|| {
        let mut hits = 0;
        for rays in &tiles {
            scene.all_instances_tile(rays, 0.0, f32::INFINITY, |_, _| hits += 1);
        }
        hits
    });
}

/// Label rays one by one.
#[divan::bench(sample_count = 10)]
fn labels_single(bencher: Bencher) {
    let scene = &SCENE.0;
    let rays = common::primary(640, 480, 1);
    bencher.counter(ItemsCount::new(rays.len())).bench(|| {
        let mut hits = 0;
        rays.iter().for_each(|ray| scene.all_instances(ray, 0.0, f32::INFINITY, |_| hits += 1));
        hits
    });
}

/// A mesh of 7 564 triangles.
#[divan::bench(sample_count = 10)]
fn build_mesh(bencher: Bencher) {
    let object = &common::objects()[2];
    bencher.bench(|| MeshBvh::build(&object.positions, &object.triangles));
}
