//! Datasets in memory, and stores that fail or are killed at any call: the resulting bytes are the same.

use crate::kit::{registry, run, run_with};
use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::error::Result;
use syntable_model::files::DatasetPath;
use syntable_model::store::{Access, MemStore, StoreFolder};
use syntable_runtime::cache::DiskCache;
use syntable_runtime::run::progress::Quiet;
use syntable_runtime::run::{MergeOptions, RunOptions, merge, verify};
use syntable_testing::fault_store::{Fault, FaultStore};
use syntable_testing::folder::{files, files_of_store as files_of};

type Files = BTreeMap<String, Vec<u8>>;

/// Two writers with shards, a file of the end, and a product of the dataset. On one thread the calls have a fixed
/// order.
fn recipe(scenes: u32, include: &str) -> String {
    format!(
        "[dataset]\nscenes = {scenes}\nviews_per_scene = 1\nname = \"stored\"\n\
         [[place]]\nkind = \"boxes\"\n[render]\nkind = \"drowsy\"\n\
         [write.lines]\ninclude = [{include}]\n\
         [write.more]\nkind = \"lines\"\ninclude = [\"thought\", \"total\"]\n"
    )
}

fn options(out: impl Into<StoreFolder>) -> RunOptions {
    RunOptions::new(out, 1, DiskCache::none())
}

/// The kinds of stores in memory: one in which scenes are staged, and one to which they are uploaded.
const KINDS: [fn() -> MemStore; 2] = [MemStore::default, MemStore::remote];

fn store_of(files: &Files, kind: fn() -> MemStore) -> Arc<MemStore> {
    let store = kind();
    files
        .iter()
        .for_each(|(path, bytes)| store.insert(DatasetPath::new(path.as_str()).expect("a path"), bytes.clone()));
    Arc::new(store)
}

#[track_caller]
fn assert_same(left: &Files, right: &Files, what: &str) {
    assert_eq!(left.keys().collect::<Vec<_>>(), right.keys().collect::<Vec<_>>(), "{what}");
    for (name, bytes) in left {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        assert!(*bytes == right[name], "{what}: {name}:\n{}\n{}", text(bytes), text(&right[name]));
    }
}

#[test]
fn a_run_into_memory_gives_the_files_of_a_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let (small, whole) = (recipe(3, "\"light\""), recipe(3, "\"light\", \"track\""));
    run(&small, &at("small"), 2).expect("on disk");
    run(&whole, &at("whole"), 2).expect("on disk");
    let in_memory = |store: &Arc<MemStore>, text: &str, change: fn(&mut RunOptions)| {
        let mut options = options(Arc::clone(store));
        change(&mut options);
        run_with(text, options, &Quiet)
    };
    let store = Arc::new(MemStore::default());
    in_memory(&store, &small, |options| options.scenes = Some(0..2)).expect("a part");
    in_memory(&store, &small, |_| ()).expect("the rest");
    assert_same(&files_of(&store), &files(&at("small")), "a run that went on");
    // Another recipe is refused, or with flags rewrites or overwrites the dataset.
    let error = in_memory(&store, &whole, |_| ()).expect_err("another recipe").to_string();
    assert!(error.contains("memory:/") && error.contains("options.rewrite"), "{error}");
    in_memory(&store, &whole, |options| options.rewrite = true).expect("rewritten");
    assert_same(&files_of(&store), &files(&at("whole")), "rewritten");
    in_memory(&store, &small, |options| options.overwrite = true).expect("overwritten");
    assert_same(&files_of(&store), &files(&at("small")), "overwritten");
    // Damage is found, named and repaired.
    store.insert(DatasetPath::new("lines/000001_0000.json").expect("a path"), b"{}".to_vec());
    store.insert(DatasetPath::new("notes.txt").expect("a path"), b"mine".to_vec());
    let found = verify(Arc::clone(&store), 2).expect("a dataset");
    assert_eq!(
        (&found.damaged[..], &found.foreign[..]),
        (&["lines/000001_0000.json".to_owned()][..], &["notes.txt".to_owned()][..])
    );
    in_memory(&store, &small, |options| options.repair = true).expect("repaired");
    assert!(verify(Arc::clone(&store), 1).expect("a dataset").whole());
    // Two runs at once are refused.
    let held =
        StoreFolder::from(Arc::clone(&store)).lock(&DatasetPath::new(".syntable/lock").expect("a path"), Access::Write);
    let error = in_memory(&store, &small, |_| ()).expect_err("locked").to_string();
    assert!(error.contains("another run is writing this dataset"), "{error}");
    drop(held);
}

#[test]
fn parts_of_any_store_are_merged_into_any_other() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = recipe(3, "\"light\"");
    let (whole, on_disk) = (folder.path().join("whole"), folder.path().join("part"));
    run(&text, &whole, 1).expect("whole");
    run_with(&text, RunOptions { scenes: Some(0..2), ..options(&on_disk) }, &Quiet).expect("a part");
    let store = Arc::new(MemStore::default());
    let within = |name: &str| StoreFolder::from(Arc::clone(&store)).inner(&DatasetPath::new(name).expect("a path"));
    run_with(&text, RunOptions { scenes: Some(2..3), ..options(within("part")) }, &Quiet).expect("a part");
    let parts = [StoreFolder::from(&on_disk), within("part")];
    let merge = |out: StoreFolder| merge(&registry(), out, &parts, &MergeOptions::new(1), &Quiet);
    merge(within("whole")).expect("into memory");
    let merged: Files = files_of(&store)
        .into_iter()
        .filter_map(|(path, bytes)| Some((path.strip_prefix("whole/")?.to_owned(), bytes)))
        .collect();
    assert_same(&merged, &files(&whole), "into memory");
    merge(folder.path().join("merged").into()).expect("onto the disk");
    assert_same(&files(&folder.path().join("merged")), &files(&whole), "onto the disk");
    for (out, says) in [("part/x", "overlap"), ("part", "both the output and a part")] {
        let error = merge(within(out)).expect_err("refused").to_string();
        assert!(error.contains(says) && error.contains("memory:/part"), "{error}");
    }
    merge(within("part-2")).expect("beside the part");
}

/// Tries one of this many calls. `STORE_FAULT_EVERY=1` tries all, which takes 15 seconds.
const EVERY: u32 = 7;

/// Makes a command fail, and kills it, at calls to a store that starts with the files `before`. The same command then
/// completes the work, with the same bytes as an undisturbed command.
fn everywhere(what: &str, before: &Files, command: &dyn Fn(StoreFolder) -> Result<()>) {
    KINDS.into_iter().for_each(|kind| everywhere_in(kind, what, before, command));
}

fn everywhere_in(kind: fn() -> MemStore, what: &str, before: &Files, command: &dyn Fn(StoreFolder) -> Result<()>) {
    let whole = store_of(before, kind);
    let counted = Arc::new(FaultStore::new(Arc::clone(&whole), |_| None));
    command(Arc::clone(&counted).into()).expect(what);
    let (whole, calls) = (files_of(&whole), counted.calls());
    assert!(calls > 50 && !verify(store_of(&whole, kind), 1).expect("a dataset").unfinished, "{what}: {calls} calls");
    let every = std::env::var("STORE_FAULT_EVERY").map_or(EVERY, |every| every.parse().expect("a number"));
    let mut failed = 0;
    for (fault, offset) in [(Fault::Once, 0), (Fault::Unheard, every / 4), (Fault::Kill, every / 2)] {
        for at in (0..calls).filter(|at| at % every == offset) {
            let case = format!("{what}: {fault:?} at call {at} of {calls}");
            let store = store_of(before, kind);
            failed += u32::from(
                command(
                    Arc::new(FaultStore::new(Arc::clone(&store), move |call| (call == at).then_some(fault))).into(),
                )
                .is_err(),
            );
            // A scene in the journal is intact after any fault.
            let is_dataset = store.get(".syntable/journal.jsonl").is_some();
            if is_dataset && store.files().keys().all(|path| !path.starts_with(".syntable/staging/")) {
                let found = verify(Arc::clone(&store), 1).unwrap_or_else(|error| panic!("{case}: {error}"));
                assert!(found.bad_scenes.is_empty() || !before.is_empty(), "{case}: {found:?}");
            }
            command(Arc::clone(&store).into()).unwrap_or_else(|error| panic!("{case}: {error}"));
            assert_same(&files_of(&store), &whole, &case);
        }
    }
    println!("{what}: {calls} calls, {failed} commands failed");
    assert!(failed > calls / every, "{what}: {failed} commands failed");
}

fn made(text: &str) -> Files {
    let store = Arc::new(MemStore::default());
    run_with(text, options(Arc::clone(&store)), &Quiet).expect("made");
    files_of(&store)
}

fn command(text: &str, change: fn(&mut RunOptions)) -> impl Fn(StoreFolder) -> Result<()> {
    move |out| {
        let mut options = options(out);
        change(&mut options);
        run_with(text, options, &Quiet).map(drop)
    }
}

#[test]
fn a_new_dataset_survives_any_fault() {
    everywhere("run", &Files::new(), &command(&recipe(2, "\"light\""), |_| ()));
}

#[test]
fn a_dataset_that_grows_survives_any_fault() {
    let text = recipe(2, "\"light\"") + "[write.last]\nkind = \"lines\"\ninclude = [\"light\"]\n";
    everywhere("grow", &made(&recipe(1, "\"light\"")), &command(&text, |_| ()));
}

#[test]
fn a_dataset_that_is_rewritten_survives_any_fault() {
    let text = recipe(2, "\"track\"");
    everywhere("rewrite", &made(&recipe(2, "\"light\"")), &command(&text, |options| options.rewrite = true));
}

#[test]
fn a_dataset_that_is_overwritten_survives_any_fault() {
    let text = recipe(2, "\"light\"").replace("\"stored\"", "\"other\"");
    everywhere("overwrite", &made(&recipe(1, "\"light\"")), &command(&text, |options| options.overwrite = true));
}

#[test]
fn a_dataset_that_is_repaired_survives_any_fault() {
    let text = recipe(2, "\"light\"");
    let mut before = made(&text);
    before.remove("lines/000001_0000.json").expect("there");
    before.remove(".syntable/scenes/000/000000.json").expect("there");
    *before.get_mut("recipe.toml").expect("there") = b"[dataset\n".to_vec();
    everywhere("repair", &before, &command(&text, |options| options.repair = true));
}

#[test]
fn a_dataset_that_is_merged_survives_any_fault() {
    let text = recipe(2, "\"light\"");
    let part = |scene: u32| {
        let store = Arc::new(MemStore::default());
        let options = RunOptions { scenes: Some(scene..scene + 1), ..options(Arc::clone(&store)) };
        run_with(&text, options, &Quiet).expect("a part");
        store
    };
    let parts = [part(0), part(1)];
    everywhere("merge", &Files::new(), &|out| merge(&registry(), out, &parts, &MergeOptions::new(1), &Quiet).map(drop));
}
