//! Records of data that stages omitted from images.

use crate::run::progress::count;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use syntable_model::error::Error;

/// Data of one kind that a stage omitted from images or from the dataset's own files: a line of a verb's summary.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Loss {
    /// The stage, such as `annotate.label_arrays` or `write.coco_panoptic`.
    pub stage: String,
    /// The affected data and the reason, after the numbers: `objects lost pixels …`.
    pub what: String,
    /// Number of affected items.
    pub count: u64,
    /// Number of all items in the affected images.
    pub of: u64,
    /// Number of affected images; 0 for files of the whole dataset.
    pub images: u32,
    /// Remedy.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub help: Option<String>,
}

impl Loss {
    /// A warning for people: `write.coco_panoptic: 3 of 4 objects lost … (in 1 image)`.
    pub fn warning(&self) -> Error {
        let Self { stage, what, count: number, of, images, help } = self;
        let place = if *images == 0 { "the dataset's files".to_owned() } else { count(*images, "image") };
        let warning = Error::new(format!("{number} of {of} {what} (in {place})")).context(stage);
        match help {
            Some(help) => warning.help(help),
            None => warning,
        }
    }

    /// Sums losses with the same stage and text.
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
