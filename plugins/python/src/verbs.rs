//! Verbs that write files.

use crate::errors::exception;
use crate::recipe::Recipe;
use crate::registry::registry;
use crate::values::to_python;
use crate::work::wait_for;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;
use std::path::{Path, PathBuf};
use syntable::workers;
use syntable::{DatasetSource, DiskCache, ImageWork, Pool, RunOptions};
use syntable_model::product::Value;
use syntable_recipe::message::Message;
use syntable_runtime::conversion::ConvertOptions;
use syntable_runtime::left_out::LeftOutReport;
use syntable_runtime::run::progress::Reporter;

/// Makes the dataset of a recipe, or continues it. `flags` are the names of options to switch on.
#[pyfunction]
#[pyo3(signature = (recipe, out, scenes, threads, flags, progress))]
pub fn run<'py>(
    py: Python<'py>,
    recipe: &Recipe,
    out: PathBuf,
    scenes: Option<(u32, u32)>,
    threads: Option<usize>,
    flags: Vec<String>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (recipe, warnings) = recipe.load(py, &[])?;
    let has = |name: &str| flags.iter().any(|flag| flag == name);
    let outcome = wait_for(py, progress.as_ref(), |sender, stop| {
        warnings.into_iter().for_each(|warning| sender.message(&Message::Diagnostic(warning)));
        let options = RunOptions {
            scenes: scenes.map(|(first, end)| first..end),
            allow_libraries: has("allow_libraries"),
            overwrite: has("overwrite"),
            retry_failed: has("retry_failed"),
            repair: has("repair"),
            rewrite: has("rewrite"),
            stop: stop.clone(),
            ..RunOptions::new(out, threads.unwrap_or_else(workers::available), DiskCache::of_user())
        };
        syntable::run(&recipe, &options, sender)
    })?;
    let result = PyDict::new(py);
    result.set_item("scenes", outcome.scenes)?;
    result.set_item("images", outcome.images)?;
    result.set_item("failed", outcome.failed)?;
    result.set_item("missing", outcome.missing)?;
    result.set_item("lacking", outcome.lacking)?;
    result.set_item("useless", outcome.useless.iter().map(|(what, _)| *what).collect::<Vec<_>>())?;
    result.set_item("bad_assets", &outcome.bad_assets)?;
    result.set_item("left_out", left_out(outcome.left_out()))?;
    Ok(result)
}

/// The texts of data that a result omits.
fn left_out(report: LeftOutReport) -> Vec<String> {
    let warnings = report.messages(Path::new(""), "").into_iter();
    warnings
        .filter_map(|message| if let Message::Warning(error) = message { Some(error.to_string()) } else { None })
        .collect()
}

/// A dataset as a caller names it: its path, its format, the folder of its images, whether its names may lead elsewhere.
type Named = (PathBuf, Option<String>, Option<PathBuf>, bool);

/// Writes a dataset in other formats. `settings` are options as `KIND.KEY=VALUE`, with the value as TOML.
#[pyfunction]
#[pyo3(signature = (dataset, to, out, settings, threads, progress))]
pub fn convert<'py>(
    py: Python<'py>,
    dataset: Named,
    to: Vec<String>,
    out: PathBuf,
    settings: Vec<String>,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let registry = registry(py)?;
    let (path, format, image_folder, trust_paths) = dataset;
    let conversion = wait_for(py, progress.as_ref(), |sender, stop| {
        let options = ConvertOptions {
            format,
            image_folder,
            trust_paths,
            to,
            set: settings,
            threads: threads.unwrap_or_else(workers::available),
            stop: stop.clone(),
            ..ConvertOptions::new(path, &[], out)
        };
        syntable::convert(&registry, &options, sender)
    })?;
    let result = PyDict::new(py);
    result.set_item("format", conversion.format)?;
    result.set_item("images", conversion.converted.images)?;
    result.set_item("lacking", conversion.lacking().into_iter().collect::<Vec<_>>())?;
    result.set_item("left_out", left_out(conversion.left_out()))?;
    Ok(result)
}

/// Checks the labels of a dataset. Returns what `syntable validate --json` prints of it.
#[pyfunction]
#[pyo3(signature = (dataset, threads, progress))]
pub fn validate<'py>(
    py: Python<'py>,
    dataset: Named,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let registry = registry(py)?;
    let (path, format, image_folder, trust_paths) = dataset;
    let found = wait_for(py, progress.as_ref(), |sender, stop| {
        let pool = Pool::new(threads.unwrap_or_else(workers::available))?;
        let work = ImageWork { workers: &pool, reporter: sender, stop };
        let source = DatasetSource::new(path).trusting(trust_paths).with_images_in(image_folder);
        syntable::validate(&registry, &source, format.as_deref(), &work)
    })?;
    let result = json(py, &found.found)?;
    result.set_item("format", found.format)?;
    Ok(result)
}

/// A serializable value as a Python object.
fn json<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let value = Value::of(value).map_err(|error| exception(py, &error))?;
    to_python(py, value)
}
