//! Time of the labels of a 640 × 480 view: `cargo bench -p syntable-annotate`.

#[path = "../tests/annotate/common/mod.rs"]
mod common;

use common::{World, annotator};
use std::hint::black_box;
use std::sync::OnceLock;
use syntable_annotate::CANVAS;
use syntable_annotate::masks::{area_outside, sweep};
use syntable_model::prelude::*;
use syntable_model::product::standard::{COVERAGE, DEPTH, INSTANCE, OBJECT_DEPTHS};
use syntable_model::product::{BitPlane, ObjectDepths};
use syntable_model::scene::{Camera, Intrinsics};
use syntable_testing::figures::Figures;

const SIZE: [u32; 2] = [640, 480];

fn main() {
    let mut figures = Figures::filtered(env!("CARGO_PKG_NAME"), env!("CARGO_CRATE_NAME"));
    for objects in [1, 20, 40, 64, 130] {
        masks_and_order(&mut figures, objects);
    }
    masks_order_and_coco(&mut figures, 20);
    for objects in [20, 130] {
        areas_outside(&mut figures, objects);
    }
    for kind in ANNOTATORS {
        annotator_of_40(&mut figures, kind);
    }
    all_of_40(&mut figures);
}

/// Disks scattered over an image of that size, the first in front, with a table behind the lower half.
fn disks(objects: usize, size: [u32; 2]) -> (Plane<InstanceId>, BitPlane) {
    disks_at(objects, size, 1)
}

/// Like [`disks`], with pixels divided into `times` × `times`.
fn disks_at(objects: usize, size: [u32; 2], times: u32) -> (Plane<InstanceId>, BitPlane) {
    let ([width, height], pixel) = (size.map(|edge| edge * times), 1.0 / f64::from(times));
    let mut stream = Stream::root(objects as u64);
    let disks: Vec<[f64; 3]> = (0..objects)
        .map(|_| [stream.uniform(40.0, 600.0), stream.uniform(60.0, 440.0), stream.uniform(25.0, 90.0)])
        .collect();
    let covers = |x: i32, y: i32, [cx, cy, r]: [f64; 3]| {
        let (dx, dy) = ((f64::from(x) + 0.5) * pixel - cx, (f64::from(y) + 0.5) * pixel - cy);
        let square = dx * dx + dy * dy;
        // A scalloped outline, like a real object's.
        let scalloped = || r * (1.0 + 0.1 * (9.0 * dy.atan2(dx)).sin());
        square < 1.3 * r * r && square < scalloped().powi(2)
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
fn masks_and_order(figures: &mut Figures, objects: usize) {
    let (first, coverage) = disks(objects, SIZE);
    figures.time(&format!("masks and order of {objects}"), || {
        sweep(black_box(&first), black_box(&coverage)).expect("planes agree")
    });
}

/// As above, and the compressed strings of COCO.
fn masks_order_and_coco(figures: &mut Figures, objects: usize) {
    let (first, coverage) = disks(objects, SIZE);
    figures.time(&format!("masks, order and COCO of {objects}"), || {
        let sweep = sweep(black_box(&first), black_box(&coverage)).expect("planes agree");
        let masks = sweep.objects.iter().flat_map(|object| [&object.visible, &object.amodal, &object.occlusion]);
        masks.map(|mask| mask.to_coco().len()).sum::<usize>()
    });
}

/// Areas on a canvas three times as wide and high as the image.
fn areas_outside(figures: &mut Figures, objects: usize) {
    let ((_, image), (_, canvas)) = (disks(objects, SIZE), disks(objects, SIZE.map(|edge| 3 * edge)));
    figures.time(&format!("areas outside of {objects}"), || area_outside(black_box(&image), black_box(&canvas)));
}

/// All labels of a view of 40 objects, except appearance and hidden normals, which need images of objects: each
/// annotator of views with the products that it needs from the renderer and from earlier annotators. The order of the
/// names provides each annotator with its inputs.
const ANNOTATORS: &[&str] = &[
    "masks",
    "boxes",
    "identity",
    "object_info",
    "camera",
    "cuboids",
    "keypoints",
    "label_arrays",
    "lights",
    "visibility",
    "outlines",
    "rotated_boxes",
    "occlusion_graph",
    "occlusion_boundary",
    "depth_relations",
    "scene_masks",
    "distance",
    "optical_flow",
    "amodal_depth",
    "object_coordinates",
    "soft_masks",
];

/// A view of 40 objects and the products of a renderer.
fn rendered() -> (World, View, Products) {
    const OBJECTS: usize = 40;
    let mut world = World::new(OBJECTS);
    let [width, height] = SIZE;
    let intrinsics = Intrinsics { width, height, fx: 600.0, fy: 600.0, cx: 320.0, cy: 240.0 };
    let pose = world.view.camera.world_from_camera;
    world.view.camera = Camera::pinhole(intrinsics, pose);
    let next =
        View { camera: Camera::pinhole(intrinsics, pose * Pose::translation(0.02, 0.0, 0.0)), ..world.view.clone() };
    let mut products = Products::new();
    let (first, coverage) = disks(OBJECTS, SIZE);
    let mut hits = Vec::new();
    for (pixel, set) in (0..).zip(coverage.data().chunks_exact(coverage.words())) {
        let ids = (1..=OBJECTS as u16).filter(|id| set[0] >> (id - 1) & 1 == 1);
        hits.extend(ids.map(|id| (pixel, InstanceId(id), 0.8 + f32::from(id) * 0.001)));
    }
    let depth = first.map(|id| 0.8 + f32::from(id.0) * 0.001);
    products.put(OBJECT_DEPTHS, ObjectDepths::from_hits(width, height, hits)).expect("new");
    products.put(DEPTH.of_next_view(), depth.clone()).expect("new");
    products.put(DEPTH, depth).expect("new");
    static FINE: OnceLock<(Plane<InstanceId>, BitPlane)> = OnceLock::new();
    let fine = FINE.get_or_init(|| disks_at(OBJECTS, SIZE, 4)).clone();
    products.put(INSTANCE.in_subpixels(4), fine.0).expect("new");
    products.put(COVERAGE.in_subpixels(4), fine.1).expect("new");
    products.put(COVERAGE.on_canvas(CANVAS), disks(OBJECTS, SIZE.map(|edge| 3 * edge)).1).expect("new");
    products.put(INSTANCE, first).expect("new");
    products.put(COVERAGE, coverage).expect("new");
    (world, next, products)
}

/// Each annotator of [`ANNOTATORS`] alone.
fn annotator_of_40(figures: &mut Figures, kind: &str) {
    if !figures.is_wanted(kind) {
        return;
    }
    let (world, next, mut products) = rendered();
    let cx = world.of_view().before(Some(&next));
    for before in ANNOTATORS.iter().take_while(|before| **before != kind) {
        annotator(before, "").annotate(&cx, &mut products).expect("annotated");
    }
    let stage = annotator(kind, "");
    figures.time_on(
        kind,
        || products.clone(),
        |mut products| {
            stage.annotate(&cx, &mut products).expect("annotated");
            products
        },
    );
}

/// [`ANNOTATORS`] together.
fn all_of_40(figures: &mut Figures) {
    let (world, next, products) = rendered();
    let cx = world.of_view().before(Some(&next));
    let stages: Vec<_> = ANNOTATORS.iter().map(|kind| annotator(kind, "")).collect();
    figures.time_on(
        "all annotators",
        || products.clone(),
        |mut products| {
            stages.iter().try_for_each(|stage| stage.annotate(&cx, &mut products)).expect("annotated");
            products
        },
    );
}
