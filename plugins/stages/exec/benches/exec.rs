//! An annotator in a program, `examples/darkness.py`, beside the same arithmetic in this process. One view of 640 × 480 with 20
//! objects. Needs `python3` with NumPy.
//!
//! `cargo bench -p syntable-exec`

use std::path::Path;
use std::process::Command;
use syntable_exec as _;
use syntable_model::context::{Collected, DatasetContext, Serial};
use syntable_model::prelude::*;
use syntable_model::product::standard::{RGB, VISIBLE_IDS, VISIBLE_MASK};
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_model::scene::{SceneId, ViewId};
use syntable_testing::figures::Figures;
use syntable_testing::scenes::dataset;

const SIZE: [u32; 2] = [640, 480];
const OBJECTS: u16 = 20;
const THRESHOLD: f64 = 0.3;

fn main() {
    let has_numpy = Command::new("python3").args(["-c", "import numpy"]).status().is_ok_and(|status| status.success());
    assert!(has_numpy, "python3 with NumPy is needed");
    let mut figures = Figures::filtered(env!("CARGO_PKG_NAME"), env!("CARGO_CRATE_NAME"));
    of_masks(&mut figures);
    of_ids(&mut figures);
    in_process(&mut figures);
}

fn products() -> Products {
    let [width, height] = SIZE;
    let mut products = Products::new();
    let object = |x: u32, y: u32| (1 + x / 128 + y / 120 * 5) as u16;
    products.put(RGB, Plane::from_fn(width, height, |x, y| [x as u8, y as u8, 9])).expect("new");
    let masks = (1..=OBJECTS).map(|id| (InstanceId(id), Mask::from_fn(width, height, |x, y| object(x, y) == id)));
    products.put(VISIBLE_MASK, PerInstance::from_iter(masks)).expect("new");
    products.put(VISIBLE_IDS, Plane::from_fn(width, height, |x, y| InstanceId(object(x, y)))).expect("new");
    products
}

fn program(file: &Path, reads: &str) -> Box<dyn ImageAnnotator> {
    let registry = Registry::linked().expect("kinds are unique");
    let entry = registry.find(Slot::Annotate, "exec").expect("registered");
    let options = format!(
        "reads = {reads}\nprovides = {{ darkness = {{ form = \"float per object\" }} }}\n\
         program = {{ file = {:?}, interpreter = [\"python3\"], options = {{ threshold = {THRESHOLD} }} }}\n",
        file.display().to_string()
    );
    match entry.construct_str(&options).expect("good options").stage {
        Stage::AnnotateImage(annotator) => annotator,
        _ => panic!("it annotates images"),
    }
}

fn run(figures: &mut Figures, name: &str, annotator: &dyn ImageAnnotator) {
    let (dataset, products, log) = (dataset(), products(), Collected::default());
    let cx = DatasetContext::new(&dataset, &Serial, &log).images(SceneId(0)).image(ViewId(0), SIZE);
    // The process starts with the first view.
    annotator.annotate(&cx, &mut products.clone()).expect("answers");
    figures.time(name, || annotator.annotate(&cx, &mut products.clone()).expect("answers"));
}

/// Masks are 6 MB.
fn of_masks(figures: &mut Figures) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/darkness.py");
    run(figures, "program, of masks", &*program(&file, "[\"rgb\", \"visible_mask\"]"));
}

/// One plane of ids instead of masks.
fn of_ids(figures: &mut Figures) {
    let folder = tempfile::tempdir().expect("a folder");
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/darkness.py");
    let text = std::fs::read_to_string(example).expect("the example");
    let (start, _) = text.split_once("    shares = ").expect("the line of the shares");
    let text = format!(
        "{start}    ids = view[\"visible_ids\"].ravel()\n    count = np.bincount(ids, minlength=21)[1:21]\n    \
         found = np.bincount(ids, weights=dark.ravel(), minlength=21)[1:21]\n    \
         answer(view, darkness=found / np.maximum(count, 1), ids=np.array(range(1, 21), dtype=np.uint16))\n"
    );
    let file = folder.path().join("darkness.py");
    std::fs::write(&file, text).expect("writable");
    run(figures, "program, of ids", &*program(&file, "[\"rgb\", \"visible_ids\"]"));
}

/// The same in this process.
fn in_process(figures: &mut Figures) {
    let products = products();
    figures.time("in this process", || {
        let (rgb, masks) = (products.get(RGB).expect("there"), products.get(VISIBLE_MASK).expect("there"));
        let dark = rgb.map(|pixel| f64::from(pixel.map(u32::from).iter().sum::<u32>()) / 3.0 < 255.0 * THRESHOLD);
        let share = |mask: &Mask| {
            let plane = mask.to_plane();
            let inside = plane.data().iter().zip(dark.data()).filter(|(set, dark)| **set && **dark).count();
            inside as f64 / f64::from(mask.area().max(1))
        };
        masks.iter().map(|(_, mask)| share(mask)).sum::<f64>()
    });
}
