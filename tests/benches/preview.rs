//! Time from a save to the updated images: `syntable preview --watch` on recipes whose camera or seed changes with
//! every save.
//!
//! `cargo bench -p syntable-tests --bench preview [-- RECIPE …]`. Prints the median, the smallest and the largest time
//! from a save to the first image in the sheet, and to the last one.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};
use syntable_program as _;
use syntable_testing::figures::{Figures, Unit};

/// Number of saves of each kind.
const SAVES: usize = 11;

fn main() {
    let named: Vec<PathBuf> = std::env::args().skip(1).filter(|it| !it.starts_with('-')).map(PathBuf::from).collect();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let recipes = if named.is_empty() { vec![root.join("recipes/quickstart.toml")] } else { named };
    println!("{:<24} {:<22} {:>30} {:>30}", "recipe", "what is saved", "first image, s", "last image, s");
    let mut figures = Figures::new(env!("CARGO_PKG_NAME"), env!("CARGO_CRATE_NAME"));
    for recipe in recipes {
        let recipe = recipe.canonicalize().unwrap_or_else(|error| panic!("{}: {error}", recipe.display()));
        measure(&mut figures, &recipe);
    }
}

/// An edit of the recipe: its name, and the text that it adds for a number.
type Edit = (&'static str, fn(usize) -> String);

const EDITS: [Edit; 3] = [
    ("nothing that is seen", |save| format!("max_attempts = {}", 3 + save % 2)),
    ("the views", |save| {
        format!("\n[views]\nkind = \"hemisphere_shell\"\nradius = {{ of_table = [0.7, {}] }}", 0.9 + 0.01 * save as f64)
    }),
    ("the seed", |save| format!("seed = {}", 100 + save)),
];

fn measure(figures: &mut Figures, recipe: &Path) {
    let folder = std::env::temp_dir().join(format!("syntable-preview-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("writable");
    let (file, sheet) = (folder.join("recipe.toml"), folder.join("sheet.png"));
    let text = |edit: &str| format!("extends = {recipe:?}\n\n[dataset]\nscenes = 2\n{edit}\n");
    fs::write(&file, text("")).expect("writable");
    let mut child = Command::new(env!("CARGO_BIN_EXE_syntable-under-test"))
        .args(["preview", "--watch", "--log-format", "json", "--out"])
        .args([&sheet, &file])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("starts");
    let errors = BufReader::new(child.stderr.take().expect("a pipe"));
    let (sender, events) = channel();
    std::thread::spawn(move || {
        for line in errors.lines().map_while(Result::ok) {
            let event: serde_json::Value = serde_json::from_str(&line).unwrap_or_default();
            if event["event"] == "message" {
                eprintln!("{line}");
            }
            let _ = sender.send((Instant::now(), event));
        }
    });
    finished(&events, Instant::now());
    for (name, edit) in EDITS {
        let mut times: [Vec<f64>; 2] = Default::default();
        for save in 0..SAVES {
            let (next, start) = (folder.join("next"), Instant::now());
            fs::write(&next, text(&edit(save))).and_then(|()| fs::rename(next, &file)).expect("writable");
            let [first, last] = finished(&events, start);
            times[0].extend(first);
            times[1].extend(last);
        }
        let recipe = recipe.file_stem().unwrap_or_default().to_string_lossy();
        times.iter_mut().for_each(|times| times.sort_by(f64::total_cmp));
        for (what, times) in ["first", "last"].iter().zip(&times) {
            if let Some(median) = times.get(times.len() / 2) {
                figures.keep(&format!("{recipe}, {name}, {what} image"), *median, Unit::Seconds);
            }
        }
        let [first, last] = times.map(summary);
        println!("{recipe:<24} {name:<22} {first:>30} {last:>30}");
    }
    child.kill().and_then(|()| child.wait().map(drop)).expect("ends");
    fs::remove_dir_all(folder).expect("removable");
}

/// Waits until a pass has ended. Returns the seconds from the start to its first image, if any, and to its end.
fn finished(events: &Receiver<(Instant, serde_json::Value)>, start: Instant) -> [Option<f64>; 2] {
    let mut first = None;
    loop {
        let (at, event) = events.recv_timeout(Duration::from_secs(600)).expect("the preview goes on");
        let seconds = at.duration_since(start).as_secs_f64();
        if event["event"] == "image" {
            first.get_or_insert(seconds);
        }
        if event["event"] == "note" && event["message"].as_str().is_some_and(|text| text.contains(" made in ")) {
            return [first, Some(seconds)];
        }
    }
}

fn summary(times: Vec<f64>) -> String {
    match times.as_slice() {
        [] => "none".to_owned(),
        [least, ..] => {
            format!("{:.2} ({least:.2} to {:.2})", times[times.len() / 2], times[times.len() - 1])
        }
    }
}
