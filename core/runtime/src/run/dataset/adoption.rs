//! A scene of another folder becomes one of the dataset: of a part to merge, or the first scene of a new dataset.

use crate::run::dataset::folder::Folder;
use crate::run::dataset::journal::{Journal, JournalEntry};
use crate::run::dataset::layout;
use crate::run::dataset::manifest::{FileState, Files, Manifest, Written};
use parking_lot::Mutex;
use syntable_model::error::{Error, Result};

impl Folder {
    /// Copies a scene of a part into the dataset.
    pub fn adopt(&self, part: &Self, entry: &JournalEntry, journal: &Mutex<Journal>) -> Result<()> {
        let files = part.files();
        let damaged = |path: &str| {
            Error::new("this file of the part is damaged")
                .in_file(files.name_of(path))
                .help("a run with `options.repair`, the part's recipe and folder makes the scene again")
        };
        let staged = self.stage(entry.scene)?;
        let (mut written, mut known) = (Written::new(), Files::new());
        if let Some(digest) = entry.manifest() {
            let path = layout::manifest(entry.scene);
            let Some((manifest, found)) = Manifest::read(files, &path)? else { return Err(damaged(&path)) };
            if found != digest {
                return Err(damaged(&path));
            }
            for (inside, stamp) in &manifest.files {
                match stamp.check_in(files, inside)? {
                    FileState::Whole => {}
                    FileState::Linked => {
                        return Err(Error::new("the path leads through a link, and `merge` follows no links in parts")
                            .in_file(files.name_of(inside))
                            .help("replace the link by the file, as `cp -rL` does"));
                    }
                    FileState::Missing | FileState::Damaged => return Err(damaged(inside)),
                }
                // A link to a file that was just compared is not read again.
                if staged.copy(files, inside, inside)? {
                    known.insert(inside.clone(), *stamp);
                }
            }
            written = manifest.writers;
        }
        let merged = self.commit_known(entry.clone(), Manifest::default(), written, &known, journal)?;
        if merged == *entry { Ok(()) } else { Err(damaged("")) }
    }
}

/// A scene in a folder of its own, inside the dataset's.
pub struct FirstScene {
    /// The folder.
    pub folder: Folder,
    /// The line of the scene in the folder's journal.
    pub entry: JournalEntry,
}

impl FirstScene {
    /// Moves the scene into the dataset.
    pub fn adopt(self, folder: &Folder, journal: &Mutex<Journal>) -> Result<()> {
        folder.adopt(&self.folder, &self.entry, journal)?;
        drop(self.folder);
        folder.files().remove_all(&layout::first_scene())
    }
}
