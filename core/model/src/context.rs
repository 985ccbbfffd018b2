//! What the program lends to a stage for one call.
//!
//! Stages that compose a scene or sample a view get a [`Context`]; what follows gets a [`ViewContext`], a
//! [`SceneContext`] or a [`DatasetContext`], after how often it runs.

use crate::digest::Digest;
use crate::error::{Error, Result};
use crate::names::{EnvironmentPool, MaterialPool, ObjectPool};
use crate::random::Stream;
use crate::scene::{Asset, AssetRef, CatalogEntry, EnvironmentMap, Material, Object, Scene, View};
use crate::stage::DatasetInfo;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;
use std::sync::Arc;

/// What is lent to a stage that runs once per dataset.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct DatasetContext<'a> {
    /// The dataset.
    pub dataset: &'a DatasetInfo,
    /// Threads to spread work over.
    pub workers: &'a dyn Workers,
    /// Where warnings go.
    pub log: &'a dyn Log,
}

/// What is lent to a stage that runs once per scene, after the scene has settled.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct SceneContext<'a> {
    /// The dataset.
    pub dataset: &'a DatasetInfo,
    /// The scene.
    pub scene: &'a Scene,
    /// Threads to spread work over.
    pub workers: &'a dyn Workers,
    /// Where warnings go.
    pub log: &'a dyn Log,
}

/// What is lent to a stage that runs once per view.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct ViewContext<'a> {
    /// The dataset.
    pub dataset: &'a DatasetInfo,
    /// The scene.
    pub scene: &'a Scene,
    /// Camera, exposure and lights.
    pub view: &'a View,
    /// Threads to spread work over.
    pub workers: &'a dyn Workers,
    /// Where warnings go.
    pub log: &'a dyn Log,
}

impl<'a> DatasetContext<'a> {
    /// The context of a dataset.
    pub fn new(dataset: &'a DatasetInfo, workers: &'a dyn Workers, log: &'a dyn Log) -> Self {
        Self { dataset, workers, log }
    }

    /// The context of one of its scenes.
    pub fn scene(self, scene: &'a Scene) -> SceneContext<'a> {
        SceneContext { dataset: self.dataset, scene, workers: self.workers, log: self.log }
    }
}

impl<'a> SceneContext<'a> {
    /// The context of one of the scene's views.
    pub fn view(self, view: &'a View) -> ViewContext<'a> {
        ViewContext { dataset: self.dataset, scene: self.scene, view, workers: self.workers, log: self.log }
    }
}

impl<'a> ViewContext<'a> {
    /// The context of the view's scene.
    pub fn of_scene(self) -> SceneContext<'a> {
        SceneContext { dataset: self.dataset, scene: self.scene, workers: self.workers, log: self.log }
    }
}

/// What is lent to a stage that composes a scene or samples a view. There is no clock, no global and no environment.
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
    /// An asset. An error means that the asset is bad; it was reported.
    fn get(&self, asset: &AssetRef) -> Result<Asset>;
}

impl dyn Assets + '_ {
    /// Draws an object, uniformly over the entries of some pools taken together. A bad asset is passed over.
    pub fn draw_object(&self, pools: &[ObjectPool], stream: &mut Stream) -> Result<(AssetRef, Arc<Object>)> {
        let pools: Vec<&str> = pools.iter().map(ObjectPool::as_str).collect();
        self.draw(&pools, stream, Asset::into_object)
    }

    /// Draws a material, uniformly over the entries of a pool. A bad asset is passed over.
    pub fn draw_material(&self, pool: &MaterialPool, stream: &mut Stream) -> Result<(AssetRef, Arc<Material>)> {
        self.draw(&[pool.as_str()], stream, Asset::into_material)
    }

    /// Draws an environment map, uniformly over the entries of some pools taken together. A bad one is passed over.
    pub fn draw_environment(
        &self,
        pools: &[EnvironmentPool],
        stream: &mut Stream,
    ) -> Result<(AssetRef, Arc<EnvironmentMap>)> {
        let pools: Vec<&str> = pools.iter().map(EnvironmentPool::as_str).collect();
        self.draw(&pools, stream, Asset::into_environment)
    }

    fn draw<T>(&self, pools: &[&str], stream: &mut Stream, take: fn(Asset) -> Result<T>) -> Result<(AssetRef, T)> {
        let mut left: Vec<(&str, &CatalogEntry)> = Vec::new();
        for &pool in pools {
            left.extend(self.entries(pool)?.iter().map(|entry| (pool, entry)));
        }
        // Every bad asset is struck from this draw's list, so that the draw ends and depends on the stream alone.
        let mut last = None;
        while !left.is_empty() {
            let (pool, entry) = left.swap_remove(stream.below(left.len() as u64) as usize);
            let asset = AssetRef { pool: pool.to_owned(), name: entry.name.clone() };
            match self.get(&asset) {
                Ok(loaded) => {
                    let loaded = take(loaded).map_err(|error| error.context(format!("asset {asset}")))?;
                    return Ok((asset, loaded));
                }
                Err(error) => last = Some(error),
            }
        }
        let names = pools.join("`, `");
        Err(match last {
            Some(error) => error.context(format!("no asset of `{names}` can be used; the last one")),
            None => Error::new(format!("no asset in `{names}`")).help("check its root folder and its selection"),
        })
    }
}

/// Bytes kept between runs, by purpose and digest. A cache may forget; it never changes what it was given.
pub trait Cache: Send + Sync {
    /// What was put under this key, if it is still there.
    fn get(&self, purpose: &str, key: Digest) -> Option<Vec<u8>>;
    /// Keeps bytes. Failure is silent: the cache is a convenience.
    fn put(&self, purpose: &str, key: Digest, bytes: &[u8]);
}

/// Threads to spread work over. Results must not depend on their number.
pub trait Workers: Send + Sync {
    /// How many jobs may run at once.
    fn threads(&self) -> usize;
    /// Runs `job(0)`, …, `job(jobs - 1)`, in any order, and returns when all are done.
    fn run(&self, jobs: usize, job: &(dyn Fn(usize) + Sync));
}

/// Where warnings go.
pub trait Log: Send + Sync {
    /// Something is not as it should be, but work goes on.
    fn warn(&self, warning: &Error);
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

/// One job after the other, on the calling thread.
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

/// Maximum number of different warnings of one piece of work that are told; of more the number is.
const MAX_WARNINGS: usize = 16;

/// A log that collects its warnings.
#[derive(Debug, Default)]
pub struct Collected(std::sync::Mutex<Vec<Error>>);
impl Collected {
    /// The warnings so far.
    pub fn warnings(&self) -> Vec<Error> {
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).clone()
    }

    /// The warnings so far, each message of a file once, with how often it came, at its first place; after sixteen the
    /// number of the others.
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
        // Of 40 textures, 15 are told; the other 25 came 25 times each, and the other file's warning once.
        assert_eq!(merged[MAX_WARNINGS], "626 more warnings");
        assert!(Collected::default().merged().is_empty());
    }
}
