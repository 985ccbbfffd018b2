//! The tables of the merged tree: each validated and built into a stage, a pool or a section.

pub(crate) mod alternatives;
pub(crate) mod asset_names;
pub(crate) mod check;
pub(crate) mod conditions;
pub(crate) mod dataset;
pub(crate) mod ids;
pub(crate) mod loader;
pub(crate) mod mixture;
pub(crate) mod noise;
pub(crate) mod numbering;
pub(crate) mod old_names;
pub(crate) mod one_of;
pub(crate) mod placers;
pub(crate) mod pool;
pub(crate) mod references;
pub(crate) mod refusals;
pub(crate) mod remote_paths;
pub(crate) mod rig;
pub(crate) mod sections;
pub(crate) mod slot_tables;
pub(crate) mod split;
pub(crate) mod stages;
