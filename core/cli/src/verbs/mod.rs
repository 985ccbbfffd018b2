//! The verbs of runs, recipes and datasets, one per file.

pub(crate) mod check;
pub(crate) mod convert;
pub(crate) mod doctor;
mod jobs;
pub(crate) mod list;
pub(crate) mod merge;
pub(crate) mod new;
pub(crate) mod plan;
pub(crate) mod run;
pub(crate) mod status;
mod template;
pub(crate) mod validate;
pub(crate) mod verify;
