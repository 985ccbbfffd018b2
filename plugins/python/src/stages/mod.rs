//! Stages in Python: kinds that the running process adds to those that are linked.
//!
//! A decorator of `syntable.stages` checks a function or a class, and registers it here. The library builds a stage from the
//! options in a recipe, and calls it on its own threads, which are attached to Python for the call only.

mod annotator;
mod asset_source;
mod call;
mod kind;
mod light;
mod placer;
mod product;
mod scene;
mod writer;

pub use annotator::{add_annotator, add_sensor};
pub use asset_source::add_asset_source;
pub use call::{Interrupts, are_abandoned, end_calls, give_up};
pub use light::add_light;
pub use placer::{SceneAssets, add_placer};
pub use product::missing_product;
pub use writer::{FinishedDataset, SceneOutput, add_writer};
