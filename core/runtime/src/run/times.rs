//! How long stages work.

use super::panics::caught;
use parking_lot::Mutex;
use serde::Serialize;
use std::collections::BTreeMap;
use std::time::Instant;
use syntable_model::error::Result;

/// How often a stage worked, and how long altogether.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Worked {
    /// Calls.
    pub calls: u64,
    /// Seconds of all calls by the clock on the wall. Calls may overlap, and a stage may use several threads.
    pub seconds: f64,
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
