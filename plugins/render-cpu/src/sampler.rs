//! Owen-scrambled Sobol' points, two dimensions at a time.
//!
//! A path asks for pairs of numbers; every pair is a (0, 2)-sequence over the samples of its pixel, shuffled and
//! scrambled on its own (Burley, "Practical Hash-based Owen Scrambling", JCGT 2020), so that pairs are independent of
//! each other and of other pixels' while each is spread as evenly as can be. Later pairs are plain hashes: noise there
//! is hardly noticed, and hashes cost less. Everything is a pure function of (seed, pixel, sample, pair).

/// Pairs that are Sobol' points; later ones are hashes.
const SOBOL_PAIRS: u32 = 11;

/// What the samples of one pixel share.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelSeed(u32);

impl PixelSeed {
    /// `seed` is the picture's.
    pub fn new(seed: u64, x: u32, y: u32) -> Self {
        let mut h = seed ^ u64::from(x) << 32 ^ u64::from(y);
        h = (h ^ h >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        h = (h ^ h >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        Self((h ^ h >> 31) as u32)
    }

    /// The numbers of one path.
    #[inline(always)]
    pub fn sample(self, index: u32) -> Sampler {
        Sampler { reversed: index.reverse_bits(), seed: self.0, pair: 0, index }
    }
}

/// The numbers of one path, drawn in order.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sampler {
    /// The sample's number with its bits reversed.
    reversed: u32,
    seed: u32,
    pair: u32,
    index: u32,
}

impl Sampler {
    /// The next pair, each in [0, 1).
    #[inline(always)]
    pub fn pair(&mut self) -> [f32; 2] {
        let seed = hash(self.seed ^ self.pair.wrapping_mul(0x9e37_79b9));
        self.pair += 1;
        if self.pair <= SOBOL_PAIRS {
            // With indices kept bit-reversed, shuffling them is one hash, and so is their first Sobol' dimension.
            let shuffled = scramble_reversed(self.reversed, seed).reverse_bits();
            let first = scramble_reversed(shuffled, seed ^ 0x7f4a_7c15);
            let second = scramble_reversed(pascal(shuffled), seed ^ 0x5bd1_e995);
            [unit(first.reverse_bits()), unit(second.reverse_bits())]
        } else {
            let a = hash(seed ^ self.index.wrapping_mul(0x85eb_ca6b));
            [unit(a), unit(hash(a))]
        }
    }

    /// A number in [0, 1) that is merely random; does not disturb the pairs.
    #[inline(always)]
    pub fn coin(&self, salt: u32) -> f32 {
        let mixed =
            self.seed ^ self.index.wrapping_mul(0x85eb_ca6b) ^ (self.pair << 8 | salt).wrapping_mul(0xc2b2_ae35);
        unit(hash(mixed))
    }
}

#[inline(always)]
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

/// A bijection that scatters bits (Wellons' search, "lowbias32").
#[inline(always)]
fn hash(x: u32) -> u32 {
    let x = (x ^ x >> 16).wrapping_mul(0x7feb_352d);
    let x = (x ^ x >> 15).wrapping_mul(0x846c_a68b);
    x ^ x >> 16
}

/// Owen scrambling of a bit-reversed number: every bit is flipped or not by the bits below it alone
/// (Laine and Karras 2011, with Vegdahl's constants).
#[inline(always)]
fn scramble_reversed(x: u32, seed: u32) -> u32 {
    let x = x ^ x.wrapping_mul(0x3d20_adea);
    let x = x.wrapping_add(seed);
    let x = x.wrapping_mul(seed >> 16 | 1);
    let x = x ^ x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

/// The second Sobol' dimension, bit-reversed, of an index: Pascal's triangle modulo two, by doubling.
#[inline(always)]
fn pascal(index: u32) -> u32 {
    let mut b = index;
    b ^= b >> 16 & 0x0000_ffff;
    b ^= b >> 8 & 0x00ff_00ff;
    b ^= b >> 4 & 0x0f0f_0f0f;
    b ^= b >> 2 & 0x3333_3333;
    b ^ (b >> 1 & 0x5555_5555)
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
            let pixel = PixelSeed::new(5, x, y);
            for pair in 0..SOBOL_PAIRS {
                for split in 0..=6 {
                    let mut seen = [false; 64];
                    for index in 0..64 {
                        let mut sampler = pixel.sample(index);
                        let [u, v] = (0..=pair).map(|_| sampler.pair()).last().expect("one");
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
        let pixel = |x: u32| PixelSeed::new(9, x, 3);
        let nth = |mut sampler: Sampler, n: u32| (0..=n).map(|_| sampler.pair()).last().expect("one");
        for (a, b) in [(0, 1), (2, 7), (10, 11), (12, 13)] {
            let z = correlation(
                (0..4096)
                    .map(|i| [nth(pixel(i / 4).sample(i % 4), a)[0], nth(pixel(i / 4).sample(i % 4), b)[1]])
                    .collect(),
            );
            assert!(z.abs() < 4.0, "pairs {a} and {b}: {z}");
        }
        let z =
            correlation((0..4096).map(|x| [pixel(x).sample(0).pair()[0], pixel(x + 1).sample(0).pair()[0]]).collect());
        assert!(z.abs() < 4.0, "pixels: {z}");
        let z = correlation((0..4096).map(|x| nth(pixel(x).sample(x & 3), 13)).collect());
        assert!(z.abs() < 4.0, "hashes: {z}");
        let z = correlation((0..4096).map(|x| [pixel(x).sample(1).coin(1), pixel(x).sample(1).coin(2)]).collect());
        assert!(z.abs() < 4.0, "coins: {z}");
    }
}
