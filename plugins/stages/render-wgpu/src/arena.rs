//! Buffers that keep assets on the device for as long as they fit.

use crate::device::Device;
use std::collections::HashMap;
use syntable_model::digest::Digest;
use syntable_model::error::{Error, Result};

/// Index of the first element of an asset.
pub type Place = u32;

/// A buffer of elements of one size, with the assets that lie in it.
pub struct Arena {
    label: &'static str,
    /// Bytes of an element.
    element: u64,
    /// Elements at the start that are no asset's.
    reserved: u64,
    used: u64,
    places: HashMap<Digest, Place>,
    buffer: wgpu::Buffer,
}

/// An asset to keep: its digest, its number of elements, and a function that makes its bytes.
pub struct Asset<'a> {
    /// Of what is written.
    pub digest: Digest,
    /// Elements.
    pub count: u64,
    /// Makes the elements.
    pub bytes: Box<dyn Fn() -> Vec<u8> + 'a>,
}

impl Arena {
    /// An empty arena.
    pub fn new(device: &Device, label: &'static str, element: u64) -> Result<Self> {
        Ok(Self { label, element, reserved: 0, used: 0, places: HashMap::new(), buffer: device.storage(label, 4096)? })
    }

    /// The buffer. A call of [`Self::keep`] may put another one in its place.
    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// Makes sure that assets are on the device, with so many elements free at the start. If there is no room for those
    /// that are missing, others are forgotten.
    ///
    /// # Errors
    /// If the assets do not fit into a buffer of the device.
    pub fn keep(&mut self, device: &Device, reserved: u64, assets: &[Asset]) -> Result<()> {
        let missing = |places: &HashMap<Digest, Place>| {
            let mut seen = std::collections::HashSet::new();
            let new = assets.iter().filter(|asset| !places.contains_key(&asset.digest) && seen.insert(asset.digest));
            new.collect::<Vec<_>>()
        };
        let mut wanted = missing(&self.places);
        let needed = |start: u64, wanted: &[&Asset]| start + wanted.iter().map(|asset| asset.count).sum::<u64>();
        let capacity = self.buffer.size() / self.element;
        if reserved > self.reserved || needed(self.used, &wanted) > capacity {
            self.places.clear();
            wanted = missing(&self.places);
            self.reserved = reserved.max(self.reserved);
            self.used = self.reserved;
            let elements = needed(self.used, &wanted);
            let limit = device.max_buffer() / self.element;
            if elements > limit {
                let mib = |elements: u64| (elements * self.element) >> 20;
                return Err(Error::exceeds_device(format!(
                    "the scene's {} need {} MiB, and a buffer of {} holds {}",
                    self.label,
                    mib(elements),
                    device.name(),
                    mib(limit)
                ))
                .help("use fewer or smaller assets, or render with `cpu_path`"));
            }
            if elements > capacity {
                // What was there is given back first. Room for the next scenes' assets, too.
                self.buffer = device.storage(self.label, 0)?;
                let (bytes, most) = (elements * self.element, limit * self.element);
                self.buffer = device.roomy_storage(self.label, bytes, (2 * bytes).next_power_of_two().min(most))?;
            }
        }
        for asset in wanted {
            let place = self.used as Place;
            let bytes = (asset.bytes)();
            debug_assert_eq!(bytes.len() as u64, asset.count * self.element);
            device.write(&self.buffer, self.used * self.element, &bytes);
            self.places.insert(asset.digest, place);
            self.used += asset.count;
        }
        Ok(())
    }

    /// Whether an asset is there.
    pub fn holds(&self, digest: &Digest) -> bool {
        self.places.contains_key(digest)
    }

    /// Where an asset is that was asked for last.
    pub fn place(&self, digest: &Digest) -> Place {
        self.places[digest]
    }
}
