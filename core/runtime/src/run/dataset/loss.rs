//! The record of what stages left out of images.

use crate::run::progress::count;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use syntable_model::error::Error;

/// What stages left out of images, of one kind: a line of a verb's summary.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Loss {
    /// The stage, such as `annotate.label_arrays` or `write.coco_panoptic`.
    pub stage: String,
    /// What it happened to and why, after the numbers: `objects lost pixels …`.
    pub what: String,
    /// How many.
    pub count: u64,
    /// Of how many in these images.
    pub of: u64,
    /// Number of images that something was left out of; the others count nowhere.
    pub images: u32,
    /// What the user can do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub help: Option<String>,
}

impl Loss {
    /// A warning for people: `write.coco_panoptic: 3 of 4 objects lost … (in 1 image)`.
    pub fn warning(&self) -> Error {
        let Self { stage, what, count: number, of, images, help } = self;
        let warning = Error::new(format!("{number} of {of} {what} (in {})", count(*images, "image"))).context(stage);
        match help {
            Some(help) => warning.help(help),
            None => warning,
        }
    }

    /// Adds up those of the same stage that say the same.
    pub fn sum(all: impl IntoIterator<Item = Self>) -> Vec<Self> {
        let mut sums: BTreeMap<(String, String), Self> = BTreeMap::new();
        for loss in all {
            let key = (loss.stage.clone(), loss.what.clone());
            match sums.get_mut(&key) {
                Some(sum) => {
                    (sum.count, sum.of, sum.images) =
                        (sum.count + loss.count, sum.of + loss.of, sum.images + loss.images);
                }
                None => drop(sums.insert(key, loss)),
            }
        }
        sums.into_values().collect()
    }
}
