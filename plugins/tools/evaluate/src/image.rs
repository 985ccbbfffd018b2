//! The objects of an image, labeled and predicted.

use crate::matching::{by_masks, pairs_of};
use std::sync::OnceLock;
use syntable_model::error::{Error, Result};
use syntable_model::product::Mask;
use syntable_model::reader::Crowd;

/// Minimum occlusion rate of a predicted object that counts as occluded.
pub const OCCLUDED_FROM: f64 = 0.05;

/// An object with its masks.
#[derive(Debug, Clone, PartialEq)]
pub struct MaskedObject {
    /// The object without occluders, within the image.
    pub amodal: Mask,
    /// Visible part of the object.
    pub visible: Mask,
    /// Hidden part of the object.
    pub occlusion: Mask,
    /// Whether the object counts as occluded.
    pub is_occluded: bool,
    /// Confidence of a prediction, if the detector states it.
    pub score: Option<f64>,
    /// Id of a labeled object in its image; 0 of a prediction.
    pub id: u16,
    /// Id of its category in the ground truth, if it is known.
    pub category: Option<u32>,
}

/// Rule for occluded predictions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Occluded {
    /// A prediction with an explicit occlusion mask is occluded if the mask has a pixel. Other predictions are occluded
    /// from [`OCCLUDED_FROM`] on, as in the reference.
    AsSaid,
    /// From this occlusion rate on.
    From(f64),
}

impl Occluded {
    /// Minimum occlusion rate of an occluded prediction, with or without an explicit occlusion mask.
    pub fn least(self, says: bool) -> f64 {
        match self {
            Self::AsSaid if says => 0.0,
            Self::AsSaid => OCCLUDED_FROM,
            Self::From(rate) => rate,
        }
    }
}

impl MaskedObject {
    /// A labeled object: occluded if any pixel is hidden.
    pub fn labeled(amodal: Mask, visible: Mask) -> Self {
        Self::labeled_with(amodal, visible, None)
    }

    /// A labeled object with its occlusion mask; without one, the mask is computed from the others.
    pub fn labeled_with(amodal: Mask, visible: Mask, occlusion: Option<Mask>) -> Self {
        Self::predicted_from(0.0, amodal, visible, occlusion)
    }

    /// A predicted object: occluded if its rate is at least [`OCCLUDED_FROM`].
    pub fn predicted(amodal: Mask, visible: Mask) -> Self {
        Self::predicted_from(OCCLUDED_FROM, amodal, visible, None)
    }

    /// A predicted object, occluded if any pixel is hidden and the rate is at least `least`. Without an occlusion mask,
    /// the mask is computed from the others.
    pub fn predicted_from(least: f64, amodal: Mask, visible: Mask, occlusion: Option<Mask>) -> Self {
        let occlusion = occlusion.unwrap_or_else(|| differ(&amodal, &visible));
        let is_occluded = f64::from(occlusion.area()) >= least * f64::from(amodal.area());
        let is_occluded = is_occluded && !occlusion.is_empty();
        Self { is_occluded, amodal, visible, occlusion, score: None, id: 0, category: None }
    }
}

/// Pixels of exactly one of two masks: the occlusion mask as the reference makes it.
fn differ(amodal: &Mask, visible: &Mask) -> Mask {
    amodal.minus(visible).or(&visible.minus(amodal))
}

/// Pairs (label, prediction).
pub type MatchedPairs = Vec<(usize, usize)>;

/// Labels and predictions of an image.
#[derive(Debug, Clone, Default)]
pub struct ImagePair {
    /// The labels.
    pub labels: Vec<MaskedObject>,
    /// Predictions with sufficient scores, by falling score.
    pub predictions: Vec<MaskedObject>,
    /// Predictions with lower scores, by falling score, for metrics that rank predictions.
    pub unlikely: Vec<MaskedObject>,
    /// Regions with objects that labels do not separate.
    pub crowds: Vec<Crowd>,
    matched: OnceLock<MatchedPairs>,
    painted: OnceLock<([Vec<Mask>; 2], MatchedPairs)>,
}

impl ImagePair {
    /// Labels and predictions of one image.
    ///
    /// # Errors
    /// If masks differ in size.
    pub fn new(labels: Vec<MaskedObject>, predictions: Vec<MaskedObject>) -> Result<Self> {
        Self { labels, predictions, ..Self::default() }.checked()
    }

    /// Adds inputs of ranking metrics: predictions with low scores, and crowds.
    ///
    /// # Errors
    /// If masks differ in size.
    pub fn with(self, unlikely: Vec<MaskedObject>, crowds: Vec<Crowd>) -> Result<Self> {
        Self { unlikely, crowds, ..self }.checked()
    }

    fn checked(self) -> Result<Self> {
        let instances = [&self.labels, &self.predictions, &self.unlikely].into_iter().flatten();
        let masks = instances.flat_map(|it| [&it.amodal, &it.visible, &it.occlusion]);
        let masks = masks.chain(self.crowds.iter().map(|it| &it.mask));
        let sizes: Vec<(u32, u32)> = masks.map(|mask| (mask.width(), mask.height())).collect();
        if let Some(other) = sizes.iter().find(|size| **size != sizes[0]) {
            let [(a, b), (c, d)] = [*other, sizes[0]];
            return Err(Error::new(format!(
                "a mask has {a} × {b} pixels, but another mask of the image has {c} × {d}"
            ))
            .help("predict masks with the size of the image"));
        }
        Ok(self)
    }

    /// Matched pairs of labels and predictions by their amodal masks, by label.
    pub fn matched(&self) -> &[(usize, usize)] {
        self.matched.get_or_init(|| by_masks(&self.labels, &self.predictions, |it| &it.amodal))
    }

    /// Visible masks of labels and of predictions, painted into label maps, and their matched pairs.
    pub fn painted(&self) -> (&[Vec<Mask>; 2], &[(usize, usize)]) {
        let (masks, pairs) = self.painted.get_or_init(|| {
            let masks = [painted(&self.labels), painted(&self.predictions)];
            let pairs = pairs_of(&masks[0].iter().collect::<Vec<_>>(), &masks[1].iter().collect::<Vec<_>>());
            (masks, pairs)
        });
        (masks, pairs)
    }
}

/// Visible masks painted into a label map in order, later ones over earlier ones. A covered pixel belongs to the last
/// mask.
pub fn painted(instances: &[MaskedObject]) -> Vec<Mask> {
    let mut shown: Vec<Mask> = Vec::new();
    for instance in instances {
        shown.iter_mut().filter(|it| it.shared_area(&instance.visible) > 0).for_each(|mask| {
            *mask = mask.minus(&instance.visible);
        });
        shown.push(instance.visible.clone());
    }
    shown.retain(|mask| !mask.is_empty());
    shown
}
