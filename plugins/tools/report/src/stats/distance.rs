//! Distances between the distributions of two datasets.

use super::distribution::Distribution;
use super::statistics::DatasetStatistics;
use serde::Serialize;

/// Distances between a quantity of two datasets.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DistributionDistance {
    /// Name of the quantity, or `layer`.
    pub name: &'static str,
    /// Unit of `wasserstein_1`; empty for numbers.
    pub unit: &'static str,
    /// Wasserstein-1 distance: the mean distance by which values move from one distribution to the other, in `unit`,
    /// accurate to a step of the quantity. None for layers, which are not numbers.
    pub wasserstein_1: Option<f64>,
    /// Jensen-Shannon divergence of the histograms, in bits: 0 for equal histograms, 1 for disjoint histograms.
    pub jensen_shannon: f64,
}

/// Distances of all quantities for which both datasets have values. Their histograms have the same bins, see
/// [`bin_alike`](super::bin_alike).
pub fn distances(a: &DatasetStatistics, b: &DatasetStatistics) -> Vec<DistributionDistance> {
    let pair = |a: &Distribution| -> Option<DistributionDistance> {
        let b = b.distribution(a.quantity())?;
        let about = a.quantity().about();
        Some(DistributionDistance {
            name: about.name,
            unit: about.unit,
            wasserstein_1: Some(wasserstein_1(a, b)?),
            jensen_shannon: jensen_shannon(&a.histogram(), &b.histogram())?,
        })
    };
    let mut all: Vec<DistributionDistance> = a.distributions.iter().filter_map(pair).collect();
    let layers = a.layers.zip(b.layers);
    let layers = layers.and_then(|(a, b)| jensen_shannon(&a.counts(), &b.counts()));
    all.extend(layers.map(|jensen_shannon| DistributionDistance {
        name: "layer",
        unit: "",
        wasserstein_1: None,
        jensen_shannon,
    }));
    all
}

/// The area between two distribution functions, ∫ |F(x) − G(x)| dx, which is the Wasserstein-1 distance on a line
/// (Vallender 1974). `None` if a distribution has no values.
pub fn wasserstein_1(a: &Distribution, b: &Distribution) -> Option<f64> {
    if a.n() == 0 || b.n() == 0 {
        return None;
    }
    // Values are in whole steps, so equal values compare as equal.
    let mut changes: Vec<(f64, f64)> = Vec::new();
    changes.extend(a.counts().map(|(value, count)| (value, count as f64 / a.n() as f64)));
    changes.extend(b.counts().map(|(value, count)| (value, -(count as f64) / b.n() as f64)));
    changes.sort_by(|x, y| x.0.total_cmp(&y.0));
    let (mut area, mut between, mut last) = (0.0, 0.0_f64, 0.0);
    for (value, change) in changes {
        area += between.abs() * (value - last);
        between += change;
        last = value;
    }
    Some(area)
}

/// The Jensen-Shannon divergence of two histograms with the same bins, in bits (Lin 1991): the mean of their relative
/// entropies to their mean. `None` if a histogram is empty.
pub fn jensen_shannon(a: &[u64], b: &[u64]) -> Option<f64> {
    let total = |counts: &[u64]| Some(counts.iter().sum::<u64>()).filter(|sum| *sum > 0).map(|sum| sum as f64);
    let (whole_a, whole_b) = (total(a)?, total(b)?);
    let bits = a.iter().zip(b).map(|(a, b)| {
        let (p, q) = (*a as f64 / whole_a, *b as f64 / whole_b);
        let part = |x: f64| if x > 0.0 { 0.5 * x * libm::log2(2.0 * x / (p + q)) } else { 0.0 };
        part(p) + part(q)
    });
    Some(bits.sum::<f64>().clamp(0.0, 1.0))
}
