//! The images with the lowest scores, with their predictions.

use crate::image::ImagePair;
use crate::matching::f_of;
use crate::measure::Measures;
use crate::table::EvaluatedImage;
use std::cmp::Ordering;
use syntable_formats::scores::{PredictedObject, ScoredImage};
use syntable_model::error::{Error, Result};

/// Default score that ranks images. Without it, the first score ranks them.
pub const RANKED_BY: &str = "amodal_overlap_f";

/// The index and the name of the score that ranks images.
///
/// # Errors
/// If no score has this name.
pub fn ranked_by(measures: &Measures, name: Option<&str>) -> Result<(usize, String)> {
    let names = measures.names();
    let place = |name: &str| names.iter().position(|it| it == name);
    let found = match name {
        Some(name) => place(name).ok_or_else(|| {
            Error::new(format!("unknown score `{name}` to rank images by")).help(format!(
                "scores are, for example, {}",
                names.iter().take(8).cloned().collect::<Vec<_>>().join(", ")
            ))
        })?,
        None => place(RANKED_BY).unwrap_or(0),
    };
    Ok((found, names.get(found).cloned().unwrap_or_default()))
}

/// The images with the lowest scores, lowest first; if scores are equal, in order. Omits images without the score.
pub fn lowest(measures: &Measures, images: &[EvaluatedImage], score: usize, most: usize) -> Vec<usize> {
    let value = |image: &EvaluatedImage| measures.values(&[&image.tally]).get(score).copied().flatten();
    let mut found: Vec<(usize, f64)> =
        images.iter().enumerate().filter_map(|(index, image)| Some((index, value(image)?))).collect();
    found.sort_by(|a, b| a.1.partial_cmp(&b.1).unwrap_or(Ordering::Equal).then(a.0.cmp(&b.0)));
    found.into_iter().take(most).map(|(index, _)| index).collect()
}

/// An image with its scores and predictions.
pub fn scored(measures: &Measures, name: &str, size: [u32; 2], pair: &ImagePair) -> ScoredImage {
    let values = measures.names().into_iter().zip(measures.values(&[&measures.tally(pair)]));
    let scores = values.filter_map(|(name, value)| Some((name, 100.0 * value?))).collect();
    let mut objects: Vec<PredictedObject> = pair
        .predictions
        .iter()
        .map(|it| PredictedObject {
            score: it.score,
            object: None,
            amodal_f: 0.0,
            visible_f: 0.0,
            occluded: it.is_occluded,
            visible: it.visible.to_coco(),
            amodal: it.amodal.to_coco(),
            hidden: (!it.occlusion.is_empty()).then(|| it.occlusion.to_coco()),
        })
        .collect();
    for &(label, prediction) in pair.matched() {
        let (truth, predicted) = (&pair.labels[label], &pair.predictions[prediction]);
        let amodal_f = f_of(&truth.amodal, &predicted.amodal);
        if amodal_f > 0.0 {
            let object = &mut objects[prediction];
            object.object = Some(truth.id);
            object.amodal_f = 100.0 * amodal_f;
            object.visible_f = 100.0 * f_of(&truth.visible, &predicted.visible);
        }
    }
    ScoredImage { name: name.to_owned(), size, scores, predictions: objects }
}
