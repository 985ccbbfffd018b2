//! Named, counter-based random streams.
//!
//! A [`Stream`] is a position in a tree of names and numbers, hashed to the key of a Philox4x32-10 generator
//! (Salmon et al., SC 2011). Draws depend on the path alone: never on time, thread or the order in which other
//! streams are used. All distributions here are our own and value-stable: changing one is a breaking change.

use crate::geometry::{UnitQuaternion, Vector3};
use nalgebra::Quaternion;

/// A named stream of random numbers.
///
/// ```
/// use syntable_model::random::Stream;
/// let scene = Stream::root(7).child("objects").at(3);
/// let (mut a, mut b) = (scene.child("count"), scene.child("poses"));
/// assert_ne!(a.next_u64(), b.next_u64());
/// assert_eq!(scene.child("count").next_u64(), scene.child("count").next_u64());
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stream {
    node: u64,
    block: u64,
    buffer: [u32; 4],
    left: u8,
}

impl Stream {
    /// The stream at the root of a dataset's tree.
    pub fn root(seed: u64) -> Self {
        Self::of_node(mix(seed ^ 0x5359_4e54_4142_4c45))
    }

    fn of_node(node: u64) -> Self {
        Self { node, block: 0, buffer: [0; 4], left: 0 }
    }

    /// The child of a name. Children are independent of each other and of the position of this stream.
    pub fn child(&self, name: &str) -> Self {
        let fnv = name
            .bytes()
            .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
        Self::of_node(mix(self.node.rotate_left(17) ^ mix(fnv ^ 0x6e61_6d65)))
    }

    /// The child of a number: a scene, a view, an attempt, an item.
    pub fn at(&self, index: u64) -> Self {
        Self::of_node(mix(self.node.rotate_left(31) ^ mix(index ^ 0x696e_6465_7800)))
    }

    /// A number that identifies this stream: a seed for kernels that hash (pixel, sample, dimension).
    pub fn seed(&self) -> u64 {
        self.node
    }

    /// 32 random bits.
    #[inline]
    pub fn next_u32(&mut self) -> u32 {
        if self.left == 0 {
            let counter = [self.block as u32, (self.block >> 32) as u32, 0, 0];
            self.buffer = philox4x32([self.node as u32, (self.node >> 32) as u32], counter);
            self.block += 1;
            self.left = 4;
        }
        self.left -= 1;
        self.buffer[3 - usize::from(self.left)]
    }

    /// 64 random bits.
    #[inline]
    pub fn next_u64(&mut self) -> u64 {
        u64::from(self.next_u32()) | u64::from(self.next_u32()) << 32
    }

    /// Uniform in [0, 1), 53 bits.
    #[inline]
    pub fn unit(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in [low, high); `low` if the bounds are equal.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A uniform integer below `n`, without bias. Zero if `n` is zero.
    pub fn below(&mut self, n: u64) -> u64 {
        if n == 0 {
            return 0;
        }
        let reject_below = n.wrapping_neg() % n;
        loop {
            let product = u128::from(self.next_u64()) * u128::from(n);
            if product as u64 >= reject_below {
                return (product >> 64) as u64;
            }
        }
    }

    /// A uniform integer in [low, high], both ends included.
    pub fn integer(&mut self, low: i64, high: i64) -> i64 {
        low + self.below((high - low) as u64 + 1) as i64
    }

    /// True with the given probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    /// A standard normal number (Box and Muller; two uniforms a draw).
    #[inline]
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(1.0 - self.unit())).sqrt();
        radius * libm::cos(std::f64::consts::TAU * self.unit())
    }

    /// One item, uniformly; none if the list is empty.
    pub fn pick<'a, T>(&mut self, items: &'a [T]) -> Option<&'a T> {
        items.get(self.below(items.len() as u64) as usize)
    }

    /// The place of one of several weights, in proportion to them; none without a weight above 0. Weights are at least 0.
    pub fn pick_by_weight(&mut self, weights: impl IntoIterator<Item = f64, IntoIter: Clone>) -> Option<usize> {
        let weights = weights.into_iter();
        let mut at = self.uniform(0.0, weights.clone().sum());
        let mut last = None;
        for (place, weight) in weights.enumerate().filter(|(_, weight)| *weight > 0.0) {
            at -= weight;
            last = Some(place);
            if at < 0.0 {
                break;
            }
        }
        // Rounding can leave no weight below the total.
        last
    }

    /// Puts items in a uniformly random order (Fisher and Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, self.below(i as u64 + 1) as usize);
        }
    }

    /// A rotation uniform on SO(3) (Shoemake, Graphics Gems III).
    pub fn rotation(&mut self) -> UnitQuaternion<f64> {
        let (u, v, w) = (self.unit(), self.unit() * std::f64::consts::TAU, self.unit() * std::f64::consts::TAU);
        let (a, b) = ((1.0 - u).sqrt(), u.sqrt());
        UnitQuaternion::from_quaternion(Quaternion::new(
            b * libm::cos(w),
            a * libm::sin(v),
            a * libm::cos(v),
            b * libm::sin(w),
        ))
    }

    /// A direction uniform on the unit sphere.
    pub fn direction(&mut self) -> Vector3<f64> {
        let z = self.uniform(-1.0, 1.0);
        let angle = self.unit() * std::f64::consts::TAU;
        let r = (1.0 - z * z).max(0.0).sqrt();
        Vector3::new(r * libm::cos(angle), r * libm::sin(angle), z)
    }
}

/// The finaliser of SplitMix64: a bijection that scatters bits.
fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// Philox4x32 with ten rounds.
pub fn philox4x32(key: [u32; 2], counter: [u32; 4]) -> [u32; 4] {
    let ([mut k0, mut k1], [mut a, mut b, mut c, mut d]) = (key, counter);
    for _ in 0..10 {
        let p = u64::from(a) * 0xD251_1F53;
        let q = u64::from(c) * 0xCD9E_8D57;
        (a, b, c, d) = ((q >> 32) as u32 ^ b ^ k0, q as u32, (p >> 32) as u32 ^ d ^ k1, p as u32);
        k0 = k0.wrapping_add(0x9E37_79B9);
        k1 = k1.wrapping_add(0xBB67_AE85);
    }
    [a, b, c, d]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn philox_gives_the_published_known_answers() {
        assert_eq!(philox4x32([0; 2], [0; 4]), [0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8]);
        assert_eq!(philox4x32([!0; 2], [!0; 4]), [0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd]);
    }

    #[test]
    fn a_child_does_not_depend_on_draws() {
        let fresh = Stream::root(1);
        let mut used = fresh.clone();
        used.next_u64();
        assert_eq!(fresh.child("a").at(2), used.child("a").at(2));
        assert_ne!(fresh.child("a"), fresh.child("b"));
        assert_ne!(fresh.at(0), fresh.at(1));
    }

    #[test]
    fn integers_reach_both_ends_evenly() {
        let mut stream = Stream::root(3);
        let mut counts = [0_i32; 5];
        for _ in 0..50_000 {
            counts[(stream.integer(-2, 2) + 2) as usize] += 1;
        }
        // χ² with 4 degrees of freedom: 23.5 is the 1e-4 tail.
        let chi2: f64 = counts.iter().map(|&n| f64::from(n - 10_000).powi(2) / 10_000.0).sum();
        assert!(chi2 < 23.5, "{counts:?}");
    }

    #[test]
    fn places_are_drawn_by_weight() {
        let (mut stream, weights) = (Stream::root(4), [0.0, 1.0, 0.0, 2.5, 0.5, 0.0]);
        let mut counts = [0_i32; 6];
        for _ in 0..40_000 {
            counts[stream.pick_by_weight(weights).expect("weights above 0")] += 1;
        }
        assert_eq!([counts[0], counts[2], counts[5]], [0; 3]);
        // χ² with 2 degrees of freedom: 18.4 is the 1e-4 tail.
        let expected = weights.map(|weight| 10_000.0 * weight);
        let chi2: f64 = [1, 3, 4].map(|i| (f64::from(counts[i]) - expected[i]).powi(2) / expected[i]).iter().sum();
        assert!(chi2 < 18.4, "{counts:?}");
        assert_eq!(stream.pick_by_weight([]), None);
        assert_eq!(stream.pick_by_weight([0.0, 0.0]), None);
    }

    #[test]
    fn rotations_are_uniform() {
        // For a uniform rotation the image of any axis is uniform on the sphere: its mean is 0 and the
        // mean square of each component is 1/3; the rotation angle has density (1 - cos θ)/π, mean π/2 + 2/π.
        let mut stream = Stream::root(5);
        let n = 20_000;
        let (mut mean, mut square, mut angle) = (Vector3::zeros(), Vector3::zeros(), 0.0);
        for _ in 0..n {
            let q = stream.rotation();
            let image = q * Vector3::x();
            mean += image / n as f64;
            square += image.component_mul(&image) / n as f64;
            angle += q.angle() / n as f64;
        }
        let pi = std::f64::consts::PI;
        assert!(mean.norm() < 0.02, "{mean}");
        assert!((square - Vector3::repeat(1.0 / 3.0)).norm() < 0.02, "{square}");
        assert!((angle - (pi / 2.0 + 2.0 / pi)).abs() < 0.02, "{angle}");
    }

    #[test]
    fn normals_have_unit_variance() {
        let mut stream = Stream::root(9);
        let draws: Vec<f64> = (0..20_000).map(|_| stream.normal()).collect();
        let mean = draws.iter().sum::<f64>() / draws.len() as f64;
        let variance = draws.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / draws.len() as f64;
        assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.05, "{mean} {variance}");
    }
}
