//! Names of assets in a recipe: patterns, lists in files, and messages about names that no asset has.

use glob::Pattern;
use std::collections::BTreeSet;
use syntable_model::context::Log;
use syntable_model::error::{ConfigError, Error, Result};
use syntable_model::files::read_small;
use syntable_model::names::AssetPath;
use syntable_model::scene::CatalogEntry;
use syntable_model::words::some_of;

/// Warns of names of a list that no asset has.
pub(crate) fn warn_of_unknown(
    key: &str,
    list: &AssetPath,
    listed: &BTreeSet<String>,
    known: &BTreeSet<&str>,
    names: &[&str],
    log: &dyn Log,
) {
    let unknown: Vec<&str> = listed.iter().map(String::as_str).filter(|name| !known.contains(name)).collect();
    if unknown.is_empty() {
        return;
    }
    let message = format!("{key}: the pool has no asset of these names: {}", some_of(unknown));
    log.warn(&Error::new(message).in_file(list.path()).help(look_of(names.to_vec())));
}

/// Help on the names of a source's assets: their number and some examples.
pub(crate) fn names_of(entries: &[CatalogEntry]) -> String {
    look_of(entries.iter().map(|entry| entry.name.as_str()).collect())
}

/// Help on names: their number and some examples.
fn look_of(mut names: Vec<&str>) -> String {
    names.sort_unstable();
    let first: Vec<String> = names.iter().take(3).map(|name| format!("`{name}`")).collect();
    format!(
        "it has {} names, such as {}; .syntable/catalogs/<pool>.json of a dataset lists all names",
        names.len(),
        first.join(", ")
    )
}

/// A refused value as an error.
pub(crate) fn of_key(invalid: ConfigError) -> Error {
    Error::new(format!("{}: {}", invalid.key, invalid.message))
}

/// The class whose patterns match a name.
pub(crate) fn class_of<'c>(classes: &[(&'c str, Vec<Pattern>)], name: &str) -> Result<Option<&'c str>> {
    let mut of = classes.iter().flat_map(|(class, patterns)| patterns.iter().map(move |pattern| (*class, pattern)));
    let mut of = of.by_ref().filter(|(_, pattern)| pattern.matches(name));
    let Some((class, pattern)) = of.next() else { return Ok(None) };
    match of.find(|(other, _)| *other != class) {
        None => Ok(Some(class)),
        Some((other, other_pattern)) => Err(Error::new(format!(
            "`{name}` is of two classes: `{pattern}` of `{class}` and `{other_pattern}` of `{other}` match it"
        ))
        .help("narrow one of the patterns under `classes`")),
    }
}

/// The names in a text file, one per line; `#` starts a comment.
pub(crate) fn names_of_list(list: &AssetPath) -> Result<BTreeSet<String>> {
    let bytes = read_small(list.path()).map_err(|error| Error::io(list.path(), &error))?;
    let text = String::from_utf8(bytes).map_err(|error| {
        Error::new("the list of names is not UTF-8 text")
            .in_file(list.path())
            .at_byte(error.utf8_error().valid_up_to() as u64)
    })?;
    let names = text.trim_start_matches('\u{feff}').lines().map(|line| line.split('#').next().unwrap_or("").trim());
    Ok(names.filter(|name| !name.is_empty()).map(str::to_owned).collect())
}

/// Compiles patterns of names. A pattern matches a whole name; `*` and `?` match `/`, too.
pub(crate) fn patterns(option: &str, patterns: &[String]) -> std::result::Result<Vec<Pattern>, ConfigError> {
    let compile = |(index, pattern): (usize, &String)| {
        // `**` would have a meaning for folders.
        let mut plain = pattern.clone();
        while plain.contains("**") {
            plain = plain.replace("**", "*");
        }
        Pattern::new(&plain).map_err(|error| {
            ConfigError::new(format!("{option}[{index}]"), format!("\"{pattern}\" is not a pattern: {}", error.msg))
                .help("`*` matches any characters, `?` one, `[ab]` one of several; `[*]` matches a `*`")
        })
    };
    patterns.iter().enumerate().map(compile).collect()
}
