//! Datasets in memory, and stores that fail or are killed at any call: the resulting bytes are the same.

use crate::kit::{registry, run, run_with};
use std::collections::BTreeMap;
use std::io::{self, ErrorKind, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;
use syntable_model::store::{Access, Fill, Found, Hold, Kind, MemStore, Store, StoreFolder, StoredFile};
use syntable_runtime::cache::DiskCache;
use syntable_runtime::run::progress::Quiet;
use syntable_runtime::run::{MergeOptions, RunOptions, merge, verify};
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

/// Fault at a call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fault {
    /// The call fails and changes nothing, and the next calls work.
    Once,
    /// The call works but fails, because its answer is lost, and the next calls work.
    Unheard,
    /// The program is killed during the call: the call does a part of its work, and no later call reaches the store.
    Kill,
}

/// A store in memory with a fault at one call.
#[derive(Debug)]
struct FaultStore {
    inner: Arc<MemStore>,
    /// The call with the fault, from 0.
    at: u32,
    fault: Fault,
    calls: AtomicU32,
    killed: Arc<AtomicBool>,
}

/// Outcome of a call.
enum Turn {
    Works,
    /// The call works, and fails.
    Unheard(Error),
    /// The call does a part of its work, and fails.
    Torn(Error),
}

impl FaultStore {
    fn new(inner: Arc<MemStore>, at: u32, fault: Fault) -> Self {
        Self { inner, at, fault, calls: AtomicU32::new(0), killed: Arc::default() }
    }

    fn error() -> io::Error {
        ErrorKind::StorageFull.into()
    }

    fn turn(&self, path: &str) -> Result<Turn> {
        let error = || Error::io(self.inner.name_of(path), &Self::error());
        if self.killed.load(Ordering::SeqCst) {
            return Err(error());
        }
        match self.fault {
            _ if self.calls.fetch_add(1, Ordering::SeqCst) != self.at => Ok(Turn::Works),
            Fault::Once => Err(error()),
            Fault::Unheard => Ok(Turn::Unheard(error())),
            Fault::Kill => {
                self.killed.store(true, Ordering::SeqCst);
                Ok(Turn::Torn(error()))
            }
        }
    }

    /// A call that may be killed before or after its work, but not during it.
    fn whole<T>(&self, path: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
        match self.turn(path)? {
            Turn::Works => work(),
            Turn::Unheard(error) => work().and(Err(error)),
            Turn::Torn(error) => Err(error),
        }
    }

    /// The first half of the files in a folder.
    fn half(&self, folder: &DatasetPath) -> Vec<DatasetPath> {
        let prefix = format!("{folder}/");
        let all: Vec<DatasetPath> = self.inner.files().into_keys().filter(|path| path.starts_with(&prefix)).collect();
        all[..all.len().div_ceil(2)].to_vec()
    }
}

impl Store for FaultStore {
    fn name_of(&self, path: &str) -> PathBuf {
        self.inner.name_of(path)
    }

    fn is_remote(&self) -> bool {
        self.inner.is_remote()
    }

    fn prepare(&self) -> Result<()> {
        self.whole("", || self.inner.prepare())
    }

    fn look(&self, path: &str) -> Result<Option<Found>> {
        self.whole(path, || self.inner.look(path))
    }

    fn list(&self, folder: &str) -> Result<Vec<(String, Kind)>> {
        self.whole(folder, || self.inner.list(folder))
    }

    fn open(&self, path: &DatasetPath) -> Result<Option<StoredFile>> {
        self.whole(path, || self.inner.open(path))
    }

    fn create(&self, path: &DatasetPath) -> Result<Option<Box<dyn Write + Send>>> {
        self.whole(path, || {
            let created = self.inner.create(path)?;
            Ok(created.map(|file| Box::new(Killable { file, killed: Arc::clone(&self.killed) }) as _))
        })
    }

    fn put(&self, path: &DatasetPath, fill: &mut Fill) -> Result<()> {
        self.whole(path, || self.inner.put(path, fill))
    }

    fn put_new(&self, path: &DatasetPath, bytes: &[u8]) -> Result<bool> {
        self.whole(path, || self.inner.put_new(path, bytes))
    }

    fn append(&self, path: &DatasetPath, bytes: &[u8]) -> Result<()> {
        match self.turn(path)? {
            Turn::Works => self.inner.append(path, bytes),
            // The contract allows no other.
            Turn::Unheard(error) => Err(error),
            Turn::Torn(error) => self.inner.append(path, &bytes[..bytes.len() / 2]).and(Err(error)),
        }
    }

    fn sync(&self, path: &DatasetPath) -> Result<()> {
        self.whole(path, || self.inner.sync(path))
    }

    fn share(&self, _: &dyn Store, path: &DatasetPath, to: &DatasetPath) -> Result<bool> {
        self.whole(to, || self.inner.share(&*self.inner, path, to))
    }

    fn rename(&self, from: &DatasetPath, to: &DatasetPath) -> Result<()> {
        match self.turn(to)? {
            Turn::Works => self.inner.rename(from, to),
            Turn::Unheard(error) => self.inner.rename(from, to).and(Err(error)),
            Turn::Torn(error) => {
                for path in self.half(from) {
                    let inside = DatasetPath::new(&path[from.len() + 1..]).expect("a part of a path");
                    self.inner.rename(&path, &to.join(&inside))?;
                }
                Err(error)
            }
        }
    }

    fn remove(&self, path: &DatasetPath) -> Result<()> {
        self.whole(path, || self.inner.remove(path))
    }

    fn remove_all(&self, path: &DatasetPath) -> Result<()> {
        match self.turn(path)? {
            Turn::Works => self.inner.remove_all(path),
            Turn::Unheard(error) => self.inner.remove_all(path).and(Err(error)),
            Turn::Torn(error) => {
                self.half(path).iter().try_for_each(|path| self.inner.remove(path))?;
                Err(error)
            }
        }
    }

    fn lock(&self, path: &DatasetPath, access: Access) -> Result<Option<Hold>> {
        self.whole(path, || self.inner.lock(path, access))
    }
}

/// A file that a killed program no longer writes.
struct Killable {
    file: Box<dyn Write + Send>,
    killed: Arc<AtomicBool>,
}

impl Write for Killable {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.killed.load(Ordering::SeqCst) { Err(FaultStore::error()) } else { self.file.write(bytes) }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
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
    let counted = Arc::new(FaultStore::new(Arc::clone(&whole), u32::MAX, Fault::Once));
    command(Arc::clone(&counted).into()).expect(what);
    let (whole, calls) = (files_of(&whole), counted.calls.load(Ordering::SeqCst));
    assert!(calls > 50 && !verify(store_of(&whole, kind), 1).expect("a dataset").unfinished, "{what}: {calls} calls");
    let every = std::env::var("STORE_FAULT_EVERY").map_or(EVERY, |every| every.parse().expect("a number"));
    let mut failed = 0;
    for (fault, offset) in [(Fault::Once, 0), (Fault::Unheard, every / 4), (Fault::Kill, every / 2)] {
        for at in (0..calls).filter(|at| at % every == offset) {
            let case = format!("{what}: {fault:?} at call {at} of {calls}");
            let store = store_of(before, kind);
            failed += u32::from(command(Arc::new(FaultStore::new(Arc::clone(&store), at, fault)).into()).is_err());
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
    before.remove(".syntable/scenes/000000.json").expect("there");
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
