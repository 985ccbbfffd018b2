//! Samples in memory: the data that a run writes, in order, without files.

use crate::kit::{Counters, THOUGHT, TICK, TRACK, registry, run};
use std::sync::Arc;
use std::time::Duration;
use syntable_model::product::{Products, Value};
use syntable_model::stage::Input;
use syntable_recipe::{Overrides, Recipe, Source};
use syntable_runtime::cache::DiskCache;
use syntable_runtime::generate::{GenerateOptions, Generated, Generator, Sample, SceneService, generate};
use syntable_runtime::run::preview::{Previewer, Wanted};
use syntable_runtime::run::progress::{Quiet, Warnings};
use syntable_runtime::run::stop::Stop;
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
    let steps = Generator::of_scenes(Arc::new(load("")), options(2), (0..5).step_by(4), Arc::new(Quiet));
    let samples: Vec<_> = steps.map(|sample| told(&sample.expect("made"))).collect();
    assert_eq!(samples, [&wanted[..3], &wanted[12..]].concat());
    let mut beyond = Generator::of_scenes(Arc::new(load("")), options(2), 4..6, Arc::new(Quiet)).skip(3);
    let error = beyond.next().expect("an error").err().expect("the recipe has no scene 5").to_string();
    assert!(error.contains("scene 5: the recipe has scenes 0..5"), "{error}");
    // Scenes on request, in any order.
    let mut service = SceneService::start(Arc::new(load("")), options(3), Arc::new(Quiet));
    let patience = Duration::from_millis(1);
    assert!(service.next_within(patience).expect("it waits").is_none());
    let asked = [3, 0, 3, 4, 1];
    asked.iter().for_each(|scene| service.request(*scene));
    for scene in asked {
        let made = loop {
            if let Some(made) = service.next_within(patience).expect("it works") {
                break made;
            }
        };
        let samples: Vec<_> = made.1.expect("samples").iter().map(told).collect();
        assert_eq!((made.0, &samples[..]), (scene, &wanted[3 * scene as usize..][..3]));
    }
}

#[test]
fn a_product_of_a_moment_comes_with_each_view_at_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = format!(
        "{}[views]\nkind = \"hemisphere_shell\"\nviews_per_second = 2\n[annotate.clock]\ntally = 21\n[write.lines]\ninclude = [\"tick\"]\n",
        head(2, 5)
    );
    let ticks = [0.0, 0.0, 1.0, 1.0, 2.0];
    run(&text, folder.path(), 2).expect("run");
    let files = files(folder.path());
    let written =
        (0..5).map(|view| serde_json::from_slice(&files[&format!("lines/000001_{view:04}.json")]).expect("JSON"));
    let written: Vec<f64> = written.map(|values: serde_json::Value| values["tick"].as_f64().expect("a time")).collect();
    assert_eq!((written.as_slice(), Counters::ticks(21)), (&ticks[..], 2 * 3));
    assert_eq!(files["lines/000001.json"], b"{}", "the scene has no moment");
    let load = || {
        let wanted = [Input::of(TICK)].to_vec();
        let overrides = Overrides { wanted, ..Overrides::of_process(Vec::new()) };
        let loaded = syntable_recipe::load(&registry(), Source::embedded("test.toml", text.as_str()), &overrides);
        loaded.unwrap_or_else(|report| panic!("{report}")).0
    };
    let tick = |products: &Products| match products.get(TICK) {
        Ok(Value::Float(seconds)) => *seconds,
        other => panic!("{other:?}"),
    };
    let mut samples = Vec::new();
    let products = vec!["tick".to_owned()];
    generate(&load(), &GenerateOptions { products: products.clone(), ..options(3) }, &Quiet, &mut |sample| {
        samples.push(tick(&sample.products));
        Ok(())
    })
    .expect("made");
    assert_eq!((samples, Counters::ticks(21)), ([ticks, ticks].concat(), 4 * 3));
    // A preview makes some of the views, in any order.
    let mut previewer = Previewer::new(1, DiskCache::new(folder.path().join("../cache"))).expect("threads");
    previewer.set(load()).expect("sound");
    let (stop, log) = (Stop::default(), Warnings(&Quiet));
    let mut pass =
        previewer.pass(&Wanted { products, width: 4, allow_code: false }, &Quiet, &log, &stop).expect("pools");
    let mut seen = Vec::new();
    pass.scene(1, &[4, 1, 0], &mut |view, products, _| seen.push((view, tick(products)))).expect("made");
    assert_eq!((seen, Counters::ticks(21)), (vec![(4, 2.0), (1, 0.0), (0, 0.0)], 4 * 3 + 2));
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
    // An error that affects every scene ends the generator.
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
    let many = options(2);
    let shared = many.stop.clone();
    let mut generator = Generator::start(recipe(1_000_000), many, Arc::new(Quiet));
    assert!(generator.next().is_some_and(|sample| sample.is_ok()));
    drop(generator);
    assert!(!shared.is_requested(), "other work of the caller may share the handle");
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
    // A product that is not computed is refused before any sample is made.
    let unknown = GenerateOptions { products: vec!["depth".into()], ..options(1) };
    let error = generate(&recipe(1), &unknown, &Quiet, &mut |_| Ok(())).expect_err("refused").to_string();
    assert!(error.contains("the recipe does not compute `depth`"), "{error}");
}
