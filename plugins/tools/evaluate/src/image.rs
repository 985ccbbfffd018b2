//! The objects of an image, labeled and predicted.

use crate::masked_object::MaskedObject;
use crate::matching::{MatchedPairs, by_masks, pairs_of};
use std::sync::OnceLock;
use syntable_model::error::{Error, Result};
use syntable_model::product::Mask;
use syntable_model::reader::Crowd;

/// Labels and predictions of an image.
#[derive(Debug, Clone, Default)]
pub struct ImagePair {
    /// The labels.
    pub labels: Vec<MaskedObject>,
    /// Predictions with sufficient scores, by descending score.
    pub predictions: Vec<MaskedObject>,
    /// Predictions with lower scores, by descending score, for metrics that rank predictions.
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
