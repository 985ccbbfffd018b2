//! Compares a dataset with its journal: what is missing, what is damaged, what is not the dataset's.

use super::folder::{each_file, finished, journal_path, lock_shared, manifest_path};
use super::journal::Journal;
use super::manifest::{Manifest, Stamp, State};
use crate::workers::Pool;
use parking_lot::Mutex;
use std::collections::{BTreeSet, HashSet};
use std::path::Path;
use syntable_model::context::Workers;
use syntable_model::digest::Digest;
use syntable_model::error::{Error, Result};
use syntable_model::stage::RESERVED;

/// What is wrong with a dataset.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Verified {
    /// Scenes that are done, failed ones not counted.
    pub scenes: u32,
    /// Files that were compared.
    pub files: u64,
    /// Files that are not there, sorted.
    pub missing: Vec<String>,
    /// Files of another size or content, sorted.
    pub damaged: Vec<String>,
    /// Files that no manifest lists, sorted.
    pub foreign: Vec<String>,
    /// Scenes that have a missing or damaged file.
    pub bad_scenes: BTreeSet<u32>,
    /// Whether a run has begun or gone on, and did not end.
    pub unfinished: bool,
}

impl Verified {
    /// Whether every file is as it was written, and all runs ended.
    pub fn whole(&self) -> bool {
        self.missing.is_empty() && self.damaged.is_empty() && !self.unfinished
    }
}

/// Compares a dataset that no run is writing. Changes nothing.
pub fn verify(root: &Path, threads: usize) -> Result<Verified> {
    if !root.join(RESERVED[0]).is_dir() {
        return Err(Error::new("there is no dataset")
            .in_file(root)
            .help("name the folder that a run wrote")
            .permanent());
    }
    let _lock = lock_shared(root)?;
    compare(root, &Pool::new(threads)?)
}

/// Compares a dataset whose folder is open.
pub(super) fn compare(root: &Path, workers: &dyn Workers) -> Result<Verified> {
    let entries = Journal::entries_of(&journal_path(root))?;
    let made: Vec<(u32, &str)> = entries.values().filter_map(|entry| Some((entry.scene, entry.manifest()?))).collect();
    let found = Mutex::new((Verified::default(), Owned::default()));
    let failure = Mutex::new(None);
    workers.run(made.len(), &|index| {
        let (scene, digest) = made[index];
        let mut wrong = Verified::default();
        let done = scene_files(root, scene, digest, &mut wrong).map(|manifest| {
            let mut found = found.lock();
            found.1.extend(&manifest);
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
    let (mut found, mut owned) = found.into_inner();
    found.scenes = made.len() as u32;
    let end = finished(root)?;
    owned.extend(&end.manifest);
    for (path, stamp) in &end.manifest.files {
        found.look(root, path, stamp)?;
    }
    let journal = journal_path(root);
    found.unfinished = match end.journal {
        Some(digest) => !journal.exists() || Stamp::of(&journal)?.1 != digest,
        None => true,
    };
    if found.unfinished {
        // Before its first end a run has written the recipe, which is listed at the end.
        owned.0.insert(key(RESERVED[1]));
    }
    let mut foreign = Vec::new();
    each_file(root, "", &mut |path| {
        if !owned.0.contains(&key(path)) {
            foreign.push(path.to_owned());
        }
    })?;
    found.foreign = foreign;
    for list in [&mut found.missing, &mut found.damaged, &mut found.foreign] {
        list.sort_unstable();
    }
    Ok(found)
}

/// Compares the files of a scene, and returns what its manifest lists as far as that can be known.
fn scene_files(root: &Path, scene: u32, digest: &str, wrong: &mut Verified) -> Result<Manifest> {
    let path = manifest_path(root, scene);
    let name = || format!("{}/scenes/{scene:06}.json", RESERVED[0]);
    wrong.files += 1;
    let manifest = match Manifest::read(&path)? {
        Some((manifest, found)) => {
            if found != digest {
                wrong.damaged.push(name());
            }
            manifest
        }
        None => {
            if path.exists() { &mut wrong.damaged } else { &mut wrong.missing }.push(name());
            Manifest::default()
        }
    };
    for (path, stamp) in &manifest.files {
        wrong.look(root, path, stamp)?;
    }
    Ok(manifest)
}

impl Verified {
    fn look(&mut self, root: &Path, path: &str, stamp: &Stamp) -> Result<()> {
        self.files += 1;
        match stamp.check(&root.join(path))? {
            State::Whole => {}
            State::Missing => self.missing.push(path.to_owned()),
            State::Damaged => self.damaged.push(path.to_owned()),
        }
        Ok(())
    }

    fn add(&mut self, other: Self) {
        self.files += other.files;
        self.missing.extend(other.missing);
        self.damaged.extend(other.damaged);
    }
}

/// The files that manifests list, by digests of their paths: a dataset may have millions.
#[derive(Default)]
struct Owned(HashSet<u64>);

impl Owned {
    fn extend(&mut self, manifest: &Manifest) {
        self.0.extend(manifest.files.keys().filter(|path| !path.starts_with(RESERVED[0])).map(|path| key(path)));
    }
}

fn key(path: &str) -> u64 {
    Digest::of(path.as_bytes()).short()
}
