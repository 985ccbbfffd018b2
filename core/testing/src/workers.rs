//! Worker threads for tests and benchmarks.

use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use syntable_model::context::Workers;

/// A number of threads that each call starts. For tests that a result does not depend on the number.
#[derive(Debug, Clone, Copy)]
pub struct Threads(pub usize);

impl Workers for Threads {
    fn threads(&self) -> usize {
        self.0
    }

    fn run(&self, jobs: usize, job: &(dyn Fn(usize) + Sync)) {
        let next = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..self.0.min(jobs) {
                scope.spawn(|| {
                    loop {
                        let index = next.fetch_add(1, Ordering::Relaxed);
                        if index >= jobs {
                            break;
                        }
                        job(index);
                    }
                });
            }
        });
    }
}

/// Threads that exist before a call, as in a run. For benchmarks, because starting a thread takes longer than some
/// jobs.
pub struct Pool(rayon::ThreadPool);

impl Pool {
    /// A pool of `threads` threads.
    pub fn new(threads: usize) -> Self {
        Self(rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start"))
    }
}

impl Workers for Pool {
    fn threads(&self) -> usize {
        self.0.current_num_threads()
    }

    fn run(&self, jobs: usize, job: &(dyn Fn(usize) + Sync)) {
        self.0.install(|| (0..jobs).into_par_iter().with_max_len(1).for_each(job));
    }
}
