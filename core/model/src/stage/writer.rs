//! Writes samples to files.

use crate::context::DatasetContext;
use crate::error::Result;
use crate::names::ProductName;
use crate::product::{Key, KeyId, Product, Products};
use crate::scene::{SceneId, ViewId};
use crate::stage::subject::{Images, Subject};
use crate::stage::{DatasetInfo, Finish, Output};

/// A file format. The files of a scene appear in the dataset when the whole scene is done; a file that covers many
/// scenes is written in `finish`, from per-scene shards.
///
/// A `Writer` writes images and labels. It sees products alone, so it writes datasets that were read, too. A `Writer<Scenes>` sees
/// bodies, materials, cameras and lights as well: it writes scenes that the program made.
pub trait Writer<S: Subject = Images>: Send + Sync {
    /// The products that it reads, each with the kinds of value that it can store. It is lent these and no others.
    fn reads(&self) -> Vec<Input>;
    /// Starts a scene. Dropping the scene writer without closing it abandons the scene.
    fn scene(&self, cx: &S::Scene<'_>, output: Output) -> Result<Box<dyn SceneWriter<S>>>;
    /// Writes what covers many scenes. Called at the end of every run, with all scenes that are done and the products of
    /// the dataset that it reads; called again, it writes the same files.
    ///
    /// It is also tried when the first scene of a run is done, and then writes to a folder that is thrown away: a mistake
    /// that shows here shows early.
    fn finish(&self, cx: &DatasetContext, products: &Products, finish: &Finish) -> Result<()> {
        let _ = (cx, products, finish);
        Ok(())
    }
    /// Whether its files tell objects apart by their numbers (`obj_id`): a recipe with two objects of one number is refused then.
    fn needs_obj_ids(&self) -> bool {
        false
    }
    /// Checks what it needs beside its options, such as files that they name. Called by `check` and before a run.
    fn ready(&self) -> Result<()> {
        Ok(())
    }
    /// The paths, relative to the dataset, that it will write for a view, for a scene or for the dataset, as far as they
    /// can be told before a run. `check` refuses those that two scenes, views or writers share, and those of which one is a
    /// folder of another.
    fn paths(&self, of: &FileOf) -> Result<Vec<String>> {
        let _ = of;
        Ok(Vec::new())
    }
    /// Names of the options that [`finish`](Self::finish) alone reads. They may change in a recipe while its dataset is
    /// made, because the files of the scenes do not depend on them.
    fn finish_options(&self) -> &'static [&'static str] {
        &[]
    }
}

/// What a file is of: a view, if there are a scene and a view; a scene, if there is a scene alone; else the dataset.
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
    /// The products that the writer reads, as far as the recipe can be planned.
    pub products: &'a [KeyId],
}

/// A writer at work on one scene.
pub trait SceneWriter<S: Subject = Images>: Send {
    /// Writes one view. Views come in order. `products` holds what the writer reads of the view, and of the scene as far
    /// as it is known before the views.
    fn view(&mut self, cx: &S::View<'_>, products: &Products) -> Result<()>;
    /// Ends the scene. `products` holds all that the writer reads of the scene.
    fn close(self: Box<Self>, cx: &S::Scene<'_>, products: &Products) -> Result<()>;
}

/// A product that a writer reads.
#[derive(Debug, Clone)]
pub struct Input {
    /// Name of the product.
    pub product: String,
    /// What the writer can store under this name.
    pub accepts: Accepts,
    /// The writer's option that names the product, such as `include[2]`, for diagnostics.
    pub option: Option<String>,
    /// Whether the writer does without it where a dataset that was read lacks it. A run always makes it.
    pub is_optional: bool,
}

/// What a writer can store.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum Accepts {
    /// Any product.
    Any,
    /// A product of exactly this key's type.
    Type(KeyId),
    /// A product that the function does not refuse. The refusal is a reason and a remedy, such as `a PNG file has no
    /// channel for 32-bit floats; write it with exr or npy`.
    If(fn(&KeyId) -> Result<(), String>),
}

impl Input {
    /// A product that the writer knows, of exactly its type.
    pub fn of<T: Product>(key: Key<T>) -> Self {
        Self { product: key.id().to_string(), accepts: Accepts::Type(key.id()), option: None, is_optional: false }
    }

    /// A product by name, whatever its type.
    pub fn named(product: impl Into<String>) -> Self {
        Self { product: product.into(), accepts: Accepts::Any, option: None, is_optional: false }
    }

    /// The same for a product that a dataset that was read may lack: then the writer leaves out what it would say, and finds
    /// it with [`Products::optional`].
    pub fn optional(self) -> Self {
        Self { is_optional: true, ..self }
    }

    /// Names of the products of some inputs.
    pub fn names(inputs: &[Self]) -> Vec<String> {
        inputs.iter().map(|input| input.product.clone()).collect()
    }

    /// The products that an option named `include` lists.
    pub fn included(include: &[ProductName], accepts: Accepts) -> Vec<Self> {
        let input = |(i, name): (usize, &ProductName)| Self {
            product: name.as_str().to_owned(),
            accepts,
            option: Some(format!("include[{i}]")),
            is_optional: false,
        };
        include.iter().enumerate().map(input).collect()
    }
}

impl Accepts {
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
