//! The resolved recipe: every default filled in, nothing inherited, and the versions that made it.

use crate::tables::alternatives::{MIXTURE, WEIGHT};
use crate::tables::dataset::{CatalogLock, Lock, LockTable};
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::registry::{Shape, Slot};
use toml_edit::{ArrayOfTables, DocumentMut, InlineTable, Item, Table, Value};

/// One stage of a resolved recipe.
pub(crate) struct ResolvedStage {
    pub slot: Slot,
    pub id: String,
    /// None for a stage with alternatives, whose kinds are in the options.
    pub kind: Option<&'static str>,
    pub options: toml::Table,
    /// Names and versions of the crates that registered its kinds.
    pub plugins: Vec<(&'static str, &'static str)>,
}

/// A component of a resolved recipe, with the writers of the recipe.
pub(crate) struct ResolvedComponent {
    /// Its name in the mixture; empty in a recipe that is no mixture.
    pub id: String,
    pub weight: f64,
    pub stages: Vec<ResolvedStage>,
}

/// Writes a resolved recipe: component by component, slot by slot, keyed stages by id.
pub(crate) fn write(dataset: &toml::Table, components: &[ResolvedComponent], inputs: &Lock) -> String {
    let version = env!("CARGO_PKG_VERSION");
    let mut document = DocumentMut::new();
    let is_mixture = components.iter().any(|component| !component.id.is_empty());
    if !is_mixture {
        components.iter().for_each(|component| empty_lists(&mut document, &component.stages));
    }
    document.insert("dataset", Item::Table(table(dataset)));
    if is_mixture {
        for ResolvedComponent { id, weight, stages } in components {
            let mut component = Table::new();
            component.insert(WEIGHT, Item::Value(float(*weight)));
            empty_lists(&mut component, stages);
            sections(&mut component, stages.iter().filter(|stage| stage.slot != Slot::Write));
            parent(&mut document, MIXTURE).insert(id, Item::Table(component));
        }
        let shared = components.iter().take(1).flat_map(|component| &component.stages);
        sections(&mut document, shared.filter(|stage| stage.slot == Slot::Write));
    } else {
        components.iter().for_each(|component| sections(&mut document, component.stages.iter()));
    }
    let stages = components.iter().flat_map(|component| &component.stages);
    let plugins: BTreeMap<&str, &str> = stages.flat_map(|stage| stage.plugins.iter().copied()).collect();
    let mut lock = Table::new();
    lock.insert("syntable", version.into());
    lock.insert("plugins", Item::Table(strings(plugins)));
    document.insert("lock", Item::Table(lock));
    insert_lock(&mut document, inputs);
    let comment = format!(
        "# Resolved by syntable {version}: every default is filled in. Running this file again gives the same dataset.\n\n"
    );
    comment + document.to_string().trim_start()
}

/// Adds the lists without stages. A missing list has a default; an empty one has none.
fn empty_lists(tables: &mut Table, stages: &[ResolvedStage]) {
    for slot in Slot::ALL {
        if slot.shape() == Shape::List && !stages.iter().any(|stage| stage.slot == slot) {
            tables.insert(slot.name(), Item::Value(Value::Array(Default::default())));
        }
    }
}

/// Adds the tables of some stages.
fn sections<'s>(tables: &mut Table, stages: impl Iterator<Item = &'s ResolvedStage>) {
    let mut ordered: Vec<&ResolvedStage> = stages.collect();
    ordered.sort_by_key(|stage| (stage.slot, (stage.slot.shape() == Shape::Keyed).then_some(&stage.id)));
    for stage in ordered {
        let name = stage.slot.name();
        let mut options = Table::new();
        if stage.slot.shape() == Shape::List {
            options.insert("id", stage.id.as_str().into());
        }
        if let Some(kind) = stage.kind {
            options.insert("kind", kind.into());
        }
        fill(&mut options, &stage.options);
        match stage.slot.shape() {
            Shape::One => {
                tables.insert(name, Item::Table(options));
            }
            Shape::List => {
                let list = tables.entry(name).or_insert_with(|| Item::ArrayOfTables(ArrayOfTables::new()));
                list.as_array_of_tables_mut().into_iter().for_each(|list| list.push(options.clone()));
            }
            _ => {
                parent(tables, name).insert(&stage.id, Item::Table(options));
            }
        }
    }
}

/// Returns a resolved recipe with its inputs locked. Assets that it already locks stay, unless their digests are
/// replaced. If `lock` has devices, catalogs or files, they replace the existing ones. A text that is not TOML is
/// returned unchanged.
pub fn with_lock(resolved: &str, lock: &Lock) -> String {
    match resolved.parse::<DocumentMut>() {
        Ok(mut document) => {
            insert_lock(&mut document, lock);
            document.to_string()
        }
        Err(_) => resolved.to_owned(),
    }
}

/// Returns a resolved recipe with the devices that rendered its dataset, and no others. A text that is not TOML is
/// returned unchanged.
pub fn with_devices(resolved: &str, devices: &BTreeSet<String>) -> String {
    let Ok(mut document) = resolved.parse::<DocumentMut>() else { return resolved.to_owned() };
    if let Some(lock) = document.get_mut("lock").and_then(Item::as_table_mut) {
        lock.remove("devices");
    }
    insert_lock(&mut document, &Lock { devices: devices.clone(), ..Lock::default() });
    document.to_string()
}

/// Returns a resolved recipe without the lock of its inputs; versions stay. A text that is not TOML is returned
/// unchanged.
pub fn without_lock(resolved: &str) -> String {
    match resolved.parse::<DocumentMut>() {
        Ok(mut document) => {
            if let Some(lock) = document.get_mut("lock").and_then(Item::as_table_mut) {
                for inputs in ["devices", "catalogs", "files", "assets"] {
                    lock.remove(inputs);
                }
                if lock.is_empty() && lock.is_implicit() {
                    document.remove("lock");
                }
            }
            document.to_string()
        }
        Err(_) => resolved.to_owned(),
    }
}

/// Returns a resolved recipe without the digests of the assets that were drawn, which a run adds at its end.
pub fn without_assets(resolved: &str) -> String {
    let Ok(mut document) = resolved.parse::<DocumentMut>() else { return resolved.to_owned() };
    if let Some(lock) = document.get_mut("lock").and_then(Item::as_table_mut) {
        lock.remove("assets");
    }
    document.to_string()
}

/// The inputs that a resolved recipe locks; none if the text is not a resolved recipe.
pub fn lock_of(resolved: &str) -> Lock {
    let table = toml::from_str::<toml::Table>(resolved).ok();
    let lock = table.and_then(|mut table| table.remove("lock")?.try_into::<LockTable>().ok());
    lock.unwrap_or_default().into()
}

fn insert_lock(document: &mut DocumentMut, new: &Lock) {
    if *new == Lock::default() {
        return;
    }
    let lock = parent(document, "lock");
    if !new.devices.is_empty() {
        lock.remove("devices");
        let names = new.devices.iter().map(String::as_str);
        lock.insert("devices", Item::Value(Value::Array(names.collect())));
    }
    let old = lock.remove("assets");
    if !new.catalogs.is_empty() {
        let mut catalogs = Table::new();
        for (pool, CatalogLock { assets, digest }) in &new.catalogs {
            let mut catalog = InlineTable::new();
            catalog.insert("assets", (*assets as i64).into());
            catalog.insert("digest", digest.as_str().into());
            catalogs.insert(pool, Item::Value(Value::InlineTable(catalog)));
        }
        lock.remove("catalogs");
        lock.insert("catalogs", Item::Table(catalogs));
    }
    if !new.catalogs.is_empty() || !new.files.is_empty() {
        lock.remove("files");
    }
    if !new.files.is_empty() {
        let files = strings(new.files.iter().map(|(option, digest)| (option.as_str(), digest.as_str())));
        lock.insert("files", Item::Table(files));
    }
    let old = old.as_ref().and_then(Item::as_table);
    let mut all: BTreeMap<&str, &str> =
        old.into_iter().flat_map(Table::iter).filter_map(|(asset, digest)| Some((asset, digest.as_str()?))).collect();
    all.extend(new.assets.iter().map(|(asset, digest)| (asset.as_str(), digest.as_str())));
    if !all.is_empty() {
        // Last, because assets are added while the dataset is made.
        lock.insert("assets", Item::Table(strings(all)));
    }
}

/// The table of a name, created without a header of its own if it is missing.
fn parent<'t>(tables: &'t mut Table, name: &str) -> &'t mut Table {
    let item = tables.entry(name).or_insert_with(|| {
        let mut table = Table::new();
        table.set_implicit(true);
        Item::Table(table)
    });
    if !item.is_table() {
        *item = Item::Table(Table::new());
    }
    item.as_table_mut().expect("it is a table")
}

fn strings<'s>(pairs: impl IntoIterator<Item = (&'s str, &'s str)>) -> Table {
    let mut table = Table::new();
    for (key, value) in pairs {
        table.insert(key, value.into());
    }
    table
}

fn table(options: &toml::Table) -> Table {
    let mut table = Table::new();
    fill(&mut table, options);
    table
}

fn fill(table: &mut Table, options: &toml::Table) {
    for (name, option) in options {
        table.insert(name, Item::Value(inline(option)));
    }
}

/// A value without headers: nested tables are inline.
fn inline(value: &toml::Value) -> Value {
    match value {
        toml::Value::String(text) => text.into(),
        toml::Value::Integer(number) => (*number).into(),
        toml::Value::Float(number) => float(*number),
        toml::Value::Boolean(value) => (*value).into(),
        toml::Value::Datetime(datetime) => (*datetime).into(),
        toml::Value::Array(items) => Value::Array(items.iter().map(inline).collect()),
        toml::Value::Table(table) => Value::InlineTable(
            table.iter().map(|(name, value)| (name.as_str(), inline(value))).collect::<InlineTable>(),
        ),
    }
}

/// A number with an exponent where it would have many digits. It reads back as the same bits.
fn float(number: f64) -> Value {
    let with_exponent = number.is_finite() && number != 0.0 && !(1e-4..1e16).contains(&number.abs());
    with_exponent.then(|| format!("{number:e}").parse().ok()).flatten().unwrap_or_else(|| number.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_read_back() {
        for text in [
            r#"a = "x\"y'\\z\n\u0001""#,
            "a = [1e-9, 1e300, -0.0, 0.1, 15.0, 123456.789, inf]",
            r#"a = { "b c" = [{ d = 1 }, {}], e = true }"#,
            "a = 1979-05-27T07:32:00Z",
            "a = '''\nx\r\n\ty'''",
            "a = [{ b = \"x\\ny\" }]",
        ] {
            let options: toml::Table = toml::from_str(text).expect("valid");
            let mut document = DocumentMut::new();
            document.insert("t", Item::Table(table(&options)));
            let written = document.to_string();
            let read: toml::Table = toml::from_str(&written).unwrap_or_else(|error| panic!("{written}\n{error}"));
            assert_eq!(read["t"], toml::Value::Table(options), "{written}");
        }
        assert_eq!(inline(&toml::Value::from(1e-9)).to_string(), "1e-9");
        assert_eq!(inline(&toml::Value::from(1e300)).to_string(), "1e300");
    }

    #[test]
    fn inputs_are_locked_kept_and_removed() {
        let map = |pairs: &[(&str, &str)]| -> BTreeMap<String, String> {
            pairs.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect()
        };
        let assets = |pairs: &[(&str, &str)]| Lock { assets: map(pairs), ..Lock::default() };
        for start in ["[dataset]\n", "[dataset]\n\n[lock]\nsyntable = \"1\"\n\n[lock.plugins]\na = \"2\"\n"] {
            let one = with_lock(start, &assets(&[("p/b", "22")]));
            assert_eq!(one, format!("{start}\n[lock.assets]\n\"p/b\" = \"22\"\n"));
            let two = with_lock(&one, &assets(&[("p/a", "11")]));
            assert_eq!(two, format!("{start}\n[lock.assets]\n\"p/a\" = \"11\"\n\"p/b\" = \"22\"\n"));
            assert_eq!(with_lock(&two, &assets(&[])), two);
            assert_eq!(without_lock(&two), start);
            assert_eq!(without_lock(start), start);
            // Catalogs and files come before the assets, whichever was locked first, and are replaced.
            let catalog = CatalogLock { assets: 2, digest: "33".into() };
            let inputs = Lock {
                catalogs: BTreeMap::from([("p".to_owned(), catalog)]),
                files: map(&[("write.x.template.file", "44")]),
                ..Lock::default()
            };
            let want = format!(
                "{start}\n[lock.catalogs]\np = {{ assets = 2, digest = \"33\" }}\n\n[lock.files]\n\"write.x.template.file\" = \"44\"\n\n[lock.assets]\n\"p/b\" = \"22\"\n"
            );
            assert_eq!(with_lock(&one, &inputs), want);
            assert_eq!(with_lock(&with_lock(&with_lock(start, &inputs), &inputs), &assets(&[("p/b", "22")])), want);
            assert_eq!(without_lock(&want), start);
            assert_eq!(lock_of(&want), Lock { assets: map(&[("p/b", "22")]), ..inputs });
        }
        assert_eq!(without_lock("a = ["), "a = [");
    }

    #[test]
    fn devices_are_those_that_rendered() {
        let devices = |names: &[&str]| -> BTreeSet<String> { names.iter().map(|name| (*name).to_owned()).collect() };
        let start = "[dataset]\n\n[lock]\nsyntable = \"1\"\n\n[lock.plugins]\na = \"2\"\n";
        let one = with_devices(start, &devices(&["b", "a"]));
        assert_eq!(one, start.replace("\"1\"\n", "\"1\"\ndevices = [\"a\", \"b\"]\n"));
        assert_eq!(lock_of(&one).devices, devices(&["a", "b"]));
        assert_eq!(with_lock(&one, &Lock { assets: BTreeMap::new(), ..Lock::default() }), one);
        assert_eq!(lock_of(&with_devices(&one, &devices(&["c"]))).devices, devices(&["c"]));
        for text in [with_devices(&one, &devices(&[])), without_lock(&one), with_devices(start, &devices(&[]))] {
            assert_eq!(text, start);
        }
    }
}
