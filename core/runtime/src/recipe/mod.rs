//! From TOML text to stages: recipes, their diagnostics, their schema, and their resolved form.
//!
//! ```text
//! files ── parse, inherit ──► one spanned tree ── validate ──► options ── build ──► Recipe + resolved text
//!   │                                                │                      │
//!   └─────────── every mistake of every table becomes a Diagnostic ────────┘
//! ```
//!
//! - [`load`] loads a recipe; it returns a [`Recipe`] with warnings, or a [`Report`] of all mistakes.
//! - [`schema()`] generates the JSON Schema for editors. The loader validates tables against the same schema.
//! - [`lints`] checks the kinds of a registry against the house rules, for tests.
//!
//! **Invariants.** Files are opened through [`Overrides`] only, and no asset is touched. Each file is parsed once and
//! each table validated once. A value keeps its file and bytes however recipes are merged. One bad table never hides the
//! mistakes of another. Loading the text in [`Recipe::resolved`] gives the same text.

mod builtin;
mod check;
mod code;
mod dataset;
mod describe;
mod diagnostic;
mod editor;
mod ids;
mod inherit;
mod key_path;
mod lints;
mod load;
mod overrides;
mod parse;
mod parts;
mod placers;
mod plan;
mod pool;
mod renamed;
mod request;
mod resolved;
mod schema;
mod source;
mod stages;
mod suggest;
mod variables;

pub use builtin::{BUILTINS, Builtin};
pub use code::Code;
pub use dataset::{CatalogAsset, CatalogLock, CatalogNames, Dataset, Lock, OnBadAsset};
pub use describe::{OptionInfo, description_of, options_of};
pub use diagnostic::{Diagnostic, Label, Report, Severity};
pub use editor::{editor_schema, schema_text};
pub(crate) use ids::Numbering;
pub use ids::ObjectIds;
pub use lints::lints;
pub use load::load;
pub(crate) use load::{Checked, checked};
pub use overrides::Overrides;
pub use parts::Parts;
pub use pool::{Center, Mass, ObjectProperties, Part, PartSizes, Pool, PoolOptions, Scale, Selection, Split};
pub use request::RecipeRequest;
pub use resolved::{lock_of, with_devices, with_lock, without_assets, without_lock};
pub use schema::schema;
pub use source::SourceFile;
pub use stages::Draw;
pub use suggest::nearest;

use crate::plan::Plan;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;
use syntable_model::check::LabelCheck;
use syntable_model::error::{Error, Result};
use syntable_model::files::read_small;
use syntable_model::stage::{CameraModel, LightSampler, Placer, Renderer, Scenes, Settler, ViewSampler, Writer};

/// The text of a recipe and its origin.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// Its name in diagnostics, if it has no path.
    pub name: String,
    /// Its file. Relative paths start from the file's folder, or without a file from the current folder.
    pub path: Option<PathBuf>,
    /// The text.
    pub text: String,
}

impl Source {
    /// Reads a file, or takes the embedded recipe that `builtin:NAME` means.
    pub fn read(path: impl Into<PathBuf>) -> Result<Self> {
        let path = path.into();
        if let Some(name) = path.to_str().and_then(|path| path.strip_prefix(builtin::PREFIX)) {
            return Builtin::find(name).map(Builtin::source);
        }
        let bytes = read_small(&path).map_err(|error| {
            let failed = Error::io(&path, &error);
            match path
                .to_str()
                .filter(|name| BUILTINS.iter().any(|builtin| builtin.name == name.trim_end_matches(".toml")))
            {
                Some(name) => failed.help(format!(
                    "write {}{} for the recipe in the program",
                    builtin::PREFIX,
                    name.trim_end_matches(".toml")
                )),
                None => failed,
            }
        })?;
        let text = String::from_utf8(bytes).map_err(|error| {
            Error::new("the recipe is not UTF-8").in_file(&path).at_byte(error.utf8_error().valid_up_to() as u64)
        })?;
        Ok(Self::file(path, text))
    }

    /// A recipe in a file.
    pub fn file(path: impl Into<PathBuf>, text: impl Into<String>) -> Self {
        let path = path.into();
        Self { name: path.display().to_string(), path: Some(path), text: text.into() }
    }

    /// A recipe that is not in a file, such as one embedded in the program.
    pub fn embedded(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self { name: name.into(), path: None, text: text.into() }
    }
}

/// A loaded recipe, ready to be planned and run.
pub struct Recipe {
    /// Name, seed and size of the dataset.
    pub dataset: Dataset,
    /// The pools, by id.
    pub assets: BTreeMap<String, Pool>,
    /// The placers with their ids, in the order in which they run.
    pub place: Vec<(String, Box<dyn Placer>)>,
    /// The settler.
    pub settle: Box<dyn Settler>,
    /// The camera.
    pub camera: Box<dyn CameraModel>,
    /// The view sampler.
    pub views: Box<dyn ViewSampler>,
    /// The light samplers with their ids, in the recipe's order.
    pub lights: Vec<(String, Box<dyn LightSampler>)>,
    /// The renderer.
    pub render: Box<dyn Renderer>,
    /// The writers, by id.
    pub write: Vec<(String, Box<dyn Writer<Scenes>>)>,
    /// What is computed for the writers, with the denoiser, the sensors and the annotators.
    pub plan: Plan,
    /// The whole recipe as TOML: every default filled in, every kind named, nothing inherited, with the versions that
    /// made it. Loading it gives the same text.
    pub resolved: String,
    /// What the inputs must be; empty unless the recipe is a resolved one.
    pub lock: Lock,
    /// Files that options of stages name, beside assets and libraries, by the option: their content matters.
    pub files: Vec<(String, PathBuf)>,
    /// Options of stages that name pools, in the order of the slots.
    pub draws: Vec<Draw>,
    /// What must hold in every view that is made.
    pub checks: Vec<Arc<dyn LabelCheck>>,
    /// Pools from which placers draw objects that labels describe.
    pub labeled_pools: BTreeSet<String>,
    /// The folder of the recipe's file, if it has one.
    pub folder: Option<PathBuf>,
    /// Kinds that were chosen for this machine, for people: one line each.
    pub choices: Vec<String>,
    /// Tables whose kind stands for others and was not chosen yet: such a recipe can be planned, not run.
    pub undecided: Vec<String>,
    /// Native libraries that the recipe names by a path beside itself: code of whoever wrote the recipe.
    pub libraries: Vec<String>,
}
