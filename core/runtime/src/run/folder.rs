//! The dataset's folder: what is staged, what is committed, and who may write.
//!
//! ```text
//! <dataset>/recipe.toml                 the resolved recipe; running it again gives the same dataset
//! <dataset>/.syntable/lock              held while a run works
//! <dataset>/.syntable/journal.jsonl     one line per scene that is done
//! <dataset>/.syntable/shards/<writer>/  what `finish` merges, one file per scene
//! <dataset>/.syntable/staging/3.part/   a scene in the making
//! <dataset>/.syntable/staging/3.ready/  a scene whose files are being moved into place
//! ```

use super::journal::{Journal, JournalEntry};
use crate::recipe::without_asset_digests;
use parking_lot::Mutex;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use syntable_model::error::{Error, Result};
use syntable_model::stage::RESERVED;

/// An open dataset folder. No other run can open it meanwhile.
pub struct Folder {
    root: PathBuf,
    _lock: File,
}

const MARK: &str = RESERVED[0];
/// Line of the journal of a staged scene, among files that no writer can write.
const RECORD: &str = RESERVED[1];

impl Folder {
    /// Opens a folder for the dataset of a resolved recipe: a new or empty one, or one in which a run of the same
    /// recipe was begun. With `overwrite`, a dataset that is there is deleted first.
    pub fn open(root: &Path, resolved: &str, overwrite: bool) -> Result<Self> {
        let fail = |error: std::io::Error| {
            use std::io::ErrorKind::{QuotaExceeded, StorageFull};
            let full = matches!(error.kind(), StorageFull | QuotaExceeded);
            let failed = Error::io(root, &error).help("choose a folder that can be written with --out");
            if full { failed } else { failed.of_request() }
        };
        fs::create_dir_all(root).map_err(fail)?;
        let empty = fs::read_dir(root).map_err(fail)?.next().is_none();
        if !empty && !root.join(MARK).is_dir() {
            return Err(Error::new("the folder is not empty and holds no dataset")
                .in_file(root)
                .help("choose another folder with --out; nothing was touched")
                .of_request());
        }
        fs::create_dir_all(root.join(MARK)).map_err(fail)?;
        let lock_path = root.join(MARK).join("lock");
        let lock = File::create(&lock_path).map_err(|error| Error::io(&lock_path, &error))?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(fs::TryLockError::WouldBlock) => {
                return Err(Error::new("another run is writing this dataset").in_file(root));
            }
            Err(fs::TryLockError::Error(error)) => {
                return Err(Error::io(&lock_path, &error)
                    .help("the file system must lock files: choose a folder on another one with --out")
                    .of_request());
            }
        }
        let folder = Self { root: root.to_owned(), _lock: lock };
        if overwrite {
            folder.clear()?;
        }
        let recipe = folder.recipe();
        match fs::read_to_string(&recipe) {
            Ok(present) if without_asset_digests(&present) == without_asset_digests(resolved) => {}
            Ok(_) => {
                return Err(Error::new("the folder holds a dataset of another recipe")
                    .in_file(root)
                    .help("choose another folder with --out, or delete the old dataset with --overwrite")
                    .of_request());
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => folder.write(&recipe, resolved)?,
            Err(error) => return Err(Error::io(&recipe, &error)),
        }
        folder.recover()?;
        Ok(folder)
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Path of the resolved recipe.
    pub fn recipe(&self) -> PathBuf {
        self.root.join(RESERVED[2])
    }

    /// Path of the journal.
    pub fn journal(&self) -> PathBuf {
        self.root.join(MARK).join("journal.jsonl")
    }

    /// An empty folder to make a scene in.
    pub fn stage(&self, scene: u32) -> Result<PathBuf> {
        let part = self.staging().join(format!("{scene}.part"));
        remove(&part)?;
        fs::create_dir_all(&part).map_err(|error| Error::io(&part, &error))?;
        Ok(part)
    }

    /// Moves the files of a staged scene into place and writes it down. Interrupted anywhere, the next
    /// [`open`](Self::open) either finishes the job or finds nothing of the scene.
    pub fn commit(&self, entry: JournalEntry, journal: &Mutex<Journal>) -> Result<()> {
        let part = self.staging().join(format!("{}.part", entry.scene));
        let ready = self.staging().join(format!("{}.ready", entry.scene));
        self.write(&part.join(RECORD), &serde_json::to_string(&entry).expect("an entry is plain data"))?;
        sync_tree(&part)?;
        remove(&ready)?;
        fs::rename(&part, &ready).map_err(|error| Error::io(&part, &error))?;
        self.publish(&ready, entry, &mut journal.lock())
    }

    /// Drops a staged scene.
    pub fn abandon(&self, scene: u32) -> Result<()> {
        remove(&self.staging().join(format!("{scene}.part")))
    }

    /// Ends a run: nothing is staged any more, and the recipe names the digests of all assets.
    pub fn finish(&self, resolved: &str) -> Result<()> {
        remove(&self.staging())?;
        self.write(&self.recipe(), resolved)
    }

    /// Finishes the scenes that were being moved into place when a run was killed, and drops half-made ones.
    fn recover(&self) -> Result<()> {
        let staging = self.staging();
        let entries = match fs::read_dir(&staging) {
            Ok(entries) => entries,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(Error::io(&staging, &error)),
        };
        let mut journal = Journal::open(&self.journal())?;
        for entry in entries {
            let ready = entry.map_err(|error| Error::io(&staging, &error))?.path();
            if ready.extension().is_some_and(|extension| extension == "ready")
                && let Ok(text) = fs::read_to_string(ready.join(RECORD))
                && let Ok(entry) = serde_json::from_str::<JournalEntry>(&text)
            {
                self.publish(&ready, entry, &mut journal)?;
            }
        }
        remove(&staging)
    }

    fn staging(&self) -> PathBuf {
        self.root.join(MARK).join("staging")
    }

    /// The record is the last to go, so that an interrupted move can be taken up again.
    fn publish(&self, ready: &Path, entry: JournalEntry, journal: &mut Journal) -> Result<()> {
        move_tree(ready, &self.root, Some(RECORD))?;
        if !journal.entries().contains_key(&entry.scene) {
            journal.append(entry)?;
        }
        remove(ready)
    }

    fn clear(&self) -> Result<()> {
        for entry in fs::read_dir(&self.root).map_err(|error| Error::io(&self.root, &error))? {
            let path = entry.map_err(|error| Error::io(&self.root, &error))?.path();
            if path.file_name() != Some(MARK.as_ref()) {
                remove(&path)?;
            }
        }
        let mark = self.root.join(MARK);
        for entry in fs::read_dir(&mark).map_err(|error| Error::io(&mark, &error))? {
            let path = entry.map_err(|error| Error::io(&mark, &error))?.path();
            if path.file_name() != Some("lock".as_ref()) {
                remove(&path)?;
            }
        }
        Ok(())
    }

    fn write(&self, path: &Path, text: &str) -> Result<()> {
        let part = path.with_extension("part");
        let fail = |error: std::io::Error| Error::io(path, &error);
        fs::write(&part, text).map_err(fail)?;
        File::open(&part).and_then(|file| file.sync_all()).map_err(fail)?;
        fs::rename(&part, path).map_err(fail)
    }
}

/// Removes a file or folder, if it is there.
fn remove(path: &Path) -> Result<()> {
    let removed = match fs::symlink_metadata(path) {
        Ok(metadata) if metadata.is_dir() => fs::remove_dir_all(path),
        Ok(_) => fs::remove_file(path),
        Err(error) => Err(error),
    };
    match removed {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(Error::io(path, &error)),
        _ => Ok(()),
    }
}

/// Moves the files of a folder to the same places below another, replacing what is there; `keep` stays.
fn move_tree(from: &Path, to: &Path, keep: Option<&str>) -> Result<()> {
    fs::create_dir_all(to).map_err(|error| Error::io(to, &error))?;
    for entry in fs::read_dir(from).map_err(|error| Error::io(from, &error))? {
        let entry = entry.map_err(|error| Error::io(from, &error))?;
        let (source, target) = (entry.path(), to.join(entry.file_name()));
        if source.is_dir() {
            move_tree(&source, &target, None)?;
        } else if keep.is_none_or(|keep| entry.file_name() != keep) {
            fs::rename(&source, &target).map_err(|error| Error::io(&target, &error))?;
        }
    }
    Ok(())
}

/// Brings the files of a folder to disk.
fn sync_tree(folder: &Path) -> Result<()> {
    for entry in fs::read_dir(folder).map_err(|error| Error::io(folder, &error))? {
        let path = entry.map_err(|error| Error::io(folder, &error))?.path();
        if path.is_dir() {
            sync_tree(&path)?;
        } else {
            File::open(&path).and_then(|file| file.sync_data()).map_err(|error| Error::io(&path, &error))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::journal::SceneOutcome;
    use super::*;

    #[test]
    fn foreign_folders_are_left_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        fs::write(folder.path().join("thesis.tex"), "precious").expect("writable");
        for overwrite in [false, true] {
            let error = Folder::open(folder.path(), "", overwrite).err().expect("foreign").to_string();
            assert!(error.contains("nothing was touched"), "{error}");
        }
        assert!(folder.path().join("thesis.tex").exists());
    }

    #[test]
    fn one_run_at_a_time_and_one_recipe_a_folder() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path().join("data");
        let open = Folder::open(&root, "a = 1\n", false).expect("new");
        assert!(Folder::open(&root, "a = 1\n", false).err().expect("locked").to_string().contains("another run"));
        drop(open);
        assert!(Folder::open(&root, "a = 2\n", false).err().expect("other").to_string().contains("another recipe"));
        let open = Folder::open(&root, "a = 1\n", false).expect("the same");
        open.finish("a = 1\n\n[lock.assets]\n\"p/x\" = \"00\"\n").expect("writable");
        drop(open);
        Folder::open(&root, "a = 1\n", false).expect("digests do not count");
        Folder::open(&root, "a = 2\n", true).expect("overwritten");
    }

    fn entry(scene: u32) -> JournalEntry {
        let outcome = SceneOutcome::Made { views: 1, objects: 1 };
        JournalEntry { scene, attempt: 0, outcome, errors: Vec::new(), assets: Default::default() }
    }

    fn staged(open: &Folder, scene: u32) -> PathBuf {
        let staged = open.stage(scene).expect("staged");
        fs::create_dir_all(staged.join("rgb")).expect("writable");
        fs::write(staged.join("rgb/3.png"), "x").expect("writable");
        fs::write(staged.join("info.txt"), "y").expect("writable");
        staged
    }

    #[test]
    fn a_scene_appears_whole() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path().join("data");
        let open = Folder::open(&root, "", false).expect("new");
        staged(&open, 3);
        assert!(!root.join("rgb").exists());
        let journal = Mutex::new(Journal::open(&open.journal()).expect("new"));
        open.commit(entry(3), &journal).expect("committed");
        assert_eq!(fs::read_to_string(root.join("rgb/3.png")).expect("there"), "x");
        assert!(!root.join(".syntable/staging/3.ready").exists() && !root.join(RECORD).exists());
        assert!(Journal::open(&open.journal()).expect("there").entries().contains_key(&3));
    }

    #[test]
    fn a_move_that_was_interrupted_is_finished() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path().join("data");
        let open = Folder::open(&root, "", false).expect("new");
        let ready = staged(&open, 3);
        fs::write(ready.join(RECORD), serde_json::to_string(&entry(3)).expect("plain")).expect("writable");
        // One file was moved, then the program was killed; another scene was half made.
        fs::rename(ready.join("info.txt"), root.join("info.txt")).expect("moved");
        fs::rename(&ready, open.staging().join("3.ready")).expect("moved");
        staged(&open, 4);
        drop(open);
        let open = Folder::open(&root, "", false).expect("again");
        assert!(root.join("rgb/3.png").exists() && root.join("info.txt").exists() && !open.staging().exists());
        let scenes: Vec<u32> = Journal::open(&open.journal()).expect("there").entries().keys().copied().collect();
        assert_eq!(scenes, [3]);
    }
}
