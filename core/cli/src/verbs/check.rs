//! `syntable check`.

use crate::arguments::RecipeArgs;
use crate::console::Console;
use crate::exit::Exit;
use clap::Args;
use std::path::PathBuf;
use syntable_model::context::{Collected, Log};
use syntable_model::error::Error;
use syntable_model::inspect::inspect;
use syntable_model::registry::Registry;
use syntable_recipe::Recipe;
use syntable_recipe::message::Message;
use syntable_runtime::check;
use syntable_runtime::pools::AssetStore;

#[derive(Args)]
pub(crate) struct CheckArgs {
    #[command(flatten)]
    recipe: RecipeArgs,
    /// Load one asset of any kind, and print its properties or its faults.
    #[arg(long, value_name = "PATH", conflicts_with_all = ["recipe", "set", "seed", "views"])]
    asset: Option<PathBuf>,
    /// Load every asset of all the recipe's pools, or of one pool, and list the bad ones.
    #[arg(long, value_name = "POOL", num_args = 0..=1, require_equals = true, conflicts_with = "asset")]
    assets: Option<Option<String>>,
}

pub(crate) fn check(console: &Console, registry: &Registry, args: &CheckArgs) -> Result<(), Exit> {
    match &args.asset {
        Some(path) => asset(console, path),
        None => recipe(console, registry, args),
    }
}

/// A log that prints its warnings on the console.
pub(crate) struct PrintedLog<'a>(pub &'a Console);

impl Log for PrintedLog<'_> {
    fn warn(&self, warning: &Error) {
        self.0.say(&Message::Warning(warning.clone()));
    }
}

/// Checks everything that needs no rendering: the text, the plan, and the pools.
fn recipe(console: &Console, registry: &Registry, args: &CheckArgs) -> Result<(), Exit> {
    let log = PrintedLog(console);
    let (source, overrides) = args.recipe.read()?;
    if let Some(wanted) = &args.assets {
        let recipe = console.loaded(check::load_naming_all(registry, source, overrides, &log))?;
        let assets = recipe.fits().and_then(|()| AssetStore::open(&recipe, &log)).map_err(Exit::wrong)?;
        console.print(&no_errors(&recipe))?;
        return all_assets(console, &assets, wanted.as_deref());
    }
    let checked = check::check(registry, source, overrides, &log);
    let mut pools = Vec::new();
    let recipe = console.loaded(checked.map(|checked| {
        pools = checked.pools;
        (checked.recipe, checked.warnings)
    }))?;
    let mut out = no_errors(&recipe);
    pools.iter().for_each(|(id, size)| out += &format!("assets.{id}: {size}\n"));
    console.print(&out)
}

fn no_errors(recipe: &Recipe) -> String {
    let products = recipe.plan.entries.len();
    format!("{}: no errors; the recipe computes {products} products\n", recipe.dataset.name)
}

/// Loads all assets of the pools, or of one pool. The log names the faults of bad assets, and the error has their
/// number.
fn all_assets(console: &Console, assets: &AssetStore<'_>, wanted: Option<&str>) -> Result<(), Exit> {
    let pools: Vec<&str> = match wanted {
        Some(pool) => vec![pool],
        None => assets.sizes().map(|(pool, _)| pool).collect(),
    };
    let (mut all, mut bad) = (0, 0);
    for pool in pools {
        let found = check::check_assets(assets, pool).map_err(Exit::wrong)?;
        let good = found.size - found.bad.len();
        let mut out = format!("assets.{pool}: {good} of {} assets are good\n", found.size);
        found.bad.iter().for_each(|name| out += &format!("  bad: {name}\n"));
        console.print(&out)?;
        (all, bad) = (all + found.size, bad + found.bad.len());
    }
    match bad {
        0 => Ok(()),
        _ => Err(Exit::wrong(
            Error::new(format!("{bad} of {all} assets are bad"))
                .help("repair them, or omit them with `exclude`; a run skips them unless `on_bad_asset = \"fail\"`"),
        )),
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
