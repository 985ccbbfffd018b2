//! An object with its masks, labeled or predicted.

use syntable_model::product::Mask;

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
    /// Id of its category in the ground truth, if known.
    pub category: Option<u32>,
}

/// Rule for occluded predictions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Occluded {
    /// A prediction with an explicit occlusion mask is occluded if the mask has a pixel. Other predictions are occluded
    /// if their rate is at least [`OCCLUDED_FROM`], as in the reference.
    AsSaid,
    /// Occluded if the rate is at least this value.
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

/// Masks of a detector.
#[derive(Debug, Clone, PartialEq)]
pub struct DetectedMasks {
    /// Visible mask.
    pub visible: Mask,
    /// Amodal mask. Without it, the union of the visible mask and the occlusion mask.
    pub amodal: Option<Mask>,
    /// Occlusion mask. Without it, the amodal mask minus the visible mask.
    pub occlusion: Option<Mask>,
    /// Whether the object is occluded, if the detector states it; otherwise this is derived from the masks.
    pub is_occluded: Option<bool>,
}

impl DetectedMasks {
    /// The predicted object.
    pub fn object(self, occluded: Occluded) -> MaskedObject {
        let Self { visible, amodal, occlusion, is_occluded } = self;
        let amodal = amodal.unwrap_or_else(|| occlusion.as_ref().map_or(visible.clone(), |hidden| visible.or(hidden)));
        let least = occluded.least(occlusion.is_some());
        let object = MaskedObject::predicted_from(least, amodal, visible, occlusion);
        MaskedObject { is_occluded: is_occluded.unwrap_or(object.is_occluded), ..object }
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

/// Pixels of exactly one of two masks: the occlusion mask as the reference computes it.
fn differ(amodal: &Mask, visible: &Mask) -> Mask {
    amodal.minus(visible).or(&visible.minus(amodal))
}
