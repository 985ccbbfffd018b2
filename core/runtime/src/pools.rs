//! The pools of a recipe: selection, scale, centring and mass are the same for every source of assets.

use crate::recipe::{Center, OnBadAsset, PoolOptions, Recipe};
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, MutexGuard};
use syntable_model::context::{Assets, Log};
use syntable_model::digest::{Digest, Hasher};
use syntable_model::error::{Error, Result};
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::scene::{Asset, AssetClass, AssetRef, CatalogEntry, EnvironmentMap, Material, Object, Topology};
use syntable_model::stage::AssetSource;

/// Bytes of loaded assets that are kept for the next scene; the least recently used are let go first.
const KEEP_BYTES: usize = 256 << 20;

/// Density and limits of mass of an object that was scaled and whose mass nobody states: hollow household things.
const DENSITY_KG_M3: f64 = 400.0;
const MASS_KG: [f64; 2] = [0.005, 20.0];

/// All pools of a recipe, with what was loaded from them.
pub struct Library<'a> {
    pools: BTreeMap<&'a str, Pool<'a>>,
    locked: &'a BTreeMap<String, String>,
    on_bad_asset: OnBadAsset,
    log: &'a dyn Log,
    loaded: Mutex<Loaded>,
    refused: Mutex<Option<Error>>,
}

struct Pool<'a> {
    source: &'a dyn AssetSource,
    options: &'a PoolOptions,
    entries: Vec<CatalogEntry>,
}

/// A loaded asset, shared.
#[derive(Clone)]
enum Shared {
    Object(Arc<Object>),
    Material(Arc<Material>),
    Environment(Arc<EnvironmentMap>),
}

#[derive(Default)]
struct Loaded {
    assets: HashMap<AssetRef, Kept>,
    bad: BTreeMap<AssetRef, Error>,
    bytes: usize,
    clock: u64,
}

struct Kept {
    asset: Shared,
    bytes: usize,
    used: u64,
}

impl<'a> Library<'a> {
    /// Opens all pools: finds and selects their entries, and loads nothing yet.
    pub fn open(recipe: &'a Recipe, log: &'a dyn Log) -> Result<Self> {
        let mut pools = BTreeMap::new();
        for (id, pool) in &recipe.assets {
            let open = || -> Result<Vec<CatalogEntry>> {
                let catalog = pool.source.catalog(log)?;
                let found = catalog.entries.len();
                let entries = pool.options.select(catalog.entries)?;
                if entries.is_empty() {
                    let hint = if found == 0 { "check its root folder" } else { "check include, exclude and split" };
                    return Err(Error::new(format!("no assets: {found} found, none selected")).help(hint));
                }
                Ok(entries)
            };
            let entries = open().map_err(|error| error.context(format!("assets.{id}")))?;
            pools.insert(id.as_str(), Pool { source: &*pool.source, options: &pool.options, entries });
        }
        Ok(Self {
            pools,
            locked: &recipe.locked,
            on_bad_asset: recipe.dataset.on_bad_asset,
            log,
            loaded: Mutex::default(),
            refused: Mutex::default(),
        })
    }

    /// Names of the pools, with the number of entries of each.
    pub fn sizes(&self) -> impl Iterator<Item = (&str, usize)> {
        self.pools.iter().map(|(&id, pool)| (id, pool.entries.len()))
    }

    /// An error if an asset must stop the run: it is bad and the recipe says so, or it is not what the recipe was
    /// resolved with.
    pub fn refused(&self) -> Result<()> {
        self.refused.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).clone().map_or(Ok(()), Err)
    }

    fn lock(&self) -> MutexGuard<'_, Loaded> {
        self.loaded.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    fn refuse(&self, error: Error) {
        self.refused.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).get_or_insert(error);
    }

    fn pool(&self, id: &str) -> Result<&Pool<'a>> {
        self.pools.get(id).ok_or_else(|| {
            let known: Vec<&str> = self.pools.keys().copied().collect();
            Error::new(format!("there is no pool `{id}`")).help(format!("the recipe has: {}", known.join(", ")))
        })
    }

    /// An asset, loaded at most once while it is kept. A bad one is reported once.
    fn get(&self, asset: &AssetRef) -> Result<Shared> {
        {
            let mut loaded = self.lock();
            if let Some(error) = loaded.bad.get(asset) {
                return Err(error.clone());
            }
            loaded.clock += 1;
            let now = loaded.clock;
            if let Some(kept) = loaded.assets.get_mut(asset) {
                kept.used = now;
                return Ok(kept.asset.clone());
            }
        }
        match self.load(asset) {
            Ok((shared, bytes)) => {
                self.lock().keep(asset, &shared, bytes);
                Ok(shared)
            }
            Err(error) => {
                let error = error.context(format!("asset {asset}"));
                if self.lock().bad.insert(asset.clone(), error.clone()).is_none() {
                    self.log.warn(&error);
                }
                if self.on_bad_asset == OnBadAsset::Fail {
                    self.refuse(error.clone());
                }
                Err(error)
            }
        }
    }

    fn load(&self, asset: &AssetRef) -> Result<(Shared, usize)> {
        let pool = self.pool(&asset.pool)?;
        let log = Named { asset, log: self.log };
        let shared = match pool.source.load(&asset.name, &log)? {
            Asset::Object(object) => Shared::Object(Arc::new(pool.normalise(object)?)),
            Asset::Material(material) => Shared::Material(Arc::new(material)),
            Asset::Environment(map) => Shared::Environment(Arc::new(map)),
        };
        let digest = shared.digest().to_string();
        if let Some(locked) = self.locked.get(&asset.to_string())
            && *locked != digest
        {
            let error =
                Error::new(format!("asset {asset} has digest {digest}, but the recipe was resolved with {locked}"))
                    .help("restore the asset, or take it out of [lock.assets] to accept the new one");
            self.refuse(error.clone());
            return Err(error);
        }
        let bytes = shared.bytes();
        Ok((shared, bytes))
    }
}

impl Loaded {
    fn keep(&mut self, asset: &AssetRef, shared: &Shared, bytes: usize) {
        self.clock += 1;
        let kept = Kept { asset: shared.clone(), bytes, used: self.clock };
        if let Some(old) = self.assets.insert(asset.clone(), kept) {
            self.bytes -= old.bytes;
        }
        self.bytes += bytes;
        while self.bytes > KEEP_BYTES && self.assets.len() > 1 {
            let oldest = self.assets.iter().min_by_key(|(_, kept)| kept.used).map(|(asset, _)| asset.clone());
            if let Some(gone) = oldest.and_then(|oldest| self.assets.remove(&oldest)) {
                self.bytes -= gone.bytes;
            }
        }
    }
}

impl Assets for Library<'_> {
    fn entries(&self, pool: &str) -> Result<&[CatalogEntry]> {
        self.pool(pool).map(|pool| pool.entries.as_slice())
    }

    fn object(&self, asset: &AssetRef) -> Result<Arc<Object>> {
        match self.get(asset)? {
            Shared::Object(object) => Ok(object),
            other => Err(other.is_not(asset, AssetClass::Object)),
        }
    }

    fn material(&self, asset: &AssetRef) -> Result<Arc<Material>> {
        match self.get(asset)? {
            Shared::Material(material) => Ok(material),
            other => Err(other.is_not(asset, AssetClass::Material)),
        }
    }

    fn environment(&self, asset: &AssetRef) -> Result<Arc<EnvironmentMap>> {
        match self.get(asset)? {
            Shared::Environment(map) => Ok(map),
            other => Err(other.is_not(asset, AssetClass::Environment)),
        }
    }
}

/// The assets of one attempt at a scene: remembers the digests of what was drawn.
pub struct Drawn<'a> {
    library: &'a Library<'a>,
    digests: Mutex<BTreeMap<String, String>>,
}

impl<'a> Drawn<'a> {
    /// Nothing drawn yet.
    pub fn new(library: &'a Library<'a>) -> Self {
        Self { library, digests: Mutex::default() }
    }

    /// Digests of all that was drawn, by `pool/name`.
    pub fn into_digests(self) -> BTreeMap<String, String> {
        self.digests.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    fn note(&self, asset: &AssetRef, digest: Digest) {
        let mut digests = self.digests.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        digests.insert(asset.to_string(), digest.to_string());
    }
}

impl Assets for Drawn<'_> {
    fn entries(&self, pool: &str) -> Result<&[CatalogEntry]> {
        self.library.entries(pool)
    }

    fn object(&self, asset: &AssetRef) -> Result<Arc<Object>> {
        let object = self.library.object(asset)?;
        self.note(asset, object.digest);
        Ok(object)
    }

    fn material(&self, asset: &AssetRef) -> Result<Arc<Material>> {
        let material = self.library.material(asset)?;
        self.note(asset, material.digest);
        Ok(material)
    }

    fn environment(&self, asset: &AssetRef) -> Result<Arc<EnvironmentMap>> {
        let map = self.library.environment(asset)?;
        self.note(asset, map.digest);
        Ok(map)
    }
}

impl Shared {
    fn digest(&self) -> Digest {
        match self {
            Self::Object(object) => object.digest,
            Self::Material(material) => material.digest,
            Self::Environment(map) => map.digest,
        }
    }

    fn is_not(&self, asset: &AssetRef, wanted: AssetClass) -> Error {
        let class = match self {
            Self::Object(_) => AssetClass::Object,
            Self::Material(_) => AssetClass::Material,
            Self::Environment(_) => AssetClass::Environment,
        };
        Error::new(format!("{asset} is of class `{class}`, not `{wanted}`"))
    }

    /// About how much memory it takes.
    fn bytes(&self) -> usize {
        match self {
            Self::Material(material) => material_bytes(material),
            Self::Environment(map) => map.texels().len() * 12,
            Self::Object(object) => {
                let data = object.mesh.data();
                data.positions.len() * 24
                    + data.uvs.len() * 8
                    + data.colors.len() * 12
                    + data.triangles.len() * 14
                    + object.materials.iter().map(|material| material_bytes(material)).sum::<usize>()
            }
        }
    }
}

fn material_bytes(material: &Material) -> usize {
    material.textures().map(|used| used.texture.texels.len()).sum::<usize>() + 256
}

impl Pool<'_> {
    /// Applies the pool's scale, centre, mass and licence to an object as the source read it, and checks its size.
    fn normalise(&self, object: Object) -> Result<Object> {
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
        let scale = options.longest_side_m.map_or(options.scale, |wanted| wanted / longest);
        let centre = bounds.centre();
        let offset = match options.center {
            Center::Bounds => -centre.coords,
            Center::Bottom => -Point3::new(centre.x, centre.y, bounds.min.z).coords,
            Center::None => Vector3::zeros(),
        };
        let mass = match (options.mass_kg, options.density_kg_m3) {
            (Some(mass), _) => mass,
            (None, Some(density)) => (Topology::of(&object.mesh).solid_volume() * scale.powi(3) * density).max(1e-4),
            (None, None) if scale == 1.0 => object.mass_kg,
            (None, None) => {
                let volume = Topology::of(&object.mesh).solid_volume() * scale.powi(3);
                (volume * DENSITY_KG_M3).clamp(MASS_KG[0], MASS_KG[1])
            }
        };
        let untouched = scale == 1.0 && offset.norm() == 0.0;
        let mesh = if untouched { Arc::clone(&object.mesh) } else { Arc::new(object.mesh.transformed(offset, scale)?) };
        let collision = object.collision.as_ref().map(|parts| {
            let moved = |p: &[f32; 3]| std::array::from_fn(|i| ((f64::from(p[i]) + offset[i]) * scale) as f32);
            Arc::new(parts.iter().map(|part| part.iter().map(moved).collect()).collect())
        });
        let digest = Hasher::new("pooled object")
            .digest(object.digest)
            .number(scale)
            .number(offset.x)
            .number(offset.y)
            .number(offset.z)
            .number(mass)
            .finish();
        let licence = options.license.clone().unwrap_or(object.licence);
        let materials = object.materials.into_iter().map(|material| scaled(material, scale)).collect();
        let object = Object { mesh, materials, collision, mass_kg: mass, digest, licence, ..object };
        object.check_extent()?;
        Ok(object)
    }
}

/// The material of an object that is made larger by a factor.
///
/// Its light passes through the object on ways that are longer by that factor; so is the distance after which a medium
/// has its colour, and a large bottle looks like a small one. In glTF this distance is a length in the world, which no
/// node scales; but a pool's scale changes the unit of a file's whole world.
fn scaled(material: Arc<Material>, factor: f64) -> Arc<Material> {
    let medium = material.transmission.as_ref().and_then(|transmission| transmission.volume);
    if factor == 1.0 || medium.is_none_or(|medium| medium.attenuation_distance_m.is_infinite()) {
        return material;
    }
    let mut material = Arc::unwrap_or_clone(material);
    if let Some(medium) = material.transmission.as_mut().and_then(|transmission| transmission.volume.as_mut()) {
        medium.attenuation_distance_m = (f64::from(medium.attenuation_distance_m) * factor) as f32;
    }
    Arc::new(material.sealed())
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

/// The class of assets that a pool gives, for messages.
pub fn class_of(recipe: &Recipe, pool: &str) -> Option<AssetClass> {
    recipe.assets.get(pool).map(|pool| pool.source.class())
}

#[cfg(test)]
mod tests {
    use super::*;
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
        glass.transmission = Some(Transmission { share: Scalar::constant(1.0), volume });
        Arc::new(glass.sealed())
    }

    fn normalised(materials: Vec<Arc<Material>>, options: &PoolOptions) -> Object {
        let object = Object { materials, ..(*object("block", box_mesh([0.1, 0.2, 0.4]), [1.0; 3])).clone() };
        Pool { source: &Nothing, options, entries: Vec::new() }.normalise(object).expect("sound")
    }

    /// The share of light left after a straight way through the middle of the object, along its longest side.
    fn passed(object: &Object) -> f64 {
        let medium = object.materials[0].transmission.as_ref().and_then(|glass| glass.volume).expect("filled");
        let way = object.mesh.bounds().size().max() / f64::from(medium.attenuation_distance_m);
        f64::from(medium.attenuation_color[0]).powf(way)
    }

    #[test]
    fn scaled_glass_lets_as_much_light_through() {
        let as_it_is = PoolOptions::default();
        let before = passed(&normalised(vec![glass(0.02)], &as_it_is));
        assert!((before - 0.2_f64.powi(20)).abs() < 1e-6 * before, "0.4 m are twenty times 0.02 m: {before}");
        for options in [
            PoolOptions { scale: 0.05, ..PoolOptions::default() },
            PoolOptions { scale: 3.0, ..PoolOptions::default() },
            PoolOptions { longest_side_m: Some(0.1), ..PoolOptions::default() },
        ] {
            let after = passed(&normalised(vec![glass(0.02)], &options));
            assert!((after / before - 1.0).abs() < 1e-4, "{options:?}: {after}, not {before}");
        }
    }

    #[test]
    fn only_coloured_media_are_changed_by_scale() {
        let materials = vec![Arc::new(Material::plain("clay", [0.5; 3], 0.5)), glass(f32::INFINITY), glass(0.02)];
        let kept = |options: &PoolOptions| {
            let object = normalised(materials.clone(), options);
            let pairs: Vec<_> = materials.iter().zip(&object.materials).collect();
            (pairs.iter().map(|(a, b)| Arc::ptr_eq(a, b)).collect(), pairs.iter().all(|(a, b)| a.digest == b.digest))
        };
        assert_eq!(kept(&PoolOptions::default()), (vec![true; 3], true));
        assert_eq!(kept(&PoolOptions { scale: 2.0, ..PoolOptions::default() }), (vec![true, true, false], false));
    }
}
