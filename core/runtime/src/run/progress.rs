//! The events of a run, and how they are shown: on a terminal, as plain lines, or as JSON lines.

use super::times::Worked;
use crate::message::{Level, Record};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use parking_lot::Mutex;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};
use syntable_model::context::{Log, Steps};
use syntable_model::error::Error;

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
    /// Shows text that is formatted for people.
    fn text(&self, text: &str) {
        let _ = text;
    }
}

/// A reporter that cannot fail what it reports on: where showing an event panics, the event is lost.
pub struct Guarded<'a>(pub &'a dyn Reporter);
impl Reporter for Guarded<'_> {
    fn event(&self, event: &Event) {
        let _ = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| self.0.event(event)));
    }
    fn text(&self, text: &str) {
        let _ = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| self.0.text(text)));
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
    fn text(&self, text: &str) {
        self.0.text(text);
    }
}

/// Shows nothing.
#[derive(Debug, Default, Clone, Copy)]
pub struct Quiet;
impl Reporter for Quiet {
    fn event(&self, _: &Event) {}
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

/// One JSON object per line on standard error.
pub struct JsonLines(Instant);

impl Default for JsonLines {
    fn default() -> Self {
        Self(Instant::now())
    }
}

impl Reporter for JsonLines {
    fn event(&self, event: &Event) {
        let elapsed_s = (self.0.elapsed().as_secs_f64() * 1000.0).round() / 1000.0;
        let line = LogLine { elapsed_s, event: std::borrow::Cow::Borrowed(event) };
        let line = serde_json::to_string(&line).expect("events are plain data");
        // A closed pipe must not end the run.
        let _ = writeln!(std::io::stderr(), "{line}");
    }
}

/// For people: a progress line on a terminal, and plain lines.
pub struct Human {
    bar: Option<ProgressBar>,
    state: Mutex<State>,
}

struct State {
    start: Instant,
    said: Instant,
    /// When a step of long work was said.
    worked: Option<Instant>,
    images: u64,
    total: u64,
    scenes: u32,
    scenes_total: u32,
    /// Images of scenes that may still fail, by scene.
    unfinished: BTreeMap<u32, u64>,
}

impl Human {
    /// A progress line if `terminal`, else a plain line now and then.
    pub fn new(terminal: bool) -> Self {
        let bar = terminal.then(|| {
            let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
            bar.set_style(
                ProgressStyle::with_template("{bar:32} {pos}/{len} images  {msg}")
                    .unwrap_or_else(|_| ProgressStyle::default_bar()),
            );
            bar.enable_steady_tick(Duration::from_millis(500));
            bar
        });
        let now = Instant::now();
        let state = State {
            start: now,
            said: now,
            worked: None,
            images: 0,
            total: 0,
            scenes: 0,
            scenes_total: 0,
            unfinished: BTreeMap::new(),
        };
        Self { bar, state: Mutex::new(state) }
    }

    fn say(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| print_line(line)),
            None => print_line(line),
        }
    }
}

/// Prints a line on standard error. A reader that has gone away must not stop a run.
fn print_line(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

impl State {
    fn pace(&self) -> String {
        let seconds = self.start.elapsed().as_secs_f64();
        let scenes = format!("scene {}/{}", self.scenes, self.scenes_total);
        if self.images == 0 || seconds <= 0.0 {
            return scenes;
        }
        let per_second = self.images as f64 / seconds;
        let left = Duration::from_secs_f64((self.total.saturating_sub(self.images)) as f64 / per_second);
        format!("{scenes}  {:.0} images/h  {} left", per_second * 3600.0, clock(left))
    }
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

impl Reporter for Human {
    fn text(&self, text: &str) {
        self.say(text);
    }

    fn event(&self, event: &Event) {
        let mut state = self.state.lock();
        match event {
            // Previews have no end to count towards.
            Event::Image { .. } | Event::Scene { .. } if state.total == 0 => {}
            Event::Started { out, scenes, views_per_scene, resumed, images, threads } => {
                (state.start, state.images, state.scenes) = (Instant::now(), 0, 0);
                state.unfinished.clear();
                state.scenes_total = scenes - resumed;
                state.total = *images;
                let done = if *resumed > 0 { format!(", {resumed} of them done before") } else { String::new() };
                let (scenes, views) = (count(*scenes, "scene"), count(*views_per_scene, "view"));
                self.say(&format!("{scenes} × {views}{done}, {} → {out}", count(*threads as u32, "thread")));
                if let Some(bar) = &self.bar {
                    bar.set_length(state.total);
                }
            }
            Event::Image { scene, .. } => {
                state.images += 1;
                *state.unfinished.entry(*scene).or_default() += 1;
                let pace = state.pace();
                if let Some(bar) = &self.bar {
                    bar.set_position(state.images);
                    bar.set_message(pace);
                } else if state.images == 1 && state.total > 0 || state.said.elapsed() > Duration::from_secs(10) {
                    state.said = Instant::now();
                    print_line(&format!("{}/{} images  {pace}", state.images, state.total));
                }
            }
            Event::Working { step } => match &self.bar {
                Some(bar) => bar.set_message(step.clone()),
                None if state.worked.is_none_or(|worked| worked.elapsed() > Duration::from_secs(10)) => {
                    state.worked = Some(Instant::now());
                    print_line(step);
                }
                None => {}
            },
            Event::Scene { scene, .. } => {
                state.scenes += 1;
                state.unfinished.remove(scene);
                if let Some(bar) = &self.bar {
                    bar.set_message(state.pace());
                }
            }
            Event::Attempt { scene, attempt, error, last } => {
                // The images of an attempt that fails are not in the dataset.
                state.images = state.images.saturating_sub(state.unfinished.remove(scene).unwrap_or(0));
                let then = if *last { "given up" } else { "trying again" };
                self.say(&format!("warning: scene {scene}, attempt {attempt}: {error}; {then}"));
            }
            Event::Message(record) => self.say(&record.line()),
            Event::Note { message } => self.say(&format!("note: {message}")),
            Event::Stages { .. } => {}
            Event::Finished { out, scenes, failed, images, made, grown, seconds } => {
                if let Some(bar) = &self.bar {
                    bar.finish_and_clear();
                }
                let failures =
                    if *failed > 0 { format!(", {} failed", count(*failed, "scene")) } else { String::new() };
                let (time, mut made) = (clock(Duration::from_secs_f64(*seconds)), count(*made, "image"));
                if *grown > 0 {
                    made += &format!(" and more files of {}", count(*grown, "scene"));
                }
                let (scenes, images) = (count(*scenes, "scene"), count(*images, "image"));
                print_line(&format!("made {made} in {time}; the dataset has {scenes}, {images}{failures}"));
                let _ = writeln!(std::io::stdout(), "{out}");
            }
        }
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
