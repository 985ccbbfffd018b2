//! The pools of a recipe: selection, scale, centering and mass are the same for every source of assets.
//!
//! `open` opens pools, numbers their objects and selects from their catalogs; `numbers` keeps the numbers of several
//! pools distinct; `asset` applies the options of a pool to an asset; `loaded` keeps assets in memory; `listing` lists
//! the probability of drawing each asset.

mod asset;
mod listing;
mod loaded;
mod numbers;
mod open;
mod open_pool;

use crate::run::panics::{caught, unwound};
pub use listing::{Chance, ListedAsset};
use loaded::InUse;
pub use loaded::Loaded;
use numbers::{number_places, numbers_differ};
pub(crate) use open::open;
use open::patiently;
use open_pool::OpenPool;
use parking_lot::Mutex;
use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::context::{Assets, Collected, Log, Steps};
use syntable_model::error::{Error, Result};
use syntable_model::registry::Slot;
use syntable_model::scene::{Asset, AssetRef, CatalogEntry, Object};
use syntable_prepare::{AssetCache, RayMesh};
use syntable_recipe::{CatalogNames, Component, OnBadAsset, PartSizes, Recipe};

/// Mark in a lock and a journal, instead of a digest, for an asset that was drawn but skipped as unusable.
pub const BAD: &str = "bad";

/// All pools of a recipe, with the assets loaded from them.
pub struct AssetStore<'a> {
    pools: BTreeMap<&'a str, OpenPool<'a>>,
    /// Components of the recipe, whose options draw from pools.
    components: Vec<&'a Component>,
    /// Digests of assets that the dataset or the recipe depends on, or [`BAD`].
    locked: BTreeMap<String, String>,
    on_bad_asset: OnBadAsset,
    log: &'a dyn Log,
    loaded: Arc<Loaded>,
    refused: Mutex<Option<Error>>,
    /// Trees of objects, for rays against scenes.
    trees: AssetCache<RayMesh>,
}

/// Bytes of the trees that no scene uses.
const TREE_BYTES: u64 = 128 << 20;

impl<'a> AssetStore<'a> {
    /// A store of open pools with no locked digests and no loaded assets.
    fn new(pools: BTreeMap<&'a str, OpenPool<'a>>, on_bad_asset: OnBadAsset, log: &'a dyn Log) -> Self {
        Self {
            pools,
            components: Vec::new(),
            locked: BTreeMap::new(),
            on_bad_asset,
            log,
            loaded: Arc::default(),
            refused: Mutex::default(),
            trees: AssetCache::new(TREE_BYTES),
        }
    }

    /// Opens all pools: finds and selects their entries, but loads no assets. The error names all pools that cannot be
    /// opened, or the first that failed with a transient error.
    pub fn open(recipe: &'a Recipe, log: &'a dyn Log) -> Result<Self> {
        let mut pools = open(&recipe.assets, log)?;
        let own = recipe.own_objects();
        let labeled = recipe.labeled_pools();
        number_places(&mut pools, &labeled, &own)?;
        if recipe.write.iter().any(|(_, writer)| writer.needs_obj_ids()) {
            numbers_differ(&pools, &labeled, &own)?;
            for (_, pool) in pools.iter().filter(|(id, pool)| labeled.contains(**id) && pool.resizes_numbered) {
                let message = "objects keep the numbers of their files at another size: models and poses differ from the benchmark";
                let help = "leave out `scale` and `units`, or give the pool other numbers with `first_id`";
                log.warn(&Error::new(message).help(help).context(pool.table));
            }
        }
        let store = Self::new(pools, recipe.dataset.on_bad_asset, log);
        let components = recipe.components.all().collect();
        Ok(Self { components, locked: recipe.lock.assets.clone(), ..store })
    }

    /// Opens all pools, and lets each step of `[[place]]` find its mistakes ([`Placer::ready`](syntable_model::stage::Placer::ready)).
    ///
    /// # Errors
    /// If a pool cannot be opened, or with the first mistake of a step, which names its table.
    pub fn open_for_run(recipe: &'a Recipe, log: &'a dyn Log) -> Result<Self> {
        let store = Self::open(recipe, log)?;
        for (_, component) in recipe.components.weights().filter(|(weight, _)| *weight > 0.0) {
            let assets = RecordingAssets::new(&store, &component.pools);
            for (id, placers) in &component.place {
                let table = component.table(&Slot::Place.stage_name(id));
                placers.all().try_for_each(|placer| caught(&table, || placer.ready(&assets, log)))?;
            }
        }
        Ok(store)
    }

    /// The same store with these assets, which were loaded earlier from the same pools.
    pub fn with(self, loaded: Arc<Loaded>) -> Self {
        Self { loaded, ..self }
    }

    /// Names of the pools, with the number of entries of each.
    pub fn sizes(&self) -> impl Iterator<Item = (&str, usize)> {
        self.pools.iter().map(|(&id, pool)| (id, pool.selection.entries.len()))
    }

    /// Sizes of the parts of a pool's split; none without a split.
    pub fn part_sizes(&self, id: &str) -> Option<PartSizes> {
        let pool = self.pools.get(id)?;
        pool.options.part_sizes(&pool.selection)
    }

    /// Adds the assets of existing scenes, which must be unchanged.
    pub fn expect(mut self, assets: impl IntoIterator<Item = (String, String)>) -> Self {
        self.locked.extend(assets);
        self
    }

    /// Names of the assets of each pool, with their categories and numbers.
    pub fn catalogs(&self) -> BTreeMap<String, CatalogNames> {
        self.pools.iter().map(|(&id, pool)| (id.to_owned(), pool.catalog())).collect()
    }

    /// The tree of an object, for rays against a scene.
    pub fn tree(&self, object: &Object) -> Arc<RayMesh> {
        self.trees.get(object.digest, || RayMesh::new(&object.mesh), RayMesh::size)
    }

    /// An error if an asset must stop the run: a bad asset that the recipe does not tolerate, an asset that is
    /// temporarily unreadable, or an asset that has changed since the recipe was resolved.
    pub fn refused(&self) -> Result<()> {
        self.refused.lock().clone().map_or(Ok(()), Err)
    }

    fn refuse(&self, error: Error) {
        self.refused.lock().get_or_insert(error);
    }

    fn pool(&self, id: &str) -> Result<&OpenPool<'a>> {
        self.pools.get(id).ok_or_else(|| {
            let known: Vec<&str> = self.pools.keys().copied().collect();
            Error::new(format!("unknown pool `{id}`")).help(format!("the recipe has: {}", known.join(", ")))
        })
    }

    /// Loads an asset. A bad asset is reported once and never loaded again.
    fn load_or_refuse(&self, asset: &AssetRef) -> Result<Asset> {
        if let Some(error) = self.loaded.bad.lock().get(asset) {
            return Err(error.clone());
        }
        self.load(asset).map_err(|error| {
            let error = error.context(format!("asset {asset}"));
            if error.is_transient() {
                // A transient error does not make the asset bad. Skipping it would produce a different dataset.
                self.refuse(error.clone());
                return error;
            }
            self.log.warn(&error);
            self.loaded.bad.lock().insert(asset.clone(), error.clone());
            if self.on_bad_asset == OnBadAsset::Fail {
                self.refuse(error.clone());
            }
            error
        })
    }

    fn load(&self, asset: &AssetRef) -> Result<Asset> {
        let pool = self.pool(&asset.pool)?;
        let log = Named { asset, log: self.log };
        // An asset whose reader panics is bad: it is reported, and skipped from then on.
        // An asset that is loaded again after it was dropped does not repeat its warnings.
        let first = !self.loaded.told.lock().contains(asset);
        let quiet = Collected::default();
        let log: &dyn Log = if first { &log } else { &quiet };
        let loaded = patiently(log, |log| {
            unwound(|| pool.load(&asset.name, log)).inspect(|loaded| pool.doubt_size(loaded, log))
        });
        if !loaded.as_ref().is_err_and(Error::is_transient) {
            self.loaded.told.lock().insert(asset.clone());
        }
        let locked = self.locked.get(&asset.to_string());
        let (was, is) = match (locked, &loaded) {
            (None, _) => return loaded,
            (_, Err(error)) if error.is_transient() => return loaded,
            (Some(locked), Err(_)) if locked == BAD => return loaded,
            (Some(locked), Err(error)) => (format!("had digest {locked}"), format!("cannot be used: {error}")),
            (Some(locked), Ok(asset)) => {
                let digest = asset.digest().to_string();
                match locked.as_str() {
                    locked if locked == digest => return loaded,
                    BAD => ("could not be used".to_owned(), format!("has digest {digest}")),
                    locked => (format!("had digest {locked}"), format!("has digest {digest}")),
                }
            }
        };
        let error = Error::new(format!("asset {asset} has changed: when the dataset was begun it {was}, now it {is}"))
            .help("restore the asset, or make a new dataset: choose another folder with `options.out`, and take the asset out of [lock.assets] if the recipe has that");
        self.refuse(error.clone());
        Err(error)
    }
}

impl Assets for AssetStore<'_> {
    fn entries(&self, pool: &str) -> Result<&[CatalogEntry]> {
        self.pool(pool).map(|pool| pool.selection.entries.as_slice())
    }

    fn get(&self, asset: &AssetRef) -> Result<Asset> {
        self.loaded.kept.get_or_insert_with(asset, || {
            // An asset that is too large to keep may still be in use.
            if let Some(asset) = self.loaded.in_use.lock().get(asset).and_then(InUse::get) {
                return Ok(asset);
            }
            let loaded = self.load_or_refuse(asset)?;
            self.loaded.in_use.lock().insert(asset.clone(), InUse::of(&loaded));
            Ok(loaded)
        })
    }
}

/// The assets of one attempt at a scene. Records the digests of the drawn assets, and names the asset that is being
/// loaded.
pub struct RecordingAssets<'a> {
    store: &'a AssetStore<'a>,
    /// Names of the pools of the scene's component in the recipe.
    pools: &'a BTreeMap<String, String>,
    digests: Mutex<BTreeMap<String, String>>,
    steps: Steps,
    /// Number of assets that the present stage has loaded, and the number that it has announced.
    progress: Mutex<[usize; 2]>,
}

impl<'a> RecordingAssets<'a> {
    /// Starts without drawn assets. `pools` has the names of pools in the recipe by their names in options.
    pub fn new(store: &'a AssetStore<'a>, pools: &'a BTreeMap<String, String>) -> Self {
        Self { store, pools, digests: Mutex::default(), steps: Steps::default(), progress: Mutex::default() }
    }

    /// Runs a stage that may load assets, and shows their names to a user who waits.
    pub fn during<T>(&self, log: &dyn Log, stage: impl FnOnce() -> T) -> T {
        *self.progress.lock() = [0, 0];
        let (mut stage, mut result) = (Some(stage), None);
        log.during(&self.steps, &mut || result = stage.take().map(|stage| stage()));
        result.expect("a log calls the work once")
    }

    /// Names the asset that is being loaded, with its number among those that the stage has announced.
    fn begin(&self, asset: &AssetRef) {
        let mut progress = self.progress.lock();
        progress[0] += 1;
        let [number, all] = *progress;
        let of = if all > 0 { format!(" ({} of {all})", number.min(all)) } else { String::new() };
        self.steps.begin(format!("loading `{asset}`{of}"));
    }

    /// Digests of all drawn assets, by `pool/name`.
    pub fn into_digests(self) -> BTreeMap<String, String> {
        self.digests.into_inner()
    }
}

impl Assets for RecordingAssets<'_> {
    fn entries(&self, pool: &str) -> Result<&[CatalogEntry]> {
        self.store.entries(self.pool_name(pool))
    }

    fn pool_name<'p>(&'p self, pool: &'p str) -> &'p str {
        self.pools.get(pool).map_or(pool, String::as_str)
    }

    fn get(&self, asset: &AssetRef) -> Result<Asset> {
        self.begin(asset);
        let loaded = self.store.get(asset);
        self.steps.end();
        let digest = loaded.as_ref().map_or_else(|_| BAD.to_owned(), |loaded| loaded.digest().to_string());
        self.digests.lock().insert(asset.to_string(), digest);
        loaded
    }

    fn expect(&self, count: usize) {
        *self.progress.lock() = [0, count];
    }
}

/// A log that names the asset.
struct Named<'a> {
    asset: &'a AssetRef,
    log: &'a dyn Log,
}

impl Log for Named<'_> {
    fn warn(&self, warning: &Error) {
        self.log.warn(&warning.clone().context(format!("asset {}", self.asset)));
    }
}

#[cfg(test)]
mod tests;
