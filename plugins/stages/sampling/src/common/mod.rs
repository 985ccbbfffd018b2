//! Shared code of samplers.

pub mod bounds;
pub mod shell;
