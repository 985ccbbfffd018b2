//! Owen-scrambled Sobol' points, two dimensions at a time.
//!
//! A path asks for pairs of numbers; every pair is a (0, 2)-sequence over the samples of its pixel, shuffled and
//! scrambled on its own (Burley, "Practical Hash-based Owen Scrambling", JCGT 2020), so that pairs are independent of
//! each other and of other pixels' while each is spread as evenly as can be. Later pairs are plain hashes: noise there
//! is hardly noticed, and hashes cost less. Everything is a pure function of (seed, pixel, sample, pair).

use crate::real::Int;

/// Pairs that are Sobol' points; later ones are hashes.
const SOBOL_PAIRS: u32 = 12;

/// What the samples of one pixel share.
pub(crate) fn pixel_seed(seed: u64, x: u32, y: u32) -> u32 {
    let mut h = seed ^ u64::from(x) << 32 ^ u64::from(y);
    h = (h ^ h >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    h = (h ^ h >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    (h ^ h >> 31) as u32
}

/// The numbers of a path: of the sample `index` of a pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sampler<I = u32> {
    /// From [`pixel_seed`].
    pub seed: I,
    /// The sample's number, from 0.
    pub index: I,
}

impl<I: Int> Sampler<I> {
    /// A pair of numbers in [0, 1); `number` counts from 0.
    #[inline(always)]
    pub fn pair(&self, number: u32) -> [I::Real; 2] {
        let seed = hash(self.seed ^ I::splat(number.wrapping_mul(0x9e37_79b9)));
        if number < SOBOL_PAIRS {
            // Shuffling an index is scrambling its digits from the highest down.
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

    /// A number in [0, 1) that is merely random, unrelated to the pairs.
    #[inline(always)]
    pub fn coin(&self, number: u32) -> I::Real {
        let seed = self.seed ^ I::splat(number.wrapping_mul(0xc2b2_ae35) ^ 0x27d4_eb2f);
        unit(hash(hash(seed) ^ self.index.times(I::splat(0x85eb_ca6b))))
    }
}

#[inline(always)]
fn unit<I: Int>(bits: I) -> I::Real {
    (bits >> 8).signed_to_real() * (1.0_f32 / (1 << 24) as f32)
}

/// A bijection that scatters bits (Wellons' search, "lowbias32").
#[inline(always)]
fn hash<I: Int>(x: I) -> I {
    let x = (x ^ x >> 16).times(I::splat(0x7feb_352d));
    let x = (x ^ x >> 15).times(I::splat(0x846c_a68b));
    x ^ x >> 16
}

/// Owen scrambling of a bit-reversed number: every bit is flipped or not by the bits below it alone
/// (Laine and Karras 2011, with Vegdahl's constants).
#[inline(always)]
fn scramble_reversed<I: Int>(x: I, seed: I) -> I {
    let x = x ^ x.times(I::splat(0x3d20_adea));
    let x = x.plus(seed);
    let x = x.times(seed >> 16 | I::splat(1));
    let x = x ^ x.times(I::splat(0x0552_6c56));
    x ^ x.times(I::splat(0x53a2_2864))
}

/// The second Sobol' dimension, bit-reversed, of an index: Pascal's triangle modulo two, by doubling.
#[inline(always)]
fn pascal<I: Int>(index: I) -> I {
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

    #[test]
    fn every_pair_is_a_net() {
        // A (0, 2)-sequence in base 2: each elementary rectangle of area 1/64 holds one of the first 64 points.
        for (x, y) in [(0, 0), (17, 4)] {
            let seed = pixel_seed(5, x, y);
            for pair in 0..SOBOL_PAIRS {
                for split in 0..=6 {
                    let mut seen = [false; 64];
                    for index in 0..64 {
                        let [u, v] = Sampler { seed, index }.pair(pair);
                        let (columns, rows) = (1 << split, 64 >> split);
                        let cell = (u * columns as f32) as usize * rows + (v * rows as f32) as usize;
                        assert!(!std::mem::replace(&mut seen[cell], true), "pair {pair}, split {split}");
                    }
                }
            }
        }
    }

    #[test]
    fn pairs_and_pixels_are_uncorrelated() {
        let correlation = |points: Vec<[f32; 2]>| {
            let n = points.len() as f64;
            let sum: f64 = points.iter().map(|p| (f64::from(p[0]) - 0.5) * (f64::from(p[1]) - 0.5) * 12.0).sum();
            sum / n.sqrt()
        };
        // Between pairs of a path, between neighbouring pixels, and within hashed pairs: standard normal.
        let sampler = |x: u32, index: u32| Sampler { seed: pixel_seed(9, x, 3), index };
        let check = |name: &str, point: &dyn Fn(u32) -> [f32; 2]| {
            let z = correlation((0..4096).map(point).collect());
            assert!(z.abs() < 4.0, "{name}: {z}");
        };
        for (a, b) in [(0, 1), (2, 7), (10, 11), (12, 13)] {
            check(&format!("pairs {a} and {b}"), &|i| {
                let sampler = sampler(i / 4, i % 4);
                [sampler.pair(a)[0], sampler.pair(b)[1]]
            });
        }
        check("pixels", &|x| [sampler(x, 0).pair(0)[0], sampler(x + 1, 0).pair(0)[0]]);
        check("hashes", &|x| sampler(x, x & 3).pair(13));
        check("coins", &|x| [sampler(x, 1).coin(1), sampler(x, 1).coin(2)]);
        check("coins and pairs", &|x| [sampler(x, x & 3).coin(1), sampler(x, x & 3).pair(12)[0]]);
    }
}
