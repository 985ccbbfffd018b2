//! The verbs of the command, each a function of the library.

mod datasets;
mod evaluation;
mod making;
mod showing;

pub use datasets::{convert, report, stats, validate};
pub use evaluation::evaluate;
pub use making::{merge, plan, run, status, verify};
pub use showing::{Viewer, preview};

use crate::errors::exception;
use crate::values::to_python;
use pyo3::prelude::*;
use serde::Serialize;
use std::path::{Path, PathBuf};
use syntable::workers;
use syntable::{DatasetSource, ImageWork, Pool, Stop};
use syntable_model::error::Result;
use syntable_model::product::Value;
use syntable_recipe::message::Message;
use syntable_runtime::left_out::LeftOutReport;
use syntable_runtime::run::progress::Reporter;

/// The texts of data that a result omits.
pub fn left_out(report: LeftOutReport) -> Vec<String> {
    let warnings = report.messages(Path::new(""), "").into_iter();
    warnings
        .filter_map(|message| if let Message::Warning(error) = message { Some(error.to_string()) } else { None })
        .collect()
}

/// The texts of data that a result omits, after a warning of Python for them. For work whose events do not name them.
pub fn warned(py: Python<'_>, report: impl IntoIterator<Item = LeftOutReport>) -> PyResult<Vec<String>> {
    let texts: Vec<String> = report.into_iter().flat_map(left_out).collect();
    warn_left_out(py, &texts)?;
    Ok(texts)
}

/// Warns that data are left out.
pub fn warn_left_out(py: Python<'_>, texts: &[String]) -> PyResult<()> {
    py.import("syntable.progress")?.call_method1("warn_left_out", (texts,)).map(drop)
}

/// A dataset as a caller names it: its path, its format, the folder of its images, whether its names may lead elsewhere.
pub type Named = (PathBuf, Option<String>, Option<PathBuf>, bool);

/// The dataset, and its format if a caller names it. Lists the files of a URL.
pub fn source((path, format, image_folder, trust_paths): Named) -> Result<(DatasetSource, Option<String>)> {
    Ok((DatasetSource::at_name(&path, image_folder.as_deref())?.trusting(trust_paths), format))
}

/// The number of threads that a caller names, or else of cores.
pub fn threads_or_all(threads: Option<usize>) -> usize {
    threads.unwrap_or_else(workers::available)
}

/// Does work on images with as many threads.
pub fn on_images<T>(
    threads: Option<usize>,
    reporter: &dyn Reporter,
    stop: &Stop,
    work: impl FnOnce(&ImageWork) -> Result<T>,
) -> Result<T> {
    let pool = Pool::new(threads_or_all(threads))?;
    work(&ImageWork { workers: &pool, reporter, stop })
}

/// A serializable value as a Python object.
pub fn json<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let value = Value::of(value).map_err(|error| exception(py, &error))?;
    to_python(py, value)
}
