//! OSD-Amodal.

mod read;

use crate::coco::Masks;
use crate::depth::DepthSource;
use crate::labels::{self, Label};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use syntable_formats::encode::png::Image;
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;
use syntable_model::product::Painted;
use syntable_model::product::standard::RGB;
use syntable_model::scene::{SceneId, ViewId};

/// Folders of images: color, depth and labels.
const IMAGES: [&str; 3] = ["image_color", "disparity", "annotation"];
/// Folders of masks of single objects: amodal and occluded.
const MASKS: [&str; 2] = ["amodal_annotation", "occlusion_annotation"];

/// Writes the layout of OSD-Amodal, which UOAIS-Net's evaluation reads.
///
/// # What it does
///
/// The folder `{id}` takes the place of `datasets/OSD-0.2-depth`. The objects of an image are numbered from 1 in the
/// order of their ids; the numbers are the labels of the visible masks and part of the names of the others. An occluded
/// mask is there only if the object is occluded, which is how the evaluation knows. Objects of which the image shows
/// nothing are left out, and so are views without objects, at which the evaluation fails. Where visible masks overlap, a pixel
/// is of the object with the smallest mask, and how many objects lose pixels is reported. An image has at most 255
/// objects. Names have no underscore, since the evaluation splits them there.
///
/// # Output
///
/// `NAME` is `s{scene:06}v{view:04}`.
///
/// - `{id}/image_color/NAME.png`: 8-bit RGB.
/// - `{id}/disparity/NAME.png`: 16-bit depth along the optical axis, whole millimeters; 0 where there is none.
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

/// Name of a view: no name ends in another, whatever the number of scenes and views.
fn name(scene: SceneId, view: ViewId) -> String {
    format!("s{:06}v{:04}", scene.0, view.0)
}

impl ImageWriter for OsdAmodal {
    type Scene = ();

    fn reads(&self) -> Vec<Input> {
        [Input::of(RGB), self.depth.input()].into_iter().chain(labels::inputs()).collect()
    }

    fn view(&self, _: &mut (), cx: &ImageContext, products: &Products, output: &Output) -> Result<()> {
        let mut labels = Masks::Visible.shown(cx.log, labels::labels(cx.dataset, products)?);
        if labels.is_empty() {
            return Ok(());
        }
        let (rgb, name) = (products.get(RGB)?, name(cx.scene_id, cx.view_id));
        let size = [rgb.width(), rgb.height()];
        let painted = Painted::new(size, labels.iter().map(|label| (label.id, label.visible)));
        painted.left_out().for_each(|left_out| cx.log.left_out(&left_out));
        let shown: BTreeSet<InstanceId> = painted.shown().collect();
        labels.retain(|label| shown.contains(&label.id));
        let write = |folder: &str, image: Image, end: &str| {
            image.write(output, &format!("{}/{folder}/{name}{end}.png", output.id()))
        };
        let images = [Image::rgb(rgb), self.depth.image(products)?, label_image(&painted, &labels)?];
        IMAGES.into_iter().zip(images).try_for_each(|(folder, image)| write(folder, image, ""))?;
        (1..).zip(&labels).try_for_each(|(number, label): (usize, _)| {
            // What an object lost to others in front of it is hidden.
            let occlusion = match painted.mask(label.id, label.visible) {
                Cow::Owned(visible) => Cow::Owned(label.amodal.minus(&visible)),
                Cow::Borrowed(_) => Cow::Borrowed(label.occlusion),
            };
            let masks = MASKS.into_iter().zip([label.amodal, &*occlusion]).filter(|(_, mask)| !mask.is_empty());
            let end = format!("_{number}");
            masks.into_iter().try_for_each(|(folder, mask)| write(folder, Image::mask(mask, u8::MAX), &end))
        })
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        let (Some(scene), Some(view)) = (of.scene, of.view) else { return Vec::new() };
        let name = name(scene, view);
        let images = IMAGES.iter().map(|folder| format!("{}/{folder}/{name}.png", of.id));
        let masks = MASKS.iter().map(|folder| format!("{}/{folder}/{name}_1.png", of.id));
        images.chain(masks).collect()
    }
}

/// The number of the object that each pixel shows.
fn label_image(painted: &Painted, labels: &[Label]) -> Result<Image> {
    let number = |(place, label): (usize, &Label)| {
        let number = u8::try_from(place + 1).map_err(|_| {
            Error::new(format!("an image shows {} objects; OSD-Amodal has labels for {}", labels.len(), u8::MAX))
                .help("place fewer objects, or write another format")
        })?;
        Ok((label.id, number))
    };
    let numbers: BTreeMap<InstanceId, u8> = labels.iter().enumerate().map(number).collect::<Result<_>>()?;
    Ok(Image::gray8(&painted.ids.map(|id| numbers.get(id).copied().unwrap_or(0))))
}

register!(OsdAmodal);
