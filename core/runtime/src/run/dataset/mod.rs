//! A dataset in its store: its folder, its journal, the manifests of its files, and data for later runs.

pub(crate) mod adoption;
pub(crate) mod claims;
mod commit;
pub mod draws;
pub(crate) mod ending;
pub mod folder;
pub(crate) mod foreign;
pub mod journal;
pub mod layout;
pub(crate) mod locking;
pub(crate) mod loss;
pub(crate) mod manifest;
mod proposal;
pub(crate) mod read_ahead;
pub(crate) mod records;
mod recovery;
mod requests;
pub(crate) mod scene_files;
pub(crate) mod settled;
mod staging;
mod staging_area;
#[cfg(test)]
mod tests;
pub(crate) mod vanished;
pub(crate) mod verify;
