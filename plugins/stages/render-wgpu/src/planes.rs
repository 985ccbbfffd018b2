//! Layout of the planes of an image on the device, and their conversion to products.

use crate::layout::{NONE, View};
use std::sync::OnceLock;
use syntable_model::context::Workers;
use syntable_model::error::Result;
use syntable_model::product::standard::{
    ALBEDO, COVERAGE, COVERAGE_BEFORE_SUPPORT, DENOISE_ALBEDO, DENOISE_NORMAL, DEPTH, INSTANCE, NORMAL, OBJECT_DEPTHS,
    RADIANCE, RADIANCE_DEMODULATED, RADIANCE_DEMODULATED_VARIANCE, RADIANCE_SPECULAR, RADIANCE_SPECULAR_VARIANCE,
    RADIANCE_VARIANCE,
};
use syntable_model::product::{BitPlane, Key, KeyId, ObjectDepths, Plane, Products};
use syntable_model::scene::InstanceId;
use syntable_prepare::labels::instance_id;
use syntable_simd::functions::FAR;

/// Numbers of a pixel's sums in `path.wgsl`, without guides and with them. The first are the radiance and the square of
/// its luminance, then the rounding error of each.
pub const SUMS: [u64; 2] = [9, 24];

/// Like [`SUMS`], with one more for the opacity, if that is counted.
pub fn sums(guides: bool, opacity: bool) -> u64 {
    SUMS[usize::from(guides)] + u64::from(opacity)
}

/// Positions of further sums: samples; samples of the guides, then their albedo and normal; radiance of each part and
/// the square of its luminance.
pub const SUM_SAMPLES: u32 = 8;
pub const SUM_GUIDES: u32 = 9;
pub const SUM_SPECULAR: u32 = 16;
pub const SUM_DEMODULATED: u32 = 20;

/// Words of a pixel in the planes of light, without guides and with them. Depth and instance are copied there with the
/// guides. The opacity comes last.
pub const PLANE_WORDS: [u64; 2] = [5, 21];
pub const AT_OPACITY: [u32; 2] = [4, 20];

/// Positions of the planes of light: the first word is this number times the number of pixels, as in `resolve` in
/// `path.wgsl`.
pub const AT_RADIANCE: u32 = 0;
pub const AT_VARIANCE: u32 = 3;
pub const AT_SPECULAR: u32 = 4;
pub const AT_SPECULAR_VARIANCE: u32 = 7;
pub const AT_DEMODULATED: u32 = 8;
pub const AT_DEMODULATED_VARIANCE: u32 = 11;
pub const AT_ALBEDO: u32 = 12;
pub const AT_NORMAL: u32 = 15;
pub const AT_DEPTH: u32 = 18;
pub const AT_INSTANCE: u32 = 19;

/// Planes of light with colors, and planes with numbers.
pub const COLORS: [(Key<Plane<[f32; 3]>>, u32); 5] = [
    (RADIANCE, AT_RADIANCE),
    (RADIANCE_SPECULAR, AT_SPECULAR),
    (RADIANCE_DEMODULATED, AT_DEMODULATED),
    (DENOISE_ALBEDO, AT_ALBEDO),
    (DENOISE_NORMAL, AT_NORMAL),
];
pub const NUMBERS: [(Key<Plane<f32>>, u32); 3] = [
    (RADIANCE_VARIANCE, AT_VARIANCE),
    (RADIANCE_SPECULAR_VARIANCE, AT_SPECULAR_VARIANCE),
    (RADIANCE_DEMODULATED_VARIANCE, AT_DEMODULATED_VARIANCE),
];

/// First words of the labels that a view wants, in the output; [`NONE`] for others.
#[derive(Clone, Copy, Debug)]
pub struct LabelSections {
    pub depth: u32,
    pub instance: u32,
    pub normal: u32,
    pub albedo: u32,
    pub coverage: u32,
    pub before: u32,
    pub object_depths: u32,
    /// Words of a pixel's set of objects, and number of objects.
    set: usize,
    objects: usize,
    /// Words of all sections.
    pub end: u64,
}

impl LabelSections {
    /// Sections of the wanted labels of an image; `set` is the number of words of a pixel's set of `objects`.
    pub fn new(wants: &[KeyId], pixels: u64, set: usize, objects: usize) -> Self {
        let mut end = 0;
        let mut section = |key: KeyId, words: usize| match wants.contains(&key) {
            true => {
                let start = end;
                end += pixels * words as u64;
                start as u32
            }
            false => NONE,
        };
        Self {
            coverage: section(COVERAGE.id(), set),
            before: section(COVERAGE_BEFORE_SUPPORT.id(), set),
            depth: section(DEPTH.id(), 1),
            instance: section(INSTANCE.id(), 1),
            normal: section(NORMAL.id(), 3),
            albedo: section(ALBEDO.id(), 3),
            object_depths: section(OBJECT_DEPTHS.id(), objects),
            set,
            objects,
            end,
        }
    }

    /// A view whose labels are written to these sections.
    pub fn placed_in(&self, view: View) -> View {
        View {
            coverage_at: self.coverage,
            before_at: self.before,
            depth_at: self.depth,
            instance_at: self.instance,
            normal_at: self.normal,
            albedo_at: self.albedo,
            object_depths_at: self.object_depths,
            ..view
        }
    }

    /// Words of all pixels that depend on the number of objects of the scene.
    pub fn words_of_objects(&self) -> u64 {
        let sections =
            [(self.coverage, self.set), (self.before, self.set), (self.object_depths, self.objects)].into_iter();
        sections.filter(|(section, _)| *section != NONE).map(|(_, words)| words as u64).sum()
    }

    /// Whether no label is wanted.
    pub fn is_empty(&self) -> bool {
        [self.depth, self.instance, self.normal, self.albedo, self.coverage, self.before, self.object_depths]
            .iter()
            .all(|&section| section == NONE)
    }

    /// Makers of the wanted labels that `output` holds.
    pub fn makers<'a>(&self, wants: &[KeyId], size: [u32; 2], output: &'a [u32]) -> Vec<Maker<'a>> {
        let [width, height] = size;
        let pixels = width as usize * height as usize;
        let section = |key: KeyId, start: u32, words: usize| {
            (start != NONE && wants.contains(&key)).then(|| &output[start as usize..][..pixels * words])
        };
        let (objects, set) = (self.objects, self.set);
        let mut makers: Vec<Maker> = Vec::new();
        for (key, start) in [(COVERAGE, self.coverage), (COVERAGE_BEFORE_SUPPORT, self.before)] {
            if let Some(words) = section(key.id(), start, self.set) {
                makers.push(Box::new(move |frame| {
                    frame.put(key, BitPlane::from_words(width, height, objects, pairs(words, set)))
                }));
            }
        }
        if let Some(words) = section(DEPTH.id(), self.depth, 1) {
            makers.push(Box::new(move |frame| {
                // 0 marks a pixel without a ray.
                let depth = |&word: &u32| if word == 0 { f32::INFINITY } else { finite_or_infinite(word) };
                frame.put(DEPTH, Plane::from_vec(width, height, words.iter().map(depth).collect()))
            }));
        }
        if let Some(words) = section(INSTANCE.id(), self.instance, 1) {
            makers.push(Box::new(move |frame| {
                // The kernel writes the index of the body plus 1, and 0 for the background.
                let id = |&word: &u32| if word == 0 { InstanceId::BACKGROUND } else { instance_id(word - 1) };
                frame.put(INSTANCE, Plane::from_vec(width, height, words.iter().map(id).collect()))
            }));
        }
        if let Some(words) = section(OBJECT_DEPTHS.id(), self.object_depths, self.objects) {
            makers.push(Box::new(move |frame| {
                let mut hits = Vec::new();
                for (pixel, depths) in (0..).zip(words.chunks_exact(objects.max(1))) {
                    let of = |(object, &word): (u32, &u32)| (pixel, instance_id(object), finite_or_infinite(word));
                    hits.extend((0..).zip(depths).map(of).filter(|(.., depth)| depth.is_finite()));
                }
                frame.put(OBJECT_DEPTHS, ObjectDepths::from_hits(width, height, hits))
            }));
        }
        for (key, start) in [(NORMAL, self.normal), (ALBEDO, self.albedo)] {
            if let Some(words) = section(key.id(), start, 3) {
                makers.push(Box::new(move |frame| frame.put(key, color(size, words))));
            }
        }
        makers
    }
}

/// Makes a product from words that were read back. Copying a plane takes longer than computing it on a card, so threads
/// share the makers.
pub type Maker<'a> = Box<dyn Fn(&mut Products) -> Result<()> + Sync + 'a>;

/// Runs all makers, and puts their products into the frame.
pub fn make_all(makers: &[Maker], workers: &dyn Workers, frame: &mut Products) -> Result<()> {
    let made: Vec<OnceLock<Result<Products>>> = makers.iter().map(|_| OnceLock::new()).collect();
    workers.run(makers.len(), &|i| {
        let mut products = Products::new();
        let _ = made[i].set(makers[i](&mut products).map(|()| products));
    });
    made.into_iter().filter_map(OnceLock::into_inner).try_for_each(|products| frame.extend(products?))
}

/// Sets in words of 32 bits as sets in words of 64 bits; each set has `set` words of 32 bits.
fn pairs(words: &[u32], set: usize) -> Vec<u64> {
    if set == 1 {
        return words.iter().map(|&word| word.into()).collect();
    }
    let pair = |pair: &[u32]| pair.iter().rev().fold(0, |bits, &word| bits << 32 | u64::from(word));
    words.chunks_exact(set).flat_map(|set| set.chunks(2).map(pair)).collect()
}

/// A plane of colors or directions.
pub fn color([width, height]: [u32; 2], words: &[u32]) -> Plane<[f32; 3]> {
    let vector = |vector: &[u32; 3]| vector.map(f32::from_bits);
    Plane::from_vec(width, height, words.as_chunks().0.iter().map(vector).collect())
}

/// A plane of numbers.
pub fn number([width, height]: [u32; 2], words: &[u32]) -> Plane<f32> {
    Plane::from_vec(width, height, words.iter().map(|&word| finite_or_infinite(word)).collect())
}

/// A number from a device; very large numbers become infinity.
fn finite_or_infinite(word: u32) -> f32 {
    let x = f32::from_bits(word);
    if x < FAR { x } else { f32::INFINITY }
}
