//! Requests of threads that wait for their answers.

use crate::failure;
use parking_lot::Mutex;
use std::process;
use std::sync::Arc;
use std::time::Duration;
use tokio::runtime::{Builder, Runtime};

/// The threads that send requests, and their process: a process that was forked has none of the threads.
static RUNTIME: Mutex<Option<(u32, Arc<Runtime>)>> = Mutex::new(None);

/// Waits for a request at most this long; none if it takes longer.
pub fn wait_at_most<F: Future>(limit: Duration, request: F) -> Option<F::Output> {
    wait(async { tokio::time::timeout(limit, request).await.ok() })
}

/// Waits for a request.
pub fn wait<F: Future>(request: F) -> F::Output {
    let runtime = {
        let mut runtime = RUNTIME.lock();
        match &*runtime {
            Some((of, runtime)) if *of == process::id() => Arc::clone(runtime),
            _ => {
                let new = Builder::new_multi_thread().worker_threads(2).thread_name("requests").enable_all().build();
                let new = Arc::new(new.expect("threads can be started"));
                // Threads of the parent process cannot be ended here.
                std::mem::forget(runtime.replace((process::id(), Arc::clone(&new))));
                new
            }
        }
    };
    runtime.block_on(request)
}

/// Times that a request is sent whose answer was lost.
pub const TRIES: u32 = 5;

/// Sends a request, which may be carried out twice, again if the connection broke off within the answer.
pub async fn whole<T>(request: impl AsyncFn() -> object_store::Result<T>) -> object_store::Result<T> {
    let mut tries = 1;
    loop {
        match request().await {
            Err(failure) if tries < TRIES && failure::is_cut(&failure) => tries += 1,
            answer => return answer,
        }
    }
}
