//! `syntable list`.

use super::{Console, Exit};
use crate::plan::table;
use clap::Args;
use std::collections::BTreeMap;
use syntable_model::product::{KeyId, Scope};
use syntable_model::registry::{Entry, Registry, Slot};

#[derive(Args)]
pub(super) struct ListArgs {
    /// A slot such as `place` or `write`, or `products`; everything if left out.
    what: Option<String>,
}

pub(super) fn list(console: &Console, registry: &Registry, args: &ListArgs) -> Result<(), Exit> {
    let what = args.what.as_deref();
    if what == Some("products") {
        return console.print(&products_table(registry));
    }
    let slots: Vec<Slot> = Slot::ALL.into_iter().filter(|slot| what.is_none_or(|what| what == slot.name())).collect();
    if slots.is_empty() {
        let names = Slot::ALL.map(Slot::name).join(", ");
        return Err(Exit::wrong(format!("nothing to list under `{}`; write products, {names}", what.unwrap_or(""))));
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
    }
    console.print(&out)
}

/// First sentence of a kind's description.
pub fn summary(entry: &Entry) -> String {
    let schema = entry.schema(&mut schemars::generate::SchemaSettings::draft07().into_generator());
    let text = schema.get("description").and_then(|text| text.as_str()).unwrap_or_default().replace('\n', " ");
    text.split_once(". ").map_or(text.trim_end_matches('.'), |(first, _)| first).to_owned()
}

/// All products of the linked plugins with their default options, and who makes them.
pub fn products(registry: &Registry) -> Vec<(KeyId, String)> {
    let mut products = BTreeMap::new();
    for entry in registry.entries() {
        let Ok(constructed) = entry.construct_str("") else { continue };
        for key in constructed.stage.provides() {
            let (_, providers): &mut (KeyId, Vec<String>) =
                products.entry(key.name).or_insert_with(|| (key, Vec::new()));
            providers.push(format!("{}.{}", entry.slot, entry.kind));
        }
    }
    products.into_values().map(|(key, providers)| (key, providers.join(", "))).collect()
}

fn products_table(registry: &Registry) -> String {
    let mut rows = vec![["product", "type", "per", "provider", "meaning"].map(str::to_owned)];
    for (key, provider) in products(registry) {
        let per = if key.scope == Scope::Scene { "scene" } else { "view" };
        rows.push([key.name.to_owned(), key.type_name(), per.to_owned(), provider, key.doc.to_owned()]);
    }
    table(&rows)
}
