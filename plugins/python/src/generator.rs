//! Samples in memory, one after the other.

use crate::errors::exception;
use crate::recipe::Recipe;
use crate::sample::Sample;
use crate::work::{EventSender, Events, SIGNALS, check_process, events, show};
use parking_lot::Mutex;
use pyo3::prelude::*;
use std::sync::Arc;
use syntable::{GenerateOptions, Stop};
use syntable_recipe::message::Message;
use syntable_runtime::generate::Waited;
use syntable_runtime::run::progress::Reporter;

/// Iterator of samples, which other threads make ahead.
#[pyclass(frozen, module = "syntable._syntable")]
pub struct Generator {
    /// None while a thread waits for a sample, and after [`Generator::close`].
    made: Mutex<Option<syntable::Generator>>,
    events: Events,
    progress: Option<Py<PyAny>>,
    stop: Stop,
    failed: Mutex<Vec<u32>>,
}

#[pymethods]
impl Generator {
    /// Starts to make samples. `products` are the names of what samples have; scenes are half-open.
    #[new]
    #[pyo3(signature = (recipe, products, scenes, threads, allow_libraries, progress))]
    fn new(
        py: Python<'_>,
        recipe: &Recipe,
        products: Vec<String>,
        scenes: Option<(u32, u32)>,
        threads: Option<usize>,
        allow_libraries: bool,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        check_process(py)?;
        let (recipe, warnings) = recipe.load(py, &products)?;
        let (sender, events): (EventSender, _) = events();
        warnings.into_iter().for_each(|warning| sender.message(&Message::Diagnostic(warning)));
        let stop = Stop::default();
        let mut options =
            GenerateOptions { products, allow_libraries, stop: stop.clone(), ..GenerateOptions::default() };
        options.scenes = scenes.map(|(first, end)| first..end);
        options.threads = threads.unwrap_or(options.threads);
        let made = syntable::Generator::start(recipe, options, Arc::new(sender));
        Ok(Self { made: Mutex::new(Some(made)), events, progress, stop, failed: Mutex::default() })
    }

    fn __iter__(self_: PyRef<'_, Self>) -> PyRef<'_, Self> {
        self_
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Sample>> {
        check_process(py)?;
        let Some(mut made) = self.made.lock().take() else { return Ok(None) };
        let waited = loop {
            let waited = py.detach(|| made.next_within(SIGNALS));
            let shown = self.show(py).and_then(|()| py.check_signals());
            if let Err(raised) = shown {
                self.stop.cancel();
                py.detach(|| drop(made));
                return Err(raised);
            }
            if let Waited::Next(next) = waited {
                break next;
            }
        };
        match waited {
            Some(Ok(sample)) => {
                *self.made.lock() = Some(made);
                Ok(Some(Sample::made(*sample)))
            }
            Some(Err(error)) => Err(exception(py, &error)),
            None => {
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
    fn close(&self, py: Python<'_>) {
        self.stop.cancel();
        let made = self.made.lock().take();
        py.detach(|| drop(made));
    }
}

/// Ends the work. Its threads may need Python's lock to end.
impl Drop for Generator {
    fn drop(&mut self) {
        self.stop.cancel();
        let Some(made) = self.made.lock().take() else { return };
        let mut made = Some(made);
        if Python::try_attach(|py| py.detach(|| drop(made.take()))).is_none() {
            // Python is gone, and with it all that waits for the threads.
            std::mem::forget(made);
        }
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
