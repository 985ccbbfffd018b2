//! Uncertainty of scores with respect to the choice of images: percentile intervals of samples with replacement.

use crate::measure::{Measures, Tally};
use std::sync::Mutex;
use syntable_model::context::Workers;
use syntable_model::random::Stream;

/// Shares of samples below either end: 95 % are between them.
const ENDS: [f64; 2] = [0.025, 0.975];

/// For each score, the interval of the central 95 % of its values over samples of images; `None` if no sample has a
/// value. The random stream is `bootstrap` of the seed, with one child per sample.
pub fn intervals(
    measures: &Measures,
    images: &[&Tally],
    samples: usize,
    seed: u64,
    workers: &dyn Workers,
) -> Vec<Option<[f64; 2]>> {
    let stream = Stream::root(seed).child("bootstrap");
    let drawn: Mutex<Vec<Vec<Option<f64>>>> = Mutex::new(Vec::with_capacity(samples));
    workers.run(samples, &|sample| {
        let mut stream = stream.at(sample as u64);
        let chosen: Vec<&Tally> = images.iter().filter_map(|_| stream.pick(images).copied()).collect();
        let values = measures.values(&chosen);
        if let Ok(mut drawn) = drawn.lock() {
            drawn.push(values);
        }
    });
    let drawn = drawn.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    // Threads return samples in any order. Sorting removes this dependence.
    (0..measures.names().len())
        .map(|score| {
            let mut values: Vec<f64> = drawn.iter().filter_map(|values| values.get(score).copied().flatten()).collect();
            values.sort_by(f64::total_cmp);
            (!values.is_empty()).then(|| ENDS.map(|share| quantile(&values, share)))
        })
        .collect()
}

/// Interpolates linearly between the two sorted values around a share.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let at = share * (sorted.len() - 1) as f64;
    let (low, high) = (sorted[at.floor() as usize], sorted[at.ceil() as usize]);
    low + (high - low) * at.fract()
}
