//! What stages leave out of images, added up.

use crate::run::progress::count;
use parking_lot::Mutex;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use syntable_model::context::{Log, Steps};
use syntable_model::error::Error;
use syntable_model::left_out::LeftOut;

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

/// What stages left out so far. Sums do not depend on the order of images.
#[derive(Debug, Default)]
pub struct Losses(Mutex<BTreeMap<(String, String), Loss>>);

impl Losses {
    fn add(&self, stage: &str, left_out: &LeftOut) {
        let LeftOut { what, count, of, help } = left_out;
        if *count == 0 {
            return;
        }
        let mut sums = self.0.lock();
        let sum = sums.entry((stage.to_owned(), what.to_string())).or_insert_with(|| Loss {
            stage: stage.to_owned(),
            what: what.to_string(),
            count: 0,
            of: 0,
            images: 0,
            help: help.as_ref().map(ToString::to_string),
        });
        (sum.count, sum.of, sum.images) = (sum.count + count, sum.of + of, sum.images + 1);
    }

    /// All sums, by stage.
    pub fn all(&self) -> Vec<Loss> {
        self.0.lock().values().cloned().collect()
    }
}

/// A log that adds up what a stage leaves out. Warnings go on to another log.
pub(in crate::run) struct StageLog<'a> {
    pub log: &'a dyn Log,
    pub losses: &'a Losses,
    pub stage: &'a str,
}

impl Log for StageLog<'_> {
    fn warn(&self, warning: &Error) {
        self.log.warn(warning);
    }

    fn left_out(&self, left_out: &LeftOut) {
        self.losses.add(self.stage, left_out);
    }

    fn during(&self, steps: &Steps, work: &mut dyn FnMut()) {
        self.log.during(steps, work);
    }
}
