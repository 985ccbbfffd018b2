//! A run, and what works on the dataset that it makes.
//!
//! An image is a pure function of recipe, seed, scene and view: streams are named after stage, scene, attempt and view, results do
//! not depend on threads or order, and a scene's files appear together with its journal line.
//!
//! | floor | holds |
//! |---|---|
//! | [`dataset`] | the dataset in its store: folder, journal, manifests, settled poses, recorded products, comparison with the journal |
//! | `decisions` | what a run may do with a folder: continue, grow, or leave it alone; the list of work |
//! | [`making`] | scenes: attempts, the walk over a scene, sessions, the queue, writers, losses, times |
//! | `finish` | annotators of the dataset, and the last step of writers |
//! | `merge`, `convert`, [`preview`] | one dataset of several parts; a dataset in other formats; single views without a dataset |
//! | [`progress`], [`stop`], `panics`, `scene_range` | events and their listeners; early ends; panics as errors; scenes by number |

mod convert;
pub mod dataset;
mod decisions;
pub(crate) mod finish;
pub mod making;
mod merge;
pub(crate) mod panics;
pub mod preview;
pub mod progress;
mod scene_range;
pub mod stop;

pub use convert::{Converted, check_images, check_place, convert_dataset, not_listed, products_of};
pub use dataset::loss::Loss;
pub use dataset::verify::{Verified, verify};
pub(crate) use decisions::inputs::files as files_of;
pub(crate) use finish::dataset_info;
pub use merge::merge;
pub use scene_range::SceneRange;

use crate::cache::DiskCache;
use crate::left_out::LeftOutReport;
use crate::recipe::Recipe;
use crate::workers::Pool;
use making::scenes::MadeScenes;
use progress::{Event, Guarded, Once, Reporter, Warnings};
use std::ops::Range;
use std::time::Instant;
use stop::Stop;
use syntable_model::error::{Error, Result};
use syntable_model::some::SHOWN;
use syntable_model::store::StoreFolder;

/// How to run a recipe.
pub struct RunOptions {
    /// Where the dataset is stored: a folder of this machine, or of another store, such as memory.
    pub out: StoreFolder,
    /// Which of the recipe's scenes to make; all if not given.
    pub scenes: Option<Range<u32>>,
    /// Threads.
    pub threads: usize,
    /// Delete a dataset that is there.
    pub overwrite: bool,
    /// Try scenes again that failed in an earlier run.
    pub retry_failed: bool,
    /// Compare all files with the journal first, and make the scenes again whose files are missing or damaged.
    pub repair: bool,
    /// Write the files of writers anew that have other options than then, or annotators with other options, and take away
    /// those of writers that are there no more.
    pub rewrite: bool,
    /// Results kept between runs.
    pub cache: DiskCache,
    /// Asks the run to end early.
    pub stop: Stop,
}

impl RunOptions {
    /// All scenes into a folder, with as many threads.
    pub fn new(out: impl Into<StoreFolder>, threads: usize, cache: DiskCache) -> Self {
        let (out, stop) = (out.into(), Stop::default());
        Self {
            out,
            scenes: None,
            threads,
            overwrite: false,
            retry_failed: false,
            repair: false,
            rewrite: false,
            cache,
            stop,
        }
    }
}

/// What a run did.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Scenes in the dataset, failed ones not counted.
    pub scenes: u32,
    /// Scenes that failed.
    pub failed: u32,
    /// Scenes in the dataset that could not be given what a grown recipe adds, or could not be repaired: they are as they
    /// were.
    pub lacking: u32,
    /// Scenes of the recipe that none of the merged parts has; 0 after a run.
    pub missing: u32,
    /// Images in the dataset.
    pub images: u32,
    /// Assets that could not be used and were passed over, as `pool/name`, sorted.
    pub bad_assets: Vec<String>,
    /// What stages left out of the scenes of the dataset.
    pub left_out: Vec<Loss>,
}

impl Outcome {
    /// Assets that were passed over, and parts of labels that writers could not store. Failed scenes are not among them.
    pub fn left_out(&self) -> LeftOutReport {
        let mut report = LeftOutReport::default();
        if !self.bad_assets.is_empty() {
            let bad =
                self.bad_assets.iter().take(SHOWN).map(|asset| Error::new(format!("asset {asset} cannot be used")));
            report.add(format!("{} passed over", progress::count(self.bad_assets.len() as u32, "bad asset")), bad);
        }
        report.losses(&self.left_out);
        report
    }
}

/// Runs a recipe. An error means that the run stopped early; what was done stays, and the same call goes on from there.
pub fn run(recipe: &Recipe, options: &RunOptions, reporter: &dyn Reporter) -> Result<Outcome> {
    let start = Instant::now();
    let guarded = Guarded(reporter);
    let reporter = &Once::new(&guarded);
    let (pool, log) = (Pool::new(options.threads)?, Warnings(reporter));
    let wanted = options.scenes.clone().unwrap_or(0..u32::MAX);
    let begun = decisions::opening::begin(recipe, options, &pool, reporter, &log)?;
    let MadeScenes { folder, journal, resolved, new, grown, lacking } =
        making::scenes::make(recipe, options, &pool, reporter, begun)?;
    let outcome = finish::end(recipe, reporter, &pool, &folder, journal, &resolved, (options.repair, &wanted))
        .map_err(stopping)?;
    let outcome = Outcome { lacking, ..outcome };
    reporter.event(&Event::Finished {
        out: options.out.name().display().to_string(),
        scenes: outcome.scenes,
        failed: outcome.failed,
        images: outcome.images,
        made: new,
        grown,
        seconds: start.elapsed().as_secs_f64(),
    });
    Ok(outcome)
}

/// An error that ends the run. One of the file system or of a device can be mended from outside.
fn stopping(error: Error) -> Error {
    if error.is_io() && error.help_text().is_none() {
        error.help("the dataset so far is whole: make room, or mend the disk or folder, then run the same command")
    } else if error.is_device() {
        let own = error.help_text().map_or_else(String::new, |help| format!("; {help}"));
        error.help(format!("the dataset keeps all that it had, and the same command goes on from there{own}"))
    } else {
        error
    }
}

/// Ascending numbers of scenes in words: `0..3, 7`, where `0..3` leaves out 3.
fn ranges(scenes: impl Iterator<Item = u32>) -> String {
    let mut runs: Vec<Range<u32>> = Vec::new();
    for scene in scenes {
        match runs.last_mut() {
            Some(run) if run.end == scene => run.end += 1,
            _ => runs.push(scene..scene + 1),
        }
    }
    let text = |run: &Range<u32>| if run.len() == 1 { run.start.to_string() } else { format!("{run:?}") };
    runs.iter().map(text).collect::<Vec<_>>().join(", ")
}
