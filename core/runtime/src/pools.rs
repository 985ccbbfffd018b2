//! The pools of a recipe: selection, scale, centering and mass are the same for every source of assets.

use crate::recipe::{
    self, CatalogAsset, CatalogNames, Center, Mass, Numbering, ObjectProperties, OnBadAsset, Part, PartSizes,
    PoolOptions, Recipe, Selection,
};
use crate::run::panics::unwound;
use parking_lot::Mutex;
use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Weak};
use std::time::Duration;
use syntable_mesh::mass::estimate_kg;
use syntable_mesh::size::doubt;
use syntable_model::context::{Assets, Collected, Log};
use syntable_model::digest::Hasher;
use syntable_model::error::{Error, Result};
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::scene::{
    Asset, AssetClass, AssetRef, CatalogEntry, EnvironmentMap, MassOrigin, Material, Object, Topology,
};
use syntable_model::stage::AssetSource;

/// Bytes of loaded assets that are kept for the next scene; the least recently used are let go first.
const KEEP_BYTES: u64 = 256 << 20;

/// What a lock and a journal say instead of a digest of an asset that was drawn, could not be used and was passed over.
pub const BAD: &str = "bad";

/// Minimum mass of an object, kg.
const MIN_KG: f64 = 1e-4;

/// Pauses before a source that the file system failed is asked again.
const RETRIES: [Duration; 3] = [Duration::from_millis(20), Duration::from_millis(150), Duration::from_millis(600)];

/// All pools of a recipe, with what was loaded from them.
pub struct AssetStore<'a> {
    pools: BTreeMap<&'a str, Pool<'a>>,
    /// Digests of assets that the dataset or the recipe depends on, or [`BAD`].
    locked: BTreeMap<String, String>,
    on_bad_asset: OnBadAsset,
    log: &'a dyn Log,
    loaded: Arc<Loaded>,
    refused: Mutex<Option<Error>>,
}

/// What was loaded from pools: for the next scene, and for the next recipe that has the same pools.
pub struct Loaded {
    kept: Cache<AssetRef, Asset, ByBytes>,
    /// What was loaded, for as long as a scene has it.
    in_use: Mutex<BTreeMap<AssetRef, InUse>>,
    /// Assets whose warnings were told.
    told: Mutex<BTreeSet<AssetRef>>,
    bad: Mutex<BTreeMap<AssetRef, Error>>,
}

impl Default for Loaded {
    fn default() -> Self {
        Self::within(KEEP_BYTES)
    }
}

impl Loaded {
    /// Nothing loaded yet. Assets that no scene uses take at most as many bytes.
    fn within(bytes: u64) -> Self {
        Self { kept: cache(bytes), in_use: Mutex::default(), told: Mutex::default(), bad: Mutex::default() }
    }

    /// Forgets the assets of all pools but some, and which assets were bad: they may be mended.
    pub fn keep(&self, is_same: impl Fn(&str) -> bool) {
        self.kept.retain(|asset, _| is_same(&asset.pool));
        self.in_use.lock().retain(|asset, _| is_same(&asset.pool));
        self.told.lock().retain(|asset| is_same(&asset.pool));
        self.bad.lock().clear();
    }
}

/// A log that says which pool a warning is about.
struct OfPool<'a> {
    id: &'a str,
    log: &'a dyn Log,
}

impl Log for OfPool<'_> {
    fn warn(&self, warning: &Error) {
        self.log.warn(&warning.clone().context(format!("assets.{}", self.id)));
    }
}

/// An asset of a pool, as its catalog knows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ListedAsset {
    /// Pool and name.
    pub asset: AssetRef,
    /// Class of the pool's assets.
    pub class: AssetClass,
    /// Category.
    pub category: String,
    /// Number of an object in every dataset of the recipe; none of materials and environment maps.
    pub obj_id: Option<u32>,
    /// The part that the asset belongs to; none if the pool has no split.
    pub part: Option<Part>,
    /// License as the pool or its source states it; none if neither does.
    pub license: Option<String>,
    /// Whether it is of the part that the recipe draws from.
    pub is_drawn: bool,
}

pub(crate) struct Pool<'a> {
    source: &'a dyn AssetSource,
    options: &'a PoolOptions,
    selection: Selection,
    /// Where the numbers of its objects come from; none if it has no objects.
    numbering: Option<Numbering>,
    /// Largest number of an object of the source, taken or not.
    last_obj_id: u32,
    /// Whether objects have the numbers of their files, and another size than these.
    resizes_numbered: bool,
    /// What the pool's table states of its objects, by name.
    properties: BTreeMap<String, ObjectProperties>,
}

/// Weighs cached assets by the memory that they take.
#[derive(Clone)]
struct ByBytes;

impl Weighter<AssetRef, Asset> for ByBytes {
    fn weight(&self, _: &AssetRef, asset: &Asset) -> u64 {
        bytes(asset) as u64
    }
}

/// A cache in one piece: of several, each would keep small assets only, and fewer the more processors there are.
fn cache(bytes: u64) -> Cache<AssetRef, Asset, ByBytes> {
    let options = OptionsBuilder::new().estimated_items_capacity(1024).weight_capacity(bytes).shards(1).build();
    match options {
        Ok(options) => {
            Cache::with_options(options, ByBytes, DefaultHashBuilder::default(), DefaultLifecycle::default())
        }
        Err(_) => Cache::with_weighter(1024, bytes, ByBytes),
    }
}

/// An asset that others may still hold.
enum InUse {
    Object(Weak<Object>),
    Material(Weak<Material>),
    Environment(Weak<EnvironmentMap>),
    Gone,
}

impl InUse {
    fn of(asset: &Asset) -> Self {
        match asset {
            Asset::Object(object) => Self::Object(Arc::downgrade(object)),
            Asset::Material(material) => Self::Material(Arc::downgrade(material)),
            Asset::Environment(map) => Self::Environment(Arc::downgrade(map)),
            _ => Self::Gone,
        }
    }

    fn get(&self) -> Option<Asset> {
        match self {
            Self::Object(object) => object.upgrade().map(Asset::Object),
            Self::Material(material) => material.upgrade().map(Asset::Material),
            Self::Environment(map) => map.upgrade().map(Asset::Environment),
            Self::Gone => None,
        }
    }
}

impl<'a> AssetStore<'a> {
    /// A store of open pools that depends on no digest and has loaded nothing.
    fn new(pools: BTreeMap<&'a str, Pool<'a>>, on_bad_asset: OnBadAsset, log: &'a dyn Log) -> Self {
        Self { pools, locked: BTreeMap::new(), on_bad_asset, log, loaded: Arc::default(), refused: Mutex::default() }
    }

    /// Opens all pools: finds and selects their entries, and loads nothing yet.
    /// The error names all pools that cannot be opened.
    pub fn open(recipe: &'a Recipe, log: &'a dyn Log) -> Result<Self> {
        let mut pools = open(&recipe.assets, log)?;
        number_places(&mut pools, &recipe.labeled_pools)?;
        if recipe.write.iter().any(|(_, writer)| writer.needs_obj_ids()) {
            numbers_differ(&pools, &recipe.labeled_pools)?;
            for (id, _) in
                pools.iter().filter(|(id, pool)| recipe.labeled_pools.contains(**id) && pool.resizes_numbered)
            {
                let message = "objects keep the numbers of their files at another size: models and poses are not those of the benchmark";
                let help = "leave out `scale` and `units`, or number the pool anew with `first_id`";
                log.warn(&Error::new(message).help(help).context(format!("assets.{id}")));
            }
        }
        Ok(Self { locked: recipe.lock.assets.clone(), ..Self::new(pools, recipe.dataset.on_bad_asset, log) })
    }

    /// The same with what was loaded before from these pools.
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

    /// The assets of all pools with their parts and licenses, by pool and name: what stages can draw, and the other parts of
    /// splits. Loads nothing.
    pub fn listing(&self) -> Vec<ListedAsset> {
        let mut listing = Vec::new();
        for (&id, pool) in &self.pools {
            let license = pool.options.license.as_deref().or(pool.source.license());
            let asset = |entry: &CatalogEntry, part, is_drawn| ListedAsset {
                asset: AssetRef { pool: id.to_owned(), name: entry.name.clone() },
                class: pool.source.class(),
                category: entry.category.clone(),
                obj_id: entry.obj_id,
                part,
                license: license.map(str::to_owned),
                is_drawn,
            };
            let own = pool.options.split.as_ref().map(|split| split.part);
            let start = listing.len();
            listing.extend(pool.selection.entries.iter().map(|entry| asset(entry, own, true)));
            listing.extend(pool.selection.other_parts.iter().map(|(entry, part)| asset(entry, Some(*part), false)));
            listing[start..].sort_by(|a, b| a.asset.cmp(&b.asset));
        }
        listing
    }

    /// Adds the assets of the scenes that a dataset has: they must be what they were.
    pub fn expect(mut self, assets: impl IntoIterator<Item = (String, String)>) -> Self {
        self.locked.extend(assets);
        self
    }

    /// Names of the assets of each pool, with their categories and numbers.
    pub fn catalogs(&self) -> BTreeMap<String, CatalogNames> {
        self.pools.iter().map(|(&id, pool)| (id.to_owned(), pool.catalog())).collect()
    }

    /// An error if an asset must stop the run: it is bad and the recipe says so, it cannot be read at present, or it is
    /// not what the recipe was resolved with.
    pub fn refused(&self) -> Result<()> {
        self.refused.lock().clone().map_or(Ok(()), Err)
    }

    fn refuse(&self, error: Error) {
        self.refused.lock().get_or_insert(error);
    }

    fn pool(&self, id: &str) -> Result<&Pool<'a>> {
        self.pools.get(id).ok_or_else(|| {
            let known: Vec<&str> = self.pools.keys().copied().collect();
            Error::new(format!("there is no pool `{id}`")).help(format!("the recipe has: {}", known.join(", ")))
        })
    }

    /// Loads an asset; whoever asks for it meanwhile waits. A bad one is reported once and never loaded again.
    fn load_or_refuse(&self, asset: &AssetRef) -> Result<Asset> {
        if let Some(error) = self.loaded.bad.lock().get(asset) {
            return Err(error.clone());
        }
        self.load(asset).map_err(|error| {
            let error = error.context(format!("asset {asset}"));
            if error.is_transient() {
                // That says nothing about the asset: another one in its place would make another dataset.
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
        // An asset that a reader panics on is a bad one: it is named, and left out from then on.
        // What its warnings say of an asset that was let go they said before.
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
            .help("restore the asset, or make a new dataset: choose another folder with --out, and take the asset out of [lock.assets] if the recipe has that")
            .permanent();
        self.refuse(error.clone());
        Err(error)
    }
}

/// Opens pools. The error names all that cannot be opened.
pub(crate) fn open<'a>(
    assets: &'a BTreeMap<String, recipe::Pool>,
    log: &dyn Log,
) -> Result<BTreeMap<&'a str, Pool<'a>>> {
    let mut pools = BTreeMap::new();
    let mut errors = Vec::new();
    for (id, pool) in assets {
        let open = || -> Result<Pool<'a>> {
            let catalog = patiently(log, |log| pool.source.catalog(log))?;
            check_order(&catalog.entries)?;
            let found = catalog.entries.len();
            let of_pool = OfPool { id, log };
            let properties = pool.options.properties(&catalog.entries, &of_pool)?;
            pool.options.warn_of_unmatched(&catalog.entries, &of_pool)?;
            // Before anything is left out: train and val of a pool give an object the same number.
            let mut all = catalog.entries;
            let has_objects = pool.source.class() == AssetClass::Object;
            let options = &pool.options;
            let keeps = options.ids.is_none() && options.first_id.is_none() && all.iter().any(|it| it.obj_id.is_some());
            let resizes_numbered = keeps && (options.scale.is_size() || options.factor(1.0) != 1.0);
            let numbering = has_objects.then(|| pool.options.number(&mut all, &of_pool)).transpose()?;
            let last_obj_id = all.iter().filter_map(|entry| entry.obj_id).max().unwrap_or_default();
            let selection = pool.options.select(all, &of_pool)?;
            let entries = &selection.entries;
            if pool.options.ids.is_some() {
                pool.options.all_numbered(entries)?;
            }
            if entries.is_empty() {
                let hint = if found == 0 { "check its root folder" } else { "check include, exclude and split" };
                return Err(Error::new(format!("no assets: {found} found, none selected")).help(hint));
            }
            let classes = &pool.options.classes;
            if !classes.is_empty() && !entries.iter().any(|entry| classes.contains_key(&entry.category)) {
                let message = format!("assets.{id}: no asset is of one of the classes");
                log.warn(
                    &Error::new(message).help("patterns match whole names: `*mug*` matches all that contain `mug`"),
                );
            }
            let source = &*pool.source;
            Ok(Pool { source, options, selection, numbering, last_obj_id, resizes_numbered, properties })
        };
        match open() {
            Ok(pool) => drop(pools.insert(id.as_str(), pool)),
            Err(error) => errors.push(error.context(format!("assets.{id}"))),
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

/// Moves numbers that are places behind those that are stated and those of other pools: first pools with objects that labels
/// describe, then others, each by id. Numbers depend on what pools hold, never on what is taken or drawn of them.
fn number_places(pools: &mut BTreeMap<&str, Pool>, labeled: &BTreeSet<String>) -> Result<()> {
    let is = |pool: &Pool, numbering| pool.numbering == Some(numbering);
    let stated = pools.values().filter(|pool| is(pool, Numbering::Stated)).map(|pool| pool.last_obj_id);
    let mut last = stated.max().unwrap_or_default();
    for described in [true, false] {
        let those = pools.iter_mut().filter(|(id, _)| labeled.contains(**id) == described);
        for (id, pool) in those.filter(|(_, pool)| is(pool, Numbering::Places)) {
            let Some(beyond) = last.checked_add(pool.last_obj_id) else {
                return Err(Error::new(format!("objects behind number {last} go beyond {}", u32::MAX))
                    .help("state smaller numbers with `ids` or `first_id`")
                    .context(format!("assets.{id}"))
                    .of_request());
            };
            let Selection { entries, other_parts } = &mut pool.selection;
            let all = entries.iter_mut().chain(other_parts.iter_mut().map(|(entry, _)| entry));
            all.filter_map(|entry| entry.obj_id.as_mut()).for_each(|obj_id| *obj_id += last);
            last = beyond;
        }
    }
    Ok(())
}

/// Refuses objects without a number, and two of one number, in the pools with objects that labels describe.
fn numbers_differ(pools: &BTreeMap<&str, Pool>, labeled: &BTreeSet<String>) -> Result<()> {
    let described = || pools.iter().filter(|(id, _)| labeled.contains(**id));
    for (id, pool) in described() {
        let numbered = pool.options.all_numbered(&pool.selection.entries);
        numbered.map_err(|error| error.context(format!("assets.{id}")).of_request())?;
    }
    let objects = described().flat_map(|(id, pool)| pool.selection.entries.iter().map(move |entry| (*id, entry)));
    let mut seen: BTreeMap<u32, (&str, &str)> = BTreeMap::new();
    for (id, entry) in objects {
        let Some(obj_id) = entry.obj_id else { continue };
        let Some((other, name)) = seen.insert(obj_id, (id, &entry.name)) else { continue };
        let message = format!("`{other}/{name}` and `{id}/{}` have the same `obj_id` {obj_id}", entry.name);
        let last = pools.values().map(|pool| pool.last_obj_id).max().unwrap_or_default();
        let help = match other == id {
            true => format!(
                "number the whole pool anew with `first_id = 1`, give its objects `ids`, or take one source of numbers per pool: \
                 `exclude = [\"{}\"]` leaves one out",
                entry.name
            ),
            false => format!(
                "number one of the pools anew, such as `first_id = {}` in [assets.{id}], or give its objects `ids`",
                u64::from(last) + 1
            ),
        };
        return Err(Error::new(message).help(help).context(format!("assets.{id}")).of_request());
    }
    Ok(())
}

/// Refuses a catalog that is not what sources promise: entries in ascending order of unique names. Scenes draw entries by
/// their number, and one that is found by its name must be the one that was drawn.
fn check_order(entries: &[CatalogEntry]) -> Result<()> {
    let Some(pair) = entries.windows(2).find(|pair| pair[0].name >= pair[1].name) else { return Ok(()) };
    let [one, other] = [&pair[0].name, &pair[1].name];
    let message = match one == other {
        true => format!("the source lists `{one}` twice"),
        false => format!("the source lists `{one}` before `{other}`, out of order"),
    };
    Err(Error::new(message).help("this is a bug of the plugin that has this kind: a catalog is sorted by unique names"))
}

/// Calls a source again, after a pause, if the file system failed it. Warnings of a call that failed so are dropped.
fn patiently<T>(log: &dyn Log, call: impl Fn(&dyn Log) -> Result<T>) -> Result<T> {
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

impl Assets for AssetStore<'_> {
    fn entries(&self, pool: &str) -> Result<&[CatalogEntry]> {
        self.pool(pool).map(|pool| pool.selection.entries.as_slice())
    }

    fn get(&self, asset: &AssetRef) -> Result<Asset> {
        self.loaded.kept.get_or_insert_with(asset, || {
            // One that is too large to keep may still be in use.
            if let Some(asset) = self.loaded.in_use.lock().get(asset).and_then(InUse::get) {
                return Ok(asset);
            }
            let loaded = self.load_or_refuse(asset)?;
            self.loaded.in_use.lock().insert(asset.clone(), InUse::of(&loaded));
            Ok(loaded)
        })
    }
}

/// The assets of one attempt at a scene: remembers the digests of what was drawn.
pub struct RecordingAssets<'a> {
    store: &'a AssetStore<'a>,
    digests: Mutex<BTreeMap<String, String>>,
}

impl<'a> RecordingAssets<'a> {
    /// Nothing drawn yet.
    pub fn new(store: &'a AssetStore<'a>) -> Self {
        Self { store, digests: Mutex::default() }
    }

    /// Digests of all that was drawn, by `pool/name`.
    pub fn into_digests(self) -> BTreeMap<String, String> {
        self.digests.into_inner()
    }
}

impl Assets for RecordingAssets<'_> {
    fn entries(&self, pool: &str) -> Result<&[CatalogEntry]> {
        self.store.entries(pool)
    }

    fn get(&self, asset: &AssetRef) -> Result<Asset> {
        let loaded = self.store.get(asset);
        let digest = loaded.as_ref().map_or_else(|_| BAD.to_owned(), |loaded| loaded.digest().to_string());
        self.digests.lock().insert(asset.to_string(), digest);
        loaded
    }
}

/// Approximate memory that an asset takes.
fn bytes(asset: &Asset) -> usize {
    match asset {
        Asset::Material(material) => material_bytes(material),
        Asset::Environment(map) => map.texels().len() * 12,
        Asset::Object(object) => {
            let data = object.mesh.data();
            data.positions.len() * 24
                + data.uvs.len() * 8
                + data.colors.len() * 12
                + data.triangles.len() * 14
                + object.materials.iter().map(|material| material_bytes(material)).sum::<usize>()
        }
        _ => 0,
    }
}

fn material_bytes(material: &Material) -> usize {
    material.textures().map(|used| used.texture.texels.len()).sum::<usize>() + 256
}

impl Pool<'_> {
    /// Loads an entry, and applies the pool's options.
    fn load(&self, name: &str, log: &dyn Log) -> Result<Asset> {
        Ok(match (self.source.load(name, log)?, &self.options.license) {
            (Asset::Object(object), _) => {
                let mut object = Arc::unwrap_or_clone(object);
                if let Some(CatalogEntry { category, obj_id, .. }) = self.entry(name) {
                    object.category.clone_from(category);
                    object.model.obj_id = *obj_id;
                }
                self.normalize(object)?.into()
            }
            (Asset::Material(material), Some(license)) => {
                Material { license: license.clone(), ..Arc::unwrap_or_clone(material) }.into()
            }
            (Asset::Environment(map), Some(license)) => {
                let mut map = Arc::unwrap_or_clone(map);
                map.license.clone_from(license);
                map.into()
            }
            (other, _) => other,
        })
    }

    /// The entry of a name. Entries are sorted.
    fn entry(&self, name: &str) -> Option<&CatalogEntry> {
        let entries = &self.selection.entries;
        let found = entries.binary_search_by(|entry| entry.name.as_str().cmp(name));
        found.ok().map(|index| &entries[index])
    }

    /// The entries by name.
    fn catalog(&self) -> CatalogNames {
        let asset = |CatalogEntry { category, obj_id, .. }: &CatalogEntry| CatalogAsset {
            category: category.clone(),
            obj_id: *obj_id,
        };
        self.selection.entries.iter().map(|entry| (entry.name.clone(), asset(entry))).collect()
    }

    /// Warns of an object of a size that is unlikely, where neither the source nor the pool states the unit or the size.
    fn doubt_size(&self, asset: &Asset, log: &dyn Log) {
        let stated = self.source.states_units() || self.options.units.is_some() || self.options.scale.is_size();
        if let (Asset::Object(object), false) = (asset, stated)
            && let Some(doubt) = doubt(object.mesh.bounds().size().max())
        {
            log.warn(&doubt);
        }
    }

    /// Applies the pool's scale, center, mass and license to an object as the source read it, and checks its size.
    fn normalize(&self, object: Object) -> Result<Object> {
        let options = self.options;
        if options.single_part_only {
            let parts = Topology::of(&object.mesh).significant_parts();
            if parts > 1 {
                return Err(Error::new(format!("it consists of {parts} separate parts"))
                    .help("single_part_only = false accepts it as one rigid body"));
            }
        }
        let bounds = object.mesh.bounds();
        let longest = bounds.size().max();
        let scale = options.factor(longest);
        let center = bounds.center();
        let offset = match options.center {
            Center::Bounds => -center.coords,
            Center::Bottom => -Point3::new(center.x, center.y, bounds.min.z).coords,
            Center::None => Vector3::zeros(),
        };
        let own = self.properties.get(&object.name).copied().unwrap_or_default();
        let volume = || Topology::of(&object.mesh).solid_volume() * scale.powi(3);
        let stated = match options.mass {
            _ if own.mass_kg.is_some() => own.mass_kg,
            _ if own.density_kg_m3.is_some() => own.density_kg_m3.map(|density| density * volume()),
            Some(Mass::Kg(mass)) => Some(mass),
            Some(Mass::DensityKgM3(density)) => Some(density * volume()),
            None => None,
        };
        let mass = match stated {
            Some(kg) => (kg.max(MIN_KG), MassOrigin::Known),
            // The estimate is that of the object's real size.
            None if object.mass.origin == MassOrigin::Estimated && scale != 1.0 => {
                (estimate_kg(volume()), MassOrigin::Estimated)
            }
            // A known mass is that of a material, which the scaled object is made of, too.
            None => (object.mass.kg * scale.powi(3), object.mass.origin),
        };
        let friction = own.friction.unwrap_or(object.friction);
        let digest = Hasher::new("pooled object")
            .digest(object.digest)
            .number(scale)
            .number(offset.x)
            .number(offset.y)
            .number(offset.z)
            .number(mass.0)
            .number(friction)
            .finish();
        let license = options.license.clone().unwrap_or_else(|| object.license.clone());
        let object = object.transformed(offset, scale)?;
        let mass = object.mass.with_kg(mass.0, mass.1);
        let object = Object { mass, friction, digest, license, ..object };
        object.check_extent()?;
        Ok(object)
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
mod tests {
    use super::*;
    use crate::recipe::Scale;
    use syntable_model::context::Collected;
    use syntable_model::scene::{Catalog, Scalar, Transmission, Volume};
    use syntable_testing::scenes::{box_mesh, object};

    struct Nothing;

    impl AssetSource for Nothing {
        fn class(&self) -> AssetClass {
            AssetClass::Object
        }

        fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
            Ok(Catalog { entries: Vec::new() })
        }

        fn load(&self, name: &str, _: &dyn Log) -> Result<Asset> {
            Err(Error::new(format!("no `{name}`")))
        }
    }

    /// A glass that is filled with something.
    fn glass(attenuation_distance_m: f32) -> Arc<Material> {
        let mut glass = Material::plain("glass", [1.0; 3], 0.0);
        let volume = Some(Volume { attenuation_color: [0.2, 0.6, 0.4], attenuation_distance_m });
        glass.transmission = Some(Transmission { fraction: Scalar::constant(1.0), volume });
        Arc::new(glass.with_digest())
    }

    fn pool<'a>(source: &'a dyn AssetSource, options: &'a PoolOptions) -> Pool<'a> {
        let numbering = Some(Numbering::Places);
        let (selection, properties) = (Selection::default(), BTreeMap::new());
        Pool { source, options, selection, numbering, last_obj_id: 0, resizes_numbered: false, properties }
    }

    /// A pool with some of the objects of a source, as it is opened.
    fn numbered<'a>(options: &'a PoolOptions, names: &[&str], stated: &[(&str, u32)]) -> Pool<'a> {
        let stated: BTreeMap<&str, u32> = stated.iter().copied().collect();
        let mut all: Vec<CatalogEntry> = names.iter().map(|name| CatalogEntry::new(*name, "thing")).collect();
        all.iter_mut().for_each(|entry| entry.obj_id = stated.get(entry.name.as_str()).copied());
        let numbering = options.number(&mut all, &Collected::default()).expect("sound");
        let last_obj_id = all.iter().filter_map(|entry| entry.obj_id).max().unwrap_or_default();
        let selection = options.select(all, &Collected::default()).expect("sound");
        Pool { selection, numbering: Some(numbering), last_obj_id, ..pool(&Nothing, options) }
    }

    fn ids(pools: &BTreeMap<&str, Pool>, pool: &str) -> Vec<u32> {
        pools[pool].selection.entries.iter().filter_map(|entry| entry.obj_id).collect()
    }

    #[test]
    fn numbers_depend_on_what_pools_hold_and_not_on_what_is_taken() {
        let names = ["a", "b", "c", "d"];
        let all = PoolOptions::default();
        let some = PoolOptions { exclude: vec!["b".into()], ..PoolOptions::default() };
        let labeled = BTreeSet::from(["objects".to_owned(), "shoes".to_owned()]);
        for (options, objects, shoes) in
            [(&all, vec![1, 2, 3, 4], vec![5, 6, 7, 8]), (&some, vec![1, 3, 4], vec![5, 7, 8])]
        {
            // Tables come last, though their name is first.
            let pool = || numbered(options, &names, &[]);
            let mut pools = BTreeMap::from([("desks", pool()), ("objects", pool()), ("shoes", pool())]);
            number_places(&mut pools, &labeled).expect("few");
            assert_eq!((ids(&pools, "objects"), ids(&pools, "shoes")), (objects, shoes));
            assert_eq!(ids(&pools, "desks")[0], 9);
            numbers_differ(&pools, &labeled).expect("all differ");
        }
        // Places are behind what others state, taken or not.
        let stated = [("a", 3), ("b", 40), ("c", 2), ("d", 5)];
        let mut pools =
            BTreeMap::from([("objects", numbered(&all, &names, &[])), ("shoes", numbered(&some, &names, &stated))]);
        number_places(&mut pools, &labeled).expect("few");
        assert_eq!((ids(&pools, "objects"), ids(&pools, "shoes")), (vec![41, 42, 43, 44], vec![3, 2, 5]));
        numbers_differ(&pools, &labeled).expect("all differ");
        // Those that are stated stay, and clashes name both.
        let mut pools =
            BTreeMap::from([("objects", numbered(&all, &names, &stated)), ("shoes", numbered(&all, &names, &stated))]);
        number_places(&mut pools, &labeled).expect("few");
        let error = numbers_differ(&pools, &labeled).expect_err("equal");
        assert!(error.to_string().contains("`objects/a` and `shoes/a` have the same `obj_id` 3"), "{error}");
        assert!(error.help_text().is_some_and(|help| help.contains("`first_id = 41` in [assets.shoes]")), "{error:?}");
        let twice = [("a", 1), ("b", 2), ("c", 1), ("d", 4)];
        let pools = BTreeMap::from([("objects", numbered(&all, &names, &twice))]);
        let error = numbers_differ(&pools, &labeled).expect_err("equal");
        assert!(error.to_string().contains("`objects/a` and `objects/c` have the same `obj_id` 1"), "{error}");
        assert!(error.help_text().is_some_and(|help| help.contains("first_id = 1")), "{error:?}");
        // Of pools that labels do not describe, nobody asks.
        numbers_differ(&pools, &BTreeSet::new()).expect("no labels");
    }

    /// The object of 0.1 m by 0.2 m by 0.4 m and 0.2 kg, as a pool hands it out.
    fn weighed(origin: MassOrigin, options: &PoolOptions, properties: Option<ObjectProperties>) -> Object {
        let object = (*object("block", box_mesh([0.1, 0.2, 0.4]), [1.0; 3])).clone();
        let mass = object.mass.with_kg(0.2, origin);
        let properties = properties.map(|properties| ("block".to_owned(), properties)).into_iter().collect();
        let pool = Pool { properties, ..pool(&Nothing, options) };
        pool.normalize(Object { mass, ..object }).expect("sound")
    }

    #[test]
    fn scaled_objects_are_of_the_same_material() {
        for scale in [Scale::Factor(0.5), Scale::Size { longest_side_m: 0.2 }] {
            let options = PoolOptions { scale, ..PoolOptions::default() };
            let known = weighed(MassOrigin::Known, &options, None);
            assert!((known.mass.kg - 0.025).abs() < 1e-8, "{scale:?}: {:?}", known.mass);
            // Uniform box of 0.1 m by 0.2 m by 0.05 m: m/12 (a² + b²).
            let long = known.mass.inertia()[(0, 0)];
            assert!((long - 0.025 / 12.0 * (0.1_f64.powi(2) + 0.2_f64.powi(2))).abs() < 1e-9, "{long}");
            assert_eq!(known.mass.origin, MassOrigin::Known);
            // An estimate is made for the size that the object has: 400 kg/m³.
            let guessed = weighed(MassOrigin::Estimated, &options, None);
            assert!((guessed.mass.kg - 400.0 * 0.001).abs() < 1e-6, "{:?}", guessed.mass);
            assert_eq!(guessed.mass.origin, MassOrigin::Estimated);
        }
    }

    #[test]
    fn a_table_states_mass_density_and_friction() {
        let dense = PoolOptions { mass: Some(Mass::DensityKgM3(1000.0)), ..PoolOptions::default() };
        let states = |mass_kg, density_kg_m3, friction| Some(ObjectProperties { mass_kg, density_kg_m3, friction });
        for (properties, kg, friction) in [
            (None, 8.0, 0.5),
            (states(Some(0.3), None, None), 0.3, 0.5),
            (states(None, Some(500.0), Some(0.9)), 4.0, 0.9),
            (states(None, None, Some(0.1)), 8.0, 0.1),
        ] {
            let found = weighed(MassOrigin::Estimated, &dense, properties);
            assert!(
                (found.mass.kg - kg).abs() < 1e-6 && found.friction == friction,
                "{properties:?}: {:?}",
                found.mass
            );
            assert_eq!(found.mass.origin, MassOrigin::Known);
        }
        let digests: Vec<_> = [None, states(None, None, Some(0.1)), states(Some(0.3), None, None)]
            .into_iter()
            .map(|properties| weighed(MassOrigin::Known, &PoolOptions::default(), properties).digest)
            .collect();
        assert!(digests[0] != digests[1] && digests[0] != digests[2] && digests[1] != digests[2]);
    }

    fn normalized(materials: Vec<Arc<Material>>, options: &PoolOptions) -> Object {
        let object = Object { materials, ..(*object("block", box_mesh([0.1, 0.2, 0.4]), [1.0; 3])).clone() };
        pool(&Nothing, options).normalize(object).expect("sound")
    }

    /// Transmittance along a straight path through the center of the object, along its longest side.
    fn passed(object: &Object) -> f64 {
        let medium = object.materials[0].transmission.as_ref().and_then(|glass| glass.volume).expect("filled");
        let way = object.mesh.bounds().size().max() / f64::from(medium.attenuation_distance_m);
        f64::from(medium.attenuation_color[0]).powf(way)
    }

    #[test]
    fn scaled_glass_lets_as_much_light_through() {
        let as_it_is = PoolOptions::default();
        let before = passed(&normalized(vec![glass(0.02)], &as_it_is));
        assert!((before - 0.2_f64.powi(20)).abs() < 1e-6 * before, "0.4 m are twenty times 0.02 m: {before}");
        for options in [
            PoolOptions { scale: Scale::Factor(0.05), ..PoolOptions::default() },
            PoolOptions { scale: Scale::Factor(3.0), ..PoolOptions::default() },
            PoolOptions { scale: Scale::Size { longest_side_m: 0.1 }, ..PoolOptions::default() },
        ] {
            let after = passed(&normalized(vec![glass(0.02)], &options));
            assert!((after / before - 1.0).abs() < 1e-4, "{options:?}: {after}, not {before}");
        }
    }

    /// A source of one material and one environment map.
    struct Licensed;

    impl AssetSource for Licensed {
        fn class(&self) -> AssetClass {
            AssetClass::Material
        }

        fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
            Ok(Catalog { entries: Vec::new() })
        }

        fn load(&self, name: &str, _: &dyn Log) -> Result<Asset> {
            Ok(match name {
                "sky" => EnvironmentMap::constant([1.0; 3]).into(),
                _ => Material::plain("oak", [0.5; 3], 0.5).with_digest().into(),
            })
        }
    }

    /// A source whose reader panics, and counts how often it was asked.
    #[derive(Default)]
    struct Panicking(std::sync::atomic::AtomicUsize);

    impl AssetSource for Panicking {
        fn class(&self) -> AssetClass {
            AssetClass::Object
        }

        fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
            Ok(Catalog { entries: Vec::new() })
        }

        fn load(&self, _: &str, _: &dyn Log) -> Result<Asset> {
            self.0.fetch_add(1, std::sync::atomic::Ordering::SeqCst);
            panic!("chunk size must not be zero")
        }
    }

    /// A source of one block.
    struct Block;

    impl AssetSource for Block {
        fn class(&self) -> AssetClass {
            AssetClass::Object
        }

        fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
            Ok(Catalog { entries: Vec::new() })
        }

        fn load(&self, name: &str, _: &dyn Log) -> Result<Asset> {
            Ok(Asset::Object(object(name, box_mesh([0.1; 3]), [1.0; 3])))
        }
    }

    #[test]
    fn an_object_has_the_category_of_its_entry() {
        let classes = BTreeMap::from([("mug".to_owned(), vec!["b*".to_owned()])]);
        let options = PoolOptions { classes, ..PoolOptions::default() };
        let entry = |name: &str| CatalogEntry::new(name, "thing");
        let entries = ["a", "block", "c"].map(entry).to_vec();
        let selection = options.select(entries, &Collected::default()).expect("sound");
        let pool = Pool { selection, ..pool(&Block, &options) };
        for (name, category) in [("a", "thing"), ("block", "mug"), ("c", "thing")] {
            let asset = pool.load(name, &Collected::default()).and_then(Asset::into_object).expect("loads");
            assert_eq!(asset.category, category, "{name}");
        }
    }

    #[test]
    fn an_asset_that_a_reader_panics_on_is_bad() {
        let (source, options, log) = (Panicking::default(), PoolOptions::default(), Collected::default());
        let store = AssetStore::new(BTreeMap::from([("p", pool(&source, &options))]), OnBadAsset::Skip, &log);
        for _ in 0..3 {
            let error = store.get(&AssetRef { pool: "p".into(), name: "x".into() }).expect_err("bad").to_string();
            assert!(error.contains("asset p/x") && error.contains("chunk size must not be zero"), "{error}");
        }
        assert_eq!(source.0.load(std::sync::atomic::Ordering::SeqCst), 1, "it is not drawn again");
        assert_eq!(log.warnings().len(), 1);
        assert!(store.refused().is_ok());
    }

    /// A source of long objects in an unknown unit, slow to load, that counts and warns.
    #[derive(Default)]
    struct Long(std::sync::atomic::AtomicUsize);

    impl AssetSource for Long {
        fn class(&self) -> AssetClass {
            AssetClass::Object
        }

        fn states_units(&self) -> bool {
            false
        }

        fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
            Ok(Catalog { entries: Vec::new() })
        }

        fn load(&self, name: &str, log: &dyn Log) -> Result<Asset> {
            self.0.fetch_add(1, std::sync::atomic::Ordering::SeqCst);
            std::thread::sleep(Duration::from_millis(50));
            log.warn(&Error::new("open"));
            Ok(Asset::Object(object(name, box_mesh([0.1, 0.2, 8.4]), [1.0; 3])))
        }
    }

    #[test]
    fn an_asset_is_loaded_once_while_it_is_in_use_and_warns_once() {
        let (source, options, log) = (Long::default(), PoolOptions::default(), Collected::default());
        // Nothing is kept: the cache is too small for anything.
        let pools = BTreeMap::from([("p", pool(&source, &options))]);
        let store =
            AssetStore { loaded: Arc::new(Loaded::within(1)), ..AssetStore::new(pools, OnBadAsset::Skip, &log) };
        let asset = AssetRef { pool: "p".into(), name: "tin".into() };
        let loads = || source.0.load(std::sync::atomic::Ordering::SeqCst);
        let held: Vec<Asset> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..4).map(|_| scope.spawn(|| store.get(&asset).expect("loads"))).collect();
            threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
        });
        store.get(&asset).expect("loads");
        assert_eq!(loads(), 1);
        drop(held);
        store.get(&asset).expect("loads");
        assert_eq!(loads(), 2, "nobody had it any more");
        let told: Vec<String> = log.warnings().iter().map(ToString::to_string).collect();
        assert_eq!(told.len(), 2, "{told:?}");
        assert!(told[1].contains("asset p/tin: the object is 8.40 m long (`units = \"cm\"`"), "{told:?}");
    }

    #[test]
    fn the_cache_keeps_an_asset_of_a_large_part_of_it() {
        let map = EnvironmentMap::new("", 64, 64, vec![[1.0; 3]; 64 * 64]).expect("sound");
        let asset = AssetRef { pool: "p".into(), name: "sky".into() };
        let cache = cache(2 * 64 * 64 * 12);
        cache.insert(asset.clone(), Asset::from(map));
        assert!(cache.get(&asset).is_some());
    }

    #[test]
    fn a_pool_gives_its_license_to_materials_and_maps_and_no_digest_changes() {
        let load = |name: &str, license: Option<&str>| {
            let options = PoolOptions { license: license.map(str::to_owned), ..PoolOptions::default() };
            let pools = BTreeMap::from([("p", pool(&Licensed, &options))]);
            let log = Collected::default();
            let store = AssetStore::new(pools, OnBadAsset::Fail, &log);
            let asset = store.get(&AssetRef { pool: "p".into(), name: name.into() }).expect("loads");
            let license = match &asset {
                Asset::Material(material) => material.license.clone(),
                Asset::Environment(map) => map.license.clone(),
                _ => String::new(),
            };
            (license, asset.digest())
        };
        for name in ["oak", "sky"] {
            let (plain, licensed) = (load(name, None), load(name, Some("CC0-1.0")));
            assert_eq!((plain.0.as_str(), licensed.0.as_str()), ("", "CC0-1.0"));
            assert_eq!(plain.1, licensed.1, "{name}");
        }
    }

    #[test]
    fn only_colored_media_are_changed_by_scale() {
        let materials = vec![Arc::new(Material::plain("clay", [0.5; 3], 0.5)), glass(f32::INFINITY), glass(0.02)];
        let kept = |options: &PoolOptions| {
            let object = normalized(materials.clone(), options);
            let pairs: Vec<_> = materials.iter().zip(&object.materials).collect();
            (pairs.iter().map(|(a, b)| Arc::ptr_eq(a, b)).collect(), pairs.iter().all(|(a, b)| a.digest == b.digest))
        };
        assert_eq!(kept(&PoolOptions::default()), (vec![true; 3], true));
        assert_eq!(
            kept(&PoolOptions { scale: Scale::Factor(2.0), ..PoolOptions::default() }),
            (vec![true, true, false], false)
        );
    }
}
