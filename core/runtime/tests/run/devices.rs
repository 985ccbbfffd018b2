//! Devices: failures that must not show in a dataset, the devices that a dataset names, and kinds that are chosen for a
//! device.

use crate::growth::assert_same;
use crate::kit::{CHOSEN, Counters, fail_next, failures_left, options, put_card, registry, run, run_scenes, run_with};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use syntable_model::error::Error;
use syntable_recipe::{Overrides, Recipe, Report, Source, lock_of};
use syntable_runtime::run::dataset::journal::JournalEntry;
use syntable_runtime::run::progress::{Event, Quiet, Reporter};
use syntable_runtime::run::{MergeOptions, RunOptions};
use syntable_testing::folder::files;

/// A recipe with three scenes of two views.
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
    // A scene that is too large for the device fails at once.
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
        // Once the device is back, the scene equals the scene of any run.
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
    let keeps = |name: &str| name.starts_with("more/00") || name.starts_with(".syntable/scenes/000/000001");
    for error in [lost(), Error::exceeds_device("the scene is too large")] {
        fail_next(18, 1, 9, error);
        let stopped = run(&both, &grown, 1).expect_err("stops");
        assert!(stopped.is_device() && !stopped.is_permanent(), "{stopped}");
        let text = stopped.to_string();
        assert!(text.contains("scene 1: render: the") && text.contains("finished scenes are kept"), "{text}");
        assert_eq!(entry(&grown, 1), had);
        let now = files(&grown);
        assert!(before.iter().filter(|(name, _)| keeps(name)).all(|(name, bytes)| now.get(name) == Some(bytes)));
        assert!(!now.keys().any(|name| name.starts_with("lines/000001")));
    }
    fail_next(18, 1, 0, lost());
    run(&both, &grown, 1).expect("goes on");
    assert_same(&grown, &whole);
    // A damaged scene that cannot be made again now also stays.
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

/// Keeps the warnings and notes of a run.
#[derive(Default)]
struct Said(Mutex<Vec<String>>);

impl Reporter for Said {
    fn event(&self, event: &Event) {
        if let Event::Message(_) | Event::Note { .. } = event {
            self.0.lock().expect("said").push(serde_json::to_string(event).expect("plain data"));
        }
    }
}

impl Said {
    fn contains(&self, words: &str) -> bool {
        self.0.lock().expect("said").iter().any(|line| line.contains(words))
    }
}

fn devices_of(folder: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(folder.join("recipe.toml")).expect("a recipe");
    lock_of(&text).devices.into_iter().collect()
}

#[test]
fn a_dataset_names_the_cards_that_rendered_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let light = recipe(19, LIGHT);
    let resume = |out: &str, scenes| {
        let said = Said::default();
        run_with(&light, RunOptions { scenes, ..options(&at(out), 1) }, &said).expect("runs");
        (said, devices_of(&at(out)))
    };
    let other = "other devices render now:";
    let (said, devices) = resume("processor", None);
    assert!(devices.is_empty() && !said.contains(other));
    put_card(19, Some("X1 (driver 1)"));
    let (said, devices) = resume("mixed", Some(0..1));
    assert!(devices == ["X1 (driver 1)"] && !said.contains(other));
    let (said, devices) = resume("mixed", Some(0..2));
    assert!(devices == ["X1 (driver 1)"] && !said.contains(other), "{devices:?}");
    run(&light, &at("whole"), 2).expect("whole");
    run_scenes(&light, &at("first"), 1, Some(0..1)).expect("the first part");
    run_scenes(&light, &at("second"), 1, Some(1..3)).expect("the second part");
    put_card(19, Some("X1 (driver 2)"));
    let (said, devices) = resume("mixed", None);
    assert!(said.contains(&format!("{other} X1 (driver 1) before, X1 (driver 2) now")));
    assert_eq!(devices, ["X1 (driver 1)", "X1 (driver 2)"]);
    // No image is left to render.
    put_card(19, Some("X2"));
    let (said, devices) = resume("mixed", None);
    assert!(devices.len() == 2 && !said.contains(other));
    // A recipe that was resolved on another card causes a warning. Its new dataset names its own card.
    let (out, source) = (at("again"), Source::read(at("first/recipe.toml")).expect("there"));
    let (resolved, _) = syntable_recipe::load(&registry(), source, &Overrides::of_process(Vec::new()))
        .unwrap_or_else(|report| panic!("{report}"));
    let said = Said::default();
    syntable_runtime::run::run(&resolved, &options(&out, 1), &said).expect("runs");
    assert!(said.contains(other) && devices_of(&out) == ["X2"], "{:?}", devices_of(&out));
    run_scenes(&light, &at("third"), 1, Some(1..3)).expect("the second part elsewhere");
    let merge = |out: &str, parts: [&str; 2]| {
        let (parts, said): (Vec<PathBuf>, _) = (parts.iter().map(|part| at(part)).collect(), Said::default());
        let options = MergeOptions { mixed_devices: true, ..MergeOptions::new(1) };
        syntable_runtime::run::merge(&registry(), at(out), &parts, &options, &said).expect("merges");
        (said.contains("different devices rendered the parts: X1 (driver 1), X2"), devices_of(&at(out)))
    };
    assert_eq!(merge("one", ["first", "second"]), (false, vec!["X1 (driver 1)".to_owned()]));
    assert_same(&at("one"), &at("whole"));
    let parts = ["first", "third"].map(at);
    let error = syntable_runtime::run::merge(&registry(), at("two"), &parts, &MergeOptions::new(1), &Quiet);
    let error = error.expect_err("refused").to_string();
    assert!(error.contains("X1 (driver 1), X2") && error.contains("options.mixed_devices"), "{error}");
    assert_eq!(merge("two", ["first", "third"]), (true, vec!["X1 (driver 1)".to_owned(), "X2".to_owned()]));
}

#[test]
fn a_chosen_kind_must_match_the_dataset() {
    let folder = tempfile::tempdir().expect("a folder");
    let (chosen, named) = (folder.path().join("chosen"), folder.path().join("named"));
    let either = recipe(20, LIGHT).replace("\"sleeper\"", "\"either\"");
    let load = |for_run: bool| -> Result<Recipe, Report> {
        let overrides = Overrides::of_process(Vec::new());
        let overrides = if for_run { overrides.for_run() } else { overrides };
        syntable_recipe::load(&registry(), Source::embedded("test.toml", either.as_str()), &overrides)
            .map(|loaded| loaded.0)
    };
    let go =
        |recipe: &Recipe, reporter: &dyn Reporter| syntable_runtime::run::run(recipe, &options(&chosen, 1), reporter);
    // `check` and `plan` choose no kind.
    let planned = load(false).unwrap_or_else(|report| panic!("{report}"));
    assert!(planned.undecided == ["render"] && planned.choices.is_empty() && planned.resolved.contains("\"either\""));
    let error = go(&planned, &Quiet).expect_err("nothing was chosen");
    assert!(error.is_permanent() && error.to_string().contains("[render]"), "{error}");
    let (ready, said) = (load(true).unwrap_or_else(|report| panic!("{report}")), Said::default());
    go(&ready, &said).expect("runs");
    assert!(said.contains("[render] `either` is `sleeper` here: it slept well"));
    run(&recipe(20, LIGHT), &named, 1).expect("runs");
    assert_same(&chosen, &named);
    // Another machine chooses another kind, and cannot continue the dataset.
    *CHOSEN.lock().expect("chosen") = Ok("drowsy");
    let error = go(&load(true).unwrap_or_else(|report| panic!("{report}")), &Quiet).expect_err("another kind");
    assert!(error.to_string().contains("render.kind: \"sleeper\" -> \"drowsy\""), "{error}");
    *CHOSEN.lock().expect("chosen") = Err("the bed is not there");
    let report = load(true).err().expect("it was asked for").to_string();
    assert!(report.contains("`either`: the bed is not there") && report.contains("wake up"), "{report}");
    assert!(load(false).is_ok());
}
