//! Events of a run, and their reporters.

use crate::run::making::times::Worked;
use parking_lot::Mutex;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;
use syntable_model::context::{Log, Steps};
use syntable_model::error::Error;
use syntable_recipe::message::{Level, Message, Record};

/// An event: one line of `--log-format json`.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// The run begins.
    Started {
        /// Path of the dataset.
        out: String,
        /// Scenes that this run must make.
        scenes: u32,
        /// Views per scene.
        views_per_scene: u32,
        /// Scenes of this run that were finished before.
        resumed: u32,
        /// Images that this run must make, or whose files a new writer must write.
        images: u64,
        /// Number of threads.
        threads: usize,
    },
    /// An image was rendered and annotated.
    Image {
        /// Scene of the image.
        scene: u32,
        /// View of the image.
        view: u32,
    },
    /// A step of a scene takes longer than a second, such as the loading of its assets, or the first convex decomposition
    /// of a pool's meshes. At most one event per second.
    Working {
        /// The current step.
        step: String,
    },
    /// A scene is done.
    Scene {
        /// Number of the scene.
        scene: u32,
        /// Objects that remain on the table.
        objects: u32,
        /// Objects that were removed while the scene settled.
        removed: u32,
    },
    /// An attempt at a scene failed. If a device failed, the same attempt follows again.
    Attempt {
        /// Number of the scene.
        scene: u32,
        /// Number of the attempt, from 0.
        attempt: u32,
        /// The error.
        error: String,
        /// Whether no other attempt follows.
        last: bool,
    },
    /// A diagnostic of a recipe, an error or a warning.
    Message(Record),
    /// Information that is not a warning: a dataset grows, or was compared with its journal.
    Note {
        /// The text.
        message: String,
    },
    /// Times of the stages over all scenes. Follows the last scene.
    Stages {
        /// Times by stage, such as `place.objects`, `settle`, `render`, `annotate.masks`, `checks` or `write.syntable`.
        stages: BTreeMap<String, Worked>,
    },
    /// The run ends.
    Finished {
        /// Path of the dataset.
        out: String,
        /// Number of scenes in the dataset.
        scenes: u32,
        /// Number of failed scenes.
        failed: u32,
        /// Number of images in the dataset.
        images: u32,
        /// Number of images that this run made.
        made: u32,
        /// Number of existing scenes that got the files of new writers.
        grown: u32,
        /// Duration of the run, s.
        seconds: f64,
    },
}

/// Shows events.
pub trait Reporter: Send + Sync {
    /// Shows one event. Several threads may call this.
    fn event(&self, event: &Event);
    /// Shows an error, a warning or a diagnostic. A reporter for people may format it; the default sends an event.
    fn message(&self, message: &Message) {
        self.event(&Event::Message(Record::from(message)));
    }
}

/// Protects work from its reporter: if showing an event panics, only the event is lost.
pub struct Guarded<'a>(pub &'a dyn Reporter);
impl Reporter for Guarded<'_> {
    fn event(&self, event: &Event) {
        let _ = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| self.0.event(event)));
    }
    fn message(&self, message: &Message) {
        let _ = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| self.0.message(message)));
    }
}

/// Number of remembered messages. Later messages concern single scenes.
const REMEMBERED: usize = 1000;

/// Passes each warning and error on once.
pub struct Once<'a>(&'a dyn Reporter, Mutex<BTreeSet<String>>);

impl<'a> Once<'a> {
    /// Starts with no message seen.
    pub fn new(reporter: &'a dyn Reporter) -> Self {
        Self(reporter, Mutex::default())
    }
}

impl Reporter for Once<'_> {
    fn event(&self, event: &Event) {
        let is_new = |record: &Record| {
            let mut told = self.1.lock();
            told.len() >= REMEMBERED || told.insert(record.line())
        };
        if !matches!(event, Event::Message(record) if !is_new(record)) {
            self.0.event(event);
        }
    }
    fn message(&self, message: &Message) {
        self.0.message(message);
    }
}

/// Shows nothing.
#[derive(Debug, Default, Clone, Copy)]
pub struct Quiet;
impl Reporter for Quiet {
    fn event(&self, _: &Event) {}
}
impl Log for Quiet {
    fn warn(&self, _: &Error) {}
}

/// One line of the log: an event with its time.
#[derive(Debug, Serialize, schemars::JsonSchema)]
pub struct LogLine<'a> {
    /// Seconds since the program started.
    pub elapsed_s: f64,
    /// The event.
    #[serde(flatten)]
    pub event: std::borrow::Cow<'a, Event>,
}

/// A number and its noun: `1 scene`, `2 scenes`.
pub fn count(number: u32, what: &str) -> String {
    format!("{number} {what}{}", if number == 1 { "" } else { "s" })
}

/// A duration for people: `42 s`, `3 min 5 s`, `2 h 10 min`.
pub fn clock(duration: Duration) -> String {
    let seconds = duration.as_secs_f64().round() as u64;
    match (seconds / 3600, seconds / 60 % 60, seconds % 60) {
        (0, 0, s) => format!("{s} s"),
        (0, m, s) => format!("{m} min {s} s"),
        (h, m, _) => format!("{h} h {m} min"),
    }
}

/// A log that reports warnings, and long steps of work, as events.
pub struct Warnings<'a>(pub &'a dyn Reporter);

/// Minimum duration of reported work, and minimum interval between reports.
const PATIENCE: Duration = Duration::from_secs(1);

impl Log for Warnings<'_> {
    fn warn(&self, warning: &Error) {
        self.0.event(&Event::Message(Record::of(Level::Warning, warning)));
    }

    fn during(&self, steps: &Steps, work: &mut dyn FnMut()) {
        let (done, waiting) = channel::<()>();
        std::thread::scope(|threads| {
            threads.spawn(move || {
                let mut told = None;
                while waiting.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout) {
                    let latest = steps.latest();
                    if latest != told
                        && let Some(step) = latest.clone()
                    {
                        self.0.event(&Event::Working { step });
                    }
                    told = latest;
                }
            });
            // A panic of the work drops this guard, too.
            let _done = done;
            work();
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default)]
    struct Heard(Mutex<Vec<String>>);
    impl Reporter for Heard {
        fn event(&self, event: &Event) {
            if let Event::Working { step } = event {
                self.0.lock().push(step.clone());
            }
        }
    }

    #[test]
    fn work_is_told_when_it_takes_long() {
        let heard = Heard::default();
        let work = |all: &[(&str, f64)]| {
            let steps = Steps::default();
            Warnings(&heard).during(&steps, &mut || {
                for (step, seconds) in all {
                    steps.begin((*step).to_owned());
                    std::thread::sleep(PATIENCE.mul_f64(*seconds));
                }
            });
        };
        work(&[("quick", 0.1)]);
        assert!(heard.0.lock().is_empty());
        // Each is reported once, whatever its duration.
        work(&[("first", 0.3), ("second", 2.2), ("third", 1.0)]);
        assert_eq!(*heard.0.lock(), ["second", "third"]);
    }

    #[test]
    fn a_panic_of_work_is_passed_on() {
        let panics = || Warnings(&Quiet).during(&Steps::default(), &mut || panic!("inside"));
        assert!(crate::run::panics::quiet(|| std::panic::catch_unwind(std::panic::AssertUnwindSafe(panics))).is_err());
    }
}
