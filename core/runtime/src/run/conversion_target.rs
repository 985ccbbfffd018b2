//! Where a conversion writes: nothing of it stays after an error.

use crate::durable::{self, Draft, Standing};
use crate::run::dataset::layout;
use std::path::Path;
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;
use syntable_model::store::{FsStore, StoreFolder};

/// The unfinished result of a conversion. Dropping it removes the files that were written.
pub enum ConversionTarget {
    /// A draft beside a folder of this machine. The folder appears when the draft is published.
    Folder(Draft),
    /// A store without a folder on this machine, such as memory. Its files appear one by one.
    Store(Unfinished),
}

/// A store that had no files before the conversion.
pub struct Unfinished(Option<StoreFolder>);

impl ConversionTarget {
    /// Begins the output, which must be new or empty.
    pub fn begin(out: &StoreFolder) -> Result<Self> {
        match out.local() {
            Some(folder) => begin_folder(&folder).map(Self::Folder),
            None => {
                out.prepare()?;
                if !out.list("")?.is_empty() {
                    return Err(not_empty(&out.name()));
                }
                Ok(Self::Store(Unfinished(Some(out.clone()))))
            }
        }
    }

    /// The folder to write files into.
    pub fn files(&self) -> StoreFolder {
        match self {
            Self::Folder(draft) => draft.folder().into(),
            Self::Store(Unfinished(store)) => store.clone().expect("it is taken when the target is consumed"),
        }
    }

    /// Keeps the files, without the inputs of `finish`: these serve a resumed run, and a conversion starts again.
    pub fn publish(self) -> Result<()> {
        self.files().remove_all(&layout::mark())?;
        match self {
            Self::Folder(draft) => draft.publish(),
            Self::Store(mut unfinished) => {
                unfinished.0 = None;
                Ok(())
            }
        }
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        let Some(store) = &self.0 else { return };
        // The error that ends the conversion is the one to report.
        for (name, _) in store.list("").unwrap_or_default() {
            let _ = DatasetPath::new(name).map(|path| store.remove_all(&path));
        }
    }
}

fn begin_folder(out: &Path) -> Result<Draft> {
    FsStore::new(out).check_link()?;
    if durable::standing(out)? == Standing::Free {
        return Draft::begin(out);
    }
    if out.is_file() {
        return Err(Error::new("the output folder is a file").in_file(out).help("choose a new or empty folder"));
    }
    // A conversion that was killed in its last step leaves the whole dataset and a temporary file.
    let _ = durable::mend(out);
    Err(not_empty(out))
}

fn not_empty(out: &Path) -> Error {
    Error::new("the output folder is not empty").in_file(out).help("choose another folder; no file was changed")
}
