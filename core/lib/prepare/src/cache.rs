//! Caches of data that depend on a single asset, shared by all scenes and sessions of a renderer.

use crate::environment::EnvironmentDistribution;
use crate::mesh::ShadingMesh;
use crate::texture::MipTexture;
use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};
use std::sync::Arc;
use syntable_model::digest::Digest;
use syntable_model::scene::{EnvironmentMap, Object, Texture};

/// Capacity of the caches of meshes, textures and environment maps that no scene uses, bytes.
const CAPACITY: u64 = 256 << 20;

/// Values by the digest of their asset, with a limit on the total size.
///
/// If several threads request a value, one computes it and the others wait. A value larger than the limit is returned,
/// but not kept.
pub struct AssetCache<T: Send + Sync>(Cache<Digest, (Arc<T>, u64), ByteWeigher>);

impl<T: Send + Sync> AssetCache<T> {
    /// Keeps up to `capacity` bytes.
    pub fn new(capacity: u64) -> Self {
        let options = OptionsBuilder::new()
            .estimated_items_capacity(1024)
            .weight_capacity(capacity)
            // The limit is divided among the shards, and only a single shard can keep large values.
            .shards(1)
            .build()
            .expect("all options are set");
        Self(Cache::with_options(options, ByteWeigher, DefaultHashBuilder::default(), DefaultLifecycle::default()))
    }

    /// The value of a digest, computed by `make` if it is missing. `size` returns its size, bytes.
    pub fn get(&self, digest: Digest, make: impl FnOnce() -> T, size: impl FnOnce(&T) -> usize) -> Arc<T> {
        let made = self.0.get_or_insert_with(&digest, || {
            let value = make();
            let bytes = size(&value) as u64;
            Ok::<_, std::convert::Infallible>((Arc::new(value), bytes))
        });
        match made {
            Ok((value, _)) => value,
            Err(never) => match never {},
        }
    }
}

/// Weighs values by their bytes.
#[derive(Clone)]
struct ByteWeigher;

impl<T> Weighter<Digest, (Arc<T>, u64)> for ByteWeigher {
    fn weight(&self, _: &Digest, (_, bytes): &(Arc<T>, u64)) -> u64 {
        // Values of weight 0 would never be evicted.
        (*bytes).max(1)
    }
}

/// The caches of a renderer, shared by its sessions.
pub struct SceneCache {
    meshes: AssetCache<ShadingMesh>,
    textures: AssetCache<MipTexture>,
    environments: AssetCache<EnvironmentDistribution>,
}

impl Default for SceneCache {
    fn default() -> Self {
        Self {
            meshes: AssetCache::new(CAPACITY),
            textures: AssetCache::new(CAPACITY),
            environments: AssetCache::new(CAPACITY),
        }
    }
}

impl SceneCache {
    /// The light distribution of an environment map.
    pub fn environment(&self, map: &Arc<EnvironmentMap>) -> Arc<EnvironmentDistribution> {
        self.environments.get(map.digest, || EnvironmentDistribution::new(map), EnvironmentDistribution::size)
    }

    /// The shading mesh of an object.
    pub fn mesh(&self, object: &Object) -> Arc<ShadingMesh> {
        self.meshes.get(object.digest, || ShadingMesh::new(&object.mesh), ShadingMesh::size)
    }

    /// A texture with its mip levels.
    pub fn texture(&self, texture: &Arc<Texture>) -> Arc<MipTexture> {
        self.textures.get(texture.digest, || MipTexture::new(texture), MipTexture::size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LightTable;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use syntable_model::geometry::{Point3, Vector3};
    use syntable_model::scene::{EnvironmentLight, Light, WindowLight};

    #[test]
    fn values_are_made_once_for_all_threads() {
        let (cache, made) = (AssetCache::new(100), AtomicUsize::new(0));
        let get = || {
            let make = || {
                std::thread::sleep(std::time::Duration::from_millis(30));
                made.fetch_add(1, Ordering::Relaxed)
            };
            *cache.get(Digest::of(b"a"), make, |_| 4)
        };
        std::thread::scope(|scope| {
            let threads: Vec<_> = (0..4).map(|_| scope.spawn(get)).collect();
            threads.into_iter().for_each(|thread| assert_eq!(thread.join().expect("no panic"), 0));
        });
        assert_eq!((get(), made.into_inner()), (0, 1));
    }

    #[test]
    fn only_environments_that_are_sampled_get_tables() {
        let map = |bright: f32| {
            let texels = vec![[bright; 3], [0.0; 3], [1.0; 3], [0.0; 3]];
            Arc::new(EnvironmentMap::new("two rows", 2, 2, texels).expect("sound"))
        };
        let placed = |map: &Arc<EnvironmentMap>| EnvironmentLight { map: map.clone(), scale: [3.0; 3], rotation: 0.0 };
        let (behind, around) = (map(7.0), map(3.0));
        let window = WindowLight {
            center: Point3::origin(),
            half_u: Vector3::x(),
            half_v: Vector3::y(),
            view: placed(&behind),
            panes: [1, 1],
            frame_m: 0.0,
            bar_m: 0.0,
            frame_radiance: [0.0; 3],
        };
        let cache = SceneCache::default();
        let lights = [Light::Window(window), Light::Environment(placed(&around))];
        let table = LightTable::new(&lights, &cache).expect("sound");
        let is_kept = |map: &EnvironmentMap| cache.environments.0.peek(&map.digest).is_some();
        assert_eq!((is_kept(&around), is_kept(&behind)), (true, false));
        // A map of two rows has equal solid angles, so the mean equals the mean of the texels: 3 (7 + 0 + 1 + 0) / 4.
        let radiance = table.area[0].radiance();
        assert!((radiance.x - 6.0).abs() < 1e-5 && radiance.x == radiance.z, "{radiance:?}");
    }

    #[test]
    fn the_limit_holds_and_large_values_are_handed_out() {
        let cache = AssetCache::new(10);
        for name in 0..100_u8 {
            assert_eq!(*cache.get(Digest::of(&[name]), || name, |_| 4), name);
        }
        let kept = (0..100_u8).filter(|name| cache.0.peek(&Digest::of(&[*name])).is_some()).count();
        assert!((1..=2).contains(&kept), "{kept} values of 4 bytes in 10");
        assert_eq!(*cache.get(Digest::of(b"large"), || 7, |_| 1000), 7);
        assert!(cache.0.peek(&Digest::of(b"large")).is_none());
    }
}
