//! Mixtures: each scene is made by one of several recipes, in one dataset.

use crate::growth::assert_same;
use crate::kit::{AtEvent, options, registry, run, run_scenes, run_with};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicU32;
use syntable_model::prelude::*;
use syntable_model::registry::{Entry, Registry};
use syntable_model::scene::Light;
use syntable_model::stage::Input;
use syntable_recipe::{Overrides, Recipe, Source};
use syntable_runtime::cache::DiskCache;
use syntable_runtime::generate::{GenerateOptions, generate};
use syntable_runtime::run::dataset::journal::JournalEntry;
use syntable_runtime::run::preview::{Previewer, Wanted};
use syntable_runtime::run::progress::{Quiet, Warnings};
use syntable_runtime::run::stop::Stop;
use syntable_runtime::run::{MergeOptions, RunOptions, merge, verify};
use syntable_testing::folder::files;

const SCENES: u32 = 12;

fn head(scenes: u32) -> String {
    format!("[dataset]\nscenes = {scenes}\nviews_per_scene = 2\nname = \"mixed\"\n")
}

/// The stages of two recipes: one cube before a fixed camera, and two cubes, lit, before a camera that wanders.
const ONE: &str = "[[place]]\nkind = \"boxes\"\n[render]\nkind = \"sleeper\"\n";
const TWO: &str = "[[place]]\nkind = \"pair\"\n[[lights]]\nkind = \"bulb\"\nnits = 7\n[views]\nkind = \"wander\"\n\
     [render]\nkind = \"drowsy\"\n";
const LINES: &str = "[write.lines]\ninclude = [\"light\", \"thought\", \"track\", \"total\"]\n";

/// The tables of a component.
fn component(id: &str, stages: &str) -> String {
    let line = |line: &str| match (line.strip_prefix("[["), line.strip_prefix('[')) {
        (Some(rest), _) => format!("[[mixture.{id}.{rest}\n"),
        (_, Some(rest)) => format!("[mixture.{id}.{rest}\n"),
        _ => format!("{line}\n"),
    };
    format!("[mixture.{id}]\n{}", stages.lines().map(line).collect::<String>())
}

fn mixed(scenes: u32, write: &str) -> String {
    let (one, two) = (component("one", ONE), component("two", TWO));
    format!("{}{one}{}{write}", head(scenes), two.replace("[mixture.two]", "[mixture.two]\nweight = 2"))
}

fn load(text: &str) -> Recipe {
    let loaded = syntable_recipe::load(&registry(), Source::embedded("t", text), &Overrides::of_process(Vec::new()));
    loaded.unwrap_or_else(|report| panic!("{report}")).0
}

fn journal(folder: &Path) -> BTreeMap<u32, JournalEntry> {
    let text = std::fs::read_to_string(folder.join(".syntable/journal.jsonl")).expect("a journal");
    let entries = text.lines().map(|line| serde_json::from_str::<JournalEntry>(line).expect("a line"));
    entries.map(|entry| (entry.scene, entry)).collect()
}

#[test]
fn a_scene_is_what_its_component_alone_makes() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = |name: &str| folder.path().join(name);
    let per_scene = "[write.lines]\ninclude = [\"light\", \"thought\", \"track\"]\n";
    run(&mixed(SCENES, per_scene), &out("mixed"), 2).expect("made");
    for (id, stages) in [("one", ONE), ("two", TWO)] {
        run(&format!("{}{stages}{per_scene}", head(SCENES)), &out(id), 2).expect("made");
    }
    let all: BTreeMap<&str, _> = ["mixed", "one", "two"].map(|name| (name, files(&out(name)))).into();
    let entries = journal(&out("mixed"));
    for (scene, entry) in &entries {
        let own = |name: &&String| name.starts_with(&format!("lines/{scene:06}"));
        let (mixed, alone) = (&all["mixed"], &all[entry.component.as_str()]);
        let names: Vec<&String> = mixed.keys().filter(own).collect();
        assert!(names.len() == 3 && names == alone.keys().filter(own).collect::<Vec<_>>(), "{names:?}");
        assert!(names.iter().all(|name| mixed[*name] == alone[*name]), "scene {scene} of {}", entry.component);
        assert_eq!(entry.outcome, journal(&out(&entry.component))[scene].outcome);
    }
    let ids: Vec<&str> = entries.values().map(|entry| entry.component.as_str()).collect();
    assert!(ids.contains(&"one") && ids.contains(&"two"), "{ids:?}");
    let recipe = load(&mixed(SCENES, per_scene));
    assert!(entries.iter().all(|(scene, entry)| recipe.component_of(*scene).1.id == entry.component));
}

#[test]
fn threads_growth_merging_and_interruptions_do_not_change_a_mixture() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = |name: &str| folder.path().join(name);
    let text = mixed(SCENES, LINES);
    run(&text, &out("whole"), 1).expect("made");
    run(&text, &out("three"), 3).expect("made");
    assert_same(&out("three"), &out("whole"));
    let verified = verify(out("whole"), 2).expect("read");
    assert!(verified.missing.is_empty() && verified.damaged.is_empty() && verified.foreign.is_empty(), "{verified:?}");
    // From fewer scenes, and from one writer.
    run(&mixed(5, "[write.lines]\ninclude = [\"light\"]\n"), &out("grown"), 2).expect("begun");
    let more = "[write.more]\nkind = \"lines\"\ninclude = [\"thought\", \"total\"]\n";
    let grown = mixed(SCENES, &format!("[write.lines]\ninclude = [\"light\"]\n{more}"));
    run(&grown, &out("grown"), 2).expect("grown");
    run(&grown, &out("at_once"), 2).expect("made");
    assert_same(&out("grown"), &out("at_once"));
    // Stopped, and continued from the resolved recipe.
    let stop = Stop::default();
    let act = || stop.cancel();
    let reporter = AtEvent { number: 9, act: &act, seen: AtomicU32::new(0) };
    let stopped = RunOptions { stop: stop.clone(), ..options(&out("stopped"), 2) };
    run_with(&text, stopped, &reporter).expect_err("stopped");
    assert!(journal(&out("stopped")).len() < SCENES as usize);
    let resolved = std::fs::read_to_string(out("stopped").join("recipe.toml")).expect("there");
    run(&resolved, &out("stopped"), 2).expect("continued");
    assert_same(&out("stopped"), &out("whole"));
    // Lost files are made again.
    let view = out("three").join("lines/000003_0001.json");
    std::fs::remove_file(&view).expect("there");
    run_with(&text, RunOptions { repair: true, ..options(&out("three"), 2) }, &Quiet).expect("repaired");
    assert_same(&out("three"), &out("whole"));
    // In two parts.
    run_scenes(&text, &out("a"), 1, Some(0..7)).expect("made");
    run_scenes(&text, &out("b"), 1, Some(7..SCENES)).expect("made");
    let parts: Vec<PathBuf> = vec![out("a"), out("b")];
    merge(&registry(), out("merged"), &parts, &MergeOptions::new(2), &Quiet).expect("merged");
    assert_same(&out("merged"), &out("whole"));
}

#[test]
fn other_weights_or_components_are_another_recipe() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = mixed(4, LINES);
    run(&text, folder.path(), 2).expect("made");
    for other in [
        text.replace("weight = 2", "weight = 3"),
        text.replace(LINES, &format!("{}{LINES}", component("three", ONE))),
        text.replace("nits = 7", "nits = 8"),
    ] {
        let error = run(&other, folder.path(), 2).expect_err("another recipe").to_string();
        assert!(error.contains("the folder has a dataset of another recipe:\n  mixture."), "{error}");
    }
}

#[test]
fn samples_in_memory_are_those_of_the_components() {
    let recipe = load(&mixed(SCENES, LINES));
    let cache = DiskCache::new(std::env::temp_dir().join("syntable-mixture-tests"));
    let mut objects = BTreeMap::new();
    let options = GenerateOptions { products: vec!["light".into()], threads: 2, cache, ..GenerateOptions::default() };
    generate(&recipe, &options, &Quiet, &mut |sample| {
        let is_lit = |light: &Light| matches!(light, Light::Sphere(bulb) if bulb.radiance == [7.0; 3]);
        let lit = sample.view.lights.iter().any(is_lit);
        objects.insert(sample.scene.id.0, (sample.scene.objects().len(), lit));
        Ok(())
    })
    .expect("made");
    let found: BTreeSet<(usize, bool)> = objects.values().copied().collect();
    assert_eq!((objects.len(), found.len()), (SCENES as usize, 2), "{objects:?}");
    for (scene, found) in objects {
        assert_eq!(
            found,
            if recipe.component_of(scene).1.id == "one" { (1, false) } else { (2, true) },
            "scene {scene}"
        );
    }
}

#[test]
fn annotators_of_the_dataset_must_agree() {
    let own = "[mixture.one.annotate.summer]\nfails_at = 100\n";
    let text = mixed(4, LINES).replace("[mixture.two]", &format!("{own}[mixture.two]"));
    let loaded = syntable_recipe::load(&registry(), Source::embedded("t", &text), &Overrides::of_process(Vec::new()));
    let report = loaded.err().expect("refused").to_string();
    assert!(report.contains("`one` and `two` differ in [annotate.summer]"), "{report}");
    load(&text.replace("[write.lines]", "[mixture.two.annotate.summer]\nfails_at = 100\n[write.lines]"));
}

/// The product `thought` with a unit.
const WEIGHED: Key<Value> = Key::view("thought", "A thought that was weighed.").unit("kg");

/// Provides [`WEIGHED`].
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct Weigher {}

impl Config for Weigher {
    type Stage = dyn ViewAnnotator;
    const KIND: &'static str = "weigher";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn ViewAnnotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl ViewAnnotator for Weigher {
    fn reads(&self) -> Vec<KeyId> {
        Vec::new()
    }
    fn provides(&self) -> Vec<KeyId> {
        vec![WEIGHED.id()]
    }
    /// Number of objects, and radiance of the bulbs.
    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let bulbs = cx.view.lights.iter().filter_map(|light| match light {
            Light::Sphere(bulb) => Some(bulb.radiance[0] as i64),
            _ => None,
        });
        products.put(WEIGHED, Value::Int(10 * cx.scene.objects().len() as i64 + bulbs.sum::<i64>()))
    }
}

fn with_weigher() -> Registry {
    let own = registry();
    let kinds = own.entries().iter().cloned().chain([Entry::of::<Weigher>("weigher", "0.0.0")]);
    Registry::new(kinds).expect("no clash")
}

#[test]
fn products_of_writers_must_agree() {
    let registry = with_weigher();
    let load = |annotators: &str| {
        let text = mixed(4, &format!("[write.lines]\ninclude = [\"thought\"]\n{annotators}"));
        syntable_recipe::load(&registry, Source::embedded("t", text), &Overrides::of_process(Vec::new()))
    };
    let [one, two] = ["one", "two"].map(|id| format!("[mixture.{id}.annotate.weigher]\n"));
    let thinker = "[mixture.two.annotate.thinker]\n";
    let report = load(&format!("{one}{thinker}")).err().expect("refused").to_string();
    let want = "write.lines reads `thought`, which `one` and `two` provide with different types, meanings or units";
    assert!(report.contains(want) && report.contains("[write.lines]"), "{report}");
    load(&format!("{one}{two}")).unwrap_or_else(|report| panic!("{report}"));
}

#[test]
fn previews_of_a_mixture_are_the_views_of_its_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let [one, two] = ["one", "two"].map(|id| format!("[mixture.{id}.annotate.weigher]\n"));
    let text = mixed(SCENES, &format!("[write.lines]\ninclude = [\"thought\"]\n{one}{two}"));
    let overrides = || Overrides { wanted: vec![Input::of(WEIGHED)], ..Overrides::of_process(Vec::new()) };
    let load = |text: &str| {
        let loaded = syntable_recipe::load(&with_weigher(), Source::embedded("t", text), &overrides());
        loaded.unwrap_or_else(|report| panic!("{report}")).0
    };
    let mut previewer = Previewer::new(1, DiskCache::new(folder.path().join("cache"))).expect("threads");
    let wanted = Wanted { products: vec!["thought".into()], width: 4, allow_code: false };
    let (stop, log) = (Stop::default(), Warnings(&Quiet));
    let mut keys = Vec::new();
    for (number, nits) in [7, 8].into_iter().enumerate() {
        let text = text.replace("nits = 7", &format!("nits = {nits}"));
        let out = folder.path().join(number.to_string());
        syntable_runtime::run::run(&load(&text), &options(&out, 2), &Quiet).expect("made");
        previewer.set(load(&text)).expect("sound");
        let mut pass = previewer.pass(&wanted, &Quiet, &log, &stop).expect("pools");
        let mut seen = BTreeMap::new();
        for scene in 0..SCENES {
            let each = &mut |view: u32, products: &Products, _| {
                seen.insert((scene, view), products.get(WEIGHED).expect("wanted").clone());
            };
            pass.scene(scene, &[0, 1], each).expect("made");
        }
        keys.push((0..SCENES).map(|scene| pass.key(scene, 0)).collect::<Vec<_>>());
        assert_eq!(seen.len(), 2 * SCENES as usize);
        let ids: BTreeMap<u32, String> =
            journal(&out).into_iter().map(|(scene, entry)| (scene, entry.component)).collect();
        for ((scene, view), found) in seen {
            let want = if ids[&scene] == "one" { 10 } else { 20 + nits };
            assert_eq!(found, Value::Int(want), "scene {scene}, view {view}");
            let path = out.join(format!("lines/{scene:06}_{view:04}.json"));
            let text = std::fs::read_to_string(&path).expect("of the run");
            assert!(text.contains(&format!("{want}")), "{}: {text}", path.display());
        }
        // Only the images of the edited component are made again.
        if let [before, after] = keys.as_slice() {
            assert!(
                ids.iter().all(|(&scene, id)| { (before[scene as usize] == after[scene as usize]) == (id == "one") })
            );
        }
    }
}
