//! `syntable check`.

use super::{Console, Exit, Message, RecipeArgs};
use crate::pools::{self, AssetStore};
use crate::recipe::{self, Checked, Diagnostic, Overrides, Recipe, Source};
use clap::Args;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};
use std::path::PathBuf;
use syntable_model::context::{Assets, Collected, Log};
use syntable_model::error::Error;
use syntable_model::inspect::inspect;
use syntable_model::registry::Registry;
use syntable_model::scene::{AssetRef, CatalogEntry};

#[derive(Args)]
pub(super) struct CheckArgs {
    #[command(flatten)]
    recipe: RecipeArgs,
    /// Load one asset of any kind, and say what it is or what is wrong with it.
    #[arg(long, value_name = "PATH", conflicts_with_all = ["recipe", "set", "seed", "views"])]
    asset: Option<PathBuf>,
    /// Load every asset of the recipe's pools, and say which ones are bad: of all pools, or of one.
    #[arg(long, value_name = "POOL", num_args = 0..=1, require_equals = true, conflicts_with = "asset")]
    assets: Option<Option<String>>,
}

pub(super) fn check(console: &Console, registry: &Registry, args: &CheckArgs) -> Result<(), Exit> {
    match &args.asset {
        Some(path) => asset(console, path),
        None => recipe(console, registry, args),
    }
}

/// A log whose warnings the console prints.
pub(super) struct PrintedLog<'a>(pub &'a Console);

impl Log for PrintedLog<'_> {
    fn warn(&self, warning: &Error) {
        self.0.say(&Message::Warning(warning.clone()));
    }
}

/// Everything that can be known without rendering: the text, the plan, and what the pools hold.
fn recipe(console: &Console, registry: &Registry, args: &CheckArgs) -> Result<(), Exit> {
    let log = PrintedLog(console);
    let (source, overrides) = args.recipe.read()?;
    let Checked { recipe, pools } = recipe::checked(registry, source, &overrides.with_existing_paths());
    let recipe = console.loaded(recipe, || pools::open(&pools, &log).err())?;
    let assets = AssetStore::open(&recipe, &log).map_err(Exit::wrong)?;
    let mut out =
        format!("{}: no mistake found; {} products are computed\n", recipe.dataset.name, recipe.plan.entries.len());
    let Some(wanted) = &args.assets else {
        for (id, size) in assets.sizes() {
            let sizes = assets.part_sizes(id).map_or_else(|| format!("{size} assets"), |sizes| sizes.to_string());
            out += &format!("assets.{id}: {sizes}\n");
        }
        return console.print(&out);
    };
    console.print(&out)?;
    all_assets(console, &assets, wanted.as_deref())
}

/// Loads a recipe for a run, with all that `check` finds: the recipe and its warnings, or all messages of one with mistakes.
pub fn load_checked(
    registry: &Registry,
    source: Source,
    overrides: Overrides,
    log: &dyn Log,
) -> Result<(Recipe, Vec<Diagnostic>), Vec<Message>> {
    let Checked { recipe, pools } = recipe::checked(registry, source, &overrides.for_run().with_existing_paths());
    recipe.map_err(|report| report.messages_with(pools::open(&pools, log).err()))
}

/// Loads all assets of the pools, or of one. The bad ones are reported as they are found; the error counts them.
fn all_assets(console: &Console, assets: &AssetStore<'_>, wanted: Option<&str>) -> Result<(), Exit> {
    if let Some(pool) = wanted {
        assets.entries(pool).map_err(Exit::wrong)?;
    }
    let (mut all, mut bad) = (0, 0);
    for (pool, size) in assets.sizes().filter(|(pool, _)| wanted.is_none_or(|wanted| wanted == *pool)) {
        let entries = assets.entries(pool).map_err(Exit::wrong)?;
        // The name of each bad asset, in order; an error of the file system says nothing about the asset.
        let bad_name = |entry: &CatalogEntry| {
            let asset = AssetRef { pool: pool.to_owned(), name: entry.name.clone() };
            match assets.get(&asset) {
                Ok(_) => Ok(None),
                Err(error) if error.is_transient() => Err(error),
                Err(_) => Ok(Some(entry.name.clone())),
            }
        };
        let found: Result<Vec<Option<String>>, Error> = entries.par_iter().map(bad_name).collect();
        let names: Vec<String> = found.map_err(Exit::wrong)?.into_iter().flatten().collect();
        let mut out = format!("assets.{pool}: {} of {size} assets are good\n", size - names.len());
        names.iter().for_each(|name| out += &format!("  bad: {name}\n"));
        console.print(&out)?;
        (all, bad) = (all + size, bad + names.len());
    }
    match bad {
        0 => Ok(()),
        _ => Err(Exit::wrong(Error::new(format!("{bad} of {all} assets are bad")).help(
            "mend them, or leave them out with `exclude`; a run leaves them out unless `on_bad_asset = \"fail\"`",
        ))),
    }
}

fn asset(console: &Console, path: &std::path::Path) -> Result<(), Exit> {
    let log = Collected::default();
    let found = inspect(path, &log);
    for warning in log.merged() {
        console.say(&Message::Warning(warning));
    }
    let (name, inspection) = found.map_err(|error| Exit::wrong(error.in_file(path)))?;
    let mut out = format!("{}: {name}\n", path.display());
    let width = inspection.facts.iter().map(|(fact, _)| fact.chars().count()).max().unwrap_or(0);
    for (fact, value) in &inspection.facts {
        out += &format!("  {fact:width$}  {value}\n");
    }
    console.print(&out)
}
