//! Work of the library on another thread, while the calling thread shows its progress and handles signals.

use crate::errors::{exception, with_arguments};
use crate::stages::{Interrupts, are_abandoned, give_up};
use crate::values;
use parking_lot::Mutex;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};
use std::{process, thread};
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_recipe::message::{Message, Record};
use syntable_runtime::run::progress::{Event, Reporter};
use syntable_runtime::run::stop::Stop;

/// Interval at which the calling thread handles signals.
pub const SIGNALS: Duration = Duration::from_millis(50);

/// The process that began work first; 0 before.
static WORKER: AtomicU32 = AtomicU32::new(0);

/// Refuses work in a process that was forked after its parent had begun work.
///
/// # Errors
/// If the threads of the library are in the parent.
pub fn check_process(py: Python<'_>) -> PyResult<()> {
    let here = process::id();
    match WORKER.compare_exchange(0, here, Ordering::Relaxed, Ordering::Relaxed) {
        Err(there) if there != here => Err(exception(
            py,
            &Error::new(
                "this process was forked from one whose threads had worked for the library, and lacks these threads",
            )
            .help("start processes with multiprocessing's \"spawn\", or pass num_workers=0 to a DataLoader"),
        )),
        _ => Ok(()),
    }
}

/// Whether this process was forked from one that had begun work. Then waiting for the threads of that work never ends.
pub fn is_forked() -> bool {
    let there = WORKER.load(Ordering::Relaxed);
    there != 0 && there != process::id()
}

/// Ends work whose threads may need Python's lock to end: waits for them without it. Interrupts stages in Python that they run: at
/// once if the user has interrupted the work, or else after a moment. Returns the exception of a signal. While stages run, it returns
/// after a second signal or a few seconds: a stage may be blocked in the system, where no exception reaches it.
pub fn end<T: Send + 'static>(work: T, is_interrupted: bool) -> Option<PyErr> {
    let mut work = Some(work);
    let waited = if is_forked() { None } else { Python::try_attach(|py| wait(py, work.take(), is_interrupted)) };
    // Otherwise the threads are in another process, or Python is gone, and with it all that waits for them.
    std::mem::forget(work);
    waited.flatten()
}

fn wait<T: Send + 'static>(py: Python<'_>, work: Option<T>, is_interrupted: bool) -> Option<PyErr> {
    const POLL: Duration = Duration::from_millis(5);
    let (mut interrupts, mut raised, start) = (Interrupts::default(), None, Instant::now());
    let ended = thread::spawn(move || drop(work));
    while !ended.is_finished() && !are_abandoned(start) {
        if is_interrupted || raised.is_some() || start.elapsed() > Interrupts::GRACE {
            interrupts.next(py);
        }
        py.detach(|| thread::sleep(POLL));
        if let Err(signal) = py.check_signals() {
            if (is_interrupted || raised.is_some()) && give_up() {
                return Some(signal);
            }
            raised.get_or_insert(signal);
        }
    }
    raised
}

/// Passes events to the calling thread.
pub struct EventSender(Mutex<Sender<Event>>);

/// Where events arrive.
pub struct Events(Mutex<Receiver<Event>>);

/// A sender, and the end where its events arrive.
pub fn events() -> (EventSender, Events) {
    let (sender, events) = channel();
    (EventSender(Mutex::new(sender)), Events(Mutex::new(events)))
}

impl Events {
    /// The next event, after at most [`SIGNALS`].
    fn next(&self) -> std::result::Result<Event, RecvTimeoutError> {
        self.0.lock().recv_timeout(SIGNALS)
    }

    /// An event that is here already.
    pub fn here(&self) -> Option<Event> {
        self.0.lock().try_recv().ok()
    }
}

impl Reporter for EventSender {
    fn event(&self, event: &Event) {
        // Without a listener, the event is not wanted.
        let _ = self.0.lock().send(event.clone());
    }
}

impl Log for EventSender {
    fn warn(&self, error: &Error) {
        self.event(&Event::Message(Record::from(&Message::Warning(error.clone()))));
    }
}

/// Passes an event to a Python function.
pub fn show(py: Python<'_>, progress: Option<&Py<PyAny>>, event: &Event) -> PyResult<()> {
    let Some(progress) = progress else { return Ok(()) };
    let failed = |error: serde_json::Error| exception(py, &Error::new(error.to_string()));
    let text = with_arguments(&serde_json::to_string(event).map_err(failed)?);
    let event = serde_json::from_str(&text).map_err(failed)?;
    progress.call1(py, (values::of_json(py, &event)?,)).map(drop)
}

/// Does work on another thread. The calling thread passes events to `progress`, and handles signals. A signal whose handler
/// raises (Ctrl-C), or an exception of `progress` asks the work to stop; when it has ended, the exception is raised. A second
/// signal is raised at once if a stage in Python runs: it may be blocked in the system, where no exception reaches it.
///
/// # Errors
/// The exception of a signal or of `progress`, or else the error of the work.
pub fn wait_for<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(&EventSender, &Stop) -> Result<T> + Send + 'static,
) -> PyResult<T> {
    check_process(py)?;
    let (stop, (sender, events)) = (Stop::default(), events());
    let asked = stop.clone();
    // The sender ends with the work, so that the events end.
    let worker = thread::spawn(move || work(&sender, &asked));
    let (mut raised, mut is_interrupted, mut interrupts) = (None, false, Interrupts::default());
    loop {
        let event = py.detach(|| events.next());
        let shown = match event {
            Ok(event) => show(py, progress.filter(|_| raised.is_none()), &event),
            Err(RecvTimeoutError::Timeout) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => break,
        };
        if let Err(error) = shown {
            stop.cancel();
            raised.get_or_insert(error);
        }
        if let Err(signal) = py.check_signals() {
            stop.cancel();
            if is_interrupted && give_up() {
                return Err(signal);
            }
            is_interrupted = true;
            raised.get_or_insert(signal);
        }
        if raised.is_some() {
            interrupts.next(py);
        }
    }
    let done = py.detach(|| worker.join());
    match (raised, done) {
        (Some(error), _) => Err(error),
        (None, Ok(Ok(made))) => Ok(made),
        (None, Ok(Err(error))) => Err(exception(py, &error)),
        (None, Err(_)) => Err(exception(py, &Error::new("a thread of the library panicked"))),
    }
}
