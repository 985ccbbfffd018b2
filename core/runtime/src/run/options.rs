//! How to run a recipe.

use crate::cache::DiskCache;
use crate::run::dataset::claims::ClaimOptions;
use crate::run::shard::{Shard, WantedScenes};
use crate::run::stop::Stop;
use std::ops::Range;
use syntable_model::error::Result;
use syntable_model::store::StoreFolder;

/// Options of a run.
pub struct RunOptions {
    /// Where to store the dataset: a folder of this machine, or of another store such as memory.
    pub out: StoreFolder,
    /// Scenes of the recipe to make, not empty; `None` makes all.
    pub scenes: Option<Range<u32>>,
    /// Make only the scenes of this shard. `None` makes a dataset that is no shard.
    pub shard: Option<Shard>,
    /// Make the dataset together with other workers. Each claims blocks of scenes. `None`: no other run may work on the
    /// dataset.
    pub claim: Option<ClaimOptions>,
    /// Number of threads.
    pub threads: usize,
    /// Maximum number of scenes in progress at once; `None`: one per thread. The dataset does not depend on it.
    pub scenes_in_flight: Option<usize>,
    /// Run code that the recipe brings: native libraries by a path beside it, and programs. It is code of the recipe's author.
    pub allow_code: bool,
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

/// Options of a merge.
pub struct MergeOptions {
    /// Number of threads.
    pub threads: usize,
    /// Run programs that write the files at the end. They are code of the author of the parts' recipe.
    pub allow_code: bool,
    /// Merge shards although others of their dataset are missing.
    pub partial: bool,
    /// Merge parts that different devices rendered. Their images may differ by rounding from images of one device.
    pub mixed_devices: bool,
    /// Ends the merge early on request.
    pub stop: Stop,
}

impl MergeOptions {
    /// Options of a merge with this number of threads.
    pub fn new(threads: usize) -> Self {
        Self { threads, allow_code: false, partial: false, mixed_devices: false, stop: Stop::default() }
    }
}

impl RunOptions {
    /// Options to make all scenes in a folder with this number of threads.
    pub fn new(out: impl Into<StoreFolder>, threads: usize, cache: DiskCache) -> Self {
        let (out, stop) = (out.into(), Stop::default());
        Self {
            out,
            scenes: None,
            shard: None,
            claim: None,
            threads,
            scenes_in_flight: None,
            allow_code: false,
            overwrite: false,
            retry_failed: false,
            repair: false,
            rewrite: false,
            cache,
            stop,
        }
    }

    /// The scenes that a run of a recipe with `count` scenes makes.
    ///
    /// # Errors
    /// If the recipe does not have them.
    pub(crate) fn wanted(&self, count: u32) -> Result<WantedScenes> {
        WantedScenes::of(self.scenes.as_ref(), self.shard, count)
    }
}
