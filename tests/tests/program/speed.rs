//! The comparison of two commits' speed.

use crate::support::{root, skip};
use serde_json::{Value as Json, json};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// Writes the figures of a round.
fn write(folder: &Path, round: usize, figures: &Json) {
    let folder = folder.join(round.to_string());
    fs::create_dir_all(&folder).expect("writable");
    fs::write(folder.join("syntable-some.bench.json"), figures.to_string()).expect("writable");
}

fn compared(before: &Path, after: &Path) -> Option<Output> {
    let script = root().join(".ci/compare-speed");
    let ended = Command::new("python3").arg(script).arg("--figures").args([before, after]).output();
    if ended.is_err() {
        skip("python3");
    }
    ended.ok()
}

#[test]
fn slower_figures_are_found_and_noise_is_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let [before, after] = ["before", "after"].map(|name| folder.path().join(name));
    let figures = |[steady, noisy, rate, error]: [f64; 4]| {
        json!([
            { "name": "steady", "value": steady, "unit": "s" },
            { "name": "noisy", "value": noisy, "unit": "s" },
            { "name": "rate", "value": rate, "unit": "1/s" },
            { "name": "error", "value": error, "unit": "dB" },
        ])
    };
    // The noisy figure's best is 15 % slower, but as fast as in a round before.
    write(&before, 0, &figures([2.0, 1.0, 100.0, 35.0]));
    write(&before, 1, &figures([2.1, 1.2, 90.0, 35.0]));
    write(&after, 0, &figures([2.0, 1.15, 50.0, 34.0]));
    write(&after, 1, &figures([1.0, 1.3, 60.0, 34.0]));
    let Some(ended) = compared(&before, &after) else { return };
    let [table, errors] = [&ended.stdout, &ended.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
    assert_eq!(ended.status.code(), Some(1), "{table}{errors}");
    let rows = [
        "| some.bench | steady | 2 s | 1 s | 0.50 | 2.00 |",
        "| some.bench | noisy | 1 s | 1.15 s | 1.15 | 1.20 |",
        "| some.bench | rate | 100 1/s | 60 1/s | **1.67** | 1.20 |",
        "| some.bench | error | 35 dB | 34 dB | **-1.00 dB** | 1.00 |",
    ];
    assert_eq!(table.lines().skip(2).collect::<Vec<_>>(), rows);
    assert_eq!(errors.lines().filter(|line| line.starts_with("slower: ")).count(), 2, "{errors}");
    let same = compared(&before, &before).expect("as before");
    assert!(same.status.success(), "{}", String::from_utf8_lossy(&same.stderr));
}
