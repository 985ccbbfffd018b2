//! The dataset on disk: its folder, its journal, the manifests of its files, and what a run keeps for the next one.

pub mod folder;
pub(crate) mod foreign;
pub(crate) mod inside;
pub mod journal;
pub(crate) mod loss;
pub(crate) mod manifest;
pub(crate) mod records;
pub(crate) mod settled;
pub(crate) mod verify;
