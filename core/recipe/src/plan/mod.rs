//! The resolver: the provider of each product, and the products that the writers of a recipe need.
//!
//! The renderer or a stage of the recipe provides a product, or else the one registered sensor or annotator that provides it
//! with its default options. A stage may replace a product: all other stages then read the new one, and the original keeps a
//! key of its own. Gaps, ambiguities, cycles and products that a writer cannot store are errors before anything runs. `check`,
//! `plan`, `list` and `run` all use this resolver.
//!
//! Writers name products by text. The resolver turns each text into a
//! [`ProductId`](syntable_model::product::ProductId) once; from there on, products are
//! compared by their identities.

mod error;
pub mod memory;
pub(crate) mod of_tables;
mod planned;
mod producer;
mod resolver;
mod table;

pub use error::{PlanError, PlanFault};
pub use planned::{Idle, Plan, PlanEntry, Provider};
pub use producer::{Candidate, Implied, PlannedStage, Producer, available, registered};
pub use resolver::{Offers, resolve};
pub use table::{table, table_within};

#[cfg(test)]
mod tests;
