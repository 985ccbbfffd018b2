//! The working times of stages, and their record in a dataset.

use crate::run::dataset::{foreign, layout};
use crate::run::panics::caught;
use parking_lot::Mutex;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::time::Instant;
use syntable_model::error::Result;
use syntable_model::store::StoreFolder;

/// Number of calls of a stage, and their total time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Worked {
    /// Calls.
    pub calls: u64,
    /// Wall-clock seconds of all calls. Calls may overlap, and a stage may use several threads.
    pub seconds: f64,
}

/// A line of `.syntable/times.jsonl`: the times of a run that made or extended scenes. It is the only file of a dataset
/// that differs from run to run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RunTimes {
    /// Number of scenes that the run made, extended, or found unchanged.
    pub scenes: u32,
    /// Number of threads.
    pub threads: usize,
    /// The devices that rendered, as `syntable doctor` names them.
    pub devices: Vec<String>,
    /// Wall-clock seconds of making the scenes.
    pub seconds: f64,
    /// The working times of stages, by stage.
    pub stages: BTreeMap<String, Worked>,
}

impl RunTimes {
    /// Adds a line to the file of a dataset.
    pub(in crate::run) fn append(&self, dataset: &StoreFolder) -> Result<()> {
        let line = serde_json::to_string(self).expect("plain data") + "\n";
        dataset.append(&layout::times(), line.as_bytes())
    }

    /// The lines of a dataset's file, in order, without unreadable lines. Empty if the file is missing.
    pub fn of_dataset(dataset: impl Into<StoreFolder>) -> Result<Vec<Self>> {
        let bytes = foreign::read(&dataset.into(), &layout::times())?;
        Ok(bytes.split(|byte| *byte == b'\n').filter_map(|it| serde_json::from_slice(it).ok()).collect())
    }
}

/// The working times of the stages of a run, by the stage's name in errors: `place.objects`, `settle`, `render`,
/// `annotate.masks`.
#[derive(Debug, Default)]
pub struct Times(Mutex<BTreeMap<String, Worked>>);

impl Times {
    /// Runs a stage. A panic becomes an error, and errors name the stage.
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

    /// The times so far.
    pub fn all(&self) -> BTreeMap<String, Worked> {
        self.0.lock().clone()
    }
}
