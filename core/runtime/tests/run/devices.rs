//! Devices that fail: what a driver does to a run must not show in its dataset.

use crate::growth::assert_same;
use crate::kit::{Counters, fail_next, failures_left, options, run, run_with};
use std::path::Path;
use syntable_model::error::Error;
use syntable_runtime::run::RunOptions;
use syntable_runtime::run::journal::JournalEntry;
use syntable_runtime::run::progress::Quiet;
use syntable_testing::folder::files;

/// Three scenes of two views.
fn recipe(tally: usize, rest: &str) -> String {
    format!(
        "[dataset]\nscenes = 3\nviews_per_scene = 2\nname = \"devices\"\nmax_attempts = 4\n\
         [[place]]\nkind = \"boxes\"\n[settle]\nkind = \"rapier\"\ntally = {tally}\n\
         [render]\nkind = \"sleeper\"\ntally = {tally}\n{rest}"
    )
}

const LIGHT: &str = "[write.lines]\ninclude = [\"light\"]\n";
const THOUGHT: &str = "[write.more]\nkind = \"lines\"\ninclude = [\"thought\"]\n";

fn lost() -> Error {
    Error::device("the device was lost")
}

fn entry(folder: &Path, scene: u32) -> JournalEntry {
    let text = std::fs::read_to_string(folder.join(".syntable/journal.jsonl")).expect("a journal");
    let mut entries = text.lines().map(|line| serde_json::from_str::<JournalEntry>(line).expect("a line"));
    entries.find(|entry| entry.scene == scene).expect("its line")
}

#[test]
fn an_attempt_is_repeated_until_the_device_is_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let (shaken, whole) = (folder.path().join("shaken"), folder.path().join("whole"));
    run(&recipe(16, LIGHT), &whole, 2).expect("whole");
    for threads in [1, 3] {
        fail_next(16, 0, 1, lost());
        fail_next(16, 2, 2, lost());
        run_with(&recipe(16, LIGHT), RunOptions { overwrite: true, ..options(&shaken, threads) }, &Quiet)
            .expect("recovers");
        assert_eq!([0, 2].map(|scene| failures_left(16, scene)), [0, 0]);
        assert_same(&shaken, &whole);
    }
}

#[test]
fn a_scene_fails_whose_device_does_not_come_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let (shaken, whole) = (folder.path().join("shaken"), folder.path().join("whole"));
    run(&recipe(17, LIGHT), &whole, 1).expect("whole");
    let settled = Counters::both(17)[0];
    // What is too large stays too large.
    for (error, tries) in [(lost(), 3), (Error::exceeds_device("the scene is too large"), 1)] {
        let before = Counters::both(17)[0];
        fail_next(17, 1, 9, error.clone());
        let again = RunOptions { overwrite: true, ..options(&shaken, 1) };
        let outcome = run_with(&recipe(17, LIGHT), again, &Quiet).expect("goes on");
        assert_eq!((outcome.scenes, outcome.failed), (2, 1));
        assert_eq!(failures_left(17, 1), 9 - tries);
        assert_eq!(Counters::both(17)[0] - before, settled + tries - 1, "attempts");
        let entry = entry(&shaken, 1);
        assert!(entry.failed() && entry.attempt == 0, "{entry:?}");
        assert_eq!(entry.errors, [format!("render: {error}")]);
        let others = files(&shaken);
        assert!(others.keys().any(|name| name.starts_with("lines/000002")));
        assert!(!others.keys().any(|name| name.starts_with("lines/000001")), "{:?}", others.keys());
        // Once it is back, the scene is the one of any run.
        fail_next(17, 1, 0, lost());
        let retry = RunOptions { retry_failed: true, ..options(&shaken, 1) };
        run_with(&recipe(17, LIGHT), retry, &Quiet).expect("recovers");
        assert_same(&shaken, &whole);
    }
}

#[test]
fn a_scene_that_is_there_keeps_what_it_has() {
    let folder = tempfile::tempdir().expect("a folder");
    let (grown, whole) = (folder.path().join("grown"), folder.path().join("whole"));
    let both = recipe(18, &format!("{LIGHT}{THOUGHT}"));
    run(&both, &whole, 2).expect("whole");
    run(&recipe(18, THOUGHT), &grown, 2).expect("begun");
    let (before, had) = (files(&grown), entry(&grown, 1));
    let keeps = |name: &str| name.starts_with("more/00") || name.starts_with(".syntable/scenes/000001");
    for error in [lost(), Error::exceeds_device("the scene is too large")] {
        fail_next(18, 1, 9, error);
        let stopped = run(&both, &grown, 1).expect_err("stops");
        assert!(stopped.is_device() && !stopped.is_permanent(), "{stopped}");
        let text = stopped.to_string();
        assert!(text.contains("scene 1: render: the") && text.contains("keeps all that it had"), "{text}");
        assert_eq!(entry(&grown, 1), had);
        let now = files(&grown);
        assert!(before.iter().filter(|(name, _)| keeps(name)).all(|(name, bytes)| now.get(name) == Some(bytes)));
        assert!(!now.keys().any(|name| name.starts_with("lines/000001")));
    }
    fail_next(18, 1, 0, lost());
    run(&both, &grown, 1).expect("goes on");
    assert_same(&grown, &whole);
    // Nor does a scene go that is damaged, and cannot be made again now.
    std::fs::write(grown.join("lines/000001_0000.json"), "{}").expect("writable");
    let had = entry(&grown, 1);
    fail_next(18, 1, 9, lost());
    let repair = || RunOptions { repair: true, ..options(&grown, 1) };
    assert!(run_with(&both, repair(), &Quiet).expect_err("stops").is_device());
    assert!(entry(&grown, 1) == had && grown.join("more/000001_0001.json").exists());
    fail_next(18, 1, 0, lost());
    run_with(&both, repair(), &Quiet).expect("mended");
    assert_same(&grown, &whole);
}
