//! The products that a generic writer includes, and their files.

use crate::encode::kind::Kind;
use crate::encode::{view, view_name};
use std::collections::BTreeSet;
use syntable_model::prelude::*;
use syntable_model::product::{KeyId, Scope};

/// Names of the products.
pub fn names(include: &[ProductName]) -> Vec<String> {
    include.iter().map(|name| name.as_str().to_owned()).collect()
}

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

/// The key of a product.
pub fn key(frame: &Products, name: &str) -> Result<KeyId> {
    let key = frame.keys().into_iter().find(|key| key.name == name);
    key.ok_or_else(|| Error::new(format!("product `{name}` has not been made")))
}

/// Whether a product is made once per scene.
pub fn of_scene(frame: &Products, name: &str) -> bool {
    key(frame, name).is_ok_and(|key| key.scope == Scope::Scene)
}

/// Writes the images of a view: `{id}/{product}/{scene:06}_{view:04}.{extension}`, and for a product per instance
/// `{id}/{product}/{scene:06}_{view:04}_{instance:04}.{extension}`.
pub fn write_images(
    include: &[ProductName],
    output: &Output,
    extension: &str,
    site: &Site,
    frame: &Products,
    encode: impl Fn(&Kind, &Value) -> Result<Vec<u8>>,
) -> Result<()> {
    let view = view_name(site.scene.id, view(site)?.id);
    for name in include {
        let name = name.as_str();
        let (key, value) = (key(frame, name)?, frame.value(name)?);
        let stem = format!("{}/{name}/{view}", output.id());
        let write = |value: &Value, end: &str| {
            let bytes =
                encode(&Kind::of(&key, value), value).map_err(|error| error.context(format!("product `{name}`")))?;
            output.write(&format!("{stem}{end}.{extension}"), &bytes)
        };
        match value {
            Value::PerInstance(values) => {
                values.iter().try_for_each(|(id, value)| write(value, &format!("_{:04}", id.0)))?;
            }
            value => write(&value, "")?,
        }
    }
    Ok(())
}
