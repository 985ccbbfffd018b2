//! Locks of datasets for writers and readers.

use crate::run::dataset::claims;
use crate::run::dataset::foreign;
use crate::run::dataset::layout;
use std::io::{self, ErrorKind};
use std::thread;
use std::time::Duration;
use syntable_model::error::{Error, Result};
use syntable_model::store::{Access, Hold, StoreFolder};

/// Locks a dataset for a run, or for readers while no run writes.
///
/// # Errors
/// If another run works there, or the lock is behind a link.
pub fn lock(dataset: &StoreFolder, access: Access) -> Result<Hold> {
    try_lock(dataset, access)?.ok_or_else(|| busy(dataset))
}

/// The error of a dataset that another run writes.
pub fn busy(dataset: &StoreFolder) -> Error {
    let busy = io::Error::new(ErrorKind::ResourceBusy, "another run is writing this dataset");
    Error::io(dataset.name(), &busy).help("wait until it has ended; a suspended run must continue or be killed")
}

/// Locks a dataset as [`lock`] does; none if another run works there.
///
/// # Errors
/// If the lock is behind a link.
pub fn try_lock(dataset: &StoreFolder, access: Access) -> Result<Option<Hold>> {
    foreign::check_mark(dataset)?;
    for attempt in 0..if dataset.is_remote() { 1 } else { ATTEMPTS } {
        if attempt > 0 {
            thread::sleep(GLANCE);
        }
        if let Some(hold) = dataset.lock(&layout::lock(), access)? {
            // Workers that share the dataset admit readers, who would see half of it.
            let is_taken = access == Access::Read && claims::are_renewed(dataset)?;
            return Ok(Some(hold).filter(|_| !is_taken));
        }
    }
    Ok(None)
}

/// Whether a run is writing a dataset now, or workers are.
pub fn is_busy(dataset: &StoreFolder) -> Result<bool> {
    foreign::check_mark(dataset)?;
    Ok(dataset.lock(&layout::lock(), Access::Read)?.is_none() || claims::are_renewed(dataset)?)
}

/// [`is_busy`] holds the lock for a moment, in which no run can take it.
const GLANCE: Duration = Duration::from_millis(20);
const ATTEMPTS: u32 = 4;
