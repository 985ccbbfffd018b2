//! What a dataset is: its numbers, and pages that show it.
//!
//! | module | holds |
//! | --- | --- |
//! | `serve` | a server of pages for the browser of this machine |

pub mod serve;

pub use syntable_model::inventory;
