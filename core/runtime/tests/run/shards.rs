//! Shards of a dataset, made apart and merged, and the state of datasets that are being made.

use crate::growth::assert_same;
use crate::kit::{options, registry, run, run_with};
use std::fs;
use std::path::{Path, PathBuf};
use syntable_model::files::DatasetPath;
use syntable_model::store::Access;
use syntable_runtime::run::progress::Quiet;
use syntable_runtime::run::{MergeOptions, RunOptions, RunOutcome, Shard, merge, status, verify};

fn recipe(scenes: u32) -> String {
    format!(
        "[dataset]\nscenes = {scenes}\nviews_per_scene = 2\nname = \"shards\"\n\
         [[place]]\nkind = \"boxes\"\n[render]\nkind = \"sleeper\"\n\
         [write.lines]\ninclude = [\"thought\", \"light\", \"track\", \"total\"]\n"
    )
}

fn shard_options(dataset: &Path, index: u32, count: u32) -> RunOptions {
    let shard = Shard::new(index, count).expect("a shard");
    RunOptions { shard: Some(shard), ..options(&shard.folder(dataset), 1) }
}

fn make(recipe: &str, dataset: &Path, index: u32, count: u32) -> RunOutcome {
    run_with(recipe, shard_options(dataset, index, count), &Quiet).expect("a shard")
}

fn merged(out: &Path, parts: &[PathBuf]) -> Result<RunOutcome, String> {
    merge(&registry(), out, parts, &MergeOptions::new(2), &Quiet).map_err(|error| error.to_string())
}

#[test]
fn shards_of_any_division_give_the_dataset_of_one_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    run(&recipe(5), &at("whole"), 2).expect("whole");
    run(&recipe(8), &at("grown"), 2).expect("grown");
    // The last division has shards without scenes.
    for count in [1, 2, 3, 7] {
        let dataset = at(&format!("of-{count}"));
        let scenes: u32 = (0..count).map(|index| make(&recipe(5), &dataset, index, count).scenes).sum();
        assert_eq!(scenes, 5);
        let parts = [Shard::folder_of_all(&dataset)];
        assert_eq!(merged(&dataset, &parts).map(|outcome| outcome.missing), Ok(0));
        assert_same(&dataset, &at("whole"));
        assert!(verify(&dataset, 1).expect("a dataset").whole());
        // The scenes of a recipe that grows stay in their shards.
        (0..count).for_each(|index| drop(make(&recipe(8), &dataset, index, count)));
        let again = at(&format!("again-{count}"));
        assert_eq!(merged(&again, &parts).map(|outcome| outcome.scenes), Ok(8));
        assert_same(&again, &at("grown"));
    }
}

#[test]
fn missing_doubled_and_other_shards_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let part = |dataset: &str, index: u32, count: u32| {
        make(&recipe(5), &at(dataset), index, count);
        shard_options(&at(dataset), index, count).out.local().expect("a folder")
    };
    let [one, two, three] = [0, 1, 2].map(|index| part("a", index, 3));
    let (copy, half) = (part("b", 1, 3), part("c", 0, 2));
    let dotted = at("b/../a.shards/1-of-3");
    fs::create_dir(at("b")).expect("writable");
    for (parts, expected) in [
        (vec![&one, &three], "shard 1/3 is missing"),
        (vec![&two], "shards 0/3, 2/3 are missing"),
        (vec![&one, &two, &copy, &three], "are both shard 1/3"),
        (vec![&one, &two, &two, &three], "1-of-3 is given twice"),
        (vec![&one, &two, &dotted, &three], "are the same folder"),
        (vec![&one, &half], "is shard 0/3, and"),
    ] {
        let parts: Vec<PathBuf> = parts.into_iter().cloned().collect();
        let error = merged(&at("merged"), &parts).expect_err(expected);
        assert!(error.contains(expected), "{error}");
        assert!(!at("merged/recipe.toml").exists());
    }
    // The existing shards are merged on request, and the last one follows without it.
    let partial = MergeOptions { partial: true, ..MergeOptions::new(1) };
    let doubled = merge(&registry(), at("merged"), &[two.clone(), copy], &partial, &Quiet).expect_err("doubled");
    assert!(doubled.to_string().contains("are both shard 1/3"), "{doubled}");
    let outcome = merge(&registry(), at("merged"), &[one.clone(), three], &partial, &Quiet).expect("merged");
    assert_eq!((outcome.scenes, outcome.missing), (3, 2));
    assert_eq!(merged(&at("merged"), std::slice::from_ref(&two)).map(|outcome| outcome.missing), Ok(0));
    run(&recipe(5), &at("whole"), 1).expect("whole");
    assert_same(&at("merged"), &at("whole"));
    // A damaged number, and a part of another version of the program.
    let (number, text) = (one.join(".syntable/shard.json"), one.join("recipe.toml"));
    let (before, made) = (fs::read(&number).expect("there"), fs::read_to_string(&text).expect("there"));
    for wrong in ["", "{\"index\":3,\"count\":3}", "{\"index\":0,\"count\":0}"] {
        fs::write(&number, wrong).expect("writable");
        let error = merged(&at("other"), &[one.clone(), two.clone()]).expect_err("damaged");
        assert!(error.contains("shard.json") && error.contains("not the number of a shard"), "{error}");
    }
    fs::write(&number, before).expect("writable");
    fs::write(&text, made.replace("syntable = \"", "syntable = \"9.")).expect("writable");
    fs::remove_file(one.join(".syntable/finished.json")).expect("there");
    let error = merged(&at("other"), &[one, two]).expect_err("another version");
    assert!(error.contains("lock.syntable") && error.contains("9."), "{error}");
}

#[test]
fn a_folder_keeps_its_shard() {
    let folder = tempfile::tempdir().expect("a folder");
    let dataset = folder.path().join("data");
    make(&recipe(5), &dataset, 1, 3);
    let here = shard_options(&dataset, 1, 3);
    for (shard, expected) in [(None, "shard 1/3, and this run makes no shard"), (Some(Shard::WHOLE), "shard 0/1")] {
        let other = RunOptions { shard, ..options(&here.out.local().expect("a folder"), 1) };
        let error = run_with(&recipe(5), other, &Quiet).expect_err("another shard").to_string();
        assert!(error.contains(expected) && error.contains("options.shard` 1/3"), "{error}");
    }
    run(&recipe(5), &folder.path().join("whole"), 1).expect("whole");
    let into = RunOptions { shard: here.shard, ..options(&folder.path().join("whole"), 1) };
    let error = run_with(&recipe(5), into, &Quiet).expect_err("not a shard").to_string();
    assert!(error.contains("no shard, and this run makes shard 1/3"), "{error}");
    // Overwriting makes another shard, of a range of scenes.
    let other = Shard::new(0, 2).expect("a shard");
    let overwritten = RunOptions { shard: Some(other), scenes: Some(1..5), overwrite: true, ..here };
    assert_eq!(run_with(&recipe(5), overwritten, &Quiet).expect("overwritten").scenes, 2);
}

#[test]
fn the_status_counts_scenes_of_shards() {
    let folder = tempfile::tempdir().expect("a folder");
    let dataset = folder.path().join("data");
    make(&recipe(5), &dataset, 0, 3);
    let first = RunOptions { scenes: Some(0..3), ..shard_options(&dataset, 2, 3) };
    run_with(&recipe(5), first, &Quiet).expect("a shard");
    let all = || status(&[Shard::folder_of_all(&dataset).into()]).expect("a status");
    let found = all();
    assert_eq!(found.missing_shards, ["1/3"]);
    let counts = |at: usize| {
        let progress = found.datasets[at].progress;
        (progress.scenes, progress.done, progress.missing, progress.images)
    };
    // Scenes 0 and 3; scene 2, the only one of its shard.
    assert_eq!((counts(0), counts(1)), ((2, 2, 0, 4), (1, 1, 0, 2)));
    assert_eq!((found.total.scenes, found.total.done, found.total.missing), (5, 3, 2));
    assert!(found.datasets.iter().all(|one| one.finished && !one.running && one.progress.scenes_per_hour.is_none()));
    let part = shard_options(&dataset, 0, 3).out;
    let hold = part.lock(&DatasetPath::new(".syntable/lock").expect("a path"), Access::Write).expect("lockable");
    assert!(hold.is_some() && all().datasets[0].running && !all().datasets[0].finished);
    drop(hold);
    // A shard alone is done when its own scenes are.
    let alone = status(std::slice::from_ref(&part)).expect("a status");
    assert!(alone.missing_shards.is_empty() && alone.datasets[0].shard.as_deref() == Some("0/3"));
    assert_eq!((alone.total.scenes, alone.total.done, alone.total.missing), (2, 2, 0));
    let two = status(&[part.clone(), shard_options(&dataset, 2, 3).out]).expect("a status");
    assert_eq!((&*two.missing_shards, two.total.scenes), (&["1/3".to_owned()][..], 5));
    // A journal with a damaged last line.
    let journal = part.local().expect("a folder").join(".syntable/journal.jsonl");
    let text = fs::read_to_string(&journal).expect("there");
    fs::write(&journal, format!("{}\nnothing\n", text.lines().next().expect("a line"))).expect("writable");
    let found = all();
    assert!(!found.datasets[0].finished && found.datasets[0].faults[0].contains("line 2"));
    assert_eq!(found.total.missing, 3);
    // The files are deleted, and a worker still writes a line.
    fs::remove_file(part.local().expect("a folder").join("recipe.toml")).expect("there");
    let error = status(std::slice::from_ref(&part)).expect_err("vanished").to_string();
    assert!(error.contains("the dataset vanished") && error.contains("0-of-3") && error.contains("restore"), "{error}");
    fs::remove_file(&journal).expect("there");
    assert_eq!(status(&[part]).expect("a run that has begun").total.scenes, 0);
    assert!(status(&[folder.path().into()]).is_err_and(|error| error.to_string().contains("no dataset")));
}
