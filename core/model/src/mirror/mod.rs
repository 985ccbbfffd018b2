//! Datasets at URLs, for readers that open paths of this machine.
//!
//! A [`Mirror`] is a folder with the names of the files below a URL, as the store lists them once. Its files are empty. Readers look
//! up names in it as in any folder, and open files with [`DatasetFile`], which gets the content from the store:
//!
//! | file | does |
//! |---|---|
//! | `downloads.rs` | complete files, kept on this machine between runs within a budget |
//! | `remote_file.rs` | a file of a store, which is downloaded when it is opened or read |
//! | `blocks.rs` | the blocks of a large file that were downloaded so far |
//! | `recent.rs` | the large files that were opened last |
//! | `outage.rs` | the failure of a download, which a reader may take for damage |
//! | `listed.rs` | the files that the store listed, in order |
//! | `ahead.rs` | downloads of the files that follow the file that was opened |
//! | `names.rs` | the folder of names, and the mirror that a path is in |
//! | `dataset_file.rs` | a file that is read, of this machine or of a mirror |

mod ahead;
mod blocks;
mod dataset_file;
mod downloads;
mod listed;
mod names;
mod outage;
mod recent;
mod remote_file;
#[cfg(test)]
mod tests;

pub use dataset_file::DatasetFile;
pub use names::{Mirror, store_at};
