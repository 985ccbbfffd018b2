//! The events of a run, and who listens to them.

use crate::run::making::times::Worked;
use parking_lot::Mutex;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;
use syntable_model::context::{Log, Steps};
use syntable_model::error::Error;
use syntable_recipe::message::{Level, Message, Record};

/// Something that happened: one line of `--log-format json`.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// The run begins.
    Started {
        /// Where the dataset is written.
        out: String,
        /// Scenes that this run is to make.
        scenes: u32,
        /// Views of each.
        views_per_scene: u32,
        /// Scenes of this run that were done before.
        resumed: u32,
        /// Images that this run is to make, or whose files a new writer lacks.
        images: u64,
        /// Threads.
        threads: usize,
    },
    /// An image was rendered and annotated.
    Image {
        /// Its scene.
        scene: u32,
        /// Its view.
        view: u32,
    },
    /// A part of a scene takes longer than a second, such as the convex decomposition of a pool's meshes when they are first
    /// used. At most one a second.
    Working {
        /// The step that it is at.
        step: String,
    },
    /// A scene is done.
    Scene {
        /// The scene.
        scene: u32,
        /// Objects that are left on the table.
        objects: u32,
        /// Objects that were removed while the scene settled.
        removed: u32,
    },
    /// An attempt at a scene failed. It comes again, with the same number, if its device failed.
    Attempt {
        /// The scene.
        scene: u32,
        /// The attempt, from 0.
        attempt: u32,
        /// Why.
        error: String,
        /// Whether it was the last.
        last: bool,
    },
    /// A diagnostic of a recipe, an error or a warning.
    Message(Record),
    /// Something to know that is no warning: a dataset grows, or was compared with its journal.
    Note {
        /// What.
        message: String,
    },
    /// How long the stages of the scenes worked. Comes when all scenes are made.
    Stages {
        /// By stage, such as `place.objects`, `settle`, `render`, `annotate.masks`, `checks` or `write.syntable`.
        stages: BTreeMap<String, Worked>,
    },
    /// The run ends.
    Finished {
        /// Where the dataset is.
        out: String,
        /// Scenes in the dataset.
        scenes: u32,
        /// Scenes that failed.
        failed: u32,
        /// Images in the dataset.
        images: u32,
        /// Images that this run made.
        made: u32,
        /// Scenes that were there and got the files of new writers.
        grown: u32,
        /// How long the run took, s.
        seconds: f64,
    },
}

/// Shows events.
pub trait Reporter: Send + Sync {
    /// Shows one event. Events come from several threads.
    fn event(&self, event: &Event);
    /// Shows an error, a warning or a diagnostic. A reporter for people may render it; by default it is an event.
    fn message(&self, message: &Message) {
        self.event(&Event::Message(Record::from(message)));
    }
}

/// A reporter that cannot fail what it reports on: where showing an event panics, the event is lost.
pub struct Guarded<'a>(pub &'a dyn Reporter);
impl Reporter for Guarded<'_> {
    fn event(&self, event: &Event) {
        let _ = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| self.0.event(event)));
    }
    fn message(&self, message: &Message) {
        let _ = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| self.0.message(message)));
    }
}

/// Number of messages that are remembered; what comes so late is about single scenes.
const REMEMBERED: usize = 1000;

/// A reporter that is told each warning and error once.
pub struct Once<'a>(&'a dyn Reporter, Mutex<BTreeSet<String>>);

impl<'a> Once<'a> {
    /// Nothing was told yet.
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

/// One line of the log: an event, and when it happened.
#[derive(Debug, Serialize, schemars::JsonSchema)]
pub struct LogLine<'a> {
    /// Seconds since the program started.
    pub elapsed_s: f64,
    /// What happened.
    #[serde(flatten)]
    pub event: std::borrow::Cow<'a, Event>,
}

/// A number with its noun: `1 scene`, `2 scenes`.
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

/// A log that turns warnings into events, and steps of work that takes long.
pub struct Warnings<'a>(pub &'a dyn Reporter);

/// How long work may take before it is told, and how often.
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
            // A panic of the work drops it, too.
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
        // Each is told once, however long it takes.
        work(&[("first", 0.3), ("second", 2.2), ("third", 1.0)]);
        assert_eq!(*heard.0.lock(), ["second", "third"]);
    }

    #[test]
    fn a_panic_of_work_is_passed_on() {
        let panics = || Warnings(&Quiet).during(&Steps::default(), &mut || panic!("inside"));
        assert!(crate::run::panics::quiet(|| std::panic::catch_unwind(std::panic::AssertUnwindSafe(panics))).is_err());
    }
}
