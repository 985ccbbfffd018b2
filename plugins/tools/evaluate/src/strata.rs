//! Scores of labeled objects by occlusion rate and by size: sums over all images.

use crate::coco::AREAS;
use crate::image::ImagePair;
use crate::masked_object::MaskedObject;
use crate::masks::DETECTED_ABOVE;
use crate::matching::f_of;
use crate::measure::{Measure, Measurement, Metric, Ratio, quotients};
use crate::register_metric;

/// Number of bins of occlusion rates, of equal width; the last bin includes 1.
pub const RATES: usize = 10;
/// Names of COCO's sizes.
pub const SIZES: [&str; 3] = ["small", "medium", "large"];
/// Scores of a bin.
pub const SCORES: [&str; 4] = ["share", "amodal_f", "visible_f", "amodal_f75"];

const BINS: usize = RATES + SIZES.len();

register_metric!(Metric {
    name: "strata",
    doc: "F of objects by occlusion rate in steps of 0.1, and by COCO's sizes of amodal masks.",
    build: |_| Measurement::of(Strata),
    crate_name: env!("CARGO_PKG_NAME"),
});

/// Names of bins, by rate and then by size.
pub fn bins() -> Vec<String> {
    let rates = (0..RATES).map(|bin| format!("occluded_{}_{}", 100 * bin / RATES, 100 * (bin + 1) / RATES));
    rates.chain(SIZES.map(str::to_owned)).collect()
}

struct Strata;

/// Contribution of an image to the scores of each bin.
type Tally = [[Ratio; SCORES.len()]; BINS];

impl Measure for Strata {
    type Tally = Tally;

    fn names(&self) -> Vec<String> {
        bins().iter().flat_map(|bin| SCORES.map(|score| format!("{bin}_{score}"))).collect()
    }

    fn tally(&self, pair: &ImagePair) -> Tally {
        let mut own = vec![None; pair.labels.len()];
        pair.matched().iter().for_each(|&(label, prediction)| own[label] = Some(&pair.predictions[prediction]));
        let mut tally = [[Ratio::default(); SCORES.len()]; BINS];
        // Every object is in one rate bin and one size bin, and the denominator counts all objects.
        tally.iter_mut().for_each(|of| of[0].whole = pair.labels.len() as f64);
        for (label, own) in pair.labels.iter().zip(own) {
            let f =
                |of: fn(&MaskedObject) -> &syntable_model::product::Mask| own.map_or(0.0, |it| f_of(of(label), of(it)));
            let (amodal, visible) = (f(|it| &it.amodal), f(|it| &it.visible));
            for bin in [Some(rate_bin(label)), size_bin(label)].into_iter().flatten() {
                let [share, rest @ ..] = &mut tally[bin];
                share.part += 1.0;
                let values = [amodal, visible, f64::from(u8::from(amodal > DETECTED_ABOVE))];
                rest.iter_mut().zip(values).for_each(|(ratio, value)| {
                    ratio.part += value;
                    ratio.whole += 1.0;
                });
            }
        }
        tally
    }

    fn values(&self, images: &[&Tally]) -> Vec<Option<f64>> {
        (0..BINS).flat_map(|bin| quotients(&images.iter().map(|image| &image[bin]).collect::<Vec<_>>())).collect()
    }
}

fn rate_bin(label: &MaskedObject) -> usize {
    let (hidden, all) = (u64::from(label.occlusion.area()), u64::from(label.amodal.area()).max(1));
    ((RATES as u64 * hidden / all) as usize).min(RATES - 1)
}

fn size_bin(label: &MaskedObject) -> Option<usize> {
    // At the limit between two sizes, the smaller size applies.
    let size = AREAS[1..].iter().position(|[_, most]| label.amodal.area() <= *most)?;
    Some(RATES + size)
}
