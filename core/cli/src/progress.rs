//! Shows the events of a run: on a terminal, as plain lines, or as JSON lines.

use crate::flags::with_flags;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use parking_lot::Mutex;
use std::collections::BTreeMap;
use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};
use syntable_recipe::message::Message;
use syntable_runtime::run::progress::{Event, LogLine, Reporter, clock, count};

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
        print_line(&line);
    }
}

/// For people: a progress line on a terminal, and plain lines.
pub struct Human {
    bar: Option<ProgressBar>,
    state: Mutex<ProgressState>,
}

struct ProgressState {
    start: Instant,
    said: Instant,
    /// Time of the last message about a long step.
    worked: Option<Instant>,
    images: u64,
    total: u64,
    scenes: u32,
    scenes_total: u32,
    /// Images of scenes that may still fail, by scene.
    unfinished: BTreeMap<u32, u64>,
}

impl Human {
    /// Shows a progress line if `terminal`, else a line of text from time to time.
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
        let state = ProgressState {
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

/// Prints a line on standard error, with flags for the options that it names. A closed pipe must not stop a run.
fn print_line(line: &str) {
    let _ = writeln!(std::io::stderr(), "{}", with_flags(line));
}

impl ProgressState {
    fn pace(&self) -> String {
        let seconds = self.start.elapsed().as_secs_f64();
        let scenes = format!("scene {}/{}", self.scenes, self.scenes_total);
        // Until a scene is done, most of the time went into loading and into scenes that have no images yet.
        if self.scenes == 0 || self.images == 0 || seconds <= 0.0 {
            return scenes;
        }
        let per_second = self.images as f64 / seconds;
        let left = Duration::from_secs_f64((self.total.saturating_sub(self.images)) as f64 / per_second);
        format!("{scenes}  {:.0} images/h  {} left", per_second * 3600.0, clock(left))
    }
}

impl Reporter for Human {
    fn message(&self, message: &Message) {
        self.say(&message.render(std::io::stderr().is_terminal()));
    }

    fn event(&self, event: &Event) {
        let mut state = self.state.lock();
        match event {
            // Previews have no total.
            Event::Image { .. } | Event::Scene { .. } if state.total == 0 => {}
            Event::Started { out, scenes, views_per_scene, resumed, images, threads } => {
                (state.start, state.images, state.scenes) = (Instant::now(), 0, 0);
                state.unfinished.clear();
                state.scenes_total = scenes - resumed;
                state.total = *images;
                let done = if *resumed > 0 { format!(", {resumed} of them finished before") } else { String::new() };
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
                // The dataset does not get the images of a failed attempt.
                state.images = state.images.saturating_sub(state.unfinished.remove(scene).unwrap_or(0));
                let then = if *last { "given up" } else { "trying again" };
                self.say(&format!("warning: scene {scene}, attempt {attempt}: {error}; {then}"));
            }
            Event::Message(record) => self.say(&record.line()),
            Event::Note { message } => self.say(&format!("note: {message}")),
            Event::Stages { .. } => {}
            Event::Finished { scenes, failed, images, made, grown, seconds, .. } => {
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
            }
        }
    }
}
