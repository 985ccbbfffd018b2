//! Figures of benchmarks: printed, and written to a file that `.ci/compare-speed` compares between commits.

use serde_json::{Value as Json, json};
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Least time of a sample. The clock and the call of the closure then take less than a thousandth of it.
const SAMPLE: Duration = Duration::from_millis(1);
/// Time that a measurement takes, if its least number of samples does not take longer.
const MEASUREMENT: Duration = Duration::from_secs(1);
/// Least number of samples of a measurement.
const SAMPLES: usize = 5;

/// Unit of a figure, which also tells whether more is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Seconds: less is better.
    Seconds,
    /// Items per second: more is better.
    PerSecond,
    /// Peak signal-to-noise ratio in decibels: more is better.
    Decibels,
}

impl Unit {
    /// The symbol in files.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Seconds => "s",
            Self::PerSecond => "1/s",
            Self::Decibels => "dB",
        }
    }
}

/// The figures of a benchmark.
pub struct Figures {
    file: PathBuf,
    filter: Option<String>,
    all: Vec<Json>,
}

impl Figures {
    /// The figures of the benchmark `bench` of `package`. Each figure is at once in `PACKAGE.BENCH.json`, in the folder that
    /// `SYNTABLE_FIGURES` names or in `target/figures`.
    ///
    /// # Panics
    /// If the folder cannot be made.
    pub fn new(package: &str, bench: &str) -> Self {
        let folder = std::env::var_os("SYNTABLE_FIGURES").map_or_else(default_folder, PathBuf::from);
        std::fs::create_dir_all(&folder).expect("the folder of figures");
        Self { file: folder.join(format!("{package}.{bench}.json")), filter: None, all: Vec::new() }
    }

    /// As [`new`](Self::new), without the measurements whose names lack the process's first argument.
    ///
    /// # Panics
    /// If the folder cannot be made.
    pub fn filtered(package: &str, bench: &str) -> Self {
        let filter = std::env::args().skip(1).find(|argument| !argument.starts_with('-'));
        Self { filter, ..Self::new(package, bench) }
    }

    /// Records the median time of calls.
    pub fn time<T>(&mut self, name: &str, mut call: impl FnMut() -> T) {
        self.time_on(name, || (), |()| call());
    }

    /// Records the median time of calls on inputs, whose making is not timed.
    pub fn time_on<I, T>(&mut self, name: &str, input: impl FnMut() -> I, call: impl FnMut(I) -> T) {
        if self.is_wanted(name) {
            self.put(name, median_s(input, call), Unit::Seconds);
        }
    }

    /// Records how many of the `items` of a call are done per second.
    pub fn rate<T>(&mut self, name: &str, items: usize, mut call: impl FnMut() -> T) {
        if self.is_wanted(name) {
            self.put(name, items as f64 / median_s(|| (), |()| call()), Unit::PerSecond);
        }
    }

    /// Whether the filter selects a measurement.
    pub fn is_wanted(&self, name: &str) -> bool {
        self.filter.as_ref().is_none_or(|filter| name.contains(filter))
    }

    /// Records and prints a figure.
    ///
    /// # Panics
    /// If the file cannot be written.
    pub fn put(&mut self, name: &str, value: f64, unit: Unit) {
        println!("{name:<48} {}", shown(value, unit));
        self.keep(name, value, unit);
    }

    /// Records a figure that the benchmark prints itself.
    ///
    /// # Panics
    /// If the value is not finite, or the file cannot be written.
    pub fn keep(&mut self, name: &str, value: f64, unit: Unit) {
        assert!(value.is_finite(), "{name}: {value}");
        self.all.push(json!({ "name": name, "value": value, "unit": unit.symbol() }));
        let text = serde_json::to_string_pretty(&self.all).expect("text and numbers");
        std::fs::write(&self.file, text + "\n").expect("the file of figures");
    }
}

/// `target/figures` of the build that made this program.
fn default_folder() -> PathBuf {
    let program = std::env::current_exe().unwrap_or_default();
    // The program is `target/release/deps/bench-0123456789abcdef`.
    program.ancestors().nth(3).unwrap_or(Path::new("target")).join("figures")
}

/// A figure in a readable unit.
fn shown(value: f64, unit: Unit) -> String {
    match unit {
        Unit::Seconds if value < 1e-3 => format!("{:10.2} µs", 1e6 * value),
        Unit::Seconds if value < 1.0 => format!("{:10.2} ms", 1e3 * value),
        Unit::Seconds => format!("{value:10.2} s"),
        Unit::PerSecond if value >= 1e6 => format!("{:10.2} M/s", 1e-6 * value),
        Unit::PerSecond => format!("{value:10.2} /s"),
        Unit::Decibels => format!("{value:10.2} dB"),
    }
}

/// The median time of a call, after one that is not timed.
fn median_s<I, T>(mut input: impl FnMut() -> I, mut call: impl FnMut(I) -> T) -> f64 {
    let mut sample = |calls: usize| {
        let inputs: Vec<I> = (0..calls).map(|_| input()).collect();
        let mut outputs = Vec::with_capacity(calls);
        let started = Instant::now();
        outputs.extend(inputs.into_iter().map(|input| call(black_box(input))));
        let taken = started.elapsed();
        drop(black_box(outputs));
        taken
    };
    sample(1);
    let mut calls = 1;
    while sample(calls) < SAMPLE {
        calls *= 2;
    }
    let (started, mut times) = (Instant::now(), Vec::new());
    while times.len() < SAMPLES || started.elapsed() < MEASUREMENT {
        times.push(sample(calls).as_secs_f64() / calls as f64);
    }
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// User and system time of this process so far, to a hundredth of a second; 0 on systems without `/proc`.
pub fn processor_seconds() -> f64 {
    ticks(11) + ticks(12)
}

/// User and system time of the child processes that have ended, as of [`processor_seconds`].
pub fn processor_seconds_of_children() -> f64 {
    ticks(13) + ticks(14)
}

/// A field of `/proc/self/stat` behind the name of the program, s.
fn ticks(field: usize) -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let mut fields = text.rsplit(')').next().unwrap_or_default().split_whitespace();
    fields.nth(field).and_then(|field| field.parse::<f64>().ok()).unwrap_or(0.0) / 100.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_is_in_the_file_at_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("package.bench.json");
        let mut figures = Figures { file: file.clone(), filter: Some("filter".to_owned()), all: Vec::new() };
        figures.keep("error of the filter", 35.5, Unit::Decibels);
        figures.time("unwanted", || panic!("the filter leaves it out"));
        figures.time_on("sleep of the filter", || 3, |ms| std::thread::sleep(Duration::from_millis(ms)));
        let read: Vec<Json> = serde_json::from_slice(&std::fs::read(&file).expect("written")).expect("JSON");
        assert_eq!(read[0], json!({ "name": "error of the filter", "value": 35.5, "unit": "dB" }));
        assert!(read[1]["value"].as_f64().is_some_and(|seconds| seconds >= 0.003), "{read:?}");
        assert_eq!(read.len(), 2);
    }
}
