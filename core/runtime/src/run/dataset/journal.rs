//! The journal of a dataset: one line per finished scene. A scene without a line does not exist.
//!
//! A run appends lines to `journal.jsonl`. In an object store, which cannot append, or if several workers make the dataset,
//! each line is a file of its own, which is written once. A run joins these files into `journal.jsonl` when it has written many, at its end, and when it
//! opens the journal. Until it has removed them, they equal the joined lines.

use crate::run::dataset::draws::PoseDraws;
use crate::run::dataset::layout;
use crate::run::dataset::loss::Loss;
use crate::run::dataset::requests;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::io::{BufRead, BufReader, Read};
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;
use syntable_model::limits::RUN_LIST_BYTES;
use syntable_model::store::{StoreFolder, StoredFile};
use syntable_model::words::SHOWN;

/// A line of the journal: a finished scene.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct JournalEntry {
    /// Number of the scene.
    pub scene: u32,
    /// The successful attempt, from 0; the last attempt if the scene failed.
    pub attempt: u32,
    /// Outcome of the scene.
    #[serde(flatten)]
    pub outcome: SceneOutcome,
    /// Anomalies of the scene as a whole.
    #[serde(default, skip_serializing_if = "BTreeSet::is_empty")]
    pub notices: BTreeSet<Notice>,
    /// Anomalies of some but not all views, with the numbers of these views, ascending.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub odd_views: BTreeMap<Notice, Vec<u32>>,
    /// Camera poses that were drawn under the conditions of `[views]`.
    #[serde(default, skip_serializing_if = "PoseDraws::is_empty")]
    pub poses: PoseDraws,
    /// Drawn alternatives of stages with `one_of`, by stage, from 0: one of a scene, or one of each view.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub choices: BTreeMap<String, Vec<u32>>,
    /// The component of a mixture that made the scene; empty if the recipe is no mixture.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub component: String,
    /// Data that stages omitted from the scene's images, by stage.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<Loss>,
    /// Messages of the failed attempts, in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub errors: Vec<String>,
    /// Digests of all assets that were drawn for the scene, by `pool/name`; `bad` for an unusable asset.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub assets: BTreeMap<String, String>,
}

/// Outcome of a finished scene.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(tag = "outcome", rename_all = "snake_case")]
pub enum SceneOutcome {
    /// The scene is in the dataset.
    Made {
        /// Number of written views.
        views: u32,
        /// Number of objects in the scene after settling.
        objects: u32,
        /// Ids of the writers of the scene, sorted.
        writers: Vec<String>,
        /// Products that were recorded for the annotators of the dataset, sorted.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        recorded: Vec<String>,
        /// Digest of the scene's list of files, `.syntable/scenes/<scene>.json`.
        manifest: String,
    },
    /// All attempts failed, or a device failed. The dataset has no file of the scene.
    Failed,
}

/// An anomaly of a scene, which may be intended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Notice {
    /// All images are black.
    Black,
    /// All images are white: at least 99 % of their pixels are overexposed.
    White,
    /// No view has a light, and no material emits any.
    Unlit,
    /// No object has a visible pixel in any view.
    Unlabeled,
    /// The camera of every view is outside the room, and the scene is black or unlabeled.
    Outside,
}

impl Notice {
    /// The notices to report of all notices of a scene: the others are causes of these.
    pub fn reported(all: &BTreeSet<Self>) -> impl Iterator<Item = Self> {
        let is_cause = |notice: Self| match notice {
            Self::Outside => true,
            Self::Unlit | Self::Unlabeled => all.contains(&Self::Black),
            Self::Black | Self::White => false,
        };
        all.iter().copied().filter(move |&notice| !is_cause(notice))
    }

    /// Message about a scene with these notices.
    pub fn text(self, all: &BTreeSet<Self>) -> &'static str {
        match self {
            Self::Black if all.contains(&Self::Unlabeled) => "all images are black, and no object is labeled",
            Self::Black => "all images are black",
            Self::White => "all images are white",
            Self::Unlit => "no light: no view has a light, and no material emits light",
            Self::Unlabeled => "no object is labeled in any view",
            Self::Outside => "the camera is outside the room in every view",
        }
    }

    /// Message about one of several views.
    pub fn text_of_view(self) -> &'static str {
        match self {
            Self::Black => "the image is black",
            Self::White => "the image is white",
            Self::Unlit => "no light",
            Self::Unlabeled => "no object is labeled",
            Self::Outside => "the camera is outside the room",
        }
    }

    /// Remedy if some views have it.
    pub fn help_of_view(self) -> &'static str {
        match self {
            Self::Black | Self::Unlit => {
                "the camera may be outside the room or inside an object: check [views], the sizes in [[place]] and \
                 [[lights]]"
            }
            Self::White => "the view is overexposed: check the intensity of [[lights]] and the exposure in [camera]",
            Self::Unlabeled | Self::Outside => {
                "the camera may be outside the room, look past the objects or be behind an object: check [views] and \
                 the sizes in [[place]]"
            }
        }
    }

    /// Whether a few such views may be intended: a camera may look past all objects, but a black image always has a
    /// cause.
    pub fn may_be_meant(self) -> bool {
        self == Self::Unlabeled
    }

    /// The cause that is certain or most likely with these notices of a scene, and the remedy.
    pub fn help(self, all: &BTreeSet<Self>) -> &'static str {
        let has = |notice: Self| all.contains(&notice);
        match self {
            Self::Black | Self::Unlit if has(Self::Unlit) => {
                "no light: no view has a light, and no material emits light; add a [[lights]] table, or raise a `count` \
                 that is 0"
            }
            Self::Black | Self::Unlabeled | Self::Outside if has(Self::Outside) => {
                "the camera is outside the room in every view: check [views] and the size of the room in [[place]]"
            }
            Self::Black if has(Self::Unlabeled) => {
                "the camera may be behind a wall or inside an object: check [views] and the sizes in [[place]]"
            }
            Self::Black => {
                "the light may be too weak or hidden: check [[lights]], the exposure in [camera], and objects right in \
                 front of the camera"
            }
            Self::White => "lower the intensity of [[lights]], or check the exposure in [camera]",
            Self::Unlit => "add a [[lights]] table",
            Self::Unlabeled | Self::Outside => {
                "the objects are outside the views or hidden, or have fewer visible pixels than `annotate.masks.min_visible_px`: check \
                 [views], and bodies that may hide the table"
            }
        }
    }
}

impl JournalEntry {
    /// The entry of a scene that had no anomaly, error or draw.
    pub fn new(scene: u32, attempt: u32, outcome: SceneOutcome) -> Self {
        let (notices, odd_views, poses, choices, component, left_out, errors, assets) = Default::default();
        Self { scene, attempt, outcome, notices, odd_views, poses, choices, component, left_out, errors, assets }
    }

    /// Whether all attempts failed.
    pub fn failed(&self) -> bool {
        self.outcome == SceneOutcome::Failed
    }

    /// Number of views in the dataset.
    pub fn views(&self) -> u32 {
        match self.outcome {
            SceneOutcome::Made { views, .. } => views,
            SceneOutcome::Failed => 0,
        }
    }

    /// Ids of the writers that wrote the scene.
    pub fn writers(&self) -> &[String] {
        match &self.outcome {
            SceneOutcome::Made { writers, .. } => writers,
            SceneOutcome::Failed => &[],
        }
    }

    /// The line of a scene without the writers `anew`, whose files are written again or removed. Records for dataset
    /// annotators are dropped too, because the annotators may have changed.
    pub fn without(&self, anew: &BTreeSet<String>) -> Self {
        let mut entry = self.clone();
        if let SceneOutcome::Made { writers, recorded, .. } = &mut entry.outcome
            && writers.iter().any(|id| anew.contains(id))
        {
            writers.retain(|id| !anew.contains(id));
            recorded.clear();
        }
        entry.left_out.retain(|loss| !loss.stage.strip_prefix("write.").is_some_and(|id| anew.contains(id)));
        entry
    }

    /// Products that were recorded of the scene.
    pub fn recorded(&self) -> &[String] {
        match &self.outcome {
            SceneOutcome::Made { recorded, .. } => recorded,
            SceneOutcome::Failed => &[],
        }
    }

    /// Digest of the scene's manifest, if it has one.
    pub fn manifest(&self) -> Option<&str> {
        match &self.outcome {
            SceneOutcome::Made { manifest, .. } => Some(manifest),
            SceneOutcome::Failed => None,
        }
    }
}

/// The readable lines of a journal that a run may be writing.
pub struct LatestLines {
    /// The finished scenes.
    pub entries: BTreeMap<u32, JournalEntry>,
    /// The last scenes, in the order of the file.
    pub order: Vec<u32>,
    /// Descriptions of unreadable lines.
    pub faults: Vec<String>,
}

/// The journal. A run appends lines to it.
pub struct Journal {
    dataset: StoreFolder,
    entries: BTreeMap<u32, JournalEntry>,
    /// Number of lines that are files of their own.
    loose: usize,
    /// Other workers write lines, too.
    is_shared: bool,
}

/// Minimum number of lines in files of their own before they are joined. Later joins wait for a quarter of all lines, so
/// a line is written a few times only.
const LOOSE: usize = 1000;
/// Lines that are read at once.
const BATCH: usize = 256;

impl Journal {
    /// Opens the journal of a dataset, or starts one. A truncated last line is ignored.
    pub fn open(dataset: impl Into<StoreFolder>) -> Result<Self> {
        let dataset = dataset.into();
        let path = layout::journal();
        let (entries, whole) = Self::read(&dataset)?;
        let mut journal = Self { dataset, entries, loose: 0, is_shared: false };
        if !line_files(&journal.dataset)?.is_empty() {
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

    /// Scenes whose lines are files of their own.
    pub fn scenes_of_files(dataset: &StoreFolder) -> Result<BTreeSet<u32>> {
        let names = dataset.list(&layout::lines())?.into_iter().map(|(name, _)| name);
        Ok(names.filter_map(|name| name.strip_suffix(".json")?.parse().ok()).collect())
    }

    /// Reads the lines of a journal, without changing it.
    pub fn entries_of(dataset: impl Into<StoreFolder>) -> Result<BTreeMap<u32, JournalEntry>> {
        Self::read(&dataset.into()).map(|(entries, _)| entries)
    }

    /// Reads the lines of a journal. Returns the entries, and the size of the complete lines, bytes.
    fn read(dataset: &StoreFolder) -> Result<(BTreeMap<u32, JournalEntry>, u64)> {
        let mut entries = BTreeMap::new();
        let whole = each_line(dataset, |place, line| {
            let entry = line.map_err(|error| {
                Error::new(format!("not a journal line: {error}"))
                    .in_file(dataset.name_of(&place.file))
                    .at_line(place.line)
                    .help(
                        "a run of the dataset's recipe with `options.repair` makes the scene of a damaged line again; if \
                         another version began the dataset, choose another folder with `options.out`, or delete this one",
                    )
            })?;
            entries.insert(entry.scene, entry);
            Ok(())
        })?;
        Ok((entries, whole))
    }

    /// Reads the readable lines of a journal, and describes the others: the first [`SHOWN`], and the number of the
    /// rest.
    pub fn readable(dataset: impl Into<StoreFolder>) -> Result<(BTreeMap<u32, JournalEntry>, Vec<String>)> {
        Self::readable_lines(&dataset.into(), |_| ())
    }

    fn readable_lines(
        dataset: &StoreFolder,
        mut each: impl FnMut(&JournalEntry),
    ) -> Result<(BTreeMap<u32, JournalEntry>, Vec<String>)> {
        let (mut entries, mut faults, mut more) = (BTreeMap::new(), Vec::new(), 0_u64);
        each_line(dataset, |place, line| {
            match line {
                Ok(entry) => {
                    each(&entry);
                    entries.insert(entry.scene, entry);
                }
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
        Ok((entries, faults))
    }

    /// The readable lines, with the order of the last `most` of them.
    pub fn latest(dataset: &StoreFolder, most: usize) -> Result<LatestLines> {
        let mut order = VecDeque::new();
        let (entries, faults) = Self::readable_lines(dataset, |entry| {
            order.push_back(entry.scene);
            if order.len() > most {
                order.pop_front();
            }
        })?;
        Ok(LatestLines { entries, order: order.into(), faults })
    }

    /// Removes unreadable lines, and returns their number.
    pub fn mend(dataset: &StoreFolder) -> Result<usize> {
        let (mut entries, mut bad) = (BTreeMap::new(), 0);
        each_line(dataset, |_, line| {
            match line {
                Ok(entry) => drop(entries.insert(entry.scene, entry)),
                Err(_) => bad += 1,
            }
            Ok(())
        })?;
        if bad > 0 {
            write(dataset, &entries)?;
        }
        Ok(bad)
    }

    /// The finished scenes, ascending.
    pub fn entries(&self) -> &BTreeMap<u32, JournalEntry> {
        &self.entries
    }

    /// Appends a line, and syncs it.
    ///
    /// # Errors
    /// If it cannot be written, or another worker has made the scene with another result.
    pub fn append(&mut self, entry: JournalEntry) -> Result<()> {
        if self.dataset.is_remote() || self.is_shared {
            return self.put_line(entry);
        }
        self.dataset.append(&layout::journal(), line_of(&entry).as_bytes())?;
        self.entries.insert(entry.scene, entry);
        Ok(())
    }

    /// Writes a line as a file of its own. If another worker has written the line of the scene, its result must be the
    /// same. A worker may fail to make a scene for a reason of its machine: the line of a scene that was made stays, or
    /// replaces the line of a failure.
    fn put_line(&mut self, entry: JournalEntry) -> Result<()> {
        let (path, line) = (layout::line(entry.scene), line_of(&entry));
        if self.entries.contains_key(&entry.scene) {
            self.dataset.write(&path, line.as_bytes())?;
        } else if !self.dataset.write_new(&path, line.as_bytes())? {
            let present = self.dataset.read(&path)?.unwrap_or_default();
            match serde_json::from_slice::<JournalEntry>(&present) {
                Ok(present) if present == entry => {}
                Ok(present) if present.failed() && !entry.failed() => self.dataset.write(&path, line.as_bytes())?,
                Ok(present) if entry.failed() => {
                    self.entries.insert(present.scene, present);
                    return Ok(());
                }
                _ => {
                    return Err(Error::new(format!(
                        "another worker has made scene {} with another result",
                        entry.scene
                    ))
                    .in_file(self.dataset.name_of(&path))
                    .help(
                        "the machine, the device or the program differs; a run with `options.repair` and without \
                             other workers makes the scene again",
                    ));
                }
            }
        }
        self.loose += 1;
        self.entries.insert(entry.scene, entry);
        if !self.is_shared && self.loose > LOOSE.max(self.entries.len() / 4) { self.rewrite() } else { Ok(()) }
    }

    /// Removes the line of a scene, atomically.
    pub fn forget(&mut self, scene: u32) -> Result<()> {
        if self.entries.remove(&scene).is_some() { self.rewrite() } else { Ok(()) }
    }

    /// Removes failed scenes, so that they are tried again. Takes effect on disk when the file is written.
    pub fn forget_failed(&mut self) {
        self.entries.retain(|_, entry| !entry.failed());
    }

    /// Removes writers from the lines of all scenes, atomically.
    pub fn forget_writers(&mut self, writers: &BTreeSet<String>) -> Result<()> {
        if writers.is_empty() {
            return Ok(());
        }
        self.entries.values_mut().for_each(|entry| *entry = entry.without(writers));
        self.rewrite()
    }

    /// Rewrites the file in scene order, atomically, so that it does not depend on the order in which scenes ended.
    pub fn rewrite(&mut self) -> Result<()> {
        write(&self.dataset, &self.entries)?;
        self.loose = 0;
        Ok(())
    }
}

/// Writes a journal in scene order, atomically. Lines in files of their own are part of it.
fn write(dataset: &StoreFolder, entries: &BTreeMap<u32, JournalEntry>) -> Result<()> {
    let path = layout::journal();
    dataset.put(&path, &mut |file| {
        for entry in entries.values() {
            file.write_all(line_of(entry).as_bytes()).map_err(|error| Error::io(dataset.name_of(&path), &error))?;
        }
        Ok(())
    })?;
    dataset.remove_all(&layout::lines())
}

/// The line of an entry, with its line end.
fn line_of(entry: &JournalEntry) -> String {
    let mut line = serde_json::to_string(entry).expect("an entry is plain data");
    line.push('\n');
    line
}

/// The files that are lines, in the order of their scenes.
fn line_files(dataset: &StoreFolder) -> Result<Vec<DatasetPath>> {
    Ok(Journal::scenes_of_files(dataset)?.into_iter().map(layout::line).collect())
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
    /// The lines in files of their own that follow.
    rest: VecDeque<DatasetPath>,
    /// The first of them, read already.
    read: VecDeque<(DatasetPath, Vec<u8>)>,
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
        let rest = line_files(dataset)?.into();
        let opened = dataset.open(&file)?.map(BufReader::new);
        let (dataset, place) = (dataset.clone(), Place { file, line: 0 });
        Ok(Self { dataset, place, file: opened, rest, read: VecDeque::new(), line: Vec::new() })
    }

    /// The next line with its line end, which a truncated last line lacks. Refuses a line longer than
    /// [`RUN_LIST_BYTES`].
    pub fn next_line(&mut self) -> Result<Option<&[u8]>> {
        let Some(file) = &mut self.file else { return self.next_file() };
        self.line.clear();
        self.place.line += 1;
        let name = || self.dataset.name_of(&self.place.file);
        let read = file.take(RUN_LIST_BYTES.most + 1).read_until(b'\n', &mut self.line);
        let read = read.map_err(|error| Error::io(name(), &error))?;
        RUN_LIST_BYTES.check(read as u64).map_err(|error| error.in_file(name()).at_line(self.place.line))?;
        if read > 0 {
            return Ok(Some(&self.line));
        }
        self.file = None;
        self.next_file()
    }

    /// The next line that is a file of its own.
    fn next_file(&mut self) -> Result<Option<&[u8]>> {
        while self.read.is_empty() && !self.rest.is_empty() {
            let paths: Vec<DatasetPath> = self.rest.drain(..BATCH.min(self.rest.len())).collect();
            let read = requests::read(&self.dataset, &paths, &RUN_LIST_BYTES)?;
            let is_joined = read.iter().any(Option::is_none);
            self.read = paths.into_iter().zip(read).filter_map(|(path, bytes)| Some((path, bytes?))).collect();
            if is_joined {
                // A run has joined lines since they were listed. The joined lines are read once more.
                self.place = Place { file: layout::journal(), line: 0 };
                self.file = self.dataset.open(&self.place.file)?.map(BufReader::new);
                return self.next_line();
            }
        }
        let Some((file, line)) = self.read.pop_front() else { return Ok(None) };
        (self.place, self.line) = (Place { file, line: 1 }, line);
        Ok(Some(&self.line))
    }
}

/// Calls `each` with every complete line of a journal: its place, and its entry or error. Returns the size of the
/// complete joined lines, bytes.
fn each_line(
    dataset: &StoreFolder,
    mut each: impl FnMut(&Place, serde_json::Result<JournalEntry>) -> Result<()>,
) -> Result<u64> {
    let (mut lines, mut whole) = (JournalLines::open(dataset)?, 0);
    while let Some(line) = lines.next_line()? {
        let size = line.len() as u64;
        let entry = line.ends_with(b"\n").then(|| serde_json::from_slice(line));
        let is_joined = lines.place.file == layout::journal();
        if let Some(entry) = entry {
            whole += if is_joined { size } else { 0 };
            each(&lines.place, entry)?;
        }
    }
    Ok(whole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::dataset::ending::Finished;
    use crate::run::dataset::manifest::Manifest;
    use crate::run::making::times::RunTimes;
    use std::fs;
    use std::path::Path;
    use std::sync::Arc;
    use syntable_model::store::MemStore;

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

    fn entry(scene: u32) -> JournalEntry {
        let (writers, manifest) = (vec!["png".to_owned()], "00".to_owned());
        let outcome = SceneOutcome::Made { views: 2, objects: 3, writers, recorded: Vec::new(), manifest };
        JournalEntry::new(scene, 0, outcome)
    }

    #[test]
    fn a_line_states_the_outcome() {
        let made =
            r#"{"scene":4,"attempt":0,"outcome":"made","views":2,"objects":3,"writers":["png"],"manifest":"00"}"#;
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
            let left: Vec<u32> = Journal::entries_of(&dataset).expect("mended").into_keys().collect();
            assert_eq!(left, (0..3).filter(|scene| !lost.contains(scene)).collect::<Vec<u32>>(), "byte {byte}");
            assert_eq!(Journal::mend(&dataset), Ok(0));
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
        fs::create_dir_all(root.join(".syntable/scenes")).expect("writable");
        let dataset = StoreFolder::from(root);
        let mut journal = Journal::open(&dataset).expect("new");
        (0..3).for_each(|scene| journal.append(entry(scene)).expect("written"));
        drop(journal);
        let hole = |path: &Path| {
            let file = fs::OpenOptions::new().create(true).append(true).open(path).expect("writable");
            file.set_len(2 * RUN_LIST_BYTES.most).expect("a hole");
        };
        let lists =
            ["scenes/000000.json", "finished.json", "times.jsonl"].map(|name| root.join(".syntable").join(name));
        lists.iter().chain([&path]).for_each(|path| hole(path));
        let errors = [
            Manifest::read(&dataset, &layout::manifest(0)).err(),
            Finished::of(&dataset).err(),
            RunTimes::of_dataset(root).err(),
            crate::run::dataset::foreign::check(&dataset).err(),
        ];
        let shard = root.join(".syntable/shards/@records/000000.jsonl");
        let settled = layout::settled(0).below(root);
        for path in [&shard, &settled] {
            fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
            hole(path);
        }
        let scene = syntable_model::scene::SceneId(0);
        let error = crate::run::dataset::records::Records::read(&dataset, scene).expect_err("too large").to_string();
        let says = ["536870912 bytes of what a run records", "limit of 268435456", "000000.jsonl", "options.repair"];
        assert!(says.iter().all(|part| error.contains(part)), "{error}");
        assert!(crate::run::dataset::settled::read(&dataset, scene).is_none());
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
