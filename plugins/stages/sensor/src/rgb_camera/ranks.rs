//! Values of a list by rank.

/// Bits of a number that choose its bin: the exponent, and seven bits of the fraction.
const BITS: u32 = 16;

/// The values of a list in their order, without a sorted copy: a histogram leads to the few values near a rank.
pub struct Ranks<'v> {
    values: &'v [f32],
    /// Number of values in each bin.
    counts: Vec<u32>,
}

impl<'v> Ranks<'v> {
    /// Counts the values.
    pub fn new(values: &'v [f32]) -> Self {
        let mut counts = vec![0; 1 << BITS];
        values.iter().for_each(|value| counts[bin_of(*value)] += 1);
        Self { values, counts }
    }

    /// The value that a sorted list has at a position, and NaN beyond the end. The order is [`f32::total_cmp`].
    pub fn at(&self, rank: usize) -> f32 {
        let mut before = 0;
        for (bin, count) in self.counts.iter().enumerate() {
            let end = before + *count as usize;
            if rank < end {
                let mut near = self.of_bin(bin);
                return *near.select_nth_unstable_by(rank - before, f32::total_cmp).1;
            }
            before = end;
        }
        f32::NAN
    }

    /// The values of a bin. Most groups of values have none, which takes one look at all of the group together.
    fn of_bin(&self, bin: usize) -> Vec<f32> {
        let mut found = Vec::with_capacity(self.counts[bin] as usize);
        for group in self.values.chunks(16) {
            if group.iter().fold(false, |any, value| any | (bin_of(*value) == bin)) {
                found.extend(group.iter().filter(|value| bin_of(**value) == bin));
            }
        }
        found
    }
}

/// The bin of a number. Bins have the order of their numbers.
#[inline]
fn bin_of(value: f32) -> usize {
    let bits = value.to_bits();
    // All bits of a negative number, and the sign of a positive one.
    let flipped = (bits.cast_signed() >> 31).cast_unsigned() | 1 << 31;
    ((bits ^ flipped) >> (32 - BITS)) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::random::Stream;

    #[test]
    fn every_rank_is_the_one_of_the_sorted_list() {
        let mut stream = Stream::root(1);
        let odd = [f32::NAN, -f32::NAN, 0.0, -0.0, f32::INFINITY, f32::NEG_INFINITY, 1e-44, -1e-44, f32::MAX];
        let mut values: Vec<f32> = (0..700).map(|_| stream.normal() as f32).chain(odd).collect();
        values.extend((0..300).map(|_| 1.0 + stream.unit() as f32 * 1e-5).chain([0.25; 50]));
        let mut sorted = values.clone();
        sorted.sort_by(f32::total_cmp);
        let ranks = Ranks::new(&values);
        for (rank, want) in sorted.iter().enumerate() {
            assert_eq!(ranks.at(rank).to_bits(), want.to_bits(), "rank {rank}");
        }
        assert!(ranks.at(values.len()).is_nan() && Ranks::new(&[]).at(0).is_nan());
    }
}
