//! What scenes share: trees by object and pictures by texture, made once and forgotten when there are too many.

use crate::light::Sky;
use crate::mesh::TracedMesh;
use crate::texture::MipTexture;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use syntable_model::digest::Digest;
use syntable_model::scene::{EnvironmentMap, Object, Texture};

/// Bytes of meshes and, apart, of textures and of skies that are kept though no scene uses them.
const CAPACITY: usize = 256 << 20;

/// The cache of a renderer; its sessions share it.
#[derive(Debug)]
pub(crate) struct SceneCache {
    meshes: Shelf<TracedMesh>,
    textures: Shelf<MipTexture>,
    skies: Shelf<Sky>,
}

impl SceneCache {
    pub fn new() -> Self {
        Self { meshes: Shelf::new(CAPACITY), textures: Shelf::new(CAPACITY), skies: Shelf::new(CAPACITY) }
    }

    /// An environment map, ready to be sampled.
    pub fn sky(&self, map: &Arc<EnvironmentMap>) -> Arc<Sky> {
        self.skies.get(map.digest, || Sky::new(map), Sky::size)
    }

    /// The mesh of an object.
    pub fn mesh(&self, object: &Object) -> Arc<TracedMesh> {
        self.meshes.get(object.digest, || TracedMesh::new(&object.mesh), TracedMesh::size)
    }

    /// A picture with its levels.
    pub fn texture(&self, texture: &Arc<Texture>) -> Arc<MipTexture> {
        self.textures.get(texture.digest, || MipTexture::new(texture), MipTexture::size)
    }
}

/// Values by digest, the least recently used forgotten first.
#[derive(Debug)]
struct Shelf<T> {
    capacity: usize,
    state: Mutex<State<T>>,
}

#[derive(Debug)]
struct State<T> {
    slots: BTreeMap<Digest, Slot<T>>,
    clock: u64,
}

#[derive(Debug)]
struct Slot<T> {
    value: Arc<OnceLock<Arc<T>>>,
    size: usize,
    used: u64,
}

impl<T> Shelf<T> {
    fn new(capacity: usize) -> Self {
        Self { capacity, state: Mutex::new(State { slots: BTreeMap::new(), clock: 0 }) }
    }

    /// The value of a digest. Threads that ask for one at the same time wait for the first to make it; others go on.
    fn get(&self, digest: Digest, make: impl FnOnce() -> T, size: impl FnOnce(&T) -> usize) -> Arc<T> {
        let cell = {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            state.clock += 1;
            let used = state.clock;
            let slot = state.slots.entry(digest).or_insert_with(|| Slot { value: Arc::default(), size: 0, used });
            slot.used = used;
            slot.value.clone()
        };
        let mut made = false;
        let value = cell.get_or_init(|| {
            made = true;
            Arc::new(make())
        });
        if made {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(slot) = state.slots.get_mut(&digest) {
                slot.size = size(value);
            }
            state.forget(self.capacity);
        }
        value.clone()
    }
}

impl<T> State<T> {
    fn forget(&mut self, capacity: usize) {
        let mut total: usize = self.slots.values().map(|slot| slot.size).sum();
        while total > capacity {
            let finished = self.slots.iter().filter(|(_, slot)| slot.value.get().is_some());
            let Some((&oldest, _)) = finished.min_by_key(|(_, slot)| slot.used) else { return };
            total -= self.slots.remove(&oldest).map_or(0, |slot| slot.size);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn makes_once_and_forgets_the_least_recently_used() {
        let shelf = Shelf::new(10);
        let get = |name: &str, made: &mut usize| {
            *shelf.get(Digest::of(name.as_bytes()), || *made + 1, |_| 4).tap(|v| *made = (*made).max(**v))
        };
        let mut made = 0;
        assert_eq!((get("a", &mut made), get("b", &mut made), get("a", &mut made)), (1, 2, 1));
        assert_eq!(get("c", &mut made), 3, "and b is forgotten");
        assert_eq!((get("a", &mut made), get("c", &mut made)), (1, 3));
        assert_eq!(get("b", &mut made), 4, "made again");
    }

    trait Tap: Sized {
        fn tap(self, f: impl FnOnce(&Self)) -> Self {
            f(&self);
            self
        }
    }
    impl<T> Tap for T {}
}
