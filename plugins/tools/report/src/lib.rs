//! Statistics of datasets, and pages that show them.
//!
//! | module | holds |
//! | --- | --- |
//! | `preview` | `syntable preview`: shows an edit of a recipe in images, within seconds |
//! | [`report`] | pages that show a dataset, as a folder |
//! | [`serve`] | a server of pages for the browser of this machine |
//! | [`stats`] | the numbers: Table 1 of the paper, distributions, near-duplicate views, distances between datasets |
//! | [`view`] | the pages of a dataset, served |

pub mod preview;
pub mod report;
pub mod serve;
pub mod stats;
pub mod view;

pub use syntable_model::inventory;
