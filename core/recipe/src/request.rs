//! A recipe and changes to it, as a user asks for them.

use crate::load::load;
use crate::merge::overrides::Overrides;
use crate::recipe::Recipe;
use crate::text::origin::{Builtin, Source};
use crate::text::report::Report;
use std::path::PathBuf;
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::registry::Registry;
use syntable_model::stage::Input;

/// Name of the default recipe.
const DEFAULT: &str = "quickstart";

/// A recipe by its path, and changes to it: the arguments of `syntable run` and its like.
///
/// ```
/// use syntable_recipe::RecipeRequest;
///
/// let (source, overrides) = RecipeRequest::default().set("dataset.scenes", "3").read()?;
/// assert_eq!(overrides.set, [("dataset.scenes".into(), "3".into())]);
/// # Ok::<(), syntable_model::error::Error>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RecipeRequest {
    /// Recipe file, or `builtin:NAME`; `builtin:quickstart` if none.
    pub recipe: Option<PathBuf>,
    /// Text of the recipe, if the caller has read it. No file is read then.
    pub source: Option<Source>,
    /// Keys to set, as `KEY=VALUE`. The value is TOML; a bare word is text.
    pub set: Vec<String>,
    /// Seed of all randomness: sets `dataset.seed`.
    pub seed: Option<u64>,
    /// Views of every scene: sets `dataset.views_per_scene`.
    pub views: Option<u32>,
}

impl RecipeRequest {
    /// A recipe file, or `builtin:NAME`.
    pub fn new(recipe: impl Into<PathBuf>) -> Self {
        Self { recipe: Some(recipe.into()), ..Self::default() }
    }

    /// The same with a key set: `value` is TOML, or a bare word.
    pub fn set(mut self, key: &str, value: &str) -> Self {
        self.set.push(format!("{key}={value}"));
        self
    }

    /// Reads and loads the recipe for work on this machine. `wanted` names products that are computed in addition to
    /// the products that writers read, for samples in memory. Warnings go to `log`.
    ///
    /// # Errors
    /// With all mistakes at once.
    pub fn load(&self, registry: &Registry, wanted: &[&str], log: &dyn Log) -> std::result::Result<Recipe, Report> {
        let unread = |error| Report { diagnostics: Vec::new(), other: Some(Box::new(error)) };
        let (source, mut overrides) = self.read().map_err(unread)?;
        overrides.wanted = wanted.iter().map(|name| Input::named(*name)).collect();
        let (recipe, warnings) = load(registry, source, &overrides.for_run().with_existing_paths())?;
        for warning in warnings {
            log.warn(&Error::new(warning.render(false)));
        }
        Ok(recipe)
    }

    /// Reads the recipe's text. The changes come with the environment and the current folder of the process.
    ///
    /// # Errors
    /// If the recipe cannot be read, or an entry of `set` has no `=`.
    pub fn read(&self) -> Result<(Source, Overrides<'static>)> {
        let source = match (&self.source, &self.recipe) {
            (Some(source), _) => source.clone(),
            (None, Some(path)) => Source::read(path)?,
            (None, None) => Builtin::find(DEFAULT)?.source(),
        };
        let mut set = self.set.iter().map(|text| assignment(text)).collect::<Result<Vec<_>>>()?;
        set.extend(self.seed.map(|seed| ("dataset.seed".to_owned(), seed.to_string())));
        set.extend(self.views.map(|views| ("dataset.views_per_scene".to_owned(), views.to_string())));
        Ok((source, Overrides::of_process(set)))
    }
}

/// Splits `KEY=VALUE`.
fn assignment(text: &str) -> Result<(String, String)> {
    let (key, value) = text.split_once('=').ok_or_else(|| {
        let error = Error::new(format!("`options.set` {text}: the value is missing"));
        error.help("write KEY=VALUE, such as dataset.scenes=3")
    })?;
    Ok((key.trim().to_owned(), value.trim().to_owned()))
}
