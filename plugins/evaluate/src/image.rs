//! The objects of an image, labeled and predicted.

use syntable_model::error::{Error, Result};
use syntable_model::product::Mask;

/// Least occlusion rate of a predicted object that counts as occluded.
pub const OCCLUDED_FROM: f64 = 0.05;

/// An object with its masks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Instance {
    /// The object without occluders, within the image.
    pub amodal: Mask,
    /// What the image shows of it.
    pub visible: Mask,
    /// What others hide of it.
    pub occlusion: Mask,
    /// Whether it counts as occluded.
    pub is_occluded: bool,
}

impl Instance {
    /// A labeled object: occluded if any pixel is hidden.
    pub fn labeled(amodal: Mask, visible: Mask) -> Self {
        let occlusion = differ(&amodal, &visible);
        Self { is_occluded: !occlusion.is_empty(), amodal, visible, occlusion }
    }

    /// A predicted object: occluded if its rate is at least [`OCCLUDED_FROM`].
    pub fn predicted(amodal: Mask, visible: Mask) -> Self {
        Self::predicted_from(OCCLUDED_FROM, amodal, visible, None)
    }

    /// A predicted object, occluded if any pixel is hidden and the rate is at least `least`. Without an occlusion mask, that
    /// follows from the others.
    pub fn predicted_from(least: f64, amodal: Mask, visible: Mask, occlusion: Option<Mask>) -> Self {
        let occlusion = occlusion.unwrap_or_else(|| differ(&amodal, &visible));
        let is_occluded = f64::from(occlusion.area()) >= least * f64::from(amodal.area());
        Self { is_occluded: is_occluded && !occlusion.is_empty(), amodal, visible, occlusion }
    }
}

/// Pixels of exactly one of two masks: the occlusion mask as the reference makes it.
fn differ(amodal: &Mask, visible: &Mask) -> Mask {
    amodal.minus(visible).or(&visible.minus(amodal))
}

/// What an image shows, and what was predicted of it, by falling score.
#[derive(Debug, Clone)]
pub struct Pair {
    /// The labels.
    pub labels: Vec<Instance>,
    /// The predictions.
    pub predictions: Vec<Instance>,
}

impl Pair {
    /// Labels and predictions of one image.
    ///
    /// # Errors
    /// If masks differ in size.
    pub fn new(labels: Vec<Instance>, predictions: Vec<Instance>) -> Result<Self> {
        let masks = || labels.iter().chain(&predictions).flat_map(|it| [&it.amodal, &it.visible, &it.occlusion]);
        let size = |mask: &Mask| (mask.width(), mask.height());
        if let Some(first) = masks().next()
            && let Some(other) = masks().find(|mask| size(mask) != size(first))
        {
            let [(a, b), (c, d)] = [size(other), size(first)];
            return Err(Error::new(format!("a mask has {a} × {b} pixels, another of its image {c} × {d}"))
                .help("predict masks of the size of the image")
                .permanent());
        }
        Ok(Self { labels, predictions })
    }
}

/// Visible masks as a label map has them: painted in order, later ones over earlier ones. What is covered is none.
pub fn painted(instances: &[Instance]) -> Vec<Mask> {
    let mut shown: Vec<Mask> = Vec::new();
    for instance in instances {
        shown.iter_mut().filter(|it| intersection(it, &instance.visible) > 0).for_each(|mask| {
            *mask = mask.minus(&instance.visible);
        });
        shown.push(instance.visible.clone());
    }
    shown.retain(|mask| !mask.is_empty());
    shown
}

/// Number of pixels in both masks, which are of one image.
pub fn intersection(a: &Mask, b: &Mask) -> u32 {
    let (mut left, mut right) = (a.runs().peekable(), b.runs().peekable());
    let mut area = 0;
    while let (Some(x), Some(y)) = (left.peek(), right.peek()) {
        area += x.end.min(y.end).saturating_sub(x.start.max(y.start));
        if x.end < y.end {
            left.next()
        } else {
            right.next()
        };
    }
    area
}
