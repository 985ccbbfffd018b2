//! All masks and the occlusion order of a view in one sweep over the first-hit and coverage planes.
//!
//! With the first body `f(p)` and the covering objects `c(p)` of every pixel `p`:
//!
//! - visible `i` = {p : f(p) = i}, amodal `i` = {p : i ∈ c(p)}, occlusion `i` = amodal minus visible;
//! - row `i` of the occlusion order is the union of `c(p)` over visible `i`, without `i` itself. This is SynTable's
//!   Algorithm 1: a pixel of visible `i` that `j` covers is a pixel of occlusion `j`.
//!
//! Masks are run lengths down the columns, and sets change rarely from one pixel to the next. So the sweep goes down
//! the columns and records, for every object, the positions at which its bit flips. Columns are gathered in strips, one
//! cache line of every row at a time.

use syntable_model::error::{Error, Result};
use syntable_model::product::extents;
use syntable_model::product::{BitPlane, Mask, Plane};
use syntable_model::scene::InstanceId;

/// Columns gathered at once: as many as a cache line has words.
const STRIP: usize = 8;

/// The masks of one object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ObjectMasks {
    /// Pixels at which the object is the first body.
    pub visible: Mask,
    /// Pixels that the object covers.
    pub amodal: Mask,
    /// Amodal minus visible.
    pub occlusion: Mask,
}

/// Result of a sweep. Object `i` has the instance id `i + 1`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sweep {
    /// The masks of every object.
    pub objects: Vec<ObjectMasks>,
    /// For every object, as a bit set of [`words`](BitPlane::words) words, the objects that cover the pixels at which
    /// it is visible; its own bit is clear.
    occludes: Vec<u64>,
    words: usize,
}

impl Sweep {
    /// Whether object `i` occludes object `j`.
    pub fn occludes(&self, i: usize, j: usize) -> bool {
        self.occludes[i * self.words + j / 64] >> (j % 64) & 1 == 1
    }
}

/// Finds the masks of all objects and their occlusion order. Costs O(H·W·⌈M/64⌉ + runs).
///
/// `coverage` must have the size of the image, and must contain every object that `first` shows.
pub fn sweep(first: &Plane<InstanceId>, coverage: &BitPlane) -> Result<Sweep> {
    let (width, height) = (first.width(), first.height());
    if (coverage.width(), coverage.height()) != (width, height) {
        return Err(Error::new(format!(
            "the coverage plane is {} × {}, the instance plane {width} × {height}",
            coverage.width(),
            coverage.height()
        )));
    }
    let mut objects = Vec::with_capacity(coverage.objects());
    for word in 0..coverage.words() {
        objects.extend(sweep_word(first, coverage, word)?);
    }
    Ok(Sweep { objects, occludes: occluded_sets(first, coverage), words: coverage.words() })
}

/// The masks of the objects that own the bits of one word.
fn sweep_word(first: &Plane<InstanceId>, coverage: &BitPlane, word: usize) -> Result<Vec<ObjectMasks>> {
    let (width, height, words) = (first.width() as usize, first.height() as usize, coverage.words());
    let bits = (coverage.objects() - word * 64).min(64);
    let mut flips: [Vec<Vec<u32>>; 3] = std::array::from_fn(|_| vec![Vec::new(); bits]);
    let [visible_flips, amodal_flips, occlusion_flips] = &mut flips;
    let flip = |flips: &mut [Vec<u32>], mut changed: u64, position: u32| {
        while changed != 0 {
            flips[changed.trailing_zeros() as usize].push(position);
            changed &= changed - 1;
        }
    };
    let mut strip = vec![(0_u64, 0_u64); STRIP * height];
    let (mut amodal, mut visible) = (0, 0);
    for x0 in (0..width).step_by(STRIP) {
        let columns = STRIP.min(width - x0);
        for y in 0..height {
            let sets = &coverage.data()[(y * width + x0) * words + word..];
            let ids = &first.data()[y * width + x0..][..columns];
            for (column, &id) in ids.iter().enumerate() {
                strip[column * height + y] = (sets[column * words], own_bit(id, word, bits));
            }
        }
        for (i, &(now_amodal, now_visible)) in strip[..columns * height].iter().enumerate() {
            if (now_amodal, now_visible) == (amodal, visible) {
                continue;
            }
            let position = x0 * height + i;
            if now_visible & !now_amodal != 0 {
                return Err(disagreement(position, height, word, now_visible));
            }
            let position = position as u32;
            flip(amodal_flips, amodal ^ now_amodal, position);
            flip(visible_flips, visible ^ now_visible, position);
            flip(occlusion_flips, (amodal & !visible) ^ (now_amodal & !now_visible), position);
            (amodal, visible) = (now_amodal, now_visible);
        }
    }
    let mask = |flips: &Vec<u32>| Mask::from_flips(width as u32, height as u32, flips);
    Ok((0..bits)
        .map(|bit| ObjectMasks {
            visible: mask(&visible_flips[bit]),
            amodal: mask(&amodal_flips[bit]),
            occlusion: mask(&occlusion_flips[bit]),
        })
        .collect())
}

/// The bit of an instance in a word of `bits` objects; 0 for background, table, room and objects of other words.
fn own_bit(id: InstanceId, word: usize, bits: usize) -> u64 {
    let bit = usize::from(id.0).wrapping_sub(1 + word * 64);
    if bit < bits { 1 << bit } else { 0 }
}

fn disagreement(position: usize, height: usize, word: usize, visible: u64) -> Error {
    let id = word * 64 + visible.trailing_zeros() as usize + 1;
    Error::new(format!(
        "instance {id} is visible at pixel ({}, {}) but not in the coverage plane",
        position / height,
        position % height
    ))
    .help("the renderer must cast one ray for both planes")
}

/// For every object, the union of the covering sets over the pixels at which it is visible, without itself.
fn occluded_sets(first: &Plane<InstanceId>, coverage: &BitPlane) -> Vec<u64> {
    let (objects, words) = (coverage.objects(), coverage.words());
    let mut rows = vec![0; objects * words];
    for (&id, set) in first.data().iter().zip(coverage.data().chunks_exact(words)) {
        let object = usize::from(id.0).wrapping_sub(1);
        if object < objects {
            for (row, &word) in rows[object * words..][..words].iter_mut().zip(set) {
                *row |= word;
            }
        }
    }
    for object in 0..objects {
        rows[object * words + object / 64] &= !(1 << (object % 64));
    }
    rows
}

/// For every object, the number of pixels that it covers outside the image: pixels on a canvas around the image minus
/// pixels in the image.
pub fn area_outside(image: &BitPlane, canvas: &BitPlane) -> Vec<u64> {
    let areas = |plane: &BitPlane| extents(plane).into_iter().map(|extent| extent.area);
    areas(canvas).zip(areas(image)).map(|(all, inside)| all.saturating_sub(inside)).collect()
}
