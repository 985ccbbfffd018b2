//! Samples in memory: what a run writes, in order, and no files.

use crate::kit::{THOUGHT, TRACK, registry, run};
use std::sync::Arc;
use syntable_model::product::Value;
use syntable_recipe::{Overrides, Recipe, Source};
use syntable_runtime::cache::DiskCache;
use syntable_runtime::generate::{GenerateOptions, Generated, Generator, Sample, generate};
use syntable_runtime::run::progress::Quiet;
use syntable_testing::folder::files;

fn load(stages: &str) -> Recipe {
    let text = format!("{}{stages}[write.lines]\ninclude = [\"thought\", \"track\"]\n", head(5, 3));
    let loaded =
        syntable_recipe::load(&registry(), Source::embedded("test.toml", &text), &Overrides::of_process(Vec::new()));
    loaded.unwrap_or_else(|report| panic!("{report}")).0
}

fn head(scenes: u32, views: u32) -> String {
    format!(
        "[dataset]\nscenes = {scenes}\nviews_per_scene = {views}\nname = \"samples\"\nmax_attempts = 2\n\
         [[place]]\nkind = \"boxes\"\n[render]\nkind = \"sleeper\"\n"
    )
}

fn options(threads: usize) -> GenerateOptions {
    let cache = DiskCache::new(std::env::temp_dir().join("syntable-generate-tests"));
    GenerateOptions { products: vec!["thought".into(), "track".into()], threads, cache, ..GenerateOptions::default() }
}

/// Scene, view, and the values of a sample as JSON.
fn told(sample: &Sample) -> (u32, u32, String) {
    let value = |value: &Value| serde_json::to_string(value).expect("plain data");
    let [thought, track] = [THOUGHT, TRACK].map(|key| value(sample.products.get(key).expect("asked for")));
    (sample.scene.id.0, sample.view.id.0, format!("{thought} {track}"))
}

#[test]
fn samples_are_what_a_run_writes() {
    let folder = tempfile::tempdir().expect("a folder");
    run(&format!("{}[write.lines]\ninclude = [\"thought\", \"track\"]\n", head(5, 3)), folder.path(), 2).expect("run");
    let files = files(folder.path());
    let written = |name: String, key: &str| {
        let values: serde_json::Value = serde_json::from_slice(&files[&name]).expect("JSON");
        values[key].to_string()
    };
    let wanted: Vec<(u32, u32, String)> = (0..5)
        .flat_map(|scene| (0..3).map(move |view| (scene, view)))
        .map(|(scene, view)| {
            let thought = written(format!("lines/{scene:06}_{view:04}.json"), "thought");
            (scene, view, format!("{thought} {}", written(format!("lines/{scene:06}.json"), "track")))
        })
        .collect();
    for threads in [1, 4] {
        let mut samples = Vec::new();
        let result = generate(&load(""), &options(threads), &Quiet, &mut |sample| {
            samples.push(told(&sample));
            Ok(())
        });
        assert_eq!((result, &samples), (Ok(Generated::default()), &wanted), "{threads} threads");
    }
    let some = GenerateOptions { scenes: Some(1..3), ..options(2) };
    let generator = Generator::start(Arc::new(load("")), some, Arc::new(Quiet));
    let samples: Vec<_> = generator.map(|sample| told(&sample.expect("made"))).collect();
    assert_eq!(samples, wanted[3..9]);
}

#[test]
fn samples_leave_out_what_a_run_leaves_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = format!("{}[write.lines]\ninclude = [\"glance\"]\n", head(3, 2));
    let outcome = run(&text, folder.path(), 1).expect("run");
    let loaded =
        syntable_recipe::load(&registry(), Source::embedded("test.toml", &text), &Overrides::of_process(Vec::new()));
    let recipe = loaded.unwrap_or_else(|report| panic!("{report}")).0;
    let all = GenerateOptions { products: Vec::new(), ..options(3) };
    let result = generate(&recipe, &all, &Quiet, &mut |_| Ok(())).expect("made");
    assert!(!outcome.left_out.is_empty() && result.left_out == outcome.left_out, "{:?}", result.left_out);
}

#[test]
fn scenes_that_fail_have_no_samples_and_are_counted() {
    let mut generator = Generator::start(
        Arc::new(load("[views]\nkind = \"hemisphere_shell\"\nbends = true\n")),
        options(3),
        Arc::new(Quiet),
    );
    assert!(generator.next().is_none());
    assert_eq!(generator.result().failed, [0, 1, 2, 3, 4]);
    // What is wrong with every scene ends it.
    let recipe = Arc::new(load("[annotate.thinker]\nmissing = true\n"));
    let mut generator = Generator::start(recipe, options(2), Arc::new(Quiet));
    let error = generator.next().expect("an error").err().expect("an error").to_string();
    assert!(error.contains("the library is not there") && generator.next().is_none(), "{error}");
}

#[test]
fn samples_end_when_nobody_wants_more() {
    // More scenes than could be made in the time of the test.
    let recipe = |scenes| {
        let text = format!("{}[write.lines]\ninclude = [\"thought\", \"track\"]\n", head(scenes, 2));
        let loaded = syntable_recipe::load(
            &registry(),
            Source::embedded("test.toml", &text),
            &Overrides::of_process(Vec::new()),
        );
        Arc::new(loaded.unwrap_or_else(|report| panic!("{report}")).0)
    };
    let mut generator = Generator::start(recipe(1_000_000), options(2), Arc::new(Quiet));
    assert!(generator.next().is_some_and(|sample| sample.is_ok()));
    drop(generator);
    let own = options(2);
    let stop = own.stop.clone();
    let result = generate(&recipe(1_000_000), &own, &Quiet, &mut |_| {
        stop.cancel();
        Ok(())
    });
    assert_eq!(result.expect_err("stopped").to_string(), "stopped by its caller");
    let refused = generate(&recipe(1_000_000), &options(2), &Quiet, &mut |_| {
        Err(syntable_model::error::Error::new("no more, thanks"))
    });
    assert_eq!(refused.expect_err("refused").to_string(), "no more, thanks");
    // A product that is not computed is refused before anything is made.
    let unknown = GenerateOptions { products: vec!["depth".into()], ..options(1) };
    let error = generate(&recipe(1), &unknown, &Quiet, &mut |_| Ok(())).expect_err("refused").to_string();
    assert!(error.contains("the recipe does not compute `depth`"), "{error}");
}
