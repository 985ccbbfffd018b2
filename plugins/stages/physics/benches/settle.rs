//! Time and quality of settling 40 objects on a table of 1.2 m by 0.8 m.
//!
//! `cargo bench -p syntable-physics` first prints one line per seed: core seconds, simulated time, the actions of the
//! acceptance check, and the figures of the report. It uses real objects (Google Scanned Objects and YCB) if it finds
//! them.

#[path = "../tests/kit/mod.rs"]
mod kit;

use kit::*;
use std::sync::Arc;
use syntable_model::scene::{Object, SceneBuilder};
use syntable_model::stage::Settler;

const COUNT: usize = 40;

fn scene(objects: &[Arc<Object>], seed: u64) -> SceneBuilder {
    let mut scene = table_scene();
    drop_objects(&mut scene, objects, COUNT, seed);
    scene
}

/// CPU time of this process, s; `None` on systems without /proc.
fn cpu_s() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    let fields: Vec<&str> = stat.rsplit(')').next()?.split_whitespace().collect();
    Some((fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?) / 100.0)
}

fn table(name: &str, objects: &[Arc<Object>], options: &str, seeds: u64) {
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
        let before = cpu_s();
        let start = std::time::Instant::now();
        let report = settle_with(&*settler, &mut scene, &cache).expect("settles");
        let wall = start.elapsed().as_secs_f64();
        let core = before.zip(cpu_s()).map_or(wall, |(before, after)| after - before);
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
    println!("  mean {:.2} core s", total / seeds as f64);
}

fn bench(bencher: divan::Bencher, settler: &dyn Settler, objects: &[Arc<Object>]) {
    let cache = MemoryCache::default();
    settle_with(settler, &mut scene(objects, 0), &cache).expect("settles");
    bencher
        .with_inputs(|| scene(objects, 0))
        .bench_local_values(|mut scene| settle_with(settler, &mut scene, &cache).expect("settles"));
}

#[divan::bench(sample_count = 5)]
fn forty_kit_shapes(bencher: divan::Bencher) {
    bench(bencher, &*settler(""), &kit_objects());
}

#[divan::bench(sample_count = 5)]
fn forty_kit_hulls_as_released(bencher: divan::Bencher) {
    let options =
        "collision = \"convex_hull\"\nmass = { kg = 1.0 }\non_violation = \"keep\"\ntime_step_s = 0.016666666666666666";
    bench(bencher, &*settler(options), &kit_objects());
}

#[divan::bench(sample_count = 5)]
fn forty_real_objects(bencher: divan::Bencher) {
    if let Some(root) = assets().last() {
        bench(bencher, &*settler(""), &real_objects(root));
    }
}

fn main() {
    let seeds = std::env::var("SEEDS").ok().and_then(|seeds| seeds.parse().ok()).unwrap_or(5);
    let options = std::env::var("OPTIONS").unwrap_or_default().replace(';', "\n");
    if !std::env::args().any(|argument| argument == "--test" || argument == "--list") {
        table("shapes of the kit", &kit_objects(), &options, seeds);
        if let Some(root) = assets().last() {
            table("real objects", &real_objects(root), &options, seeds);
        }
    }
    if std::env::var_os("FIGURES").is_none() {
        divan::main();
    }
}
