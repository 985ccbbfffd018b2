//! The files that a store listed, in order.

use super::downloads::Downloads;
use super::outage::Outage;
use super::recent::Recent;
use super::remote_file::{Open, RemoteFile};
use crate::error::Result;
use crate::files::DatasetPath;
use crate::natural::natural;
use crate::store::{StoreFolder, Stored};
use std::sync::Arc;

/// The files below a URL.
pub struct Listed {
    store: StoreFolder,
    downloads: Arc<Downloads>,
    /// In natural order: numbers in names count by their values.
    pub files: Vec<RemoteFile>,
    recent: Recent,
    outage: Arc<Outage>,
}

impl Listed {
    pub fn new(store: StoreFolder, url: &str, list: Vec<(DatasetPath, Stored)>, downloads: Arc<Downloads>) -> Self {
        let mut files: Vec<RemoteFile> =
            list.into_iter().map(|(path, stored)| RemoteFile::new(path, &stored, url)).collect();
        files.sort_unstable_by(|one, other| natural(&one.path, &other.path));
        Self { store, downloads, files, recent: Recent::default(), outage: Arc::default() }
    }

    /// The folder at the URL.
    pub fn store(&self) -> &StoreFolder {
        &self.store
    }

    /// The number of a file.
    pub fn find(&self, path: &str) -> Option<usize> {
        self.files.binary_search_by(|file| natural(&file.path, path)).ok()
    }

    /// Whether a file is on this machine, or is too large to be downloaded before it is read.
    pub fn is_ready(&self, number: usize) -> bool {
        self.files[number].is_ready(&self.downloads)
    }

    /// Opens a file; see [`RemoteFile::open`].
    pub fn open(&self, number: usize) -> Result<Open> {
        self.files[number].open(&self.store, &self.downloads, (&self.recent, &self.outage))
    }

    /// Why a download failed, if no call has reported it yet.
    pub fn outage(&self) -> &Outage {
        &self.outage
    }

    /// Opens a file without locks; see [`RemoteFile::open_alone`].
    pub fn open_alone(&self, number: usize) -> Result<Open> {
        self.files[number].open_alone(&self.store, &self.downloads)
    }
}
