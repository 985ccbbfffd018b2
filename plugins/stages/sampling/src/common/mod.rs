//! What several samplers share.

pub mod bounds;
pub mod shell;
