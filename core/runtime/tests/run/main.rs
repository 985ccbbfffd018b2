//! Runs of stages written for these tests: scheduling, scopes, replacement, errors that end a run at once, and datasets
//! that grow, are compared, repaired and merged.

mod claims;
mod devices;
mod draws;
mod generate;
mod growth;
#[cfg(unix)]
mod hostile;
mod kit;
mod mixture;
mod preview;
mod scale;
mod shards;
mod stores;
mod whole;

use kit::{Counters, run};
use std::time::{Duration, Instant};
use syntable_model::registry::Registry;
use syntable_recipe::{Overrides, Source};
use syntable_runtime::cache::DiskCache;
use syntable_runtime::run::forecast::{Bound, ForecastOptions, forecast};
use syntable_runtime::run::progress::Quiet;
use syntable_runtime::run::stop::Stop;
use syntable_testing::folder::files;

/// Number of scenes and of views of each, and the time to compose a scene, render a view and annotate a view, ms.
const SCENES: u32 = 6;
const VIEWS: u32 = 4;
const COMPOSE_MS: u64 = 60;
const RENDER_MS: u64 = 25;
const ANNOTATE_MS: u64 = 25;

fn slow_recipe() -> String {
    format!(
        "[dataset]\nscenes = {SCENES}\nviews_per_scene = {VIEWS}\nname = \"slow\"\n\
         [[place]]\nkind = \"boxes\"\nsleep_ms = {COMPOSE_MS}\n\
         [render]\nkind = \"sleeper\"\nsleep_ms = {RENDER_MS}\n\
         [annotate.thinker]\nsleep_ms = {ANNOTATE_MS}\n\
         [write.lines]\ninclude = [\"thought\", \"light\"]\n"
    )
}

fn slow(out: &std::path::Path, threads: usize) -> Duration {
    let start = Instant::now();
    run(&slow_recipe(), out, threads).expect("the run ends well");
    start.elapsed()
}

#[test]
fn one_render_session_overlaps_with_everything_else() {
    let folder = tempfile::tempdir().expect("a folder");
    // Other programs may slow one run down.
    let out = |name: &str| folder.path().join(name);
    let took = ["two", "two again", "two once more"].map(|name| slow(&out(name), 2)).into_iter().min().expect("three");
    let rendering = Duration::from_millis(u64::from(SCENES * VIEWS) * RENDER_MS);
    let rest = Duration::from_millis(u64::from(SCENES) * COMPOSE_MS + u64::from(SCENES * VIEWS) * ANNOTATE_MS);
    eprintln!("rendering {rendering:?}, the rest {rest:?} on 2 threads, together {took:?}");
    // The run takes little longer than the larger part. The first scene cannot overlap with other work. The sum is 1.56
    // s.
    assert!(took < (rendering + rest).mul_f64(0.75), "{took:?} of {rendering:?} + {rest:?}");
    // The bytes do not depend on the scheduling.
    for threads in [1, 5] {
        let other = out(&threads.to_string());
        slow(&other, threads);
        assert_eq!(files(&other), files(&out("two")), "{threads} threads");
    }
}

#[test]
fn a_forecast_agrees_with_the_run() {
    let folder = tempfile::tempdir().expect("a folder");
    slow(&folder.path().join("data"), 2);
    let source = Source::embedded("test.toml", slow_recipe());
    let (recipe, _) =
        syntable_recipe::load(&kit::registry(), source, &Overrides::of_process(Vec::new())).expect("loads");
    let options = ForecastOptions {
        measured: Some(2),
        threads: 2,
        allow_code: false,
        cache: DiskCache::new(folder.path().join("cache")),
        stop: Stop::default(),
    };
    let found = forecast(&recipe, &options, &Quiet).expect("a forecast");
    // One session renders the views of all scenes, one after the other.
    let rendering = Duration::from_millis(u64::from(VIEWS) * RENDER_MS).as_secs_f64();
    let pace = &found.pace;
    assert_eq!((pace.measured, found.scenes, pace.bound), (2, SCENES, Bound::RenderDevice), "{found:?}");
    assert!(pace.scene_s >= rendering && pace.total_s >= f64::from(SCENES) * rendering, "{found:?}");
    // The dataset has more files of its own than its scenes have.
    let written: usize = files(&folder.path().join("data")).values().map(Vec::len).sum();
    assert!((0.5..2.0).contains(&(found.total_bytes() as f64 / written as f64)), "{written}, {found:?}");
}

#[test]
fn annotators_of_scene_and_dataset_see_all_views_and_scenes() {
    let folder = tempfile::tempdir().expect("a folder");
    let recipe = "[dataset]\nscenes = 3\nviews_per_scene = 4\nname = \"scopes\"\n\
         [[place]]\nkind = \"boxes\"\n[render]\nkind = \"sleeper\"\n\
         [write.lines]\ninclude = [\"track\", \"total\", \"thought\"]\n";
    run(recipe, folder.path(), 3).expect("the run ends well");
    let files = files(folder.path());
    let text = |name: &str| String::from_utf8(files[name].clone()).expect("text");
    // `thought` of view v in scene s is 100 s + v; the track lists the thoughts of all views, and the total is their
    // sum.
    assert_eq!(text("lines/000002.json"), r#"{"track":[200,201,202,203]}"#);
    assert_eq!(text("lines/000001_0003.json"), r#"{"thought":103}"#);
    assert!(text("lines/dataset.json").ends_with(r#"{"total":{"scenes":3,"sum":1218}}"#));
}

#[test]
fn a_resumed_run_annotates_the_dataset_from_all_scenes() {
    let folder = tempfile::tempdir().expect("a folder");
    let recipe = "[dataset]\nscenes = 3\nviews_per_scene = 1\nname = \"resumed\"\n\
         [[place]]\nkind = \"boxes\"\n[render]\nkind = \"sleeper\"\n[write.lines]\ninclude = [\"total\"]\n";
    kit::run_scenes(recipe, folder.path(), 1, Some(0..1)).expect("the first scene");
    let total = || {
        let text = String::from_utf8(files(folder.path())["lines/dataset.json"].clone()).expect("text");
        text.lines().last().expect("a line").to_owned()
    };
    assert_eq!(total(), r#"{"total":{"scenes":1,"sum":0}}"#);
    run(recipe, folder.path(), 1).expect("the others");
    assert_eq!(total(), r#"{"total":{"scenes":3,"sum":300}}"#);
}

#[test]
fn a_stage_replaces_a_product_for_all_others() {
    let line = |stage: &str, include: &str| {
        let folder = tempfile::tempdir().expect("a folder");
        let recipe = format!(
            "[dataset]\nscenes = 1\nviews_per_scene = 1\nname = \"replaced\"\n\
             [[place]]\nkind = \"boxes\"\n[render]\nkind = \"sleeper\"\n{stage}[write.lines]\ninclude = [{include}]\n"
        );
        run(&recipe, folder.path(), 1).expect("the run ends well");
        String::from_utf8(files(folder.path())["lines/000000_0000.json"].clone()).expect("text")
    };
    let replaced = line("[sensor.doubler]\n", "\"light\", \"light_raw\", \"thought\"");
    assert_eq!(replaced, r#"{"light":2,"light_raw":1,"thought":0}"#);
    // A registered stage that is not in the recipe replaces nothing.
    assert_eq!(line("", "\"light\", \"thought\""), r#"{"light":1,"thought":0}"#);
}

#[test]
fn of_two_providers_the_stock_one_is_taken() {
    let recipe = "[dataset]\nscenes = 1\nviews_per_scene = 1\nname = \"rivals\"\n\
         [[place]]\nkind = \"boxes\"\n[render]\nkind = \"sleeper\"\n[write.lines]\ninclude = [\"thought\"]\n";
    let load = |registry: &Registry| {
        let source = Source::embedded("test.toml", recipe);
        syntable_recipe::load(registry, source, &Overrides::of_process(Vec::new())).map(|(recipe, _)| {
            let of =
                recipe.components.first().plan.entries.iter().find(|entry| entry.key.is("thought")).expect("planned");
            of.provider.to_string()
        })
    };
    // A crate is part of the stock by its full name, not by a similar name.
    assert_eq!(load(&kit::rivals("syntable-annotate", "syntable-extra")).as_deref(), Ok("annotate.thinker"));
    assert_eq!(load(&kit::rivals("syntable-extra", "syntable-annotate")).as_deref(), Ok("annotate.echo"));
    let both = load(&kit::rivals("syntable-extra", "syntable-annotate-more")).expect_err("nobody's").to_string();
    assert!(both.contains("has several providers"), "{both}");
}

#[test]
fn a_panic_anywhere_fails_the_scene_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let recipe = "[dataset]\nscenes = 2\nviews_per_scene = 2\nname = \"bent\"\nmax_attempts = 2\n\
         [[place]]\nkind = \"boxes\"\n[render]\nkind = \"sleeper\"\n[views]\nkind = \"hemisphere_shell\"\nbends = true\n\
         [write.lines]\ninclude = [\"light\"]\n";
    let outcome = run(recipe, folder.path(), 2).expect("the run ends well");
    assert_eq!((outcome.scenes, outcome.failed), (0, 2));
    let journal = String::from_utf8(files(folder.path())[".syntable/journal.jsonl"].clone()).expect("text");
    assert!(journal.contains("views: panicked at") && journal.contains("the shell is bent"), "{journal}");
}

#[test]
fn what_chance_cannot_change_ends_the_run_at_once() {
    for (tally, (broken, message)) in (1..).zip([
        ("panics = false\nundeclared = true", "annotate.thinker: product `light` is read but not declared"),
        ("silent = true", "annotate.thinker: it declares to provide `thought` but did not"),
        ("missing = true", "annotate.thinker: the library is not there"),
    ]) {
        let folder = tempfile::tempdir().expect("a folder");
        let recipe = format!(
            "[dataset]\nscenes = 50\nviews_per_scene = 2\nname = \"broken\"\nmax_attempts = 4\n\
             [[place]]\nkind = \"boxes\"\n[render]\nkind = \"sleeper\"\ntally = {tally}\n[annotate.thinker]\n{broken}\n\
             [write.lines]\ninclude = [\"thought\", \"light\"]\n"
        );
        let error = run(&recipe, folder.path(), 1).expect_err("it stops").to_string();
        assert!(error.contains(message), "{error}");
        let rendered = Counters::rendered(tally);
        assert!((1..=4).contains(&rendered), "{broken}: {rendered} views rendered");
    }
}

#[test]
fn what_chance_can_change_is_tried_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let recipe = "[dataset]\nscenes = 2\nviews_per_scene = 2\nname = \"panics\"\nmax_attempts = 2\n\
         [[place]]\nkind = \"boxes\"\n[render]\nkind = \"sleeper\"\n[annotate.thinker]\npanics = true\n\
         [write.lines]\ninclude = [\"thought\", \"light\"]\n";
    let outcome = run(recipe, folder.path(), 2).expect("the run ends well");
    assert_eq!((outcome.scenes, outcome.failed), (0, 2));
    let journal = String::from_utf8(files(folder.path())[".syntable/journal.jsonl"].clone()).expect("text");
    assert!(journal.contains("annotate.thinker: panicked at") && journal.contains("kit.rs"), "{journal}");
}
