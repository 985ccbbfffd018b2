//! Calls of Python functions from threads of the library.

use parking_lot::{Condvar, Mutex};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use std::process;
use std::time::{Duration, Instant};
use syntable_model::error::{Error, Result};

/// The Python module that explains exceptions.
const STAGES: &str = "syntable.stages._calls";

/// The calls of this moment.
struct Calls {
    running: usize,
    /// Whether Python is about to end.
    are_over: bool,
    /// Whether the user has interrupted the running calls twice.
    are_given_up: bool,
    /// The process whose threads make the calls; 0 before the first call.
    process: u32,
}

static CALLS: Mutex<Calls> = Mutex::new(Calls { running: 0, are_over: false, are_given_up: false, process: 0 });
static ENDED: Condvar = Condvar::new();

/// A call that is counted until it is dropped.
struct Call;

impl Call {
    /// Begins a call, unless Python is about to end.
    fn begin() -> Option<Self> {
        let mut calls = CALLS.lock();
        if calls.process != process::id() {
            // The calls of the parent do not exist in a process that was forked.
            (calls.process, calls.running) = (process::id(), 0);
        }
        let may_begin = !calls.are_over;
        calls.running += usize::from(may_begin);
        may_begin.then(|| Self)
    }
}

impl Drop for Call {
    fn drop(&mut self) {
        let mut calls = CALLS.lock();
        calls.running = calls.running.saturating_sub(1);
        calls.are_given_up &= calls.running > 0;
        ENDED.notify_all();
    }
}

/// Calls Python from any thread, which is attached for the call only. An exception becomes an error.
///
/// # Errors
/// The exception, or that Python is about to end.
pub fn with_python<T>(work: impl FnOnce(Python<'_>) -> PyResult<T>) -> Result<T> {
    let over = || Error::stopped("Python ends, so its stages cannot be called");
    let _call = Call::begin().ok_or_else(over)?;
    let done = Python::try_attach(|py| work(py).map_err(|exception| failure(py, &exception)));
    done.unwrap_or_else(|| Err(over()))
}

/// Gives up the running calls after a second Ctrl-C: nothing waits for them, not even the end of Python.
pub fn give_up() {
    let mut calls = CALLS.lock();
    calls.are_given_up = calls.running > 0;
}

/// Whether calls run that nothing waits for: Python ends, they are given up, or they have been asked to end for
/// [`Interrupts::LIMIT`].
pub fn are_abandoned(asked: Instant) -> bool {
    let calls = CALLS.lock();
    let are_running = calls.running > 0 && calls.process == process::id();
    are_running && (calls.are_over || calls.are_given_up || asked.elapsed() > Interrupts::LIMIT)
}

/// Ends all calls before Python ends: waits for running ones, interrupts them after Ctrl-C or a few seconds, and refuses later
/// ones. A call that does not end within [`Interrupts::LIMIT`], or before a second Ctrl-C, is not waited for: it is in a call of its
/// own that no exception reaches, such as `time.sleep`.
#[pyfunction]
pub fn end_calls(py: Python<'_>) -> PyResult<()> {
    const POLL: Duration = Duration::from_millis(50);
    let (mut interrupts, mut raised, start) = (Interrupts::default(), None, Instant::now());
    loop {
        let is_done = py.detach(|| {
            let mut calls = CALLS.lock();
            calls.are_over = true;
            let is_idle = |calls: &Calls| calls.running == 0 || calls.are_given_up || calls.process != process::id();
            if !is_idle(&calls) {
                ENDED.wait_for(&mut calls, POLL);
            }
            is_idle(&calls)
        });
        if is_done {
            return raised.map_or(Ok(()), Err);
        }
        if let Err(signal) = py.check_signals() {
            if raised.is_some() {
                return Err(signal);
            }
            raised = Some(signal);
        }
        if start.elapsed() > Interrupts::LIMIT {
            return raised.map_or(Ok(()), Err);
        }
        if raised.is_some() || start.elapsed() > Interrupts::GRACE {
            interrupts.next(py);
        }
    }
}

/// Raises `KeyboardInterrupt` in the functions that run as stages, so that Ctrl-C ends a loop in one of them.
#[derive(Default)]
pub struct Interrupts(Option<Instant>);

impl Interrupts {
    /// Time for functions to end when nothing needs their results.
    pub const GRACE: Duration = Duration::from_secs(2);

    /// Time after which nothing waits for functions any longer.
    const LIMIT: Duration = Duration::from_secs(6);

    /// Time for a function to end, and for a call that was about to begin.
    const INTERVAL: Duration = Duration::from_secs(1);

    /// Interrupts all functions that run, unless the last interrupt was a moment ago.
    pub fn next(&mut self, py: Python<'_>) {
        if self.0.is_some_and(|last| last.elapsed() < Self::INTERVAL) {
            return;
        }
        self.0 = Some(Instant::now());
        let interrupted = py.import(STAGES).and_then(|stages| stages.call_method0("_interrupt"));
        if let Err(error) = interrupted {
            error.write_unraisable(py, None);
        }
    }
}

/// An exception as an error with the last lines of its traceback.
pub fn failure(py: Python<'_>, exception: &PyErr) -> Error {
    explained(py, exception).unwrap_or_else(|_| Error::new(exception.to_string()))
}

fn explained(py: Python<'_>, exception: &PyErr) -> PyResult<Error> {
    type Explained = (String, Option<String>, Option<usize>, Option<String>, bool);
    let explain = py.import(STAGES)?.getattr("_explained")?;
    let (message, file, line, help, is_unlucky): Explained =
        explain.call1((exception.value(py), exception.traceback(py)))?.extract()?;
    let error = match is_unlucky {
        _ if exception.is_instance_of::<PyKeyboardInterrupt>(py) => Error::stopped(message),
        true => Error::unlucky(message),
        false => Error::new(message),
    };
    let error = file.into_iter().fold(error, |error, file| error.in_file(file));
    let error = line.into_iter().fold(error, Error::at_line);
    Ok(help.into_iter().fold(error, Error::help))
}
