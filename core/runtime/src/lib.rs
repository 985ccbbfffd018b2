//! Recipes, plans, runs and the command line of SynTable. Of plugins, only those that add a verb depend on this crate.

pub mod cache;
pub mod check;
pub mod conversion;
pub mod durable;
pub mod generate;
pub mod images;
pub mod left_out;
pub mod memory;
pub mod message;
pub mod paths;
pub mod plan;
pub mod pools;
mod ready;
pub mod recipe;
pub mod run;
pub mod validate;
pub mod workers;

pub use syntable_model::inventory;
