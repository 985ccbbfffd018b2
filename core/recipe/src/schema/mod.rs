//! JSON Schema of recipes, for the loader, for editors and for the reference.

pub(crate) mod describe;
pub(crate) mod editor;
pub(crate) mod kinds;
pub(crate) mod lints;
pub(crate) mod shared;
