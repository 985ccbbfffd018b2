//! Collision shapes by object: made once, kept in memory for as long as there is room, and on disk by mesh digest.

use crate::codec;
use crate::config::{Collision, Rapier};
use crate::decompose::{Method, convex_parts};
use crate::hull::{self, Hull};
use crate::shape::CollisionShape;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock};
use syntable_model::context::{Cache, Workers};
use syntable_model::digest::{Digest, Hasher};
use syntable_model::error::Result;
use syntable_model::scene::{Mesh, Object};

/// Version of parry3d, whose decomposition the cached parts come from; a test compares it with the lock file.
const PARRY: &str = "0.31.1";

/// Raised when anything in this crate changes the parts of a mesh.
const FORMAT: f64 = 1.0;

/// Shapes kept in memory.
const CAPACITY: usize = 512;

type Slot = Arc<OnceLock<Result<Arc<CollisionShape>>>>;

/// Makes and keeps collision shapes.
pub struct Library {
    collision: Collision,
    method: Method,
    kept: Mutex<Kept>,
}

#[derive(Default)]
struct Kept {
    slots: BTreeMap<Digest, (u64, Slot)>,
    clock: u64,
}

impl Library {
    /// An empty library for some options.
    pub fn new(config: &Rapier) -> Self {
        let method = match config.collision {
            Collision::ConvexHull => Method::Hull,
            Collision::Decomposition => Method::Decomposition {
                resolution: config.resolution,
                concavity: config.concavity as f32,
                max_parts: config.max_parts,
            },
        };
        Self { collision: config.collision, method, kept: Mutex::default() }
    }

    /// The shapes of some objects, in their order. What is missing is made on as many threads as there are.
    pub fn shapes(
        &self,
        objects: &[&Object],
        cache: &dyn Cache,
        workers: &dyn Workers,
    ) -> Vec<Result<Arc<CollisionShape>>> {
        let slots: Vec<Slot> = objects.iter().map(|object| self.slot(object)).collect();
        workers.run(objects.len(), &|i| {
            slots[i].get_or_init(|| self.make(objects[i], cache));
        });
        slots.iter().zip(objects).map(|(slot, object)| slot.get_or_init(|| self.make(object, cache)).clone()).collect()
    }

    fn slot(&self, object: &Object) -> Slot {
        let bounds = object.mesh.bounds();
        let key = bounds
            .min
            .iter()
            .chain(bounds.max.iter())
            .fold(Hasher::new("collision shape").digest(object.digest), |hasher, x| hasher.number(*x))
            .number(object.mesh.data().positions.len() as f64)
            .number(object.collision.as_ref().map_or(-1.0, |parts| parts.len() as f64))
            .finish();
        let mut kept = self.kept.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        kept.clock += 1;
        let now = kept.clock;
        let slot = {
            let (used, slot) = kept.slots.entry(key).or_default();
            *used = now;
            slot.clone()
        };
        while kept.slots.len() > CAPACITY {
            let oldest = kept.slots.iter().min_by_key(|(_, (used, _))| *used).map(|(key, _)| *key);
            oldest.and_then(|key| kept.slots.remove(&key));
        }
        slot
    }

    fn make(&self, object: &Object, cache: &dyn Cache) -> Result<Arc<CollisionShape>> {
        let brought = match (self.collision, &object.collision) {
            (Collision::Decomposition, Some(parts)) => parts.iter().filter_map(|part| Hull::around(part)).collect(),
            _ => Vec::new(),
        };
        let parts = if brought.is_empty() { self.cached_parts(&object.mesh, cache) } else { brought };
        CollisionShape::new(&parts).map(Arc::new)
    }

    fn cached_parts(&self, mesh: &Mesh, cache: &dyn Cache) -> Vec<Hull> {
        let key = self.key(mesh);
        // Parts from the cache and fresh ones are the same to the bit, since both have gone through the codec.
        cache.get("convex-parts", key).and_then(|bytes| codec::decode(&bytes)).unwrap_or_else(|| {
            let parts = convex_parts(mesh, self.method);
            let bytes = codec::encode(&parts);
            let parts = codec::decode(&bytes).unwrap_or(parts);
            cache.put("convex-parts", key, &bytes);
            parts
        })
    }

    fn key(&self, mesh: &Mesh) -> Digest {
        let data = mesh.data();
        let hasher = Hasher::new("convex parts").text(PARRY).number(FORMAT);
        let hasher = match self.method {
            Method::Hull => hasher.text("hull"),
            Method::Decomposition { resolution, concavity, max_parts } => hasher
                .text("decomposition")
                .number(f64::from(resolution))
                .number(f64::from(concavity))
                .number(f64::from(max_parts)),
        };
        let positions: Vec<f32> = data.positions.iter().flatten().copied().collect();
        let triangles: Vec<u8> = data.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
        hasher
            .number(f64::from(hull::MIN_THICKNESS_M))
            .number(f64::from(hull::TOLERANCE_M))
            .number(f64::from(hull::GRID_M))
            .number(hull::MAX_VERTICES as f64)
            .floats(positions.into_iter())
            .bytes(&triangles)
            .finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_of_parry_is_that_of_the_lock_file() {
        let lock = include_str!("../../../Cargo.lock");
        let wanted = format!("name = \"parry3d\"\nversion = \"{PARRY}\"\n");
        assert!(lock.contains(&wanted), "Cargo.lock has another parry3d than {PARRY}: set PARRY to its version");
    }
}
