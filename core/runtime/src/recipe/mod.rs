//! From TOML text to stages: recipes, their diagnostics, their schema, and their resolved form.
//!
//! ```text
//! texts ── extend ──► one spanned tree ── check against the schema ──► stages ──► Recipe + resolved text
//!   │                                        │                          │
//!   └────────────── every mistake of every table becomes a Diagnostic ──┘
//! ```
//!
//! - [`load`] reads a recipe; it returns a [`Recipe`] with warnings, or a [`Report`] of all that is wrong.
//! - [`schema()`] gives the JSON Schema that editors use. The program checks tables against the same schema.
//! - [`registry_faults`] holds a registry to the house rules, for tests.
//!
//! **Invariants.** Nothing here opens a file but through [`Overrides`], and no asset is touched. A value knows the file
//! and bytes that it comes from, however recipes were merged. One bad table never hides the mistakes of another. The
//! text in [`Recipe::resolved`] loads to a recipe with the same text.

mod check;
mod code;
mod dataset;
mod diagnostic;
mod extend;
mod key_path;
mod load;
mod lock;
mod overrides;
mod parse;
mod plan;
mod pool;
mod registry_faults;
mod schema;
mod source;
mod stages;
mod suggest;
mod variables;

pub use code::Code;
pub use dataset::{Dataset, OnBadAsset};
pub use diagnostic::{Diagnostic, Label, Report, Severity};
pub use load::load;
pub use lock::with_asset_digests;
pub use overrides::Overrides;
pub use pool::{Centre, Part, Pool, PoolOptions, Split};
pub use registry_faults::registry_faults;
pub use schema::{schema, schema_text};
pub use source::SourceFile;

use crate::plan::Plan;
use std::collections::BTreeMap;
use std::path::PathBuf;
use syntable_model::error::{Error, Result};
use syntable_model::stage::{CameraModel, LightSampler, Placer, Renderer, Settler, ViewSampler, Writer};

/// The text of a recipe, and where it is from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// Its name in diagnostics, where it has no path.
    pub name: String,
    /// Its file. Relative paths in the text count from the file's folder, or without a file from the current folder.
    pub path: Option<PathBuf>,
    /// The text.
    pub text: String,
}

impl Source {
    /// Reads a file.
    pub fn read(path: impl Into<PathBuf>) -> Result<Self> {
        let path = path.into();
        let bytes = std::fs::read(&path).map_err(|error| Error::io(&path, &error))?;
        let text = String::from_utf8(bytes).map_err(|error| {
            Error::new("the recipe is not UTF-8 text").in_file(&path).at_byte(error.utf8_error().valid_up_to() as u64)
        })?;
        Ok(Self::file(path, text))
    }

    /// The text of a file.
    pub fn file(path: impl Into<PathBuf>, text: impl Into<String>) -> Self {
        let path = path.into();
        Self { name: path.display().to_string(), path: Some(path), text: text.into() }
    }

    /// A text that is no file, such as a recipe embedded in the program.
    pub fn embedded(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self { name: name.into(), path: None, text: text.into() }
    }
}

/// A recipe, ready to be planned and run.
pub struct Recipe {
    /// What the dataset is called and how large it is.
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
    pub write: Vec<(String, Box<dyn Writer>)>,
    /// What is computed for the writers, with the denoiser, the sensors and the annotators.
    pub plan: Plan,
    /// The whole recipe as TOML text: every default filled in, every kind named, nothing inherited, with the versions
    /// that made it. Loading it gives the same text.
    pub resolved: String,
    /// Digests that assets must have, by `pool/name`, if the recipe is a resolved one.
    pub locked: BTreeMap<String, String>,
}
