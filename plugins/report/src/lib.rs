//! What a dataset is: its numbers, and pages that show it.
//!
//! | module | holds |
//! | --- | --- |

pub use syntable_model::inventory;
