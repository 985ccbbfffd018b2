//! Contexts: the data and services that the program passes to a stage for one call.
//!
//! Stages that compose a scene or sample a view get a [`Context`]. Later stages get a context of their input:
//!
//! | | of a scene that the program made | of any dataset |
//! |---|---|---|
//! | each view | [`ViewContext`] | [`ImageContext`] |
//! | each moment | [`FrameContext`] | |
//! | each scene | [`SceneContext`] | [`ImagesContext`] |
//! | the dataset | | [`DatasetContext`] |
//!
//! A stage that takes a context of the right column also serves datasets that were read, in conversions for instance. A
//! context of the left column dereferences to its neighbor in the right column.

use crate::digest::Digest;
use crate::error::{Error, Result};
use crate::left_out::LeftOut;
use crate::names::PoolName;
use crate::pools::{EnvironmentPools, MaterialPools, ObjectPools, Pools};
use crate::random::Stream;
use crate::scene::{
    Asset, AssetRef, CatalogEntry, EnvironmentMap, Material, Moment, Object, Scene, SceneId, View, ViewId,
};
use crate::stage::DatasetInfo;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::ops::Deref;
use std::path::Path;
use std::sync::Arc;

/// Context of a stage that runs once per dataset.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct DatasetContext<'a> {
    /// The dataset.
    pub dataset: &'a DatasetInfo,
    /// Results that are costly to compute, kept between runs.
    pub cache: &'a dyn Cache,
    /// Threads to spread work over.
    pub workers: &'a dyn Workers,
    /// Where warnings go.
    pub log: &'a dyn Log,
}

/// Context of a stage that works on the images of one scene, which the program made or read from a dataset. It has the
/// number of the scene, but not its bodies.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct ImagesContext<'a> {
    /// The dataset.
    pub dataset: &'a DatasetInfo,
    /// Number of the scene in the dataset.
    pub scene_id: SceneId,
    /// Results that are costly to compute, kept between runs.
    pub cache: &'a dyn Cache,
    /// Threads to spread work over.
    pub workers: &'a dyn Workers,
    /// Where warnings go.
    pub log: &'a dyn Log,
}

/// Context of a stage that runs once per scene, after the scene has settled.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct SceneContext<'a> {
    images: ImagesContext<'a>,
    /// Bodies, materials and surroundings.
    pub scene: &'a Scene,
}

/// Context of a stage that runs once per moment of a scene that the program made.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct FrameContext<'a> {
    images: ImagesContext<'a>,
    /// Bodies at the moment, materials and surroundings.
    pub scene: &'a Scene,
    /// The moment of the views that share the products.
    pub moment: Moment,
}

/// Context of a stage that processes one image, rendered or read from a dataset.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct ImageContext<'a> {
    /// The dataset.
    pub dataset: &'a DatasetInfo,
    /// Number of the scene in the dataset.
    pub scene_id: SceneId,
    /// Number of the view in the scene.
    pub view_id: ViewId,
    /// Width and height of the image, px.
    pub size: [u32; 2],
    /// Results that are costly to compute, kept between runs.
    pub cache: &'a dyn Cache,
    /// Threads to spread work over.
    pub workers: &'a dyn Workers,
    /// Where warnings go.
    pub log: &'a dyn Log,
}

/// Context of a stage that processes one view of a scene that the program made.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct ViewContext<'a> {
    image: ImageContext<'a>,
    /// Bodies, materials and surroundings.
    pub scene: &'a Scene,
    /// Camera, exposure and lights.
    pub view: &'a View,
    /// The next view of the scene; none for the last view.
    pub next: Option<&'a View>,
}

impl<'a> DatasetContext<'a> {
    /// The context of a dataset.
    pub fn new(dataset: &'a DatasetInfo, workers: &'a dyn Workers, log: &'a dyn Log) -> Self {
        Self { dataset, cache: &NoCache, workers, log }
    }

    /// The same with a cache.
    pub fn with_cache(self, cache: &'a dyn Cache) -> Self {
        Self { cache, ..self }
    }

    /// The context of the images of a scene.
    pub fn images(self, scene_id: SceneId) -> ImagesContext<'a> {
        let Self { dataset, cache, workers, log } = self;
        ImagesContext { dataset, scene_id, cache, workers, log }
    }

    /// The context of a scene.
    pub fn scene(self, scene: &'a Scene) -> SceneContext<'a> {
        SceneContext { images: self.images(scene.id), scene }
    }
}

impl<'a> ImagesContext<'a> {
    /// The context of one of the images, `size` pixels wide and high.
    pub fn image(self, view_id: ViewId, size: [u32; 2]) -> ImageContext<'a> {
        let Self { dataset, scene_id, cache, workers, log } = self;
        ImageContext { dataset, scene_id, view_id, size, cache, workers, log }
    }

    /// The same with another log.
    pub fn with_log(self, log: &'a dyn Log) -> Self {
        Self { log, ..self }
    }
}

impl<'a> SceneContext<'a> {
    /// The context of a view of the scene, without a next view; see [`ViewContext::before`].
    pub fn view(self, view: &'a View) -> ViewContext<'a> {
        let k = &view.camera.intrinsics;
        ViewContext { image: self.images.image(view.id, [k.width, k.height]), scene: self.scene, view, next: None }
    }

    /// The context of a moment. The scene must be [at](Scene::at) this moment.
    pub fn frame(self, moment: Moment) -> FrameContext<'a> {
        FrameContext { images: self.images, scene: self.scene, moment }
    }

    /// The same with another log.
    pub fn with_log(self, log: &'a dyn Log) -> Self {
        Self { images: self.images.with_log(log), ..self }
    }
}

impl<'a> Deref for SceneContext<'a> {
    type Target = ImagesContext<'a>;

    fn deref(&self) -> &ImagesContext<'a> {
        &self.images
    }
}

impl<'a> FrameContext<'a> {
    /// The same with another log.
    pub fn with_log(self, log: &'a dyn Log) -> Self {
        Self { images: self.images.with_log(log), ..self }
    }
}

impl<'a> Deref for FrameContext<'a> {
    type Target = ImagesContext<'a>;

    fn deref(&self) -> &ImagesContext<'a> {
        &self.images
    }
}

impl<'a> ImageContext<'a> {
    /// The context of the images of the scene.
    pub fn of_images(self) -> ImagesContext<'a> {
        let Self { dataset, scene_id, cache, workers, log, .. } = self;
        ImagesContext { dataset, scene_id, cache, workers, log }
    }

    /// The same with another log.
    pub fn with_log(self, log: &'a dyn Log) -> Self {
        Self { log, ..self }
    }
}

impl<'a> ViewContext<'a> {
    /// The same with the next view.
    pub fn before(self, next: Option<&'a View>) -> Self {
        Self { next, ..self }
    }

    /// The context of the view's scene.
    pub fn of_scene(self) -> SceneContext<'a> {
        SceneContext { images: self.image.of_images(), scene: self.scene }
    }

    /// The same with another log.
    pub fn with_log(self, log: &'a dyn Log) -> Self {
        Self { image: self.image.with_log(log), ..self }
    }
}

impl<'a> Deref for ViewContext<'a> {
    type Target = ImageContext<'a>;

    fn deref(&self) -> &ImageContext<'a> {
        &self.image
    }
}

/// Context of a stage that composes a scene or samples a view. It gives no access to a clock, to global state or to the
/// environment.
pub struct Context<'a> {
    /// Random numbers of this stage, scene, view and attempt. Clone it, or derive children.
    pub stream: Stream,
    /// The pools of the recipe.
    pub assets: &'a dyn Assets,
    /// Results that are costly to compute, kept between runs.
    pub cache: &'a dyn Cache,
    /// Threads to spread work over.
    pub workers: &'a dyn Workers,
    /// Where warnings go.
    pub log: &'a dyn Log,
}

/// Pools of assets: loaded lazily, cached and shared.
pub trait Assets: Send + Sync {
    /// The entries of a pool, sorted by name.
    fn entries(&self, pool: &str) -> Result<&[CatalogEntry]>;
    /// Name of a pool in asset names. In a mixture of recipes, it can differ from the name that the recipe's options use.
    fn pool_name<'p>(&'p self, pool: &'p str) -> &'p str {
        pool
    }
    /// Loads an asset. An error means that the asset is bad; the error has been reported.
    fn get(&self, asset: &AssetRef) -> Result<Asset>;
    /// States how many assets the stage is about to load, for messages about progress. By default, this does nothing.
    fn expect(&self, count: usize) {
        let _ = count;
    }
}

impl dyn Assets + '_ {
    /// Draws an object. Skips bad assets.
    pub fn draw_object(&self, pools: &ObjectPools, stream: &mut Stream) -> Result<(AssetRef, Arc<Object>)> {
        self.draw(pools, stream, Asset::into_object)
    }

    /// Draws a material. Skips bad assets.
    pub fn draw_material(&self, pools: &MaterialPools, stream: &mut Stream) -> Result<(AssetRef, Arc<Material>)> {
        self.draw(pools, stream, Asset::into_material)
    }

    /// Draws an environment map. Skips bad maps.
    pub fn draw_environment(
        &self,
        pools: &EnvironmentPools,
        stream: &mut Stream,
    ) -> Result<(AssetRef, Arc<EnvironmentMap>)> {
        self.draw(pools, stream, Asset::into_environment)
    }

    /// All assets of some pools in the order in which they are drawn without replacement, good or bad.
    pub fn drawn_order<P: PoolName>(&self, pools: &Pools<P>, stream: &mut Stream) -> Result<Vec<AssetRef>> {
        let mut left = Undrawn::of(self, pools)?;
        if let [(_, only)] = left.groups.as_mut_slice() {
            stream.shuffle(only);
            return Ok(only.iter().map(|(pool, entry)| asset_ref(pool, entry)).collect());
        }
        Ok(std::iter::from_fn(|| left.draw(stream)).collect())
    }

    fn draw<P: PoolName, T>(
        &self,
        pools: &Pools<P>,
        stream: &mut Stream,
        take: fn(Asset) -> Result<T>,
    ) -> Result<(AssetRef, T)> {
        // Each bad asset is removed from the list of this draw, so that the draw ends and depends only on the stream.
        let mut left = Undrawn::of(self, pools)?;
        let mut last = None;
        while let Some(asset) = left.draw(stream) {
            match self.get(&asset) {
                Ok(loaded) => {
                    let loaded = take(loaded).map_err(|error| error.context(format!("asset {asset}")))?;
                    return Ok((asset, loaded));
                }
                Err(error) => last = Some(error),
            }
        }
        let names = pools.names().join("`, `");
        Err(match last {
            Some(error) => error.context(format!("no asset of `{names}` can be used; the last one")),
            None => Error::new(format!("no asset in `{names}`")).help("check its root folder and its selection"),
        })
    }
}

/// Entries of pools that are not drawn yet, in groups with weights.
struct Undrawn<'a> {
    groups: Vec<(f64, Vec<(&'a str, &'a CatalogEntry)>)>,
}

impl<'a> Undrawn<'a> {
    fn of<P: PoolName>(assets: &'a (dyn Assets + '_), pools: &'a Pools<P>) -> Result<Self> {
        let group = |(weight, pools): (f64, Vec<&'a str>)| {
            let mut group = Vec::new();
            for pool in pools {
                let name = assets.pool_name(pool);
                group.extend(assets.entries(pool)?.iter().map(|entry| (name, entry)));
            }
            Ok((weight, group))
        };
        Ok(Self { groups: pools.groups().into_iter().map(group).collect::<Result<_>>()? })
    }

    /// Draws a group in proportion to its weight, then an entry uniformly within it. A single group takes no random number
    /// of its own.
    fn draw(&mut self, stream: &mut Stream) -> Option<AssetRef> {
        self.groups.retain(|(_, group)| !group.is_empty());
        let last = self.groups.len().checked_sub(1)?;
        let mut chosen = last;
        if last > 0 {
            chosen = stream.pick_by_weight(self.groups.iter().map(|(weight, _)| *weight)).unwrap_or(last);
        }
        let group = &mut self.groups[chosen].1;
        let (pool, entry) = group.swap_remove(stream.below(group.len() as u64) as usize);
        Some(asset_ref(pool, entry))
    }
}

fn asset_ref(pool: &str, entry: &CatalogEntry) -> AssetRef {
    AssetRef { pool: pool.to_owned(), name: entry.name.clone() }
}

/// Bytes kept between runs, by purpose and digest. A cache may drop entries, but never changes their bytes.
pub trait Cache: Send + Sync {
    /// The bytes stored under this key, if the cache still has them.
    fn get(&self, purpose: &str, key: Digest) -> Option<Vec<u8>>;
    /// Stores bytes. Failures are silent, because the cache is only a convenience.
    fn put(&self, purpose: &str, key: Digest, bytes: &[u8]);
}

/// Threads to spread work over. Results must not depend on their number.
pub trait Workers: Send + Sync {
    /// How many jobs may run at once.
    fn threads(&self) -> usize;
    /// Runs `job(0)`, …, `job(jobs - 1)`, in any order, and returns when all are done.
    fn run(&self, jobs: usize, job: &(dyn Fn(usize) + Sync));
    /// Unwinds if the work was asked to stop, so that no stage has to pass on an unfinished result. Loops that take
    /// longer than a tenth of a second call it, inside jobs or outside. [`run`](Self::run) calls it itself. By default,
    /// nothing stops the work.
    fn check_stop(&self) {}
}

/// Where warnings go.
pub trait Log: Send + Sync {
    /// Reports a problem that does not stop the work.
    fn warn(&self, warning: &Error);

    /// Reports that a stage leaves something out of an image. Verbs sum up these reports and end with exit code 3.
    fn left_out(&self, left_out: &LeftOut) {
        if left_out.count > 0 {
            let warning = Error::new(left_out.to_string());
            self.warn(&left_out.help.iter().fold(warning, |warning, help| warning.help(help.as_ref())));
        }
    }

    /// Calls `work` once. If it takes longer than a second, the log may show the current step to the user; by default,
    /// it does not.
    fn during(&self, steps: &Steps, work: &mut dyn FnMut()) {
        let _ = steps;
        work();
    }
}

/// The steps of long work, for users who wait. Results must not depend on them.
#[derive(Debug, Default)]
pub struct Steps(std::sync::Mutex<Option<String>>);

impl Steps {
    /// Begins a step, named by the operation and its object, such as "decomposing `mug` into convex parts (3 of 12)".
    pub fn begin(&self, step: String) {
        *self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = Some(step);
    }

    /// Ends the latest step.
    pub fn end(&self) {
        *self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = None;
    }

    /// The latest step; none before the first and after an end.
    pub fn latest(&self) -> Option<String> {
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).clone()
    }
}

/// A cache that keeps nothing.
#[derive(Debug, Default, Clone, Copy)]
pub struct NoCache;
impl Cache for NoCache {
    fn get(&self, _: &str, _: Digest) -> Option<Vec<u8>> {
        None
    }
    fn put(&self, _: &str, _: Digest, _: &[u8]) {}
}

/// Runs one job after another, on the calling thread.
#[derive(Debug, Default, Clone, Copy)]
pub struct Serial;
impl Workers for Serial {
    fn threads(&self) -> usize {
        1
    }
    fn run(&self, jobs: usize, job: &(dyn Fn(usize) + Sync)) {
        (0..jobs).for_each(job);
    }
}

/// Maximum number of different warnings of one piece of work that are listed. The others are only counted.
const MAX_WARNINGS: usize = 16;

/// A log that collects its warnings.
#[derive(Debug, Default)]
pub struct Collected(std::sync::Mutex<Vec<Error>>);
impl Collected {
    /// The warnings so far.
    pub fn warnings(&self) -> Vec<Error> {
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).clone()
    }

    /// The warnings so far. Repeats of a message about the same file are merged at the first place, with their number.
    /// After sixteen different warnings, only the number of the others follows.
    pub fn merged(&self) -> Vec<Error> {
        let all = self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let mut known: BTreeMap<(Option<&Path>, &str), usize> = BTreeMap::new();
        let mut merged: Vec<(&Error, usize)> = Vec::new();
        let mut others = 0;
        for warning in all.iter() {
            match known.entry((warning.file(), warning.message())) {
                Entry::Occupied(at) => merged[*at.get()].1 += 1,
                Entry::Vacant(entry) if merged.len() < MAX_WARNINGS => {
                    entry.insert(merged.len());
                    merged.push((warning, 1));
                }
                Entry::Vacant(_) => others += 1,
            }
        }
        let told = |(warning, count): (&Error, usize)| match count {
            1 => warning.clone(),
            count => warning.clone().said(count),
        };
        let more = (others > 0).then(|| Error::new(format!("{others} more warnings")));
        merged.into_iter().map(told).chain(more).collect()
    }
}
impl Log for Collected {
    fn warn(&self, warning: &Error) {
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).push(warning.clone());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::names::MaterialPool;
    use std::collections::BTreeMap;

    /// Pools of materials named by number; materials with other names are bad.
    struct Numbers(BTreeMap<&'static str, Vec<CatalogEntry>>);

    impl Numbers {
        fn new(pools: &[(&'static str, std::ops::Range<u32>)]) -> Self {
            let entry = |name: String| CatalogEntry::new(name, "");
            let pool = |range: &std::ops::Range<u32>| range.clone().map(|i| entry(format!("{i:03}"))).collect();
            let mut all: BTreeMap<_, Vec<CatalogEntry>> =
                pools.iter().map(|(name, range)| (*name, pool(range))).collect();
            all.insert("broken", vec![entry("x".into()), entry("y".into())]);
            all.insert("empty", Vec::new());
            Self(all)
        }

        fn draw(&self, pools: &MaterialPools, stream: &mut Stream) -> Result<AssetRef> {
            let assets: &dyn Assets = self;
            assets.draw_material(pools, stream).map(|(asset, _)| asset)
        }
    }

    impl Assets for Numbers {
        fn entries(&self, pool: &str) -> Result<&[CatalogEntry]> {
            self.0.get(pool).map(Vec::as_slice).ok_or_else(|| Error::new(format!("unknown pool `{pool}`")))
        }
        fn get(&self, asset: &AssetRef) -> Result<Asset> {
            match asset.name.parse::<u32>() {
                Ok(_) => Ok(Material::plain(&asset.name, [0.5; 3], 0.5).into()),
                Err(_) => Err(Error::new("bad")),
            }
        }
    }

    fn weights(weights: &[(&str, f64)]) -> MaterialPools {
        Pools::weighted(weights.iter().map(|(pool, weight)| (MaterialPool::from(*pool), *weight))).expect("weights")
    }

    #[test]
    fn a_pool_is_drawn_by_weight_and_an_asset_uniformly_within_it() {
        let assets = Numbers::new(&[("few", 0..3), ("many", 100..140), ("never", 0..9)]);
        let pools = weights(&[("many", 1.0), ("few", 3.0), ("never", 0.0), ("broken", 0.5)]);
        let (mut stream, mut counts) = (Stream::root(8), BTreeMap::<String, u32>::new());
        let draws = 40_000;
        for _ in 0..draws {
            *counts.entry(assets.draw(&pools, &mut stream).expect("drawn").to_string()).or_default() += 1;
        }
        assert_eq!(counts.len(), 43, "all of both pools, nothing of the one without weight");
        // A bad asset is drawn again, so the pools keep their ratio of 3 to 1. χ² with 42 degrees of freedom: 88 is the
        // 5e-5 tail.
        let expected = |name: &str| f64::from(draws) * if name.starts_with("few") { 0.75 / 3.0 } else { 0.25 / 40.0 };
        let chi2: f64 = counts.iter().map(|(name, &n)| (f64::from(n) - expected(name)).powi(2) / expected(name)).sum();
        assert!(chi2 < 88.0, "{chi2}");
    }

    #[test]
    fn a_list_is_uniform_over_all_entries_and_keeps_its_random_numbers() {
        let assets = Numbers::new(&[("a", 0..4), ("b", 10..17)]);
        let all: Vec<String> =
            (0..4).map(|i| format!("a/{i:03}")).chain((10..17).map(|i| format!("b/{i:03}"))).collect();
        let list = MaterialPools::from(vec![MaterialPool::from("a"), "b".into()]);
        for seed in 0..40 {
            let mut stream = Stream::root(seed);
            let mut same = stream.clone();
            let drawn = assets.draw(&list, &mut stream).expect("drawn").to_string();
            assert_eq!(drawn, all[same.below(11) as usize]);
            assert_eq!(stream, same, "one number per draw");
            let single = assets.draw(&"b".into(), &mut Stream::root(seed)).expect("drawn");
            assert_eq!(single, assets.draw(&weights(&[("b", 0.2)]), &mut Stream::root(seed)).expect("drawn"));

            let order = |pools: &MaterialPools| -> Vec<String> {
                let assets: &dyn Assets = &assets;
                let order = assets.drawn_order(pools, &mut Stream::root(seed)).expect("there");
                order.iter().map(AssetRef::to_string).collect()
            };
            let mut shuffled = all.clone();
            Stream::root(seed).shuffle(&mut shuffled);
            assert_eq!(order(&list), shuffled);
            let mut weighted = order(&weights(&[("a", 1e-6), ("b", 1.0)]));
            assert!(weighted[..7].iter().all(|name| name.starts_with('b')), "{weighted:?}");
            weighted.sort();
            assert_eq!(weighted, all, "each once");
        }
    }

    #[test]
    fn pools_that_give_nothing_are_named() {
        let assets = Numbers::new(&[("a", 0..4)]);
        let error = |pools: &MaterialPools| assets.draw(pools, &mut Stream::root(1)).expect_err("nothing").to_string();
        assert_eq!(
            error(&weights(&[("broken", 1.0), ("empty", 2.0)])),
            "no asset of `broken`, `empty` can be used; the last one: bad"
        );
        assert!(error(&"empty".into()).starts_with("no asset in `empty`"));
        assert!(error(&weights(&[("gone", 1.0), ("a", 1.0)])).starts_with("unknown pool `gone`"));
    }

    #[test]
    fn repeated_warnings_are_counted() {
        let log = Collected::default();
        for line in 1..=1000 {
            log.warn(&Error::new("no such material").in_file("a.obj").at_line(line));
            log.warn(&Error::new(format!("no texture {}", line % 40)).in_file("a.obj"));
        }
        log.warn(&Error::new("no such material").in_file("b.obj"));
        let merged: Vec<String> = log.merged().iter().map(ToString::to_string).collect();
        assert_eq!(merged.len(), MAX_WARNINGS + 1, "{merged:?}");
        assert_eq!(merged[0], "a.obj:1: no such material (1000 times)");
        assert_eq!(merged[1], "a.obj: no texture 1 (25 times)");
        // Of 40 textures, 15 are listed. The other 25 warned 25 times each, and the other file warned once.
        assert_eq!(merged[MAX_WARNINGS], "626 more warnings");
        assert!(Collected::default().merged().is_empty());
    }
}
