//! Time and quality of settling 40 objects on a table of 1.2 m by 0.8 m.
//!
//! `cargo bench -p syntable-physics` prints one line per seed: core seconds, simulated time, the actions of the acceptance
//! check, and the figures of the report. `SEEDS` is the number of seeds (5), and `OPTIONS` has options of the settler with `;`
//! between them. It uses real objects (Google Scanned Objects and YCB) if it finds them.

#[path = "../tests/kit/mod.rs"]
mod kit;

use kit::*;
use std::sync::Arc;
use syntable_model::scene::{Object, SceneBuilder};
use syntable_testing::figures::{Figures, Unit, processor_seconds};

const COUNT: usize = 40;

fn scene(objects: &[Arc<Object>], seed: u64) -> SceneBuilder {
    let mut scene = table_scene();
    drop_objects(&mut scene, objects, COUNT, seed);
    scene
}

fn table(figures: &mut Figures, name: &str, objects: &[Arc<Object>], options: &str, seeds: u64) {
    println!("{COUNT} of {} {name}, options [{options}]", objects.len());
    let (settler, cache) = (settler(options), MemoryCache::default());
    // The parts are computed before the clock starts.
    let start = std::time::Instant::now();
    let mut all = table_scene();
    for (i, object) in objects.iter().enumerate() {
        all.add(dynamic(object, at(0.0, 0.0, 2.0 + i as f64)));
    }
    settle_with(
        &*kit::settler(&format!("{options}\nduration_s = 0.01\nremove = \"keep\"\non_violation = \"keep\"")),
        &mut all,
        &cache,
    )
    .expect("settles");
    println!("  convex parts made in {:.1} s", start.elapsed().as_secs_f64());
    let mut total = 0.0;
    for seed in 0..seeds {
        let mut scene = scene(objects, seed);
        // Warm: parts from the cache.
        let before = processor_seconds();
        let start = std::time::Instant::now();
        let report = settle_with(&*settler, &mut scene, &cache).expect("settles");
        let wall = start.elapsed().as_secs_f64();
        let core = processor_seconds() - before;
        total += core;
        let rejected = report.removed.iter().filter(|removal| !removal.reason.contains("table")).count();
        println!(
            "  seed {seed}: {core:.2} core s, {wall:.2} s, {:.2} s simulated, {} respawned, {} off the table, {rejected} rejected; \
             {:.1} mm deep, {:.4} m/s, {:.3} rad/s",
            report.simulated_s,
            report.respawned,
            report.removed.len() - rejected,
            report.deepest_penetration_m * 1e3,
            report.residual_speed_m_s,
            report.residual_angular_speed_rad_s,
        );
    }
    figures.put(&format!("settling {COUNT} of {name}"), total / seeds as f64, Unit::Seconds);
}

fn main() {
    let seeds = std::env::var("SEEDS").ok().and_then(|seeds| seeds.parse().ok()).unwrap_or(5);
    let options = std::env::var("OPTIONS").unwrap_or_default().replace(';', "\n");
    let mut figures = Figures::new(env!("CARGO_PKG_NAME"), env!("CARGO_CRATE_NAME"));
    let as_released =
        "collision = \"convex_hull\"\nmass = { kg = 1.0 }\non_violation = \"keep\"\ntime_step_s = 0.016666666666666666";
    table(&mut figures, "shapes of the kit", &kit_objects(), &options, seeds);
    table(&mut figures, "hulls of the kit as released", &kit_objects(), as_released, seeds);
    if let Some(root) = assets().last() {
        table(&mut figures, "real objects", &real_objects(root), &options, seeds);
    }
}
