//! Buffers that keep assets on the device as long as they fit.

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
    /// Elements at the start that belong to no asset.
    reserved: u64,
    used: u64,
    places: HashMap<Digest, Place>,
    buffer: wgpu::Buffer,
}

/// An asset to keep: its digest, its number of elements, and a function that makes its bytes.
pub struct Asset<'a> {
    /// Digest of the content.
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

    /// The buffer. [`Self::keep`] may replace it.
    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// Uploads the assets that the buffer lacks, after `reserved` free elements at the start. If they do not fit, all
    /// assets are dropped and the given ones are uploaded again.
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
                // First free the old buffer. The new one has room for the assets of later scenes, too.
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

    /// Whether the buffer holds an asset.
    pub fn holds(&self, digest: &Digest) -> bool {
        self.places.contains_key(digest)
    }

    /// Place of an asset of the last call of [`Self::keep`].
    pub fn place(&self, digest: &Digest) -> Place {
        self.places[digest]
    }
}
