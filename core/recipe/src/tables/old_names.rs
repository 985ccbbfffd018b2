//! Gives options with old names their new ones, so that an old name hides no other mistake of a recipe.

use crate::tables::references::recipe_at_mut;
use crate::text::key_path;
use crate::text::source::Span;
use syntable_toml_schema::Step;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Moves the value of an option to its new name. The value of a name that is given already stays.
pub(crate) fn rename(table: &mut DeTable, old: &[Step], new: &str) {
    let new = key_path::steps(new);
    let (Some((Step::Key(from), above)), Some((Step::Key(to), below))) = (old.split_last(), new.split_last()) else {
        return;
    };
    if recipe_at_mut(table, &new).is_some() {
        return;
    }
    let Some((key, value)) = inside(table, above, None).and_then(|table| table.remove_entry(from.as_str())) else {
        return;
    };
    if let Some(table) = inside(table, below, Some(&key.span())) {
        table.insert(Spanned::new(key.span(), to.clone().into()), value);
    }
}

/// The table at a path. Missing tables are made if bytes are given for them.
fn inside<'t, 'a>(table: &'t mut DeTable<'a>, path: &[Step], made_at: Option<&Span>) -> Option<&'t mut DeTable<'a>> {
    path.iter().try_fold(table, |table, step| {
        let Step::Key(key) = step else { return None };
        if !table.contains_key(key.as_str()) {
            let span = made_at?.clone();
            let made = Spanned::new(span.clone(), DeValue::Table(DeTable::new()));
            table.insert(Spanned::new(span, key.clone().into()), made);
        }
        match table.get_mut(key.as_str())?.get_mut() {
            DeValue::Table(inner) => Some(inner),
            _ => None,
        }
    })
}
