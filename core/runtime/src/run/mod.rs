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
//! | [`forecast`] | the time and disk space of a run, measured on its first scenes |
//! | `status` | counts and pace of datasets that other processes make |
//! | `sharing` | a dataset that several workers make together |
//! | `merge`, `convert`, [`preview`] | one dataset of several parts; a dataset in other formats; single views without a dataset |
//! | [`progress`], [`stop`], `panics`, `scene_range`, `shard` | events and their listeners; early ends; panics as errors; scenes by number and by shard |

mod conversion_target;
mod convert;
pub mod dataset;
mod decisions;
pub(crate) mod finish;
pub mod forecast;
pub mod making;
mod merge;
mod options;
mod outcome;
pub(crate) mod panics;
pub mod preview;
pub mod progress;
mod remarks;
pub(crate) mod scene_range;
mod shard;
mod sharing;
mod status;
pub mod stop;

pub use convert::{Converted, check_images, check_place, convert_dataset, not_listed, products_of};
pub use dataset::claims::ClaimOptions;
pub use dataset::loss::Loss;
pub use dataset::verify::{Verified, verify};
pub use merge::{datasets_in, merge};
pub use options::{MergeOptions, RunOptions};
pub use outcome::RunOutcome;
pub use scene_range::SceneRange;
pub use shard::{Shard, ShardChoice, WantedScenes};
pub use status::{DatasetStatus, Progress, Status, status};

use crate::workers::{Pool, Stoppable};
use dataset::folder::Folder;
use decisions::opening::{self, CheckedRun};
use making::scenes::MadeScenes;
use making::times::Times;
use making::{first_scene, scenes};
use outcome::stopping;
use progress::{Event, Guarded, Once, Reporter, Warnings};
use std::time::Instant;
use syntable_model::error::Result;
use syntable_recipe::Recipe;

/// Runs a recipe. After an error, finished work remains, and the same call continues.
pub fn run(recipe: &Recipe, options: &RunOptions, reporter: &dyn Reporter) -> Result<RunOutcome> {
    if let Some(claim) = options.claim {
        return sharing::run(recipe, options, claim, reporter);
    }
    run_timed(recipe, options, reporter, &Times::default())
}

/// Opens the folder of a run.
type Open<'o> = dyn Fn() -> Result<Option<Folder>> + 'o;

/// Runs a recipe, and adds the working times of its stages to `times`.
fn run_timed(recipe: &Recipe, options: &RunOptions, reporter: &dyn Reporter, times: &Times) -> Result<RunOutcome> {
    let open = || opening::open_folder(options, reporter).map(Some);
    run_in(recipe, options, reporter, times, &open).map(|outcome| outcome.expect("the folder was opened"))
}

/// Runs a recipe in the folder that `open` opens, after the recipe was checked; none if it opens none.
fn run_in(
    recipe: &Recipe,
    options: &RunOptions,
    reporter: &dyn Reporter,
    times: &Times,
    open: &Open,
) -> Result<Option<RunOutcome>> {
    let start = Instant::now();
    let guarded = Guarded(reporter);
    let reporter = &Once::new(&guarded);
    let (pool, log) = (Pool::new(options.threads)?, Warnings(reporter));
    let wanted = options.wanted(u32::MAX)?;
    let checked = CheckedRun::new(recipe, options, &log)?;
    let Some(folder) = open()? else { return Ok(None) };
    let aside = if options.overwrite { first_scene::replace(recipe, options, &folder, reporter)? } else { None };
    let begun = checked.begin(folder, aside, &pool, reporter)?;
    let MadeScenes { folder, journal, resolved, new, grown, lacking, told } =
        scenes::make(recipe, options, (&pool, times), reporter, begun)?;
    let workers = &Stoppable { workers: &pool, stop: &options.stop };
    let end = || finish::end(recipe, reporter, workers, &folder, journal, &resolved, (options.repair, &wanted, &told));
    let outcome = pool.install(|| panics::unwound(end)).map_err(stopping)?;
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
    Ok(Some(outcome))
}
