//! Masks with fractions of pixels.

use crate::masks::TableAndRoom;
use std::collections::BTreeMap;
use syntable_model::prelude::*;
use syntable_model::product::BitPlane;
use syntable_model::product::standard::{AMODAL_MASK, AMODAL_SOFT_MASK, INSTANCE, VISIBLE_SOFT_MASK};

/// The part of each pixel's area that annotated objects cover: `visible_soft_mask` where they are seen, `amodal_soft_mask`
/// with what others hide. Both are the share of the rays through the centers of `subpixels` × `subpixels` equal squares of
/// the pixel that hit the object, in steps of 1 / `subpixels`²; so a straight edge is off by at most about half of
/// 1 / `subpixels`. The visible part is at most the amodal one in every pixel.
///
/// The renderer is asked for `instance` and `coverage` in sub-pixels, `subpixels`² as many rays as for masks: labels take that
/// much longer, and that much memory. A mask of `masks` is taken at the center of the pixel and need not be where the soft
/// mask is above one half.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SoftMasks {
    /// Sub-pixels along either edge of a pixel.
    #[schemars(range(min = 2, max = 8))]
    pub subpixels: u32,
    /// How to treat the part of an object behind table and room: that of `masks`.
    pub table_and_room: TableAndRoom,
}

impl Default for SoftMasks {
    fn default() -> Self {
        Self { subpixels: 4, table_and_room: TableAndRoom::Occlude }
    }
}

impl Config for SoftMasks {
    type Stage = dyn Annotator;
    const KIND: &'static str = "soft_masks";
    const EXAMPLE: &'static str = "subpixels = 4";
    fn build(self) -> Result<Box<dyn Annotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl SoftMasks {
    fn instance(&self) -> Key<Plane<InstanceId>> {
        INSTANCE.in_subpixels(self.subpixels)
    }

    fn coverage(&self) -> Key<BitPlane> {
        self.table_and_room.coverage().in_subpixels(self.subpixels)
    }
}

impl Annotator for SoftMasks {
    fn reads(&self) -> Vec<KeyId> {
        keys![AMODAL_MASK, self.instance(), self.coverage()]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![VISIBLE_SOFT_MASK, AMODAL_SOFT_MASK]
    }

    fn is_of_products(&self) -> bool {
        true
    }

    fn annotate(&self, _: &ViewContext, products: &mut Products) -> Result<()> {
        let (annotated, instance, coverage) =
            (products.get(AMODAL_MASK)?, products.get(self.instance())?, products.get(self.coverage())?);
        let size = [instance.width() / self.subpixels, instance.height() / self.subpixels];
        let (mut visible, mut amodal) = (Counts::new(annotated, size), Counts::new(annotated, size));
        for (y, x) in (0..instance.height()).flat_map(|y| (0..instance.width()).map(move |x| (y, x))) {
            let pixel = [x / self.subpixels, y / self.subpixels];
            visible.add(*instance.at(x, y), pixel);
            ids(coverage.set(x, y)).for_each(|id| amodal.add(id, pixel));
        }
        let rays = (self.subpixels * self.subpixels) as f32;
        products.put(VISIBLE_SOFT_MASK, visible.shares(rays))?;
        products.put(AMODAL_SOFT_MASK, amodal.shares(rays))
    }
}

/// The instances of a set of objects.
fn ids(set: &[u64]) -> impl Iterator<Item = InstanceId> {
    set.iter().enumerate().flat_map(|(word, &bits)| {
        let bits =
            std::iter::successors(Some(bits), |bits| Some(bits & bits.wrapping_sub(1))).take_while(|bits| *bits != 0);
        bits.map(move |bits| InstanceId((64 * word) as u16 + bits.trailing_zeros() as u16 + 1))
    })
}

/// Rays of each pixel that hit each of some objects.
struct Counts(BTreeMap<InstanceId, Plane<u8>>);

impl Counts {
    fn new(objects: &PerInstance<Mask>, [width, height]: [u32; 2]) -> Self {
        Self(objects.iter().map(|(id, _)| (id, Plane::from_fn(width, height, |_, _| 0))).collect())
    }

    fn add(&mut self, id: InstanceId, [x, y]: [u32; 2]) {
        if let Some(counts) = self.0.get_mut(&id) {
            let width = counts.width() as usize;
            counts.data_mut()[y as usize * width + x as usize] += 1;
        }
    }

    fn shares(self, rays: f32) -> PerInstance<Plane<f32>> {
        self.0.into_iter().map(|(id, counts)| (id, counts.map(|&count| f32::from(count) / rays))).collect()
    }
}

register!(SoftMasks);
