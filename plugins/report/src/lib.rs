//! What a dataset is: its numbers, and pages that show it.
//!
//! | module | holds |
//! | --- | --- |
//! | `preview` | `syntable preview`: an edit of a recipe in images, within seconds |
//! | `serve` | a server of pages for the browser of this machine |

mod preview;
pub mod serve;

pub use syntable_model::inventory;
