//! One tree from all texts of a recipe: what it extends, what is set from outside, variables, old names.

pub(crate) mod edit;
pub(crate) mod graph;
pub(crate) mod inherit;
pub(crate) mod overrides;
pub(crate) mod renamed;
pub(crate) mod variables;
