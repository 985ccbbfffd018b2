//! Datasets that are stopped, damaged, repaired, merged and deleted: the result equals the dataset of one run.

use crate::growth::assert_same;
use crate::kit::{AtEvent, Counters, options, registry, run, run_scenes, run_with};
use std::collections::BTreeMap;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicU32;
use syntable_model::error::Result;
use syntable_runtime::run::dataset::folder::Folder;
use syntable_runtime::run::dataset::journal::Journal;
use syntable_runtime::run::progress::{Event, Quiet, Reporter};
use syntable_runtime::run::stop::Stop;
use syntable_runtime::run::{MergeOptions, RunOptions, RunOutcome, merge, verify};
use syntable_testing::folder::files;

const RECIPE: &str = "[dataset]\nscenes = 4\nviews_per_scene = 2\nname = \"whole\"\n\
    [[place]]\nkind = \"boxes\"\n[render]\nkind = \"sleeper\"\n\
    [write.lines]\ninclude = [\"light\"]\n\
    [write.more]\nkind = \"lines\"\ninclude = [\"thought\", \"track\", \"total\"]\n";

/// All files that the manifests of a dataset must list, by name.
fn listed(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = files(folder);
    let own = [".syntable/lock", ".syntable/journal.jsonl", ".syntable/finished.json"];
    all.retain(|name, _| !own.contains(&name.as_str()) && !name.starts_with(".syntable/catalogs/"));
    all
}

#[test]
fn every_file_is_compared_and_repaired() {
    let folder = tempfile::tempdir().expect("a folder");
    let (whole, data) = (folder.path().join("whole"), folder.path().join("data"));
    let small = RECIPE.replace("scenes = 4", "scenes = 2").replace("views_per_scene = 2", "views_per_scene = 1");
    run(&small, &whole, 2).expect("whole");
    run(&small, &data, 2).expect("whole");
    let all = listed(&data);
    assert_eq!(verify(&data, 2).map(|found| (found.whole(), found.scenes)), Ok((true, 2)));
    assert!(all.keys().any(|name| name.contains("shards")) && all.keys().any(|name| name.contains("settled")));
    for (index, (name, bytes)) in all.iter().enumerate() {
        let path = data.join(name);
        let missing = index % 3 == 0;
        match index % 3 {
            0 => fs::remove_file(&path).expect("removable"),
            1 => fs::write(&path, &bytes[1..]).expect("writable"),
            _ => {
                // The same size, with one bit changed.
                let mut changed = bytes.clone();
                *changed.last_mut().expect("not empty") ^= 4;
                fs::write(&path, changed).expect("writable");
            }
        }
        let found = verify(&data, 1).expect("a dataset");
        let (named, other) = if missing { (&found.missing, &found.damaged) } else { (&found.damaged, &found.missing) };
        assert!(*named == std::slice::from_ref(name) && other.is_empty() && !found.whole(), "{name}: {found:?}");
        if name == "recipe.toml" {
            // Another recipe cannot replace the lost recipe.
            let other = small.replace("name = \"whole\"", "name = \"other\"");
            run_with(&other, RunOptions { repair: true, ..options(&data, 1) }, &Quiet).expect_err("another recipe");
            run(&small, &data, 1).expect_err("not asked to repair");
        }
        run_with(&small, RunOptions { repair: true, ..options(&data, 1) }, &Quiet).expect("repaired");
        assert_same(&whole, &data);
    }
    // A file that does not belong to the dataset is reported and stays.
    fs::write(data.join("notes.txt"), "mine").expect("writable");
    let found = verify(&data, 1).expect("a dataset");
    assert!(found.whole() && found.foreign == ["notes.txt"], "{found:?}");
    run_with(&small, RunOptions { repair: true, ..options(&data, 1) }, &Quiet).expect("nothing to repair");
    assert!(data.join("notes.txt").exists());
}

#[test]
fn lines_that_are_gone_are_missed() {
    let folder = tempfile::tempdir().expect("a folder");
    let (whole, data) = (folder.path().join("whole"), folder.path().join("data"));
    run(RECIPE, &whole, 2).expect("whole");
    run_scenes(RECIPE, &data, 1, Some(0..3)).expect("a part");
    fs::write(data.join(".syntable/shards/lines/000/000001.jsonl"), "").expect("writable");
    let error = run(RECIPE, &data, 1).expect_err("the end would lose lines").to_string();
    assert!(error.contains("shards/lines/000/000001.jsonl") && error.contains("options.repair"), "{error}");
    run_with(RECIPE, RunOptions { repair: true, ..options(&data, 1) }, &Quiet).expect("repaired");
    assert_same(&whole, &data);
}

#[test]
fn an_unreadable_line_of_the_journal_hides_no_other_fault() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data");
    run(RECIPE, &data, 2).expect("whole");
    let whole = verify(&data, 1).expect("a dataset");
    let path = data.join(".syntable/journal.jsonl");
    let journal = fs::read_to_string(&path).expect("there");
    let number = journal.lines().position(|line| line.starts_with(r#"{"scene":2,"#)).expect("a line");
    fs::write(&path, journal.replace(r#"{"scene":2,"#, r#"{"scene":2;"#)).expect("writable");
    fs::write(data.join("lines/000001.json"), "changed").expect("writable");
    fs::write(data.join("notes.txt"), "mine").expect("writable");
    let found = verify(&data, 1).expect("it compares the other lines");
    let fault = format!("line {} is not a journal line", number + 1);
    assert!(found.faults.len() == 1 && found.faults[0].starts_with(&fault), "{found:?}");
    assert!(!found.whole() && found.scenes == 3 && found.files < whole.files, "{found:?}");
    assert_eq!((found.damaged.as_slice(), found.missing.len()), (&["lines/000001.json".to_owned()][..], 0));
    assert!(
        found.unlisted.keys().eq(&[2]) && found.unlisted[&2].contains(&"lines/000002.json".to_owned()),
        "{found:?}"
    );
    assert_eq!(found.foreign, ["notes.txt"]);
    run_with(RECIPE, RunOptions { repair: true, ..options(&data, 1) }, &Quiet).expect("repaired");
    assert!(verify(&data, 1).expect("a dataset").whole());
}

#[test]
fn files_of_a_scene_without_its_manifest_are_told_from_others() {
    let folder = tempfile::tempdir().expect("a folder");
    let (whole, data) = (folder.path().join("whole"), folder.path().join("data"));
    run(RECIPE, &whole, 2).expect("whole");
    run(RECIPE, &data, 2).expect("whole");
    fs::write(data.join("lines/notes 1.txt"), "mine").expect("writable");
    let files_of = |scene: u32| -> Vec<String> {
        let number = format!("{scene:06}");
        let all = files(&data).into_keys().filter(|name| !name.starts_with(".syntable/"));
        all.filter(|name| name.split(['/', '_', '.']).nth(1) == Some(&number)).collect()
    };
    for lost in [vec![1], vec![0, 3], vec![0, 1, 2]] {
        for scene in &lost {
            fs::remove_file(data.join(format!(".syntable/scenes/000/{scene:06}.json"))).expect("there");
        }
        let found = verify(&data, 2).expect("a dataset");
        let want: BTreeMap<u32, Vec<String>> = lost.iter().map(|&scene| (scene, files_of(scene))).collect();
        assert!(want.values().all(|files| files.len() == 6), "{want:?}");
        assert_eq!(found.unlisted, want);
        assert_eq!(found.foreign, ["lines/notes 1.txt"]);
        assert!(!found.whole() && found.missing.len() == lost.len());
        run_with(RECIPE, RunOptions { repair: true, ..options(&data, 1) }, &Quiet).expect("repaired");
        let found = verify(&data, 2).expect("a dataset");
        assert!(found.whole() && found.unlisted.is_empty() && found.foreign.len() == 1, "{found:?}");
    }
    fs::remove_file(data.join("lines/notes 1.txt")).expect("still there");
    assert_same(&whole, &data);
}

/// The record of a staged scene is half written.
#[test]
fn a_run_that_was_killed_within_a_record_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let [whole, data] = ["whole", "data"].map(|name| folder.path().join(name));
    run(RECIPE, &whole, 1).expect("whole");
    run_scenes(RECIPE, &data, 1, Some(0..1)).expect("begun");
    let staged = data.join(".syntable/staging/1.ready");
    fs::create_dir_all(staged.join(".syntable")).expect("writable");
    fs::create_dir_all(staged.join("lines")).expect("writable");
    fs::write(staged.join(".syntable/staged.json.part"), "{").expect("writable");
    fs::copy(whole.join("lines/000001.json"), staged.join("lines/000001.json")).expect("copied");
    run(RECIPE, &data, 1).expect("it goes on");
    assert_same(&whole, &data);
}

#[test]
fn only_damaged_scenes_are_made_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let recipe = RECIPE
        .replace("\"sleeper\"", "\"sleeper\"\ntally = 12")
        .replace("[render]", "[settle]\nkind = \"rapier\"\ntally = 12\n[render]");
    run(&recipe, folder.path(), 1).expect("whole");
    fs::remove_file(folder.path().join("lines/000002_0001.json")).expect("there");
    let before = Counters::both(12);
    run_with(&recipe, RunOptions { repair: true, ..options(folder.path(), 1) }, &Quiet).expect("repaired");
    let after = Counters::both(12);
    assert_eq!([after[0] - before[0], after[1] - before[1]], [1, 2]);
    assert!(verify(folder.path(), 1).expect("a dataset").whole());
}

/// Stops a call at its first event, at its second, and so on, until it completes. Returns how often it stopped.
fn stopped_anywhere(call: &dyn Fn(&Stop, &dyn Reporter) -> Result<RunOutcome>, check: &dyn Fn()) -> u32 {
    for number in 0.. {
        let stop = Stop::default();
        let reporter = AtEvent { number, act: &|| stop.cancel(), seen: AtomicU32::new(0) };
        match call(&stop, &reporter) {
            Ok(_) => return number,
            Err(error) => {
                let error = error.to_string();
                assert!(error.contains("stopped by its caller") && error.contains("the same command"), "{error}");
                check();
            }
        }
    }
    unreachable!("a call ends")
}

#[test]
fn a_run_that_is_stopped_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = folder.path().join("whole");
    run(RECIPE, &whole, 2).expect("whole");
    for threads in [1, 3] {
        let data = folder.path().join(threads.to_string());
        let call = |stop: &Stop, reporter: &dyn Reporter| {
            run_with(RECIPE, RunOptions { stop: stop.clone(), ..options(&data, threads) }, reporter)
        };
        let check = || {
            let found = verify(&data, 1).expect("a dataset");
            assert!(found.missing.is_empty() && found.damaged.is_empty() && found.unfinished, "{found:?}");
        };
        assert!(stopped_anywhere(&call, &check) > 2);
        assert_same(&whole, &data);
    }
}

#[test]
fn a_reporter_fails_no_scene() {
    struct Broken;
    impl Reporter for Broken {
        fn event(&self, _: &Event) {
            panic!("nobody reads this");
        }
    }
    let folder = tempfile::tempdir().expect("a folder");
    let (whole, data) = (folder.path().join("whole"), folder.path().join("data"));
    run(RECIPE, &whole, 2).expect("whole");
    run_with(RECIPE, options(&data, 2), &Broken).expect("nothing of the dataset failed");
    assert_same(&whole, &data);
}

/// Parts with scenes 0 and 1, scenes 1 and 2, and scene 3.
fn parts(folder: &Path, recipe: &str) -> Vec<PathBuf> {
    let part = |(number, scenes): (usize, std::ops::Range<u32>)| {
        let path = folder.join(format!("part-{number}"));
        run_scenes(recipe, &path, 1, Some(scenes)).expect("a part");
        path
    };
    [0..2, 1..3, 3..4].into_iter().enumerate().map(part).collect()
}

#[test]
fn parts_are_merged_into_what_one_run_makes() {
    let folder = tempfile::tempdir().expect("a folder");
    let (whole, merged) = (folder.path().join("whole"), folder.path().join("merged"));
    run(RECIPE, &whole, 2).expect("whole");
    let parts = parts(folder.path(), RECIPE);
    let before: Vec<_> = parts.iter().map(|part| files(part)).collect();
    let call = |stop: &Stop, reporter: &dyn Reporter| {
        merge(&registry(), &merged, &parts, &MergeOptions { stop: stop.clone(), ..MergeOptions::new(2) }, reporter)
    };
    assert!(stopped_anywhere(&call, &|| drop(verify(&merged, 1))) >= 1);
    assert_same(&whole, &merged);
    assert!(verify(&merged, 1).expect("a dataset").whole());
    // A second merge changes nothing, and a single part can be merged.
    merge(&registry(), &merged, &parts[..1], &MergeOptions::new(1), &Quiet).expect("merged already");
    assert_same(&whole, &merged);
    let one = folder.path().join("one");
    merge(&registry(), &one, &parts[..1], &MergeOptions::new(1), &Quiet).expect("one part");
    assert_same(&parts[0], &one);
    // A run continues the merged dataset, and the parts are unchanged.
    merge(&registry(), &one, &parts[2..], &MergeOptions::new(1), &Quiet).expect("another part");
    run(RECIPE, &one, 1).expect("goes on");
    assert_same(&whole, &one);
    for (part, before) in parts.iter().zip(before) {
        assert!(files(part) == before, "{} was changed", part.display());
    }
}

#[test]
fn parts_that_do_not_belong_together_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let ours = parts(folder.path(), RECIPE);
    let merge = |parts: &[&PathBuf]| {
        let parts: Vec<PathBuf> = parts.iter().map(|&part| part.clone()).collect();
        let out = folder.path().join("merged");
        let error = merge(&registry(), &out, &parts, &MergeOptions::new(1), &Quiet).expect_err("refused").to_string();
        assert!(!out.join("lines/dataset.json").exists(), "{error}");
        error
    };
    let other = folder.path().join("other");
    run_scenes(&RECIPE.replace("whole", "other"), &other, 1, Some(1..2)).expect("another recipe");
    let error = merge(&[&ours[0], &other]);
    assert!(error.contains("different recipes") && error.contains("dataset.name: \"whole\" -> \"other\""), "{error}");
    let nothing = folder.path().join("nothing");
    assert!(merge(&[&ours[0], &nothing]).contains("no dataset in this folder"));
    // The dataset as one of its parts, by another name.
    let again = ours[0].join("../part-0");
    let error =
        syntable_runtime::run::merge(&registry(), &ours[0], &[ours[1].clone(), again], &MergeOptions::new(1), &Quiet)
            .expect_err("named twice")
            .to_string();
    assert!(error.contains("both the output and a part") && error.contains("leave out the part"), "{error}");
    assert_eq!(verify(&ours[0], 1).map(|found| (found.whole(), found.scenes)), Ok((true, 2)));
    // Nested folders, existing or not.
    for (out, part) in [(ours[0].join("new/merged"), &ours[0]), (ours[0].join("../part-0/x"), &ours[0])] {
        let error =
            syntable_runtime::run::merge(&registry(), &out, std::slice::from_ref(part), &MergeOptions::new(1), &Quiet)
                .expect_err("nested")
                .to_string();
        assert!(error.contains("overlap") && error.contains("beside the parts"), "{error}");
        assert!(!out.exists());
    }
    // A part without its recipe.
    let recipe = ours[1].join("recipe.toml");
    let text = fs::read_to_string(&recipe).expect("there");
    let edited = text.replace("scenes = ", "scenes = 1");
    for damage in [None, Some(""), Some(&edited)] {
        match damage {
            None => fs::remove_file(&recipe).expect("there"),
            Some(text) => fs::write(&recipe, text).expect("writable"),
        }
        let error = merge(&[&ours[0], &ours[1]]);
        assert!(
            error.contains("recipe.toml") && error.contains("options.repair") && error.contains("part-1"),
            "{error}"
        );
    }
    fs::write(&recipe, text).expect("writable");
    // A dataset without its recipe accepts no part of another dataset.
    let target = ours[0].join("recipe.toml");
    let text = fs::read_to_string(&target).expect("there");
    fs::remove_file(&target).expect("there");
    let error = syntable_runtime::run::merge(&registry(), &ours[0], &[other], &MergeOptions::new(1), &Quiet)
        .expect_err("whose is it?")
        .to_string();
    assert!(error.contains("the dataset has lost its recipe.toml") && error.contains("options.repair"), "{error}");
    fs::write(&target, text).expect("writable");
    // The same scene with another byte, and a journal that records it.
    let journal = ours[1].join(".syntable/journal.jsonl");
    let text = fs::read_to_string(&journal).expect("there");
    fs::write(&journal, text.replacen("\"objects\":1", "\"objects\":2", 1)).expect("writable");
    assert!(merge(&[&ours[0], &ours[1]]).contains("scene 1 differs"));
    fs::write(&journal, text).expect("writable");
    let file = ours[1].join("lines/000002_0000.json");
    let bytes = fs::read(&file).expect("there");
    fs::write(&file, "{}").expect("writable");
    let error = merge(&[&ours[0], &ours[1]]);
    assert!(error.contains("lines/000002_0000.json") && error.contains("damaged"), "{error}");
    fs::write(&file, bytes).expect("writable");
    // The scenes that were merged before stay, and the same call continues.
    let (out, whole) = (folder.path().join("merged"), folder.path().join("whole"));
    syntable_runtime::run::merge(&registry(), &out, &ours, &MergeOptions::new(1), &Quiet).expect("mended");
    run(RECIPE, &whole, 1).expect("whole");
    assert_same(&whole, &out);
}

#[test]
fn inputs_must_not_differ_between_any_two_parts() {
    let folder = tempfile::tempdir().expect("a folder");
    let parts = parts(folder.path(), RECIPE);
    let draw = |part: &Path, digest: &str| {
        let journal = part.join(".syntable/journal.jsonl");
        let text = fs::read_to_string(&journal).expect("there");
        let drawn = text.replacen("\"outcome\":", &format!("\"assets\":{{\"pool/cup\":\"{digest}\"}},\"outcome\":"), 1);
        assert_ne!(text, drawn);
        fs::write(&journal, drawn).expect("writable");
    };
    // The first part did not draw the asset.
    draw(&parts[1], &"1".repeat(64));
    draw(&parts[2], &"2".repeat(64));
    let out = folder.path().join("merged");
    let error = merge(&registry(), &out, &parts, &MergeOptions::new(1), &Quiet).expect_err("differs").to_string();
    let says = ["the asset pool/cup differed", "part-1", "part-2"];
    assert!(says.iter().all(|word| error.contains(word)) && !out.exists(), "{error}");
}

#[test]
fn scenes_that_the_recipe_lacks_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data");
    run(RECIPE, &data, 1).expect("runs");
    let before = files(&data);
    for scenes in [4..5, 2..9, 1..1, Range { start: 2, end: 1 }] {
        let options = RunOptions { scenes: Some(scenes.clone()), overwrite: true, ..options(&data, 1) };
        let error = run_with(RECIPE, options, &Quiet).expect_err("refused").to_string();
        assert!(error.contains("the recipe has scenes 0..4"), "{scenes:?}: {error}");
        assert!(files(&data) == before, "{scenes:?}: the old dataset was changed");
    }
}

#[test]
fn overwriting_takes_what_is_the_datasets() {
    let folder = tempfile::tempdir().expect("a folder");
    let (whole, data) = (folder.path().join("whole"), folder.path().join("data"));
    let other = RECIPE.replace("name = \"whole\"", "name = \"other\"").replace("write.more", "write.less");
    run(&other, &data, 2).expect("another dataset");
    fs::write(data.join("lines/notes.txt"), "mine").expect("writable");
    // Refused without the flag. A recipe that cannot run is refused, too.
    run(RECIPE, &data, 1).expect_err("another recipe");
    let broken = RECIPE.replace("[write.lines]", "[write.lines]\nsaid_path = \"x\"");
    let before = files(&data);
    let overwrite = |text: &str| run_with(text, RunOptions { overwrite: true, ..options(&data, 1) }, &Quiet);
    overwrite(&broken).expect_err("cannot run");
    assert!(files(&data) == before, "something was deleted");
    // Mistakes that appear only when a scene is made, permanent or by chance, and at the end of a run.
    for (wrong, says) in [
        ("[annotate.thinker]\nmissing = true\n", "the library is not there"),
        ("[annotate.thinker]\npanics = true\n", "scene 0 failed in"),
        ("[write.last]\nkind = \"lines\"\ninclude = [\"light\"]\nbreaks_at = 1\n", "too many scenes for me"),
    ] {
        let error = overwrite(&format!("{RECIPE}{wrong}")).expect_err("a mistake").to_string();
        assert!(error.contains(says) && error.contains("the old dataset stays as it was"), "{error}");
        assert!(files(&data) == before, "{says}: something was deleted");
    }
    struct Notes(std::sync::Mutex<Vec<String>>);
    impl Reporter for Notes {
        fn event(&self, event: &Event) {
            let mut told = self.0.lock().expect("notes");
            match event {
                Event::Note { message } => told.push(message.clone()),
                Event::Started { scenes, resumed, .. } => {
                    told.push(format!("started: {scenes}, {resumed} done before"))
                }
                Event::Image { .. } => told.push("image".to_owned()),
                _ => {}
            }
        }
    }
    let notes = Notes(Default::default());
    run_with(RECIPE, RunOptions { overwrite: true, ..options(&data, 2) }, &notes).expect("anew");
    let notes = notes.0.into_inner().expect("notes");
    assert!(notes.iter().any(|note| note.contains("1 file in the folder, such as lines/notes.txt, stay")), "{notes:?}");
    // The first scene is made before the old dataset is deleted, and after the run has reported its start, once.
    let place = |what: &str| notes.iter().position(|note| note.starts_with(what)).expect("told");
    assert!(place("started") < place("image"), "{notes:?}");
    assert_eq!(notes.iter().filter(|note| note.starts_with("started")).count(), 1, "{notes:?}");
    assert!(notes[place("started")].ends_with(", 0 done before"), "{notes:?}");
    fs::remove_file(data.join("lines/notes.txt")).expect("still there");
    run(RECIPE, &whole, 2).expect("whole");
    assert_same(&whole, &data);
}

#[test]
fn nothing_is_deleted_for_a_recipe_that_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let (data, list) = (folder.path().join("data"), folder.path().join("names.txt"));
    let recipe = format!("{RECIPE}[assets.things]\nkind = \"names\"\nlist = \"{}\"\n", list.display());
    fs::write(&list, "a\nb\n").expect("writable");
    run(&recipe, &data, 2).expect("a dataset");
    let (locked, before) = (fs::read_to_string(data.join("recipe.toml")).expect("there"), files(&data));
    fs::write(&list, "a\n").expect("writable");
    let anew = |recipe: &str| run_with(recipe, RunOptions { overwrite: true, ..options(&data, 1) }, &Quiet);
    let error = anew(&locked).expect_err("another pool").to_string();
    assert!(error.contains("`assets.things` has changed"), "{error}");
    assert!(files(&data) == before, "something was deleted");
    anew(&recipe).expect("a recipe that locks nothing");
}

#[test]
fn a_deleted_dataset_leaves_nothing_but_its_lock() {
    let folder = tempfile::tempdir().expect("a folder");
    let (data, list) = (folder.path().join("data"), folder.path().join("names.txt"));
    fs::write(&list, "a\n").expect("writable");
    let recipe = format!("{RECIPE}[assets.things]\nkind = \"names\"\nlist = \"{}\"\n", list.display());
    run(&recipe, &data, 2).expect("a dataset");
    let names = |folder: &Path| -> Vec<String> {
        let entries = fs::read_dir(folder).expect("there").map(|entry| entry.expect("readable").file_name());
        entries.map(|name| name.to_string_lossy().into_owned()).collect()
    };
    assert!(names(&data.join(".syntable")).len() > 5);
    let left = Folder::open(&data).and_then(|folder| folder.discard()).expect("deleted");
    assert!(left.is_empty(), "{left:?}");
    assert_eq!((names(&data), names(&data.join(".syntable"))), (vec![".syntable".to_owned()], vec!["lock".to_owned()]));
}

#[test]
fn a_dataset_without_its_recipe_is_nobodys() {
    let folder = tempfile::tempdir().expect("a folder");
    run(RECIPE, folder.path(), 1).expect("whole");
    fs::remove_file(folder.path().join("recipe.toml")).expect("there");
    let error = run(&RECIPE.replace("whole", "other"), folder.path(), 1).expect_err("no recipe").to_string();
    assert!(error.contains("lost its recipe.toml"), "{error}");
    let edited = RECIPE.replace("whole", "other");
    for damaged in [&b"[dataset\n"[..], b"", &[0xff, 0xfe], edited.as_bytes()] {
        fs::write(folder.path().join("recipe.toml"), damaged).expect("writable");
        for recipe in [RECIPE, &edited] {
            let error = run(recipe, folder.path(), 1).expect_err("damaged").to_string();
            assert!(error.contains("recipe.toml that is damaged, or was edited"), "{error}");
        }
        let repair = RunOptions { repair: true, ..options(folder.path(), 1) };
        let error = run_with(&edited, repair, &Quiet).expect_err("another recipe").to_string();
        assert!(error.contains("may differ from the dataset"), "{error}");
    }
    let repair = || run_with(RECIPE, RunOptions { repair: true, ..options(folder.path(), 1) }, &Quiet);
    repair().expect("written again");
    assert!(verify(folder.path(), 1).expect("a dataset").whole());
    // A dataset without its journal still has scenes, so no other recipe may continue it.
    let journal = folder.path().join(".syntable/journal.jsonl");
    let lines = fs::read(&journal).expect("there");
    fs::remove_file(&journal).expect("there");
    let before = files(folder.path());
    let error = run(&RECIPE.replace("whole", "other"), folder.path(), 1).expect_err("another recipe").to_string();
    assert!(error.contains("another recipe"), "{error}");
    assert_eq!(files(folder.path()).len(), before.len() + 1, "but for an empty journal");
    fs::write(&journal, lines).expect("writable");
    // Without the list, which has the recipe's digest, no recipe certainly matches.
    fs::remove_file(folder.path().join(".syntable/finished.json")).expect("there");
    fs::remove_file(folder.path().join("recipe.toml")).expect("there");
    let error = repair().expect_err("not certain").to_string();
    assert!(error.contains("may differ from the dataset") && error.contains("options.overwrite"), "{error}");
}

#[test]
fn the_recipe_of_a_run_that_was_stopped_is_had_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let (whole, data, list) =
        (folder.path().join("whole"), folder.path().join("data"), folder.path().join("names.txt"));
    fs::write(&list, "a\nb\n").expect("writable");
    let recipe = &format!("{RECIPE}[assets.things]\nkind = \"names\"\nlist = \"{}\"\n", list.display());
    run(recipe, &whole, 2).expect("whole");
    let call = |stop: &Stop, reporter: &dyn Reporter| {
        run_with(recipe, RunOptions { stop: stop.clone(), repair: true, ..options(&data, 1) }, reporter)
    };
    let lose = || fs::remove_file(data.join("recipe.toml")).expect("there");
    assert!(stopped_anywhere(&call, &lose) > 2);
    assert_same(&whole, &data);
}

/// The events of a call.
#[derive(Default)]
struct Told(std::sync::Mutex<Vec<Event>>);

impl Reporter for Told {
    fn event(&self, event: &Event) {
        self.0.lock().expect("events").push(event.clone());
    }
}

impl Told {
    fn text(&self) -> String {
        format!("{:?}", self.0.lock().expect("events"))
    }
}

#[test]
fn growth_that_did_not_end_is_no_damage() {
    let folder = tempfile::tempdir().expect("a folder");
    let (whole, data) = (folder.path().join("whole"), folder.path().join("data"));
    let [few, more] = ["scenes = 2", "scenes = 4"].map(|scenes| RECIPE.replace("scenes = 4", scenes));
    run(&few, &data, 2).expect("begun");
    let call = |stop: &Stop, reporter: &dyn Reporter| {
        run_with(&more, RunOptions { stop: stop.clone(), ..options(&data, 1) }, reporter)
    };
    let check = || {
        let found = verify(&data, 1).expect("a dataset");
        assert!(found.missing.is_empty() && found.damaged.is_empty(), "{found:?}");
        // Without a new scene, the dataset is unchanged.
        assert_eq!(found.unfinished, found.scenes > 2);
        if !found.unfinished {
            return;
        }
        // The list also covers the recipe of the growth.
        let recipe = fs::read_to_string(data.join("recipe.toml")).expect("there");
        fs::write(data.join("recipe.toml"), recipe.replace("scenes = 4", "scenes = 5")).expect("writable");
        assert_eq!(verify(&data, 1).expect("a dataset").damaged, ["recipe.toml"]);
        fs::write(data.join("recipe.toml"), recipe).expect("writable");
    };
    assert!(stopped_anywhere(&call, &check) > 2);
    run(&more, &whole, 2).expect("whole");
    assert_same(&whole, &data);
}

#[test]
fn a_lost_list_of_what_the_end_wrote_is_had_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let (whole, data) = (folder.path().join("whole"), folder.path().join("data"));
    let repair = |recipe: &str| run_with(recipe, RunOptions { repair: true, ..options(&data, 1) }, &Quiet);
    let [list, end] = [".syntable/finished.json", "lines/dataset.json"].map(|name| data.join(name));
    run(RECIPE, &whole, 2).expect("whole");
    run(RECIPE, &data, 2).expect("whole");
    // A lost list that is made again with the same bytes is restored.
    for damage in [None, Some("{\"journal\"")] {
        match damage {
            None => fs::remove_file(&list).expect("there"),
            Some(text) => fs::write(&list, text).expect("writable"),
        }
        run(RECIPE, &data, 1).expect("the same end");
        assert_same(&whole, &data);
    }
    // If the list is lost and the end's file is damaged, only a repair replaces the file.
    fs::remove_file(&list).expect("there");
    fs::write(&end, "cut sho").expect("writable");
    for _ in 0..2 {
        let error = run(RECIPE, &data, 1).expect_err("whose is it?").to_string();
        assert!(error.contains("`lines/dataset.json` exists") && error.contains("options.repair"), "{error}");
        assert_eq!(fs::read_to_string(&end).ok().as_deref(), Some("cut sho"));
    }
    repair(RECIPE).expect("taken for the dataset's");
    assert_same(&whole, &data);
    // If the list exists, a file that it does not name is foreign, and even a repair keeps it.
    let other = RECIPE.replace("[write.lines]", "[write.lines]\nend = \"mine.json\"");
    fs::write(data.join("lines/mine.json"), "mine").expect("writable");
    for _ in 0..2 {
        let error = repair(&other).expect_err("not the dataset's").to_string();
        assert!(error.contains("`lines/mine.json` exists") && !error.contains("options.repair"), "{error}");
    }
    assert_eq!(fs::read_to_string(data.join("lines/mine.json")).ok().as_deref(), Some("mine"));
}

#[test]
fn a_damaged_journal_is_mended_by_making_its_scenes_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let (whole, data) = (folder.path().join("whole"), folder.path().join("data"));
    run(RECIPE, &whole, 2).expect("whole");
    run(RECIPE, &data, 2).expect("whole");
    let journal = data.join(".syntable/journal.jsonl");
    let bytes = fs::read(&journal).expect("there");
    let starts: Vec<usize> = (0..bytes.len()).filter(|&at| at == 0 || bytes[at - 1] == b'\n').collect();
    for (scene, &start) in starts.iter().enumerate() {
        let mut broken = bytes.clone();
        broken[start + 4] ^= 1 << (scene + 1);
        fs::write(&journal, broken).expect("writable");
        let error = run(RECIPE, &data, 1).expect_err("damaged").to_string();
        assert!(error.contains(&format!("journal.jsonl:{}", scene + 1)) && error.contains("options.repair"), "{error}");
        let found = verify(&data, 1).expect("it compares the other lines");
        assert!(!found.whole() && found.faults[0].starts_with(&format!("line {} is not", scene + 1)), "{found:?}");
        // Even if another scene was requested.
        let told = Told::default();
        let some = Some(if scene == 0 { 1..2 } else { 0..1 });
        run_with(RECIPE, RunOptions { repair: true, scenes: some, ..options(&data, 1) }, &told).expect("repaired");
        assert!(told.text().contains(&format!("making scenes {scene} again\"")), "{}", told.text());
        assert!(told.text().contains("made: 2,"), "a scene has two views: {}", told.text());
        assert_same(&whole, &data);
    }
    // A journal of an earlier version, without manifests, stays.
    fs::rename(data.join(".syntable/scenes"), folder.path().join("scenes")).expect("movable");
    fs::write(&journal, "{\"scene\":0,\"attempt\":0,\"views\":2}\n").expect("writable");
    run_with(RECIPE, RunOptions { repair: true, ..options(&data, 1) }, &Quiet).expect_err("another version");
    assert_eq!(fs::read_to_string(&journal).expect("there").lines().count(), 1);
}

#[test]
fn forgotten_parts_are_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let recipe = RECIPE.replace("scenes = 4", "scenes = 9");
    let part = |name: &str, scenes: std::ops::Range<u32>| {
        let path = folder.path().join(name);
        run_scenes(&recipe, &path, 1, Some(scenes)).expect("a part");
        path
    };
    let parts = [part("a", 1..3), part("b", 6..7)];
    let out = folder.path().join("merged");
    let merged = |parts: &[PathBuf]| {
        let told = Told::default();
        let outcome = merge(&registry(), &out, parts, &MergeOptions::new(1), &told).expect("merged");
        assert_eq!(outcome.missing + outcome.scenes, 9);
        told.text()
    };
    let text = merged(&parts);
    assert!(text.contains("no part has 6 of the recipe's 9 scenes: 0, 3..6, 7..9"), "{text}");
    assert!(text.contains("merge parts with these scenes"), "{text}");
    assert!(merged(&[part("c", 0..1), part("d", 3..6)]).contains("scenes: 7..9\""));
    assert!(!merged(&[part("e", 7..9)]).contains("no part has"));
}

#[test]
fn labels_that_contradict_each_other_are_put_aside() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data");
    let recipe = |more: &str| {
        format!(
            "[dataset]\nscenes = 3\nviews_per_scene = 2\nname = \"wrong\"\nmax_attempts = 4\n[[place]]\nkind = \"boxes\"\n\
             [render]\nkind = \"sleeper\"\n[write.lines]\ninclude = [\"thought\"]\n{more}"
        )
    };
    let wrong = recipe("[annotate.thinker]\ncontradicts = true\n");
    let outcome = run(&wrong, &data, 2).expect("the others are made");
    assert_eq!((outcome.scenes, outcome.failed, outcome.images), (2, 1, 4));
    // No further attempt hides the contradiction, and the dataset has no file of the scene.
    let entries = Journal::entries_of(&data).expect("readable");
    let errors = entries.get(1).expect("a line").entry().errors;
    let says = |what: &str| errors[0].contains(what);
    assert!(errors.len() == 1 && says("view 1: ") && says("thoughts_are_positive: a thought is -1"), "{errors:?}");
    assert!(says("quarantine/000001"), "{errors:?}");
    assert!(!files(&data).keys().any(|name| name.starts_with("lines/000001")));
    assert!(verify(&data, 1).expect("a dataset").whole());
    let aside = data.join(".syntable/quarantine/000001");
    assert!(std::fs::read_to_string(aside.join("faults.txt")).expect("there").contains("a thought is -1"));
    assert!(aside.join("lines/000001_0000.json").exists(), "the view before it is there to look at");
    // Overwriting the dataset also deletes the quarantine.
    run_with(&recipe(""), RunOptions { overwrite: true, ..options(&data, 1) }, &Quiet).expect("another dataset");
    assert!(!aside.exists());
}
