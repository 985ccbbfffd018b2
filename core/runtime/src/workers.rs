//! Worker threads that all stages share.

use crate::run::panics::carried;
use rayon::prelude::*;
use syntable_model::context::Workers;
use syntable_model::error::{Error, Result};

/// A pool of threads, shared by the scenes in flight.
pub struct Pool(rayon::ThreadPool);

impl Pool {
    /// A pool of `threads` threads.
    pub fn new(threads: usize) -> Result<Self> {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|i| format!("worker-{i}"))
            .build()
            .map(Self)
            .map_err(|error| {
                Error::new(format!("{threads} threads cannot be started: {error}")).help("set `options.threads`")
            })
    }
}

impl Workers for Pool {
    fn threads(&self) -> usize {
        self.0.current_num_threads()
    }

    fn run(&self, jobs: usize, job: &(dyn Fn(usize) + Sync)) {
        self.0.install(|| (0..jobs).into_par_iter().with_max_len(1).for_each(|index| carried(|| job(index))));
    }
}

/// Number of threads that this machine can run at once.
pub fn available() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}
