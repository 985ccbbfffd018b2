//! Locks of datasets for writers and readers.

use crate::run::dataset::foreign;
use crate::run::dataset::layout;
use syntable_model::error::{Error, Result};
use syntable_model::store::{Access, Hold, StoreFolder};

/// Locks a dataset for a run, or for readers while no run writes.
///
/// # Errors
/// If another run works there, or the lock is behind a link.
pub fn lock(dataset: &StoreFolder, access: Access) -> Result<Hold> {
    foreign::check_mark(dataset)?;
    let busy = || Error::new("another run is writing this dataset").in_file(dataset.name());
    dataset.lock(&layout::lock(), access)?.ok_or_else(busy)
}
