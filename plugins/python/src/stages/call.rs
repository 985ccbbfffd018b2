//! Calls of Python functions from threads of the library.

use parking_lot::{Condvar, Mutex};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use std::collections::BTreeSet;
use std::process;
use std::time::{Duration, Instant};
use syntable_model::error::{Error, Result};

/// The Python module that explains exceptions.
const STAGES: &str = "syntable.stages._calls";

/// The calls of this moment.
struct Calls {
    /// Numbers of the calls that run, ascending: a later call has a higher one.
    running: BTreeSet<u64>,
    /// Number of the next call.
    next: u64,
    /// Calls with a lower number are given up: the user has interrupted them twice.
    given_up_below: u64,
    /// Whether Python is about to end.
    are_over: bool,
    /// The process whose threads make the calls; 0 before the first call.
    process: u32,
}

impl Calls {
    /// Forgets the calls of the parent in a process that was forked: they do not exist there.
    fn here(&mut self) -> &mut Self {
        if self.process != process::id() {
            self.process = process::id();
            self.running.clear();
        }
        self
    }

    /// Whether a call runs that is not given up.
    fn are_awaited(&self) -> bool {
        self.running.last().is_some_and(|last| *last >= self.given_up_below)
    }
}

static CALLS: Mutex<Calls> =
    Mutex::new(Calls { running: BTreeSet::new(), next: 0, given_up_below: 0, are_over: false, process: 0 });
static ENDED: Condvar = Condvar::new();

/// A call that counts as running until it is dropped.
struct Call(u64);

impl Call {
    /// Begins a call, unless Python is about to end.
    fn begin() -> Option<Self> {
        let mut calls = CALLS.lock();
        let calls = calls.here();
        if calls.are_over {
            return None;
        }
        let number = calls.next;
        calls.next += 1;
        calls.running.insert(number);
        Some(Self(number))
    }
}

impl Drop for Call {
    fn drop(&mut self) {
        CALLS.lock().running.remove(&self.0);
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

/// Gives up the running calls after a second Ctrl-C: the end of Python does not wait for them. Returns whether any runs.
pub fn give_up() -> bool {
    let mut calls = CALLS.lock();
    let calls = calls.here();
    let are_awaited = calls.are_awaited();
    calls.given_up_below = calls.next;
    are_awaited
}

/// Whether calls may keep work from ending, and nothing waits for them any longer: Python ends, or they were asked to end
/// [`Interrupts::LIMIT`] ago.
pub fn are_abandoned(asked: Instant) -> bool {
    let mut calls = CALLS.lock();
    let calls = calls.here();
    !calls.running.is_empty() && (calls.are_over || asked.elapsed() > Interrupts::LIMIT)
}

/// Ends all calls before Python ends: waits for running ones, interrupts them after Ctrl-C or a few seconds, and refuses later
/// ones. It returns while calls run that are given up, after [`Interrupts::LIMIT`], and after a second Ctrl-C: such a call is blocked
/// in the system, as in `time.sleep`, where no exception reaches it.
#[pyfunction]
pub fn end_calls(py: Python<'_>) -> PyResult<()> {
    const POLL: Duration = Duration::from_millis(50);
    let (mut interrupts, mut raised, start) = (Interrupts::default(), None, Instant::now());
    loop {
        let is_done = py.detach(|| {
            let mut calls = CALLS.lock();
            calls.here().are_over = true;
            if calls.are_awaited() {
                ENDED.wait_for(&mut calls, POLL);
            }
            !calls.are_awaited()
        });
        if is_done || start.elapsed() > Interrupts::LIMIT {
            return raised.map_or(Ok(()), Err);
        }
        if let Err(signal) = py.check_signals() {
            if raised.is_some() {
                return Err(signal);
            }
            raised = Some(signal);
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
