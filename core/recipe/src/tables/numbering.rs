//! The numbers of the objects of a pool.

use crate::tables::asset_names::names_of;
use crate::tables::pool::PoolOptions;
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::scene::CatalogEntry;
use syntable_model::words::some_names;

/// Where the numbers of a pool come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Numbering {
    /// They are stated, by the recipe or by the source.
    Stated,
    /// They are places in the catalog, from 1, after the numbers of other pools.
    Places,
}

impl PoolOptions {
    /// Numbers all objects of a source, whether the pool takes them or not. If `ids` names some of them, the others
    /// keep the number that the source states, or have none. Warns of names that the source does not have.
    pub fn number(&self, entries: &mut [CatalogEntry], log: &dyn Log) -> Result<Numbering> {
        if let Some(first) = self.first_id {
            let last = first.checked_add(entries.len().saturating_sub(1) as u32);
            if last.is_none() || entries.len() > u32::MAX as usize {
                return Err(Error::new(format!(
                    "first_id: {first} and {} assets go beyond {}",
                    entries.len(),
                    u32::MAX
                ))
                .help("choose a smaller first_id"));
            }
            entries.iter_mut().zip(first..).for_each(|(entry, id)| entry.obj_id = Some(id));
            return Ok(Numbering::Stated);
        }
        if let Some(ids) = &self.ids {
            let table = ids.read().map_err(|error| error.context("ids"))?;
            let mut names: BTreeMap<u32, &str> = BTreeMap::new();
            for (name, id) in &table {
                if let Some(other) = names.insert(*id, name) {
                    let message = format!("ids: `{other}` and `{name}` have the same number {id}");
                    return Err(ids.in_file(Error::new(message)).help("give each object a number of its own"));
                }
            }
            let known: BTreeSet<&str> = entries.iter().map(|entry| entry.name.as_str()).collect();
            let unknown: Vec<&str> = table.keys().map(String::as_str).filter(|name| !known.contains(name)).collect();
            if !unknown.is_empty() {
                let message = format!("ids: the pool has no asset of these names: {}", some_names(&unknown));
                log.warn(&ids.in_file(Error::new(message)).help(names_of(entries)));
            }
            for entry in entries.iter_mut() {
                entry.obj_id = table.get(&entry.name).copied().or(entry.obj_id);
            }
            return Ok(Numbering::Stated);
        }
        if entries.iter().any(|entry| entry.obj_id.is_some()) {
            return Ok(Numbering::Stated);
        }
        entries.iter_mut().zip(1..).for_each(|(entry, id)| entry.obj_id = Some(id));
        Ok(Numbering::Places)
    }

    /// Refuses objects of the pool that neither `ids` nor the source numbers.
    pub fn all_numbered(&self, entries: &[CatalogEntry]) -> Result<()> {
        let without = entries.iter().filter(|entry| entry.obj_id.is_none()).map(|entry| entry.name.as_str());
        let without: Vec<&str> = without.collect();
        if without.is_empty() {
            return Ok(());
        }
        let error = match &self.ids {
            Some(ids) => ids.in_file(Error::new(format!("ids: no number for {}", some_names(&without)))),
            None => Error::new(format!("the source states no number of {}, but of others", some_names(&without))),
        };
        Err(error
            .help("add them to `ids`, leave them out with `exclude`, or number the whole pool with `first_id = 1`"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tables::ids::ObjectIds;
    use std::num::NonZeroU32;
    use syntable_model::context::Collected;
    use syntable_model::names::AssetPath;

    fn entries(stated: &[(&str, Option<u32>)]) -> Vec<CatalogEntry> {
        stated.iter().map(|(name, obj_id)| CatalogEntry { obj_id: *obj_id, ..CatalogEntry::new(*name, "") }).collect()
    }

    fn numbers(options: &PoolOptions, stated: &[(&str, Option<u32>)]) -> Result<Vec<Option<u32>>> {
        let mut entries = entries(stated);
        options.number(&mut entries, &Collected::default())?;
        options.all_numbered(&entries)?;
        Ok(entries.into_iter().map(|entry| entry.obj_id).collect())
    }

    fn table(ids: &[(&str, u32)]) -> ObjectIds {
        let number = |id: u32| NonZeroU32::new(id).expect("from 1");
        ObjectIds::Table(ids.iter().map(|(name, id)| ((*name).to_owned(), number(*id))).collect())
    }

    #[test]
    fn what_is_stated_goes_before_places() {
        let plain = [("can", None), ("mug", None), ("pan", None)];
        let bop = [("can", Some(7)), ("mug", Some(2)), ("pan", Some(9))];
        let own = |ids: &[(&str, u32)]| PoolOptions { ids: Some(table(ids)), ..PoolOptions::default() };
        let first = PoolOptions { first_id: Some(100), ..PoolOptions::default() };
        let all = |ids: [u32; 3]| ids.map(Some).to_vec();
        assert_eq!(numbers(&PoolOptions::default(), &plain).expect("places"), all([1, 2, 3]));
        assert_eq!(numbers(&PoolOptions::default(), &bop).expect("those of the source"), all([7, 2, 9]));
        assert_eq!(numbers(&first, &plain).expect("from 100"), all([100, 101, 102]));
        assert_eq!(numbers(&first, &bop).expect("from 100"), all([100, 101, 102]));
        assert_eq!(numbers(&own(&[("can", 5), ("mug", 3), ("pan", 4)]), &plain).expect("stated"), all([5, 3, 4]));
        assert_eq!(numbers(&own(&[("mug", 3)]), &bop).expect("some of the source"), all([7, 3, 9]));
        let error = numbers(&own(&[("mug", 3)]), &plain).expect_err("two have none").to_string();
        assert!(error.starts_with("ids: no number for `can`, `pan`"), "{error}");
        let error = numbers(&own(&[("mug", 3), ("pan", 3)]), &plain).expect_err("equal").to_string();
        assert!(error.starts_with("ids: `mug` and `pan` have the same number 3"), "{error}");
        let error = numbers(&PoolOptions { first_id: Some(u32::MAX - 1), ..PoolOptions::default() }, &plain);
        assert!(error.expect_err("too large").to_string().contains("go beyond 4294967295"));
    }

    #[test]
    fn files_of_numbers_are_toml_json_or_a_catalog() {
        let folder = tempfile::tempdir().expect("a folder");
        let read = |name: &str, text: &str| {
            let file = folder.path().join(name);
            std::fs::write(&file, text).expect("written");
            let options = PoolOptions { ids: Some(ObjectIds::File(AssetPath(file))), ..PoolOptions::default() };
            numbers(&options, &[("a b", None), ("c", None)]).map_err(|error| error.to_string())
        };
        let both = Ok(vec![Some(4), Some(9)]);
        assert_eq!(read("ids.toml", "\u{feff}\"a b\" = 4\nc = 9\n"), both);
        assert_eq!(read("ids.json", r#"{"c": 9, "a b": 4}"#), both);
        assert_eq!(read("p.json", r#"{"a b":{"category":"x","obj_id":4},"c":{"category":"y","obj_id":9}}"#), both);
        for (name, text, wanted) in [
            ("ids.toml", "c = 0", "`c` has no number from 1 to 4294967295, but 0"),
            ("ids.toml", "c = 1\nc = 2", "ids.toml:2"),
            ("ids.json", r#"{"c": "9"}"#, "`c` has no number from 1 to 4294967295, but \"9\""),
            ("ids.json", r#"{"c": 5000000000}"#, "5000000000"),
            ("ids.json", "{\n\"c\": }", "ids.json:2"),
            ("ids.json", r#"{"c": 1, "a b": 1}"#, "`a b` and `c` have the same number 1"),
        ] {
            let error = read(name, text).expect_err(text);
            assert!(error.contains(wanted) && error.contains("ids"), "{text}: {error}");
        }
    }
}
