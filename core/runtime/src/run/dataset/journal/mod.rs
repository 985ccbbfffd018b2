//! The journal of a dataset: one line per finished scene. A scene without a line does not exist.
//!
//! A run appends lines to `journal.jsonl`. In an object store, which cannot append, or if several workers make the dataset,
//! each line is a file of its own, which is written once. A run joins these files into `journal.jsonl` when it has written many, at its end, and when it
//! opens the journal. Until it has removed them, they equal the joined lines.

mod entries;
mod entry;
mod line_files;
mod notice;

pub use entries::{AssetDigests, Entries, JournalLine, SceneLine};
pub use entry::{JournalEntry, SceneOutcome};
pub use line_files::LineFiles;
pub use notice::Notice;

use crate::run::dataset::foreign;
use crate::run::dataset::layout;
use crate::run::dataset::manifest::Stamp;
use crate::run::dataset::requests;
use entries::EntriesBuilder;
use line_files::JOINED;
use std::collections::{BTreeSet, VecDeque};
use std::io::{self, BufRead, BufReader, ErrorKind, Read};
use syntable_model::digest::Digest;
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;
use syntable_model::limits::RUN_LIST_BYTES;
use syntable_model::store::{StoreFolder, StoredFile};
use syntable_model::words::SHOWN;

/// The readable lines of a journal that a run may be writing.
pub struct LatestLines {
    /// The finished scenes.
    pub entries: Entries,
    /// The last scenes, in the order of the file.
    pub order: Vec<u32>,
    /// Descriptions of unreadable lines.
    pub faults: Vec<String>,
}

/// The journal. A run appends lines to it.
pub struct Journal {
    dataset: StoreFolder,
    entries: Entries,
    /// Number of lines that are files of their own.
    loose: usize,
    /// Other workers write lines, too.
    is_shared: bool,
}

/// Minimum number of lines in files of their own before they are joined. Later joins wait for a quarter of all lines, so
/// a line is written a few times only.
const LOOSE: usize = 1000;
/// Own lines of a worker after which it looks for lines to join.
const LOOKS: usize = 250;
/// Files with lines that are read at once.
const BATCH: usize = 256;
/// Attempts to write a line while other workers join lines.
const TRIES: u32 = 5;

impl Journal {
    /// Opens the journal of a dataset, or starts one. A truncated last line is ignored.
    pub fn open(dataset: impl Into<StoreFolder>) -> Result<Self> {
        let dataset = dataset.into();
        let path = layout::journal();
        let (entries, whole) = Self::read(&dataset)?;
        let mut journal = Self { dataset, entries, loose: 0, is_shared: false };
        if !LineFiles::of(&journal.dataset)?.is_empty() {
            journal.rewrite()?;
            return Ok(journal);
        }
        let dataset = &journal.dataset;
        match dataset.look(&path)? {
            None => dataset.append(&path, &[])?,
            Some(there) if whole < there.size => cut(dataset, whole)?,
            Some(_) => {}
        }
        Ok(journal)
    }

    /// Opens the journal of a dataset that several workers make. It has the lines of this moment.
    pub fn open_shared(dataset: impl Into<StoreFolder>) -> Result<Self> {
        let dataset = dataset.into();
        let (entries, _) = Self::read(&dataset)?;
        Ok(Self { dataset, entries, loose: 0, is_shared: true })
    }

    /// Whether the line of a scene is in a file of its own, or in a file of its thousand.
    pub fn has_file_of(dataset: &StoreFolder, scene: u32) -> Result<bool> {
        Ok(dataset.has(&layout::line(scene))? || dataset.has(&layout::lines_of_thousand(scene / JOINED))?)
    }

    /// Reads the lines of a journal, without changing it.
    pub fn entries_of(dataset: impl Into<StoreFolder>) -> Result<Entries> {
        Self::read(&dataset.into()).map(|(entries, _)| entries)
    }

    /// Reads the lines of a journal. Returns the entries, and the size of the complete lines, bytes.
    fn read(dataset: &StoreFolder) -> Result<(Entries, u64)> {
        let mut entries = EntriesBuilder::default();
        let whole = each_line(dataset, |place, line| {
            entries.add(line).map_err(|error| {
                Error::new(format!("not a journal line: {error}"))
                    .in_file(dataset.name_of(&place.file))
                    .at_line(place.line)
                    .help(
                        "a run of the dataset's recipe with `options.repair` makes the scene of a damaged line again; if \
                         another version began the dataset, choose another folder with `options.out`, or delete this one",
                    )
            })?;
            Ok(())
        })?;
        Ok((entries.build(), whole))
    }

    /// Reads the readable lines of a journal, and describes the others: the first [`SHOWN`], and the number of the
    /// rest.
    pub fn readable(dataset: impl Into<StoreFolder>) -> Result<(Entries, Vec<String>)> {
        Self::readable_lines(&dataset.into(), |_| ())
    }

    fn readable_lines(dataset: &StoreFolder, mut each: impl FnMut(u32)) -> Result<(Entries, Vec<String>)> {
        let (mut entries, mut faults, mut more) = (EntriesBuilder::default(), Vec::new(), 0_u64);
        each_line(dataset, |place, line| {
            match entries.add(line) {
                Ok(scene) => scene.into_iter().for_each(&mut each),
                Err(error) if faults.len() < SHOWN => {
                    let line = match place.file == layout::journal() {
                        true => format!("line {}", place.line),
                        false => format!("`{}`", place.file),
                    };
                    faults.push(format!("{line} is not a journal line: {error}"));
                }
                Err(_) => more += 1,
            }
            Ok(())
        })?;
        if more > 0 {
            faults.push(format!("{more} more lines are not journal lines"));
        }
        Ok((entries.build(), faults))
    }

    /// The readable lines, with the order of the last `most` of them.
    pub fn latest(dataset: &StoreFolder, most: usize) -> Result<LatestLines> {
        let mut order = VecDeque::new();
        let (entries, faults) = Self::readable_lines(dataset, |scene| {
            order.push_back(scene);
            if order.len() > most {
                order.pop_front();
            }
        })?;
        Ok(LatestLines { entries, order: order.into(), faults })
    }

    /// Removes unreadable lines, and returns their number.
    pub fn mend(dataset: &StoreFolder) -> Result<usize> {
        let (mut entries, mut bad) = (EntriesBuilder::default(), 0);
        each_line(dataset, |_, line| {
            bad += usize::from(entries.add(line).is_err());
            Ok(())
        })?;
        if bad > 0 {
            write(dataset, &entries.build())?;
        }
        Ok(bad)
    }

    /// The finished scenes, ascending.
    pub fn entries(&self) -> &Entries {
        &self.entries
    }

    /// Whether the journal of a dataset has this digest, and no line in a file of its own.
    pub fn has_digest(dataset: &StoreFolder, digest: Digest) -> Result<bool> {
        let path = layout::journal();
        Ok(LineFiles::of(dataset)?.is_empty() && dataset.has(&path)? && Stamp::of(dataset, &path)?.1 == digest)
    }

    /// Appends a line, and syncs it. Digests of assets that the journal has are not written again.
    ///
    /// # Errors
    /// If it cannot be written, or another worker has made the scene with another result.
    pub fn append(&mut self, entry: JournalEntry) -> Result<()> {
        let entry = JournalEntry { assets: self.entries.unknown(&entry.assets), ..entry };
        if self.dataset.is_remote() || self.is_shared {
            return self.put_line(entry);
        }
        self.dataset.append(&layout::journal(), line_of(&entry).as_bytes())?;
        self.entries.insert(&entry);
        Ok(())
    }

    /// Adds digests of assets of scenes that the journal will get.
    pub fn add_assets(&mut self, assets: &AssetDigests) -> Result<()> {
        let assets = self.entries.unknown(assets);
        self.entries.add_assets(&assets);
        // Where each line is a file, the next joined journal has them.
        if assets.is_empty() || self.dataset.is_remote() || self.is_shared {
            return Ok(());
        }
        self.dataset.append(&layout::journal(), json_line(&JournalLine::Assets { assets }).as_bytes())
    }

    /// Writes a line as a file of its own. If another worker has written the line of the scene, its result must be the
    /// same. A worker may fail to make a scene for a reason of its machine: the line of a scene that was made stays, or
    /// replaces the line of a failure.
    fn put_line(&mut self, entry: JournalEntry) -> Result<()> {
        let (path, line) = (layout::line(entry.scene), line_of(&entry));
        if self.entries.contains(entry.scene) {
            self.dataset.write(&path, line.as_bytes())?;
        } else if let Some(present) = self.write_line(&path, line.as_bytes())? {
            match serde_json::from_slice::<JournalEntry>(&present) {
                Ok(present) if is_same(&present, &entry) => {}
                Ok(present) if present.failed() && !entry.failed() => self.dataset.write(&path, line.as_bytes())?,
                Ok(present) if entry.failed() => {
                    self.entries.insert(&present);
                    return Ok(());
                }
                _ => return Err(self.differs(entry.scene, &path)),
            }
        } else if self.is_shared {
            self.compare_joined(&entry, &path)?;
        }
        self.loose += 1;
        self.entries.insert(&entry);
        match self.is_shared {
            true if self.loose.is_multiple_of(LOOKS) => LineFiles::of(&self.dataset)?.join(&self.dataset),
            false if self.loose > LOOSE.max(self.entries.len() / 4) => self.rewrite(),
            _ => Ok(()),
        }
    }

    /// Writes a new line. Returns the line of another worker instead, if it exists.
    fn write_line(&self, path: &DatasetPath, line: &[u8]) -> Result<Option<Vec<u8>>> {
        for _ in 0..TRIES {
            if self.dataset.write_new(path, line)? {
                return Ok(None);
            }
            if let Some(present) = self.dataset.read(path)? {
                return Ok(Some(present));
            }
            // Another worker has just joined that line. The new one is compared with it after it is written.
        }
        Err(vanished(&self.dataset, path))
    }

    /// Compares a new line with the line of the same scene that another worker wrote earlier, if that one is joined
    /// already. If they are equal, the earlier one stays alone.
    fn compare_joined(&self, entry: &JournalEntry, path: &DatasetPath) -> Result<()> {
        let joined = layout::lines_of_thousand(entry.scene / JOINED);
        let Some(lines) = foreign::read_list(&self.dataset, &joined)? else { return Ok(()) };
        let lines = lines.split(|byte| *byte == b'\n').filter_map(|line| serde_json::from_slice(line).ok());
        let present: Option<JournalEntry> = lines.into_iter().find(|line: &JournalEntry| line.scene == entry.scene);
        match present {
            Some(present) if present.failed() && !entry.failed() => Ok(()),
            Some(present) => {
                self.dataset.remove(path)?;
                if is_same(&present, entry) || entry.failed() {
                    Ok(())
                } else {
                    Err(self.differs(entry.scene, &joined))
                }
            }
            None => Ok(()),
        }
    }

    fn differs(&self, scene: u32, path: &DatasetPath) -> Error {
        Error::new(format!("another worker has made scene {scene} with another result"))
            .in_file(self.dataset.name_of(path))
            .help(
                "the machine, the device or the program differs; a run with `options.repair` and without other workers \
                 makes the scene again",
            )
    }

    /// Removes the line of a scene, atomically.
    pub fn forget(&mut self, scene: u32) -> Result<()> {
        if self.entries.remove(scene) { self.rewrite() } else { Ok(()) }
    }

    /// Removes failed scenes, so that they are tried again. Takes effect on disk when the file is written.
    pub fn forget_failed(&mut self) {
        self.entries.remove_failed();
    }

    /// Removes writers from the lines of all scenes, atomically.
    pub fn forget_writers(&mut self, writers: &BTreeSet<String>) -> Result<()> {
        if writers.is_empty() {
            return Ok(());
        }
        let has = |line: SceneLine| line.writers().iter().any(|id| writers.contains(id));
        self.entries.change(has, |entry| entry.without(writers));
        self.rewrite()
    }

    /// Rewrites the file in scene order, atomically, so that it does not depend on the order in which scenes ended.
    pub fn rewrite(&mut self) -> Result<()> {
        write(&self.dataset, &self.entries)?;
        self.loose = 0;
        Ok(())
    }
}

/// Writes a journal in scene order, atomically. Lines in files of their own are part of it. A line of all assets comes
/// first.
fn write(dataset: &StoreFolder, entries: &Entries) -> Result<()> {
    let path = layout::journal();
    dataset.put(&path, &mut |file| {
        let mut write =
            |line: &str| file.write_all(line.as_bytes()).map_err(|error| Error::io(dataset.name_of(&path), &error));
        let assets = entries.assets();
        if !assets.is_empty() {
            write(&json_line(&JournalLine::Assets { assets: assets.clone() }))?;
        }
        entries.iter().try_for_each(|line| write(&line_of(&line.entry())))
    })?;
    dataset.remove_all(&layout::lines())
}

/// The line of an entry, with its line end.
fn line_of(entry: &JournalEntry) -> String {
    json_line(entry)
}

fn json_line(line: &impl serde::Serialize) -> String {
    serde_json::to_string(line).expect("a line is plain data") + "\n"
}

/// Whether two workers have made the same scene. A worker writes only digests of assets that are new to it.
fn is_same(one: &JournalEntry, other: &JournalEntry) -> bool {
    let agree = one.assets.iter().all(|(name, digest)| other.assets.get(name).is_none_or(|theirs| theirs == digest));
    agree && JournalEntry { assets: other.assets.clone(), ..one.clone() } == *other
}

/// The error of a file that a store names and does not have.
fn vanished(dataset: &StoreFolder, path: &DatasetPath) -> Error {
    let error = io::Error::new(ErrorKind::StaleNetworkFileHandle, "the store lists this file, and does not find it");
    Error::io(dataset.name_of(path), &error).help(
        "the list of a folder on a network drive may be a minute old: run the same command again then; if it fails again, \
         check the drive",
    )
}

/// Removes a truncated last line.
fn cut(dataset: &StoreFolder, whole: u64) -> Result<()> {
    let path = layout::journal();
    let opened = dataset.open(&path)?;
    let mut lines = opened.map(|opened| opened.take(whole));
    dataset.put(&path, &mut |file| {
        let copied = lines.as_mut().map_or(Ok(0), |lines| std::io::copy(lines, file));
        copied.map(drop).map_err(|error| Error::io(dataset.name_of(&path), &error))
    })
}

/// The lines of a journal, as bytes, a few in memory at a time.
pub struct JournalLines {
    dataset: StoreFolder,
    place: Place,
    /// The joined lines. `None` after their end, or if the journal does not exist.
    file: Option<BufReader<StoredFile>>,
    /// The files with lines that follow.
    rest: VecDeque<DatasetPath>,
    /// The first lines of these files, read already.
    read: VecDeque<(Place, Vec<u8>)>,
    /// Files that a list named and that did not exist.
    missing: BTreeSet<DatasetPath>,
    line: Vec<u8>,
}

/// The place of a line.
#[derive(Debug, Clone)]
struct Place {
    file: DatasetPath,
    /// Number in the file, from 1.
    line: usize,
}

impl JournalLines {
    /// Opens the journal of a dataset. A missing journal has no lines.
    pub fn open(dataset: &StoreFolder) -> Result<Self> {
        let file = layout::journal();
        let rest = LineFiles::of(dataset)?.paths().collect();
        let opened = dataset.open(&file)?.map(BufReader::new);
        let (dataset, place) = (dataset.clone(), Place { file, line: 0 });
        let (read, missing) = (VecDeque::new(), BTreeSet::new());
        Ok(Self { dataset, place, file: opened, rest, read, missing, line: Vec::new() })
    }

    /// The next line with its line end, which a truncated last line lacks. Refuses a line longer than
    /// [`RUN_LIST_BYTES`].
    pub fn next_line(&mut self) -> Result<Option<&[u8]>> {
        Ok(if self.advance()? { Some(&self.line) } else { None })
    }

    /// Reads the next line. Returns `false` after the last one.
    fn advance(&mut self) -> Result<bool> {
        loop {
            if let Some(file) = &mut self.file {
                self.line.clear();
                self.place.line += 1;
                let name = || self.dataset.name_of(&self.place.file);
                let read = file.take(RUN_LIST_BYTES.most + 1).read_until(b'\n', &mut self.line);
                let read = read.map_err(|error| Error::io(name(), &error))?;
                RUN_LIST_BYTES.check(read as u64).map_err(|error| error.in_file(name()).at_line(self.place.line))?;
                if read > 0 {
                    return Ok(true);
                }
                self.file = None;
            }
            if let Some((place, line)) = self.read.pop_front() {
                (self.place, self.line) = (place, line);
                return Ok(true);
            }
            if self.rest.is_empty() {
                return Ok(false);
            }
            self.read_files()?;
        }
    }

    /// Reads the next files with lines. If a worker has joined some since they were listed, the journal starts again.
    ///
    /// # Errors
    /// If a file cannot be read, or two lists name it and it does not exist.
    fn read_files(&mut self) -> Result<()> {
        let paths: Vec<DatasetPath> = self.rest.drain(..BATCH.min(self.rest.len())).collect();
        let read = requests::read(&self.dataset, &paths, &RUN_LIST_BYTES)?;
        let mut is_joined = false;
        for (file, bytes) in paths.into_iter().zip(read) {
            if let Some(bytes) = bytes {
                let lines = bytes.split_inclusive(|byte| *byte == b'\n').zip(1..);
                self.read.extend(lines.map(|(text, line)| (Place { file: file.clone(), line }, text.to_owned())));
                continue;
            }
            is_joined = true;
            if !self.missing.insert(file.clone()) {
                return Err(vanished(&self.dataset, &file));
            }
        }
        if is_joined {
            // All files that follow, and the joined lines, are read once more.
            self.rest = LineFiles::of(&self.dataset)?.paths().collect();
            self.place = Place { file: layout::journal(), line: 0 };
            self.file = self.dataset.open(&self.place.file)?.map(BufReader::new);
        }
        Ok(())
    }
}

/// Calls `each` with every complete line of a journal and its place. Returns the size of the complete joined lines,
/// bytes.
fn each_line(dataset: &StoreFolder, mut each: impl FnMut(&Place, &[u8]) -> Result<()>) -> Result<u64> {
    let (mut lines, mut whole) = (JournalLines::open(dataset)?, 0);
    while lines.advance()? {
        if lines.line.ends_with(b"\n") {
            whole += if lines.place.file == layout::journal() { lines.line.len() as u64 } else { 0 };
            each(&lines.place, &lines.line)?;
        }
    }
    Ok(whole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::dataset::ending::Finished;
    use crate::run::dataset::manifest::Manifest;
    use crate::run::dataset::records::{OWNER, Records};
    use crate::run::dataset::scene_files::SceneFiles;
    use crate::run::making::times::RunTimes;
    use std::fs;
    use std::path::Path;
    use std::sync::Arc;
    use syntable_model::scene::SceneId;
    use syntable_model::store::{MemStore, Store as _};
    use syntable_testing::fault_store::FaultStore;

    /// A dataset in memory, and the bytes of its journal.
    fn dataset() -> (StoreFolder, Arc<MemStore>) {
        let store = Arc::new(MemStore::default());
        (Arc::clone(&store).into(), store)
    }

    fn bytes(store: &MemStore) -> Vec<u8> {
        store.get(&layout::journal()).expect("there").to_vec()
    }

    fn set(store: &MemStore, bytes: &[u8]) {
        store.insert(layout::journal(), bytes.to_vec());
    }

    /// The digest that is these letters, often enough.
    fn digest(letters: &str) -> Digest {
        Digest::try_from(letters.repeat(16)).expect("32 letters")
    }

    fn entry(scene: u32) -> JournalEntry {
        let (writers, manifest) = (vec!["png".to_owned()], digest("00"));
        let outcome = SceneOutcome::Made { views: 2, objects: 3, writers, recorded: Vec::new(), manifest };
        JournalEntry::new(scene, 0, outcome)
    }

    #[test]
    fn a_line_states_the_outcome() {
        let made = r#"{"scene":4,"attempt":0,"outcome":"made","views":2,"objects":3,"writers":["png"],"manifest":"00000000000000000000000000000000"}"#;
        let failed = r#"{"scene":5,"attempt":2,"outcome":"failed","errors":["a","b","c"]}"#;
        let errors = ["a", "b", "c"].map(str::to_owned).to_vec();
        let failure = JournalEntry { attempt: 2, outcome: SceneOutcome::Failed, errors, ..entry(5) };
        for (line, entry, views) in [(made, entry(4), 2), (failed, failure, 0)] {
            assert_eq!(serde_json::to_string(&entry).expect("plain data"), line);
            assert_eq!(serde_json::from_str::<JournalEntry>(line).expect("reads back"), entry);
            assert_eq!((entry.views(), entry.failed()), (views, views == 0));
        }
    }

    #[test]
    fn a_cut_line_counts_as_not_written() {
        let (dataset, store) = dataset();
        let mut journal = Journal::open(&dataset).expect("new");
        journal.append(entry(4)).expect("written");
        journal.append(entry(1)).expect("written");
        drop(journal);
        let whole = bytes(&store);
        for cut in 0..whole.len() {
            set(&store, &whole[..cut]);
            let mut journal = Journal::open(&dataset).expect("readable");
            let lines = whole[..cut].iter().filter(|&&byte| byte == b'\n').count();
            assert_eq!(journal.entries().len(), lines, "cut at {cut}");
            journal.append(entry(7)).expect("written");
            assert_eq!(Journal::open(&dataset).expect("readable").entries().len(), lines + 1);
        }
    }

    #[test]
    fn the_rewritten_file_does_not_tell_the_order() {
        let write = |order: [u32; 3]| {
            let (dataset, store) = dataset();
            let mut journal = Journal::open(dataset).expect("new");
            order.into_iter().for_each(|scene| journal.append(entry(scene)).expect("written"));
            journal.rewrite().expect("written");
            journal.append(entry(9)).expect("goes on");
            bytes(&store)
        };
        assert_eq!(write([0, 1, 2]), write([2, 0, 1]));
    }

    #[test]
    fn lines_that_cannot_be_read_are_taken_out() {
        let (dataset, store) = dataset();
        let mut journal = Journal::open(&dataset).expect("new");
        (0..3).for_each(|scene| journal.append(entry(scene)).expect("written"));
        drop(journal);
        let whole = bytes(&store);
        let length = whole.len() / 3;
        // A quote, a byte that makes the text invalid UTF-8, and the end of the first line, which joins it with the
        // second.
        for (byte, bit, lost) in [(length, 1, vec![1]), (length + 3, 128, vec![1]), (length - 1, 1, vec![0, 1])] {
            let mut broken = whole.clone();
            broken[byte] ^= bit;
            set(&store, &broken);
            let error = Journal::open(&dataset).err().expect("damaged").to_string();
            assert!(error.contains("not a journal line") && error.contains("options.repair"), "{error}");
            assert_eq!(Journal::mend(&dataset), Ok(1));
            let left: Vec<u32> = Journal::entries_of(&dataset).expect("mended").scenes().collect();
            assert_eq!(left, (0..3).filter(|scene| !lost.contains(scene)).collect::<Vec<u32>>(), "byte {byte}");
            assert_eq!(Journal::mend(&dataset), Ok(0));
        }
    }

    /// Two workers write the lines of scenes 0 to 1199 in turn.
    #[test]
    fn workers_join_the_lines_of_a_thousand_scenes() {
        let (dataset, store) = dataset();
        let open = || Journal::open_shared(&dataset).expect("shared");
        let mut workers = [open(), open()];
        let failed = |scene| JournalEntry::new(scene, 2, SceneOutcome::Failed);
        for scene in 0..1200 {
            let line = if scene == 7 { failed(scene) } else { entry(scene) };
            workers[scene as usize % 2].append(line).expect("written");
        }
        let files = LineFiles::of(&dataset).expect("listed");
        assert_eq!(files.paths().next(), Some(layout::lines_of_thousand(0)));
        assert!(files.paths().skip(1).eq((1000..1200).map(layout::line)));
        assert!(files.has(0) && files.has(1199) && !files.has(1200));
        assert!(Journal::has_file_of(&dataset, 999).expect("known") && !store.files().contains_key(&layout::line(999)));
        let all = Journal::entries_of(&dataset).expect("readable");
        assert!(all.scenes().eq(0..1200) && all.iter().all(|line| line.failed() == (line.scene == 7)));
        // A slow worker writes a line that is joined already.
        let mut slow = open();
        slow.entries = Entries::default();
        slow.append(entry(3)).expect("the same");
        let mut other = entry(4);
        other.attempt = 1;
        let error = slow.append(other).expect_err("another result").to_string();
        assert!(error.contains("scene 4 with another result") && error.contains("000.jsonl"), "{error}");
        slow.append(failed(5)).expect("the scene that was made stays");
        assert!([3, 4, 5].iter().all(|scene| !store.files().contains_key(&layout::line(*scene))));
        slow.append(entry(7)).expect("a scene replaces a failure");
        let mut journal = Journal::open(&dataset).expect("alone");
        assert!(journal.entries().made().count() == 1200 && journal.entries().has(&entry(7)));
        journal.rewrite().expect("written");
        assert!(LineFiles::of(&dataset).expect("listed").is_empty());
        assert_eq!(Journal::entries_of(&dataset).expect("readable").made().count(), 1200);
    }

    /// A dataset in which another program changes files before one call. The calls are counted from the beginning.
    fn changing(store: &Arc<MemStore>, call: u32, change: impl Fn(&MemStore) + Send + Sync + 'static) -> StoreFolder {
        let files = Arc::clone(store);
        let plan = move |number| {
            if number == call {
                change(&files);
            }
            None
        };
        Arc::new(FaultStore::new(Arc::clone(store), plan)).into()
    }

    /// A worker finds the line of another worker, which is joined before the first worker reads it.
    #[test]
    fn a_line_that_is_joined_meanwhile_is_compared() {
        let failed = JournalEntry::new(3, 2, SceneOutcome::Failed);
        for (late, is_same) in [(entry(3), true), (JournalEntry { attempt: 1, ..entry(3) }, false), (failed, true)] {
            let (_, store) = dataset();
            // Calls to open the journal: it and the files are listed, and it is opened. Then the line is written.
            let join = |store: &MemStore| {
                let line = store.get(&layout::line(3)).expect("there");
                store.insert(layout::lines_of_thousand(0), line.to_vec());
                store.remove(&layout::line(3)).expect("removed");
            };
            let mut worker = Journal::open_shared(changing(&store, 3, join)).expect("shared");
            store.insert(layout::line(3), line_of(&entry(3)).into_bytes());
            let appended = worker.append(late);
            assert_eq!(appended.is_ok(), is_same, "{appended:?}");
            assert!(appended.err().is_none_or(|error| error.to_string().contains("another result")));
            let files = LineFiles::of(&StoreFolder::from(Arc::clone(&store))).expect("listed");
            assert!(files.paths().eq([layout::lines_of_thousand(0)]), "the joined line stays alone");
            assert!(Journal::entries_of(Arc::clone(&store)).expect("readable").has(&entry(3)));
        }
    }

    /// Another worker makes a scene while the line of its failure is joined.
    #[test]
    fn a_line_that_is_replaced_while_it_is_joined_stays() {
        let (_, store) = dataset();
        let failed = JournalEntry::new(7, 2, SceneOutcome::Failed);
        for scene in 0..JOINED {
            let line = if scene == 7 { &failed } else { &entry(scene) };
            store.insert(layout::line(scene), line_of(line).into_bytes());
        }
        // One call lists the lines, and each of the next calls reads one. Then they are written.
        let make = |store: &MemStore| store.insert(layout::line(7), line_of(&entry(7)).into_bytes());
        let changing = changing(&store, 1 + JOINED, make);
        LineFiles::of(&changing).expect("listed").join(&changing).expect("joined");
        let joined = store.get(&layout::lines_of_thousand(0)).expect("there");
        assert!(joined.windows(8).any(|part| part == b"\"failed\""));
        let files = LineFiles::of(&StoreFolder::from(Arc::clone(&store))).expect("listed");
        assert!(files.paths().eq([layout::lines_of_thousand(0), layout::line(7)]));
        assert_eq!(Journal::entries_of(store).expect("readable").made().count(), JOINED as usize);
    }

    /// A folder has the name of the line.
    #[test]
    fn a_line_that_is_refused_and_missing_is_named() {
        let (dataset, store) = dataset();
        let inside = layout::line(3).join(&DatasetPath::new("x").expect("a path"));
        store.insert(inside, Vec::new());
        let error = Journal::open_shared(&dataset).expect("shared").append(entry(3)).expect_err("refused");
        assert!(error.is_transient() && error.to_string().contains("000003.json"), "{error}");
    }

    /// The program writes none of these names. If they counted, it would look for `000003.json` and `004.jsonl`.
    #[test]
    fn foreign_names_are_no_lines() {
        let (dataset, store) = dataset();
        let mut shared = Journal::open_shared(&dataset).expect("shared");
        (0..3).for_each(|scene| shared.append(entry(scene)).expect("written"));
        for name in ["3.json", "+3.json", "0000003.json", "4.jsonl", "0004.jsonl", "000003.json/x", "004.jsonl/x"] {
            let path = layout::lines().join(&DatasetPath::new(name).expect("a path"));
            store.insert(path.clone(), line_of(&entry(3)).into_bytes());
            let files = LineFiles::of(&dataset).expect("listed");
            assert!(files.paths().eq((0..3).map(layout::line)) && !files.has(3) && !files.has(4000), "{name}");
            assert!(Journal::entries_of(&dataset).expect("readable").scenes().eq(0..3), "{name}");
            store.remove(&path).expect("removed");
        }
    }

    /// As where the list of a folder is old.
    #[test]
    fn a_listed_file_that_does_not_exist_is_named() {
        let (dataset, store) = dataset();
        for journal in [None, Some(line_of(&entry(0)))] {
            journal.iter().for_each(|line| set(&store, line.as_bytes()));
            let mut lines = JournalLines::open(&dataset).expect("readable");
            // It was joined after the list was made, and the journal starts again.
            lines.rest.push_back(layout::line(7));
            while lines.advance().expect("readable") {}
            lines.rest.push_back(layout::line(7));
            let error = lines.advance().expect_err("twice");
            assert!(error.is_transient() && error.to_string().contains("000007.json"), "{error}");
        }
    }

    #[test]
    fn damage_is_named() {
        let (dataset, store) = dataset();
        // The others are lines of earlier versions, without an outcome or a list of files.
        for (line, lacks) in [
            (r#"{"scene":0}"#, "attempt"),
            (r#"{"scene":0,"attempt":0,"views":2,"objects":3}"#, "outcome"),
            (r#"{"scene":0,"attempt":0,"outcome":"made","views":2,"objects":3}"#, "writers"),
        ] {
            set(&store, format!("{line}\n").as_bytes());
            let error = Journal::open(&dataset).err().expect("damaged").to_string();
            let want = format!("journal.jsonl:1: not a journal line: missing field `{lacks}`");
            assert!(error.contains(&want) && error.contains("another version began the dataset"), "{error}");
        }
    }

    #[test]
    fn of_many_bad_lines_the_first_are_told_and_the_rest_counted() {
        let (dataset, store) = dataset();
        set(&store, "x\n".repeat(500).as_bytes());
        let (entries, faults) = Journal::readable(&dataset).expect("readable");
        assert!(entries.is_empty() && faults.len() == SHOWN + 1, "{faults:?}");
        assert!(faults[0].starts_with("line 1 ") && faults[SHOWN].starts_with(&format!("{} more", 500 - SHOWN)));
    }

    /// The files have holes, which take no space on a disk.
    #[test]
    fn files_of_a_run_are_bounded() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path();
        let path = root.join(".syntable/journal.jsonl");
        fs::create_dir_all(root.join(".syntable/scenes/000")).expect("writable");
        let dataset = StoreFolder::from(root);
        let mut journal = Journal::open(&dataset).expect("new");
        (0..3).for_each(|scene| journal.append(entry(scene)).expect("written"));
        drop(journal);
        let hole = |path: &Path| {
            let file = fs::OpenOptions::new().create(true).append(true).open(path).expect("writable");
            file.set_len(2 * RUN_LIST_BYTES.most).expect("a hole");
        };
        let lists =
            ["scenes/000/000000.json", "finished.json", "times.jsonl"].map(|name| root.join(".syntable").join(name));
        lists.iter().chain([&path]).for_each(|path| hole(path));
        let errors = [
            Manifest::read(&dataset, &layout::manifest(0)).err(),
            Finished::of(&dataset).err(),
            RunTimes::of_dataset(root).err(),
            crate::run::dataset::foreign::check(&dataset).err(),
        ];
        let settled = layout::settled(0).below(root);
        fs::create_dir_all(settled.parent().expect("a folder")).expect("writable");
        hole(&settled);
        let mut manifest = Manifest::default();
        let path = syntable_model::stage::shard_path(OWNER, SceneId(4)).expect("a path");
        manifest.files.insert(path, Stamp(2 * RUN_LIST_BYTES.most, Digest::of(&[])));
        let (text, digest) = manifest.text();
        dataset.write(&layout::manifest(4), text.as_bytes()).expect("writable");
        let mut listed = entry(4);
        if let SceneOutcome::Made { manifest, .. } = &mut listed.outcome {
            *manifest = digest;
        }
        let files = SceneFiles::new(&dataset, &Entries::from_iter([&listed]));
        let error = Records::read(&files, SceneId(4)).expect_err("too large").to_string();
        let says = ["536870912 bytes of what a run records", "limit of 268435456", "000004.jsonl", "options.repair"];
        assert!(says.iter().all(|part| error.contains(part)), "{error}");
        assert!(crate::run::dataset::settled::read(&dataset, SceneId(0)).is_none());
        for error in errors {
            let error = error.expect("too large").to_string();
            let says =
                ["536870912 bytes of a file that a run keeps", "limit of 268435456", "`options.repair`", ".json"];
            assert!(says.iter().all(|part| error.contains(part)), "{error}");
        }
        for error in [Journal::open(&dataset).err(), Journal::readable(&dataset).err()] {
            let error = error.expect("too long").to_string();
            let says = ["journal.jsonl:4", "of a line of its journal", "limit of 268435456", "`options.repair`"];
            assert!(says.iter().all(|part| error.contains(part)), "{error}");
        }
    }
}
