//! Texts of recipes: where they come from, how they are parsed, and messages that point into them.

pub(crate) mod code;
pub(crate) mod diagnostic;
pub(crate) mod fix;
pub(crate) mod key_path;
pub mod message;
pub(crate) mod origin;
pub(crate) mod parse;
pub(crate) mod report;
pub(crate) mod source;
pub(crate) mod suggest;
