//! Previews of recipes, and datasets in a browser.

use super::{Named, source, threads_or_all};
use crate::errors::exception;
use crate::recipe::Recipe;
use crate::registry::registry;
use crate::work::{check_process, is_forked, wait_for};
use numpy::ndarray::Array3;
use numpy::{IntoPyArray, PyArray3};
use parking_lot::Mutex;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::thread::{self, JoinHandle};
use syntable::preview::{PassEnd, Preview};
use syntable::{Pool, PreviewOptions, Stop, view};
use syntable_model::error::Error;

/// Renders a contact sheet of a recipe. Returns its pixels and the number of scenes that failed.
#[pyfunction]
#[pyo3(signature = (recipe, scenes, samples, width, labels, threads, allow_code, progress))]
#[expect(clippy::too_many_arguments, reason = "the options of a verb")]
pub fn preview<'py>(
    py: Python<'py>,
    recipe: &Recipe,
    scenes: Option<(u32, u32)>,
    samples: u32,
    width: u32,
    labels: bool,
    threads: Option<usize>,
    allow_code: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Bound<'py, PyArray3<u8>>, u32)> {
    // Raises the mistakes of the recipe.
    recipe.load(py, &[])?;
    let registry = registry(py)?;
    let scenes = scenes.map(|(first, end)| format!("{first}..{end}").parse()).transpose();
    let scenes = scenes.map_err(|error: String| exception(py, &Error::new(error)))?;
    let options = PreviewOptions {
        scenes,
        samples,
        width,
        labels,
        allow_code,
        out: None,
        threads: threads_or_all(threads),
        ..PreviewOptions::new(recipe.request())
    };
    let (end, sheet) = wait_for(py, progress.as_ref(), move |sender, stop| {
        Preview::new(&registry, options, sender).and_then(|mut preview| preview.sheet(stop))
    })?;
    let (PassEnd::Done { failed, .. }, Some(sheet)) = (end, sheet) else {
        return Err(exception(
            py,
            &Error::new("the recipe cannot be previewed").help("`Recipe.check` names all mistakes"),
        ));
    };
    let (height, width) = (sheet.height() as usize, sheet.width() as usize);
    let pixels = sheet.data().as_flattened().to_vec();
    let pixels = Array3::from_shape_vec((height, width, 3), pixels)
        .map_err(|error| exception(py, &Error::new(error.to_string())))?;
    Ok((pixels.into_pyarray(py), failed))
}

/// A dataset that a local server shows.
#[pyclass(frozen, module = "syntable._syntable")]
pub struct Viewer {
    /// Address of the first page.
    #[pyo3(get)]
    url: String,
    stop: Stop,
    server: Mutex<Option<JoinHandle<()>>>,
}

#[pymethods]
impl Viewer {
    /// Opens a dataset and serves its pages.
    #[new]
    #[pyo3(signature = (dataset, scores, port, threads))]
    fn new(
        py: Python<'_>,
        dataset: Named,
        scores: Option<PathBuf>,
        port: u16,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        check_process(py)?;
        let registry = registry(py)?;
        let opened = py.detach(|| {
            let (source, format) = source(dataset)?;
            let viewer = view::Viewer::open(&registry, &source, format.as_deref(), scores.as_deref(), port)?;
            Ok((viewer, Pool::new(threads_or_all(threads))?))
        });
        let (viewer, pool) = opened.map_err(|error| exception(py, &error))?;
        let (url, stop) = (viewer.url(), Stop::default());
        let asked = stop.clone();
        let server = thread::spawn(move || viewer.run(&pool, &asked));
        Ok(Self { url, stop, server: Mutex::new(Some(server)) })
    }

    /// Whether the server still answers.
    #[getter]
    fn is_open(&self) -> bool {
        self.server.lock().as_ref().is_some_and(|server| !server.is_finished())
    }

    /// Ends the server.
    fn close(&self, py: Python<'_>) {
        self.stop.cancel();
        let server = self.server.lock().take();
        if is_forked() {
            std::mem::forget(server);
        } else {
            py.detach(|| server.map(JoinHandle::join));
        }
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        // The rest of the statistics no longer matters.
        self.stop.cancel();
    }
}
