//! Items of a document by their indices.

use gltf::json::Index;
use syntable_model::error::{Error, Result};

/// An item by its index, or an error that names both.
pub fn get<'a, T>(items: &'a [T], index: Index<T>, what: &str) -> Result<&'a T> {
    items
        .get(index.value())
        .ok_or_else(|| Error::new(format!("the file refers to {what} {}, but has {}", index.value(), items.len())))
}
