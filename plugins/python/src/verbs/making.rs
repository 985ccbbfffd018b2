//! Verbs that make datasets of recipes, and check them.

use super::{json, left_out, threads_or_all};
use crate::errors::exception;
use crate::recipe::Recipe;
use crate::registry::registry;
use crate::work::wait_for;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Value as Json, json as object};
use std::path::PathBuf;
use std::time::Duration;
use syntable::{DiskCache, MergeOptions, RunOptions};
use syntable_model::store::StoreFolder;
use syntable_recipe::Component;
use syntable_recipe::message::Message;
use syntable_runtime::run::forecast::{self, Forecast, ForecastOptions};
use syntable_runtime::run::progress::Reporter;
use syntable_runtime::run::{ClaimOptions, RunOutcome, Shard, ShardChoice};

/// The scenes that a run makes: their range, the text of a shard, and the block and lease of a worker's claims.
type Part = (Option<(u32, u32)>, Option<String>, Option<(u32, f64)>);

/// Makes the dataset of a recipe, or continues it. `flags` are the names of options to switch on.
#[pyfunction]
#[pyo3(signature = (recipe, out, part, threads, flags, progress))]
pub fn run<'py>(
    py: Python<'py>,
    recipe: &Recipe,
    out: PathBuf,
    part: Part,
    threads: Option<usize>,
    flags: Vec<String>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (recipe, warnings) = recipe.load(py, &[])?;
    let (scenes, shard, claim) = part;
    let claim = claim.map(|(block, lease)| ClaimOptions { block, lease: Duration::from_secs_f64(lease) });
    let shard = shard.map(|text| shard_of(py, &text)).transpose()?;
    let out = shard.map_or_else(|| out.clone(), |shard| shard.folder(&out));
    let (path, out) = (out.clone(), folder_at(py, &out)?);
    let outcome = wait_for(py, progress.as_ref(), move |sender, stop| {
        let has = |name: &str| flags.iter().any(|flag| flag == name);
        warnings.into_iter().for_each(|warning| sender.message(&Message::Diagnostic(warning)));
        let options = RunOptions {
            scenes: scenes.map(|(first, end)| first..end),
            shard,
            claim,
            allow_code: has("allow_code"),
            overwrite: has("overwrite"),
            retry_failed: has("retry_failed"),
            repair: has("repair"),
            rewrite: has("rewrite"),
            stop: stop.clone(),
            ..RunOptions::new(out, threads_or_all(threads), DiskCache::of_user())
        };
        syntable::run(&recipe, &options, sender)
    })?;
    outcome_of(py, outcome, path)
}

/// The folder at a path or a URL.
fn folder_at(py: Python<'_>, name: &PathBuf) -> PyResult<StoreFolder> {
    StoreFolder::at(name).map_err(|error| exception(py, &error))
}

/// The shard that a text such as `3/10` or `auto` means.
fn shard_of(py: Python<'_>, text: &str) -> PyResult<Shard> {
    let choice: ShardChoice = text.parse().map_err(PyValueError::new_err)?;
    let (shard, _) = choice.resolve(&|name| std::env::var(name).ok()).map_err(|error| exception(py, &error))?;
    Ok(shard)
}

fn outcome_of(py: Python<'_>, outcome: RunOutcome, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let result = PyDict::new(py);
    result.set_item("path", path.into_os_string())?;
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

/// Merges the parts of a dataset. `flags` are the names of options to switch on.
#[pyfunction]
#[pyo3(signature = (parts, out, threads, flags, progress))]
pub fn merge<'py>(
    py: Python<'py>,
    parts: Vec<PathBuf>,
    out: PathBuf,
    threads: Option<usize>,
    flags: Vec<String>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (registry, path, out) = (registry(py)?, out.clone(), folder_at(py, &out)?);
    let parts = parts.iter().map(|part| folder_at(py, part)).collect::<PyResult<Vec<_>>>()?;
    let outcome = wait_for(py, progress.as_ref(), move |sender, stop| {
        let has = |name: &str| flags.iter().any(|flag| flag == name);
        let options = MergeOptions {
            allow_code: has("allow_code"),
            partial: has("partial"),
            mixed_devices: has("mixed_devices"),
            stop: stop.clone(),
            ..MergeOptions::new(threads_or_all(threads))
        };
        syntable::merge(&registry, &out, &parts, &options, sender)
    })?;
    outcome_of(py, outcome, path)
}

/// The state of datasets, or of the datasets in folders.
#[pyfunction]
#[pyo3(signature = (datasets))]
pub fn status(py: Python<'_>, datasets: Vec<PathBuf>) -> PyResult<Bound<'_, PyAny>> {
    let datasets = datasets.iter().map(|dataset| folder_at(py, dataset)).collect::<PyResult<Vec<_>>>()?;
    let found = wait_for(py, None, move |_, _| syntable_runtime::run::status(&datasets))?;
    json(py, &object!(found))
}

/// Compares the files of a dataset with its journal.
#[pyfunction]
#[pyo3(signature = (dataset, threads))]
pub fn verify(py: Python<'_>, dataset: PathBuf, threads: Option<usize>) -> PyResult<Bound<'_, PyAny>> {
    let dataset = folder_at(py, &dataset)?;
    let found = wait_for(py, None, move |_, _| syntable::verify(&dataset, threads_or_all(threads)))?;
    let result = object!({
        "scenes": found.scenes,
        "files": found.files,
        "missing": found.missing,
        "damaged": found.damaged,
        "faults": found.faults,
        "unlisted": found.unlisted.iter().map(|(scene, paths)| object!([scene, paths])).collect::<Vec<_>>(),
        "foreign": found.foreign,
        "links": found.links,
        "linked": found.linked,
        "outside": found.outside,
        "bad_scenes": found.bad_scenes,
        "unfinished": found.unfinished,
        "whole": found.whole(),
    });
    json(py, &result)
}

/// The products and stages of a recipe. With `measured`, also the time of its run: from as many scenes, or from as many as ten
/// seconds allow if it is 0.
#[pyfunction]
#[pyo3(signature = (recipe, measured, threads, allow_code, progress))]
pub fn plan<'py>(
    py: Python<'py>,
    recipe: &Recipe,
    measured: Option<u32>,
    threads: Option<usize>,
    allow_code: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let Some(measured) = measured else {
        let planned = recipe.checked(py)?.map_err(|report| crate::errors::of_recipe(py, &report))?.0;
        return json(py, &of_recipe(&planned, None));
    };
    let (recipe, warnings) = recipe.load(py, &[])?;
    recipe.ready(allow_code).map_err(|error| exception(py, &error))?;
    let (recipe, found) = wait_for(py, progress.as_ref(), move |sender, stop| {
        warnings.into_iter().for_each(|warning| sender.message(&Message::Diagnostic(warning)));
        let options = ForecastOptions {
            measured: Some(measured).filter(|measured| *measured > 0),
            threads: threads_or_all(threads),
            allow_code,
            cache: DiskCache::of_user(),
            stop: stop.clone(),
        };
        let found = forecast::forecast(&recipe, &options, sender)?;
        Ok((recipe, found))
    })?;
    json(py, &of_recipe(&recipe, Some(&found)))
}

fn of_recipe(recipe: &syntable_recipe::Recipe, time: Option<&Forecast>) -> Json {
    let total: f64 = recipe.components.weights().map(|(weight, _)| weight).sum();
    let component = |(weight, component): (f64, &Component)| {
        let entry = |entry: &syntable_recipe::plan::PlanEntry| {
            object!({
                "product": entry.key.to_string(),
                "provider": entry.provider.to_string(),
                "per": entry.key.scope.to_string(),
                "wanted_by": entry.wanted_by,
            })
        };
        object!({
            "name": component.id,
            "share": weight / total,
            "products": component.plan.entries.iter().map(entry).collect::<Vec<_>>(),
            "idle": component.plan.idle.iter().map(|idle| &idle.stage).collect::<Vec<_>>(),
            "render": component.render.cost(),
            "text": component.plan.table(&*component.render),
        })
    };
    object!({
        "name": recipe.dataset.name,
        "scenes": recipe.dataset.scenes,
        "views_per_scene": recipe.dataset.views_per_scene,
        "components": recipe.components.weights().map(component).collect::<Vec<_>>(),
        "bytes_per_view": recipe.stored_bytes_per_view(),
        "time": time.map(of_forecast),
    })
}

fn of_forecast(found: &Forecast) -> Json {
    let pace = &found.pace;
    object!({
        "measured": pace.measured,
        "threads": found.threads,
        "objects": pace.objects,
        "start_s": pace.start_s,
        "scene_s": pace.scene_s,
        "total_s": pace.total_s,
        "total_range_s": pace.total_range_s,
        "images_per_hour": found.images_per_hour(),
        "scene_bytes": found.scene_bytes,
        "total_bytes": found.total_bytes(),
        "limit": match pace.bound {
            forecast::Bound::Cores => "cores",
            forecast::Bound::RenderDevice => "render device",
            forecast::Bound::SceneSteps => "steps of a scene",
        },
        "stages_s": pace.stages,
        "unmeasured": found.unmeasured,
    })
}
