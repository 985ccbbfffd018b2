//! Datasets that are read, in any format.

use crate::errors::exception;
use crate::registry::registry;
use crate::sample::Sample;
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};
use syntable_model::error::{Error, Result};
use syntable_model::product::{KeyId, Products};
use syntable_model::reader::{DatasetFormat, OpenDataset, Source};
use syntable_model::scene::{SceneId, ViewId};

/// A dataset with the products that other writers of the same run stored by name.
pub struct RunDataset {
    /// The dataset that lists the images.
    pub first: OpenDataset,
    companions: Vec<(Arc<dyn DatasetFormat>, Source)>,
    /// The datasets of the other writers, opened at their first use.
    others: OnceLock<Result<Vec<Companion>>>,
}

/// A dataset of another writer of the run.
struct Companion {
    dataset: OpenDataset,
    /// Its images by scene and view.
    places: BTreeMap<(SceneId, ViewId), usize>,
    /// The products that it stores, and no dataset before it.
    keys: Vec<KeyId>,
}

impl RunDataset {
    fn others(&self) -> Result<&[Companion]> {
        let open = || {
            let (mut others, mut known) = (Vec::new(), self.first.offers.clone());
            for (format, source) in &self.companions {
                let dataset = format.open(source)?;
                let is_new =
                    |key: &&KeyId| !dataset.is_derived(key) && known.iter().all(|other| !other.is(&key.to_string()));
                let keys: Vec<KeyId> = dataset.offers.iter().filter(is_new).copied().collect();
                known.extend(&keys);
                let places = dataset.images.iter().enumerate().map(|(at, image)| ((image.scene, image.view), at));
                others.push(Companion { places: places.collect(), dataset, keys });
            }
            Ok(others)
        };
        self.others.get_or_init(open).as_ref().map(Vec::as_slice).map_err(Error::clone)
    }

    /// The keys of all products.
    ///
    /// # Errors
    /// If the files of another writer cannot be read.
    pub fn keys(&self) -> Result<Vec<KeyId>> {
        let others = self.others()?.iter().flat_map(|other| &other.keys);
        Ok(self.first.offers.iter().chain(others).copied().collect())
    }

    /// The key of a product. The other writers' datasets are opened only for products that the first one lacks.
    ///
    /// # Errors
    /// If the files of another writer cannot be read.
    pub fn key(&self, name: &str) -> Result<Option<KeyId>> {
        let of = |keys: &[KeyId]| keys.iter().find(|key| key.is(name)).copied();
        match of(&self.first.offers) {
            Some(key) => Ok(Some(key)),
            None => Ok(of(&self.keys()?)),
        }
    }

    /// Reads products of an image. An image that a writer left out lacks its products.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn read(&self, image: usize, wants: &[KeyId]) -> Result<Products> {
        let (own, others): (Vec<KeyId>, Vec<KeyId>) = wants.iter().partition(|key| self.first.offers.contains(key));
        let mut products = if own.is_empty() { Products::new() } else { self.first.read(image, &own)?.products };
        if others.is_empty() {
            return Ok(products);
        }
        let found = &self.first.images[image];
        for other in self.others()? {
            let own: Vec<KeyId> = others.iter().filter(|key| other.keys.contains(key)).copied().collect();
            if let Some(&place) = other.places.get(&(found.scene, found.view)).filter(|_| !own.is_empty()) {
                products.extend(other.dataset.read(place, &own)?.products)?;
            }
        }
        Ok(products)
    }
}

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
        let source = Source::new(path).trusting(trust_paths).with_images_in(image_folder);
        let opened = py.detach(|| {
            let (kind, found) = registry.find_dataset(&source, format.as_deref())?;
            let companions = registry.companions(&source, &found);
            Ok((kind.name(), RunDataset { first: kind.open(&found)?, companions, others: OnceLock::new() }))
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
    fn products(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let keys = py.detach(|| self.dataset.keys()).map_err(|error| exception(py, &error))?;
        Ok(keys.iter().map(ToString::to_string).collect())
    }

    /// Parts that the reader could not read, and left out, with reasons.
    #[getter]
    fn left_out(&self) -> Vec<String> {
        let first = &self.dataset.first;
        let lost = first.faults.iter().filter(|fault| fault.is_lost);
        lost.map(|fault| fault.place_and_text(&first.images).join(": ")).collect()
    }

    /// Categories: ids and names.
    #[getter]
    fn categories(&self) -> Vec<(u32, String)> {
        self.dataset.first.info.categories().map(|(id, name)| (id, name.to_string())).collect()
    }
}
