//! Photographs behind scenes: a photograph of the empty stand-in gives the image that the renderer makes of the whole scene.

use crate::support::{fails, made, small_dataset_run};
use std::path::Path;
use syntable_formats::decode::FileContent;
use syntable_model::error::Result;
use syntable_model::product::standard::{EXPOSURE, INSTANCE, RGB};
use syntable_model::product::{Key, Plane, Product, Value};
use syntable_testing::takes::open_dataset;

/// Makes a small dataset with two views, developed without a tone curve. Its arrays have the image and the empty scene.
fn run(out: &Path, denoiser: &str, plate: &str) -> std::process::Command {
    let sensor = format!("sensor.rgb_camera={{ tone = \"linear\"{plate} }}");
    let arrays = "write={ npz = { include = [\"rgb\", \"exposure\", \"instance\"] }, \
                  npy = { include = [\"radiance (furniture alone)\"] } }";
    let denoiser = format!("denoise.kind=\"{denoiser}\"");
    small_dataset_run(
        out,
        &[
            "render.samples_per_pixel=16",
            "dataset.scenes=1",
            "dataset.views_per_scene=2",
            "place[2].count=24",
            &sensor,
            arrays,
            &denoiser,
        ],
    )
}

fn product<T: Product + Clone>(dataset: &Path, view: usize, key: Key<T>) -> Result<T> {
    let (_, dataset) = open_dataset(&dataset.join("npz"), None)?;
    dataset.read(view, &[key.id()])?.products.get(key).cloned()
}

/// Radiance of a view without objects.
fn empty(dataset: &Path, view: usize) -> Plane<[f32; 3]> {
    let path = dataset.join(format!("npy/radiance (furniture alone)/000000_{view:04}.npy"));
    let array = FileContent::read(&path).expect("written").npy().expect("readable");
    let [height, width, 3] = array.shape[..] else { panic!("{:?}", array.shape) };
    let numbers: Vec<f32> = array.bytes.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
    Plane::from_vec(width as u32, height as u32, numbers.as_chunks().0.to_vec())
}

/// Light that becomes white, nits.
fn white(exposure: &Value) -> f32 {
    let Value::Record(fields) = exposure else { panic!("no record: {exposure:?}") };
    match fields.iter().find(|(name, _)| name == "white_nits") {
        Some((_, Value::Float(white))) => *white as f32,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_photograph_of_the_empty_scene_gives_the_rendered_image() {
    gives_the_rendered_image("none", 6, 12, 100);
}

/// The denoiser smooths the parts apart, and silhouettes get no specks.
#[test]
fn a_denoised_plate_gives_the_denoised_image() {
    gives_the_rendered_image("guided", 4, 5, 50);
}

/// Codes may be apart by `noise`. Where they are apart by `shadow`, objects change the stand-in,
/// in more than `shadows` pixels.
fn gives_the_rendered_image(denoiser: &str, noise: u8, shadow: u8, shadows: u32) {
    let folder = tempfile::tempdir().expect("a folder");
    let (rendered, photographs) = (folder.path().join("rendered"), folder.path().join("photographs"));
    made(&mut run(&rendered, denoiser, ""));
    std::fs::create_dir(&photographs).expect("created");
    for view in 0..2 {
        let empty = empty(&rendered, view);
        let white = white(&product(&rendered, view, EXPOSURE).expect("made"));
        let photograph = image::RgbImage::from_fn(empty.width(), empty.height(), |x, y| {
            image::Rgb(empty.at(x, y).map(|nits| (255.0 * nits / white + 0.5).clamp(0.0, 255.0) as u8))
        });
        photograph.save(photographs.join(format!("{view}.png"))).expect("written");
    }
    let composed = folder.path().join("composed");
    let plate = format!(", plate = {{ photographs = {photographs:?}, order = \"by_view\" }}");
    made(&mut run(&composed, denoiser, &plate));
    let (mut compared, mut off, mut shadowed) = (0, 0, 0);
    for view in 0..2 {
        let [want, got] = [&rendered, &composed].map(|dataset| product(dataset, view, RGB).expect("made"));
        let labels = [&rendered, &composed].map(|dataset| product(dataset, view, INSTANCE).expect("made"));
        assert!(labels[0] == labels[1], "a plate changed labels");
        let photograph = image::open(photographs.join(format!("{view}.png"))).expect("readable").to_rgb8();
        for y in 0..want.height() {
            for x in 0..want.width() {
                let (code, want, got) = (photograph.get_pixel(x, y).0, want.at(x, y), got.at(x, y));
                // A photograph knows neither light beyond white nor fine steps in the dark.
                if code.iter().any(|code| !(16..=254).contains(code)) {
                    continue;
                }
                let far = |a: &[u8; 3], b: &[u8; 3], by: u8| (0..3).any(|c| a[c].abs_diff(b[c]) > by);
                compared += 1;
                off += u32::from(far(want, got, noise));
                shadowed += u32::from(labels[0].at(x, y).0 > 24 && far(&code, want, shadow));
            }
        }
    }
    println!("{compared} pixels, {off} differ, objects change {shadowed} of the stand-in");
    assert!(compared > 5000 && shadowed > shadows && off * 200 <= compared, "{compared} {shadowed} {off}");
    // The dataset states the photograph of each view.
    let Value::Record(fields) = product(&composed, 1, EXPOSURE).expect("made") else { panic!("no record") };
    let stated = fields.iter().find(|(name, _)| name == "plate").map(|(_, plate)| plate.clone());
    assert_eq!(stated, Some(Value::record([("photograph", "1.png".into())])));
    // Another photograph would change later scenes.
    std::fs::copy(photographs.join("1.png"), photographs.join("2.png")).expect("copied");
    let message = fails(&mut run(&composed, denoiser, &plate), 2);
    assert!(message.contains("`sensor.rgb_camera.plate.photographs` has changed since the dataset began"), "{message}");
}

#[test]
fn missing_photographs_end_the_run_before_it_begins() {
    let folder = tempfile::tempdir().expect("a folder");
    let nowhere = folder.path().join("nowhere");
    let message =
        fails(&mut run(&folder.path().join("out"), "none", &format!(", plate = {{ photographs = {nowhere:?} }}")), 2);
    assert!(message.contains("nowhere"), "{message}");
    let message = fails(&mut run(&folder.path().join("out"), "none", ", plate = {}"), 2);
    assert!(message.contains("needs the cameras of a recorded scene"), "{message}");
}
