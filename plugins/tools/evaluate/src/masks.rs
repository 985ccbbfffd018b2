//! Overlap and Boundary P, R, F and F@.75: means over images.

use crate::boundary::Boundary;
use crate::image::ImagePair;
use crate::masked_object::MaskedObject;
use crate::matching::f_of;
use crate::measure::{Measure, Measurement, Metric, Ratio, quotients};
use crate::{Convention, register_metric};
use syntable_model::product::Mask;

/// F that a pair must exceed to count in F@.75.
pub const DETECTED_ABOVE: f64 = 0.75;

/// Seven scores of a kind of mask.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaskScores {
    /// Precision, recall and F of areas.
    pub overlap: [f64; 3],
    /// Precision, recall and F of boundaries.
    pub boundary: [f64; 3],
    /// Fraction of the objects whose pair has an F above 0.75.
    pub f75: f64,
    /// Number of labeled masks.
    pub objects: usize,
}

impl MaskScores {
    fn all(p: f64, r: f64, f: f64, objects: usize) -> Self {
        Self { overlap: [p, r, f], boundary: [p, r, f], f75: f, objects }
    }
}

/// A kind of mask.
struct MaskMetric {
    names: [&'static str; 7],
    of: fn(&ImagePair) -> MaskScores,
    convention: Convention,
}

impl Measure for MaskMetric {
    type Tally = [Ratio; 7];

    fn names(&self) -> Vec<String> {
        self.names.map(str::to_owned).to_vec()
    }

    fn tally(&self, pair: &ImagePair) -> [Ratio; 7] {
        let scores = (self.of)(pair);
        let weight = match self.convention {
            Convention::Release => 1.0,
            Convention::Paper => scores.objects as f64,
        };
        let [[op, or, of], [bp, br, bf]] = [scores.overlap, scores.boundary].map(|of| of.map(Ratio::mean));
        [op, or, of, bp, br, bf, Ratio { part: scores.f75 * weight, whole: weight }]
    }

    fn values(&self, images: &[&[Ratio; 7]]) -> Vec<Option<f64>> {
        let mut values = quotients(images);
        if self.convention == Convention::Paper {
            for first in [0, 3] {
                values[first + 2] = values[first].zip(values[first + 1]).map(|(p, r)| harmonic(p, r));
            }
        }
        values.to_vec()
    }
}

macro_rules! register_masks {
    ($($kind:literal, $of:expr, $doc:literal);+ $(;)?) => {
        register_metric!($(Metric {
            name: $kind,
            doc: $doc,
            build: |convention| Measurement::of(MaskMetric {
                names: [
                    concat!($kind, "_overlap_p"),
                    concat!($kind, "_overlap_r"),
                    concat!($kind, "_overlap_f"),
                    concat!($kind, "_boundary_p"),
                    concat!($kind, "_boundary_r"),
                    concat!($kind, "_boundary_f"),
                    concat!($kind, "_f75"),
                ],
                of: $of,
                convention,
            }),
            crate_name: env!("CARGO_PKG_NAME"),
        }),+);
    };
}

register_masks! {
    "amodal", amodal, "Overlap and Boundary P, R, F and F@.75 of amodal masks.";
    "visible", visible, "Overlap and Boundary P, R, F and F@.75 of visible masks, painted into label maps.";
    "invisible", invisible, "Overlap and Boundary P, R, F and F@.75 of occlusion masks of occluded objects.";
}

/// The scores of amodal masks.
pub fn amodal(pair: &ImagePair) -> MaskScores {
    of_masks(&amodal_masks(&pair.labels), &amodal_masks(&pair.predictions), pair.matched())
}

fn amodal_masks(objects: &[MaskedObject]) -> Vec<Mask> {
    objects.iter().map(|object| object.amodal.clone()).collect()
}

/// Scores of visible masks, painted into label maps and matched separately.
pub fn visible(pair: &ImagePair) -> MaskScores {
    let (masks, pairs) = pair.painted();
    of_masks(&masks[0], &masks[1], pairs)
}

/// Scores of the occlusion masks of pairs whose objects are both occluded. Denominators include all
/// occluded labels and predictions.
pub fn invisible(pair: &ImagePair) -> MaskScores {
    let mut index = [Vec::new(), Vec::new()];
    let mut masks = [Vec::new(), Vec::new()];
    for (side, instances) in [&pair.labels, &pair.predictions].into_iter().enumerate() {
        for instance in instances {
            index[side].push(instance.is_occluded.then_some(masks[side].len()));
            masks[side].extend(instance.is_occluded.then(|| instance.occlusion.clone()));
        }
    }
    let both = |&(label, prediction): &(usize, usize)| index[0][label].zip(index[1][prediction]);
    of_masks(&masks[0], &masks[1], &pair.matched().iter().filter_map(both).collect::<Vec<_>>())
}

/// The scores of masks with these pairs.
pub fn of_masks(labels: &[Mask], predictions: &[Mask], pairs: &[(usize, usize)]) -> MaskScores {
    match (labels.is_empty(), predictions.is_empty()) {
        (true, true) => return MaskScores::all(1.0, 1.0, 1.0, 0),
        (false, true) => return MaskScores::all(1.0, 0.0, 0.0, labels.len()),
        (true, false) => return MaskScores::all(0.0, 1.0, 0.0, 0),
        (false, false) => {}
    }
    let area = |masks: &[Mask]| masks.iter().map(|mask| u64::from(mask.area())).sum::<u64>() as usize;
    let both = pairs.iter().map(|&(i, j)| labels[i].shared_area(&predictions[j]) as usize).sum();
    let lines = [labels, predictions].map(|masks| masks.iter().map(Boundary::of).collect::<Vec<_>>());
    let length = |side: usize| lines[side].iter().map(Boundary::len).sum();
    let hits = |a: usize, b: usize| -> usize {
        let of = |&(i, j): &(usize, usize)| lines[a][[i, j][a]].near(&lines[b][[i, j][b]]);
        pairs.iter().map(of).sum()
    };
    let detected = pairs.iter().filter(|&&(i, j)| f_of(&labels[i], &predictions[j]) > DETECTED_ABOVE).count();
    MaskScores {
        overlap: prf((both, area(predictions)), (both, area(labels))),
        boundary: prf((hits(1, 0), length(1)), (hits(0, 1), length(0))),
        f75: detected as f64 / labels.len() as f64,
        objects: labels.len(),
    }
}

/// Precision, recall and F from hits and totals. 0 of 0 is 1; in the reference, it makes the mean NaN.
fn prf(precision: (usize, usize), recall: (usize, usize)) -> [f64; 3] {
    let [p, r] = [precision, recall].map(|(hits, of)| if of == 0 { 1.0 } else { hits as f64 / of as f64 });
    [p, r, harmonic(p, r)]
}

/// Harmonic mean of precision and recall; 0 if both are 0.
pub fn harmonic(p: f64, r: f64) -> f64 {
    if p + r > 0.0 { 2.0 * p * r / (p + r) } else { 0.0 }
}
