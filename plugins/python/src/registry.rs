//! Everything that recipes can name: the stages that are linked, and the stages that Python adds.

use crate::errors::exception;
use parking_lot::Mutex;
use pyo3::prelude::*;
use syntable_model::error::Error;
use syntable_model::registry::{Entry, Registry};

/// The stages that Python has added, in order.
static ADDED: Mutex<Vec<Entry>> = Mutex::new(Vec::new());

/// The registry of this moment.
///
/// # Errors
/// If two stages have the same name.
pub fn registry(py: Python<'_>) -> PyResult<Registry> {
    whole().map_err(|clash| exception(py, &Error::new(clash)))
}

/// The same without Python.
///
/// # Errors
/// If two stages have the same name.
pub fn whole() -> Result<Registry, String> {
    ADDED.lock().iter().cloned().try_fold(Registry::linked()?, Registry::with)
}

/// Adds a stage. It replaces one that Python added under the same name, so that a cell of a notebook can run again.
pub fn add(entry: Entry) {
    let mut added = ADDED.lock();
    let old = added.iter().position(|other| (other.slot, other.kind) == (entry.slot, entry.kind));
    let old = old.map(|at| added.remove(at));
    added.push(entry);
    drop(added);
    // The end of a Python object may run any code.
    drop(old);
}
