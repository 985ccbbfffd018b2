//! Masks with fractions of pixels.

use crate::masks::TableAndRoom;
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
        let (mut visible, mut amodal) = (Shares::new(annotated, size), Shares::new(annotated, size));
        let times = self.subpixels;
        let rays = times * times;
        let (mut seen, mut sets, mut covered) = (Vec::new(), Vec::new(), Vec::new());
        for [x, y] in (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| [x, y])) {
            for (i, j) in (0..times).flat_map(|j| (0..times).map(move |i| (x * times + i, y * times + j))) {
                count(&mut seen, *instance.at(i, j), 1);
                count(&mut sets, coverage.set(i, j), 1);
            }
            for (set, hits) in sets.drain(..) {
                ids(set).for_each(|id| count(&mut covered, id, hits));
            }
            seen.drain(..).for_each(|(id, hits)| visible.put(id, [x, y], hits, rays));
            covered.drain(..).for_each(|(id, hits)| amodal.put(id, [x, y], hits, rays));
        }
        products.put(VISIBLE_SOFT_MASK, visible.finish())?;
        products.put(AMODAL_SOFT_MASK, amodal.finish())
    }
}

/// Adds hits of something that rays met; most rays of a pixel meet the same.
fn count<T: PartialEq>(found: &mut Vec<(T, u32)>, what: T, hits: u32) {
    match found.iter_mut().find(|(it, _)| *it == what) {
        Some((_, sum)) => *sum += hits,
        None => found.push((what, hits)),
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

/// Shares of the rays of each pixel that hit each of some objects, by id; none of others.
struct Shares(Vec<Option<Plane<f32>>>);

impl Shares {
    fn new(objects: &PerInstance<Mask>, [width, height]: [u32; 2]) -> Self {
        let mut planes = Vec::new();
        for (id, _) in objects.iter() {
            planes.resize(planes.len().max(usize::from(id.0) + 1), None);
            planes[usize::from(id.0)] = Some(Plane::from_vec(width, height, vec![0.0; (width * height) as usize]));
        }
        Self(planes)
    }

    fn put(&mut self, id: InstanceId, [x, y]: [u32; 2], hits: u32, rays: u32) {
        if let Some(Some(shares)) = self.0.get_mut(usize::from(id.0)) {
            let width = shares.width() as usize;
            shares.data_mut()[y as usize * width + x as usize] = hits as f32 / rays as f32;
        }
    }

    fn finish(self) -> PerInstance<Plane<f32>> {
        let named = (0..).zip(self.0).filter_map(|(id, shares)| Some((InstanceId(id), shares?)));
        named.collect()
    }
}

register!(SoftMasks);
