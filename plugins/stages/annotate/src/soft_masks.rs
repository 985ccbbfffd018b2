//! Masks with fractions of pixels.

use crate::masks::TableAndRoom;
use std::ops::{BitOr, BitXor};
use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_MASK, AMODAL_SOFT_MASK, INSTANCE, VISIBLE_SOFT_MASK};
use syntable_model::product::{BitPlane, ObjectImage, ObjectImages};

/// Fraction of each pixel's area that annotated objects cover: `visible_soft_mask` for their visible parts,
/// `amodal_soft_mask` with their hidden parts. Both are the fraction of rays through the centers of `subpixels` ×
/// `subpixels` equal squares of the pixel that hit the object, in steps of 1 / `subpixels`². The error at a straight
/// edge is at most about half of 1 / `subpixels`.
///
/// The renderer traces `instance` and `coverage` with `subpixels`² rays per pixel, so labels take that many times as
/// long and as much memory. The masks of `masks` are sampled at pixel centers, so they can differ from the soft mask at
/// a threshold of one half.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SoftMasks {
    /// Sub-pixels along either edge of a pixel.
    #[schemars(range(min = 2, max = 8))]
    pub subpixels: u32,
    /// How to treat the part of an object behind table and room. Should equal the option of `masks`.
    pub table_and_room: TableAndRoom,
}

impl Default for SoftMasks {
    fn default() -> Self {
        Self { subpixels: 4, table_and_room: TableAndRoom::Occlude }
    }
}

config!(SoftMasks => dyn ImageAnnotator, "soft_masks", "subpixels = 4");

impl SoftMasks {
    fn instance(&self) -> Key<Plane<InstanceId>> {
        INSTANCE.in_subpixels(self.subpixels)
    }

    fn coverage(&self) -> Key<BitPlane> {
        self.table_and_room.coverage().in_subpixels(self.subpixels)
    }
}

impl ImageAnnotator for SoftMasks {
    fn reads(&self) -> Vec<KeyId> {
        keys![AMODAL_MASK, self.instance(), self.coverage()]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![VISIBLE_SOFT_MASK, AMODAL_SOFT_MASK]
    }

    fn annotate(&self, _: &ImageContext, products: &mut Products) -> Result<()> {
        let (instance, coverage) = (products.get(self.instance())?, products.get(self.coverage())?);
        let [width, height] = [instance.width(), instance.height()].map(|edge| edge / self.subpixels);
        let annotated = products.get(AMODAL_MASK)?;
        let (mut visible, mut amodal) = (Hits::new(annotated), Hits::new(annotated));
        let (times, words) = (self.subpixels as usize, coverage.words());
        let rows_of = |y: u32| {
            let [start, count] = [y as usize, 1].map(|rows| rows * times * width as usize * times);
            (&instance.data()[start..][..count], &coverage.data()[start * words..][..count * words])
        };
        let rays = self.subpixels * self.subpixels;
        let (mut found, mut mixed) = (Found::default(), Vec::new());
        for y in 0..height {
            let (ids, sets) = rows_of(y);
            mixed.clear();
            mixed.resize(width as usize, false);
            mark_mixed(&mut mixed, ids, times, 1, |id| id.0);
            mark_mixed(&mut mixed, sets, times, words, |set| *set);
            let mut x = 0;
            while x < width {
                let column = x as usize * times;
                if mixed[x as usize] {
                    found.cast(ids, sets, column, times);
                    found.seen.drain(..).for_each(|(id, hits)| visible.add(id, PixelHits { x, y, length: 1, hits }));
                    found.covered.drain(..).for_each(|(id, hits)| amodal.add(id, PixelHits { x, y, length: 1, hits }));
                    x += 1;
                } else {
                    let set_at = |column: usize| &sets[column * words..][..words];
                    let is_same = |&x: &u32| {
                        let other = x as usize * times;
                        !mixed[x as usize] && ids[other] == ids[column] && set_at(other).iter().eq(set_at(column))
                    };
                    let end = (x + 1..width).find(|x| !is_same(x)).unwrap_or(width);
                    let run = PixelHits { x, y, length: end - x, hits: rays };
                    visible.add(ids[column], run);
                    ids_of(set_at(column)).for_each(|id| amodal.add(id, run));
                    x = end;
                }
            }
        }
        products.put(VISIBLE_SOFT_MASK, visible.shares([width, height], rays))?;
        products.put(AMODAL_SOFT_MASK, amodal.shares([width, height], rays))
    }
}

/// Pixels of a row that are marked at once, so that all of their rays are in the fastest cache.
const BLOCK: usize = 64;

/// Marks pixels of a row whose rays have different results. The row has `times` rows of `times` rays per pixel, and
/// each ray has some words. Few pixels are marked: the others lie within objects or the background.
fn mark_mixed<T, B>(pixels: &mut [bool], rays: &[T], times: usize, words: usize, bits: impl Fn(&T) -> B)
where
    B: Copy + Default + PartialEq + BitXor<Output = B> + BitOr<Output = B>,
{
    let (row, of_pixel) = (rays.len() / times, times * words);
    // Bits in which any other row of rays differs from the first.
    let mut differ = Vec::with_capacity(BLOCK * of_pixel);
    for (block, pixels) in pixels.chunks_mut(BLOCK).enumerate() {
        let rays_of = |j: usize| &rays[j * row + block * BLOCK * of_pixel..][..pixels.len() * of_pixel];
        let first = rays_of(0);
        differ.clear();
        differ.resize(first.len(), B::default());
        for other in (1..times).map(rays_of) {
            for ((differ, a), b) in differ.iter_mut().zip(first).zip(other) {
                *differ = *differ | bits(a) ^ bits(b);
            }
        }
        let of_pixels = differ.chunks_exact(of_pixel).zip(first.chunks_exact(of_pixel));
        for (is_mixed, (down, across)) in pixels.iter_mut().zip(of_pixels) {
            let across = across.iter().zip(&across[words..]).map(|(a, b)| bits(a) ^ bits(b));
            let differ = down.iter().copied().chain(across).fold(B::default(), |all, differ| all | differ);
            *is_mixed |= differ != B::default();
        }
    }
}

/// Hits of the rays of one pixel, each with the number of rays.
#[derive(Default)]
struct Found {
    /// First bodies.
    seen: Vec<(InstanceId, u32)>,
    /// Objects at any depth.
    covered: Vec<(InstanceId, u32)>,
}

impl Found {
    /// Counts the hits of the rays of the pixel that starts at a column, in the rows of rays of a row of pixels.
    fn cast(&mut self, ids: &[InstanceId], sets: &[u64], column: usize, times: usize) {
        let (row, words) = (ids.len() / times, sets.len() / ids.len());
        let rays_from = |j: usize| j * row + column;
        for start in (0..times).map(rays_from) {
            ids[start..][..times].iter().for_each(|&id| self.see(id));
        }
        for word in 0..words {
            let rows = (0..times).map(|j| &sets[rays_from(j) * words..][..times * words]);
            let rays = rows.flat_map(|row| row[word..].iter().step_by(words).copied());
            let (all, any) = rays.clone().fold((!0, 0), |(all, any), set| (all & set, any | set));
            let whole = ids_in(word, all).map(|id| (id, (times * times) as u32));
            // Few objects have their edge in the pixel.
            let part = ids_in(word, any & !all).map(|id| {
                let bit = (usize::from(id.0) - 1) % 64;
                (id, rays.clone().map(|set| (set >> bit & 1) as u32).sum())
            });
            self.covered.extend(whole.chain(part));
        }
    }

    /// Adds a ray whose first body is `id`.
    fn see(&mut self, id: InstanceId) {
        match self.seen.iter_mut().find(|(it, _)| *it == id) {
            Some((_, hits)) => *hits += 1,
            None => self.seen.push((id, 1)),
        }
    }
}

/// The instances of a set of objects.
fn ids_of(set: &[u64]) -> impl Iterator<Item = InstanceId> {
    set.iter().enumerate().flat_map(|(word, &bits)| ids_in(word, bits))
}

/// The instances of one word of a set.
fn ids_in(word: usize, bits: u64) -> impl Iterator<Item = InstanceId> {
    let bits =
        std::iter::successors(Some(bits), |bits| Some(bits & bits.wrapping_sub(1))).take_while(|bits| *bits != 0);
    bits.map(move |bits| InstanceId((64 * word) as u16 + bits.trailing_zeros() as u16 + 1))
}

/// The pixels in which rays hit each of some objects, by id; `None` for other objects.
struct Hits(Vec<Option<Vec<PixelHits>>>);

/// A pixel, or a run of pixels in a row from left to right, and the number of rays of each that hit.
#[derive(Clone, Copy)]
struct PixelHits {
    x: u32,
    y: u32,
    length: u32,
    hits: u32,
}

impl Hits {
    fn new(objects: &PerInstance<Mask>) -> Self {
        let mut hits = Vec::new();
        for (id, _) in objects.iter() {
            hits.resize(hits.len().max(usize::from(id.0) + 1), None);
            hits[usize::from(id.0)] = Some(Vec::new());
        }
        Self(hits)
    }

    fn add(&mut self, id: InstanceId, run: PixelHits) {
        if let Some(Some(runs)) = self.0.get_mut(usize::from(id.0)) {
            runs.push(run);
        }
    }

    /// The fraction of `rays` rays in each pixel of a view.
    fn shares(self, [width, height]: [u32; 2], rays: u32) -> ObjectImages<f32> {
        let mut images = ObjectImages::new(width, height);
        for (id, runs) in (0..).zip(self.0).filter_map(|(id, runs)| Some((InstanceId(id), runs?))) {
            let least = |of: fn(&PixelHits) -> u32| runs.iter().map(of).min().unwrap_or(0);
            let greatest = |of: fn(&PixelHits) -> u32| runs.iter().map(of).max().unwrap_or(0);
            let (left, top) = (least(|run| run.x), least(|run| run.y));
            let (right, bottom) = (greatest(|run| run.x + run.length), greatest(|run| run.y + 1));
            let size = (right - left) as usize * (bottom - top) as usize;
            let mut shares = Plane::from_vec(right - left, bottom - top, vec![0.0; size]);
            for run in runs {
                let start = (run.y - top) as usize * (right - left) as usize + (run.x - left) as usize;
                shares.data_mut()[start..][..run.length as usize].fill(run.hits as f32 / rays as f32);
            }
            images.insert(id, ObjectImage { x: left, y: top, pixels: shares });
        }
        images
    }
}

register!(SoftMasks);
