//! The one rule for omitted data: a function lists what its result omits, and the verb ends with exit code 3.

use crate::run::progress::count;
use crate::run::{Loss, not_listed};
use std::path::Path;
use syntable_model::error::Error;
use syntable_model::left_out::LeftOut;
use syntable_model::reader::OpenDataset;
use syntable_model::words::SHOWN;
use syntable_recipe::message::Message;

/// Data that a function omitted from its result, for people to read.
#[derive(Debug, Clone, Default)]
pub struct LeftOutReport {
    warnings: Vec<Error>,
    summaries: Vec<String>,
}

impl LeftOutReport {
    /// Adds omitted data: a summary such as `3 images left out as unreadable`, and a warning for each
    /// item or for the first few.
    pub fn add(&mut self, summary: String, warnings: impl IntoIterator<Item = Error>) {
        self.warnings.extend(warnings);
        self.summaries.push(summary);
    }

    /// Adds images that the dataset does not list because files that hold or name them cannot be read.
    pub fn unlisted(&mut self, dataset: &OpenDataset) {
        let lost: Vec<String> = not_listed(dataset);
        if !lost.is_empty() {
            let summary = format!("{} left out as unreadable", count(lost.len() as u32, "part"));
            self.add(summary, lost.into_iter().take(SHOWN).map(Error::new));
        }
    }

    /// Adds annotations that the reader did not turn into objects.
    pub fn annotations(&mut self, not_objects: &[LeftOut]) {
        let some: Vec<&LeftOut> = not_objects.iter().filter(|it| it.count > 0).collect();
        if !some.is_empty() {
            let number = some.iter().map(|it| it.count).sum::<u64>();
            let summary = format!("{} left out or incomplete", count(number as u32, "annotation"));
            self.add(summary, some.into_iter().map(|it| Error::new(it.to_string())));
        }
    }

    /// Adds data that stages omitted from images.
    pub fn losses(&mut self, losses: &[Loss]) {
        if !losses.is_empty() {
            let mut stages: Vec<&str> = losses.iter().map(|loss| loss.stage.as_str()).collect();
            stages.dedup();
            let summary = format!("data are written incompletely by {}", stages.join(", "));
            self.add(summary, losses.iter().map(Loss::warning));
        }
    }

    /// The warnings, then one error with all summaries; empty if nothing was omitted. `help` tells the reader where to
    /// look.
    pub fn messages(self, file: &Path, help: &str) -> Vec<Message> {
        let Self { warnings, summaries } = self;
        let error = Error::new(summaries.join("; ")).in_file(file).help(help);
        let error = (!summaries.is_empty()).then_some(Message::Error(error));
        warnings.into_iter().map(Message::Warning).chain(error).collect()
    }

    /// Whether the result is complete.
    pub fn is_empty(&self) -> bool {
        self.summaries.is_empty()
    }
}
