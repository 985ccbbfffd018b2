//! The failure of a download.

use crate::error::Error;
use parking_lot::Mutex;

/// Why a file could not be downloaded, until it is reported. A reader may take the failure for damage of the file.
#[derive(Default)]
pub struct Outage(Mutex<Option<Error>>);

impl Outage {
    /// Remembers a failure that says nothing about the file.
    pub fn note(&self, error: &Error) {
        if error.is_transient() {
            self.0.lock().get_or_insert_with(|| error.clone());
        }
    }

    /// The first failure since the last call.
    pub fn take(&self) -> Option<Error> {
        self.0.lock().take()
    }
}
