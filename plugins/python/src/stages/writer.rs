//! Writers in Python.

use crate::errors::exception;
use crate::sample::Sample;
use crate::stages::call::with_python;
use crate::stages::kind::Kind;
use parking_lot::Mutex;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::io::Read;
use std::sync::Arc;
use syntable_model::context::{DatasetContext, ImageContext, ImagesContext};
use syntable_model::error::{Error, Result};
use syntable_model::product::Products;
use syntable_model::random::Stream;
use syntable_model::registry::{Slot, Stage};
use syntable_model::scene::SceneId;
use syntable_model::stage::{DatasetInfo, Finish, Input, Output, SceneWriter, Writer};

/// A writer in Python, with the instance of its class for some options.
struct PythonWriter {
    stage: Arc<str>,
    reads: Vec<Input>,
    /// From the instance, the view, the seed of its random numbers, its size and the output to nothing.
    write: Arc<Py<PyAny>>,
    /// From the instance, the dataset and the output to nothing.
    finish: Option<Arc<Py<PyAny>>>,
    instance: Arc<Py<PyAny>>,
}

/// Registers a writer.
#[pyfunction]
#[pyo3(signature = (kind, write, finish, reads, optional))]
pub fn add_writer(
    kind: Kind,
    write: Py<PyAny>,
    finish: Option<Py<PyAny>>,
    reads: Vec<String>,
    optional: Vec<String>,
) -> PyResult<()> {
    let stage: Arc<str> = kind.stage(Slot::Write).into();
    let optional = optional.into_iter().map(|name| Input::named(name).optional());
    let reads: Vec<Input> = reads.into_iter().map(Input::named).chain(optional).collect();
    let (write, finish) = (Arc::new(write), finish.map(Arc::new));
    kind.add(Slot::Write, move |instance| {
        Stage::Write(Box::new(PythonWriter {
            stage: Arc::clone(&stage),
            reads: reads.clone(),
            write: Arc::clone(&write),
            finish: finish.clone(),
            instance,
        }))
    })
}

impl Writer for PythonWriter {
    fn reads(&self) -> Vec<Input> {
        self.reads.clone()
    }

    fn scene(&self, _: &ImagesContext, output: Output) -> Result<Box<dyn SceneWriter>> {
        let Self { stage, write, instance, .. } = self;
        Ok(Box::new(PythonSceneWriter {
            stage: Arc::clone(stage),
            write: Arc::clone(write),
            instance: Arc::clone(instance),
            target: Arc::new(Mutex::new(Some(Target::Scene(output)))),
            records: Arc::default(),
            keeps_records: self.finish.is_some(),
        }))
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        let Some(call) = &self.finish else { return Ok(()) };
        let target = Arc::new(Mutex::new(Some(Target::Dataset(finish.clone()))));
        let done = with_python(|py| {
            let dataset = FinishedDataset { info: cx.dataset.clone(), finish: finish.clone() };
            let output = SceneOutput { target: Arc::clone(&target), records: None };
            call.call1(py, (&*self.instance, dataset, output)).map(drop)
        });
        *target.lock() = None;
        done
    }
}

/// Where files of a writer go.
enum Target {
    Scene(Output),
    Dataset(Finish),
}

/// A writer in Python at work on one scene.
struct PythonSceneWriter {
    stage: Arc<str>,
    write: Arc<Py<PyAny>>,
    instance: Arc<Py<PyAny>>,
    target: Arc<Mutex<Option<Target>>>,
    /// Lines of JSON.
    records: Arc<Mutex<String>>,
    keeps_records: bool,
}

impl SceneWriter for PythonSceneWriter {
    fn view(&mut self, cx: &ImageContext, products: &Products) -> Result<()> {
        cx.workers.check_stop();
        let stream = Stream::root(cx.dataset.seed).child(&cx.dataset.name).child(&self.stage);
        let seed = stream.at(cx.scene_id.0.into()).at(cx.view_id.0.into()).seed();
        with_python(|py| {
            let view = Sample::lent(cx.scene_id, cx.view_id, products.clone());
            let [width, height] = cx.size;
            let records = Some(Arc::clone(&self.records));
            let output = SceneOutput { target: Arc::clone(&self.target), records };
            self.write.call1(py, (&*self.instance, view, seed, (height, width), output)).map(drop)
        })
    }

    fn close(self: Box<Self>, _: &ImagesContext, _: &Products) -> Result<()> {
        match self.target.lock().take() {
            Some(Target::Scene(output)) if self.keeps_records => output.write_shard(self.records.lock().as_bytes()),
            _ => Ok(()),
        }
    }
}

impl Drop for PythonSceneWriter {
    fn drop(&mut self) {
        // Python may keep the output of an abandoned scene.
        *self.target.lock() = None;
    }
}

/// Where a writer in Python puts its files.
#[pyclass(frozen, module = "syntable._syntable")]
pub struct SceneOutput {
    target: Arc<Mutex<Option<Target>>>,
    records: Option<Arc<Mutex<String>>>,
}

impl SceneOutput {
    fn with<T: Send>(&self, py: Python<'_>, work: impl FnOnce(&Target) -> Result<T> + Send) -> PyResult<T> {
        let done = py.detach(|| self.target.lock().as_ref().map(work));
        let ended = || PyRuntimeError::new_err("the output has ended: write files before the method returns");
        done.ok_or_else(ended)?.map_err(|error| exception(py, &error))
    }
}

#[pymethods]
impl SceneOutput {
    /// The writer's id in the recipe, which is the name of its folder.
    fn id(&self, py: Python<'_>) -> PyResult<String> {
        self.with(py, |target| {
            Ok(match target {
                Target::Scene(output) => output.id().to_owned(),
                Target::Dataset(finish) => finish.id().to_owned(),
            })
        })
    }

    /// Writes a file at a path relative to the dataset.
    fn write(&self, py: Python<'_>, path: &str, bytes: &[u8]) -> PyResult<()> {
        self.with(py, |target| match target {
            Target::Scene(output) => output.write(path, bytes),
            Target::Dataset(finish) => {
                finish.write(path, |file| file.write_all(bytes).map_err(|error| Error::io(path, &error)))
            }
        })
    }

    /// Keeps a line of JSON for the end of the run.
    fn record(&self, line: &str) -> PyResult<()> {
        let ended = || PyRuntimeError::new_err("records are kept by `write`, and read by `finish`");
        let mut records = self.records.as_ref().ok_or_else(ended)?.lock();
        records.push_str(line);
        records.push('\n');
        Ok(())
    }
}

/// The dataset at the end of a run.
#[pyclass(frozen, module = "syntable._syntable")]
pub struct FinishedDataset {
    info: DatasetInfo,
    finish: Finish,
}

#[pymethods]
impl FinishedDataset {
    /// Name of the dataset.
    #[getter]
    fn name(&self) -> &str {
        &self.info.name
    }

    /// Seed of the dataset.
    #[getter]
    fn seed(&self) -> u64 {
        self.info.seed
    }

    /// Numbers of the scenes that are done, ascending.
    #[getter]
    fn scenes(&self) -> Vec<u32> {
        self.finish.scenes().iter().map(|scene| scene.0).collect()
    }

    /// Categories: ids and names.
    #[getter]
    fn categories(&self) -> Vec<(u32, String)> {
        self.info.categories().map(|(id, name)| (id, name.to_owned())).collect()
    }

    /// The records of a scene: lines of JSON.
    fn records<'py>(&self, py: Python<'py>, scene: u32) -> PyResult<Bound<'py, PyBytes>> {
        let read = || -> Result<Vec<u8>> {
            let mut bytes = Vec::new();
            let read = self.finish.shard(SceneId(scene))?.read_to_end(&mut bytes);
            read.map_err(|error| Error::new(format!("the records of scene {scene} cannot be read: {error}")))?;
            Ok(bytes)
        };
        let bytes = py.detach(read).map_err(|error| exception(py, &error))?;
        Ok(PyBytes::new(py, &bytes))
    }
}
