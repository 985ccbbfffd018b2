//! OSD-Amodal.

mod check;
mod read;
mod record;
mod write;

use syntable_formats::depth::DepthSource;
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;

/// Writes the layout of OSD-Amodal, which UOAIS-Net's evaluation reads.
///
/// # Behavior
///
/// The folder `{id}` replaces `datasets/OSD-0.2-depth`. The objects of an image are numbered from 1 in the order of
/// their ids; these numbers are the labels of the visible masks and part of the other masks' names. Only occluded
/// objects have an occlusion mask, which the evaluation takes as the sign of occlusion. Objects without a visible pixel
/// are omitted, and so are views without objects, on which the evaluation fails. If visible masks overlap, a pixel
/// belongs to the object with the smallest mask, and the number of objects that lose pixels is reported. An image has
/// at most 255 objects. Names have no underscore, since the evaluation splits them there.
///
/// # Output
///
/// `NAME` is `s{scene:06}v{view:04}`.
///
/// - `{id}/image_color/NAME.png`: 8-bit RGB.
/// - `{id}/disparity/NAME.png`: 16-bit depth along the optical axis, whole millimeters; 0 without a surface.
/// - `{id}/annotation/NAME.png`: 8-bit labels, 0 where no object is visible.
/// - `{id}/amodal_annotation/NAME_{n}.png` and `{id}/occlusion_annotation/NAME_{n}.png`: 8-bit masks, 0 and 255.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OsdAmodal {
    /// Depth that is written.
    pub depth: DepthSource,
}

impl Config for OsdAmodal {
    type Stage = dyn Writer;
    const KIND: &'static str = "osd_amodal";
    const EXAMPLE: &'static str = "depth = \"rendered\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        Ok(self.boxed())
    }
}

register!(OsdAmodal);
