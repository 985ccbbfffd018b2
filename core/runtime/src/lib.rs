//! What is done with a loaded recipe and with datasets: pools, runs, previews, samples in memory, validation, conversion. These are
//! functions that print nothing. Of plugins, only tools depend on this crate.

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
