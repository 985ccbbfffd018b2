//! Compares a dataset with its journal, and lists missing, damaged and foreign files.

use crate::run::dataset::ending::{self, Finished};
use crate::run::dataset::folder::each_file;
use crate::run::dataset::foreign::{self, Depth, StrayFile};
use crate::run::dataset::journal::{Entries, Journal};
use crate::run::dataset::layout::{self, MARK, RECIPE};
use crate::run::dataset::locking::lock;
use crate::run::dataset::manifest::{FileState, Manifest, Stamp};
use crate::workers::Pool;
use parking_lot::Mutex;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use syntable_model::context::Workers;
use syntable_model::digest::Digest;
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;
use syntable_model::stage::unreadable;
use syntable_model::store::{Access, Kind, StoreFolder};

/// Result of comparing a dataset.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Verified {
    /// Number of finished scenes, without failed ones.
    pub scenes: u32,
    /// Number of compared files.
    pub files: u64,
    /// Missing files, sorted.
    pub missing: Vec<String>,
    /// Files of different size or content, sorted.
    pub damaged: Vec<String>,
    /// Faults of the journal: descriptions of unreadable lines. Only the scenes of the other lines were compared.
    pub faults: Vec<String>,
    /// Files of scenes with lost manifests, by scene, where the paths of another scene identify them; and files of scenes
    /// with manifests, whose lines are lost, if the journal has faults. Sorted.
    pub unlisted: BTreeMap<u32, Vec<String>>,
    /// Other files that no manifest lists, sorted.
    pub foreign: Vec<String>,
    /// Links in the folder with their targets, sorted.
    pub links: Vec<(String, String)>,
    /// Listed files that are links or behind one, and were therefore not compared, sorted.
    pub linked: Vec<String>,
    /// Lists with foreign names, and foreign entries of the program's own folder, with reasons, sorted. If the
    /// program's own folder has links, nothing was compared.
    pub outside: Vec<(String, String)>,
    /// Scenes with a missing or damaged file.
    pub bad_scenes: BTreeSet<u32>,
    /// Whether the last run did not end.
    pub unfinished: bool,
}

impl Verified {
    /// Whether every file is unchanged, and all runs ended.
    pub fn whole(&self) -> bool {
        let lists = [&self.missing, &self.damaged, &self.linked];
        lists.iter().all(|list| list.is_empty())
            && self.faults.is_empty()
            && self.outside.is_empty()
            && !self.unfinished
    }
}

/// Compares a dataset, without changing it. No run may be writing it.
pub fn verify(dataset: impl Into<StoreFolder>, threads: usize) -> Result<Verified> {
    let dataset = dataset.into();
    if !layout::is_dataset(&dataset)? {
        return Err(Error::new("no dataset in this folder")
            .in_file(dataset.name())
            .help("name the output folder of a run"));
    }
    let _lock = lock(&dataset, Access::Read)?;
    compare(&dataset, &Pool::new(threads)?)
}

/// Compares a dataset with an open folder.
pub(in crate::run) fn compare(dataset: &StoreFolder, workers: &dyn Workers) -> Result<Verified> {
    let own = foreign::own_files(dataset, Depth::Files)?;
    if !own.odd.is_empty() {
        let mut found = Verified::default();
        found.add_odd(own.odd);
        return Ok(found);
    }
    let (entries, faults) = Journal::readable(dataset)?;
    let made: Vec<(u32, Digest)> = entries.iter().filter_map(|line| Some((line.scene, line.manifest()?))).collect();
    let found = Mutex::new((Verified::default(), Owned::default(), ManifestScenes::default()));
    let failure = Mutex::new(None);
    workers.run(made.len(), &|index| {
        let (scene, digest) = made[index];
        let mut wrong = Verified::default();
        let done = scene_files(dataset, scene, digest, &mut wrong).map(|manifest| {
            let mut found = found.lock();
            found.2.add(scene, manifest.as_ref());
            found.1.extend(&manifest.unwrap_or_default());
            if !wrong.whole() {
                found.0.bad_scenes.insert(scene);
            }
            found.0.add(wrong);
        });
        if let Err(error) = done {
            failure.lock().get_or_insert(error);
        }
    });
    if let Some(error) = failure.into_inner() {
        return Err(error);
    }
    let (mut found, mut owned, known) = found.into_inner();
    found.scenes = made.len() as u32;
    found.faults = faults;
    let without_line = if found.faults.is_empty() { HashMap::new() } else { without_line(dataset, &entries)? };
    let end = Finished::of(dataset)?;
    owned.extend(&end.manifest);
    for (path, stamp) in &end.manifest.files {
        found.look(dataset, path, stamp)?;
    }
    found.add_odd(foreign::names(dataset, &own.lists, workers)?.0);
    found.unfinished = !ending::is_finished(dataset)?;
    if found.unfinished {
        // Before its first end, a run has written the recipe, which the end lists.
        owned.0.insert(key(RECIPE));
    }
    let patterns = Patterns::of(dataset, known)?;
    each_file(dataset, "", &mut |path, kind| {
        if kind == Kind::Link {
            let there = dataset.look(path).ok().flatten();
            found.links.push((path.to_owned(), there.and_then(|there| there.leads_to).unwrap_or_default()));
        } else if !owned.0.contains(&key(path)) {
            match without_line.get(&key(path)).copied().or_else(|| patterns.scene_of(path)) {
                Some(scene) => found.unlisted.entry(scene).or_default().push(path.to_owned()),
                None => found.foreign.push(path.to_owned()),
            }
        }
    })?;
    found.links.sort_unstable();
    found.outside.sort_unstable();
    let lists = [&mut found.missing, &mut found.damaged, &mut found.foreign, &mut found.linked];
    lists.into_iter().chain(found.unlisted.values_mut()).for_each(|list| list.sort_unstable());
    Ok(found)
}

/// The scenes of the files that manifests without a line list, by the [`key`] of the file.
fn without_line(dataset: &StoreFolder, entries: &Entries) -> Result<HashMap<u64, u32>> {
    let mut scenes = HashMap::new();
    for (scene, path) in layout::manifests_in(dataset, &layout::manifests())? {
        if !entries.contains(scene)
            && let Some((manifest, _)) = Manifest::read_any(dataset, &path)?
        {
            scenes.extend(manifest.files.keys().map(|path| (key(path), scene)));
        }
    }
    Ok(scenes)
}

/// Compares the files of a scene, and returns its manifest, or `None` if the manifest is lost.
fn scene_files(dataset: &StoreFolder, scene: u32, digest: Digest, wrong: &mut Verified) -> Result<Option<Manifest>> {
    let path = layout::manifest(scene);
    wrong.files += 1;
    let manifest = match Manifest::read_any(dataset, &path)? {
        Some((manifest, found)) => {
            if found != digest {
                wrong.damaged.push(path.to_string());
            }
            manifest
        }
        None => {
            if dataset.has(&path)? { &mut wrong.damaged } else { &mut wrong.missing }.push(path.to_string());
            return Ok(None);
        }
    };
    for (path, stamp) in &manifest.files {
        wrong.look(dataset, path, stamp)?;
    }
    Ok(Some(manifest))
}

impl Verified {
    fn look(&mut self, dataset: &StoreFolder, path: &DatasetPath, stamp: &Stamp) -> Result<()> {
        self.files += 1;
        match stamp.check_in(dataset, path).map_err(unreadable)? {
            FileState::Whole => {}
            FileState::Missing => self.missing.push(path.to_string()),
            FileState::Damaged => self.damaged.push(path.to_string()),
            FileState::Linked => self.linked.push(path.to_string()),
        }
        Ok(())
    }

    fn add_odd(&mut self, odd: Vec<StrayFile>) {
        self.outside.extend(odd.into_iter().map(|StrayFile { path, what }| (path, what)));
    }

    fn add(&mut self, other: Self) {
        self.files += other.files;
        self.missing.extend(other.missing);
        self.damaged.extend(other.damaged);
        self.linked.extend(other.linked);
    }
}

/// Digests of the paths of all listed files. A dataset may have millions of files.
#[derive(Default)]
struct Owned(HashSet<u64>);

impl Owned {
    fn extend(&mut self, manifest: &Manifest) {
        self.0.extend(manifest.files.keys().filter(|path| !path.starts_with(MARK)).map(|path| key(path)));
    }
}

/// Scenes by the state of their manifests.
#[derive(Default)]
struct ManifestScenes {
    /// Scenes with lost manifests.
    lost: BTreeSet<u32>,
    /// Number of files of the largest scene, and that scene; the first of several.
    example: Option<(usize, std::cmp::Reverse<u32>)>,
}

impl ManifestScenes {
    fn add(&mut self, scene: u32, manifest: Option<&Manifest>) {
        match manifest {
            Some(manifest) => self.example = self.example.max(Some((manifest.files.len(), std::cmp::Reverse(scene)))),
            None => drop(self.lost.insert(scene)),
        }
    }
}

/// Identifies the scene of an unlisted file by the paths of another scene: the position of that scene's number in its
/// paths. Without another scene, any number in the path counts.
struct Patterns {
    lost: BTreeSet<u32>,
    /// The scene with the example paths.
    example: u32,
    /// Numbers in the paths of its files, by the path without numbers; `None` without such a scene.
    numbers: Option<HashMap<String, Vec<Vec<u32>>>>,
}

impl Patterns {
    fn of(dataset: &StoreFolder, known: ManifestScenes) -> Result<Self> {
        let ManifestScenes { lost, example } = known;
        let Some((_, std::cmp::Reverse(example))) = example.filter(|_| !lost.is_empty()) else {
            return Ok(Self { lost, example: 0, numbers: None });
        };
        let manifest =
            Manifest::read_any(dataset, &layout::manifest(example))?.map(|(manifest, _)| manifest).unwrap_or_default();
        let mut all: HashMap<String, Vec<Vec<u32>>> = HashMap::new();
        for path in manifest.files.keys() {
            let (shape, numbers) = split(path);
            all.entry(shape).or_default().push(numbers);
        }
        Ok(Self { lost, example, numbers: Some(all) })
    }

    fn scene_of(&self, path: &str) -> Option<u32> {
        if self.lost.is_empty() {
            return None;
        }
        let (shape, numbers) = split(path);
        let Some(all) = &self.numbers else {
            return numbers.into_iter().find(|number| self.lost.contains(number));
        };
        all.get(&shape)?.iter().find_map(|theirs| {
            let mut other = theirs.iter().zip(&numbers).filter(|(theirs, ours)| theirs != ours);
            let (first, &scene) = other.next()?;
            let same = *first == self.example && other.all(|(theirs, ours)| (theirs, *ours) == (first, scene));
            (same && self.lost.contains(&scene)).then_some(scene)
        })
    }
}

/// A path with `#` for each number, and the numbers; a number beyond 32 bits becomes the largest.
fn split(path: &str) -> (String, Vec<u32>) {
    let (mut shape, mut numbers) = (String::new(), Vec::new());
    let mut rest = path;
    while let Some(at) = rest.find(|letter: char| letter.is_ascii_digit()) {
        let (before, from) = rest.split_at(at);
        let digits = from.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(from.len());
        shape += before;
        shape.push('#');
        numbers.push(from[..digits].parse().unwrap_or(u32::MAX));
        rest = &from[digits..];
    }
    (shape + rest, numbers)
}

fn key(path: &str) -> u64 {
    Digest::of(path.as_bytes()).short()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_told_by_the_paths_of_another_scene() {
        let theirs = ["png/rgb/3_1.png", "png/rgb/3_3.png", "v2/000003.json", "3/a/3.txt"];
        let mut numbers: HashMap<String, Vec<Vec<u32>>> = HashMap::new();
        for (shape, found) in theirs.map(split) {
            numbers.entry(shape).or_default().push(found);
        }
        let patterns = Patterns { lost: [5, 7].into(), example: 3, numbers: Some(numbers) };
        for (path, scene) in [
            ("png/rgb/5_1.png", Some(5)),
            ("png/rgb/7_3.png", Some(7)),
            ("png/rgb/6_1.png", None),
            ("png/rgb/5_2.png", None),
            ("v2/000005.json", Some(5)),
            ("v5/000003.json", None),
            ("5/a/5.txt", Some(5)),
            ("5/a/7.txt", None),
            ("notes 5.txt", None),
        ] {
            assert_eq!(patterns.scene_of(path), scene, "{path}");
        }
        let alone = Patterns { numbers: None, ..patterns };
        assert_eq!(alone.scene_of("notes 5.txt"), Some(5));
        assert_eq!(alone.scene_of("notes.txt"), None);
    }
}
