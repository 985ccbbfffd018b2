//! Datasets that grow: more scenes, more views, more writers. The result equals the dataset of one run.

use crate::kit::{Counters, options, registry, rivals, run, run_scenes, run_with};
use std::path::Path;
use syntable_recipe::{Overrides, Source, load};
use syntable_runtime::run::progress::Quiet;
use syntable_runtime::run::{RunOptions, verify};
use syntable_testing::folder::files;

fn recipe(scenes: u32, views: u32, tally: usize, rest: &str) -> String {
    format!(
        "[dataset]\nscenes = {scenes}\nviews_per_scene = {views}\nname = \"growing\"\n\
         [[place]]\nkind = \"boxes\"\n[settle]\nkind = \"rapier\"\ntally = {tally}\n\
         [render]\nkind = \"sleeper\"\ntally = {tally}\n{rest}"
    )
}

const LIGHT: &str = "[write.lines]\ninclude = [\"light\"]\n";
const THOUGHT: &str = "[write.more]\nkind = \"lines\"\ninclude = [\"thought\", \"track\", \"total\"]\n";

/// Asserts that two folders have the same files, byte for byte.
pub fn assert_same(left: &Path, right: &Path) {
    let (a, b) = (files(left), files(right));
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (name, bytes) in &a {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        assert!(*bytes == b[name], "{name}:\n{}\n{}", text(bytes), text(&b[name]));
    }
}

/// A stage of the same kind may come from another crate, or from another file in Python. Its values may differ.
#[test]
fn a_stage_of_another_crate_does_not_continue_a_dataset() {
    let folder = tempfile::tempdir().expect("a folder");
    let run_by = |thinker: &'static str, out: &str, text: &str| {
        let (recipe, _) =
            load(&rivals(thinker, "echo"), Source::embedded("test.toml", text), &Overrides::of_process(Vec::new()))
                .unwrap_or_else(|report| panic!("{report}"));
        syntable_runtime::run::run(&recipe, &options(&folder.path().join(out), 1), &Quiet)
    };
    let text = |scenes| recipe(scenes, 1, 0, "[annotate.thinker]\n[write.lines]\ninclude = [\"thought\"]\n");
    run_by("one", "data", &text(1)).expect("begun");
    for (thinker, scenes) in [("two", 1), ("two", 2), ("kit", 2)] {
        let error = run_by(thinker, "data", &text(scenes)).expect_err("another crate").to_string();
        assert!(error.contains("lock.plugins.one"), "{thinker}: {error}");
    }
    run_by("kit", "other", &text(1)).expect("begun");
    let error = run_by("two", "other", &text(2)).expect_err("another crate").to_string();
    assert!(error.contains("lock.plugins.two"), "{error}");
    run_by("one", "data", &text(2)).expect("the same crate");
}

#[test]
fn more_scenes_give_what_one_run_gives() {
    let folder = tempfile::tempdir().expect("a folder");
    let (grown, whole) = (folder.path().join("grown"), folder.path().join("whole"));
    let rest = format!("{LIGHT}{THOUGHT}");
    run(&recipe(2, 2, 5, &rest), &grown, 2).expect("begun");
    assert_eq!(Counters::both(5), [2, 4]);
    run(&recipe(5, 2, 5, &rest), &grown, 2).expect("grown");
    assert_eq!(Counters::both(5), [5, 10], "what was there was not made again");
    run(&recipe(5, 2, 5, &rest), &whole, 2).expect("whole");
    assert_same(&grown, &whole);
}

#[test]
fn new_scenes_may_have_more_views() {
    let folder = tempfile::tempdir().expect("a folder");
    run(&recipe(2, 2, 0, LIGHT), folder.path(), 1).expect("begun");
    run(&recipe(3, 4, 0, LIGHT), folder.path(), 1).expect("grown");
    // A writer that is added later writes the views that each scene has.
    let outcome = run(&recipe(3, 4, 0, &format!("{LIGHT}{THOUGHT}")), folder.path(), 1).expect("grown");
    assert_eq!((outcome.scenes, outcome.images), (3, 8));
    let files = files(folder.path());
    for id in ["lines", "more"] {
        let views = |scene: u32| files.keys().filter(|name| name.starts_with(&format!("{id}/{scene:06}_"))).count();
        assert_eq!([0, 1, 2].map(views), [2, 2, 4], "{id}");
    }
}

#[test]
fn a_writer_that_comes_later_costs_only_what_it_needs() {
    let (light, thought) = (LIGHT.to_owned(), THOUGHT.to_owned());
    let both = format!("{LIGHT}{THOUGHT}");
    // Labels are made without simulating or rendering. Light is rendered without simulating.
    for (tally, first, cost) in [(6, &light, [3, 6]), (7, &thought, [3, 6])] {
        let folder = tempfile::tempdir().expect("a folder");
        let (grown, whole) = (folder.path().join("grown"), folder.path().join("whole"));
        run(&recipe(3, 2, tally, first), &grown, 2).expect("begun");
        let begun = Counters::both(tally);
        assert_eq!(begun, if first == &light { [3, 6] } else { [3, 0] });
        // Some scenes first, as if the run had been stopped.
        run_scenes(&recipe(3, 2, tally, &both), &grown, 1, Some(1..2)).expect("grows");
        run(&recipe(3, 2, tally, &both), &grown, 2).expect("grown");
        assert_eq!(Counters::both(tally), cost);
        run(&recipe(3, 2, 0, &both).replace("tally = 0", &format!("tally = {tally}")), &whole, 1).expect("whole");
        assert_same(&grown, &whole);
    }
}

#[test]
fn a_scene_that_fails_by_what_comes_later_is_made_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let (grown, whole) = (folder.path().join("grown"), folder.path().join("whole"));
    let both = format!("{LIGHT}{THOUGHT}[annotate.thinker]\nstumbles = true\n");
    run(&recipe(4, 2, 8, LIGHT), &grown, 1).expect("begun");
    run(&recipe(4, 2, 8, &both), &grown, 1).expect("grown");
    // Scenes 1 and 3 failed with the annotator, and were settled again for their second attempt.
    assert_eq!(Counters::both(8)[0], 4 + 2);
    run(&recipe(4, 2, 8, &both), &whole, 2).expect("whole");
    assert_same(&grown, &whole);
}

#[test]
fn growth_of_which_nothing_was_made_can_be_taken_back_or_mended() {
    let folder = tempfile::tempdir().expect("a folder");
    let (data, whole) = (folder.path().join("data"), folder.path().join("whole"));
    let (few, mended) = (recipe(2, 1, 0, LIGHT), recipe(3, 1, 0, &format!("{LIGHT}{THOUGHT}")));
    run(&few, &data, 1).expect("begun");
    let before = files(&data);
    // The annotator fails by chance in every attempt, or can never work; tried on existing and on new scenes.
    for (scenes, mistake, says) in [
        (2, "panics", "2 scenes could not be made"),
        (4, "panics", "4 scenes could not be made"),
        (2, "missing", "the library is not there"),
        (4, "missing", "the library is not there"),
    ] {
        let wrong = recipe(scenes, 1, 0, &format!("{LIGHT}{THOUGHT}[annotate.thinker]\n{mistake} = true\n"));
        let error = run(&wrong, &data, 1).expect_err("nothing was made");
        assert!(error.is_permanent() && error.to_string().contains(says), "{error}");
        assert!(files(&data) == before, "{mistake}: something was changed");
        assert!(verify(&data, 1).expect("a dataset").whole());
    }
    run(&few, &data, 1).expect("taken back");
    assert!(files(&data) == before, "something was changed");
    run(&mended, &data, 1).expect("mended, and it grows");
    run(&mended, &whole, 1).expect("whole");
    assert_same(&data, &whole);
}

#[test]
fn a_scene_that_cannot_have_what_comes_later_stays_as_it_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let (data, whole) = (folder.path().join("data"), folder.path().join("whole"));
    let once = |rest: &str| recipe(3, 1, 0, rest).replace("scenes =", "max_attempts = 1\nscenes =");
    let both = once(&format!("{LIGHT}{THOUGHT}[annotate.thinker]\nstumbles = true\n"));
    run(&once(LIGHT), &data, 1).expect("begun");
    let before = files(&data);
    // Scene 1 fails, and every run tries it again.
    for _ in 0..2 {
        let outcome = run(&both, &data, 1).expect("scenes 0 and 2 grow");
        assert_eq!((outcome.scenes, outcome.failed, outcome.lacking, outcome.images), (3, 0, 1, 3));
        let now = files(&data);
        for name in ["lines/000001_0000.json", ".syntable/scenes/000/000001.json"] {
            assert!(now[name] == before[name], "{name} was changed");
        }
        let more: Vec<&String> = now.keys().filter(|name| name.starts_with("more/00")).collect();
        assert!(more.len() == 4 && !more.iter().any(|name| name.contains("000001")), "{more:?}");
        assert!(verify(&data, 1).expect("a dataset").whole());
    }
    let outcome = run(&both, &whole, 1).expect("whole");
    assert_eq!(
        (outcome.scenes, outcome.failed, outcome.lacking),
        (2, 1, 0),
        "without a scene there is nothing to keep"
    );
}

#[test]
fn files_of_a_writer_are_written_anew_by_who_asks_for_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let both = format!("{LIGHT}{THOUGHT}");
    let other = format!("{LIGHT}{}", THOUGHT.replace("\"track\", ", ""));
    let rewrite = |text: &str, data: &Path| run_with(text, RunOptions { rewrite: true, ..options(data, 1) }, &Quiet);
    // Other options; a recipe without the writer and the stages that only it needs; and the unchanged recipe.
    for (number, to) in (0..).zip([other.as_str(), LIGHT, &both]) {
        let data = folder.path().join(format!("data {number}"));
        run(&recipe(3, 2, 12, &both), &data, 1).expect("begun");
        let (before, simulated) = (files(&data), Counters::both(12)[0]);
        if to != both {
            let error = run(&recipe(3, 2, 12, to), &data, 1).expect_err("not asked for").to_string();
            assert!(error.contains("write.more") && error.contains("run with `options.rewrite`"), "{error}");
            assert!(files(&data) == before, "something was touched");
        }
        rewrite(&recipe(3, 2, 12, to), &data).expect("written anew");
        assert_eq!(Counters::both(12)[0], simulated, "nothing is simulated again");
        let whole = folder.path().join(format!("whole {number}"));
        run(&recipe(3, 2, 12, to), &whole, 1).expect("whole");
        assert_same(&whole, &data);
        assert!(verify(&data, 1).expect("a dataset").whole());
    }
    // A mistake that appears in a later scene can be fixed or taken back.
    let wrong = format!("{LIGHT}{THOUGHT}[annotate.thinker]\nmissing_later = true\n");
    for (number, to) in (3..).zip([both.as_str(), LIGHT]) {
        let [data, whole] = ["data", "whole"].map(|name| folder.path().join(format!("{name} {number}")));
        run(&recipe(4, 1, 12, LIGHT), &data, 1).expect("begun");
        let error = run(&recipe(4, 1, 12, &wrong), &data, 1).expect_err("in scene 1").to_string();
        assert!(error.contains("scene 1") && data.join("more/000000_0000.json").exists(), "{error}");
        run(&recipe(4, 1, 12, to), &data, 1).expect_err("not asked for");
        rewrite(&recipe(4, 1, 12, to), &data).expect("mended or taken back");
        run(&recipe(4, 1, 12, to), &whole, 1).expect("whole");
        assert_same(&whole, &data);
    }
    // If the options of an annotator change, the files of writers that read it are written again, and other files stay.
    let (data, whole) = (folder.path().join("data 0"), folder.path().join("whole 5"));
    let before = files(&data);
    let changed = format!("{other}[annotate.thinker]\nsleep_ms = 1\n");
    rewrite(&recipe(3, 2, 12, &changed), &data).expect("written anew");
    run(&recipe(3, 2, 12, &changed), &whole, 1).expect("whole");
    assert_same(&whole, &data);
    assert!(files(&data)["lines/000001_0000.json"] == before["lines/000001_0000.json"]);
    // A change of the renderer makes a different dataset.
    let error = rewrite(&recipe(3, 2, 13, &changed), &data).expect_err("another renderer").to_string();
    assert!(error.contains("render.tally") && error.contains("options.out"), "{error}");
}

#[test]
fn files_stay_until_there_are_new_ones() {
    let folder = tempfile::tempdir().expect("a folder");
    let [data, whole] = ["data", "whole"].map(|name| folder.path().join(name));
    let both = format!("{LIGHT}{THOUGHT}");
    let other = format!("{LIGHT}{}", THOUGHT.replace("\"track\", ", ""));
    let rewrite =
        |text: &str| run_with(&recipe(3, 1, 0, text), RunOptions { rewrite: true, ..options(&data, 1) }, &Quiet);
    run(&recipe(3, 1, 0, &both), &data, 1).expect("begun");
    let before = files(&data);
    // With the new options, every scene fails: nothing changes.
    rewrite(&format!("{other}[annotate.thinker]\npanics = true\n")).expect_err("in scene 0");
    assert!(files(&data) == before, "something was touched");
    // Scene 1 fails: scenes 1 and 2 keep their earlier files, and all files are listed.
    rewrite(&format!("{other}[annotate.thinker]\nmissing_later = true\n")).expect_err("in scene 1");
    let now = files(&data);
    for (name, stays) in [("000000", false), ("000001", true), ("000002", true)] {
        let name = format!("more/{name}.json");
        assert_eq!(now[&name] == before[&name], stays, "{name}");
    }
    let found = verify(&data, 1).expect("a dataset");
    assert!(found.unfinished && found.missing.is_empty() && found.damaged.is_empty() && found.foreign.is_empty());
    // The dataset does not mistake them for files of its current recipe.
    rewrite(&both).expect("taken back");
    run(&recipe(3, 1, 0, &both), &whole, 1).expect("whole");
    assert_same(&whole, &data);
    // A scene that fails in every attempt with the new options does not keep files made with the old options.
    let wrong = format!("{other}[annotate.thinker]\nstumbles = true\n");
    let once = recipe(3, 1, 0, &wrong).replace("scenes =", "max_attempts = 1\nscenes =");
    let data = folder.path().join("once");
    run(&recipe(3, 1, 0, &both).replace("scenes =", "max_attempts = 1\nscenes ="), &data, 1).expect("begun");
    let outcome = run_with(&once, RunOptions { rewrite: true, ..options(&data, 1) }, &Quiet).expect("scenes 0 and 2");
    assert_eq!((outcome.scenes, outcome.lacking), (3, 1));
    let of_more: Vec<bool> = (0..3).map(|scene| data.join(format!("more/{scene:06}.json")).exists()).collect();
    assert_eq!(of_more, [true, false, true]);
    assert!(verify(&data, 1).expect("a dataset").whole());
}

#[test]
fn scenes_that_are_left_out_of_a_rewrite_keep_their_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let [data, whole] = ["data", "whole"].map(|name| folder.path().join(name));
    let both = recipe(3, 1, 0, &format!("{LIGHT}{THOUGHT}"));
    let other = recipe(3, 1, 0, &format!("{LIGHT}{}", THOUGHT.replace("\"track\", ", "")));
    run(&both, &data, 1).expect("begun");
    let before = files(&data);
    let one = RunOptions { rewrite: true, scenes: Some(0..1), ..options(&data, 1) };
    run_with(&other, one, &Quiet).expect("scene 0");
    let now = files(&data);
    for (name, stays) in [("more/000000.json", false), ("more/000001.json", true), ("more/000002.json", true)] {
        assert_eq!(now.get(name) == before.get(name), stays, "{name}");
    }
    assert!(verify(&data, 1).expect("a dataset").whole());
    // A run of all scenes no longer needs the option.
    run(&other, &data, 1).expect("the others");
    run(&other, &whole, 1).expect("whole");
    assert_same(&whole, &data);
}

#[test]
fn a_file_of_the_dataset_may_become_a_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let ends = |end: &str| recipe(2, 1, 0, &LIGHT.replace("include", &format!("end = \"{end}\"\ninclude")));
    for end in ["all", "all/lines.json"] {
        run(&ends(end), folder.path(), 1).expect("ended");
        assert!(folder.path().join("lines").join(end).is_file(), "{end}");
        assert!(verify(folder.path(), 1).expect("a dataset").whole(), "{end}");
    }
}

#[test]
fn repairing_takes_no_scene_away() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data");
    run(&recipe(2, 1, 0, LIGHT), &data, 1).expect("begun");
    std::fs::write(data.join("lines/000001_0000.json"), "damaged").expect("writable");
    let before = files(&data);
    let wrong = recipe(2, 1, 0, &format!("{LIGHT}{THOUGHT}[annotate.thinker]\npanics = true\n"));
    let repair = RunOptions { repair: true, ..options(&data, 1) };
    let error = run_with(&wrong, repair, &Quiet).expect_err("nothing can be made").to_string();
    assert!(
        error.contains("2 scenes could not be made with what the recipe adds; nothing was written")
            && files(&data) == before,
        "{error}"
    );
}

#[test]
fn growth_follows_the_first_new_scene() {
    let folder = tempfile::tempdir().expect("a folder");
    let (data, whole) = (folder.path().join("data"), folder.path().join("whole"));
    // Scene 1 exists and cannot get the new parts; scene 3 fails before scene 2 is made.
    let once = |scenes, rest: &str| recipe(scenes, 1, 0, rest).replace("scenes =", "max_attempts = 1\nscenes =");
    let both = format!("{LIGHT}{THOUGHT}[annotate.thinker]\nstumbles = true\n");
    run_scenes(&once(4, LIGHT), &data, 1, Some(1..2)).expect("begun");
    let before = files(&data);
    let error = run_scenes(&once(4, &both), &data, 1, Some(3..4)).expect_err("it fails").to_string();
    assert!(error.contains("1 scene could not be made") && files(&data) == before, "{error}");
    let outcome = run(&once(4, &both), &data, 1).expect("0 and 2 are made");
    assert_eq!((outcome.scenes, outcome.failed, outcome.lacking), (3, 1, 1));
    assert!(verify(&data, 1).expect("a dataset").whole());
    // A run with other options for its end can finish even if a scene permanently lacks parts.
    let other = both.replace("[write.more]", "end = \"other.json\"\n[write.more]");
    run(&once(4, &other), &data, 1).expect("ends anew");
    assert!(data.join("lines/other.json").exists());
    run(&once(4, &other), &whole, 1).expect("whole");
    let of = |data: &Path, scene: &str| -> Vec<(String, Vec<u8>)> {
        let written = |name: &String| (name.starts_with("lines/") || name.starts_with("more/")) && name.contains(scene);
        files(data).into_iter().filter(|(name, _)| written(name)).collect()
    };
    for scene in ["000000", "000002"] {
        assert!(of(&data, scene).len() == 4 && of(&data, scene) == of(&whole, scene), "{scene}");
    }
}

#[test]
fn any_recipe_continues_a_dataset_without_scenes() {
    let folder = tempfile::tempdir().expect("a folder");
    let (data, whole) = (folder.path().join("data"), folder.path().join("whole"));
    for mistake in ["panics", "missing"] {
        let wrong = recipe(2, 1, 0, &format!("{THOUGHT}[annotate.thinker]\n{mistake} = true\n"));
        let outcome = run(&wrong, &data, 1).map(|outcome| (outcome.scenes, outcome.failed)).ok();
        assert_eq!(outcome, (mistake == "panics").then_some((0, 2)));
        assert!(data.join("recipe.toml").exists());
    }
    let mended = recipe(2, 1, 0, &LIGHT.replace("lines]", "more]\nkind = \"lines\""));
    run(&mended, &data, 1).expect("mended");
    run(&mended, &whole, 1).expect("whole");
    assert_same(&data, &whole);
}

#[test]
fn what_the_end_of_a_run_reads_may_change() {
    let folder = tempfile::tempdir().expect("a folder");
    let (changed, whole) = (folder.path().join("changed"), folder.path().join("whole"));
    run(&recipe(3, 1, 9, LIGHT), &changed, 1).expect("begun");
    let other = format!("{LIGHT}end = \"other.json\"\n");
    run(&recipe(3, 1, 9, &other), &changed, 1).expect("ends anew");
    assert_eq!(Counters::both(9), [3, 3]);
    run(&recipe(3, 1, 9, &other), &whole, 1).expect("whole");
    assert_same(&changed, &whole);
    assert!(!changed.join("lines/dataset.json").exists() && changed.join("lines/other.json").exists());
}

#[test]
fn a_mistake_at_the_end_shows_after_the_first_scene() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mended, whole) = (folder.path().join("mended"), folder.path().join("whole"));
    let error =
        run(&recipe(50, 1, 10, &format!("{LIGHT}breaks_at = 1\n")), &mended, 1).expect_err("breaks").to_string();
    assert!(
        error.contains("write.lines") && error.contains("too many scenes") && error.contains("nothing is lost"),
        "{error}"
    );
    assert!(Counters::both(10)[0] <= 2, "{:?}", Counters::both(10));
    let few = recipe(50, 1, 10, LIGHT).replace("scenes = 50", "scenes = 51");
    run_scenes(&few, &mended, 1, Some(0..3)).expect("mended, and it may grow, too");
    run_scenes(&few, &whole, 1, Some(0..3)).expect("whole");
    assert_same(&mended, &whole);
}

#[test]
fn every_writer_ends_though_another_fails() {
    let folder = tempfile::tempdir().expect("a folder");
    let rest = format!("{LIGHT}breaks_at = 2\n{THOUGHT}");
    let error = run(&recipe(3, 1, 0, &rest), folder.path(), 1).expect_err("breaks").to_string();
    assert!(error.contains("too many scenes"), "{error}");
    assert!(folder.path().join("more/dataset.json").exists() && !folder.path().join("lines/dataset.json").exists());
    let found = syntable_runtime::run::verify(folder.path(), 1).expect("a dataset");
    assert!(found.unfinished && !found.whole() && found.missing.is_empty() && found.damaged.is_empty(), "{found:?}");
    assert!(found.foreign.is_empty(), "{found:?}");
    run(&recipe(3, 1, 0, &rest.replace("breaks_at = 2", "breaks_at = 9")), folder.path(), 1).expect("mended");
    assert!(syntable_runtime::run::verify(folder.path(), 1).expect("a dataset").whole());
}

#[test]
fn every_writer_ends_that_needs_no_product_of_an_annotator_that_fails() {
    let folder = tempfile::tempdir().expect("a folder");
    let rest = "[annotate.summer]\nfails_at = 2\n[write.labels]\nkind = \"lines\"\ninclude = [\"thought\"]\n"
        .to_owned()
        + &THOUGHT.replace("write.more", "write.a");
    let error = run(&recipe(3, 1, 0, &rest), folder.path(), 1).expect_err("fails").to_string();
    assert!(error.contains("annotate.summer") && error.contains("the sum is too large"), "{error}");
    assert!(folder.path().join("labels/dataset.json").exists() && !folder.path().join("a/dataset.json").exists());
    let found = syntable_runtime::run::verify(folder.path(), 1).expect("a dataset");
    assert!(found.unfinished && found.missing.is_empty() && found.damaged.is_empty(), "{found:?}");
}

#[test]
fn growth_that_is_refused_changes_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let (data, list) = (folder.path().join("data"), folder.path().join("names.txt"));
    // Scene 1 fails.
    let rest = format!(
        "[assets.things]\nkind = \"names\"\nlist = \"{}\"\n[annotate.thinker]\nstumbles = true\n{THOUGHT}",
        list.display()
    );
    let of = |scenes: u32| recipe(scenes, 1, 0, &rest).replace("scenes =", "max_attempts = 1\nscenes =");
    std::fs::write(&list, "a\nb\n").expect("writable");
    assert_eq!(run(&of(2), &data, 1).map(|outcome| (outcome.scenes, outcome.failed)), Ok((1, 1)));
    let before = files(&data);
    std::fs::write(&list, "a\nb\nc\n").expect("writable");
    for retry_failed in [false, true] {
        let error =
            run_with(&of(4), RunOptions { retry_failed, ..options(&data, 1) }, &Quiet).expect_err("another pool");
        assert!(error.to_string().contains("`assets.things` has changed") && error.is_permanent(), "{error}");
        assert!(files(&data) == before, "something was changed");
    }
    std::fs::write(&list, "a\nb\n").expect("writable");
    assert_eq!(run(&of(3), &data, 1).map(|outcome| (outcome.scenes, outcome.failed)), Ok((2, 1)));
}

#[test]
fn a_source_lists_its_assets_once_and_in_order() {
    let folder = tempfile::tempdir().expect("a folder");
    let (data, list) = (folder.path().join("data"), folder.path().join("names.txt"));
    let rest = format!("[assets.things]\nkind = \"names\"\nlist = \"{}\"\n{LIGHT}", list.display());
    for (names, says) in [("a\nc\nb\n", "`c` before `b`"), ("a\nb\nb\n", "`b` twice")] {
        std::fs::write(&list, names).expect("writable");
        let error = run(&recipe(1, 1, 0, &rest), &data, 1).expect_err("not sorted").to_string();
        assert!(error.contains("assets.things") && error.contains(says) && error.contains("plugin"), "{error}");
    }
}

#[test]
fn another_dataset_is_refused_key_by_key() {
    let folder = tempfile::tempdir().expect("a folder");
    let both = format!("{LIGHT}{THOUGHT}");
    run(&recipe(3, 2, 0, &both), folder.path(), 1).expect("begun");
    let before = files(folder.path());
    for (other, says) in [
        (recipe(2, 2, 0, &both), vec!["has 3 scenes", "the recipe has 2", "options.scenes"]),
        (recipe(3, 1, 0, &both), vec!["has 2 views per scene", "the recipe has 1"]),
        (recipe(3, 2, 0, LIGHT), vec!["another recipe", "write.more: kind \"lines\" -> nothing", "options.out"]),
        (recipe(3, 2, 0, &both.replace("\"track\", ", "")), vec!["write.more.include: [", "] -> ["]),
        (recipe(3, 2, 1, &both), vec!["render.tally: 0 -> 1", "settle.tally: 0 -> 1"]),
        (recipe(3, 2, 0, &format!("{both}[sensor.doubler]\n")), vec!["[sensor.doubler]", "write.lines"]),
        (
            recipe(3, 2, 0, &both).replace("growing", "other"),
            vec!["dataset.name: \"growing\" -> \"other\"", "another recipe"],
        ),
    ] {
        let error = run(&other, folder.path(), 1).expect_err("another dataset");
        let text = error.to_string();
        assert!(error.is_permanent() && says.iter().all(|word| text.contains(word)), "{says:?}: {text}");
        assert!(files(folder.path()) == before, "{says:?}: something was touched");
    }
    assert!(registry().entries().len() > 5);
}

#[test]
fn a_path_of_two_scenes_is_refused() {
    // A conflict that `check` can find is refused before any scene is made.
    let folder = tempfile::tempdir().expect("a folder");
    for (path, says) in [
        ("labels.txt", "one path, `labels.txt`"),
        ("/labels.txt", "not a path inside the dataset"),
        (".syntable/lock", "keeps for itself"),
        ("recipe.toml", "keeps for itself"),
        ("a/../../b", "not a path inside the dataset"),
    ] {
        let error = run(&recipe(2, 1, 0, &format!("{LIGHT}said_path = \"{path}\"\n")), folder.path(), 1);
        let error = error.expect_err("refused").to_string();
        assert!(error.contains("write.lines") && error.contains(says), "{path}: {error}");
        assert!(files(folder.path()).is_empty());
    }
    // Any other conflict is refused at the second scene. The first scene, whichever it is, keeps its file.
    let error = run(&recipe(9, 1, 11, &format!("{LIGHT}one_path = true\n")), folder.path(), 1).expect_err("refused");
    assert!(error.is_permanent(), "{error}");
    assert!(error.to_string().contains("`all/scenes.json` is a file of scene"), "{error}");
    assert!(Counters::both(11)[0] <= 4 && folder.path().join("all/scenes.json").exists());
    let views = files(folder.path()).keys().filter(|name| name.starts_with("lines/")).count();
    assert_eq!(views, 1, "the second scene left nothing");
}
