//! Verbs that read datasets.

use super::{Named, json, on_images, source, threads_or_all, warned};
use crate::errors::exception;
use crate::registry::registry;
use crate::work::wait_for;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use syntable::report::make::{ReportOptions, make};
use syntable::stats::distribution::Binning;
use syntable::stats::{Edges, StatisticsOptions, compare, table};
use syntable_model::error::Error;
use syntable_model::store::StoreFolder;
use syntable_runtime::conversion::ConvertOptions;

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
    let out = StoreFolder::at(out).map_err(|error| exception(py, &error))?;
    let conversion = wait_for(py, progress.as_ref(), move |sender, stop| {
        let options = ConvertOptions {
            format,
            image_folder,
            trust_paths,
            to,
            set: settings,
            threads: threads_or_all(threads),
            stop: stop.clone(),
            ..ConvertOptions::new(path, &[], out)
        };
        syntable::convert(&registry, &options, sender)
    })?;
    let result = PyDict::new(py);
    result.set_item("format", conversion.format)?;
    result.set_item("images", conversion.converted.images)?;
    result.set_item("lacking", conversion.lacking().into_iter().collect::<Vec<_>>())?;
    result.set_item("left_out", warned(py, [conversion.left_out()])?)?;
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
    let found = wait_for(py, progress.as_ref(), move |sender, stop| {
        let (source, format) = source(dataset)?;
        on_images(threads, sender, stop, |work| syntable::validate(&registry, &source, format.as_deref(), work))
    })?;
    let result = json(py, &found.found)?;
    result.set_item("format", found.format)?;
    Ok(result)
}

/// Statistics of datasets: what `syntable stats --json` prints, and the same as text and as CSV. `edges` and `bins` are values of
/// the command's options.
#[pyfunction]
#[pyo3(signature = (datasets, labels_only, edges, bins, prefixes, duplicate_levels, threads, progress))]
#[expect(clippy::too_many_arguments, reason = "the options of a verb")]
pub fn stats<'py>(
    py: Python<'py>,
    datasets: Vec<Named>,
    labels_only: bool,
    edges: &str,
    bins: &str,
    prefixes: bool,
    duplicate_levels: u8,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let unknown =
        |name: &str, value: &str, known: &str| PyValueError::new_err(format!("{name} is {known}, not {value:?}"));
    let options = StatisticsOptions {
        labels_only,
        edges: match edges {
            "pixels" => Edges::Pixels,
            "iou" => Edges::Iou,
            "stored" => Edges::Stored,
            _ => return Err(unknown("edges", edges, "'pixels', 'iou' or 'stored'")),
        },
        prefixes,
        levels: duplicate_levels,
        binning: match bins {
            "fixed" => Binning::Fixed,
            "equal" => Binning::Equal,
            _ => return Err(unknown("bins", bins, "'fixed' or 'equal'")),
        },
    };
    let registry = registry(py)?;
    let found = wait_for(py, progress.as_ref(), move |sender, stop| {
        let (mut all, mut left_out) = (Vec::new(), Vec::new());
        on_images(threads, sender, stop, |work| {
            // Each dataset can have a format of its own.
            for dataset in datasets {
                let (source, format) = source(dataset)?;
                let found = compare(&registry, &[source], format.as_deref(), &options, work)?;
                all.extend(found.datasets);
                left_out.push(found.left_out);
            }
            Ok(())
        })?;
        syntable::stats::bin_alike(
            &mut all.iter_mut().map(|it| &mut it.statistics).collect::<Vec<_>>(),
            options.binning,
        );
        let [text, csv] = [table::text(&all), table::csv(&all)];
        let json: serde_json::Value =
            serde_json::from_str(&table::json(&all)).map_err(|error| Error::new(error.to_string()))?;
        Ok((json, text, csv, left_out))
    })?;
    let (all, text, csv, lost) = found;
    let result = PyDict::new(py);
    result.set_item("json", json(py, &all)?)?;
    result.set_item("text", text)?;
    result.set_item("csv", csv)?;
    result.set_item("left_out", warned(py, lost)?)?;
    Ok(result)
}

/// Makes web pages about a dataset.
#[pyfunction]
#[pyo3(signature = (dataset, out, scores, images, scenes, labels_only, overwrite, threads, progress))]
#[expect(clippy::too_many_arguments, reason = "the options of a verb")]
pub fn report<'py>(
    py: Python<'py>,
    dataset: Named,
    out: Option<PathBuf>,
    scores: Option<PathBuf>,
    images: Option<usize>,
    scenes: Option<usize>,
    labels_only: bool,
    overwrite: bool,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let registry = registry(py)?;
    let (images, scenes) = (images.unwrap_or(usize::MAX), scenes.unwrap_or(usize::MAX));
    let made = wait_for(py, progress.as_ref(), move |sender, stop| {
        let (source, format) = source(dataset)?;
        let options =
            ReportOptions { format, out, overwrite, scores, images, scenes, labels_only, ..ReportOptions::new(source) };
        on_images(threads, sender, stop, |work| make(&registry, &options, work))
    })?;
    let result = PyDict::new(py);
    result.set_item("index", made.index.display().to_string())?;
    result.set_item("format", made.format)?;
    result.set_item("images", made.images)?;
    result.set_item("all_images", made.all_images)?;
    result.set_item("scenes", made.scenes)?;
    result.set_item("notes", made.notes.iter().map(ToString::to_string).collect::<Vec<_>>())?;
    result.set_item("left_out", warned(py, [made.left_out])?)?;
    Ok(result)
}
