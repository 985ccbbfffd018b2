//! Sources of objects in Python.

use crate::stages::call::with_python;
use crate::stages::kind::Kind;
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use std::path::Path;
use std::sync::Arc;
use syntable_mesh::{Model, ObjectInfo};
use syntable_model::context::Log;
use syntable_model::error::Result;
use syntable_model::registry::{Slot, Stage};
use syntable_model::scene::{Asset, AssetClass, Catalog, CatalogEntry, Material, MeshData};
use syntable_model::stage::AssetSource;

/// A class in Python that has objects, with its instance for some options.
struct PythonSource {
    kind: Arc<str>,
    /// From the instance to names with categories.
    catalog: Arc<Py<PyAny>>,
    /// From the instance and a name to an object.
    load: Arc<Py<PyAny>>,
    license: Option<String>,
    instance: Arc<Py<PyAny>>,
}

/// Registers a source of objects.
#[pyfunction]
#[pyo3(signature = (kind, catalog, load, license))]
pub fn add_asset_source(kind: Kind, catalog: Py<PyAny>, load: Py<PyAny>, license: Option<String>) -> PyResult<()> {
    let (catalog, load) = (Arc::new(catalog), Arc::new(load));
    let name: Arc<str> = kind.name().into();
    kind.add(Slot::Assets, move |instance| {
        Stage::Assets(Box::new(PythonSource {
            kind: Arc::clone(&name),
            catalog: Arc::clone(&catalog),
            load: Arc::clone(&load),
            license: license.clone(),
            instance,
        }))
    })
}

/// An object as Python checks it.
#[derive(FromPyObject)]
struct Loaded<'py> {
    category: String,
    vertices: PyReadonlyArray2<'py, f32>,
    faces: PyReadonlyArray2<'py, u32>,
    /// Colors by vertex, linear.
    colors: Option<PyReadonlyArray2<'py, f32>>,
    /// Base color, linear.
    color: [f32; 3],
    roughness: f32,
}

fn rows_of<T: Copy + numpy::Element, const N: usize>(array: &PyReadonlyArray2<'_, T>) -> Vec<[T; N]> {
    array.as_array().outer_iter().map(|row| std::array::from_fn(|column| row[column])).collect()
}

impl AssetSource for PythonSource {
    fn class(&self) -> AssetClass {
        AssetClass::Object
    }

    fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
        let names = with_python(|py| self.catalog.call1(py, (&*self.instance,))?.extract::<Vec<(String, String)>>(py))?;
        let mut entries: Vec<_> = names.iter().map(|(name, category)| CatalogEntry::new(name, category)).collect();
        entries.sort();
        Ok(Catalog { entries })
    }

    fn load(&self, name: &str, log: &dyn Log) -> Result<Asset> {
        let (model, category) = with_python(|py| {
            let loaded = self.load.call1(py, (&*self.instance, name))?;
            let loaded: Loaded<'_> = loaded.bind(py).extract()?;
            let colors = loaded.colors.as_ref().map(rows_of).unwrap_or_default();
            let (positions, triangles) = (rows_of(&loaded.vertices), rows_of(&loaded.faces));
            let mesh = MeshData { positions, triangles, colors, ..MeshData::default() };
            let materials = vec![Material::plain("python", loaded.color, loaded.roughness)];
            Ok((Model { mesh, materials }, loaded.category))
        })?;
        let license = self.license.clone().unwrap_or_default();
        let info = ObjectInfo { name: name.to_owned(), category, license };
        let place = format!("{}/{name}", self.kind);
        let (object, _) = model.into_object(info, Path::new(&place), log)?;
        Ok(object.into())
    }

    fn license(&self) -> Option<&str> {
        self.license.as_deref()
    }
}
