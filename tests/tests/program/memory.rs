//! Memory stays flat over many scenes.

use crate::support::small_run;
use std::io::{BufRead, BufReader};
use std::process::Stdio;

#[test]
fn two_hundred_scenes_take_the_memory_of_one_hundred() {
    let folder = tempfile::tempdir().expect("a folder");
    // With few assets, the data kept between scenes is soon complete, so a leak would show.
    let set = [
        "dataset.scenes=200",
        "assets.objects.variants_per_family=1",
        "assets.floors.variants_per_family=1",
        "assets.walls.variants_per_family=1",
        "assets.tabletops.variants_per_family=1",
        "assets.tables.variants_per_design=1",
        "settle.duration_s=0.3",
        "settle.on_violation=keep",
        "settle.remove=keep",
        "render.samples_per_pixel=1",
        "camera.resolution=[32, 24]",
    ];
    let mut command = small_run(folder.path(), &["--views", "1", "--log-format", "json"]);
    command.args(set.iter().flat_map(|set| ["--set", set]));
    let mut run = command.stderr(Stdio::piped()).stdout(Stdio::null()).spawn().expect("starts");
    let resident = |pid: u32| -> Option<f64> {
        let text = std::fs::read_to_string(format!("/proc/{pid}/statm")).ok()?;
        Some(text.split_whitespace().nth(1)?.parse::<f64>().ok()? * 4096.0 / 1e6)
    };
    let mut megabytes = Vec::new();
    let pid = run.id();
    for line in BufReader::new(run.stderr.take().expect("piped")).lines() {
        let line = line.expect("text");
        if line.contains("\"event\":\"scene\"") {
            megabytes.extend(resident(pid));
        }
    }
    assert!(run.wait().expect("waits").success());
    if megabytes.is_empty() {
        eprintln!("skipped: this system does not tell a process's memory");
        return;
    }
    assert!(megabytes.len() >= 190, "{} scenes seen", megabytes.len());
    let peak = |range: std::ops::Range<usize>| megabytes[range].iter().copied().fold(0.0, f64::max);
    let (early, late) = (peak(0..100), peak(150..190));
    assert!(late < early * 1.15 + 16.0, "{early:.0} MB in the first half, {late:.0} MB at the end");
}
