//! The products that a generic writer includes, and their files.

use crate::coco::{self, Category};
use crate::decode::FileContent;
use crate::encode::kind::ValueKind;
use crate::encode::{scene_name, view_name};
use crate::json;
use crate::known::{self, PRODUCTS};
use schemars::{Schema, SchemaGenerator, json_schema};
use std::borrow::Cow;
use syntable_model::files::DatasetFolder;
use syntable_model::prelude::*;
use syntable_model::product::standard::{CATEGORY_ID, CATEGORY_MAP};
use syntable_model::product::{Form, KeyId, Scope};

/// Suffixes of the file names of images in [`paths`]: for a product, and for a product per instance.
pub const IMAGE_ENDS: [&[&str]; 2] = [&[""], &["_0001"]];

/// The option `include` of a generic writer: products by name, each once.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Included(Vec<ProductName>);

impl<const N: usize> From<[&str; N]> for Included {
    fn from(names: [&str; N]) -> Self {
        Self(names.map(ProductName::from).to_vec())
    }
}

impl JsonSchema for Included {
    fn schema_name() -> Cow<'static, str> {
        "Included".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "array", "items": generator.subschema_for::<ProductName>(), "uniqueItems": true })
    }

    fn inline_schema() -> bool {
        true
    }
}

impl Included {
    /// Whether the list is empty.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The names.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(ProductName::as_str)
    }

    /// The products as inputs of a writer.
    pub fn inputs(&self, accepts: Accepts) -> Vec<Input> {
        Input::included(&self.0, accepts)
    }

    /// Refuses products with the name of a field in the writer's own records.
    ///
    /// # Errors
    /// If a product has such a name.
    pub fn check_free(&self, taken: &[&str]) -> Result<(), ConfigError> {
        match self.names().enumerate().find(|(_, name)| taken.contains(name)) {
            None => Ok(()),
            Some((i, name)) => {
                let message = format!("a product named `{name}` has the name of a field of this writer");
                Err(ConfigError::new(format!("include[{i}]"), message)
                    .help("write it with another writer, such as npy"))
            }
        }
    }

    /// The existing products of a scope, with their keys. Products of a moment count as products of each view at this
    /// moment.
    pub fn of_scope<'a>(&'a self, products: &'a Products, scope: Scope) -> impl Iterator<Item = (&'a str, KeyId)> {
        self.names().filter_map(move |name| {
            let key = products.key(name)?;
            is_stored_with(&key, scope).then_some((name, key))
        })
    }

    /// Whether a product has category ids.
    pub fn has_category_ids(&self) -> bool {
        self.names().any(|name| [CATEGORY_ID.name(), CATEGORY_MAP.name()].contains(&name))
    }

    /// The paths of the [lists](write_lists) of the dataset; none for a scene or view.
    pub fn list_paths(&self, of: &FileOf) -> Vec<String> {
        list_paths(of, self.has_category_ids())
    }

    /// Writes the [lists](write_lists) of the dataset.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write_lists(&self, dataset: &DatasetInfo, finish: &Finish) -> Result<()> {
        write_lists(dataset, finish, self.has_category_ids())
    }
}

/// The file of categories, next to products with category ids: COCO's list.
pub const CATEGORIES: &str = "categories.json";

/// The paths of the [lists](write_lists) of a dataset; none for a scene or view.
pub fn list_paths(of: &FileOf, has_category_ids: bool) -> Vec<String> {
    let lists = [(CATEGORIES, has_category_ids), (PRODUCTS, known::declared(of.products).is_some())];
    let lists = lists.into_iter().filter(|(_, has)| *has && of.scene.is_none());
    lists.map(|(name, _)| format!("{}/{name}", of.id)).collect()
}

/// Writes the lists that explain the files of a dataset: [all categories](CATEGORIES) of the recipe if files have ids of
/// categories, so that ids have names in every part of the dataset, and the [products](PRODUCTS) that no linked crate
/// defines, such as products of annotators in Python.
///
/// # Errors
/// If a file cannot be written.
pub fn write_lists(dataset: &DatasetInfo, finish: &Finish, has_category_ids: bool) -> Result<()> {
    let write = |name: &str, bytes: Vec<u8>| write_file(finish, &format!("{}/{name}", finish.id()), &bytes);
    if has_category_ids {
        write(CATEGORIES, json::pretty(&coco::categories(dataset))?)?;
    }
    known::declared(finish.reads()).map_or(Ok(()), |declared| write(PRODUCTS, json::pretty(&declared)?))
}

/// The categories in a folder's file of categories, if the file exists.
pub fn categories_in(folder: &DatasetFolder) -> Result<Option<Vec<Category>>> {
    let path = folder.file(CATEGORIES)?;
    if !path.is_file() {
        return Ok(None);
    }
    let content = FileContent::read(&path)?;
    let categories = serde_json::from_slice(content.bytes());
    categories.map(Some).map_err(|error| json::located(&error, None, &[]).in_file(&path).of_request())
}

/// Whether a product is stored with the views, the scenes or the dataset.
fn is_stored_with(key: &KeyId, scope: Scope) -> bool {
    if scope == Scope::View { key.scope.comes_with_view() } else { key.scope == scope }
}

/// Writes a file of the dataset.
///
/// # Errors
/// If the file cannot be written.
pub fn write_file(finish: &Finish, path: &str, bytes: &[u8]) -> Result<()> {
    finish.write(path, |out| out.write_all(bytes).map_err(|error| Error::io(path, &error)))
}

/// Scope and name of the view or scene that a path belongs to.
fn scope_and_name(of: &FileOf) -> Option<(Scope, String)> {
    match (of.scene, of.view) {
        (Some(scene), Some(view)) => Some((Scope::View, view_name(scene, view))),
        (Some(scene), None) => Some((Scope::Scene, scene_name(scene))),
        _ => None,
    }
}

/// Path of the single file with all products of a view or a scene; none if the writer reads no product of that scope.
pub fn path_of_all(of: &FileOf, extension: &str) -> Option<String> {
    let (scope, name) = scope_and_name(of)?;
    of.products.iter().any(|key| is_stored_with(key, scope)).then(|| file_of_all(of.id, &name, extension))
}

fn file_of_all(id: &str, name: &str, extension: &str) -> String {
    format!("{id}/{name}.{extension}")
}

/// Height and width of an image: the shape of its arrays.
pub fn shape(cx: &ImageContext) -> [usize; 2] {
    let [width, height] = cx.size.map(|edge| edge as usize);
    [height, width]
}

/// Paths of the files of the products that a writer reads: `{id}/{product}/{name}{end}.{extension}`. `ends` has the
/// suffixes for a product and for a product per instance, which always has a file of the first instance.
pub fn paths(of: &FileOf, extension: &str, ends: [&[&str]; 2]) -> Vec<String> {
    let Some((scope, name)) = scope_and_name(of) else { return Vec::new() };
    let own = of.products.iter().filter(|key| is_stored_with(key, scope));
    own.flat_map(|key| {
        let stem = stem(of.id, &key.to_string(), &name);
        let per_instance = matches!(key.form(), Form::PerInstance(_));
        ends[usize::from(per_instance)].iter().map(move |end| format!("{stem}{end}.{extension}"))
    })
    .collect()
}

/// Path of a product's file without suffix and extension.
fn stem(id: &str, product: &str, name: &str) -> String {
    format!("{id}/{product}/{name}")
}

/// The included products of a view or a scene, and the output of their files.
pub struct IncludedProducts<'a> {
    /// The names of the products.
    pub include: &'a Included,
    /// The scope of the products.
    pub scope: Scope,
    /// All products that the writer reads.
    pub products: &'a Products,
    /// The output of the scene.
    pub output: &'a Output,
    /// Name of the view or scene in names of files.
    pub name: String,
    /// Height and width of the image; zeros for the products of a scene.
    pub shape: [usize; 2],
    /// Where warnings go.
    pub log: &'a dyn Log,
}

impl<'a> IncludedProducts<'a> {
    /// Calls `each` with the name, key and value of each product, in the order of the option.
    ///
    /// # Errors
    /// If a product is missing, and errors of `each`.
    pub fn try_for_each(&self, mut each: impl FnMut(&'a str, &KeyId, Value) -> Result<()>) -> Result<()> {
        let mut included = self.include.of_scope(self.products, self.scope);
        included.try_for_each(|(product, key)| each(product, &key, self.products.value(product)?))
    }

    /// Writes a file of a product, `{id}/{product}/{name}{end}`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, product: &str, end: &str, bytes: &[u8]) -> Result<()> {
        self.output.write(&format!("{}{end}", stem(self.output.id(), product, &self.name)), bytes)
    }

    /// Writes the single file of all products, `{id}/{name}.{extension}`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write_all(&self, extension: &str, bytes: &[u8]) -> Result<()> {
        self.output.write(&file_of_all(self.output.id(), &self.name, extension), bytes)
    }

    /// Calls `each` with every image and its kind. An image is a product, or the value of an instance with its id.
    ///
    /// # Errors
    /// If a product is missing, and errors of `each`.
    pub fn for_each_image(
        &self,
        mut each: impl FnMut(&'a str, Option<InstanceId>, &ValueKind, Value) -> Result<()>,
    ) -> Result<()> {
        self.try_for_each(|product, key, value| {
            let mut each = |id: Option<InstanceId>, value: Value| each(product, id, &ValueKind::of(key, &value), value);
            match value {
                Value::PerInstance(values) => values.into_iter().try_for_each(|(id, value)| each(Some(id), value)),
                value => each(None, value),
            }
        })
    }

    /// Writes a file of each image: `{id}/{product}/{name}.{extension}`, and for a product per instance
    /// `{id}/{product}/{name}_{instance:04}.{extension}`.
    ///
    /// # Errors
    /// If a product is missing or cannot be encoded, or a file cannot be written.
    pub fn write_images(&self, extension: &str, encode: impl Fn(&ValueKind, &Value) -> Result<Vec<u8>>) -> Result<()> {
        self.for_each_image(|product, id, kind, value| {
            let bytes = encode(kind, &value).map_err(|error| error.context(format!("product `{product}`")))?;
            let end = id.map_or_else(String::new, |id| format!("_{:04}", id.0));
            self.write(product, &format!("{end}.{extension}"), &bytes)
        })
    }
}
