//! One dataset of 24 scenes, made in all ways that the book names: equal bytes, and a table of times.

use crate::jobs::Cluster;
use crate::support::bucket::{Bucket, url};
use crate::support::{SMALL, assert_same, made, small_run, syntable, text};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

const SCENES: [&str; 2] = ["--set", "dataset.scenes=24"];

/// A dataset that one run made, and the times of the other ways.
struct Ways {
    folder: tempfile::TempDir,
    whole: PathBuf,
    rows: Vec<(String, f64)>,
}

impl Ways {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let whole = folder.path().join("whole");
        let start = Instant::now();
        made(&mut small_run(&whole, &SCENES));
        let rows = vec![("one run".to_owned(), start.elapsed().as_secs_f64())];
        Self { folder, whole, rows }
    }

    /// Makes the dataset in a way, and compares it with the dataset of one run.
    fn add(&mut self, way: &str, make: impl FnOnce(&Path)) {
        let out = self.folder.path().join(way.replace(' ', "-"));
        let start = Instant::now();
        make(&out);
        self.rows.push((way.to_owned(), start.elapsed().as_secs_f64()));
        assert_same(&self.whole, &out);
    }
}

fn start(mut command: Command) -> Child {
    command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("starts")
}

fn succeeds(worker: Child) {
    let output = worker.wait_with_output().expect("waits");
    assert!(output.status.success(), "{}", text(&output));
}

fn signal(worker: &Child, name: &str) {
    made(Command::new("kill").args([name, &worker.id().to_string()]));
}

/// Three workers claim scenes. One is killed, and one stands still for longer than its lease.
fn claims(run: &dyn Fn() -> Command, has_scenes: &dyn Fn() -> bool) {
    let worker = || {
        let mut command = run();
        command.args(["--claim", "1", "--lease", "2", "--threads", "1"]);
        start(command)
    };
    let [mut killed, slow, third] = [worker(), worker(), worker()];
    let begun = Instant::now();
    while !has_scenes() {
        assert!(begun.elapsed() < Duration::from_secs(60), "no worker made a scene");
        thread::sleep(Duration::from_millis(20));
    }
    killed.kill().expect("it works");
    let _ = killed.wait();
    signal(&slow, "-STOP");
    thread::sleep(Duration::from_secs(3));
    signal(&slow, "-CONT");
    [slow, third].into_iter().for_each(succeeds);
}

#[test]
#[ignore = "a table of times, for a quiet machine"]
fn all_ways_to_one_dataset() {
    let mut ways = Ways::new();
    ways.add("3 shards merged", |out| {
        for number in 0..3 {
            made(&mut small_run(out, &[&SCENES[..], &["--shard", &format!("{number}/3")]].concat()));
        }
        made(syntable().arg("merge").arg(out).arg(out.with_extension("shards")));
    });
    ways.add("3 workers", |out| {
        let lines = || fs::read_dir(out.join(".syntable/journal")).map_or(0, |lines| lines.flatten().count());
        claims(&|| small_run(out, &SCENES), &|| lines() > 2);
    });
    let bucket = Bucket::start();
    ways.add("a bucket", |out| {
        made(&mut bucket.run("one", &SCENES));
        made(bucket.syntable(&["merge"]).arg(out).arg(url("one")));
    });
    ways.add("3 workers in a bucket with faults", |out| {
        bucket.disturb(5, 150);
        let lines =
            || fs::read_dir(bucket.stored("shared/.syntable/journal")).map_or(0, |lines| lines.flatten().count());
        claims(&|| bucket.run("shared", &SCENES), &|| lines() > 2);
        bucket.disturb(0, 0);
        made(bucket.syntable(&["merge"]).arg(out).arg(url("shared")));
    });
    println!("faults in the bucket: {:?}", bucket.faults());
    if Cluster::is_installed() {
        let folder = ways.folder.path().join("slurm");
        fs::create_dir(&folder).expect("writable");
        fs::copy(ways.whole.join("recipe.toml"), folder.join("recipe.toml")).expect("there");
        let cluster = Cluster::start(&folder);
        ways.add("a Slurm array of 3, one task killed", |out| cluster.array(out, 3));
    }
    if let Some(python) = std::env::var_os("SYNTABLE_RAY_PYTHON") {
        let mut settings: Vec<String> =
            SMALL.iter().chain(&SCENES).filter(|it| **it != "--set").map(|it| (*it).to_owned()).collect();
        settings.insert(0, "recipes/quickstart.toml".to_owned());
        ways.add("Ray on 3 nodes, one removed", |out| {
            let mut command = Command::new(python);
            command
                .current_dir(crate::support::root())
                .arg("-c")
                .arg(include_str!("support/ray_run.py"))
                .arg(out)
                .args(&settings);
            made(&mut command);
        });
    }
    println!("| way | s |\n|---|---|");
    ways.rows.iter().for_each(|(way, seconds)| println!("| {way} | {seconds:.1} |"));
}
