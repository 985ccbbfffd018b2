//! Worker threads that all stages share.

use crate::run::panics::carried;
use crate::run::stop::Stop;
use rayon::prelude::*;
use syntable_model::context::Workers;
use syntable_model::error::{Error, Result};
use syntable_model::panics;

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

    /// Runs a function on a thread of the pool. Parallel work inside it stays on these threads.
    pub fn install<T: Send>(&self, run: impl FnOnce() -> T + Send) -> T {
        self.0.install(run)
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

/// Workers whose work ends on request. Only for stages, whose callers catch what unwinds.
#[derive(Clone, Copy)]
pub struct Stoppable<'a> {
    /// The threads.
    pub workers: &'a dyn Workers,
    /// Ends the work.
    pub stop: &'a Stop,
}

impl Workers for Stoppable<'_> {
    fn threads(&self) -> usize {
        self.workers.threads()
    }

    fn run(&self, jobs: usize, job: &(dyn Fn(usize) + Sync)) {
        self.workers.run(jobs, &|index| {
            if !self.stop.is_requested() {
                job(index);
            }
        });
        // Some jobs may not have run.
        self.check_stop();
    }

    fn check_stop(&self) {
        if let Some(reason) = self.stop.requested() {
            panics::stop(format!("stopped by {reason}"));
        }
    }
}

/// Number of threads that this machine can run at once.
pub fn available() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::panics::caught;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn no_job_begins_after_a_stop_and_the_stage_ends_with_it() {
        for threads in [1, 3] {
            let (pool, stop) = (Pool::new(threads).expect("threads"), Stop::default());
            let [begun, late] = [AtomicUsize::new(0), AtomicUsize::new(0)];
            let workers = Stoppable { workers: &pool, stop: &stop };
            let work = |last: usize| {
                caught("render", || {
                    workers.run(1000, &|_| {
                        late.fetch_add(usize::from(stop.is_requested()), Ordering::SeqCst);
                        if begun.fetch_add(1, Ordering::SeqCst) == last {
                            stop.cancel();
                            // Long jobs end, too.
                            workers.check_stop();
                        }
                    });
                    Ok(())
                })
            };
            work(usize::MAX).expect("nothing stops it");
            assert_eq!(begun.load(Ordering::SeqCst), 1000);
            let error = work(1010).expect_err("stopped");
            assert_eq!(error.to_string(), "render: stopped by its caller");
            assert_eq!(error, Error::stopped("stopped by its caller").context("render"));
            // A job may begin while another job requests the stop.
            assert!(late.load(Ordering::SeqCst) < threads, "{late:?}");
        }
    }
}
