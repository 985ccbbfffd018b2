//! Wall and processor time of whole commands: the quickstart's job, then `stats`, `report`, `validate` and `convert` on a COCO
//! dataset.
//!
//! `cargo bench -p syntable-tests --bench commands [-- IMAGES]` (2000). `SYNTABLE` is the full path of another program to measure,
//! such as an older release. Images of 160 × 120 pixels show 12 ellipses, with amodal, visible and occlusion masks as the writer `coco`
//! stores them.

use serde_json::json;
use std::ffi::OsStr;
use std::fs;
use std::io::{BufWriter, Write as _};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;
use syntable_formats::encode::png::PngImage;
use syntable_formats::segmentation::Rle;
use syntable_model::prelude::*;
use syntable_program as _;
use syntable_testing::figures::{Figures, Unit, processor_seconds_of_children};

const SIZE: [u32; 2] = [160, 120];
const OBJECTS: usize = 12;

fn main() {
    let images = std::env::args().skip(1).find_map(|it| it.parse().ok()).unwrap_or(2000);
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data");
    write(&data, images);
    let data = data.as_os_str();
    let program = std::env::var_os("SYNTABLE").unwrap_or_else(|| env!("CARGO_BIN_EXE_syntable-under-test").into());
    let run = |name: &str, arguments: &[&OsStr], makes: &str| {
        let mut command = Command::new(&program);
        command
            .args(arguments)
            .env("SYNTABLE_CACHE", folder.path().join("cache"))
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        if !makes.is_empty() {
            command.arg("--out").arg(folder.path().join(makes));
        }
        let (started, before) = (Instant::now(), processor_seconds_of_children());
        let ended = command.output().unwrap_or_else(|error| panic!("{}: {error}", program.display()));
        // Polygons of YOLO leave data out.
        let errors = String::from_utf8_lossy(&ended.stderr);
        assert!(matches!(ended.status.code(), Some(0 | 3)), "`{name}` ended with {}: {errors}", ended.status);
        [started.elapsed().as_secs_f64(), processor_seconds_of_children() - before]
    };
    let mut figures = Figures::new(env!("CARGO_PKG_NAME"), env!("CARGO_CRATE_NAME"));
    let mut measure = |name: &str, arguments: &[&OsStr], makes: &str| {
        let [wall, processor] = run(name, arguments, makes);
        figures.put(name, wall, Unit::Seconds);
        figures.put(&format!("{name}, processor"), processor, Unit::Seconds);
    };
    let words = |text: &'static str| text.split(' ').map(OsStr::new).collect::<Vec<_>>();
    // The first job fills the cache.
    measure("quickstart, empty cache", &words("run builtin:quickstart"), "first");
    measure("quickstart", &words("run builtin:quickstart"), "second");
    for (name, options, makes) in [
        ("stats of labels", "stats --labels-only", ""),
        ("stats", "stats", ""),
        ("report", "report", "report"),
        ("validate", "validate", ""),
        ("convert to yolo", "convert --to yolo", "yolo"),
    ] {
        measure(name, &[&words(options)[..], &[data]].concat(), makes);
    }
}

/// Writes a dataset with this number of images.
fn write(data: &Path, images: usize) {
    fs::create_dir_all(data.join("annotations")).expect("writable");
    fs::create_dir_all(data.join("images")).expect("writable");
    let file = fs::File::create(data.join("annotations/instances_train.json")).expect("writable");
    let mut out = BufWriter::new(file);
    let name = |image: usize| format!("{:06}_{:04}.png", image / 4, image % 4);
    let [width, height] = SIZE;
    let list = (0..images).map(|image| {
        json!({ "id": image + 1, "file_name": name(image), "width": width, "height": height, "license": 1 }).to_string()
    });
    let list = list.collect::<Vec<_>>().join(",\n");
    let mut put = |text: &str| out.write_all(text.as_bytes()).expect("writable");
    put(&format!(
        "{{\"categories\": [{{\"id\": 1, \"name\": \"object\"}}], \"images\": [\n{list}\n], \"annotations\": [\n"
    ));
    let mut stream = Stream::root(1);
    for image in 0..images {
        let shapes: Vec<[f64; 4]> = (0..OBJECTS).map(|_| shape(&mut stream)).collect();
        let mut hidden = Mask::empty(width, height);
        for (object, shape) in shapes.iter().enumerate() {
            let amodal = Mask::from_fn(width, height, |x, y| is_inside(shape, x, y));
            let visible = amodal.minus(&hidden);
            let comma = if image + object > 0 { ",\n" } else { "" };
            put(&format!("{comma}{}", annotation([image, object], &amodal, &visible)));
            hidden = hidden.or(&amodal);
        }
        let level = stream.uniform(60.0, 140.0);
        let rgb = Plane::from_fn(width, height, |x, y| {
            let front = shapes.iter().position(|shape| is_inside(shape, x, y)).map_or(0.0, |it| 8.0 * it as f64 + 10.0);
            [0.9, 1.0, 0.8].map(|tint| (tint * (level + front) + 2.0 * stream.normal()).clamp(0.0, 255.0) as u8)
        });
        let png = PngImage::rgb(&rgb).encode().expect("an image");
        fs::write(data.join("images").join(name(image)), png).expect("writable");
    }
    put("\n]}\n");
}

/// Center and half axes of an ellipse, px.
fn shape(stream: &mut Stream) -> [f64; 4] {
    [(0.0, 160.0), (0.0, 120.0), (6.0, 24.0), (6.0, 24.0)].map(|(low, high)| stream.uniform(low, high))
}

fn is_inside([x, y, a, b]: &[f64; 4], column: u32, row: u32) -> bool {
    let [u, v] = [(f64::from(column) - x) / a, (f64::from(row) - y) / b];
    u * u + v * v <= 1.0
}

/// The record of an object, as the writer `coco` makes it.
fn annotation([image, object]: [usize; 2], amodal: &Mask, visible: &Mask) -> String {
    let hidden = amodal.minus(visible);
    let bbox = |mask: &Mask| <[i32; 4]>::from(mask.bbox());
    let rate = f64::from(hidden.area()) / f64::from(amodal.area().max(1));
    let record = json!({
        "id": image * OBJECTS + object + 1, "image_id": image + 1, "category_id": 1, "segmentation": Rle::encode(amodal),
        "area": amodal.area(), "bbox": bbox(amodal), "iscrowd": 0, "instance_id": object + 1,
        "visible_mask": Rle::encode(visible), "visible_bbox": bbox(visible), "amodal_mask": Rle::encode(amodal),
        "amodal_bbox": bbox(amodal), "occluded_mask": Rle::encode(&hidden), "occluded_rate": rate,
    });
    record.to_string()
}
