//! What labels of a 640 × 480 view cost.

use divan::{Bencher, black_box};
use syntable_annotate::masks::{area_outside, sweep};
use syntable_model::prelude::*;
use syntable_model::product::{BitPlane, Plane};

const SIZE: [u32; 2] = [640, 480];

fn main() {
    divan::main();
}

/// Disks scattered over an image of that size, the first in front, with a table behind the lower half.
fn disks(objects: usize, [width, height]: [u32; 2]) -> (Plane<InstanceId>, BitPlane) {
    let mut stream = Stream::root(objects as u64);
    let disks: Vec<[f64; 3]> = (0..objects)
        .map(|_| [stream.uniform(40.0, 600.0), stream.uniform(60.0, 440.0), stream.uniform(25.0, 90.0)])
        .collect();
    let covers = |x: i32, y: i32, [cx, cy, r]: [f64; 3]| {
        let (dx, dy) = (f64::from(x) + 0.5 - cx, f64::from(y) + 0.5 - cy);
        // A scalloped outline, as of a real object.
        let r = r * (1.0 + 0.1 * (9.0 * dy.atan2(dx)).sin());
        dx * dx + dy * dy < r * r
    };
    let mut coverage = BitPlane::new(width, height, objects);
    for y in 0..height {
        for x in 0..width {
            for (i, _) in disks.iter().enumerate().filter(|(_, disk)| covers(x as i32, y as i32, **disk)) {
                coverage.insert(x, y, InstanceId(i as u16 + 1));
            }
        }
    }
    let first = Plane::from_fn(width, height, |x, y| {
        let front = disks.iter().position(|&disk| covers(x as i32, y as i32, disk));
        InstanceId(front.map_or(if y > height / 2 { objects + 1 } else { objects + 2 }, |i| i + 1) as u16)
    });
    (first, coverage)
}

/// Masks as run lengths, and the occlusion order.
#[divan::bench(args = [1, 20, 40, 64, 130])]
fn masks_and_order(bencher: Bencher, objects: usize) {
    let (first, coverage) = disks(objects, SIZE);
    bencher.bench(|| sweep(black_box(&first), black_box(&coverage)).expect("planes agree"));
}

/// As above, and the compressed strings of COCO.
#[divan::bench(args = [20])]
fn masks_order_and_coco(bencher: Bencher, objects: usize) {
    let (first, coverage) = disks(objects, SIZE);
    bencher.bench(|| {
        let sweep = sweep(black_box(&first), black_box(&coverage)).expect("planes agree");
        let masks = sweep.objects.iter().flat_map(|object| [&object.visible, &object.amodal, &object.occlusion]);
        masks.map(|mask| mask.to_coco().len()).sum::<usize>()
    });
}

/// Areas on the canvas three times as wide and high.
#[divan::bench(args = [20, 130])]
fn areas_outside(bencher: Bencher, objects: usize) {
    let ((_, image), (_, canvas)) = (disks(objects, SIZE), disks(objects, SIZE.map(|edge| 3 * edge)));
    bencher.bench(|| area_outside(black_box(&image), black_box(&canvas)));
}
