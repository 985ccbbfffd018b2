//! `syntable check`.

use crate::arguments::RecipeChanges;
use crate::console::Console;
use crate::exit::Exit;
use clap::Args;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use syntable_model::context::{Collected, Log};
use syntable_model::error::Error;
use syntable_model::inspect::inspect;
use syntable_model::registry::Registry;
use syntable_recipe::message::Message;
use syntable_recipe::{Fix, Overrides, Recipe, Source};
use syntable_runtime::durable;
use syntable_runtime::pools::AssetStore;
use syntable_runtime::{check, run::progress::count};

#[derive(Args)]
pub(crate) struct CheckArgs {
    /// Recipe files, or `builtin:NAME` for built-in recipes (see `syntable list recipes`). Default:
    /// `builtin:quickstart`.
    #[arg(value_name = "RECIPE")]
    recipes: Vec<PathBuf>,
    #[command(flatten)]
    changes: RecipeChanges,
    /// First rewrite old names of options, kinds and products in the named files, and print the changed lines. Recipes
    /// that the named ones extend stay as they are.
    #[arg(long, requires = "recipes", conflicts_with = "asset")]
    fix: bool,
    /// Load one asset of any kind, and print its properties or its faults.
    #[arg(long, value_name = "PATH", conflicts_with_all = ["recipes", "set", "seed", "views"])]
    asset: Option<PathBuf>,
    /// Load every asset of all the recipe's pools, or of one pool, and list the bad ones.
    #[arg(long, value_name = "POOL", num_args = 0..=1, require_equals = true, conflicts_with = "asset")]
    assets: Option<Option<String>>,
}

pub(crate) fn check(console: &Console, registry: &Registry, args: &CheckArgs) -> Result<(), Exit> {
    if let Some(path) = &args.asset {
        return asset(console, path);
    }
    if args.fix {
        fix(console, registry, args)?;
    }
    match args.recipes.as_slice() {
        [] => recipe(console, registry, args, None),
        [path] => recipe(console, registry, args, Some(path)),
        paths => all(console, registry, args, paths),
    }
}

/// Checks several recipes. The exit code is the worst one.
fn all(console: &Console, registry: &Registry, args: &CheckArgs, paths: &[PathBuf]) -> Result<(), Exit> {
    let (mut worst, mut wrong) = (0, 0);
    for path in paths {
        console.print(&format!("{}: ", path.display()))?;
        if let Err(Exit { code, messages }) = recipe(console, registry, args, Some(path)) {
            console.print("has errors\n")?;
            messages.iter().for_each(|message| console.say(message));
            (worst, wrong) = (worst.max(code), wrong + 1);
        }
    }
    let good = paths.len() - wrong;
    console.print(&format!("{}: {good} without errors, {wrong} with errors\n", count(paths.len() as u32, "recipe")))?;
    if worst == 0 { Ok(()) } else { Err(Exit { code: worst, messages: Vec::new() }) }
}

/// Rewrites old names in the named files.
fn fix(console: &Console, registry: &Registry, args: &CheckArgs) -> Result<(), Exit> {
    // A file has one absolute path, whatever way leads to it.
    let whole = |path: &Path| path.canonicalize().ok();
    let mut fixes: BTreeMap<PathBuf, Vec<Fix>> = BTreeMap::new();
    for path in &args.recipes {
        if whole(path).is_none() {
            return Err(Exit::wrong(Error::new("--fix rewrites files, and this is none").in_file(path)));
        }
    }
    for path in &args.recipes {
        let (source, overrides) = args.changes.request(Some(path.clone())).read().map_err(Exit::wrong)?;
        for fix in found_fixes(registry, source, &overrides) {
            if let Some(file) = whole(Path::new(fix.file.name())) {
                fixes.entry(file).or_default().push(fix);
            }
        }
    }
    let mut rewritten = 0;
    for path in &args.recipes {
        let Some(own) = whole(path).and_then(|file| fixes.remove(&file)) else { continue };
        let before = own[0].file.text();
        let after = syntable_recipe::fixed(before, &own).map_err(|error| Exit::wrong(error.in_file(path)))?;
        durable::write_file(path, after.as_bytes()).map_err(Exit::stopped)?;
        console.print(&syntable_recipe::diff(&path.display().to_string(), before, &after))?;
        rewritten += 1;
    }
    if rewritten == 0 { console.print("no old names found\n") } else { Ok(()) }
}

/// The fixes of all mistakes of a recipe, also in recipes that it extends.
fn found_fixes(registry: &Registry, source: Source, overrides: &Overrides) -> Vec<Fix> {
    match syntable_recipe::load(registry, source, overrides) {
        Ok(_) => Vec::new(),
        Err(report) => report.diagnostics.into_iter().filter_map(|diagnostic| diagnostic.fix).collect(),
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
fn recipe(console: &Console, registry: &Registry, args: &CheckArgs, path: Option<&PathBuf>) -> Result<(), Exit> {
    let log = PrintedLog(console);
    let (source, overrides) = args.changes.request(path.cloned()).read().map_err(Exit::wrong)?;
    if let Some(wanted) = &args.assets {
        let recipe = console.loaded(check::load_naming_all(registry, source, overrides, &log))?;
        let assets = recipe.fits().and_then(|()| AssetStore::open_for_run(&recipe, &log)).map_err(Exit::wrong)?;
        console.print(&no_errors(&recipe))?;
        return all_assets(console, (&recipe, &assets), wanted.as_deref());
    }
    let checked = check::check(registry, source, overrides, &log);
    let mut pools = Vec::new();
    let recipe = console.loaded(checked.map(|checked| {
        pools = checked.pools;
        (checked.recipe, checked.warnings)
    }))?;
    let mut out = no_errors(&recipe);
    pools.iter().for_each(|(name, size)| out += &format!("{}: {size}\n", recipe.assets[name].table));
    console.print(&out)
}

fn no_errors(recipe: &Recipe) -> String {
    let entries = recipe.components.all().flat_map(|component| &component.plan.entries);
    let products: BTreeSet<String> = entries.map(|entry| entry.key.to_string()).collect();
    format!("{}: no errors; the recipe computes {} products\n", recipe.dataset.name, products.len())
}

/// Loads all assets of the pools, or of one pool. The log names the faults of bad assets, and the error has their
/// number.
fn all_assets(
    console: &Console,
    (recipe, assets): (&Recipe, &AssetStore<'_>),
    wanted: Option<&str>,
) -> Result<(), Exit> {
    let pools: Vec<&str> = match wanted {
        Some(pool) => vec![pool],
        None => assets.sizes().map(|(pool, _)| pool).collect(),
    };
    let (mut all, mut bad) = (0, 0);
    for pool in pools {
        let found = check::check_assets(assets, pool).map_err(Exit::wrong)?;
        let good = found.size - found.bad.len();
        let table = &recipe.assets[pool].table;
        let mut out = format!("{table}: {good} of {} assets are good\n", found.size);
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

fn asset(console: &Console, path: &Path) -> Result<(), Exit> {
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
