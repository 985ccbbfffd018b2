//! The products that a generic writer includes.

use std::collections::BTreeSet;
use syntable_model::error::Invalid;
use syntable_model::names::ProductName;
use syntable_model::product::{Frame, KeyId, Scope};

/// Names of the products.
pub fn names(include: &[ProductName]) -> Vec<String> {
    include.iter().map(|name| name.as_str().to_owned()).collect()
}

/// Refuses a list that names a product twice or that names nothing.
pub fn check(include: &[ProductName]) -> Result<(), Invalid> {
    if include.is_empty() {
        return Err(Invalid::new("include", "`include` names no product").help("name at least one product to write"));
    }
    check_unique(include)
}

/// Refuses a list that names a product twice.
pub fn check_unique(include: &[ProductName]) -> Result<(), Invalid> {
    let mut seen = BTreeSet::new();
    match include.iter().enumerate().find(|(_, name)| !seen.insert(name.as_str())) {
        None => Ok(()),
        Some((i, name)) => Err(Invalid::new(format!("include[{i}]"), format!("`{}` is included twice", name.as_str()))),
    }
}

/// Refuses products whose name is a field of the writer's own records.
pub fn check_free(include: &[ProductName], taken: &[&str]) -> Result<(), Invalid> {
    match include.iter().enumerate().find(|(_, name)| taken.contains(&name.as_str())) {
        None => Ok(()),
        Some((i, name)) => {
            let message = format!("a product named `{}` has the name of a field of this writer", name.as_str());
            Err(Invalid::new(format!("include[{i}]"), message).help("write it with another writer, such as npy"))
        }
    }
}

/// The key of a product that is in a frame.
pub fn key(frame: &Frame, name: &str) -> Option<KeyId> {
    frame.keys().into_iter().find(|key| key.name == name)
}

/// Whether a product is made once a scene.
pub fn of_scene(frame: &Frame, name: &str) -> bool {
    key(frame, name).is_some_and(|key| key.scope == Scope::Scene)
}
