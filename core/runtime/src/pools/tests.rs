//! Tests of pools.

use super::loaded::cache;
use super::open_pool::OpenPool;
use super::*;
use std::collections::BTreeSet;
use std::time::Duration;
use syntable_model::length_unit::LengthUnit;
use syntable_model::scene::{
    AssetClass, Catalog, EnvironmentMap, MassOrigin, Material, Object, Scalar, Transmission, Volume,
};
use syntable_model::stage::AssetSource;
use syntable_recipe::{Mass, Scale};
use syntable_recipe::{Numbering, ObjectProperties, PoolOptions, Selection};
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

fn pool<'a>(source: &'a dyn AssetSource, options: &'a PoolOptions) -> OpenPool<'a> {
    let numbering = Some(Numbering::Places);
    let (selection, properties) = (Selection::default(), BTreeMap::new());
    let table = "assets.p";
    OpenPool { table, source, options, selection, numbering, last_obj_id: 0, resizes_numbered: false, properties }
}

/// An open pool with some of the objects of a source.
fn numbered<'a>(options: &'a PoolOptions, names: &[&str], stated: &[(&str, u32)]) -> OpenPool<'a> {
    let stated: BTreeMap<&str, u32> = stated.iter().copied().collect();
    let mut all: Vec<CatalogEntry> = names.iter().map(|name| CatalogEntry::new(*name, "thing")).collect();
    all.iter_mut().for_each(|entry| entry.obj_id = stated.get(entry.name.as_str()).copied());
    let numbering = options.number(&mut all, &Collected::default()).expect("sound");
    let last_obj_id = all.iter().filter_map(|entry| entry.obj_id).max().unwrap_or_default();
    let selection = options.select(all, &Collected::default()).expect("sound");
    OpenPool { selection, numbering: Some(numbering), last_obj_id, ..pool(&Nothing, options) }
}

fn ids(pools: &BTreeMap<&str, OpenPool>, pool: &str) -> Vec<u32> {
    pools[pool].selection.entries.iter().filter_map(|entry| entry.obj_id).collect()
}

#[test]
fn numbers_depend_on_what_pools_hold_and_not_on_what_is_taken() {
    let names = ["a", "b", "c", "d"];
    let all = PoolOptions::default();
    let some = PoolOptions { exclude: vec!["b".into()], ..PoolOptions::default() };
    let labeled = BTreeSet::from(["objects".to_owned(), "shoes".to_owned()]);
    for (options, objects, shoes) in [(&all, vec![1, 2, 3, 4], vec![5, 6, 7, 8]), (&some, vec![1, 3, 4], vec![5, 7, 8])]
    {
        // Pools without labels come last, even if their names sort first.
        let pool = || numbered(options, &names, &[]);
        let mut pools = BTreeMap::from([("desks", pool()), ("objects", pool()), ("shoes", pool())]);
        number_places(&mut pools, &labeled, &[]).expect("few");
        assert_eq!((ids(&pools, "objects"), ids(&pools, "shoes")), (objects, shoes));
        assert_eq!(ids(&pools, "desks")[0], 9);
        numbers_differ(&pools, &labeled, &[]).expect("all differ");
    }
    // Position-based numbers follow all stated numbers, selected or not.
    let stated = [("a", 3), ("b", 40), ("c", 2), ("d", 5)];
    let mut pools =
        BTreeMap::from([("objects", numbered(&all, &names, &[])), ("shoes", numbered(&some, &names, &stated))]);
    number_places(&mut pools, &labeled, &[]).expect("few");
    assert_eq!((ids(&pools, "objects"), ids(&pools, "shoes")), (vec![41, 42, 43, 44], vec![3, 2, 5]));
    numbers_differ(&pools, &labeled, &[]).expect("all differ");
    // Stated numbers stay, and the error for a clash names both objects.
    let shoes = OpenPool { table: "assets.shoes", ..numbered(&all, &names, &stated) };
    let mut pools = BTreeMap::from([("objects", numbered(&all, &names, &stated)), ("shoes", shoes)]);
    number_places(&mut pools, &labeled, &[]).expect("few");
    let error = numbers_differ(&pools, &labeled, &[]).expect_err("equal");
    assert!(error.to_string().contains("`objects/a` and `shoes/a` have the same `obj_id` 3"), "{error}");
    assert!(error.help_text().is_some_and(|help| help.contains("`first_id = 41` in [assets.shoes]")), "{error:?}");
    let twice = [("a", 1), ("b", 2), ("c", 1), ("d", 4)];
    let pools = BTreeMap::from([("objects", numbered(&all, &names, &twice))]);
    let error = numbers_differ(&pools, &labeled, &[]).expect_err("equal");
    assert!(error.to_string().contains("`objects/a` and `objects/c` have the same `obj_id` 1"), "{error}");
    assert!(error.help_text().is_some_and(|help| help.contains("first_id = 1")), "{error:?}");
    // The objects of placers have the numbers that they state.
    let own = |name: &str, obj_id| [("arm", CatalogEntry { obj_id, ..CatalogEntry::new(name, "") })];
    let mut pools = BTreeMap::from([("objects", numbered(&all, &names, &[]))]);
    number_places(&mut pools, &labeled, &own("gripper", Some(6))).expect("few");
    assert_eq!(ids(&pools, "objects"), [7, 8, 9, 10]);
    numbers_differ(&pools, &labeled, &own("gripper", Some(6))).expect("all differ");
    for (obj_id, says) in [(None, "`gripper` has no `obj_id`"), (Some(8), "`objects/b` and `gripper` have the same")] {
        let error = numbers_differ(&pools, &labeled, &own("gripper", obj_id)).expect_err("refused").to_string();
        assert!(error.contains(says) && error.contains("place.arm"), "{error}");
    }
    let twice = [own("gripper", Some(6)), own("gripper", Some(6))].concat();
    numbers_differ(&pools, &labeled, &twice).expect("one object, placed twice");
    // Objects of unlabeled pools need no distinct numbers.
    numbers_differ(&pools, &BTreeSet::new(), &[]).expect("no labels");
}

/// The object of 0.1 m by 0.2 m by 0.4 m and 0.2 kg, with the options of a pool applied.
fn weighed(origin: MassOrigin, options: &PoolOptions, properties: Option<ObjectProperties>) -> Object {
    let object = (*object("block", box_mesh([0.1, 0.2, 0.4]), [1.0; 3])).clone();
    let mass = object.mass.with_kg(0.2, origin);
    let properties = properties.map(|properties| ("block".to_owned(), properties)).into_iter().collect();
    let pool = OpenPool { properties, ..pool(&Nothing, options) };
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
        // An estimate uses the scaled size: 400 kg/m³.
        let guessed = weighed(MassOrigin::Estimated, &options, None);
        assert!((guessed.mass.kg - 400.0 * 0.001).abs() < 1e-6, "{:?}", guessed.mass);
        assert_eq!(guessed.mass.origin, MassOrigin::Estimated);
    }
}

#[test]
fn a_table_of_a_category_goes_after_the_table_of_a_name() {
    let object = (*object("block", box_mesh([0.1, 0.2, 0.4]), [1.0; 3])).clone();
    let category = ObjectProperties { mass_kg: Some(3.0), restitution: Some(0.4), ..ObjectProperties::default() };
    let name = ObjectProperties { density_kg_m3: Some(100.0), friction: Some(0.2), ..ObjectProperties::default() };
    let of = |named: &[(&str, ObjectProperties)]| {
        let properties = named.iter().map(|(key, properties)| ((*key).to_owned(), *properties)).collect();
        let options = PoolOptions::default();
        OpenPool { properties, ..pool(&Nothing, &options) }.normalize(object.clone()).expect("sound")
    };
    let both = of(&[(&object.category, category), ("block", name)]);
    assert!((both.mass.kg - 0.8).abs() < 1e-6, "its own density states the mass: {:?}", both.mass);
    assert_eq!((both.friction, both.restitution), (0.2, Some(0.4)));
    let one = of(&[(&object.category, category)]);
    assert!((one.mass.kg - 3.0).abs() < 1e-6 && one.restitution == Some(0.4));
    assert_ne!(one.digest, of(&[(&object.category, ObjectProperties { restitution: None, ..category })]).digest);
}

#[test]
fn a_table_states_mass_density_and_friction() {
    let dense = PoolOptions { mass: Some(Mass::DensityKgM3(1000.0)), ..PoolOptions::default() };
    let states = |mass_kg, density_kg_m3, friction| {
        Some(ObjectProperties { mass_kg, density_kg_m3, friction, restitution: None })
    };
    for (properties, kg, friction) in [
        (None, 8.0, 0.5),
        (states(Some(0.3), None, None), 0.3, 0.5),
        (states(None, Some(500.0), Some(0.9)), 4.0, 0.9),
        (states(None, None, Some(0.1)), 8.0, 0.1),
    ] {
        let found = weighed(MassOrigin::Estimated, &dense, properties);
        assert!((found.mass.kg - kg).abs() < 1e-6 && found.friction == friction, "{properties:?}: {:?}", found.mass);
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

/// A source with one material and one environment map.
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

/// A source whose reader panics, and which counts its calls.
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

/// A source with one block.
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
    let pool = OpenPool { selection, ..pool(&Block, &options) };
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

/// A source of long objects in an unknown unit. It loads slowly, counts its calls, and warns.
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
    // The cache is too small to keep anything.
    let pools = BTreeMap::from([("p", pool(&source, &options))]);
    let store = AssetStore { loaded: Arc::new(Loaded::within(1)), ..AssetStore::new(pools, OnBadAsset::Skip, &log) };
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

/// A log that samples the steps of work.
#[derive(Default)]
struct Sampled(Mutex<BTreeSet<Option<String>>>);

impl Log for Sampled {
    fn warn(&self, _: &Error) {}

    fn during(&self, steps: &Steps, work: &mut dyn FnMut()) {
        let done = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !done.load(std::sync::atomic::Ordering::SeqCst) {
                    self.0.lock().insert(steps.latest());
                    std::thread::sleep(Duration::from_millis(1));
                }
            });
            work();
            done.store(true, std::sync::atomic::Ordering::SeqCst);
        });
        assert_eq!(steps.latest(), None);
    }
}

#[test]
fn an_asset_is_named_with_its_number_while_it_is_loaded() {
    let (source, options, log) = (Long::default(), PoolOptions::default(), Sampled::default());
    let store = AssetStore::new(BTreeMap::from([("p", pool(&source, &options))]), OnBadAsset::Skip, &log);
    let names = BTreeMap::new();
    let assets = RecordingAssets::new(&store, &names);
    let get = |name: &str| drop(assets.get(&AssetRef { pool: "p".into(), name: name.into() }));
    assets.during(&log, || get("desk"));
    assets.during(&log, || {
        assets.expect(2);
        ["cup", "tin"].into_iter().for_each(get);
    });
    let steps: Vec<String> = log.0.into_inner().into_iter().flatten().collect();
    assert_eq!(steps, ["loading `p/cup` (1 of 2)", "loading `p/desk`", "loading `p/tin` (2 of 2)"]);
}

#[test]
fn an_object_in_the_wrong_unit_names_the_option_to_change() {
    let options = PoolOptions { units: Some(LengthUnit::Mm), ..PoolOptions::default() };
    let scan = object("scan", box_mesh([0.1, 0.05, 0.02]), [1.0; 3]);
    let error =
        pool(&Nothing, &options).normalize(std::sync::Arc::unwrap_or_clone(scan)).expect_err("a tenth of a millimeter");
    let help = error.help_text().expect("a remedy");
    assert_eq!(help, "`units = \"m\"` instead of `\"mm\"` makes it 10.0 cm", "{error}");
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
