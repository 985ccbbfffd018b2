//! Runs a recipe, and works on the resulting dataset.
//!
//! An image is a pure function of recipe, seed, scene and view: random streams are named by stage, scene, attempt and
//! view, results do not depend on threads or order, and a scene's files appear together with its journal line.
//!
//! | floor | holds |
//! |---|---|
//! | [`dataset`] | the dataset in its store: folder, journal, manifests, settled poses, recorded products, comparison with the journal |
//! | `decisions` | permitted changes to a folder: continue it, grow it, or leave it unchanged; the list of work |
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
pub use merge::merge;
pub use scene_range::SceneRange;

use crate::cache::DiskCache;
use crate::left_out::LeftOutReport;
use crate::workers::Pool;
use decisions::opening::{self, CheckedRun};
use making::scenes::MadeScenes;
use making::{first_scene, scenes};
use progress::{Event, Guarded, Once, Reporter, Warnings};
use std::ops::Range;
use std::time::Instant;
use stop::Stop;
use syntable_model::error::{Error, Result};
use syntable_model::store::StoreFolder;
use syntable_model::words::SHOWN;
use syntable_recipe::Recipe;

/// Options of a run.
pub struct RunOptions {
    /// Where to store the dataset: a folder of this machine, or of another store such as memory.
    pub out: StoreFolder,
    /// Scenes of the recipe to make; `None` makes all.
    pub scenes: Option<Range<u32>>,
    /// Number of threads.
    pub threads: usize,
    /// Delete an existing dataset.
    pub overwrite: bool,
    /// Retry scenes that failed in an earlier run.
    pub retry_failed: bool,
    /// Compare all files with the journal first, and make scenes with missing or damaged files again.
    pub repair: bool,
    /// Write the files of writers again whose options, or whose annotators' options, have changed, and remove the files
    /// of writers that left the recipe.
    pub rewrite: bool,
    /// Cache of results that later runs can use.
    pub cache: DiskCache,
    /// Ends the run early on request.
    pub stop: Stop,
}

impl RunOptions {
    /// Options to make all scenes in a folder with this number of threads.
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

/// Result of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunOutcome {
    /// Number of scenes in the dataset, without failed scenes.
    pub scenes: u32,
    /// Number of failed scenes.
    pub failed: u32,
    /// Number of scenes in the dataset that could not be repaired, or could not get the additions of a grown recipe.
    /// They stay as they were.
    pub lacking: u32,
    /// Number of the recipe's scenes that no merged part has; 0 after a run.
    pub missing: u32,
    /// Number of images in the dataset.
    pub images: u32,
    /// Unusable assets that were skipped, as `pool/name`, sorted.
    pub bad_assets: Vec<String>,
    /// Data that stages omitted from the scenes of the dataset.
    pub left_out: Vec<Loss>,
}

impl RunOutcome {
    /// Skipped assets, and parts of labels that writers could not store. Failed scenes are not included.
    pub fn left_out(&self) -> LeftOutReport {
        let mut report = LeftOutReport::default();
        if !self.bad_assets.is_empty() {
            let bad =
                self.bad_assets.iter().take(SHOWN).map(|asset| Error::new(format!("asset {asset} cannot be used")));
            report.add(format!("{} skipped", progress::count(self.bad_assets.len() as u32, "bad asset")), bad);
        }
        report.losses(&self.left_out);
        report
    }
}

/// Runs a recipe. After an error, finished work remains, and the same call continues.
pub fn run(recipe: &Recipe, options: &RunOptions, reporter: &dyn Reporter) -> Result<RunOutcome> {
    let start = Instant::now();
    let guarded = Guarded(reporter);
    let reporter = &Once::new(&guarded);
    let (pool, log) = (Pool::new(options.threads)?, Warnings(reporter));
    let wanted = options.scenes.clone().unwrap_or(0..u32::MAX);
    let checked = CheckedRun::new(recipe, options, &log)?;
    let folder = opening::open_folder(options, reporter)?;
    let aside = if options.overwrite { first_scene::replace(recipe, options, &folder, reporter)? } else { None };
    let begun = checked.begin(folder, aside, &pool, reporter)?;
    let MadeScenes { folder, journal, resolved, new, grown, lacking } =
        scenes::make(recipe, options, &pool, reporter, begun)?;
    let outcome = finish::end(recipe, reporter, &pool, &folder, journal, &resolved, (options.repair, &wanted))
        .map_err(stopping)?;
    let outcome = RunOutcome { lacking, ..outcome };
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

/// Adds help to an error that ends a run. The user can fix errors of the file system or a device.
fn stopping(error: Error) -> Error {
    if error.is_io() && error.help_text().is_none() {
        error.help("finished scenes are kept: free disk space, or repair the disk or folder, then run the same command")
    } else if error.is_device() {
        let own = error.help_text().map_or_else(String::new, |help| format!("; {help}"));
        error.help(format!("finished scenes are kept, and the same command continues from there{own}"))
    } else {
        error
    }
}

/// Ascending scene numbers as text: `0..3, 7`, where `0..3` excludes 3.
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
