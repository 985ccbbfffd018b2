//! Samples in memory, one after the other.

use crate::errors::exception;
use crate::recipe::Recipe;
use crate::sample::Sample;
use crate::work::{EventSender, Events, SIGNALS, check_process, end, events, show};
use parking_lot::Mutex;
use pyo3::prelude::*;
use std::sync::Arc;
use std::thread;
use std::time::Duration;
use syntable::{GenerateOptions, Stop};
use syntable_recipe::message::Message;
use syntable_runtime::generate::Waited;
use syntable_runtime::run::progress::Reporter;

/// Who may take the next sample.
enum Turn {
    /// The first thread that asks.
    Free(syntable::Generator),
    /// A thread that waits for it.
    Taken,
    /// No thread: the last sample was taken, or the work was closed.
    Over,
}

impl Turn {
    /// Takes the turn, if it is free.
    fn take(&mut self) -> Self {
        match self {
            Self::Free(_) => std::mem::replace(self, Self::Taken),
            Self::Taken => Self::Taken,
            Self::Over => Self::Over,
        }
    }

    /// Ends all turns.
    fn end(&mut self) -> Self {
        std::mem::replace(self, Self::Over)
    }
}

/// Interval at which a thread looks whether its turn has come.
const TURN: Duration = Duration::from_millis(2);

/// Iterator of samples, which other threads make ahead.
#[pyclass(frozen, module = "syntable._syntable")]
pub struct Generator {
    turn: Mutex<Turn>,
    events: Events,
    progress: Option<Py<PyAny>>,
    stop: Stop,
    failed: Mutex<Vec<u32>>,
}

#[pymethods]
impl Generator {
    /// Starts to make samples. `products` are the names of what samples have; `scenes` are the first number, the end and the step.
    #[new]
    #[pyo3(signature = (recipe, products, scenes, threads, allow_code, progress))]
    fn new(
        py: Python<'_>,
        recipe: &Recipe,
        products: Vec<String>,
        scenes: Option<(u32, u32, usize)>,
        threads: Option<usize>,
        allow_code: bool,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        check_process(py)?;
        let (recipe, warnings) = recipe.load(py, &products)?;
        let (sender, events): (EventSender, _) = events();
        warnings.into_iter().for_each(|warning| sender.message(&Message::Diagnostic(warning)));
        let stop = Stop::default();
        let mut options = GenerateOptions { products, allow_code, stop: stop.clone(), ..GenerateOptions::default() };
        options.threads = threads.unwrap_or(options.threads);
        let sender = Arc::new(sender);
        let made = match scenes {
            Some((first, end, step)) if step > 1 => {
                syntable::Generator::of_scenes(recipe, options, (first..end).step_by(step), sender)
            }
            scenes => {
                options.scenes = scenes.map(|(first, end, _)| first..end);
                syntable::Generator::start(recipe, options, sender)
            }
        };
        Ok(Self { turn: Mutex::new(Turn::Free(made)), events, progress, stop, failed: Mutex::default() })
    }

    fn __iter__(self_: PyRef<'_, Self>) -> PyRef<'_, Self> {
        self_
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Sample>> {
        check_process(py)?;
        let mut made = loop {
            let turn = self.turn.lock().take();
            match turn {
                Turn::Free(made) => break made,
                Turn::Over => return Ok(None),
                Turn::Taken => {
                    py.detach(|| thread::sleep(TURN));
                    py.check_signals()?;
                }
            }
        };
        let waited = loop {
            let waited = py.detach(|| made.next_within(SIGNALS));
            let shown = self.show(py).and_then(|()| py.check_signals());
            if let Err(raised) = shown {
                self.stop.cancel();
                self.turn.lock().end();
                end(made, true);
                return Err(raised);
            }
            if let Waited::Next(next) = waited {
                break next;
            }
        };
        let mut turn = self.turn.lock();
        if matches!(*turn, Turn::Over) {
            // Another thread closed the work meanwhile.
            drop(turn);
            drop(waited);
            return end(made, true).map_or(Ok(None), Err);
        }
        match waited {
            Some(Ok(sample)) => {
                *turn = Turn::Free(made);
                Ok(Some(Sample::made(*sample)))
            }
            Some(Err(error)) => {
                turn.end();
                Err(exception(py, &error))
            }
            None => {
                turn.end();
                self.failed.lock().clone_from(&made.result().failed);
                Ok(None)
            }
        }
    }

    /// Numbers of the scenes that failed; complete after the last sample.
    #[getter]
    fn failed(&self) -> Vec<u32> {
        self.failed.lock().clone()
    }

    /// Ends the work. Later calls of `next` raise StopIteration.
    fn close(&self) -> PyResult<()> {
        self.stop.cancel();
        let ended = self.turn.lock().end();
        end(ended, false).map_or(Ok(()), Err)
    }
}

/// Ends the work. Its threads may need Python's lock to end.
impl Drop for Generator {
    fn drop(&mut self) {
        self.stop.cancel();
        let ended = self.turn.lock().end();
        end(ended, false);
    }
}

impl Generator {
    /// Passes the events that are here to Python.
    fn show(&self, py: Python<'_>) -> PyResult<()> {
        while let Some(event) = self.events.here() {
            show(py, self.progress.as_ref(), &event)?;
        }
        Ok(())
    }
}
