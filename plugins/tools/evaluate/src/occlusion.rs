//! Whether objects are occluded: sums over all images of the dataset.

use crate::image::ImagePair;
use crate::measure::{Measurement, Metric, Ratio, Ratios};
use crate::register_metric;

register_metric!(Metric {
    name: "occlusion",
    doc: "ACC_O and F_O: whether objects are occluded.",
    build: |_| Measurement::of(Ratios { names: ["acc_o", "f_o"], of: score }),
    crate_name: env!("CARGO_PKG_NAME"),
});

fn score(pair: &ImagePair) -> [Ratio; 2] {
    let (labels, predictions, matched) = (&pair.labels, &pair.predictions, pair.matched());
    let agree = matched.iter().filter(|&&(i, j)| labels[i].is_occluded == predictions[j].is_occluded).count();
    // F_O is the harmonic mean of agree / predictions and agree / labels.
    [Ratio::micro(agree, matched.len()), Ratio::micro(2 * agree, labels.len() + predictions.len())]
}
