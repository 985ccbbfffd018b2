//! The products that a generic writer includes, and their files.

use crate::encode::kind::Kind;
use std::collections::BTreeSet;
use syntable_model::prelude::*;
use syntable_model::product::{KeyId, Scope};

/// Refuses a list that names a product twice.
pub fn check_unique(include: &[ProductName]) -> Result<(), ConfigError> {
    let mut seen = BTreeSet::new();
    match include.iter().enumerate().find(|(_, name)| !seen.insert(name.as_str())) {
        None => Ok(()),
        Some((i, name)) => {
            let message = format!("`{}` is included twice", name.as_str());
            Err(ConfigError::new(format!("include[{i}]"), message).help("remove one of them"))
        }
    }
}

/// Refuses products whose name is a field of the writer's own records.
pub fn check_free(include: &[ProductName], taken: &[&str]) -> Result<(), ConfigError> {
    match include.iter().enumerate().find(|(_, name)| taken.contains(&name.as_str())) {
        None => Ok(()),
        Some((i, name)) => {
            let message = format!("a product named `{}` has the name of a field of this writer", name.as_str());
            Err(ConfigError::new(format!("include[{i}]"), message).help("write it with another writer, such as npy"))
        }
    }
}

/// The included products of a scope, with their keys, that are there.
pub fn of_scope<'a>(
    include: &'a [ProductName],
    products: &'a Products,
    scope: Scope,
) -> impl Iterator<Item = (&'a str, KeyId)> {
    include.iter().filter_map(move |name| {
        let key = products.key(name.as_str())?;
        (key.scope == scope).then_some((name.as_str(), key))
    })
}

/// Writes the included images of a scope: `{id}/{product}/{name}.{extension}`, and for a product per instance
/// `{id}/{product}/{name}_{instance:04}.{extension}`.
pub fn write_images(
    images: impl Iterator<Item = (impl AsRef<str>, KeyId)>,
    output: &Output,
    extension: &str,
    name: &str,
    products: &Products,
    encode: impl Fn(&Kind, &Value) -> Result<Vec<u8>>,
) -> Result<()> {
    for (product, key) in images {
        let product = product.as_ref();
        let stem = format!("{}/{product}/{name}", output.id());
        let write = |value: &Value, end: &str| {
            let bytes = encode(&Kind::of(&key, value), value)
                .map_err(|error| error.context(format!("product `{product}`")).permanent())?;
            output.write(&format!("{stem}{end}.{extension}"), &bytes)
        };
        match products.value(product)? {
            Value::PerInstance(values) => {
                values.iter().try_for_each(|(id, value)| write(value, &format!("_{:04}", id.0)))?;
            }
            value => write(&value, "")?,
        }
    }
    Ok(())
}
