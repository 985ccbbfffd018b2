//! Owen-scrambled Sobol' points, two dimensions at a time.
//!
//! A path requests pairs of numbers. Every pair is a (0, 2)-sequence over the samples of a block of pixels, shuffled
//! and scrambled independently (Burley, "Practical Hash-based Owen Scrambling", JCGT 2020), so pairs are independent of
//! each other, and each is spread as evenly as possible. Within a block, samples are numbered pixel by pixel along a
//! Morton curve (Ahmed and Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via Hierarchical
//! Ordering of Pixels", SIGGRAPH Asia 2020). Therefore, not only the samples of a pixel are spread evenly, but also the
//! samples of 2 × 2, 4 × 4 and 8 × 8 pixels, and errors of neighbors cancel, both for the eye and for denoisers. Later
//! pairs are plain hashes, which cost less, and whose noise is hardly visible. Every number is a pure function of
//! (seed, pixel, sample, pair).

use syntable_simd::Int;

/// The same functions in WGSL.
pub const SAMPLER_WGSL: &str = include_str!("sampler.wgsl");

/// Number of pairs that are Sobol' points. Later pairs are hashes.
pub const SOBOL_PAIRS: u32 = 12;

/// Assigns sample numbers to the pixels of an image.
#[derive(Clone, Copy, Debug)]
pub struct SampleOrder {
    seed: u64,
    /// Base-2 logarithm of the number of sample numbers per pixel.
    sample_bits: u32,
    /// Base-2 logarithm of the edge of a block, pixels.
    block_bits: u32,
}

impl SampleOrder {
    /// An order for images with up to `samples` per pixel.
    pub fn new(seed: u64, samples: u32) -> Self {
        let sample_bits = samples.max(1).next_power_of_two().trailing_zeros();
        Self { seed, sample_bits, block_bits: (30_u32.saturating_sub(sample_bits) / 2).min(8) }
    }

    /// Seed of the image.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Base-2 logarithm of the number of samples per pixel.
    pub fn sample_bits(&self) -> u32 {
        self.sample_bits
    }

    /// Base-2 logarithm of the edge of a block of pixels.
    pub fn block_bits(&self) -> u32 {
        self.block_bits
    }

    /// Seed of the pixel's block, and number of the pixel's first sample. Its other samples follow.
    pub fn pixel(&self, x: u32, y: u32) -> (u32, u32) {
        let block = |c: u32| u64::from(c >> self.block_bits);
        let inside = |c: u32| spread(c & ((1 << self.block_bits) - 1));
        let mut h = self.seed ^ block(x) << 32 ^ block(y);
        h = (h ^ h >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        h = (h ^ h >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((h ^ h >> 31) as u32, (inside(x) | inside(y) << 1) << self.sample_bits)
    }
}

/// Moves the bits of a number below 2⁸ to the even positions.
fn spread(x: u32) -> u32 {
    let x = (x | x << 4) & 0x0f0f;
    let x = (x | x << 2) & 0x3333;
    (x | x << 1) & 0x5555
}

/// Random numbers of a path, for one sample of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct Sampler<I = u32> {
    /// Seed of the block of pixels.
    pub seed: I,
    /// Number of the sample in the block.
    pub index: I,
}

impl<I: Int> Sampler<I> {
    /// A pair of numbers in [0, 1) with the dimension `number`, from 0.
    #[inline(always)]
    pub fn pair(&self, number: u32) -> [I::Real; 2] {
        let seed = hash(self.seed ^ I::splat(number.wrapping_mul(0x9e37_79b9)));
        if number < SOBOL_PAIRS {
            // Shuffling an index means scrambling its digits from the highest down.
            let shuffled = scramble_reversed(self.index.reverse_bits(), seed).reverse_bits();
            // Its first Sobol' dimension is the index with its bits reversed.
            let first = scramble_reversed(shuffled, seed ^ I::splat(0x7f4a_7c15));
            let second = scramble_reversed(pascal(shuffled), seed ^ I::splat(0x5bd1_e995));
            [unit(first.reverse_bits()), unit(second.reverse_bits())]
        } else {
            let a = hash(seed ^ self.index.times(I::splat(0x85eb_ca6b)));
            [unit(a), unit(hash(a))]
        }
    }

    /// A plain random number in [0, 1), independent of the pairs.
    #[inline(always)]
    pub fn random(&self, number: u32) -> I::Real {
        let seed = self.seed ^ I::splat(number.wrapping_mul(0xc2b2_ae35) ^ 0x27d4_eb2f);
        unit(hash(hash(seed) ^ self.index.times(I::splat(0x85eb_ca6b))))
    }
}

/// A number in [0, 1) from the upper 24 bits.
#[inline(always)]
pub fn unit<I: Int>(bits: I) -> I::Real {
    (bits >> 8).signed_to_real() * (1.0_f32 / (1 << 24) as f32)
}

/// A bijection that scatters bits (Wellons' search, "lowbias32").
#[inline(always)]
pub fn hash<I: Int>(x: I) -> I {
    let x = (x ^ x >> 16).times(I::splat(0x7feb_352d));
    let x = (x ^ x >> 15).times(I::splat(0x846c_a68b));
    x ^ x >> 16
}

/// Owen scrambling of a bit-reversed number: each bit is flipped depending only on the bits below it (Laine and Karras
/// 2011, with Vegdahl's constants).
#[inline(always)]
pub fn scramble_reversed<I: Int>(x: I, seed: I) -> I {
    let x = x ^ x.times(I::splat(0x3d20_adea));
    let x = x.plus(seed);
    let x = x.times(seed >> 16 | I::splat(1));
    let x = x ^ x.times(I::splat(0x0552_6c56));
    x ^ x.times(I::splat(0x53a2_2864))
}

/// The second Sobol' dimension, bit-reversed, of an index: Pascal's triangle modulo two, by doubling.
#[inline(always)]
pub fn pascal<I: Int>(index: I) -> I {
    let mut b = index;
    b = b ^ (b >> 16 & I::splat(0x0000_ffff));
    b = b ^ (b >> 8 & I::splat(0x00ff_00ff));
    b = b ^ (b >> 4 & I::splat(0x0f0f_0f0f));
    b = b ^ (b >> 2 & I::splat(0x3333_3333));
    b ^ (b >> 1 & I::splat(0x5555_5555))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The textbook form: direction numbers v₀ = 2³¹, vₖ = vₖ₋₁ ^ vₖ₋₁ / 2.
    fn sobol2(mut index: u32) -> u32 {
        let (mut out, mut v) = (0, 1_u32 << 31);
        while index != 0 {
            if index & 1 == 1 {
                out ^= v;
            }
            index >>= 1;
            v ^= v >> 1;
        }
        out
    }

    #[test]
    fn the_second_dimension_is_sobols() {
        for index in (0..5000).chain([0x8000_0001, 0xdead_beef, u32::MAX]) {
            assert_eq!(pascal(index).reverse_bits(), sobol2(index), "{index}");
        }
    }

    /// A (0, 2)-sequence in base 2: each elementary rectangle of area 1/64 has one of 64 points.
    fn is_net(points: &[[f32; 2]], what: &str) {
        assert_eq!(points.len(), 64);
        for split in 0..=6 {
            let mut seen = [false; 64];
            for [u, v] in points {
                let (columns, rows) = (1 << split, 64 >> split);
                let cell = (u * columns as f32) as usize * rows + (v * rows as f32) as usize;
                assert!(!std::mem::replace(&mut seen[cell], true), "{what}, split {split}");
            }
        }
    }

    #[test]
    fn samples_of_a_pixel_and_of_a_square_of_pixels_are_nets() {
        for pair in 0..SOBOL_PAIRS {
            let point = |order: &SampleOrder, x: u32, y: u32, sample: u32| {
                let (seed, first) = order.pixel(x, y);
                Sampler { seed, index: first + sample }.pair(pair)
            };
            let many = SampleOrder::new(5, 64);
            for (x, y) in [(0, 0), (17, 4), (639, 479)] {
                let points: Vec<_> = (0..64).map(|sample| point(&many, x, y, sample)).collect();
                is_net(&points, &format!("pair {pair} of pixel {x}, {y}"));
            }
            for (samples, edge) in [(1, 8), (4, 4), (16, 2)] {
                let order = SampleOrder::new(6, samples);
                let corner = (edge * 37, edge * 11);
                let place = |i: u32| (corner.0 + i / samples % edge, corner.1 + i / samples / edge, i % samples);
                let points: Vec<_> = (0..64).map(place).map(|(x, y, sample)| point(&order, x, y, sample)).collect();
                is_net(&points, &format!("pair {pair} of {edge} × {edge} pixels of {samples} samples"));
            }
        }
    }

    #[test]
    fn every_pixel_has_numbers_of_its_own() {
        for samples in [1, 3, 64, 1000, 1 << 20] {
            let order = SampleOrder::new(1, samples);
            let edge = 1_u32 << order.block_bits.min(4);
            let mut firsts: Vec<u32> = (0..edge * edge).map(|i| order.pixel(i % edge, i / edge).1).collect();
            firsts.sort_unstable();
            assert!(firsts.windows(2).all(|pair| pair[1] - pair[0] >= samples), "{samples}");
            assert_ne!(order.pixel(0, 0).0, order.pixel(1 << order.block_bits, 0).0);
        }
    }

    #[test]
    fn pairs_are_uncorrelated() {
        let correlation = |points: Vec<[f32; 2]>| {
            let n = points.len() as f64;
            let sum: f64 = points.iter().map(|p| (f64::from(p[0]) - 0.5) * (f64::from(p[1]) - 0.5) * 12.0).sum();
            sum / n.sqrt()
        };
        let sampler = |i: u32| {
            let (seed, first) = SampleOrder::new(9, 4).pixel(i / 4 % 64, i / 256);
            Sampler { seed, index: first + i % 4 }
        };
        let check = |name: &str, point: &dyn Fn(u32) -> [f32; 2]| {
            let z = correlation((0..4096).map(point).collect());
            assert!(z.abs() < 4.0, "{name}: {z}");
        };
        for (a, b) in [(0, 1), (2, 7), (10, 11), (12, 13)] {
            check(&format!("pairs {a} and {b}"), &|i| [sampler(i).pair(a)[0], sampler(i).pair(b)[1]]);
        }
        check("hashes", &|i| sampler(i).pair(13));
        check("random numbers", &|i| [sampler(i).random(1), sampler(i).random(2)]);
        check("random numbers and pairs", &|i| [sampler(i).random(1), sampler(i).pair(12)[0]]);
    }
}
