//! Arguments that several verbs share.

use crate::exit::Exit;
use clap::Args;
use std::path::PathBuf;
use syntable_recipe::{Overrides, RecipeRequest, Source};

/// A recipe and changes to it, shared by all verbs that take one: [`Args::augment_args`] adds them to a command.
#[derive(Debug, Clone, Args)]
pub struct RecipeArgs {
    /// Recipe file, or `builtin:NAME` for a built-in recipe (see `syntable list recipes`). Default:
    /// `builtin:quickstart`.
    pub recipe: Option<PathBuf>,
    /// The changes.
    #[command(flatten)]
    pub changes: RecipeChanges,
}

/// Changes to recipes: the part of [`RecipeArgs`] without the recipe.
#[derive(Debug, Clone, Default, Args)]
pub struct RecipeChanges {
    /// Set a key: `a.b=value`, `place[2].count=5`. The value is TOML; a bare word is text.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Seed of all random numbers: short for `--set dataset.seed=N`.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Views per scene: short for `--set dataset.views_per_scene=N`.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    pub views: Option<u32>,
}

impl RecipeArgs {
    /// The recipe and its changes as an argument of library functions.
    pub fn request(&self) -> RecipeRequest {
        self.changes.request(self.recipe.clone())
    }

    /// The text of the recipe, and its changes.
    pub fn read(&self) -> Result<(Source, Overrides<'static>), Exit> {
        self.request().read().map_err(Exit::wrong)
    }
}

impl RecipeChanges {
    /// A recipe with these changes as an argument of library functions.
    pub fn request(&self, recipe: Option<PathBuf>) -> RecipeRequest {
        let Self { set, seed, views } = self.clone();
        RecipeRequest { recipe, set, seed, views, ..RecipeRequest::default() }
    }
}

/// Help of `--trust-paths`, a flag of all verbs that read datasets.
pub const TRUST_PATHS: &str =
    "Also read files outside the dataset's folder if its paths or links lead there. Only for datasets that you trust";

/// Help of `--image-folder`, an option of verbs that read the images of datasets.
pub const IMAGE_FOLDER: &str = "Folder of the images, to which the annotation file's names are relative. If it has none of these names, the last part of \
     each name counts, provided that no two are equal. Default: found by the layout of the format";

/// The requested number of threads, or else the number of cores.
pub fn threads(asked: Option<u16>) -> usize {
    asked.map_or_else(syntable_runtime::workers::available, usize::from)
}

/// Parses a number from 1 on, or `all`.
pub fn amount(text: &str) -> std::result::Result<usize, String> {
    match text {
        "all" => Ok(usize::MAX),
        _ => text.parse().ok().filter(|number| *number > 0).ok_or_else(|| "a number from 1 on, or `all`".to_owned()),
    }
}
