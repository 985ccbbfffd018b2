//! Writes OSD-Amodal's folders.

use super::OsdAmodal;
use super::record::{COLOR, DEPTH, IMAGES, LABELS, MASKS, image_path, mask_name, view_name};
use crate::coco::MaskChoice;
use crate::depth;
use crate::labels::{self, ShownLabel};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use syntable_formats::encode::png::PngImage;
use syntable_formats::encode::rgb::{RgbFiles, RgbFormat};
use syntable_formats::image_file::{self, RgbFile};
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;
use syntable_model::product::Painted;
use syntable_model::product::standard::RGB;

impl ImageWriter for OsdAmodal {
    type Scene = ();

    fn reads(&self) -> Vec<Input> {
        [Input::of(RGB), image_file::input(), self.depth.input()].into_iter().chain(labels::inputs()).collect()
    }

    fn view(&self, _: &mut (), cx: &ImageContext, products: &Products, output: &Output) -> Result<()> {
        let mut labels = MaskChoice::Visible.shown(cx.log, labels::labels(cx.dataset, products)?);
        if labels.is_empty() {
            return Ok(());
        }
        let (rgb, name) = (products.get(RGB)?, view_name(cx.scene_id, cx.view_id));
        let size = [rgb.width(), rgb.height()];
        let painted = Painted::new(size, labels.iter().map(|label| (label.id, label.visible)));
        painted.left_out().for_each(|left_out| cx.log.left_out(&left_out));
        let shown: BTreeSet<InstanceId> = painted.shown().collect();
        labels.retain(|label| shown.contains(&label.id));
        let write = |folder: &str, image: PngImage, end: &str| {
            image.write(output, &format!("{}/{}", output.id(), image_path(folder, &format!("{name}{end}"))))
        };
        let file = RgbFile::of(products, &[RgbFormat::Png], RgbFiles::default())?;
        output.write(&format!("{}/{}", output.id(), image_path(COLOR, &name)), &file.bytes)?;
        write(DEPTH, depth::image(self.depth, products, cx.log)?, "")?;
        write(LABELS, label_image(&painted, &labels)?, "")?;
        (1..).zip(&labels).try_for_each(|(number, label)| {
            // Pixels that an object lost to others are hidden.
            let occlusion = match painted.mask(label.id, label.visible) {
                Cow::Owned(visible) => Cow::Owned(label.amodal.minus(&visible)),
                Cow::Borrowed(_) => Cow::Borrowed(label.occlusion),
            };
            let masks = MASKS.into_iter().zip([label.amodal, &*occlusion]).filter(|(_, mask)| !mask.is_empty());
            let end = mask_name("", number);
            masks.into_iter().try_for_each(|(folder, mask)| write(folder, PngImage::mask(mask, u8::MAX), &end))
        })
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        let (Some(scene), Some(view)) = (of.scene, of.view) else { return Vec::new() };
        let name = view_name(scene, view);
        let images = IMAGES.iter().map(|folder| image_path(folder, &name));
        let masks = MASKS.iter().map(|folder| image_path(folder, &mask_name(&name, 1)));
        images.chain(masks).map(|path| format!("{}/{path}", of.id)).collect()
    }
}

/// The number of the object that each pixel shows.
fn label_image(painted: &Painted, labels: &[ShownLabel]) -> Result<PngImage> {
    let number = |(place, label): (usize, &ShownLabel)| {
        let number = u8::try_from(place + 1).map_err(|_| {
            Error::new(format!("an image shows {} objects; OSD-Amodal has labels for {}", labels.len(), u8::MAX))
                .help("place fewer objects, or write another format")
        })?;
        Ok((label.id, number))
    };
    let numbers: BTreeMap<InstanceId, u8> = labels.iter().enumerate().map(number).collect::<Result<_>>()?;
    Ok(PngImage::gray8(&painted.ids.map(|id| numbers.get(id).copied().unwrap_or(0))))
}
