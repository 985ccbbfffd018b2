//! Samples: views with their products, in memory or in a dataset.

use crate::errors::exception;
use crate::masks;
use crate::run_dataset::RunDataset;
use crate::stages::missing_product;
use crate::values;
use numpy::PyArray3;
use parking_lot::Mutex;
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use std::collections::BTreeSet;
use std::sync::Arc;
use syntable_model::error::{Error, Result};
use syntable_model::product::{Form, KeyId, Products, Value};
use syntable_model::scene::{InstanceId, SceneId, ViewId};

/// A view of a scene with its products. Products of a dataset are read when they are first asked for.
#[pyclass(frozen, module = "syntable._syntable")]
pub struct Sample {
    /// Number of the scene.
    #[pyo3(get)]
    scene: u32,
    /// Number of the view.
    #[pyo3(get)]
    view: u32,
    /// Name of the image in its dataset; `SCENE_VIEW` of a sample that was made.
    #[pyo3(get)]
    name: String,
    products: Mutex<Products>,
    stored: Option<StoredImage>,
    /// Whether a stage in Python gets it, with the products that the stage reads.
    is_lent: bool,
}

/// An image of a dataset.
struct StoredImage {
    dataset: Arc<RunDataset>,
    image: usize,
}

impl Sample {
    /// A sample that was made.
    pub fn made(sample: syntable::Sample) -> Self {
        let (scene, view) = (sample.scene.id.0, sample.view.id.0);
        Self::of_view(scene, view, sample.products)
    }

    /// A view for a stage, with the products that the stage reads.
    pub fn lent(scene: SceneId, view: ViewId, products: Products) -> Self {
        Self { is_lent: true, ..Self::of_view(scene.0, view.0, products) }
    }

    fn of_view(scene: u32, view: u32, products: Products) -> Self {
        let (name, products) = (format!("{scene}_{view}"), Mutex::new(products));
        Self { scene, view, name, products, stored: None, is_lent: false }
    }

    /// An image of a dataset.
    pub fn stored(dataset: Arc<RunDataset>, image: usize) -> Self {
        let found = &dataset.first.images[image];
        let (scene, view, name) = (found.scene.0, found.view.0, found.name.clone());
        let stored = Some(StoredImage { dataset, image });
        Self { scene, view, name, products: Mutex::default(), stored, is_lent: false }
    }

    /// The keys of all products.
    fn keys(&self) -> Vec<KeyId> {
        match &self.stored {
            Some(stored) => stored.dataset.keys(),
            None => self.products.lock().keys(),
        }
    }

    fn key(&self, name: &str) -> Option<KeyId> {
        match &self.stored {
            Some(stored) => stored.dataset.key(name),
            None => self.products.lock().keys().into_iter().find(|key| key.is(name)),
        }
    }

    /// Reads products that are in the dataset only.
    fn need(&self, keys: &[KeyId]) -> Result<()> {
        let Some(StoredImage { dataset, image }) = &self.stored else { return Ok(()) };
        let missing = |held: &Products| keys.iter().copied().filter(|key| !held.contains(key)).collect::<Vec<_>>();
        let wants = missing(&self.products.lock());
        if wants.is_empty() {
            return Ok(());
        }
        // Reading takes long, and other threads may read other products of the image.
        let read = dataset.read(*image, &wants)?;
        let mut held = self.products.lock();
        let new = read.without(&held);
        held.extend(new)
    }

    /// The value of a product; none if the image lacks it.
    fn value(&self, key: KeyId) -> Result<Option<Value>> {
        self.need(&[key])?;
        let held = self.products.lock();
        if held.contains(&key) { held.value(&key).map(Some) } else { Ok(None) }
    }

    fn known(&self, py: Python<'_>, name: &str) -> PyResult<KeyId> {
        if let Some(key) = py.detach(|| self.key(name)) {
            return Ok(key);
        }
        let names = self.names(py);
        Err(PyKeyError::new_err(if self.is_lent {
            let names = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            format!("the stage does not read `{name}`: add it to reads=[…], which has {names}")
        } else {
            missing_product(name, names)
        }))
    }
}

#[pymethods]
impl Sample {
    /// Names of all products.
    fn names(&self, py: Python<'_>) -> Vec<String> {
        py.detach(|| self.keys()).iter().map(ToString::to_string).collect()
    }

    /// Whether the sample has a product.
    fn has(&self, py: Python<'_>, name: &str) -> bool {
        py.detach(|| self.key(name)).is_some()
    }

    /// A product by its name; `None` if this image of the dataset lacks it.
    fn get<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let key = self.known(py, name)?;
        let value = py.detach(|| self.value(key)).map_err(|error| exception(py, &error))?;
        values::to_python(py, value.unwrap_or(Value::Null))
    }

    /// Reads products of a dataset ahead of their use, with one pass over its files.
    fn read(&self, py: Python<'_>, names: Vec<String>) -> PyResult<()> {
        let keys = names.iter().map(|name| self.known(py, name)).collect::<PyResult<Vec<_>>>()?;
        py.detach(|| self.need(&keys)).map_err(|error| exception(py, &error))
    }

    /// Masks of objects as an array of bool: objects × height × width, in the order of `ids`.
    fn masks<'py>(&self, py: Python<'py>, name: &str, ids: Vec<u16>) -> PyResult<Bound<'py, PyArray3<bool>>> {
        let key = self.known(py, name)?;
        let value = py.detach(|| self.value(key)).map_err(|error| exception(py, &error))?;
        let Some(Value::PerInstance(each)) = value else {
            let message = format!("`{name}` is {}, not a mask per object", key.kind_of_value());
            return Err(exception(py, &Error::new(message)));
        };
        let of = |id: &u16| match each.get(&InstanceId(*id)) {
            Some(Value::Mask(mask)) => Some(mask),
            _ => None,
        };
        let found: Vec<_> = ids.iter().map(of).collect();
        let size = each.values().find_map(|value| match value {
            Value::Mask(mask) => Some([mask.width(), mask.height()]),
            _ => None,
        });
        masks::stack(py, &found, size.unwrap_or([0, 0]))
    }

    /// Ids of the objects that have a value of any product, ascending.
    fn ids(&self, py: Python<'_>) -> PyResult<Vec<u16>> {
        let keys = match &self.stored {
            Some(stored) => stored.dataset.first.offers.clone(),
            None => self.products.lock().keys(),
        };
        let mut of_objects = keys.iter().filter(|key| matches!(key.form(), Form::PerInstance(_))).copied();
        py.detach(|| {
            let mut ids = BTreeSet::new();
            match &self.stored {
                // One product of all objects is enough: others may need whole images.
                Some(_) => {
                    let named = || PREFERRED.iter().filter_map(|name| keys.iter().find(|key| key.is(name)));
                    let is_held = |key: &&KeyId| self.products.lock().contains(*key);
                    let first = named().find(is_held).or_else(|| named().next());
                    if let Some(key) = first.copied().or_else(|| of_objects.next()) {
                        ids.extend(self.ids_of(key)?);
                    }
                }
                None => {
                    for key in of_objects {
                        ids.extend(self.ids_of(key)?);
                    }
                }
            }
            Ok(ids.into_iter().map(|id| id.0).collect())
        })
        .map_err(|error| exception(py, &error))
    }
}

/// Products that all objects of an image have, the cheapest first.
const PREFERRED: [&str; 6] = ["category_id", "object_info", "visible_box", "amodal_box", "visible_mask", "amodal_mask"];

impl Sample {
    fn ids_of(&self, key: KeyId) -> Result<Vec<InstanceId>> {
        match self.value(key)? {
            Some(Value::PerInstance(each)) => Ok(each.into_keys().collect()),
            _ => Ok(Vec::new()),
        }
    }
}
