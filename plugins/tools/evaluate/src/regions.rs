//! Panoptic quality and mean IoU.

use crate::image::ImagePair;
use crate::measure::{Measurement, Metric, Ratio, Ratios};
use crate::register_metric;
use syntable_model::product::Mask;
use syntable_model::reader::Crowd;

/// IoU that a matched pair of segments must exceed.
const MATCHED_ABOVE: f64 = 0.5;
/// Fraction of a segment in crowds above which it is not a false positive.
const IN_CROWDS_ABOVE: f64 = 0.5;

register_metric!(
    Metric {
        name: "panoptic",
        doc: "Panoptic quality, SQ and RQ of visible masks, painted into label maps, regardless of class.",
        build: |_| Measurement::of(Ratios { names: ["pq", "sq", "rq"], of: panoptic }),
        crate_name: env!("CARGO_PKG_NAME"),
    },
    Metric {
        name: "miou",
        doc: "Mean IoU of amodal and visible masks: intersections by unions of the pairs of an image.",
        build: |_| Measurement::of(Ratios { names: ["amodal_miou", "visible_miou"], of: miou }),
        crate_name: env!("CARGO_PKG_NAME"),
    },
);

fn iou(a: &Mask, b: &Mask) -> f64 {
    let both = f64::from(a.shared_area(b));
    if both == 0.0 { 0.0 } else { both / (f64::from(a.area()) + f64::from(b.area()) - both) }
}

fn panoptic(pair: &ImagePair) -> [Ratio; 3] {
    let ([labels, predictions], _) = pair.painted();
    let boxes: Vec<_> = labels.iter().map(Mask::bbox).collect();
    let (mut sum, mut hits, mut spurious) = (0.0, 0, 0);
    for prediction in predictions {
        let area = prediction.bbox();
        // Segments do not overlap, so at most one label has such an IoU.
        let ious = labels.iter().zip(&boxes).filter(|it| it.1.meets(&area)).map(|it| iou(it.0, prediction));
        match ious.into_iter().find(|iou| *iou > MATCHED_ABOVE) {
            Some(iou) => {
                sum += iou;
                hits += 1;
            }
            None => spurious += usize::from(!is_in_crowds(prediction, labels, &pair.crowds)),
        }
    }
    let whole = hits as f64 + 0.5 * (spurious + labels.len() - hits) as f64;
    let hits = hits as f64;
    [Ratio { part: sum, whole }, Ratio { part: sum, whole: hits }, Ratio { part: hits, whole }]
}

/// Whether most of a segment lies in crowds, where objects have no labels.
fn is_in_crowds(prediction: &Mask, labels: &[Mask], crowds: &[Crowd]) -> bool {
    let Some(first) = crowds.first() else { return false };
    let all = crowds[1..].iter().fold(first.mask.clone(), |all, it| all.or(&it.mask));
    let inside = labels.iter().fold(all.and(prediction), |inside, label| inside.minus(label));
    f64::from(inside.area()) > IN_CROWDS_ABOVE * f64::from(prediction.area())
}

fn miou(pair: &ImagePair) -> [Ratio; 2] {
    let amodal = pair.matched().iter().map(|&(i, j)| (&pair.labels[i].amodal, &pair.predictions[j].amodal));
    let (masks, pairs) = pair.painted();
    let visible = pairs.iter().map(|&(i, j)| (&masks[0][i], &masks[1][j]));
    [of_pairs(amodal, [pair.labels.len(), pair.predictions.len()]), of_pairs(visible, [masks[0].len(), masks[1].len()])]
}

/// 1 for an image without labels and predictions, 0 for an image with only labels or only predictions.
fn of_pairs<'a>(pairs: impl Iterator<Item = (&'a Mask, &'a Mask)>, counts: [usize; 2]) -> Ratio {
    let (mut both, mut either) = (0.0, 0.0);
    for (a, b) in pairs {
        let shared = f64::from(a.shared_area(b));
        both += shared;
        either += f64::from(a.area()) + f64::from(b.area()) - shared;
    }
    Ratio::mean(if either > 0.0 { both / either } else { f64::from(u8::from(counts == [0, 0])) })
}
