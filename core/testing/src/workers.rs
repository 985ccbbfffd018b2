//! Worker threads for tests.

use std::sync::atomic::{AtomicUsize, Ordering};
use syntable_model::context::Workers;

/// A number of threads, started for every call. For tests that a result does not depend on it.
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
