//! Overlap and Boundary P, R, F and F@.75: means over images, each by itself.

use crate::boundary::Boundary;
use crate::image::{Pair, intersection, painted};
use crate::matching::{assign, f_of};
use crate::{Convention, Ratio};
use syntable_model::product::Mask;

/// F that a pair must exceed to count in F@.75.
const DETECTED_ABOVE: f64 = 0.75;

/// Seven scores of a kind of masks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scores {
    /// Precision, recall and F of areas.
    pub overlap: [f64; 3],
    /// Precision, recall and F of boundaries.
    pub boundary: [f64; 3],
    /// Share of the objects whose pair has an F above 0.75.
    pub f75: f64,
    /// Number of labeled masks.
    pub objects: usize,
}

impl Scores {
    fn all(p: f64, r: f64, f: f64, objects: usize) -> Self {
        Self { overlap: [p, r, f], boundary: [p, r, f], f75: f, objects }
    }
}

/// Names of the scores of a kind of masks.
type Names = [&'static str; 7];

macro_rules! names {
    ($kind:literal) => {
        [
            concat!($kind, "_overlap_p"),
            concat!($kind, "_overlap_r"),
            concat!($kind, "_overlap_f"),
            concat!($kind, "_boundary_p"),
            concat!($kind, "_boundary_r"),
            concat!($kind, "_boundary_f"),
            concat!($kind, "_f75"),
        ]
    };
}

const AMODAL: Names = names!("amodal");
const VISIBLE: Names = names!("visible");
const INVISIBLE: Names = names!("invisible");

/// The scores of amodal, visible and invisible masks of an image. `matched` are the pairs by amodal masks.
pub fn score(pair: &Pair, matched: &[(usize, usize)], convention: Convention) -> Vec<Ratio> {
    let amodal = |of: &[crate::image::Instance]| of.iter().map(|it| it.amodal.clone()).collect::<Vec<_>>();
    let kinds = [
        (AMODAL, of_masks(&amodal(&pair.labels), &amodal(&pair.predictions), matched)),
        (VISIBLE, visible(pair)),
        (INVISIBLE, invisible(pair, matched)),
    ];
    kinds.iter().flat_map(|(names, scores)| named(names, scores, convention)).collect()
}

fn named(names: &Names, scores: &Scores, convention: Convention) -> Vec<Ratio> {
    let values = scores.overlap.into_iter().chain(scores.boundary);
    let mut ratios: Vec<Ratio> = names.iter().zip(values).map(|(name, value)| Ratio::mean(name, value)).collect();
    let weight = match convention {
        Convention::Release => 1.0,
        Convention::Paper => scores.objects as f64,
    };
    ratios.push(Ratio { name: names[6], part: scores.f75 * weight, whole: weight });
    ratios
}

/// Names of the precision, recall and F of each kind of masks, by area and by boundary.
pub fn triples() -> impl Iterator<Item = [&'static str; 3]> {
    [AMODAL, VISIBLE, INVISIBLE]
        .into_iter()
        .flat_map(|names| [[names[0], names[1], names[2]], [names[3], names[4], names[5]]])
}

/// The scores of visible masks, painted into label maps and matched by themselves.
pub fn visible(pair: &Pair) -> Scores {
    let (labels, predictions) = (painted(&pair.labels), painted(&pair.predictions));
    let scores: Vec<Vec<f64>> =
        labels.iter().map(|label| predictions.iter().map(|it| f_of(label, it)).collect()).collect();
    of_masks(&labels, &predictions, &assign(&scores, predictions.len()))
}

/// The scores of occlusion masks of the pairs that are occluded in both; all of either count in denominators.
pub fn invisible(pair: &Pair, matched: &[(usize, usize)]) -> Scores {
    let mut index = [Vec::new(), Vec::new()];
    let mut masks = [Vec::new(), Vec::new()];
    for (side, instances) in [&pair.labels, &pair.predictions].into_iter().enumerate() {
        for instance in instances {
            index[side].push(instance.is_occluded.then_some(masks[side].len()));
            masks[side].extend(instance.is_occluded.then(|| instance.occlusion.clone()));
        }
    }
    let both = |&(label, prediction): &(usize, usize)| index[0][label].zip(index[1][prediction]);
    of_masks(&masks[0], &masks[1], &matched.iter().filter_map(both).collect::<Vec<_>>())
}

/// The scores of masks with these pairs.
pub fn of_masks(labels: &[Mask], predictions: &[Mask], pairs: &[(usize, usize)]) -> Scores {
    match (labels.is_empty(), predictions.is_empty()) {
        (true, true) => return Scores::all(1.0, 1.0, 1.0, 0),
        (false, true) => return Scores::all(1.0, 0.0, 0.0, labels.len()),
        (true, false) => return Scores::all(0.0, 1.0, 0.0, 0),
        (false, false) => {}
    }
    let area = |masks: &[Mask]| masks.iter().map(|mask| u64::from(mask.area())).sum::<u64>() as usize;
    let both = pairs.iter().map(|&(i, j)| intersection(&labels[i], &predictions[j]) as usize).sum();
    let lines = [labels, predictions].map(|masks| masks.iter().map(Boundary::of).collect::<Vec<_>>());
    let length = |side: usize| lines[side].iter().map(Boundary::len).sum();
    let hits = |a: usize, b: usize| -> usize {
        let of = |&(i, j): &(usize, usize)| lines[a][[i, j][a]].near(&lines[b][[i, j][b]]);
        pairs.iter().map(of).sum()
    };
    let detected = pairs.iter().filter(|&&(i, j)| f_of(&labels[i], &predictions[j]) > DETECTED_ABOVE).count();
    Scores {
        overlap: prf((both, area(predictions)), (both, area(labels))),
        boundary: prf((hits(1, 0), length(1)), (hits(0, 1), length(0))),
        f75: detected as f64 / labels.len() as f64,
        objects: labels.len(),
    }
}

/// Precision, recall and F of hits and totals. Unlike in the reference, whose mean becomes NaN, 0 of 0 is 1.
fn prf(precision: (usize, usize), recall: (usize, usize)) -> [f64; 3] {
    let [p, r] = [precision, recall].map(|(hits, of)| if of == 0 { 1.0 } else { hits as f64 / of as f64 });
    [p, r, harmonic(p, r)]
}

/// Harmonic mean of precision and recall; 0 if both are.
pub fn harmonic(p: f64, r: f64) -> f64 {
    if p + r > 0.0 { 2.0 * p * r / (p + r) } else { 0.0 }
}
