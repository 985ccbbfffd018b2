//! Numbers of objects that a recipe states: `ids` and `first_id` of a pool.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::num::NonZeroU32;
use syntable_model::error::{Error, Result};
use syntable_model::files::read_small;
use syntable_model::names::AssetPath;

/// Numbers of the objects of a pool by name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum ObjectIds {
    /// In the recipe.
    Table(BTreeMap<String, NonZeroU32>),
    /// In a file.
    File(#[schemars(extend("x-syntable-ref" = "file"))] AssetPath),
}

/// A number in a file of numbers.
#[derive(Deserialize)]
#[serde(untagged)]
enum Entry {
    Number(NonZeroU32),
    /// As `.syntable/catalogs/<pool>.json` of a dataset has it.
    Asset {
        obj_id: NonZeroU32,
    },
}

impl ObjectIds {
    /// The numbers by name. Reads the file.
    pub(crate) fn read(&self) -> Result<BTreeMap<String, u32>> {
        let file = match self {
            Self::Table(table) => return Ok(table.iter().map(|(name, id)| (name.clone(), id.get())).collect()),
            Self::File(file) => file.path(),
        };
        let help = "write one number from 1 per name: \"024_bowl\" = 24 in a TOML file, or {\"024_bowl\": 24} in a JSON file; \
                    .syntable/catalogs/<pool>.json of a dataset is such a file";
        let wrong = |message: String| Error::new(message).in_file(file).help(help);
        let bytes = read_small(file).map_err(|error| Error::io(file, &error))?;
        let text = std::str::from_utf8(&bytes).map_err(|error| {
            wrong("the table of numbers is not UTF-8 text".into()).at_byte(error.valid_up_to() as u64)
        })?;
        let text = text.trim_start_matches('\u{feff}');
        let is_json = file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"));
        // Names first, so that an error names the object with the wrong number.
        let read = |name: &String, number: Option<Entry>, found: &dyn std::fmt::Display| match number {
            Some(Entry::Number(id) | Entry::Asset { obj_id: id }) => Ok(id.get()),
            None => Err(wrong(format!("`{name}` has no number from 1 to {}, but {found}", u32::MAX))),
        };
        if is_json {
            let table: BTreeMap<String, serde_json::Value> =
                serde_json::from_str(text).map_err(|error| wrong(error.to_string()).at_line(error.line().max(1)))?;
            let entry = |(name, value): (String, serde_json::Value)| {
                Ok((name.clone(), read(&name, Entry::deserialize(&value).ok(), &value)?))
            };
            table.into_iter().map(entry).collect()
        } else {
            let table: BTreeMap<String, toml::Value> = toml::from_str(text).map_err(|error| {
                let line = error.span().map_or(1, |span| text[..span.start].matches('\n').count() + 1);
                wrong(error.message().to_owned()).at_line(line)
            })?;
            let entry = |(name, value): (String, toml::Value)| {
                Ok((name.clone(), read(&name, Entry::deserialize(value.clone()).ok(), &value)?))
            };
            table.into_iter().map(entry).collect()
        }
    }

    /// Adds the file to an error, if the numbers come from a file.
    pub(crate) fn in_file(&self, error: Error) -> Error {
        match self {
            Self::Table(_) => error,
            Self::File(file) => error.in_file(file.path()),
        }
    }
}
