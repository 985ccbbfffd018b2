//! `syntable list`.

use super::{Console, Exit};
use crate::plan::{available, table};
use clap::Args;
use syntable_mesh::format::{ImageFormats, MeshFormats};
use syntable_model::error::{Error, Result};
use syntable_model::product::{KeyId, first_sentence};
use syntable_model::registry::{Entry, Registry, Slot};

#[derive(Args)]
pub(super) struct ListArgs {
    /// A slot such as `place` or `write`, `products` or `formats`; everything if left out.
    what: Option<String>,
}

pub(super) fn list(console: &Console, registry: &Registry, args: &ListArgs) -> std::result::Result<(), Exit> {
    let what = args.what.as_deref();
    if what == Some("products") {
        return console.print(&products_table(registry));
    }
    if what == Some("formats") {
        return console.print(&formats_table().map_err(Exit::wrong)?);
    }
    let slots: Vec<Slot> = Slot::ALL.into_iter().filter(|slot| what.is_none_or(|what| what == slot.name())).collect();
    if slots.is_empty() {
        let names = Slot::ALL.map(Slot::name).join(", ");
        let error = Error::new(format!("there is nothing to list under `{}`", what.unwrap_or_default()));
        return Err(Exit::wrong(error.help(format!("write products, formats, {names}"))));
    }
    let mut rows = vec![["slot", "kind", "crate", "version", "what it does"].map(str::to_owned)];
    for entry in slots.into_iter().flat_map(|slot| registry.of_slot(slot)) {
        rows.push(
            [entry.slot.name(), entry.kind, entry.crate_name, entry.crate_version, &summary(entry)].map(str::to_owned),
        );
    }
    let mut out = table(&rows);
    if what.is_none() {
        out.push('\n');
        out += &products_table(registry);
        out.push('\n');
        out += &formats_table().map_err(Exit::wrong)?;
    }
    console.print(&out)
}

/// First sentence of a kind's description.
pub fn summary(entry: &Entry) -> String {
    let schema = entry.schema(&mut schemars::generate::SchemaSettings::draft07().into_generator());
    first_sentence(schema.get("description").and_then(|text| text.as_str()).unwrap_or_default())
}

/// All products of the linked plugins with their default options, and who makes them.
pub fn products(registry: &Registry) -> Vec<(KeyId, String)> {
    available(registry).into_iter().map(|(key, providers)| (key, providers.join(", "))).collect()
}

fn products_table(registry: &Registry) -> String {
    let mut rows = vec![["product", "kind of value", "per", "provider", "meaning"].map(str::to_owned)];
    for (key, provider) in products(registry) {
        rows.push([key.name.to_string(), key.kind_of_value(), key.scope.to_string(), provider, key.summary()]);
    }
    table(&rows)
}

/// The file formats that the linked plugins read.
fn formats_table() -> Result<String> {
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
    Ok(table(&rows))
}
