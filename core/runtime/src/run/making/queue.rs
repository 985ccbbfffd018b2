//! A bounded queue of the jobs that follow rendering. Jobs start in the order in which they were added.

use parking_lot::Mutex;
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::Scope;

type QueuedJob<'env> = Box<dyn FnOnce() + Send + 'env>;

/// Handle that adds jobs to a queue, and blocks while the queue is full. The threads end after the last handle.
#[derive(Clone)]
pub struct Queue<'env>(SyncSender<QueuedJob<'env>>);

impl<'env> Queue<'env> {
    /// Starts `threads` threads that work on the queue. The same number of jobs can wait.
    pub fn start<'scope>(scope: &'scope Scope<'scope, 'env>, threads: usize) -> Self
    where
        'env: 'scope,
    {
        let (sender, receiver) = sync_channel::<QueuedJob<'env>>(threads);
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
