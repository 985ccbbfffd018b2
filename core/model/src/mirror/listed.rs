//! The files that a store listed, in order.

use super::downloads::Downloads;
use super::outage::Outage;
use super::recent::Recent;
use super::remote_file::{Open, RemoteFile};
use crate::error::Result;
use crate::files::DatasetPath;
use crate::store::{StoreFolder, Stored};
use std::cmp::Ordering;
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

/// Orders paths folder by folder. Of two names, the first difference counts; digits there count as a number.
pub fn natural(one: &str, other: &str) -> Ordering {
    let (mut left, mut right) = (one.as_bytes(), other.as_bytes());
    while let (Some(&a), Some(&b)) = (left.first(), right.first()) {
        if a.is_ascii_digit() && b.is_ascii_digit() {
            let number = |text: &[u8]| text.iter().take_while(|byte| byte.is_ascii_digit()).count();
            let (ends, zeros) =
                ([number(left), number(right)], |text: &[u8]| text.iter().take_while(|byte| **byte == b'0').count());
            let (a, b) = (&left[zeros(left).min(ends[0])..ends[0]], &right[zeros(right).min(ends[1])..ends[1]]);
            match a.len().cmp(&b.len()).then_with(|| a.cmp(b)) {
                Ordering::Equal => (left, right) = (&left[ends[0]..], &right[ends[1]..]),
                order => return order,
            }
        } else if a == b {
            (left, right) = (&left[1..], &right[1..]);
        } else {
            // The files of a folder stay together.
            let rank = |byte: u8| if byte == b'/' { 0 } else { byte };
            return rank(a).cmp(&rank(b));
        }
    }
    left.len().cmp(&right.len()).then_with(|| one.cmp(other))
}
