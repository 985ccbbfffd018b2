//! Surfaces that many objects share, baked when first asked for.

use super::paint::SurfaceFamily;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock};
use syntable_model::random::Stream;
use syntable_model::scene::Material;

type Slot = Arc<OnceLock<Arc<Material>>>;

/// A few variants of every surface family. A variant is the same whoever asks for it first.
pub struct Shelf {
    stream: Stream,
    size: usize,
    slots: Mutex<BTreeMap<(SurfaceFamily, u32), Slot>>,
}

impl Shelf {
    /// Variants with textures of `size` texels.
    pub fn new(stream: Stream, size: usize) -> Self {
        Self { stream, size, slots: Mutex::default() }
    }

    /// A variant of a family.
    pub fn surface(&self, family: SurfaceFamily, variant: u32) -> Arc<Material> {
        let slot = {
            let mut slots = self.slots.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
            slots.entry((family, variant)).or_default().clone()
        };
        // Baked outside of the lock on the shelf: other families go on meanwhile.
        slot.get_or_init(|| {
            let stream = self.stream.child(family.name()).at(u64::from(variant));
            Arc::new(family.bake(&stream, self.size, &format!("{}_{variant:04}", family.name())))
        })
        .clone()
    }
}
