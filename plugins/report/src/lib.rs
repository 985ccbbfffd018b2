//! What a dataset is: its numbers, and pages that show it.
//!
//! | module | holds |
//! | --- | --- |
//! | [`stats`] | the numbers: Table 1 of the paper, distributions, near-duplicate views, distances between datasets |

pub mod stats;

pub use syntable_model::inventory;
