//! Predictions in memory.

use crate::masked_object::{DetectedMasks, MaskedObject, Occluded};
use crate::names::ImageNames;
use crate::results::ranked;
use syntable_model::error::{Error, Result};
use syntable_model::product::Mask;
use syntable_model::reader::OpenDataset;

/// Image of a prediction.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PredictedImage {
    /// Its place in the ground truth, from 0.
    Place(usize),
    /// Its name in the ground truth.
    Name(String),
}

/// A predicted object.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// The image.
    pub image: PredictedImage,
    /// Confidence of the detector.
    pub score: f64,
    /// Id of its category in the ground truth, if the detector states it.
    pub category: Option<u32>,
    /// Its masks.
    pub masks: DetectedMasks,
}

/// Predictions in memory, by image.
#[derive(Debug, Default)]
pub struct Detections {
    /// Minimum score of predictions.
    least: f64,
    /// Predictions of each image of the ground truth, by descending score. If scores are equal, the earlier prediction
    /// comes first.
    images: Vec<Vec<Detection>>,
}

impl Detections {
    /// Predictions for the images of a dataset. Predictions with a score below `least` are kept separately.
    ///
    /// # Errors
    /// If a prediction belongs to no image of the dataset, or its score is not finite.
    pub fn new(detections: Vec<Detection>, least: f64, dataset: &OpenDataset) -> Result<Self> {
        let mut images: Vec<Vec<Detection>> = vec![Vec::new(); dataset.images.len()];
        let names = ImageNames::of(dataset.images.iter().map(|it| it.name.as_str()));
        for (number, detection) in detections.into_iter().enumerate() {
            let image = match &detection.image {
                PredictedImage::Place(place) => Some(*place).filter(|place| *place < images.len()),
                PredictedImage::Name(name) => names.find(name),
            };
            let Some(image) = image else {
                let what = match &detection.image {
                    PredictedImage::Place(place) => place.to_string(),
                    PredictedImage::Name(name) => format!("\"{name}\""),
                };
                let error = Error::new(format!("{what} is not an image of the ground truth"));
                let example = dataset.images.first().map_or(String::new(), |it| format!(", such as \"{}\"", it.name));
                let last = images.len().saturating_sub(1);
                return Err(error.help(format!("an image is its place, 0 to {last}, or its name{example}")));
            };
            if !detection.score.is_finite() {
                let error = Error::new(format!("the score {} of prediction {number} is not a number", detection.score));
                return Err(error.help("leave the prediction out"));
            }
            images[image].push(detection);
        }
        images.iter_mut().for_each(|of| of.sort_by(|a, b| b.score.total_cmp(&a.score)));
        Ok(Self { least, images })
    }

    /// Predictions for an image with `[width, height]` pixels: predictions with sufficient scores, and predictions with
    /// lower scores for rankings.
    ///
    /// # Errors
    /// If a mask has another size.
    pub fn instances(&self, image: usize, size: [u32; 2], occluded: Occluded) -> Result<[Vec<MaskedObject>; 2]> {
        let (kept, detections) = ranked(&self.images[image], self.least, |it| it.score, |it| it.category);
        let object = |it: &Detection| {
            let DetectedMasks { visible, amodal, occlusion, .. } = &it.masks;
            [Some(visible), amodal.as_ref(), occlusion.as_ref()]
                .into_iter()
                .flatten()
                .try_for_each(|m| fits(m, size))?;
            let object = it.masks.clone().object(occluded);
            Ok(MaskedObject { score: Some(it.score), category: it.category, ..object })
        };
        let mut likely = detections.into_iter().map(object).collect::<Result<Vec<_>>>()?;
        let unlikely = likely.split_off(kept);
        Ok([likely, unlikely])
    }
}

fn fits(mask: &Mask, [width, height]: [u32; 2]) -> Result<()> {
    if [mask.width(), mask.height()] == [width, height] {
        return Ok(());
    }
    let own = format!("{} × {}", mask.width(), mask.height());
    Err(Error::new(format!("a predicted mask has {own} pixels, the ground truth {width} × {height}"))
        .help("predict masks with the size of the image"))
}
