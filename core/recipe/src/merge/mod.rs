//! Merges all texts of a recipe into one tree: extended recipes, overrides, variables, old names.

pub(crate) mod edit;
pub(crate) mod graph;
pub(crate) mod inherit;
pub(crate) mod overrides;
pub(crate) mod renamed;
pub(crate) mod variables;
