//! Datasets that are read, in any format.

use crate::errors::exception;
use crate::registry::registry;
use crate::run_dataset::{RunDataset, lost};
use crate::sample::Sample;
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;
use syntable_model::reader::Source;

/// A dataset in a format that the library reads.
#[pyclass(frozen, module = "syntable._syntable")]
pub struct Dataset {
    dataset: Arc<RunDataset>,
    /// Name of the format.
    #[pyo3(get)]
    format: &'static str,
}

#[pymethods]
impl Dataset {
    /// Opens a dataset: a folder, or an annotation file.
    #[new]
    #[pyo3(signature = (path, format, image_folder, trust_paths))]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        format: Option<String>,
        image_folder: Option<PathBuf>,
        trust_paths: bool,
    ) -> PyResult<Self> {
        let registry = registry(py)?;
        let opened = py.detach(|| {
            let source = Source::at_name(&path, image_folder.as_deref())?.trusting(trust_paths);
            let (kind, found) = registry.find_dataset(&source, format.as_deref())?;
            let companions = registry.companions(&source, &found);
            Ok((kind.name(), RunDataset::new(kind.open(&found)?, companions)))
        });
        let (format, dataset) = opened.map_err(|error| exception(py, &error))?;
        Ok(Self { dataset: Arc::new(dataset), format })
    }

    fn __len__(&self) -> usize {
        self.dataset.first.images.len()
    }

    /// An image by its place in the dataset.
    fn sample(&self, image: usize) -> PyResult<Sample> {
        let images = self.dataset.first.images.len();
        if image >= images {
            return Err(PyIndexError::new_err(format!("the dataset has {images} images")));
        }
        Ok(Sample::stored(Arc::clone(&self.dataset), image))
    }

    /// Name of the dataset.
    #[getter]
    fn name(&self) -> &str {
        &self.dataset.first.info.name
    }

    /// Names of the products that images have.
    #[getter]
    fn products(&self, py: Python<'_>) -> Vec<String> {
        py.detach(|| self.dataset.keys()).iter().map(ToString::to_string).collect()
    }

    /// Parts that the reader could not read, and left out, with reasons.
    #[getter]
    fn left_out(&self) -> Vec<String> {
        lost(&self.dataset.first)
    }

    /// The same of the datasets of other writers, which it opens.
    #[getter]
    fn left_out_of_others(&self, py: Python<'_>) -> Vec<String> {
        py.detach(|| self.dataset.left_out_of_others().to_vec())
    }

    /// Categories: ids and names.
    #[getter]
    fn categories(&self) -> Vec<(u32, String)> {
        self.dataset.first.info.categories().map(|(id, name)| (id, name.to_string())).collect()
    }
}
