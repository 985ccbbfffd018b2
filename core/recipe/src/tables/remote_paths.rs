//! Assets and files at URLs, which a recipe names.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use syntable_model::error::{Error, Result};
use syntable_model::mirror::Mirror;

/// The URLs that a recipe names, each listed once.
#[derive(Default)]
pub(crate) struct RemotePaths {
    known: RefCell<BTreeMap<String, Option<PathBuf>>>,
    mirrors: RefCell<Vec<Arc<Mirror>>>,
    /// Why a store did not answer. It says nothing about the recipe.
    failure: RefCell<Option<Error>>,
}

impl RemotePaths {
    /// The path on this machine of a folder or a file at a URL. None if its store does not answer, which
    /// [`finish`](Self::finish) reports.
    ///
    /// # Errors
    /// If nothing is at the URL, or it cannot be read.
    pub fn path(&self, url: &str) -> Result<Option<PathBuf>> {
        if let Some(path) = self.known.borrow().get(url) {
            return Ok(path.clone());
        }
        let path = match Mirror::open(url) {
            Ok((mirror, path)) => {
                self.mirrors.borrow_mut().push(mirror);
                Some(path)
            }
            Err(error) if !error.is_transient() => return Err(error),
            Err(error) => {
                self.failure.borrow_mut().get_or_insert(error);
                None
            }
        };
        self.known.borrow_mut().insert(url.to_owned(), path.clone());
        Ok(path)
    }

    /// The mirrors of the URLs, for the time of the recipe; or why a store did not answer.
    pub fn finish(self) -> Result<Vec<Arc<Mirror>>> {
        match self.failure.into_inner() {
            Some(failure) => Err(failure),
            None => Ok(self.mirrors.into_inner()),
        }
    }
}
