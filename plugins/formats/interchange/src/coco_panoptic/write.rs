//! Writes COCO's layout for panoptic segmentation.

use super::CocoPanoptic;
use super::record::{BACKGROUND_NAME, FILE, PanopticAnnotation, PanopticSegment};
use crate::coco::{MaskChoice, StoredParts};
use crate::family::write::{Family, IMAGES, SceneFiles};
use crate::labels::{self, Partial};
use std::collections::BTreeSet;
use syntable_formats::Extra;
use syntable_formats::coco::{Category, IS_THING, categories};
use syntable_formats::encode::png::{PngImage, PngSamples};
use syntable_formats::encode::rgb::RgbFiles;
use syntable_formats::encode::view_name;
use syntable_model::prelude::*;
use syntable_model::product::Painted;
use syntable_model::product::standard::RGB;

/// Id of the segment of the background, larger than any object id.
const BACKGROUND: u32 = 1 << 16;

impl CocoPanoptic {
    /// Folder of the images of ids inside the writer's folder. panopticapi derives it from the name of the annotation
    /// file.
    fn folder(&self) -> String {
        format!("annotations/{FILE}{}", self.split)
    }
}

impl Family for CocoPanoptic {
    fn reads(&self) -> Vec<Input> {
        std::iter::once(Input::of(RGB)).chain(labels::visible_inputs()).collect()
    }

    fn rgb(&self) -> RgbFiles {
        self.rgb
    }

    fn file(&self) -> String {
        format!("{}.json", self.folder())
    }

    fn files_of_view(&self, view: &str) -> Vec<String> {
        vec![format!("{IMAGES}/{}", self.rgb.file_name(view)), format!("{}/{}", self.folder(), id_file(view))]
    }

    fn finish_options(&self) -> &'static [&'static str] {
        // The option `split` is part of the file names of each view.
        &[]
    }

    fn categories(&self, dataset: &DatasetInfo) -> Result<Vec<Category>> {
        Ok(with_background(dataset))
    }

    fn view(&self, cx: &ImageContext, products: &Products, files: &mut SceneFiles) -> Result<()> {
        let rgb = products.get(RGB)?;
        let labels =
            MaskChoice::Visible.shown_partial(cx.log, labels::partial(cx.dataset, products)?, StoredParts::Visible);
        let painted = Painted::new(
            [rgb.width(), rgb.height()],
            labels.iter().filter_map(|label| Some((label.id, visible(label)?))),
        );
        painted.left_out().for_each(|left_out| cx.log.left_out(&left_out));
        let name = id_file(&view_name(cx.scene_id, cx.view_id));
        files.png(&format!("{}/{name}", self.folder()), &id_image(&painted.ids))?;
        files.image(cx, products, 1)?;
        let segments_info = segments(&painted, background_category(cx.dataset), &labels);
        let extra = Extra::from_iter([("id".to_owned(), 0.into())]);
        files.annotation(&PanopticAnnotation { extra, image_id: 0, file_name: name, segments_info })
    }
}

/// Name of the image of ids of a view.
fn id_file(view: &str) -> String {
    format!("{view}.png")
}

/// The categories of objects, followed by the category of the background.
fn with_background(dataset: &DatasetInfo) -> Vec<Category> {
    let of = |mut category: Category, is_thing: u8| {
        category.extra.insert(IS_THING.into(), is_thing.into());
        category
    };
    let id = background_category(dataset);
    let background = Category { id, name: BACKGROUND_NAME.into(), ..Category::default() };
    categories(dataset).into_iter().map(|thing| of(thing, 1)).chain([of(background, 0)]).collect()
}

fn background_category(dataset: &DatasetInfo) -> u64 {
    dataset.categories().map(|(id, _)| u64::from(id)).max().unwrap_or_default() + 1
}

fn visible<'a>(label: &Partial<'a>) -> Option<&'a Mask> {
    MaskChoice::Visible.shown_of(label)
}

/// The segments of an image: all objects with visible pixels, then the background if any pixel shows it.
fn segments(painted: &Painted, background: u64, labels: &[Partial]) -> Vec<PanopticSegment<i64>> {
    let shown: BTreeSet<InstanceId> = painted.shown().collect();
    let things = labels.iter().filter(|label| shown.contains(&label.id));
    let thing = |label: &Partial| {
        Some(segment(label.id.0.into(), label.category.into(), &painted.mask(label.id, visible(label)?)))
    };
    let ids = &painted.ids;
    let rest = Mask::from_fn(ids.width(), ids.height(), |x, y| *ids.at(x, y) == InstanceId::default());
    let stuff = (!rest.is_empty()).then(|| segment(BACKGROUND, background, &rest));
    things.filter_map(thing).chain(stuff).collect()
}

/// The image whose colors encode the segment ids of the pixels.
fn id_image(ids: &Plane<InstanceId>) -> PngImage {
    let segment = |id: &InstanceId| if *id == InstanceId::default() { BACKGROUND } else { id.0.into() };
    let color = |id: &InstanceId| <[u8; 3]>::try_from(&segment(id).to_le_bytes()[..3]).expect("three of four bytes");
    PngImage {
        width: ids.width(),
        height: ids.height(),
        samples: PngSamples::Rgb8(ids.data().iter().flat_map(color).collect()),
    }
}

fn segment(id: u32, category_id: u64, mask: &Mask) -> PanopticSegment<i64> {
    let bbox = <[i32; 4]>::from(mask.bbox()).map(i64::from);
    PanopticSegment { id, category_id, area: mask.area().into(), bbox, iscrowd: 0, extra: Extra::new() }
}
