//! Numbers of objects over all pools of a recipe.

use super::open_pool::OpenPool;
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::error::{Error, Result};
use syntable_model::scene::CatalogEntry;
use syntable_recipe::{Numbering, Selection};

/// Raises position-based numbers above all stated numbers and above the numbers of earlier pools. Pools with labeled
/// objects come first, then the others, each group sorted by id. Numbers depend on the content of pools, never on the
/// selected or drawn assets. `own` are the objects that placers have themselves.
pub(super) fn number_places(
    pools: &mut BTreeMap<&str, OpenPool>,
    labeled: &BTreeSet<String>,
    own: &[(&str, CatalogEntry)],
) -> Result<()> {
    let is = |pool: &OpenPool, numbering| pool.numbering == Some(numbering);
    let stated = pools.values().filter(|pool| is(pool, Numbering::Stated)).map(|pool| pool.last_obj_id);
    let mut last = stated.chain(own.iter().filter_map(|(_, entry)| entry.obj_id)).max().unwrap_or_default();
    for described in [true, false] {
        let those = pools.iter_mut().filter(|(id, _)| labeled.contains(**id) == described);
        for (_, pool) in those.filter(|(_, pool)| is(pool, Numbering::Places)) {
            let Some(beyond) = last.checked_add(pool.last_obj_id) else {
                return Err(Error::new(format!("objects behind number {last} go beyond {}", u32::MAX))
                    .help("state smaller numbers with `ids` or `first_id`")
                    .context(pool.table));
            };
            let Selection { entries, other_parts } = &mut pool.selection;
            let all = entries.iter_mut().chain(other_parts.iter_mut().map(|(entry, _)| entry));
            all.filter_map(|entry| entry.obj_id.as_mut()).for_each(|obj_id| *obj_id += last);
            last = beyond;
        }
    }
    Ok(())
}

/// Refuses objects without a number, and two objects with the same number, among the pools of labeled objects and the
/// objects that placers have themselves.
pub(super) fn numbers_differ(
    pools: &BTreeMap<&str, OpenPool>,
    labeled: &BTreeSet<String>,
    own: &[(&str, CatalogEntry)],
) -> Result<()> {
    let described = || pools.iter().filter(|(id, _)| labeled.contains(**id));
    for (_, pool) in described() {
        let numbered = pool.options.all_numbered(&pool.selection.entries);
        numbered.map_err(|error| error.context(pool.table).of_request())?;
    }
    let objects = described().flat_map(|(id, pool)| pool.selection.entries.iter().map(move |entry| (*id, entry)));
    let mut seen: BTreeMap<u32, (&str, &str)> = BTreeMap::new();
    for (id, entry) in objects {
        let Some(obj_id) = entry.obj_id else { continue };
        let Some((other, name)) = seen.insert(obj_id, (id, &entry.name)) else { continue };
        let message = format!("`{other}/{name}` and `{id}/{}` have the same `obj_id` {obj_id}", entry.name);
        let table = pools[id].table;
        let last = pools.values().map(|pool| pool.last_obj_id).max().unwrap_or_default();
        let help = match other == id {
            true => format!(
                "number the whole pool again with `first_id = 1`, give its objects `ids`, or take one source of numbers per pool: \
                 `exclude = [\"{}\"]` leaves one out",
                entry.name
            ),
            false => format!(
                "give one of the pools other numbers, such as `first_id = {}` in [{table}], or give its objects `ids`",
                u64::from(last) + 1
            ),
        };
        return Err(Error::new(message).help(help).context(table));
    }
    for (step, entry) in own {
        let of_step =
            |message: String, help: String| Err(Error::new(message).help(help).context(format!("place.{step}")));
        let name = &entry.name;
        let Some(obj_id) = entry.obj_id else {
            return of_step(
                format!("`{name}` has no `obj_id`, and a writer needs the numbers of all objects"),
                "give the step an `obj_id`".to_owned(),
            );
        };
        // The same object can be placed several times.
        match seen.insert(obj_id, (step, name)) {
            Some((other, its)) if its != name => {
                let message = format!("`{other}/{its}` and `{name}` have the same `obj_id` {obj_id}");
                return of_step(message, "give the step another `obj_id`".to_owned());
            }
            _ => {}
        }
    }
    Ok(())
}
