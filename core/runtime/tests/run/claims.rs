//! Several workers that make one dataset: the bytes of one run, whatever happens to the workers and the store.

use crate::kit::{run, run_with};
use std::collections::BTreeMap;
use std::fs;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::{Duration, Instant};
use syntable_model::error::Error;
use syntable_model::files::DatasetPath;
use syntable_model::random::Stream;
use syntable_model::store::{MemStore, StoreFolder};
use syntable_runtime::cache::DiskCache;
use syntable_runtime::run::progress::{Event, Quiet, Reporter};
use syntable_runtime::run::stop::Stop;
use syntable_runtime::run::{ClaimOptions, RunOptions, status, verify};
use syntable_testing::fault_store::{Fault, FaultStore};
use syntable_testing::folder::{files, files_of_store as files_of};

type Files = BTreeMap<String, Vec<u8>>;

const LEASE: Duration = Duration::from_millis(300);

fn recipe(scenes: u32) -> String {
    format!(
        "[dataset]\nscenes = {scenes}\nviews_per_scene = 2\nname = \"shared\"\n\
         [[place]]\nkind = \"boxes\"\nsleep_ms = 2\n[render]\nkind = \"drowsy\"\n\
         [write.lines]\ninclude = [\"light\"]\n\
         [write.more]\nkind = \"lines\"\ninclude = [\"thought\", \"total\"]\n"
    )
}

fn options(out: impl Into<StoreFolder>, block: u32) -> RunOptions {
    let claim = Some(ClaimOptions { block, lease: LEASE });
    RunOptions { claim, ..RunOptions::new(out, 2, DiskCache::none()) }
}

/// Runs workers at the same time until all have ended.
fn work(text: &str, outs: Vec<StoreFolder>, block: u32) -> Vec<Result<u32, Error>> {
    thread::scope(|threads| {
        let start = |out: StoreFolder| threads.spawn(move || run_with(text, options(out, block), &Quiet));
        let workers: Vec<_> = outs.into_iter().map(start).collect();
        workers.into_iter().map(|worker| worker.join().expect("no panic").map(|outcome| outcome.scenes)).collect()
    })
}

/// The files without the working times, which depend on the workers.
fn without_times(mut files: Files) -> Files {
    files.retain(|path, _| path != ".syntable/times.jsonl");
    files
}

#[track_caller]
fn assert_same(left: Files, right: Files, what: &str) {
    let (left, right) = (without_times(left), without_times(right));
    assert_eq!(left.keys().collect::<Vec<_>>(), right.keys().collect::<Vec<_>>(), "{what}");
    let differs = left.iter().find(|(name, bytes)| **bytes != right[*name]);
    assert!(differs.is_none(), "{what}: {}", differs.expect("there").0);
}

#[test]
fn workers_give_the_dataset_of_one_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = folder.path().join("whole");
    run(&recipe(7), &whole, 1).expect("one run");
    let whole = files(&whole);
    for (workers, block) in [(1, 1), (3, 1), (3, 2), (2, 100)] {
        let out = folder.path().join(format!("{workers}-{block}"));
        let made = work(&recipe(7), vec![StoreFolder::from(&out); workers], block);
        assert!(made.iter().all(|made| *made == Ok(7)), "{made:?}");
        assert_same(files(&out), whole.clone(), "in a folder");
        for store in [MemStore::default(), MemStore::remote()].map(Arc::new) {
            let made = work(&recipe(7), vec![Arc::clone(&store).into(); workers], block);
            assert!(made.iter().all(|made| *made == Ok(7)), "{made:?}");
            assert_same(files_of(&store), whole.clone(), "in memory");
        }
    }
    // More workers continue a dataset, and a larger recipe grows it.
    let out = folder.path().join("grows");
    let first = RunOptions { scenes: Some(0..2), ..options(&out, 1) };
    run_with(&recipe(4), first, &Quiet).expect("two scenes");
    let made = work(&recipe(7), vec![StoreFolder::from(&out); 8], 1);
    assert!(made.iter().all(|made| *made == Ok(7)), "{made:?}");
    assert_same(files(&out), whole, "grown");
}

/// Workers make the same scenes at the same moments, because their claims differ or vanish. Each writes the same bytes, and
/// none disturbs another.
#[test]
fn claims_only_spare_work() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = recipe(10);
    run(&text, &folder.path().join("whole"), 1).expect("one run");
    let whole = files(&folder.path().join("whole"));
    for round in 0..6 {
        let out = folder.path().join(round.to_string());
        let store = Arc::new(MemStore::remote());
        let at: StoreFolder = if round % 3 == 2 { Arc::clone(&store).into() } else { (&out).into() };
        let claims = out.join(".syntable/claims");
        let made = thread::scope(|threads| {
            let start = |block: u32| {
                let (text, options) = (&text, options(at.clone(), block));
                threads.spawn(move || run_with(text, options, &Quiet).map(|outcome| outcome.scenes))
            };
            let workers: Vec<_> = [1, 5, 2, 1].map(start).into();
            while round % 3 == 0 && workers.iter().any(|worker| !worker.is_finished()) {
                let names = fs::read_dir(&claims).into_iter().flatten().flatten().map(|entry| entry.path());
                names
                    .filter(|path| path.extension().is_some_and(|it| it == "json"))
                    .for_each(|path| drop(fs::remove_file(path)));
                thread::sleep(Duration::from_millis(3));
            }
            workers.into_iter().map(|worker| worker.join().expect("no panic")).collect::<Vec<_>>()
        });
        assert!(made.iter().all(|made| *made == Ok(10)), "round {round}: {made:?}");
        let made = if round % 3 == 2 { files_of(&store) } else { files(&out) };
        assert_same(made, whole.clone(), &format!("round {round}"));
    }
}

#[test]
fn a_lost_or_slow_worker_costs_its_block() {
    let folder = tempfile::tempdir().expect("a folder");
    run(&recipe(12), &folder.path().join("whole"), 1).expect("one run");
    let whole = files(&folder.path().join("whole"));
    let store = Arc::new(MemStore::remote());
    let at = |plan: fn(u32) -> Option<Fault>| Arc::new(FaultStore::new(Arc::clone(&store), plan));
    let lost = at(|call| (call == 150).then_some(Fault::Kill));
    let slow = at(|call| (call % 20 == 19).then_some(Fault::Slow(LEASE)));
    let outs = vec![Arc::clone(&store).into(), Arc::clone(&lost).into(), Arc::clone(&slow).into()];
    let made = work(&recipe(12), outs, 2);
    assert!(lost.is_killed() && made[1].is_err() && made[0] == Ok(12) && made[2] == Ok(12), "{made:?}");
    assert_same(files_of(&store), whole, "the dataset");
}

#[test]
fn workers_exclude_runs_and_other_recipes() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("data");
    for change in [
        (|options: &mut RunOptions| options.overwrite = true) as fn(&mut RunOptions),
        |options| options.repair = true,
        |options| options.claim = Some(ClaimOptions { block: 0, lease: LEASE }),
    ] {
        let mut options = options(&out, 1);
        change(&mut options);
        let error = run_with(&recipe(2), options, &Quiet).expect_err("refused").to_string();
        assert!(error.contains("claim") && !out.exists(), "{error}");
    }
    // A worker holds the dataset until its scenes are made.
    let slow = recipe(4).replace("sleep_ms = 2", "sleep_ms = 400");
    thread::scope(|threads| {
        let worker = threads.spawn(|| run_with(&slow, options(&out, 1), &Quiet));
        let end = Instant::now() + Duration::from_secs(20);
        while !out.join(".syntable/claims").exists() && Instant::now() < end {
            thread::sleep(Duration::from_millis(5));
        }
        let error = run(&slow, &out, 1).expect_err("shared").to_string();
        assert!(error.contains("another run"), "{error}");
        let error = verify(&out, 1).expect_err("shared").to_string();
        assert!(error.contains("another run"), "{error}");
        let state = &status(&[StoreFolder::from(&out)]).expect("a dataset").datasets[0];
        assert!(state.running && !state.finished);
        let other = slow.replace("\"light\"", "\"track\"");
        let error = run_with(&other, options(&out, 1), &Quiet).expect_err("another recipe").to_string();
        assert!(error.contains("options.rewrite"), "{error}");
        assert_eq!(worker.join().expect("no panic").map(|outcome| outcome.scenes), Ok(4));
    });
    let state = &status(&[StoreFolder::from(&out)]).expect("a dataset").datasets[0];
    assert!(!state.running && state.finished && verify(&out, 1).expect("a dataset").whole());
    assert!(!out.join(".syntable/claims").exists() && !out.join(".syntable/journal").exists());
    assert!(
        fs::read_dir(out.join(".syntable")).expect("there").all(|entry| entry.expect("there").file_name() != "staging")
    );
}

/// Counts the scenes that a worker makes, and stops it after some of them.
struct Counting {
    made: AtomicU32,
    stop: Option<(u32, Stop)>,
}

impl Reporter for Counting {
    fn event(&self, event: &Event) {
        if matches!(event, Event::Scene { .. }) {
            let made = self.made.fetch_add(1, Ordering::Relaxed) + 1;
            self.stop.iter().filter(|(after, _)| made == *after).for_each(|(_, stop)| stop.cancel());
        }
    }
}

#[test]
fn a_worker_that_is_stopped_counts_the_scenes_of_all() {
    let folder = tempfile::tempdir().expect("a folder");
    for out in [StoreFolder::from(folder.path().join("data")), Arc::new(MemStore::remote()).into()] {
        run_with(&recipe(20), RunOptions { scenes: Some(0..5), ..options(out.clone(), 1) }, &Quiet).expect("five");
        let options = options(out.clone(), 1);
        let worker = Counting { made: AtomicU32::new(0), stop: Some((2, options.stop.clone())) };
        let error = run_with(&recipe(20), options, &worker).expect_err("stopped").to_string();
        let done = status(std::slice::from_ref(&out)).expect("a dataset").total.done;
        assert!((7..20).contains(&done), "{done}");
        let says = format!("stopped by its caller: all workers together have done {done} of 20 scenes (the same");
        assert!(error.contains(&says), "{error}");
    }
}

/// All files of a dataset are deleted under a worker.
#[test]
fn a_worker_names_a_dataset_that_vanished() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = recipe(200).replace("sleep_ms = 2", "sleep_ms = 50");
    for out in [StoreFolder::from(folder.path().join("data")), Arc::new(MemStore::remote()).into()] {
        let worker = Counting { made: AtomicU32::new(0), stop: None };
        let error = thread::scope(|threads| {
            let works = threads.spawn(|| run_with(&text, options(out.clone(), 1), &worker));
            while !works.is_finished() && !out.has(".syntable/journal").expect("readable") {
                thread::sleep(Duration::from_millis(5));
            }
            out.remove_all(&DatasetPath::new("recipe.toml").expect("a path")).expect("removable");
            // The worker may write a file meanwhile.
            let _ = out.remove_all(&DatasetPath::new(".syntable").expect("a path"));
            works.join().expect("no panic").expect_err("vanished").to_string()
        });
        assert!(error.contains("the dataset vanished") && error.contains("another program deleted"), "{error}");
        assert!(worker.made.into_inner() < 150, "it made the other scenes");
    }
}

/// Number of rounds of random faults. `CLAIM_ROUNDS=200` takes three minutes.
const ROUNDS: u64 = 10;

/// Three workers on a store. Any call may fail, work without an answer, be slow, or be the last one of a worker.
#[test]
fn no_fault_makes_journals_disagree_or_loses_a_scene() {
    let folder = tempfile::tempdir().expect("a folder");
    run(&recipe(6), &folder.path().join("whole"), 1).expect("one run");
    let whole = files(&folder.path().join("whole"));
    let rounds = std::env::var("CLAIM_ROUNDS").map_or(ROUNDS, |rounds| rounds.parse().expect("a number"));
    let (mut failed, mut killed) = (0, 0);
    for round in 0..rounds {
        let store = Arc::new(if round % 3 == 0 { MemStore::default() } else { MemStore::remote() });
        let mut lines: Files = Files::new();
        // Workers that end are started again, as a scheduler does, at first with faults.
        for attempt in 0_u64.. {
            let plan = move |worker: u64| {
                move |call: u32| {
                    let mut stream = Stream::root(round).at(worker).at(attempt).at(u64::from(call));
                    match stream.below(600) {
                        _ if attempt > 3 => None,
                        0 | 1 => Some(Fault::Once),
                        2 | 3 => Some(Fault::Unheard),
                        4 => Some(Fault::Kill),
                        5 => Some(Fault::Slow(LEASE * 3 / 2)),
                        _ => None,
                    }
                }
            };
            let stores: Vec<_> =
                (0..3).map(|worker| Arc::new(FaultStore::new(Arc::clone(&store), plan(worker)))).collect();
            let made =
                work(&recipe(6), stores.iter().map(|store| Arc::clone(store).into()).collect(), 1 + round as u32 % 2);
            failed += made.iter().filter(|made| made.is_err()).count();
            killed += stores.iter().filter(|store| store.is_killed()).count();
            // A line that was written stays, and says the same.
            let now = lines_of(&store);
            for (scene, line) in &lines {
                assert_eq!(now.get(scene), Some(line), "round {round}, attempt {attempt}, scene {scene}");
            }
            lines = now;
            if made.iter().all(|made| *made == Ok(6)) {
                break;
            }
            assert!(attempt < 10, "round {round}: {made:?}");
        }
        assert_same(files_of(&store), whole.clone(), &format!("round {round}"));
        assert!(verify(Arc::clone(&store), 1).expect("a dataset").whole());
    }
    println!("{rounds} rounds: {failed} workers failed, of which {killed} were killed");
    assert!(failed as u64 > rounds && killed as u64 > rounds / 4);
}

/// The journal lines of scenes that were made, by scene.
fn lines_of(store: &MemStore) -> Files {
    let joined = store.get(".syntable/journal.jsonl").map(|bytes| bytes.to_vec()).unwrap_or_default();
    let own = store.files().into_iter().filter(|(path, _)| path.starts_with(".syntable/journal/"));
    let own = own.filter(|(path, _)| DatasetPath::new(path.as_str()).is_ok()).map(|(_, bytes)| bytes.to_vec());
    let text = [joined].into_iter().chain(own).flat_map(|bytes| {
        String::from_utf8(bytes).map(|text| text.lines().map(str::to_owned).collect::<Vec<_>>()).unwrap_or_default()
    });
    text.filter(|line| line.contains("\"made\""))
        .map(|line| (line.split(',').next().unwrap_or_default().to_owned(), line.into_bytes()))
        .collect()
}
