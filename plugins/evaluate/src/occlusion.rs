//! Whether objects are occluded, and by whom: sums over all images of the dataset.

use crate::Ratio;
use crate::image::{Instance, Pair, intersection};
use syntable_model::product::Mask;

/// IoU that makes an edge in SynTable's release.
const RELEASE_IOU: f64 = 0.1;

/// The scores of an image. `matched` are the pairs by amodal masks.
pub fn score(pair: &Pair, matched: &[(usize, usize)]) -> Vec<Ratio> {
    let (labels, predictions) = (&pair.labels, &pair.predictions);
    let agree = matched.iter().filter(|&&(i, j)| labels[i].is_occluded == predictions[j].is_occluded).count();
    let (n, pairs) = (labels.len(), labels.len() * labels.len().saturating_sub(1));
    let (truth, predicted) = (paper(labels), paper(predictions));
    let edges = [&truth, &predicted].map(|order| order.iter().flatten().filter(|edge| **edge).count());
    let found = equal(matched, &truth, &predicted, |edge| edge);
    vec![
        Ratio::micro("acc_o", agree, matched.len()),
        // The harmonic mean of agree / predictions and agree / labels.
        Ratio::micro("f_o", 2 * agree, n + predictions.len()),
        Ratio::micro("acc_oo", equal(matched, &truth, &predicted, |_| true), pairs),
        Ratio::micro("acc_oo_release", equal(matched, &release(labels), &iou(predictions), |_| true), pairs),
        Ratio::micro("edge_p", found, edges[1]),
        Ratio::micro("edge_r", found, edges[0]),
        Ratio::micro("edge_f1", 2 * found, edges[0] + edges[1]),
    ]
}

/// Who (row) occludes whom (column).
type Order = Vec<Vec<bool>>;

/// Ordered pairs of matched objects of which both say the same, if what they say counts.
fn equal(matched: &[(usize, usize)], truth: &Order, predicted: &Order, counts: fn(bool) -> bool) -> usize {
    let all = matched.iter().flat_map(|a| matched.iter().map(move |b| (a, b))).filter(|(a, b)| a != b);
    all.filter(|((i, p), (j, q))| truth[*i][*j] == predicted[*p][*q] && counts(truth[*i][*j])).count()
}

fn order(n: usize, occludes: impl Fn(usize, usize) -> bool) -> Order {
    (0..n).map(|i| (0..n).map(|j| i != j && occludes(i, j)).collect()).collect()
}

/// The paper's Algorithm 1: the visible mask of one meets the occlusion mask of the other.
pub fn paper(all: &[Instance]) -> Order {
    order(all.len(), |i, j| intersection(&all[i].visible, &all[j].occlusion) > 0)
}

/// Edges of predictions as the release has them.
fn iou(all: &[Instance]) -> Order {
    order(all.len(), |i, j| exceeds(&all[i].visible, &all[j].occlusion))
}

/// Edges of labels as the release has them: every visible mask is the union of all, so that rows are equal.
fn release(all: &[Instance]) -> Order {
    let Some(first) = all.first() else { return Vec::new() };
    let union = all[1..].iter().fold(first.visible.clone(), |union, it| union.or(&it.visible));
    let is_hidden: Vec<bool> = all.iter().map(|it| exceeds(&union, &it.occlusion)).collect();
    order(all.len(), |_, j| is_hidden[j])
}

fn exceeds(visible: &Mask, occlusion: &Mask) -> bool {
    let both = intersection(visible, occlusion);
    f64::from(both) > RELEASE_IOU * f64::from(visible.area() + occlusion.area() - both)
}
