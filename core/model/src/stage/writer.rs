//! Writes samples to files.

use crate::context::DatasetContext;
use crate::error::Result;
use crate::names::ProductName;
use crate::product::{Key, KeyId, Product, Products};
use crate::scene::{SceneId, ViewId};
use crate::stage::subject::{Images, Subject};
use crate::stage::{DatasetInfo, Finish, Output};
use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;

/// A file format. The files of a scene appear in the dataset when the whole scene is done. `finish` writes files that cover many
/// scenes, from a shard per scene.
///
/// A `Writer` gets only products, so it also writes datasets that were read. A `Writer<Scenes>` also gets bodies, materials, cameras
/// and lights, so it writes only scenes that the program made.
pub trait Writer<S: Subject = Images>: Send + Sync {
    /// The products that it reads, each with the kinds of value that it can store. It gets only these.
    fn reads(&self) -> Vec<Input>;
    /// Starts a scene. Dropping the scene writer without closing it abandons the scene.
    fn scene(&self, cx: &S::Scene<'_>, output: Output) -> Result<Box<dyn SceneWriter<S>>>;
    /// Writes the files that cover many scenes. Every run calls it at its end, with all finished scenes and with the products of
    /// the dataset that the writer reads. A second call writes the same files.
    ///
    /// To find mistakes early, a run also calls it after its first scene, and deletes the files.
    fn finish(&self, cx: &DatasetContext, products: &Products, finish: &Finish) -> Result<()> {
        let _ = (cx, products, finish);
        Ok(())
    }
    /// The same writer for the conversion of a dataset with these products, if other options suit the dataset better than
    /// defaults that the user left as they are: a dataset of boxes, for one, has no polygons.
    fn for_dataset(&self, has: &BTreeSet<String>) -> Option<Box<dyn Writer<S>>> {
        let _ = has;
        None
    }
    /// Whether its files identify objects by their numbers (`obj_id`). If so, a recipe with two objects of one number is refused.
    fn needs_obj_ids(&self) -> bool {
        false
    }
    /// Whether its files describe the shape of an object by its asset and a pose. If so, a recipe that varies the sizes of objects is
    /// refused.
    fn needs_sizes_of_assets(&self) -> bool {
        false
    }
    /// Checks its requirements beyond the options, such as files that they name. Called by `check` and before a run.
    fn ready(&self) -> Result<()> {
        Ok(())
    }
    /// The paths of its files for a view, a scene or the dataset, relative to the dataset. Paths that are unknown
    /// before a run are left out. `check` refuses paths that two scenes, views or writers share, and a path inside of
    /// another file.
    fn paths(&self, of: &FileOf) -> Result<Vec<String>> {
        let _ = of;
        Ok(Vec::new())
    }
    /// Names of the options that only [`finish`](Self::finish) reads. They may change while the dataset is unfinished, because the
    /// files of scenes do not depend on them.
    fn finish_options(&self) -> &'static [&'static str] {
        &[]
    }
}

/// The view, scene or dataset of a file: a view if both numbers are set, a scene if only the scene's number is set.
#[derive(Debug, Clone, Copy)]
pub struct FileOf<'a> {
    /// The dataset.
    pub dataset: &'a DatasetInfo,
    /// The writer's id in the recipe.
    pub id: &'a str,
    /// The scene.
    pub scene: Option<SceneId>,
    /// The view.
    pub view: Option<ViewId>,
    /// The products that the writer reads. Empty if the recipe has no plan.
    pub products: &'a [KeyId],
}

/// A writer at work on one scene.
pub trait SceneWriter<S: Subject = Images>: Send {
    /// Writes one view. Views come in order. `products` holds what the writer reads of the view, of its moment, and of the scene
    /// before its views.
    fn view(&mut self, cx: &S::View<'_>, products: &Products) -> Result<()>;
    /// Ends the scene. `products` holds all products of the scene that the writer reads.
    fn close(self: Box<Self>, cx: &S::Scene<'_>, products: &Products) -> Result<()>;
}

/// A product that a writer reads.
#[derive(Debug, Clone)]
pub struct Input {
    /// Name of the product.
    pub product: String,
    /// The values that the writer can store under this name.
    pub accepts: Accepts,
    /// The writer's option that names the product, such as `include[2]`, for diagnostics.
    pub option: Option<String>,
    /// Whether the writer can do without it.
    pub need: InputNeed,
    /// Whether the writer stores it. A writer of visible masks may read amodal masks, and only decide with them what it stores.
    pub is_stored: bool,
}

/// When a writer needs a product.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InputNeed {
    /// Always.
    Always,
    /// In a run. A dataset that is converted may lack it.
    UnlessRead,
    /// Never. A dataset that is converted may have it, and a run does not make it.
    IfStored,
}

/// The values that a writer can store.
#[derive(Clone)]
#[non_exhaustive]
pub enum Accepts {
    /// Any product.
    Any,
    /// A product of exactly this key's type.
    Type(KeyId),
    /// A product that the function accepts. Its error has a reason and a remedy, such as `a PNG file has no channel for 32-bit
    /// floats; write it with exr or npy`.
    If(Arc<AcceptsKey>),
}

/// Refuses a product that a writer cannot store, with a reason and a remedy.
pub type AcceptsKey = dyn Fn(&KeyId) -> Result<(), String> + Send + Sync;

impl Input {
    /// A product that the writer knows, of exactly its type.
    pub fn of<T: Product>(key: Key<T>) -> Self {
        Self { accepts: Accepts::Type(key.id()), ..Self::named(key.id().to_string()) }
    }

    /// A product by name, whatever its type.
    pub fn named(product: impl Into<String>) -> Self {
        Self { product: product.into(), accepts: Accepts::Any, option: None, need: InputNeed::Always, is_stored: true }
    }

    /// The same for a product that a dataset may lack. The writer gets it from [`Products::optional`], and leaves out its labels
    /// if it is missing.
    pub fn optional(self) -> Self {
        Self { need: InputNeed::UnlessRead, ..self }
    }

    /// The same for a product that only datasets have, and runs do not make. The writer gets it from [`Products::optional`].
    pub fn if_stored(self) -> Self {
        Self { need: InputNeed::IfStored, ..self }
    }

    /// The same for a product that the writer reads, and does not store.
    pub fn not_stored(self) -> Self {
        Self { is_stored: false, ..self }
    }

    /// Names of the products of some inputs.
    pub fn names(inputs: &[Self]) -> Vec<String> {
        inputs.iter().map(|input| input.product.clone()).collect()
    }

    /// The products that an option named `include` lists.
    pub fn included(include: &[ProductName], accepts: Accepts) -> Vec<Self> {
        let input = |(i, name): (usize, &ProductName)| Self {
            accepts: accepts.clone(),
            option: Some(format!("include[{i}]")),
            ..Self::named(name.as_str())
        };
        include.iter().enumerate().map(input).collect()
    }
}

impl fmt::Debug for Accepts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Any => f.write_str("Any"),
            Self::Type(key) => f.debug_tuple("Type").field(key).finish(),
            Self::If(_) => f.write_str("If(..)"),
        }
    }
}

impl Accepts {
    /// A product that the function accepts; see [`If`](Self::If).
    pub fn when(accepts: impl Fn(&KeyId) -> Result<(), String> + Send + Sync + 'static) -> Self {
        Self::If(Arc::new(accepts))
    }

    /// Refuses a product that cannot be stored, with the reason.
    pub fn check(&self, key: &KeyId) -> Result<(), String> {
        match self {
            Self::Any => Ok(()),
            Self::Type(own) if own.type_id() == key.type_id() => Ok(()),
            Self::Type(own) => Err(format!("it is {}, not {}", key.type_name(), own.type_name())),
            Self::If(check) => check(key),
        }
    }
}
