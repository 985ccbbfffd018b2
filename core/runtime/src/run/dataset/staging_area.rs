//! The place of unfinished files: the dataset, or a temporary folder of this machine if the dataset is on another.

use crate::run::dataset::layout;
use std::io;
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;
use syntable_model::store::StoreFolder;
use tempfile::TempDir;

/// Where unfinished files are.
pub(super) enum Staging {
    /// In the dataset.
    Inside,
    /// In a folder of the dataset that one of several workers has for itself.
    Worker(DatasetPath),
    /// In a temporary folder of this machine.
    Here {
        files: StoreFolder,
        /// Removes the folder.
        _folder: TempDir,
    },
}

impl Staging {
    /// A place for the unfinished files of a dataset that the caller alone writes.
    pub fn of(dataset: &StoreFolder) -> Result<Self> {
        if dataset.is_remote() { Self::here() } else { Ok(Self::Inside) }
    }

    /// A place for the unfinished files of one of several workers.
    pub fn of_worker(dataset: &StoreFolder, worker: &str) -> Result<Self> {
        if dataset.is_remote() { Self::here() } else { Ok(Self::Worker(layout::staged(&format!("w-{worker}")))) }
    }

    fn here() -> Result<Self> {
        let fail = |error: io::Error| {
            Error::io(std::env::temp_dir(), &error).help("scenes are made there before they are uploaded: set TMPDIR")
        };
        let folder = tempfile::Builder::new().prefix("syntable-").tempdir().map_err(fail)?;
        Ok(Self::Here { files: folder.path().into(), _folder: folder })
    }
}
