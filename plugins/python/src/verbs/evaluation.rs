//! Scores of predictions.

use super::{Named, json, on_images, source, warned};
use crate::masks::Mask;
use crate::registry::registry;
use crate::work::wait_for;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use syntable::evaluation::masked_object::{DetectedMasks, Occluded};
use syntable::evaluation::memory::{Detection, PredictedImage};
use syntable::evaluation::{Convention, evaluate_detections};
use syntable::{DatasetSource, EvaluateOptions};
use syntable_runtime::durable::write_file;

/// Options of an evaluation.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options {
    min_score: f64,
    occluded_from: Option<f64>,
    convention: String,
    metrics: Vec<String>,
    by_category: bool,
    bootstrap: Option<u32>,
    seed: u64,
    worst_by: Option<String>,
    worst: Option<usize>,
    save: Option<PathBuf>,
}

/// An image of the ground truth.
#[derive(FromPyObject)]
pub enum Image {
    Place(usize),
    Name(String),
}

/// A predicted object: its image, score, category, visible, amodal and occlusion mask, and whether it is occluded.
pub type Predicted<'py> =
    (Image, f64, Option<u32>, PyRef<'py, Mask>, Option<PyRef<'py, Mask>>, Option<PyRef<'py, Mask>>, Option<bool>);

/// Predictions: a dataset or a result file, or objects.
#[derive(FromPyObject)]
pub enum Predictions<'py> {
    Files(Named),
    Objects(Vec<Predicted<'py>>),
}

fn detection((image, score, category, visible, amodal, occlusion, is_occluded): Predicted<'_>) -> Detection {
    let image = match image {
        Image::Place(place) => PredictedImage::Place(place),
        Image::Name(name) => PredictedImage::Name(name),
    };
    let [amodal, occlusion] = [amodal, occlusion].map(|mask| mask.map(|mask| mask.0.clone()));
    let masks = DetectedMasks { visible: visible.0.clone(), amodal, occlusion, is_occluded };
    Detection { image, score, category, masks }
}

/// Scores predictions: what `syntable eval --json` prints, and the same as text and as CSV.
#[pyfunction]
#[pyo3(signature = (dataset, predictions, options, threads, progress))]
pub fn evaluate<'py>(
    py: Python<'py>,
    dataset: Named,
    predictions: Predictions<'py>,
    options: Options,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let registry = registry(py)?;
    let (files, objects) = match predictions {
        Predictions::Files(named) => (Some(named), None),
        Predictions::Objects(objects) => (None, Some(objects.into_iter().map(detection).collect::<Vec<Detection>>())),
    };
    let convention = match options.convention.as_str() {
        "release" => Convention::Release,
        "paper" => Convention::Paper,
        other => return Err(PyValueError::new_err(format!("convention is 'release' or 'paper', not {other:?}"))),
    };
    let (save, worst) = (options.save, options.worst.unwrap_or(usize::MAX));
    let (table, text, csv, lost) = wait_for(py, progress.as_ref(), move |sender, stop| {
        let (truth, truth_format) = source(dataset)?;
        let (files, predictions_format) =
            files.map_or_else(|| Ok((DatasetSource::new("predictions"), None)), source)?;
        let defaults = EvaluateOptions::new(truth, files);
        let options = EvaluateOptions {
            truth_format,
            predictions_format,
            min_score: options.min_score,
            occluded: options.occluded_from.map_or(defaults.occluded, Occluded::From),
            convention,
            metrics: options.metrics,
            by_category: options.by_category,
            bootstrap: options.bootstrap,
            seed: options.seed,
            rank_by: options.worst_by,
            ..defaults
        };
        on_images(threads, sender, stop, |work| {
            let found = match objects {
                Some(objects) => evaluate_detections(&registry, &options, objects, work)?,
                None => syntable::evaluate(&registry, &options, work)?,
            };
            if let Some(file) = save {
                write_file(&file, found.with_worst(worst, work)?.text().as_bytes())?;
            }
            let table = found.table();
            Ok((table.json(), table.text(), found.csv(), found.left_out()))
        })
    })?;
    let result = PyDict::new(py);
    result.set_item("json", json(py, &table)?)?;
    result.set_item("text", text)?;
    result.set_item("csv", csv)?;
    result.set_item("left_out", warned(py, [lost])?)?;
    Ok(result)
}
