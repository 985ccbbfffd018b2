//! How long stages work, and what a dataset remembers of it.

use crate::run::dataset::{foreign, layout};
use crate::run::panics::caught;
use parking_lot::Mutex;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::time::Instant;
use syntable_model::error::Result;
use syntable_model::store::StoreFolder;

/// How often a stage worked, and how long altogether.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Worked {
    /// Calls.
    pub calls: u64,
    /// Seconds of all calls by the clock on the wall. Calls may overlap, and a stage may use several threads.
    pub seconds: f64,
}

/// A line of `.syntable/times.jsonl`: what a run that made scenes, or let them grow, took. The file is no part of what a recipe
/// makes, and the only one of a dataset that differs from run to run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RunTimes {
    /// Scenes that were made or grew.
    pub scenes: u32,
    /// Threads.
    pub threads: usize,
    /// What rendered, as `syntable doctor` names it.
    pub devices: Vec<String>,
    /// Seconds of making the scenes by the clock on the wall.
    pub seconds: f64,
    /// The work of stages, by stage.
    pub stages: BTreeMap<String, Worked>,
}

impl RunTimes {
    /// Adds a line to the file of a dataset.
    pub(in crate::run) fn append(&self, dataset: &StoreFolder) -> Result<()> {
        let line = serde_json::to_string(self).expect("plain data") + "\n";
        dataset.append(&layout::times(), line.as_bytes())
    }

    /// The lines of a dataset's file, in order; none if there is no file. A line that cannot be read is left out.
    pub fn of_dataset(dataset: impl Into<StoreFolder>) -> Result<Vec<Self>> {
        let bytes = foreign::read(&dataset.into(), &layout::times())?;
        Ok(bytes.split(|byte| *byte == b'\n').filter_map(|it| serde_json::from_slice(it).ok()).collect())
    }
}

/// The work of the stages of a run, by stage as errors name it: `place.objects`, `settle`, `render`, `annotate.masks`.
#[derive(Debug, Default)]
pub struct Times(Mutex<BTreeMap<String, Worked>>);

impl Times {
    /// Runs a stage; a panic becomes an error, and errors say where they are from.
    pub fn of<T>(&self, stage: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
        let start = Instant::now();
        let result = caught(stage, work);
        let seconds = start.elapsed().as_secs_f64();
        let mut stages = self.0.lock();
        match stages.get_mut(stage) {
            Some(worked) => (worked.calls, worked.seconds) = (worked.calls + 1, worked.seconds + seconds),
            None => drop(stages.insert(stage.to_owned(), Worked { calls: 1, seconds })),
        }
        result
    }

    /// What was measured.
    pub fn all(&self) -> BTreeMap<String, Worked> {
        self.0.lock().clone()
    }
}
