//! Datasets of many scenes, whose files are copies of one scene's. Not tests: they print times and memory.

use crate::kit::{AtEvent, options, registry, run_with};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicU32;
use std::time::Instant;
use syntable_model::digest::Digest;
use syntable_model::store::StoreFolder;
use syntable_runtime::run::progress::Quiet;
use syntable_runtime::run::stop::Stop;
use syntable_runtime::run::{ClaimOptions, MergeOptions, RunOptions, merge};
use syntable_testing::folder::files;

fn recipe(scenes: u32) -> String {
    recipe_of(scenes, 1)
}

fn recipe_of(scenes: u32, views: u32) -> String {
    format!(
        "[dataset]\nscenes = {scenes}\nviews_per_scene = {views}\nname = \"many\"\n[[place]]\nkind = \"boxes\"\n\
         [render]\nkind = \"sleeper\"\n[annotate.thinker]\n[write.lines]\ninclude = [\"thought\"]\n"
    )
}

/// Peak memory of this process since the last call, MB.
fn peak_mb() -> u64 {
    let status = fs::read_to_string("/proc/self/status").expect("Linux");
    let line = status.lines().find(|line| line.starts_with("VmHWM")).expect("a peak");
    let kb: u64 = line.split_whitespace().nth(1).and_then(|kb| kb.parse().ok()).expect("a number");
    fs::write("/proc/self/clear_refs", "5").expect("writable");
    kb / 1000
}

fn measure<T>(what: &str, act: impl FnOnce() -> T) -> T {
    peak_mb();
    let start = Instant::now();
    let done = act();
    println!("{what}: {:.2} s, {} MB at most", start.elapsed().as_secs_f64(), peak_mb());
    done
}

fn digest(text: &str) -> Digest {
    Digest::of_reader(text.as_bytes()).expect("memory").0
}

/// Makes a dataset of some scenes of a recipe. Each has the files of the first one, with its own number, and a shard of
/// some bytes.
fn simulate(root: &Path, recipe: &str, scenes: impl Iterator<Item = u32>, shard_bytes: usize) {
    let mut scenes = scenes.peekable();
    let first = *scenes.peek().expect("a scene");
    run_with(recipe, RunOptions { scenes: Some(first..first + 1), ..options(root, 1) }, &Quiet).expect("made");
    let number = |scene: u32| format!("{scene:06}");
    let read = |path: &str| fs::read_to_string(root.join(path)).expect("there");
    let mut contents: BTreeMap<String, String> = files(root)
        .into_keys()
        .filter(|path| path.contains(&number(first)))
        .map(|path| (path.clone(), read(&path)))
        .collect();
    let is_manifest = |path: &str| path.starts_with(".syntable/scenes/");
    let manifest = contents.keys().find(|path| is_manifest(path)).expect("a manifest").clone();
    let shard = contents.keys().find(|path| path.starts_with(".syntable/shards/")).expect("a shard").clone();
    let stamp = |text: &str| format!("[{},\"{}\"]", text.len(), digest(text));
    let mut listing = contents.remove(&manifest).expect("there");
    let line = read(".syntable/journal.jsonl");
    let before = digest(&listing).to_string();
    let text = "a shard\n".repeat(shard_bytes / 8);
    listing = listing.replace(&stamp(&contents[&shard]), &stamp(&text));
    contents.insert(shard, text);
    let mut lines = String::new();
    let mut folder = u32::MAX;
    for scene in scenes {
        let [from, to] = [first, scene].map(|scene| format!("{:03}/{scene:06}", scene / 1000));
        let of_scene = |text: &str| text.replace(&from, &to).replace(&number(first), &number(scene));
        let write = |path: &str, text: &str| {
            let path = root.join(of_scene(path));
            if scene / 1000 != folder {
                fs::create_dir_all(path.parent().expect("a folder")).expect("made");
            }
            fs::write(path, text).expect("written");
        };
        contents.iter().for_each(|(path, text)| write(path, text));
        let listing = of_scene(&listing);
        write(&manifest, &listing);
        folder = scene / 1000;
        let line = line.replace(&format!("\"scene\":{first}"), &format!("\"scene\":{scene}"));
        lines += &line.replace(&before, &digest(&listing).to_string());
    }
    fs::write(root.join(".syntable/journal.jsonl"), lines).expect("written");
}

/// Makes a dataset with the journal of `scenes` scenes, all finished, and the files of the first one.
fn simulate_journal(root: &Path, scenes: u32) {
    run_with(&recipe(scenes), RunOptions { scenes: Some(0..1), ..options(root, 1) }, &Quiet).expect("made");
    let path = root.join(".syntable/journal.jsonl");
    let line = fs::read_to_string(&path).expect("there");
    let assets = (0..2000).map(|number| format!("\"objects/asset-{number}\":\"{}\"", digest(&number.to_string())));
    let mut lines = format!("{{\"assets\":{{{}}}}}\n", assets.collect::<Vec<_>>().join(","));
    for scene in 0..scenes {
        // The manifests differ, and a tenth of the scenes have remarks of their own.
        let line = line.replace("\"scene\":0", &format!("\"scene\":{scene}"));
        let (start, _) = line.rsplit_once("\"manifest\"").expect("a manifest");
        let remark = if scene % 10 == 0 { format!(",\"choices\":{{\"lights[0]\":[{scene}]}}") } else { String::new() };
        let _ = writeln!(lines, "{start}\"manifest\":\"{}\"{remark}}}", digest(&scene.to_string()));
    }
    fs::write(&path, &lines).expect("written");
    let finished = root.join(".syntable/finished.json");
    let text = fs::read_to_string(&finished).expect("there");
    fs::write(finished, text.replace(&digest(&line).to_string(), &digest(&lines).to_string())).expect("written");
}

fn number(name: &str, default: u32) -> u32 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

#[test]
#[ignore = "measures: cargo test --release -p syntable-runtime --test run scale -- --ignored --nocapture"]
fn a_journal_of_a_million_scenes() {
    let scenes = number("SCENES", 1_000_000);
    let folder = tempfile::tempdir().expect("a folder");
    let root = folder.path().join("data");
    simulate_journal(&root, scenes);
    println!("journal: {} bytes", fs::metadata(root.join(".syntable/journal.jsonl")).expect("there").len());
    let outcome = measure("nothing to do", || run_with(&recipe(scenes), options(&root, 2), &Quiet).expect("finished"));
    assert_eq!(outcome.scenes, scenes);
    let status = measure("status", || syntable_runtime::run::status(&[root.as_path().into()]).expect("readable"));
    assert_eq!(status.total.done, scenes);
    measure("the first of ten more scenes", || {
        let stop = Stop::default();
        let at_first = AtEvent { number: 1, act: &|| stop.cancel(), seen: AtomicU32::new(0) };
        let options = RunOptions { stop: stop.clone(), ..options(&root, 2) };
        run_with(&recipe(scenes + 10), options, &at_first).expect_err("stopped");
    });
}

#[test]
#[ignore = "measures: cargo test --release -p syntable-runtime --test run scale -- --ignored --nocapture"]
fn a_million_scenes_to_make() {
    let scenes = number("SCENES", 1_000_000);
    let folder = tempfile::tempdir().expect("a folder");
    for (name, claim) in [("one run", None), ("a worker", Some(ClaimOptions::default()))] {
        measure(&format!("{name}: the first scene"), || {
            let stop = Stop::default();
            let at_first = AtEvent { number: 1, act: &|| stop.cancel(), seen: AtomicU32::new(0) };
            let options = RunOptions { stop: stop.clone(), claim, ..options(&folder.path().join(name), 2) };
            run_with(&recipe(scenes), options, &at_first).expect_err("stopped");
        });
    }
}

#[test]
#[ignore = "measures: cargo test --release -p syntable-runtime --test run scale -- --ignored --nocapture"]
fn a_dataset_of_many_scenes() {
    let scenes = number("SCENES", 20_000);
    let folder = tempfile::tempdir().expect("a folder");
    let root = folder.path().join("data");
    measure("simulate", || simulate(&root, &recipe(scenes), 0..scenes, 40));
    println!("journal: {} bytes", fs::metadata(root.join(".syntable/journal.jsonl")).expect("there").len());
    let run = |scenes: u32| run_with(&recipe(scenes), options(&root, 2), &Quiet).expect("it runs");
    measure("the first end", || run(scenes));
    measure("nothing to do", || run(scenes));
    measure("one scene more", || run(scenes + 1));
}

#[test]
#[ignore = "measures: cargo test --release -p syntable-runtime --test run scale -- --ignored --nocapture"]
fn a_merge_of_many_images() {
    let images = number("IMAGES", 50_000);
    let (views, scenes) = (50, images / 50);
    let folder = tempfile::tempdir().expect("a folder");
    let parts: Vec<StoreFolder> = (0..3)
        .map(|part| {
            let root = folder.path().join(format!("part-{part}"));
            // 200 bytes for each of 15 objects of a view.
            simulate(&root, &recipe_of(scenes, views), (part..scenes).step_by(3), 200 * 15 * views as usize);
            root.as_path().into()
        })
        .collect();
    for threads in [1, 2] {
        let out = folder.path().join(format!("merged-{threads}"));
        let merged = measure(&format!("merge {images} images with {threads} threads"), || {
            merge(&registry(), &*out, &parts, &MergeOptions::new(threads), &Quiet).expect("merged")
        });
        assert_eq!(merged.images, images);
    }
}
