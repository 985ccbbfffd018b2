//! A failing scene is retried and then recorded. It never stops the run or affects another scene.

#[path = "program/support/mod.rs"]
mod support;
use std::path::Path;
use std::sync::Mutex;
use support::{SMALL, root};
use syntable_model::prelude::*;
use syntable_model::product::standard::VISIBLE_MASK;
use syntable_model::registry::Registry;
use syntable_model::scene::{AssetRef, Removal, Role, SettleReport};
use syntable_program as _;
use syntable_recipe::{Overrides, Source};
use syntable_runtime::cache::DiskCache;
use syntable_runtime::run::progress::{Event, Reporter};
use syntable_runtime::run::{RunOptions, RunOutcome, run};
use syntable_testing::folder::files;
use syntable_testing::scenes;

products! {
    /// A product that some attempts fail to make.
    pub const FRAGILE: Key<PerInstance<u32>> = view("fragile");
}

/// Fails in some scenes.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct Fragile {
    /// Scenes in which every attempt panics.
    panics_in: Vec<u32>,
    /// Scenes in which the first attempt fails.
    stumbles_in: Vec<u32>,
    /// Scenes in which every attempt omits its product.
    silent_in: Vec<u32>,
}

impl Config for Fragile {
    type Stage = dyn ViewAnnotator;
    const KIND: &'static str = "fragile";
    const EXAMPLE: &'static str = "panics_in = [1]";
    fn build(self) -> Result<Box<dyn ViewAnnotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl ViewAnnotator for Fragile {
    fn reads(&self) -> Vec<KeyId> {
        keys![VISIBLE_MASK]
    }
    fn provides(&self) -> Vec<KeyId> {
        keys![FRAGILE]
    }
    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let scene = cx.scene_id.0;
        assert!(!self.panics_in.contains(&scene), "scene {scene} is too much");
        if self.stumbles_in.contains(&scene) && cx.scene.attempt == 0 {
            return Err(Error::unlucky("stumbled"));
        }
        if self.silent_in.contains(&scene) {
            return Ok(());
        }
        let areas = products.get(VISIBLE_MASK)?.map(|_, mask| mask.area());
        products.put(FRAGILE, areas)
    }
}
register!(Fragile);

#[derive(Default)]
struct Events(Mutex<Vec<Event>>);
impl Reporter for Events {
    fn event(&self, event: &Event) {
        self.0.lock().expect("events").push(event.clone());
    }
}

fn small(out: &Path, set: &[(&str, &str)]) -> (RunOutcome, Vec<Event>) {
    let (outcome, events) = attempt(out, set);
    (outcome.expect("the run ends well"), events)
}

fn attempt(out: &Path, set: &[(&str, &str)]) -> (Result<RunOutcome>, Vec<Event>) {
    let registry = Registry::linked().expect("no clash");
    let source = Source::read(root().join("recipes/quickstart.toml")).expect("there");
    let mut changes: Vec<(String, String)> = SMALL
        .chunks(2)
        .map(|pair| pair[1].split_once('=').expect("key=value"))
        .chain(set.iter().copied())
        .map(|(key, value)| (key.to_owned(), value.to_owned()))
        .collect();
    changes.push(("dataset.scenes".into(), "4".into()));
    changes.push(("write.jsonl.include".into(), "[\"fragile\"]".into()));
    let (recipe, _) = syntable_recipe::load(&registry, source, &Overrides::of_process(changes)).expect("a good recipe");
    let options = RunOptions::new(out, 2, DiskCache::new(root().join("target/test-cache")));
    let events = Events::default();
    let outcome = run(&recipe, &options, &events);
    (outcome, events.0.into_inner().expect("events"))
}

#[test]
fn a_panic_costs_one_scene_and_shifts_none() {
    let folder = tempfile::tempdir().expect("a folder");
    let (good, bad) = (folder.path().join("good"), folder.path().join("bad"));
    let (outcome, _) = small(&good, &[]);
    assert_eq!(
        outcome,
        RunOutcome {
            scenes: 4,
            failed: 0,
            lacking: 0,
            missing: 0,
            useless: Vec::new(),
            images: 8,
            bad_assets: Vec::new(),
            left_out: Vec::new()
        }
    );
    let (outcome, events) = small(&bad, &[("annotate.fragile.panics_in", "[1]")]);
    assert_eq!(
        outcome,
        RunOutcome {
            scenes: 3,
            failed: 1,
            lacking: 0,
            missing: 0,
            useless: Vec::new(),
            images: 6,
            bad_assets: Vec::new(),
            left_out: Vec::new()
        }
    );
    let attempts: Vec<&String> =
        events.iter().filter_map(|e| if let Event::Attempt { error, .. } = e { Some(error) } else { None }).collect();
    assert_eq!(attempts.len(), 3);
    assert!(attempts[0].contains("scene 1 is too much") && attempts[0].contains("failing_scenes.rs"), "{attempts:?}");
    let (good, bad) = (files(&good), files(&bad));
    for scene in [0, 2, 3] {
        for view in [0, 1] {
            let name = format!("data/mono/rgb/{scene}_{view}.png");
            assert!(good[&name] == bad[&name], "{name} differs");
        }
    }
    assert!(!bad.keys().any(|name| name.starts_with("data/mono/rgb/1_")), "nothing of a failed scene is left");
    let journal = String::from_utf8(bad[".syntable/journal.jsonl"].clone()).expect("text");
    let lines: Vec<&str> = journal.lines().collect();
    // A run sorts the journal at its end, and writes the digests of all assets first.
    let lines = lines.strip_prefix(&[lines[0]]).filter(|_| lines[0].starts_with(r#"{"assets":"#)).expect("assets");
    assert!(lines[0].contains(r#""outcome":"made","views":2,"#), "{journal}");
    assert!(lines[1].contains(r#""outcome":"failed","#) && lines[1].contains("scene 1 is too much"), "{journal}");
}

#[test]
fn the_next_attempt_may_do_better() {
    let folder = tempfile::tempdir().expect("a folder");
    let (outcome, events) = small(folder.path(), &[("annotate.fragile.stumbles_in", "[2]")]);
    assert_eq!(
        outcome,
        RunOutcome {
            scenes: 4,
            failed: 0,
            lacking: 0,
            missing: 0,
            useless: Vec::new(),
            images: 8,
            bad_assets: Vec::new(),
            left_out: Vec::new()
        }
    );
    let attempts = events.iter().filter(|event| matches!(event, Event::Attempt { last: false, scene: 2, .. })).count();
    assert_eq!(attempts, 1);
}

#[test]
fn a_broken_promise_ends_the_run_and_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let (outcome, events) = attempt(folder.path(), &[("annotate.fragile.silent_in", "[0]")]);
    let error = outcome.expect_err("other random numbers cannot mend a plugin").to_string();
    assert!(error.contains("annotate.fragile: it declares to provide `fragile`"), "{error}");
    assert!(!events.iter().any(|event| matches!(event, Event::Attempt { .. })), "it was tried again: {events:?}");
}

#[test]
fn an_empty_table_fails_the_scene_only() {
    let folder = tempfile::tempdir().expect("a folder");
    // After a twentieth of a second, everything is still falling, and moving objects are removed.
    let set = [
        ("place[2].count", "1"),
        ("settle.on_violation", "remove"),
        ("settle.max_speed_m_s", "0.0001"),
        ("settle.duration_s", "0.05"),
    ];
    let (outcome, events) = small(folder.path(), &set);
    assert_eq!((outcome.scenes, outcome.failed), (0, 4));
    let attempts = events.iter().filter_map(|e| if let Event::Attempt { error, .. } = e { Some(error) } else { None });
    let mut seen = 0;
    for error in attempts {
        assert!(error.contains("of 1 that were placed: 1 still moving at ") && error.contains("more time"), "{error}");
        seen += 1;
    }
    assert!(seen >= 4, "{seen}");
}

#[test]
fn what_left_the_table_is_counted_by_reason() {
    let left = |placed: u32, reasons: &[&str]| {
        let mut scene = scenes::table();
        for spawn in 0..placed {
            let cube = scenes::object("cube", scenes::box_mesh([0.1; 3]), [0.5; 3]);
            let handle = scene.add(scenes::body(cube, [0.0, 0.0, f64::from(spawn)], Role::Object));
            scene.remove(handle);
        }
        let asset = || AssetRef { pool: "p".into(), name: "cube".into() };
        let removed =
            (0..).zip(reasons).map(|(spawn, reason)| Removal { spawn, asset: asset(), reason: (*reason).to_owned() });
        let report = SettleReport { removed: removed.collect(), ..SettleReport::default() };
        scene.freeze(report).expect_err("no object").to_string()
    };
    let fell = "fell off the table";
    let text =
        left(6, &["still moving at 0.12 m/s", fell, "still moving at 0.5 m/s", fell, fell, "1.0 mm deep in p/cube"]);
    let says =
        "of 6 that were placed: 3 fell off the table, 2 such as: still moving at 0.12 m/s, 1 1.0 mm deep in p/cube";
    assert!(text.contains(says), "{text}");
    assert!(left(2, &[]).contains("no object is left, of 2 that were placed ("), "{}", left(2, &[]));
    let none = left(0, &[]);
    assert!(none.contains("no step placed an object") && none.contains("drop_box"), "{none}");
}
