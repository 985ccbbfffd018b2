//! Datasets that are read, in any format.

use crate::errors::exception;
use crate::registry::registry;
use crate::sample::Sample;
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};
use syntable_model::error::Result;
use syntable_model::product::{KeyId, Products};
use syntable_model::reader::{DatasetFormat, OpenDataset, Source};
use syntable_model::scene::{SceneId, ViewId};

/// A dataset with the products that other writers of the same run stored by name.
pub struct RunDataset {
    /// The dataset that lists the images.
    pub first: OpenDataset,
    companions: Vec<(Arc<dyn DatasetFormat>, Source)>,
    /// The datasets of the other writers, opened at their first use.
    others: OnceLock<Companions>,
}

/// The datasets of the other writers of a run.
#[derive(Default)]
struct Companions {
    datasets: Vec<Companion>,
    /// Parts that cannot be read, with reasons.
    left_out: Vec<String>,
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
    fn others(&self) -> &Companions {
        self.others.get_or_init(|| {
            let (mut others, mut known) = (Companions::default(), self.first.offers.clone());
            for (format, source) in &self.companions {
                let dataset = match format.open(source) {
                    Ok(dataset) => dataset,
                    Err(error) => {
                        others.left_out.push(error.to_string());
                        continue;
                    }
                };
                let is_known = |key: &KeyId| known.iter().any(|other| other.is(&key.to_string()));
                let new = dataset.offers.iter().filter(|key| !dataset.is_derived(key) && !is_known(key));
                let keys: Vec<KeyId> = new.copied().collect();
                known.extend(&keys);
                others.left_out.extend(lost(&dataset));
                let places = dataset.images.iter().enumerate().map(|(at, image)| ((image.scene, image.view), at));
                others.datasets.push(Companion { places: places.collect(), dataset, keys });
            }
            others
        })
    }

    /// The keys of all products.
    pub fn keys(&self) -> Vec<KeyId> {
        let others = self.others().datasets.iter().flat_map(|other| &other.keys);
        self.first.offers.iter().chain(others).copied().collect()
    }

    /// The key of a product. The other writers' datasets are opened only for products that the first one lacks.
    pub fn key(&self, name: &str) -> Option<KeyId> {
        let of = |keys: &[KeyId]| keys.iter().find(|key| key.is(name)).copied();
        of(&self.first.offers).or_else(|| of(&self.keys()))
    }

    /// Parts of the other writers' datasets that cannot be read, with reasons.
    pub fn left_out_of_others(&self) -> &[String] {
        &self.others().left_out
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
        for other in &self.others().datasets {
            let own: Vec<KeyId> = others.iter().filter(|key| other.keys.contains(key)).copied().collect();
            if let Some(&place) = other.places.get(&(found.scene, found.view)).filter(|_| !own.is_empty()) {
                products.extend(other.dataset.read(place, &own)?.products)?;
            }
        }
        Ok(products)
    }
}

/// Parts of a dataset that its reader could not read, with reasons.
fn lost(dataset: &OpenDataset) -> Vec<String> {
    let lost = dataset.faults.iter().filter(|fault| fault.is_lost);
    lost.map(|fault| fault.place_and_text(&dataset.images).join(": ")).collect()
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
