//! The frequencies of a quantity's values, in memory that does not grow with their number.

use super::quantity::{Quantity, equal_edges};
use serde::ser::{Serialize, Serializer};
use std::collections::BTreeMap;

/// Binning of histograms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Binning {
    /// Depends on the quantity: fixed for rates, whole numbers for counts, round widths for lengths.
    #[default]
    Fixed,
    /// Ten equal bins from the minimum to the maximum, as in the figures of the SynTable paper.
    Equal,
}

/// Number of bins of [`Binning::Equal`].
const EQUAL_BINS: u32 = 10;

/// Fraction of a step by which rounding may put a value below a whole number of steps.
const ROUNDING: f64 = 1e-6;

/// The values of a quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct Distribution {
    quantity: Quantity,
    /// Number of values by whole steps of [`About::step`](super::quantity::About::step).
    counts: BTreeMap<u64, u64>,
    n: u64,
    sum: f64,
    range: Option<[f64; 2]>,
    edges: Vec<f64>,
}

impl Distribution {
    /// No values of a quantity.
    pub fn new(quantity: Quantity) -> Self {
        Self { quantity, counts: BTreeMap::new(), n: 0, sum: 0.0, range: None, edges: Vec::new() }
    }

    /// Adds a finite, nonnegative value.
    pub fn add(&mut self, value: f64) {
        let steps = self.steps(value);
        self.add_counts([(steps, 1)], value, [value; 2]);
    }

    /// Adds numbers of values by whole steps, with the sum and the range of the values.
    pub fn add_counts(&mut self, counts: impl IntoIterator<Item = (u64, u64)>, sum: f64, [low, high]: [f64; 2]) {
        for (steps, count) in counts {
            *self.counts.entry(steps).or_default() += count;
            self.n += count;
        }
        self.sum += sum;
        let known = self.range.unwrap_or([low, high]);
        self.range = Some([known[0].min(low), known[1].max(high)]);
    }

    fn steps(&self, value: f64) -> u64 {
        (value / self.quantity.about().step + ROUNDING).floor().max(0.0) as u64
    }

    /// The quantity.
    pub fn quantity(&self) -> Quantity {
        self.quantity
    }

    /// Number of values.
    pub fn n(&self) -> u64 {
        self.n
    }

    /// Mean; `None` without values.
    pub fn mean(&self) -> Option<f64> {
        (self.n > 0).then(|| self.sum / self.n as f64)
    }

    /// Minimum and maximum; `None` without values.
    pub fn range(&self) -> Option<[f64; 2]> {
        self.range
    }

    /// Median, in whole steps; for an even number of values, the mean of the two middle ones. `None` without values.
    pub fn median(&self) -> Option<f64> {
        let middle = [self.ranked(self.n.checked_sub(1)? / 2)?, self.ranked(self.n / 2)?];
        Some((middle[0] + middle[1]) as f64 / 2.0 * self.quantity.about().step)
    }

    /// The value of a rank from 0, in whole steps.
    fn ranked(&self, rank: u64) -> Option<u64> {
        let mut below = 0;
        let found = self.counts.iter().find(|(_, count)| {
            below += **count;
            rank < below
        });
        found.map(|(steps, _)| *steps)
    }

    /// Values with their numbers, ascending, rounded down to whole steps.
    pub fn counts(&self) -> impl Iterator<Item = (f64, u64)> {
        let step = self.quantity.about().step;
        self.counts.iter().map(move |(steps, count)| (*steps as f64 * step, *count))
    }

    /// Edges of the bins of its histogram, one more than the number of bins. Empty before [`bin`].
    pub fn edges(&self) -> &[f64] {
        &self.edges
    }

    /// Number of values in each bin of its histogram. A bin includes its lower edge; only the last bin includes its
    /// upper edge.
    pub fn histogram(&self) -> Vec<u64> {
        let about = self.quantity.about();
        let mut bins = vec![0; self.edges.len().saturating_sub(1)];
        let Some(inner) = self.edges.get(1..bins.len()) else { return bins };
        let steps: Vec<f64> = inner
            .iter()
            .map(|edge| {
                let steps = edge / about.step;
                // Rounds an edge that should be a whole number of steps.
                if (steps - steps.round()).abs() < ROUNDING { steps.round() } else { steps }
            })
            .collect();
        for (value, count) in &self.counts {
            bins[steps.partition_point(|edge| *edge <= *value as f64)] += count;
        }
        bins
    }
}

/// Rebins the histograms of one quantity in several datasets to the same bins.
pub fn bin(distributions: &mut [&mut Distribution], binning: Binning) {
    let ranges = distributions.iter().filter_map(|it| it.range);
    let Some(range) = ranges.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]) else { return };
    for it in distributions {
        it.edges = match binning {
            Binning::Fixed => it.quantity.edges(range),
            Binning::Equal => equal_edges(EQUAL_BINS, range),
        };
    }
}

impl Serialize for Distribution {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(serde::Serialize)]
        struct DistributionJson<'a> {
            name: &'static str,
            title: &'static str,
            unit: &'static str,
            per: &'static str,
            n: u64,
            mean: Option<f64>,
            median: Option<f64>,
            min: Option<f64>,
            max: Option<f64>,
            edges: &'a [f64],
            counts: Vec<u64>,
        }
        let about = self.quantity.about();
        let (min, max) = self.range.map(|[low, high]| (low, high)).unzip();
        DistributionJson {
            name: about.name,
            title: about.title,
            unit: about.unit,
            per: about.per,
            n: self.n,
            mean: self.mean(),
            median: self.median(),
            min,
            max,
            edges: &self.edges,
            counts: self.histogram(),
        }
        .serialize(serializer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rates(values: &[(u32, u32)], binning: Binning) -> Distribution {
        let mut of = Distribution::new(Quantity::OcclusionRate);
        values.iter().for_each(|(hidden, all)| of.add(f64::from(*hidden) / f64::from(*all)));
        bin(&mut [&mut of], binning);
        of
    }

    #[test]
    fn values_at_edges_are_in_the_upper_bin() {
        // Every tenth, for an area whose tenths are not exact in binary, and one pixel below.
        let at: Vec<(u32, u32)> = (0..=10).map(|tenth| (30_719 * tenth, 307_190)).collect();
        assert_eq!(rates(&at, Binning::Fixed).histogram(), [1, 1, 1, 1, 1, 1, 1, 1, 1, 2]);
        let below: Vec<(u32, u32)> = (1..=10).map(|tenth| (30_719 * tenth - 1, 307_190)).collect();
        assert_eq!(rates(&below, Binning::Fixed).histogram(), [1; 10]);
    }

    #[test]
    fn equal_bins_reach_from_the_least_to_the_greatest() {
        let of = rates(&[(1, 10), (2, 10), (3, 10), (6, 10)], Binning::Equal);
        assert_eq!((of.edges()[0], of.edges()[10], of.edges().len()), (0.1, 0.6, 11));
        assert_eq!(of.histogram(), [1, 0, 1, 0, 1, 0, 0, 0, 0, 1]);
        let one = rates(&[(1, 4), (1, 4)], Binning::Equal);
        assert_eq!(one.histogram().iter().sum::<u64>(), 2);
    }

    #[test]
    fn mean_median_and_range() {
        let of = rates(&[(0, 9), (1, 3), (1, 3), (1, 1)], Binning::Fixed);
        assert_eq!((of.n(), of.range()), (4, Some([0.0, 1.0])));
        assert!((of.mean().expect("values") - 5.0 / 12.0).abs() < 1e-15);
        assert!((of.median().expect("values") - 0.333_333).abs() < 1e-12);
        let median = |values: &[(u32, u32)]| rates(values, Binning::Fixed).median().expect("values");
        // The mean of the two middle values, far apart or equal, and the middle value of an odd number.
        for (values, expected) in [
            (&[(1, 4), (3, 4)][..], 0.5),
            (&[(0, 1), (1, 4), (3, 4), (1, 1)], 0.5),
            (&[(0, 1), (1, 4), (1, 4), (1, 1)], 0.25),
            (&[(3, 4), (0, 1), (1, 4)], 0.25),
            (&[(3, 4)], 0.75),
        ] {
            assert!((median(values) - expected).abs() < 1e-12, "{values:?}: {}", median(values));
        }
        let none = rates(&[], Binning::Fixed);
        assert_eq!((none.mean(), none.median(), none.histogram()), (None, None, Vec::new()));
    }
}
