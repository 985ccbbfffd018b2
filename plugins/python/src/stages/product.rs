//! Products that stages in Python provide and read.

use crate::registry::whole;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use syntable_model::product::{DeclaredProduct, KeyId, linked};
use syntable_recipe::nearest;
use syntable_recipe::plan::available;

/// A product as Python declares it.
#[derive(FromPyObject)]
pub struct Declared {
    name: String,
    /// A [`DeclaredProduct`] as JSON.
    product: String,
}

impl Declared {
    /// The key of the product.
    ///
    /// # Errors
    /// If no type of the library has the form, or the library has the product with another type.
    pub fn key(&self) -> PyResult<KeyId> {
        let product: DeclaredProduct =
            serde_json::from_str(&self.product).map_err(|error| PyValueError::new_err(error.to_string()))?;
        product.key(&self.name).map_err(|error| PyValueError::new_err(error.to_string()))
    }
}

/// The message for a product that a sample lacks: it suggests a similar name, or lists the sample's products.
#[pyfunction]
pub fn missing_product(name: &str, known: Vec<String>) -> String {
    match nearest(name, known.iter().map(String::as_str)) {
        Some(near) => format!("the sample has no `{name}`: did you mean `{near}`?"),
        None if known.is_empty() => format!("the sample has no `{name}`, and no other product"),
        None => format!("the sample has no `{name}`, only {}", known.join(", ")),
    }
}

/// The keys of products that a stage reads.
///
/// # Errors
/// If no stage provides a product. The message suggests a similar name.
pub fn named(names: &[String]) -> PyResult<Vec<KeyId>> {
    let find = |keys: &[KeyId], name: &str| {
        let exact = keys.iter().find(|key| key.is(name)).copied();
        exact.or_else(|| keys.iter().find_map(|key| key.parse(name)))
    };
    let mut provided: Option<Vec<KeyId>> = None;
    let mut found = Vec::new();
    for name in names {
        if let Some(key) = find(linked(), name) {
            found.push(key);
            continue;
        }
        if provided.is_none() {
            let registry = whole().map_err(PyRuntimeError::new_err)?;
            provided = Some(available(&registry).into_iter().map(|(key, _)| key).collect());
        }
        let provided = provided.as_deref().unwrap_or_default();
        found.push(find(provided, name).ok_or_else(|| {
            let known = linked().iter().chain(provided).map(|key| key.product);
            let near = nearest(name, known).map_or_else(String::new, |near| format!(": did you mean `{near}`?"));
            PyValueError::new_err(format!(
                "no stage provides `{name}`{near} (`syntable list products` lists all; define a stage in Python before the \
                 stages that read its products)"
            ))
        })?);
    }
    Ok(found)
}
