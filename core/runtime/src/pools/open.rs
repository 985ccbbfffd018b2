//! Opens pools: reads, numbers and selects from catalogs, without loading assets.

use super::open_pool::OpenPool;
use std::collections::BTreeMap;
use std::time::Duration;
use syntable_model::context::{Collected, Log};
use syntable_model::error::{Error, Result};
use syntable_model::scene::{AssetClass, CatalogEntry};
use syntable_model::stage::AssetSource;
use syntable_recipe::{Numbering, PoolOptions, Selection};

/// Pauses before a source is called again after a file-system error.
const RETRIES: [Duration; 3] = [Duration::from_millis(20), Duration::from_millis(150), Duration::from_millis(600)];

/// Opens pools. The error names all pools that cannot be opened, or the first that failed with a transient error.
pub(crate) fn open<'a>(
    assets: &'a BTreeMap<String, syntable_recipe::Pool>,
    log: &dyn Log,
) -> Result<BTreeMap<&'a str, OpenPool<'a>>> {
    let mut pools = BTreeMap::new();
    let mut errors = Vec::new();
    for (id, pool) in assets {
        match OpenPool::open(pool, log) {
            Ok(pool) => drop(pools.insert(id.as_str(), pool)),
            Err(error) => errors.push(error.context(&pool.table)),
        }
    }
    if let Some(failed) = errors.iter().position(Error::is_transient) {
        return Err(errors.remove(failed));
    }
    match errors.len() {
        0 => {}
        1 => return Err(errors.remove(0).of_request()),
        count => {
            let all: Vec<String> = errors.iter().map(Error::without_help).collect();
            let error = Error::new(format!("{count} pools cannot be opened: {}", all.join("; ")));
            let help = errors.iter().find_map(Error::help_text).unwrap_or("check their folders").to_owned();
            return Err(error.help(help).of_request());
        }
    }
    Ok(pools)
}

/// The assets of a source with their numbers, before any selection, so that all parts of a split give an object the
/// same number.
struct Numbered {
    entries: Vec<CatalogEntry>,
    numbering: Option<Numbering>,
    last_obj_id: u32,
    resizes_numbered: bool,
}

impl<'a> OpenPool<'a> {
    /// Opens a pool.
    fn open(pool: &'a syntable_recipe::Pool, log: &dyn Log) -> Result<Self> {
        let syntable_recipe::Pool { source, options, table, .. } = pool;
        let (source, of_pool) = (&**source, OfPool { table, log });
        let catalog = catalog_of(source, log)?;
        let found = catalog.len();
        let properties = options.properties(&catalog, &of_pool)?;
        options.warn_of_unmatched(&catalog, &of_pool)?;
        let Numbered { entries, numbering, last_obj_id, resizes_numbered } =
            Numbered::of(catalog, source, options, &of_pool)?;
        let selection = select(entries, options, &of_pool)?;
        if selection.entries.is_empty() {
            let hint = if found == 0 { "check its root folder" } else { "check include, exclude and split" };
            return Err(Error::new(format!("no assets: {found} found, none selected")).help(hint));
        }
        warn_of_classes(&selection, options, table, log);
        Ok(Self { table, source, options, selection, numbering, last_obj_id, resizes_numbered, properties })
    }
}

/// All assets of a source, in the guaranteed order.
fn catalog_of(source: &dyn AssetSource, log: &dyn Log) -> Result<Vec<CatalogEntry>> {
    let catalog = patiently(log, |log| source.catalog(log))?;
    check_order(&catalog.entries)?;
    Ok(catalog.entries)
}

impl Numbered {
    fn of(
        mut entries: Vec<CatalogEntry>,
        source: &dyn AssetSource,
        options: &PoolOptions,
        log: &dyn Log,
    ) -> Result<Self> {
        let has_own = entries.iter().any(|entry| entry.obj_id.is_some());
        let keeps_own = options.ids.is_none() && options.first_id.is_none() && has_own;
        let resizes_numbered = keeps_own && (options.scale.is_size() || options.factor(1.0) != 1.0);
        let has_objects = source.class() == AssetClass::Object;
        let numbering = has_objects.then(|| options.number(&mut entries, log)).transpose()?;
        let last_obj_id = entries.iter().filter_map(|entry| entry.obj_id).max().unwrap_or_default();
        Ok(Self { entries, numbering, last_obj_id, resizes_numbered })
    }
}

/// The assets that the options of a pool select. With `ids`, each has a number.
fn select(entries: Vec<CatalogEntry>, options: &PoolOptions, log: &dyn Log) -> Result<Selection> {
    let selection = options.select(entries, log)?;
    if options.ids.is_some() {
        options.all_numbered(&selection.entries)?;
    }
    Ok(selection)
}

/// Warns if no asset of a pool has any of the configured classes.
fn warn_of_classes(selection: &Selection, options: &PoolOptions, table: &str, log: &dyn Log) {
    let is_of_class = |entry: &CatalogEntry| options.classes.contains_key(&entry.category);
    if options.classes.is_empty() || selection.entries.iter().any(is_of_class) {
        return;
    }
    let message = format!("{table}: no asset is of one of the classes");
    log.warn(&Error::new(message).help("patterns match whole names: `*mug*` matches all that contain `mug`"));
}

/// Refuses a catalog that breaks the contract of sources: entries in ascending order of unique names. Scenes draw
/// entries by index, and looking up the name must find the drawn entry.
fn check_order(entries: &[CatalogEntry]) -> Result<()> {
    let Some(pair) = entries.windows(2).find(|pair| pair[0].name >= pair[1].name) else { return Ok(()) };
    let [one, other] = [&pair[0].name, &pair[1].name];
    let message = match one == other {
        true => format!("the source lists `{one}` twice"),
        false => format!("the source lists `{one}` before `{other}`, out of order"),
    };
    Err(Error::new(message).help("this is a bug of the plugin that has this kind: a catalog is sorted by unique names"))
}

/// Calls a source again, after a pause, if it failed with a file-system error. Warnings of failed calls are dropped.
pub(super) fn patiently<T>(log: &dyn Log, call: impl Fn(&dyn Log) -> Result<T>) -> Result<T> {
    let mut pauses = RETRIES.iter();
    loop {
        let said = Collected::default();
        let result = call(&said);
        if let Err(error) = &result
            && error.is_transient()
            && let Some(&pause) = pauses.next()
        {
            std::thread::sleep(pause);
            continue;
        }
        said.merged().iter().for_each(|warning| log.warn(warning));
        return result;
    }
}

/// A log that adds the table of the pool to warnings.
struct OfPool<'a> {
    table: &'a str,
    log: &'a dyn Log,
}

impl Log for OfPool<'_> {
    fn warn(&self, warning: &Error) {
        self.log.warn(&warning.clone().context(self.table));
    }
}
