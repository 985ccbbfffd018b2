//! Masks with fractions of pixels.

use crate::masks::TableAndRoom;
use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_MASK, AMODAL_SOFT_MASK, INSTANCE, VISIBLE_SOFT_MASK};
use syntable_model::product::{BitPlane, ObjectImage, ObjectImages};

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
        let (instance, coverage) = (products.get(self.instance())?, products.get(self.coverage())?);
        let [width, height] = [instance.width(), instance.height()].map(|edge| edge / self.subpixels);
        let annotated = products.get(AMODAL_MASK)?;
        let (mut visible, mut amodal) = (Hits::new(annotated), Hits::new(annotated));
        let mut pixel = PixelRays::default();
        for [x, y] in (0..height).flat_map(|y| (0..width).map(move |x| [x, y])) {
            pixel.cast(instance, coverage, [x, y], self.subpixels);
            pixel.seen.drain(..).for_each(|(id, hits)| visible.add(id, [x, y], hits));
            pixel.covered.drain(..).for_each(|(id, hits)| amodal.add(id, [x, y], hits));
        }
        let rays = self.subpixels * self.subpixels;
        products.put(VISIBLE_SOFT_MASK, visible.shares([width, height], rays))?;
        products.put(AMODAL_SOFT_MASK, amodal.shares([width, height], rays))
    }
}

/// What the rays of one pixel hit, each with their number.
#[derive(Default)]
struct PixelRays {
    /// First bodies.
    seen: Vec<(InstanceId, u32)>,
    /// Objects at any depth.
    covered: Vec<(InstanceId, u32)>,
}

impl PixelRays {
    fn cast(&mut self, instance: &Plane<InstanceId>, coverage: &BitPlane, [x, y]: [u32; 2], times: u32) {
        let (words, row_of) = (coverage.words(), |j: u32| ((y * times + j) * instance.width() + x * times) as usize);
        let rows = (0..times).map(|j| {
            let (start, count) = (row_of(j), times as usize);
            (&instance.data()[start..][..count], &coverage.data()[start * words..][..count * words])
        });
        let (first, set) = (instance.data()[row_of(0)], &coverage.data()[row_of(0) * words..][..words]);
        // Most pixels are within an object or the background: all of their rays meet the same.
        if rows.clone().all(|(ids, sets)| is_same(ids, first) && sets.chunks_exact(words).all(|other| other == set)) {
            self.seen.push((first, times * times));
            self.covered.extend(ids(set).map(|id| (id, times * times)));
            return;
        }
        for (row, sets) in rows {
            row.iter().for_each(|&id| count(&mut self.seen, id));
            sets.chunks_exact(words).flat_map(ids).for_each(|id| count(&mut self.covered, id));
        }
    }
}

fn is_same(ids: &[InstanceId], first: InstanceId) -> bool {
    ids.iter().fold(0, |differ, id| differ | (id.0 ^ first.0)) == 0
}

/// Adds a ray that met something.
fn count(found: &mut Vec<(InstanceId, u32)>, id: InstanceId) {
    match found.iter_mut().find(|(it, _)| *it == id) {
        Some((_, hits)) => *hits += 1,
        None => found.push((id, 1)),
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

/// The pixels in which rays hit each of some objects, by id, with the number of rays; none of other objects.
struct Hits(Vec<Option<Vec<PixelHits>>>);

/// A pixel, and how many of its rays hit.
type PixelHits = ([u32; 2], u32);

impl Hits {
    fn new(objects: &PerInstance<Mask>) -> Self {
        let mut hits = Vec::new();
        for (id, _) in objects.iter() {
            hits.resize(hits.len().max(usize::from(id.0) + 1), None);
            hits[usize::from(id.0)] = Some(Vec::new());
        }
        Self(hits)
    }

    fn add(&mut self, id: InstanceId, pixel: [u32; 2], hits: u32) {
        if let Some(Some(pixels)) = self.0.get_mut(usize::from(id.0)) {
            pixels.push((pixel, hits));
        }
    }

    /// The share of so many rays in each pixel of a view.
    fn shares(self, [width, height]: [u32; 2], rays: u32) -> ObjectImages<f32> {
        let mut images = ObjectImages::new(width, height);
        for (id, pixels) in (0..).zip(self.0).filter_map(|(id, pixels)| Some((InstanceId(id), pixels?))) {
            let (left, top) = (edge(&pixels, 0, u32::min), edge(&pixels, 1, u32::min));
            let (right, bottom) = (edge(&pixels, 0, u32::max), edge(&pixels, 1, u32::max));
            let [width, height] = if pixels.is_empty() { [0; 2] } else { [right - left + 1, bottom - top + 1] };
            let mut shares = Plane::from_vec(width, height, vec![0.0; width as usize * height as usize]);
            for ([x, y], hits) in pixels {
                shares.data_mut()[((y - top) * width + x - left) as usize] = hits as f32 / rays as f32;
            }
            images.insert(id, ObjectImage { x: left, y: top, pixels: shares });
        }
        images
    }
}

/// The least or greatest column or row of some pixels; 0 if there is none.
fn edge(pixels: &[PixelHits], axis: usize, of: fn(u32, u32) -> u32) -> u32 {
    pixels.iter().map(|(pixel, _)| pixel[axis]).reduce(of).unwrap_or(0)
}

register!(SoftMasks);
