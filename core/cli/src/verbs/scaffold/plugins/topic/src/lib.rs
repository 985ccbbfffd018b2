//! Topic `linked_crates`: the table of `syntable list linked_crates`.

use std::collections::BTreeMap;
use syntable_cli::Topic;
use syntable_model::error::{Error, Result};
use syntable_model::registry::Registry;

syntable_cli::register_topic!(Topic { name: "linked_crates", rows });

/// Headings, then one row for each crate that registers kinds of stages: name, version, kinds.
///
/// # Errors
/// If two crates register one kind.
pub fn rows() -> Result<Vec<[String; 3]>> {
    let registry = Registry::linked().map_err(Error::new)?;
    let mut crates: BTreeMap<_, Vec<&str>> = BTreeMap::new();
    for entry in registry.entries() {
        crates.entry((entry.crate_name, entry.crate_version)).or_default().push(entry.kind);
    }
    let headings = ["crate", "version", "kinds"].map(str::to_owned);
    let rows = crates.into_iter().map(|((name, version), kinds)| [name.into(), version.into(), kinds.join(", ")]);
    Ok(std::iter::once(headings).chain(rows).collect())
}
