//! Requests of threads that wait for their answers.

use parking_lot::Mutex;
use std::process;
use std::sync::Arc;
use tokio::runtime::{Builder, Runtime};

/// The threads that send requests, and their process: a process that was forked has none of the threads.
static RUNTIME: Mutex<Option<(u32, Arc<Runtime>)>> = Mutex::new(None);

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
