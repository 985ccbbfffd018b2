//! Datasets that are read, in any format.

use crate::errors::exception;
use crate::registry::registry;
use crate::sample::Sample;
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;
use syntable_model::reader::{OpenDataset, Source};

/// A dataset in a format that the library reads.
#[pyclass(frozen, module = "syntable._syntable")]
pub struct Dataset {
    dataset: Arc<OpenDataset>,
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
        let source = Source::new(path).trusting(trust_paths).with_images_in(image_folder);
        let opened = py.detach(|| registry.open_dataset(&source, format.as_deref()));
        let (format, dataset) = opened.map_err(|error| exception(py, &error))?;
        Ok(Self { dataset: Arc::new(dataset), format: format.name() })
    }

    fn __len__(&self) -> usize {
        self.dataset.images.len()
    }

    /// An image by its place in the dataset.
    fn sample(&self, image: usize) -> PyResult<Sample> {
        if image >= self.dataset.images.len() {
            return Err(PyIndexError::new_err(format!("the dataset has {} images", self.dataset.images.len())));
        }
        Ok(Sample::stored(Arc::clone(&self.dataset), image))
    }

    /// Name of the dataset.
    #[getter]
    fn name(&self) -> &str {
        &self.dataset.info.name
    }

    /// Names of the products that images have.
    #[getter]
    fn products(&self) -> Vec<String> {
        self.dataset.offers.iter().map(ToString::to_string).collect()
    }

    /// Categories: ids and names.
    #[getter]
    fn categories(&self) -> Vec<(u32, String)> {
        self.dataset.info.categories().map(|(id, name)| (id, name.to_string())).collect()
    }
}
