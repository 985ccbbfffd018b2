//! Errors of images before and after denoising, against a reference of many samples.
//!
//! `cargo bench -p syntable-denoise --bench quality [-- LOOK [REFERENCE [REGULARIZE [FOLDER]]]]` renders the center of
//! the room of the renderer's bench with 1 to 64 samples per pixel and with `REFERENCE` (512), all with the option
//! `regularize = REGULARIZE` (0.3, as in recipes), and writes the images to `FOLDER`. `LOOK` is the material of the
//! objects: `mixed`, `glass`, `plastic`, `metal`, or `all` in turn. The reference has noise too: 512 samples suffice
//! for errors down to about 45 dB. `SYNTABLE_OIDN` names Open Image Denoise, to compare it as well.
//!
//! The first columns cover the whole image; the columns after the bar cover only the objects. PSNR is of the
//! sRGB-encoded image, white at 5.56 times the log-average luminance. relMSE is the mean over pixels and channels of (x
//! − r)² / (r² + 0.01 m²), r the reference and m its mean luminance.

#[path = "../tests/common/mod.rs"]
mod common;

use common::denoise;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;
use syntable_denoise as _;
use syntable_model::prelude::*;
use syntable_model::product::standard::{INSTANCE, RADIANCE, RADIANCE_NOISY};
use syntable_model::registry::{Registry, Slot};
use syntable_render_cpu::CpuPathRenderer;
use syntable_testing::errors::{Image, psnr, relative_error, srgb, white};
use syntable_testing::figures::{Figures, Unit};
use syntable_testing::room::{self, Look};
use syntable_testing::workers::Threads;
use syntable_transport::PathTracing;

const WIDTH: u32 = 320;
const HEIGHT: u32 = 240;

const LOOKS: [(&str, Look); 4] =
    [("mixed", Look::Mixed), ("glass", Look::Glass), ("plastic", Look::Plastic), ("metal", Look::Metal)];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let chosen = arguments.first().map_or("mixed", String::as_str);
    let many = arguments.get(1).and_then(|a| a.parse().ok()).unwrap_or(512);
    let regularize = arguments.get(2).and_then(|a| a.parse().ok()).unwrap_or(0.3);
    let folder = arguments.get(3);
    let mut denoisers = vec![("guided", denoiser("guided", ""))];
    match std::env::var("SYNTABLE_OIDN") {
        Ok(library) => denoisers.push(("oidn", denoiser("oidn", &format!("library = {library:?}")))),
        Err(_) => println!("SYNTABLE_OIDN is not set: no comparison with Open Image Denoise"),
    }
    let mut figures = Figures::new(env!("CARGO_PKG_NAME"), env!("CARGO_CRATE_NAME"));
    for (name, look) in LOOKS.into_iter().filter(|(name, _)| ["all", name].contains(&chosen)) {
        println!("{name}");
        compare(
            &mut figures,
            name,
            look,
            &denoisers,
            (many, regularize),
            folder.map(|folder| Path::new(folder).join(name)).as_deref(),
        );
    }
}

/// Prints the errors of one look, and writes its images to the folder.
fn compare(
    figures: &mut Figures,
    look_name: &str,
    look: Look,
    denoisers: &[(&str, Box<dyn Denoiser>)],
    (many, regularize): (u32, f64),
    folder: Option<&Path>,
) {
    let (scene, view) = (room::scene_of(look), room::view(WIDTH, HEIGHT));
    let wants: Vec<KeyId> = denoisers.iter().flat_map(|(_, denoiser)| denoiser.reads()).collect();
    let rendered = render(&scene, &view, (many, regularize), 100, &[RADIANCE_NOISY.id(), INSTANCE.id()]);
    let objects = scene.objects().len();
    let is_object: Vec<bool> = rendered
        .get(INSTANCE)
        .expect("made")
        .data()
        .iter()
        .map(|id| (1..=objects).contains(&usize::from(id.0)))
        .collect();
    let of_objects = |image: &Image| -> Vec<[f32; 3]> {
        image.iter().zip(&is_object).filter(|(_, is)| **is).map(|(pixel, _)| *pixel).collect()
    };
    let reference = rendered.get(RADIANCE_NOISY).expect("made").data();
    let white = white(reference);
    let keep = |name: &str, image: &Image| {
        if let Some(folder) = folder {
            std::fs::create_dir_all(folder).expect("the folder can be made");
            write(&folder.join(name), image, white);
        }
    };
    keep("reference.png", reference);
    println!("samples  image       PSNR    relMSE  light  |     PSNR    relMSE  light     time");
    for samples in [1, 2, 4, 8, 16, 32, 64] {
        let products = render(&scene, &view, (samples, regularize), 1, &wants);
        let noisy = products.get(RADIANCE_NOISY).expect("made").data();
        let mut report = |name: &str, image: &Image, seconds: f64| {
            let errors = |image: &Image, reference: &Image| {
                let light = sum(image) / sum(reference);
                format!(
                    "{:6.2} dB  {:8.5}  {light:.4}",
                    psnr(image, reference, white),
                    relative_error(image, reference)
                )
            };
            let [whole, part] = [errors(image, reference), errors(&of_objects(image), &of_objects(reference))];
            println!("{samples:7}  {name:8} {whole} | {part}  {:4.0} ms", 1e3 * seconds);
            let error = format!("{look_name}, samples {samples}, {name}");
            figures.keep(&error, psnr(image, reference, white), Unit::Decibels);
            keep(&format!("{name}-{samples}.png"), image);
        };
        report("noisy", noisy, 0.0);
        for (name, denoiser) in denoisers {
            let run = || {
                let started = Instant::now();
                (denoise(&**denoiser, &products, &threads()).expect("denoises"), started.elapsed().as_secs_f64())
            };
            let (first, second) = (run(), run());
            report(name, first.0.get(RADIANCE).expect("provided").data(), first.1.min(second.1));
        }
    }
}

fn denoiser(kind: &str, options: &str) -> Box<dyn Denoiser> {
    let registry = Registry::linked().expect("no clash");
    let entry = registry.find(Slot::Denoise, kind).expect("registered");
    match entry.construct_str(options).map(|made| made.stage) {
        Ok(syntable_model::registry::Stage::Denoise(denoiser)) => denoiser,
        _ => panic!("`{kind}` cannot be made with `{options}`"),
    }
}

fn render(scene: &Arc<Scene>, view: &View, (samples, regularize): (u32, f64), seed: u64, wants: &[KeyId]) -> Products {
    let options = PathTracing { samples_per_pixel: samples, regularize, ..PathTracing::default() };
    let mut session = CpuPathRenderer::new(options).session();
    session.load(scene, &threads()).expect("loads");
    let mut products = Products::new();
    // The renderer provides the noisy image as the product `radiance`.
    let mut wants: Vec<KeyId> =
        wants.iter().map(|&key| if key == RADIANCE_NOISY.id() { RADIANCE.id() } else { key }).collect();
    wants.sort_by_key(|key| key.product_id());
    wants.dedup();
    let threads = threads();
    let request = RenderRequest::new(view, &wants, Stream::root(seed), &threads);
    session.render(&request, &mut products).expect("renders");
    products.rename(RADIANCE.id(), RADIANCE_NOISY.id()).expect("not there yet");
    products
}

/// All cores.
fn threads() -> Threads {
    Threads(std::thread::available_parallelism().map_or(1, usize::from))
}

fn sum(image: &Image) -> f64 {
    image.iter().flatten().map(|&x| f64::from(x)).sum()
}

fn write(path: &Path, image: &Image, white: f64) {
    let bytes: Vec<u8> = image.iter().flatten().map(|&x| (srgb(f64::from(x) / white) * 255.0 + 0.5) as u8).collect();
    let file = std::fs::File::create(path).expect("the folder exists");
    let mut encoder = png::Encoder::new(file, WIDTH, HEIGHT);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().and_then(|mut writer| writer.write_image_data(&bytes)).expect("the image can be written");
}
