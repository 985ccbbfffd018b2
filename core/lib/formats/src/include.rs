//! The products that a generic writer includes, and their files.

use crate::coco::{self, Category};
use crate::decode::Content;
use crate::encode::kind::Kind;
use crate::encode::{scene_name, view_name};
use crate::json;
use std::collections::BTreeSet;
use syntable_model::files::DatasetFolder;
use syntable_model::prelude::*;
use syntable_model::product::standard::{CATEGORY_ID, CATEGORY_MAP};
use syntable_model::product::{Form, KeyId, Scope};

/// How the name of an image ends in [`paths`]: of a product, and of one per instance.
pub const IMAGE_ENDS: [&[&str]; 2] = [&[""], &["_0001"]];

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

/// The file of categories, beside products that have ids of them: COCO's list.
pub const CATEGORIES: &str = "categories.json";

/// The path of the file of categories, if an included product has ids of them.
pub fn categories_path(include: &[ProductName], id: &str) -> Option<String> {
    has_category_ids(include).then(|| format!("{id}/{CATEGORIES}"))
}

/// Whether an included product has ids of categories.
pub fn has_category_ids(include: &[ProductName]) -> bool {
    let has_ids = |name: &ProductName| [CATEGORY_ID.name(), CATEGORY_MAP.name()].contains(&name.as_str());
    include.iter().any(has_ids)
}

/// Writes the file of categories, if an included product has ids of them.
pub fn write_categories(include: &[ProductName], dataset: &DatasetInfo, finish: &Finish) -> Result<()> {
    match categories_path(include, finish.id()) {
        Some(path) => write_categories_to(&path, dataset, finish),
        None => Ok(()),
    }
}

/// Writes the categories of the dataset to a path: all that the recipe has, so that ids have names in every part of it.
pub fn write_categories_to(path: &str, dataset: &DatasetInfo, finish: &Finish) -> Result<()> {
    let fail = |error: serde_json::Error| Error::new(format!("cannot be written as JSON: {error}"));
    let mut text = serde_json::to_vec_pretty(&coco::categories(dataset)).map_err(fail)?;
    text.push(b'\n');
    finish.write(path, |out| out.write_all(&text).map_err(|error| Error::io(path, &error)))
}

/// The categories that the file of a folder has, if there is one.
pub fn categories_in(folder: &DatasetFolder) -> Result<Option<Vec<Category>>> {
    let path = folder.file(CATEGORIES)?;
    if !path.is_file() {
        return Ok(None);
    }
    let content = Content::read(&path)?;
    let categories = serde_json::from_slice(content.bytes());
    categories.map(Some).map_err(|error| json::located(&error, None, &[]).in_file(&path).of_request())
}

/// Scope and name of what a path is asked of: of a view or a scene.
pub fn scope_and_name(of: &FileOf) -> Option<(Scope, String)> {
    match (of.scene, of.view) {
        (Some(scene), Some(view)) => Some((Scope::View, view_name(scene, view))),
        (Some(scene), None) => Some((Scope::Scene, scene_name(scene))),
        _ => None,
    }
}

/// Paths of the files of the products that a writer reads: `{id}/{product}/{name}{end}.{extension}`. `ends` are those of a
/// product and of one per instance, which has a file of the first instance at least.
pub fn paths(of: &FileOf, extension: &str, ends: [&[&str]; 2]) -> Vec<String> {
    let Some((scope, name)) = scope_and_name(of) else { return Vec::new() };
    let own = of.products.iter().filter(|key| key.scope == scope);
    own.flat_map(|key| {
        let stem = stem(of.id, &key.name.to_string(), &name);
        let per_instance = matches!(key.form(), Form::PerInstance(_));
        ends[usize::from(per_instance)].iter().map(move |end| format!("{stem}{end}.{extension}"))
    })
    .collect()
}

/// Path of a product's file without its end.
pub fn stem(id: &str, product: &str, name: &str) -> String {
    format!("{id}/{product}/{name}")
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
        let stem = stem(output.id(), product, name);
        let write = |value: &Value, end: &str| {
            let bytes =
                encode(&Kind::of(&key, value), value).map_err(|error| error.context(format!("product `{product}`")))?;
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
