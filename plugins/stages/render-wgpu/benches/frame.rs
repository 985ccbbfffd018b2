//! A whole frame on a graphics card: a closed room, a table, 20 objects of 16 384 triangles, a ceiling panel and a
//! globe, 640 × 480, with 8 bounces.
//!
//! `cargo bench -p syntable-render-wgpu --bench frame [-- ADAPTER]` prints the time to the first image, milliseconds
//! per frame for several numbers of samples, rays per second, the cost of labels and of guides, the difference of the
//! denoised image from an image of 4096 samples, and the time per frame with several views in flight, as in a run.

use std::sync::{Arc, Barrier};
use std::thread;
use std::time::Instant;
use syntable_guided::Guided;
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    ALBEDO, COVERAGE, COVERAGE_BEFORE_SUPPORT, DENOISE_ALBEDO, DEPTH, INSTANCE, NORMAL, RADIANCE, RENDER_REPORT,
};
use syntable_model::scene::Scene;
use syntable_render_wgpu::{Adapters, GpuPathRenderer};
use syntable_testing::errors::{psnr, white};
use syntable_testing::figures::{Figures, Unit};
use syntable_testing::room::{self, Look};
use syntable_testing::workers::Pool;
use syntable_transport::PathTracing;

/// Frames to render; the fastest counts.
const FRAMES: usize = 5;

/// Views that are rendered at the same time, as in a run on each card, and frames of each.
const IN_FLIGHT: usize = 2;
const FRAMES_IN_FLIGHT: usize = 30;

/// Samples of the reference image for denoised images.
const CONVERGED: u32 = 4096;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let adapter = arguments.first().and_then(|a| a.parse().ok()).unwrap_or(0);
    let found = Adapters::find().used().unwrap_or_default();
    let Some(info) = found.get(adapter) else { return println!("no adapter is called {adapter}") };
    println!("{info}");
    let mut figures = Figures::new(env!("CARGO_PKG_NAME"), env!("CARGO_CRATE_NAME"));
    let workers = Pool::new(std::thread::available_parallelism().map_or(2, usize::from));
    let view = room::view(640, 480);
    for look in [Look::Mixed, Look::Plastic, Look::Glass] {
        let scene = room::scene_of(look);
        let converged = {
            let options = PathTracing { samples_per_pixel: CONVERGED, ..PathTracing::default() };
            let mut session = GpuPathRenderer::new(options).open(adapter).expect("opens");
            session.load(&scene, &workers).expect("loads");
            let mut frame = Products::new();
            let wants = [RADIANCE.id()];
            session.render(&RenderRequest::new(&view, &wants, Stream::root(2), &workers), &mut frame).expect("renders");
            frame.get(RADIANCE).expect("made").data().to_vec()
        };
        let white = white(&converged);
        for samples in [1, 4, 16, 32, 64] {
            let started = Instant::now();
            let options = PathTracing { samples_per_pixel: samples, ..PathTracing::default() };
            let renderer = GpuPathRenderer::new(options);
            let mut session = renderer.open(adapter).expect("opens");
            session.load(&scene, &workers).expect("loads");
            let loaded = started.elapsed().as_secs_f64();
            let guided = Guided::default();
            let mut best = |wants: &[KeyId], denoiser: Option<&dyn Denoiser>| {
                let (mut fastest, mut frame) = (f64::INFINITY, Products::new());
                for _ in 0..FRAMES {
                    let started = Instant::now();
                    frame = Products::new();
                    let request =
                        RenderRequest { denoiser, ..RenderRequest::new(&view, wants, Stream::root(1), &workers) };
                    session.render(&request, &mut frame).expect("renders");
                    fastest = fastest.min(started.elapsed().as_secs_f64());
                }
                (fastest, frame)
            };
            let first = Instant::now();
            best(&[RADIANCE.id()], None);
            let first = first.elapsed().as_secs_f64();
            let (light, _) = best(&[RADIANCE.id()], None);
            let (denoised, image) = best(&[RADIANCE.id()], Some(&guided));
            let near = psnr(image.get(RADIANCE).expect("made").data(), &converged, white);
            let (_, report) = best(&[RADIANCE.id(), RENDER_REPORT.id()], None);
            let (guides, _) = best(&[RADIANCE.id(), DENOISE_ALBEDO.id()], None);
            let count = |name: &str| match report.get(RENDER_REPORT) {
                Ok(Value::Record(fields)) => {
                    fields.iter().find(|(field, _)| field == name).map_or(f64::NAN, |(_, count)| {
                        if let Value::Int(count) = count { *count as f64 } else { f64::NAN }
                    })
                }
                _ => f64::NAN,
            };
            let in_flight = |wants: &[KeyId], denoiser: Option<&dyn Denoiser>| {
                1e3 * seconds_in_flight(&renderer, adapter, &scene, wants, denoiser)
            };
            let flying = [in_flight(&[RADIANCE.id()], None), in_flight(&[RADIANCE.id()], Some(&guided))];
            let (rays, shadows) = (count("rays"), count("shadow_rays"));
            println!(
                "{look:?}, {samples} samples: {:.1} ms; {:.2} + {:.2} rays and shadow rays a path, {:.2} Grays/s; with guides {:.1} \
                 ms, denoised {:.1} ms, {near:.1} dB; {IN_FLIGHT} in flight {:.1} ms, denoised {:.1} ms; loaded in {loaded:.2} s, first {FRAMES} frames {first:.2} s",
                1e3 * light,
                rays / count("paths"),
                shadows / count("paths"),
                (rays + shadows) / light / 1e9,
                1e3 * guides,
                1e3 * denoised,
                flying[0],
                flying[1],
            );
            let mut keep = |name: &str, value: f64, unit: Unit| {
                figures.keep(&format!("{look:?}, samples {samples}, {name}"), value, unit);
            };
            keep("image", light, Unit::Seconds);
            keep("denoised image", denoised, Unit::Seconds);
            keep("denoised images in flight", 1e-3 * flying[1], Unit::Seconds);
            keep("rays", (rays + shadows) / light, Unit::PerSecond);
            keep("error of the denoised image", near, Unit::Decibels);
            if samples == 1 {
                let masks = [DEPTH.id(), INSTANCE.id(), COVERAGE.id(), COVERAGE_BEFORE_SUPPORT.id()];
                let (labels, _) = best(&masks, None);
                let (shaded, _) = best(&[NORMAL.id(), ALBEDO.id()], None);
                keep("labels", labels, Unit::Seconds);
                keep("normals and albedo", shaded, Unit::Seconds);
                println!(
                    "{look:?}, labels: {:.2} ms, {IN_FLIGHT} in flight {:.2} ms; normals and albedo {:.2} ms",
                    1e3 * labels,
                    in_flight(&masks, None),
                    1e3 * shaded
                );
            }
        }
    }
}

/// Seconds per frame with several views at the same time, each in its own session.
fn seconds_in_flight(
    renderer: &GpuPathRenderer,
    adapter: usize,
    scene: &Arc<Scene>,
    wants: &[KeyId],
    denoiser: Option<&dyn Denoiser>,
) -> f64 {
    let (ready, done) = (Barrier::new(IN_FLIGHT + 1), Barrier::new(IN_FLIGHT + 1));
    let cores = thread::available_parallelism().map_or(2, usize::from);
    thread::scope(|scope| {
        for _ in 0..IN_FLIGHT {
            scope.spawn(|| {
                let (view, workers) = (room::view(640, 480), Pool::new((cores / IN_FLIGHT).max(1)));
                let mut session = renderer.open(adapter).expect("opens");
                session.load(scene, &workers).expect("loads");
                let mut render = || {
                    let request =
                        RenderRequest { denoiser, ..RenderRequest::new(&view, wants, Stream::root(1), &workers) };
                    session.render(&request, &mut Products::new()).expect("renders");
                };
                render();
                ready.wait();
                (0..FRAMES_IN_FLIGHT).for_each(|_| render());
                done.wait();
            });
        }
        ready.wait();
        let started = Instant::now();
        done.wait();
        started.elapsed().as_secs_f64() / (IN_FLIGHT * FRAMES_IN_FLIGHT) as f64
    })
}
