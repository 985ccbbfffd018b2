//! Operations on loaded recipes and on datasets: pools, runs, previews, samples in memory, validation, conversion.
//! These functions print nothing. Among plugins, only tools depend on this crate.

pub mod cache;
pub mod check;
pub mod conversion;
pub mod durable;
pub mod generate;
pub mod images;
pub mod left_out;
pub mod paths;
pub mod pools;
pub mod run;
pub mod validate;
pub mod workers;

pub use syntable_model::inventory;
