//! Sums of the data that stages omitted.

use crate::run::dataset::loss::Loss;
use parking_lot::Mutex;
use std::collections::BTreeMap;
use syntable_model::context::{DatasetContext, Log, Steps};
use syntable_model::error::Error;
use syntable_model::left_out::LeftOut;

/// Sums of the omitted data so far. They do not depend on the order of images.
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

/// Passes a dataset to the stages that run once for it, and sums the data that they omit.
pub struct DatasetLender<'a> {
    cx: DatasetContext<'a>,
    losses: Losses,
}

impl<'a> DatasetLender<'a> {
    pub fn new(cx: DatasetContext<'a>) -> Self {
        Self { cx, losses: Losses::default() }
    }

    /// Runs a stage on the dataset.
    pub fn lend<T>(&self, stage: &str, work: impl FnOnce(&DatasetContext) -> T) -> T {
        let log = StageLog { log: self.cx.log, losses: &self.losses, stage };
        let mut cx = self.cx;
        cx.log = &log;
        work(&cx)
    }

    /// The sums of all stages.
    pub fn losses(&self) -> Vec<Loss> {
        self.losses.all().into_iter().map(|loss| Loss { images: 0, ..loss }).collect()
    }
}

/// A log that sums the data that a stage omits, and passes warnings on to another log.
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
