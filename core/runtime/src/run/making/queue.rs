//! A bounded queue of jobs for what follows rendering: jobs start in the order in which they were added.

use parking_lot::Mutex;
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::Scope;

type Job<'env> = Box<dyn FnOnce() + Send + 'env>;

/// Adds jobs to a queue; blocks while it is full. The threads end when all handles are gone.
#[derive(Clone)]
pub struct Queue<'env>(SyncSender<Job<'env>>);

impl<'env> Queue<'env> {
    /// Starts a number of threads that work on the queue. At most `threads` jobs wait beside those that run.
    pub fn start<'scope>(scope: &'scope Scope<'scope, 'env>, threads: usize) -> Self
    where
        'env: 'scope,
    {
        let (sender, receiver) = sync_channel::<Job<'env>>(threads);
        let receiver = Arc::new(Mutex::new(receiver));
        for _ in 0..threads {
            let receiver = Arc::clone(&receiver);
            scope.spawn(move || {
                loop {
                    let job = receiver.lock().recv();
                    match job {
                        Ok(job) => job(),
                        Err(_) => break,
                    }
                }
            });
        }
        Self(sender)
    }

    /// Adds a job.
    pub fn add(&self, job: impl FnOnce() + Send + 'env) {
        // The receiver lives as long as the threads, which end after the last sender.
        let _ = self.0.send(Box::new(job));
    }
}
