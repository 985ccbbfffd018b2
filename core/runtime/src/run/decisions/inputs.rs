//! The inputs of a dataset, compared with what they were: pools, and files that options name.

use crate::run::dataset::folder::catalog_path;
use crate::run::dataset::foreign::read_list;
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::some::some_names;
use syntable_model::stage::DeviceClass;
use syntable_model::store::StoreFolder;
use syntable_recipe::{CatalogAsset, CatalogLock, CatalogNames as Names, Lock, Recipe};

/// The devices that render what a recipe wants, if others may round otherwise.
pub fn devices(recipe: &Recipe) -> Result<BTreeSet<String>> {
    if recipe.plan.rendered.is_empty() {
        return Ok(BTreeSet::new());
    }
    let devices = recipe.render.devices()?.into_iter();
    Ok(devices.filter(|device| device.class.rounds()).map(|device| device.name).collect())
}

/// Says that a program renders in place of a card, if so.
pub fn emulated(recipe: &Recipe) -> Result<Option<String>> {
    if recipe.plan.rendered.is_empty() {
        return Ok(None);
    }
    let program = recipe.render.devices()?.into_iter().find(|device| device.class == DeviceClass::Emulated);
    Ok(program
        .map(|device| format!("there is no graphics card: {} renders, which is slower than `cpu_path`", device.name)))
}

/// Warns if scenes are to be rendered on other devices than those of then.
pub fn tell_of_devices(then: [&BTreeSet<String>; 2], now: &BTreeSet<String>, log: &dyn Log) {
    let list = |names: &BTreeSet<String>| names.iter().cloned().collect::<Vec<_>>().join(", ");
    if let Some(then) = then.into_iter().find(|then| !then.is_empty() && !now.is_empty() && !now.is_subset(then)) {
        log.warn(
            &Error::new(format!("the dataset was begun on {}, and goes on on {}", list(then), list(now)))
                .help("images may differ by rounding; `cpu_path` gives the same bytes on every machine"),
        );
    }
}

/// What pools offer.
pub fn catalogs(names: &BTreeMap<String, Names>) -> BTreeMap<String, CatalogLock> {
    names.iter().map(|(pool, names)| (pool.clone(), CatalogLock::of(names))).collect()
}

/// Refuses inputs that are not those of a lock, with what was added, removed or changed. `home` is the folder of the
/// dataset whose lock it is, where the names of its pools' assets may be; `catalogs` are the names now.
pub fn unchanged(
    then: &Lock,
    now: &Lock,
    catalogs: &BTreeMap<String, Names>,
    home: Option<&StoreFolder>,
) -> Result<()> {
    let refuse = |message: String| {
        Err(Error::new(message)
            .help("scenes would differ from those of then: restore it, or make a new dataset with --out, from a recipe without that entry of [lock]"))
    };
    for (pool, was) in &then.catalogs {
        let Some(is) = now.catalogs.get(pool).filter(|is| *is != was) else { continue };
        let what = match home.and_then(|home| names(home, pool, was)) {
            Some(before) => changes(&before, &catalogs[pool]),
            None => format!("{} assets then, {} now, or other names, categories or numbers", was.assets, is.assets),
        };
        return refuse(format!("the pool `assets.{pool}` is not what it was when the dataset was begun: {what}"));
    }
    for (option, was) in &then.files {
        if now.files.get(option).is_some_and(|is| is != was) {
            return refuse(format!("the file of `{option}` is not what it was when the dataset was begun"));
        }
    }
    Ok(())
}

/// What a pool offered otherwise when another dataset was begun, if both datasets store what it offered.
pub fn difference(pool: &str, [one, other]: [(&StoreFolder, &Lock); 2]) -> Option<String> {
    let of = |(home, lock): (&StoreFolder, &Lock)| names(home, pool, lock.catalogs.get(pool)?);
    Some(changes(&of(one)?, &of(other)?)).filter(|changes| !changes.is_empty())
}

/// The names that a dataset stores of a pool, if they are those of the lock.
fn names(home: &StoreFolder, pool: &str, lock: &CatalogLock) -> Option<Names> {
    let text = read_list(home, &catalog_path(home, pool).ok()?).ok()??;
    let names: Names = serde_json::from_slice(&text).ok()?;
    (CatalogLock::of(&names) == *lock).then_some(names)
}

fn changes(before: &Names, now: &Names) -> String {
    let list = |what: &str, names: Vec<&str>| (!names.is_empty()).then(|| format!("{what} {}", some_names(names)));
    let added = now.keys().filter(|name| !before.contains_key(*name)).map(String::as_str).collect();
    let removed = before.keys().filter(|name| !now.contains_key(*name)).map(String::as_str).collect();
    let moved = |differs: fn(&CatalogAsset, &CatalogAsset) -> bool| {
        let in_both = now.iter().filter_map(|(name, is)| Some((name.as_str(), before.get(name)?, is)));
        in_both.filter(|(_, was, is)| differs(was, is)).map(|(name, ..)| name).collect()
    };
    let other_categories = moved(|was, is| was.category != is.category);
    let other_numbers: Vec<&str> = moved(|was, is| was.obj_id != is.obj_id);
    let number = |names: &Names, name: &str| {
        let obj_id = names.get(name).and_then(|asset| asset.obj_id);
        obj_id.map_or_else(|| "none".to_owned(), |id| id.to_string())
    };
    let first = other_numbers.first().map(|name| {
        let was = before.get(*name).and_then(|asset| asset.obj_id);
        let taken = now.iter().find(|(_, asset)| was.is_some() && asset.obj_id == was);
        let taken = taken.map_or_else(String::new, |(other, _)| format!("; {} is `{other}` now", number(before, name)));
        format!("such as `{name}`, which was {} and is {}{taken}", number(before, name), number(now, name))
    });
    let parts = [
        list("added", added),
        list("removed", removed),
        list("of another category", other_categories),
        list("of another number", other_numbers).zip(first).map(|(all, first)| format!("{all}, {first}")),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_differs_is_named() {
        let home = StoreFolder::from(std::sync::Arc::new(syntable_model::store::MemStore::default()));
        let names = |pairs: &[(&str, &str)]| -> Names {
            let asset = |category: &str| CatalogAsset { category: category.to_owned(), obj_id: None };
            pairs.iter().map(|(name, category)| ((*name).to_owned(), asset(category))).collect()
        };
        let (before, now) =
            (names(&[("a", "x"), ("b", "x"), ("c", "x")]), names(&[("b", "y"), ("c", "x"), ("d", "x")]));
        let lock = |names: &Names, file: &str| Lock {
            catalogs: BTreeMap::from([("p".to_owned(), CatalogLock::of(names))]),
            files: BTreeMap::from([("write.t.template.file".to_owned(), file.to_owned())]),
            ..Lock::default()
        };
        let compare = |then: &Lock, home: Option<&StoreFolder>| {
            unchanged(then, &lock(&now, "1"), &BTreeMap::from([("p".to_owned(), now.clone())]), home)
        };
        compare(&lock(&now, "1"), None).expect("the same");
        compare(&Lock::default(), None).expect("nothing is locked");
        let error = compare(&lock(&now, "2"), None).expect_err("another file").to_string();
        assert!(error.contains("`write.t.template.file`"), "{error}");
        let error = compare(&lock(&before, "1"), Some(&home)).expect_err("other names").to_string();
        assert!(error.contains("`assets.p`") && error.contains("3 assets then, 3 now"), "{error}");
        let path = catalog_path(&home, "p").expect("a name");
        home.write(&path, serde_json::to_string(&before).expect("plain data").as_bytes()).expect("writable");
        let error = compare(&lock(&before, "1"), Some(&home)).expect_err("other names").to_string();
        assert!(error.contains("added `d`; removed `a`; of another category `b`"), "{error}");
    }
}
