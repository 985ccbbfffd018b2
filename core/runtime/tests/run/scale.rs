//! Datasets of many scenes, whose files are copies of one scene's. Not tests: they print times and memory.

use crate::kit::{AtEvent, options, run_with};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicU32;
use std::time::Instant;
use syntable_model::digest::Digest;
use syntable_runtime::run::RunOptions;
use syntable_runtime::run::progress::Quiet;
use syntable_runtime::run::stop::Stop;
use syntable_testing::folder::files;

fn recipe(scenes: u32) -> String {
    format!(
        "[dataset]\nscenes = {scenes}\nviews_per_scene = 1\nname = \"many\"\n[[place]]\nkind = \"boxes\"\n\
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

/// Makes a dataset of `scenes` scenes in which each has the files of the first one, with its own number.
fn simulate(root: &Path, scenes: u32) {
    run_with(&recipe(1), options(root, 1), &Quiet).expect("made");
    let own = root.join(".syntable");
    let template = |path: &str| fs::read_to_string(root.join(path)).expect("there");
    let paths: Vec<String> = files(root).into_keys().filter(|path| path.contains("000000")).collect();
    let manifest = paths.iter().find(|path| path.starts_with(".syntable/scenes/")).expect("a manifest");
    let journal = template(".syntable/journal.jsonl");
    let before = digest(&template(manifest)).to_string();
    let mut lines = journal.clone();
    for scene in 1..scenes {
        let folder = format!("{:03}/{scene:06}", scene / 1000);
        let of_scene = |text: &str| text.replace("000/000000", &folder).replace("000000", &format!("{scene:06}"));
        if scene % 1000 == 0 {
            for path in &paths {
                fs::create_dir_all(root.join(of_scene(path)).parent().expect("a folder")).expect("made");
            }
        }
        let mut text = of_scene(&template(manifest));
        for path in paths.iter().filter(|path| *path != manifest) {
            let to = root.join(of_scene(path));
            let content = template(path);
            fs::write(&to, &content).expect("written");
        }
        text = text.replace("\"scene\":0", &format!("\"scene\":{scene}"));
        fs::write(root.join(of_scene(manifest)), &text).expect("written");
        let line = journal.replace("\"scene\":0", &format!("\"scene\":{scene}"));
        let _ = write!(lines, "{}", line.replace(&before, &digest(&text).to_string()));
    }
    fs::write(own.join("journal.jsonl"), lines).expect("written");
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
fn a_dataset_of_many_scenes() {
    let scenes = number("SCENES", 20_000);
    let folder = tempfile::tempdir().expect("a folder");
    let root = folder.path().join("data");
    measure("simulate", || simulate(&root, scenes));
    println!("journal: {} bytes", fs::metadata(root.join(".syntable/journal.jsonl")).expect("there").len());
    let run = |scenes: u32| run_with(&recipe(scenes), options(&root, 2), &Quiet).expect("it runs");
    measure("the first end", || run(scenes));
    measure("nothing to do", || run(scenes));
    measure("one scene more", || run(scenes + 1));
}
