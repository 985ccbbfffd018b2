//! `syntable check`.

use super::{Console, Exit, Message, RecipeArgs};
use crate::pools::AssetStore;
use crate::recipe::Overrides;
use clap::Args;
use std::path::PathBuf;
use syntable_model::context::{Collected, Log};
use syntable_model::error::Error;
use syntable_model::inspect::inspect;
use syntable_model::registry::Registry;

#[derive(Args)]
pub(super) struct CheckArgs {
    #[command(flatten)]
    recipe: RecipeArgs,
    /// Load one asset of any kind, and say what it is or what is wrong with it.
    #[arg(long, value_name = "PATH", conflicts_with_all = ["recipe", "set", "seed", "views"])]
    asset: Option<PathBuf>,
}

pub(super) fn check(console: &Console, registry: &Registry, args: &CheckArgs) -> Result<(), Exit> {
    match &args.asset {
        Some(path) => asset(console, path),
        None => recipe(console, registry, &args.recipe),
    }
}

/// Everything that can be known without rendering: the text, the plan, and what the pools hold.
fn recipe(console: &Console, registry: &Registry, args: &RecipeArgs) -> Result<(), Exit> {
    struct Print<'a>(&'a Console);
    impl Log for Print<'_> {
        fn warn(&self, warning: &Error) {
            self.0.say(&Message::Warning(warning.clone()));
        }
    }
    let recipe = console.load_with(registry, args, Overrides::with_existing_paths)?;
    recipe.found().map_err(Exit::wrong)?;
    let log = Print(console);
    let assets = AssetStore::open(&recipe, &log).map_err(Exit::wrong)?;
    let mut out =
        format!("{}: no mistake found; {} products are computed\n", recipe.dataset.name, recipe.plan.entries.len());
    for (id, size) in assets.sizes() {
        out += &format!("assets.{id}: {size} assets\n");
    }
    console.print(&out)
}

fn asset(console: &Console, path: &std::path::Path) -> Result<(), Exit> {
    let log = Collected::default();
    let found = inspect(path, &log);
    for warning in log.warnings() {
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
