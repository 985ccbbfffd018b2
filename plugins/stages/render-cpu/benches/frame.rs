//! A whole frame: a closed room, a table, 20 objects of 16 384 triangles, a ceiling panel and a globe, 640 × 480.
//!
//! `cargo bench -p syntable-render-cpu --bench frame [-- SAMPLES [THREADS [IMAGE.ppm]]]` prints processor seconds for
//! one sample per pixel, rays per path and rays per second, for images of few and of many bounces, and the cost of
//! labels and of the appearance of all objects.

use std::time::Instant;
use syntable_model::prelude::*;
use syntable_model::product::Lighting;
use syntable_model::product::standard::{
    ALBEDO, COVERAGE, COVERAGE_BEFORE_SUPPORT, DEPTH, INSTANCE, NORMAL, OPACITY, RADIANCE,
};
use syntable_render_cpu::CpuPathRenderer;
use syntable_testing::figures::{Figures, Unit, processor_seconds};
use syntable_testing::room;
use syntable_testing::workers::Threads;
use syntable_transport::PathTracing;
use syntable_transport::film::Statistics;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let number = |at: usize, or: u32| arguments.get(at).and_then(|a| a.parse().ok()).unwrap_or(or);
    let (samples, threads) = (number(0, 8), number(1, 2) as usize);
    let workers = Threads(threads);
    let mut figures = Figures::new(env!("CARGO_PKG_NAME"), env!("CARGO_CRATE_NAME"));
    let (scene, view) = (room::scene(), room::view(640, 480));

    for max_bounces in [8, 1] {
        let options = PathTracing { samples_per_pixel: samples, max_bounces, ..PathTracing::default() };
        let mut session = CpuPathRenderer::new(options).session();
        let started = Instant::now();
        session.load(&scene, &workers).expect("loads");
        if max_bounces == 8 {
            println!("load: {:.2} s", started.elapsed().as_secs_f64());
        }
        let mut render = |wants: &[KeyId]| {
            let mut frame = Products::new();
            let before = session.statistics();
            let (started, cpu) = (Instant::now(), processor_seconds());
            let request = RenderRequest::new(&view, wants, Stream::root(1), &workers);
            session.render(&request, &mut frame).expect("renders");
            let (wall, cpu) = (started.elapsed().as_secs_f64(), processor_seconds() - cpu);
            let now = session.statistics();
            let traced = Statistics {
                paths: now.paths - before.paths,
                rays: now.rays - before.rays,
                shadow_rays: now.shadow_rays - before.shadow_rays,
            };
            (frame, traced, wall, cpu)
        };
        let (frame, traced, wall, cpu) = render(&[RADIANCE.id()]);
        let per_sample = f64::from(samples);
        let all = (traced.rays + traced.shadow_rays) as f64;
        println!(
            "{max_bounces} bounces, {samples} samples, {threads} threads: {:.3} s wall, {:.3} s processor a sample; {:.2} rays and \
             {:.2} shadow rays a path; {:.2} Mrays/s a processor",
            wall / per_sample,
            cpu / per_sample,
            traced.rays as f64 / traced.paths as f64,
            traced.shadow_rays as f64 / traced.paths as f64,
            all / cpu / 1e6,
        );
        figures.keep(&format!("sample of {max_bounces} bounces, processor"), cpu / per_sample, Unit::Seconds);
        if max_bounces == 8 {
            if let Some(path) = arguments.get(2) {
                write_ppm(path, frame.get(RADIANCE).expect("made"));
            }
            let labels: [(&str, &[KeyId]); 2] = [
                (
                    "depth, instance, coverage",
                    &[DEPTH.id(), INSTANCE.id(), COVERAGE.id(), COVERAGE_BEFORE_SUPPORT.id()],
                ),
                ("normal, albedo", &[NORMAL.id(), ALBEDO.id()]),
            ];
            for (name, wants) in labels {
                let (_, _, wall, cpu) = render(wants);
                println!("{name}: {wall:.3} s wall, {cpu:.2} s processor");
                figures.keep(name, wall, Unit::Seconds);
            }
            let coverage = render(&[COVERAGE.id()]).0;
            let atlas = Atlas::of(coverage.get(COVERAGE).expect("made"));
            for lighting in Lighting::ALL {
                let wants = [RADIANCE.id(), OPACITY.id()];
                let request = RenderRequest::new(&view, &wants, Stream::root(1), &workers).of_objects(&atlas, lighting);
                let (started, pixels) = (Instant::now(), request.pixels() as f64 / (640.0 * 480.0));
                session.render(&request, &mut Products::new()).expect("renders");
                let (wall_objects, objects) = (started.elapsed().as_secs_f64(), atlas.tiles.len());
                figures.keep(&format!("appearance of objects, {lighting:?}"), wall_objects, Unit::Seconds);
                println!(
                    "{objects} objects {lighting:?}: windows of {pixels:.2} images, {:.3} of the time of the image",
                    wall_objects / wall
                );
            }
        }
    }
}

fn write_ppm(path: &str, plane: &Plane<[f32; 3]>) {
    let mut bytes = format!("P6 {} {} 255\n", plane.width(), plane.height()).into_bytes();
    let mut sorted: Vec<f32> = plane.data().iter().map(|p| p[0].max(p[1]).max(p[2])).collect();
    sorted.sort_by(f32::total_cmp);
    let white = sorted[sorted.len() * 96 / 100];
    bytes.extend(
        plane.data().iter().flatten().map(|x| ((x / white).clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0 + 0.5) as u8),
    );
    std::fs::write(path, bytes).expect("the image can be written");
}
