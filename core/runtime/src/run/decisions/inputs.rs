//! Compares the inputs of a dataset with their locked state: pools, and files that options name.

use crate::run::dataset::folder::catalog_path;
use crate::run::dataset::foreign::read_list;
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::stage::{DeviceClass, RenderDevice};
use syntable_model::store::StoreFolder;
use syntable_model::words::some_names;
use syntable_recipe::{CatalogAsset, CatalogLock, CatalogNames as Names, Component, Lock, Recipe, pool_table};

/// The devices of the renderers of the components that pass a test.
pub fn devices_of(recipe: &Recipe, is_meant: impl Fn(&Component) -> bool) -> Result<Vec<RenderDevice>> {
    let mut all: Vec<RenderDevice> = Vec::new();
    for component in recipe.components.all().filter(|component| is_meant(component)) {
        for device in component.render.devices()? {
            if !all.iter().any(|other| other.name == device.name) {
                all.push(device);
            }
        }
    }
    Ok(all)
}

fn renders(component: &Component) -> bool {
    !component.plan.rendered.is_empty()
}

/// The devices that would render a recipe, if other devices may round differently.
pub fn devices(recipe: &Recipe) -> Result<BTreeSet<String>> {
    let devices = devices_of(recipe, renders)?.into_iter();
    Ok(devices.filter(|device| device.class.rounds()).map(|device| device.name).collect())
}

/// A message if a program emulates the graphics card.
pub fn emulated(recipe: &Recipe) -> Result<Option<String>> {
    let program = devices_of(recipe, renders)?.into_iter().find(|device| device.class == DeviceClass::Emulated);
    Ok(program.map(|device| format!("no graphics card: {} emulates one, which is slower than `cpu_path`", device.name)))
}

/// Warns if the devices differ from those that rendered the existing scenes.
pub fn tell_of_devices(then: [&BTreeSet<String>; 2], now: &BTreeSet<String>, log: &dyn Log) {
    let list = |names: &BTreeSet<String>| names.iter().cloned().collect::<Vec<_>>().join(", ");
    if let Some(then) = then.into_iter().find(|then| !then.is_empty() && !now.is_empty() && !now.is_subset(then)) {
        log.warn(
            &Error::new(format!("other devices render now: {} before, {} now", list(then), list(now)))
                .help("images may differ by rounding; `cpu_path` gives the same bytes on every machine"),
        );
    }
}

/// Contents of pools.
pub fn catalogs(names: &BTreeMap<String, Names>) -> BTreeMap<String, CatalogLock> {
    names.iter().map(|(pool, names)| (pool.clone(), CatalogLock::of(names))).collect()
}

/// Refuses inputs that differ from a lock, and lists the additions, removals and changes. `home` is the folder of the
/// lock's dataset, which may store the names of the pools' assets; `catalogs` are the current names.
pub fn unchanged(
    then: &Lock,
    now: &Lock,
    catalogs: &BTreeMap<String, Names>,
    home: Option<&StoreFolder>,
) -> Result<()> {
    let refuse = |message: String| {
        Err(Error::new(message)
            .help("new scenes would differ from existing ones: restore the input, or make a new dataset with `options.out`, from a recipe without that entry of [lock]"))
    };
    for (pool, was) in &then.catalogs {
        let Some(is) = now.catalogs.get(pool).filter(|is| *is != was) else { continue };
        let what = match home.and_then(|home| names(home, pool, was)) {
            Some(before) => changes(&before, &catalogs[pool]),
            None => {
                format!("{} assets before, {} now, or different names, categories or numbers", was.assets, is.assets)
            }
        };
        return refuse(format!("the pool `{}` has changed since the dataset began: {what}", pool_table(pool)));
    }
    for (option, was) in &then.files {
        if now.files.get(option).is_some_and(|is| is != was) {
            return refuse(format!(
                "the file or folder of `{option}` has changed since the dataset began, or a file that it names"
            ));
        }
    }
    Ok(())
}

/// The difference between a pool's contents in two datasets, if both store them.
pub fn difference(pool: &str, [one, other]: [(&StoreFolder, &Lock); 2]) -> Option<String> {
    let of = |(home, lock): (&StoreFolder, &Lock)| names(home, pool, lock.catalogs.get(pool)?);
    Some(changes(&of(one)?, &of(other)?)).filter(|changes| !changes.is_empty())
}

/// The names that a dataset stores for a pool, if they match the lock.
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
        format!("such as `{name}`, which was {} and is now {}{taken}", number(before, name), number(now, name))
    });
    let parts = [
        list("added", added),
        list("removed", removed),
        list("with another category", other_categories),
        list("with another number", other_numbers).zip(first).map(|(all, first)| format!("{all}, {first}")),
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
        assert!(error.contains("`assets.p`") && error.contains("3 assets before, 3 now"), "{error}");
        let path = catalog_path(&home, "p").expect("a name");
        home.write(&path, serde_json::to_string(&before).expect("plain data").as_bytes()).expect("writable");
        let error = compare(&lock(&before, "1"), Some(&home)).expect_err("other names").to_string();
        assert!(error.contains("added `d`; removed `a`; with another category `b`"), "{error}");
    }
}
