//! Baked materials that several objects use.

use super::MaterialFamily;
use quick_cache::sync::Cache;
use std::sync::Arc;
use syntable_model::random::Stream;
use syntable_model::scene::Material;

/// Number of materials that are kept: more than families times the variants that objects and tables use.
const CAPACITY: usize = 512;

/// Variants of the material families, each baked at first use. A variant depends on the stream, its family and its
/// number alone, so the order of requests and evictions do not show.
pub struct MaterialCache {
    stream: Stream,
    size: usize,
    materials: Cache<(MaterialFamily, u32), Arc<Material>>,
}

impl MaterialCache {
    /// A cache of variants with textures of `size` × `size` texels.
    pub fn new(stream: Stream, size: usize) -> Self {
        Self { stream, size, materials: Cache::new(CAPACITY) }
    }

    /// A variant of a family. Concurrent requests for the same variant wait for one bake.
    pub fn get(&self, family: MaterialFamily, variant: u32) -> Arc<Material> {
        let bake = || {
            let stream = self.stream.child(family.name()).at(u64::from(variant));
            Ok(Arc::new(family.bake(&stream, self.size, &format!("{}_{variant:04}", family.name()))))
        };
        match self.materials.get_or_insert_with::<_, std::convert::Infallible>(&(family, variant), bake) {
            Ok(material) => material,
            Err(never) => match never {},
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn concurrent_requests_share_one_bake() {
        let cache = MaterialCache::new(Stream::root(1), 64);
        let materials: Vec<Arc<Material>> = std::thread::scope(|scope| {
            let request = |_| scope.spawn(|| cache.get(MaterialFamily::Wood, 3));
            let threads: Vec<_> = (0..8).map(request).collect();
            threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
        });
        assert!(materials.iter().all(|material| Arc::ptr_eq(material, &materials[0])));
        assert!(!Arc::ptr_eq(&cache.get(MaterialFamily::Wood, 4), &materials[0]));
    }
}
