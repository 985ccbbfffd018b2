//! Checks of a recipe and its assets without rendering.

use crate::pools::{self, AssetStore};
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};
use syntable_model::context::{Assets, Log};
use syntable_model::error::{Error, Result};
use syntable_model::registry::Registry;
use syntable_model::scene::{AssetRef, CatalogEntry};
use syntable_recipe::{Checked, Diagnostic, Overrides, Recipe, Report, Source};

/// A recipe without mistakes.
pub struct CheckedRecipe {
    /// The recipe.
    pub recipe: Recipe,
    /// Warnings about its text.
    pub warnings: Vec<Diagnostic>,
    /// Its pools, with their sizes in words.
    pub pools: Vec<(String, String)>,
}

/// Loads and plans a recipe, and finds every mistake that a run would find before it renders: wrong keys and values,
/// missing files, products that no stage provides, pools that cannot be opened, names of assets that no pool has, and images that the memory of this
/// machine cannot hold. Native libraries are not loaded.
///
/// # Errors
/// With all mistakes at once.
pub fn check(
    registry: &Registry,
    source: Source,
    overrides: Overrides,
    log: &dyn Log,
) -> std::result::Result<CheckedRecipe, Report> {
    let (recipe, warnings) = load_naming_all(registry, source, overrides, log)?;
    let size = |assets: &AssetStore, id: &str, size: usize| {
        assets.part_sizes(id).map_or_else(|| format!("{size} assets"), |sizes| sizes.to_string())
    };
    let opened = recipe.fits().and_then(|()| {
        let assets = AssetStore::open_for_run(&recipe, log)?;
        Ok(assets.sizes().map(|(id, count)| (id.to_owned(), size(&assets, id, count))).collect())
    });
    match opened {
        Ok(pools) => Ok(CheckedRecipe { recipe, warnings, pools }),
        Err(error) => Err(Report { diagnostics: warnings, other: Some(Box::new(error)) }),
    }
}

/// Loads and plans a recipe. Only if the recipe has mistakes, its pools are opened, too, so that the error names all
/// mistakes.
///
/// # Errors
/// With all mistakes at once.
pub fn load_naming_all(
    registry: &Registry,
    source: Source,
    overrides: Overrides,
    log: &dyn Log,
) -> std::result::Result<(Recipe, Vec<Diagnostic>), Report> {
    let Checked { recipe, pools } = syntable_recipe::checked(registry, source, &overrides.with_existing_paths());
    recipe.map_err(|report| Report { other: pools::open(&pools, log).err().map(Box::new), ..report })
}

/// The assets of a pool, all of them loaded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CheckedPool {
    /// Name of the pool.
    pub pool: String,
    /// Number of its assets.
    pub size: usize,
    /// Names of the unusable assets, in the order of the catalog. The log has the reason for each.
    pub bad: Vec<String>,
}

/// Loads all assets of a pool on all threads of the current pool of workers.
///
/// # Errors
/// If the recipe has no such pool, or a file system fails. A bad asset is no error.
pub fn check_assets(assets: &AssetStore<'_>, pool: &str) -> Result<CheckedPool> {
    let entries = assets.entries(pool)?;
    let bad_name = |entry: &CatalogEntry| {
        let asset = AssetRef { pool: pool.to_owned(), name: entry.name.clone() };
        match assets.get(&asset) {
            Ok(_) => Ok(None),
            // A transient error does not make the asset bad.
            Err(error) if error.is_transient() => Err(error),
            Err(_) => Ok(Some(entry.name.clone())),
        }
    };
    let found: std::result::Result<Vec<Option<String>>, Error> = entries.par_iter().map(bad_name).collect();
    Ok(CheckedPool { pool: pool.to_owned(), size: entries.len(), bad: found?.into_iter().flatten().collect() })
}
