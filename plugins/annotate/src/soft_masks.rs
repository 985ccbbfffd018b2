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
        let (times, words) = (self.subpixels as usize, coverage.words());
        let rows_of = |y: u32| {
            let [start, count] = [y as usize, 1].map(|rows| rows * times * width as usize * times);
            (&instance.data()[start..][..count], &coverage.data()[start * words..][..count * words])
        };
        let (mut found, mut mixed) = (Found::default(), Mixed::default());
        for y in 0..height {
            let (ids, sets) = rows_of(y);
            mixed.pixels.clear();
            mixed.pixels.resize(width as usize, false);
            mixed.mark(ids, times, 1, |id| u64::from(id.0));
            mixed.mark(sets, times, words, |set| *set);
            for (x, &is_mixed) in (0..width).zip(&mixed.pixels) {
                let column = x as usize * times;
                if is_mixed {
                    found.cast(ids, sets, column, times);
                    found.seen.drain(..).for_each(|(id, hits)| visible.add(id, [x, y], hits));
                    found.covered.drain(..).for_each(|(id, hits)| amodal.add(id, [x, y], hits));
                } else {
                    let hits = self.subpixels * self.subpixels;
                    visible.add(ids[column], [x, y], hits);
                    ids_of(&sets[column * words..][..words]).for_each(|id| amodal.add(id, [x, y], hits));
                }
            }
        }
        let rays = self.subpixels * self.subpixels;
        products.put(VISIBLE_SOFT_MASK, visible.shares([width, height], rays))?;
        products.put(AMODAL_SOFT_MASK, amodal.shares([width, height], rays))
    }
}

/// Pixels of a row whose rays do not all meet the same. Few pixels are: the others lie within objects or the background.
#[derive(Default)]
struct Mixed {
    pixels: Vec<bool>,
    /// Bits in which any other row of rays differs from the first.
    differ: Vec<u64>,
}

impl Mixed {
    /// Marks pixels by what their rays meet: `times` rows of `times` rays per pixel, each of some words.
    fn mark<T>(&mut self, rays: &[T], times: usize, words: usize, bits: impl Fn(&T) -> u64 + Copy) {
        let (first, others) = rays.split_at(rays.len() / times);
        self.differ.clear();
        self.differ.resize(first.len(), 0);
        for row in others.chunks_exact(first.len()) {
            for ((differ, a), b) in self.differ.iter_mut().zip(first).zip(row) {
                *differ |= bits(a) ^ bits(b);
            }
        }
        let (down, across) = (self.differ.chunks_exact(times * words), first.chunks_exact(times * words));
        for ((mixed, down), across) in self.pixels.iter_mut().zip(down).zip(across) {
            let differ = across.iter().zip(&across[words..]).fold(0, |differ, (a, b)| differ | (bits(a) ^ bits(b)));
            *mixed |= down.iter().fold(differ, |differ, it| differ | it) != 0;
        }
    }
}

/// What the rays of one pixel hit, each with their number.
#[derive(Default)]
struct Found {
    /// First bodies.
    seen: Vec<(InstanceId, u32)>,
    /// Objects at any depth.
    covered: Vec<(InstanceId, u32)>,
}

impl Found {
    /// Counts what the rays of the pixel from a column on hit, of the rows of rays of a row of pixels.
    fn cast(&mut self, ids: &[InstanceId], sets: &[u64], column: usize, times: usize) {
        let (row, words) = (ids.len() / times, sets.len() / ids.len());
        for start in (0..times).map(|j| j * row + column) {
            ids[start..][..times].iter().for_each(|&id| count(&mut self.seen, id));
            let sets = sets[start * words..][..times * words].chunks_exact(words);
            sets.flat_map(ids_of).for_each(|id| count(&mut self.covered, id));
        }
    }
}

/// Adds a ray that met something.
fn count(found: &mut Vec<(InstanceId, u32)>, id: InstanceId) {
    match found.iter_mut().find(|(it, _)| *it == id) {
        Some((_, hits)) => *hits += 1,
        None => found.push((id, 1)),
    }
}

/// The instances of a set of objects.
fn ids_of(set: &[u64]) -> impl Iterator<Item = InstanceId> {
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
