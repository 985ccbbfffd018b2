//! `syntable list`.

use super::check::PrintedLog;
use crate::arguments::{RecipeArgs, RecipeChanges};
use crate::console::Console;
use crate::exit::Exit;
use crate::verb::topics;
use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};
use syntable_mesh::format::{ImageFormats, MeshFormats};
use syntable_model::error::{Error, Result};
use syntable_model::product::KeyId;
use syntable_model::registry::{Entry, Registry, Slot};
use syntable_model::words::first_sentence;
use syntable_recipe::plan::{available, table_within};
use syntable_recipe::{BUILTINS, description_of, nearest, options_of};
use syntable_runtime::pools::{AssetStore, ListedAsset};

#[derive(Args)]
pub(crate) struct ListArgs {
    /// A slot such as `place` or `write`, a kind such as `drop_box` or `lights.sun`, `products`, `recipes`, `formats`
    /// or `metrics`. Default: all kinds.
    what: Option<String>,
    /// Recipe for `syntable list assets my.toml`, which lists its assets with part, license and probability.
    recipe: Option<PathBuf>,
    /// Set a key of the recipe, as in `syntable run`.
    #[arg(long, value_name = "KEY=VALUE", requires = "recipe")]
    set: Vec<String>,
    /// Print the recipe's assets as JSON, one object per line.
    #[arg(long, requires = "recipe")]
    json: bool,
}

pub(crate) fn list(console: &Console, registry: &Registry, args: &ListArgs) -> std::result::Result<(), Exit> {
    let what = args.what.as_deref();
    let width = console.width();
    if let Some(path) = &args.recipe {
        return match what {
            Some("assets") => assets(console, registry, args, path),
            _ => {
                let error = Error::new(format!("a recipe has no list of `{}`", what.unwrap_or_default()));
                Err(Exit::wrong(error.help("write `syntable list assets RECIPE`, or leave out the recipe")))
            }
        };
    }
    match what {
        Some("products") => return console.print(&products_table(registry, width)),
        Some("formats") => return console.print(&formats_table(registry, width).map_err(Exit::wrong)?),
        Some("recipes") => return console.print(&recipes_table(width)),
        _ => {}
    }
    if let Some(topic) = topics().iter().find(|topic| what == Some(topic.name)) {
        let rows = (topic.rows)().map_err(Exit::stopped)?;
        return console.print(&table_within(&rows, width));
    }
    let kinds: Vec<&Entry> =
        registry.entries().iter().filter(|entry| what.is_some_and(|what| is_named(entry, what))).collect();
    if !kinds.is_empty() {
        let pages: Vec<String> = kinds.into_iter().map(|entry| kind_page(registry, entry, width)).collect();
        return console.print(&pages.join("\n"));
    }
    let slots: Vec<Slot> = Slot::ALL.into_iter().filter(|slot| what.is_none_or(|what| what == slot.name())).collect();
    if slots.is_empty() {
        let what = what.unwrap_or_default();
        let own = topics().into_iter().map(|topic| topic.name);
        let names = own.chain(Slot::ALL.map(Slot::name)).collect::<Vec<_>>().join(", ");
        let error = Error::new(format!("no kind or list has the name `{what}`"));
        let near = nearest(what, registry.entries().iter().map(|entry| entry.kind));
        let near = near.map_or_else(String::new, |near| format!("did you mean {near}? "));
        return Err(Exit::wrong(error.help(format!("{near}write a kind, products, recipes, formats, {names}"))));
    }
    let mut rows = vec![["slot", "kind", "crate", "version", "what it does"].map(str::to_owned)];
    for entry in slots.into_iter().flat_map(|slot| registry.of_slot(slot)) {
        rows.push(
            [entry.slot.name(), entry.kind, entry.crate_name, entry.crate_version, &summary(entry)].map(str::to_owned),
        );
    }
    let mut out = table_within(&rows, width);
    if what.is_none() {
        out.push('\n');
        out += &products_table(registry, width);
        out.push('\n');
        out += &recipes_table(width);
        out.push('\n');
        out += &formats_table(registry, width).map_err(Exit::wrong)?;
        for topic in topics() {
            out.push('\n');
            out += &table_within(&(topic.rows)().map_err(Exit::stopped)?, width);
        }
    }
    console.print(&out)
}

/// The assets of a recipe's pools: part, license, and the probability that each drawing option selects it.
fn assets(console: &Console, registry: &Registry, args: &ListArgs, path: &Path) -> std::result::Result<(), Exit> {
    let log = PrintedLog(console);
    let changes = RecipeChanges { set: args.set.clone(), ..RecipeChanges::default() };
    let of_run = RecipeArgs { recipe: Some(path.to_owned()), changes };
    let (source, overrides) = of_run.read()?;
    let recipe = syntable_recipe::load(registry, source, &overrides.with_existing_paths());
    let recipe = console.loaded(recipe)?;
    let store = AssetStore::open(&recipe, &log).map_err(Exit::wrong)?;
    let listing = store.listing();
    if args.json {
        let lines: String = listing.iter().map(|asset| json!(asset).to_string() + "\n").collect();
        return console.print(&lines);
    }
    console.print(&assets_table(&listing, console.width()))
}

fn assets_table(listing: &[ListedAsset], width: Option<usize>) -> String {
    let mut rows =
        vec![["pool", "name", "obj_id", "category", "part", "license", "chance per draw"].map(str::to_owned)];
    for asset in listing {
        let chances = asset.draws.iter().map(|chance| format!("{} {}", chance.option, percent(chance.probability)));
        rows.push([
            asset.asset.pool.clone(),
            asset.asset.name.clone(),
            asset.obj_id.map_or_else(|| "-".to_owned(), |obj_id| obj_id.to_string()),
            asset.category.clone(),
            asset.part.map_or_else(|| "-".to_owned(), |part| part.to_string()),
            asset.license.clone().unwrap_or_else(|| "not stated".to_owned()),
            chances.collect::<Vec<_>>().join(", "),
        ]);
    }
    table_within(&rows, width)
}

/// A probability in percent, with three significant digits down to 0.1 %.
fn percent(probability: f64) -> String {
    match probability * 100.0 {
        percent if percent >= 10.0 => format!("{percent:.1} %"),
        percent if percent >= 1.0 => format!("{percent:.2} %"),
        percent if percent >= 0.1 => format!("{percent:.3} %"),
        percent => format!("{percent:.5} %"),
    }
}

/// First sentence of a kind's description.
pub fn summary(entry: &Entry) -> String {
    let schema = entry.schema(&mut schemars::generate::SchemaSettings::draft07().into_generator());
    first_sentence(schema.get("description").and_then(|text| text.as_str()).unwrap_or_default())
}

/// All products of the linked plugins with default options, and their providers.
pub fn products(registry: &Registry) -> Vec<(KeyId, String)> {
    available(registry).into_iter().map(|(key, providers)| (key, providers.join(", "))).collect()
}

/// Whether a word names a kind: `drop_box`, or with its slot `place.drop_box`.
fn is_named(entry: &Entry, what: &str) -> bool {
    let is_slot = Slot::ALL.iter().any(|slot| slot.name() == what);
    (what == entry.kind && !is_slot) || what.split_once('.') == Some((entry.slot.name(), entry.kind))
}

/// The description and the options of a kind.
fn kind_page(registry: &Registry, entry: &Entry, width: Option<usize>) -> String {
    let mut out = format!("{}.{} ({} {})\n\n", entry.slot, entry.kind, entry.crate_name, entry.crate_version);
    out += &description_of(registry, entry);
    let mut rows = vec![["option", "value", "default", "meaning"].map(str::to_owned)];
    rows.extend(options_of(registry, entry).into_iter().map(|option| {
        let default =
            if option.required { "required".to_owned() } else { option.default.unwrap_or_else(|| "none".into()) };
        [option.path, option.value, default, option.meaning]
    }));
    match rows.len() {
        1 => out += "\n\nIt has no options.\n",
        _ => out += &format!("\n\n{}", table_within(&rows, width)),
    }
    if !entry.example.is_empty() {
        out += &format!("\nExample:\n{}\n", entry.example);
    }
    out
}

/// The built-in recipes.
fn recipes_table(width: Option<usize>) -> String {
    let mut rows = vec![["recipe", "what it makes"].map(str::to_owned)];
    rows.extend(BUILTINS.iter().map(|builtin| [format!("builtin:{}", builtin.name), builtin.summary()]));
    table_within(&rows, width)
}

fn products_table(registry: &Registry, width: Option<usize>) -> String {
    let mut rows = vec![["product", "kind of value", "per", "provider", "meaning"].map(str::to_owned)];
    for (key, provider) in products(registry) {
        rows.push([key.to_string(), key.kind_of_value(), key.scope.to_string(), provider, key.summary()]);
    }
    table_within(&rows, width)
}

/// The file formats that the linked plugins read.
fn formats_table(registry: &Registry, width: Option<usize>) -> Result<String> {
    let mut rows = vec![["format", "what it holds", "file endings", "crate"].map(str::to_owned)];
    let mut row = |name: &str, holds: &str, extensions: &[&str], crate_name: &str| {
        rows.push([name.to_owned(), holds.to_owned(), extensions.join(", "), crate_name.to_owned()]);
    };
    for format in MeshFormats::linked()?.iter() {
        row(format.name, "mesh", format.extensions, format.crate_name);
    }
    for format in ImageFormats::linked()?.iter() {
        row(format.name, "image", format.extensions, format.crate_name);
    }
    for format in registry.formats() {
        row(format.name(), "dataset, for convert and validate", &[], format.owner());
    }
    Ok(table_within(&rows, width))
}
