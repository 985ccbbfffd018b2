//! COCO panoptic segmentation.

mod read;

use crate::annotation_file::{self, Listed, SceneFiles, check_split, image_name, merge};
use crate::coco::Masks;
use crate::labels::{self, Partial};
use std::collections::BTreeSet;
use syntable_formats::coco::{Category, categories};
use syntable_formats::encode::png::{Image, Samples};
use syntable_model::prelude::*;
use syntable_model::product::Painted;
use syntable_model::product::standard::RGB;

/// How names of annotation files begin.
pub(crate) const FILE: &str = "panoptic_";

/// Id of the segment of the background, beyond all ids of objects.
const BACKGROUND: u32 = 1 << 16;

/// Writes COCO's layout for panoptic segmentation.
///
/// # What it does
///
/// Every visible mask is a segment of a thing, whose id is the id of the object in its scene. Where visible masks overlap, as
/// in COCO and LVIS, a pixel is of the object with the smallest mask: areas and boxes are of the pixels that a segment has, an
/// object that has none left has no segment, and how many objects lose pixels is reported. All other pixels (table,
/// room, distractors and objects without labels) are one segment of the stuff `background`, so that panopticapi counts
/// what is predicted there as wrong; no pixel is void. A segment's id is R + 256 · G + 256² · B of its pixels in the
/// PNG file. Categories are `object` (1) and the classes of the recipe's pools, with `isthing` 1, then `background`
/// with `isthing` 0. Image ids are `scene · views_per_scene + view + 1`; `bbox` is `[x, y, width, height]`, `area`
/// whole pixels.
///
/// # Output
///
/// - `{id}/images/{scene:06}_{view:04}.png`: 8-bit RGB.
/// - `{id}/annotations/panoptic_{split}/{scene:06}_{view:04}.png`: the segments.
/// - `{id}/annotations/panoptic_{split}.json`: one annotation per image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CocoPanoptic {
    /// Name of the split in the names of the annotation file and of its folder.
    pub split: String,
}

impl Default for CocoPanoptic {
    fn default() -> Self {
        Self { split: "train".into() }
    }
}

impl Config for CocoPanoptic {
    type Stage = dyn Writer;
    const KIND: &'static str = "coco_panoptic";
    const EXAMPLE: &'static str = "split = \"train\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_split(&self.split)?;
        Ok(Box::new(self))
    }
}

impl CocoPanoptic {
    /// Folder of the segments' images inside the writer's folder, which panopticapi derives from the annotation file.
    fn folder(&self) -> String {
        format!("annotations/{FILE}{}", self.split)
    }

    fn file(&self) -> String {
        format!("{}.json", self.folder())
    }
}

impl Writer for CocoPanoptic {
    fn reads(&self) -> Vec<Input> {
        std::iter::once(Input::of(RGB)).chain(labels::visible_inputs()).collect()
    }

    fn scene(&self, _: &ImagesContext, output: Output) -> Result<Box<dyn SceneWriter>> {
        Ok(Box::new(PanopticScene { folder: self.folder(), files: SceneFiles::new(output) }))
    }

    fn paths(&self, of: &FileOf) -> Result<Vec<String>> {
        let mut paths = annotation_file::paths(of, &[self.file()]);
        if let (Some(scene), Some(view)) = (of.scene, of.view) {
            paths.push(format!("{}/{}/{}", of.id, self.folder(), image_name(scene, view)));
        }
        Ok(paths)
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        merge(cx, finish, &self.file(), Some(&with_background(cx.dataset)), Listed::All)
    }
}

/// What the stuff is called that is all pixels without an object.
const BACKGROUND_NAME: &str = "background";

/// The categories of things, and that of the background after them.
fn with_background(dataset: &DatasetInfo) -> Vec<Category> {
    let of = |mut category: Category, isthing: u8| {
        category.extra.insert("isthing".into(), isthing.into());
        category
    };
    let id = background_category(dataset);
    let background = Category { id, name: BACKGROUND_NAME.into(), ..Category::default() };
    categories(dataset).into_iter().map(|thing| of(thing, 1)).chain([of(background, 0)]).collect()
}

fn background_category(dataset: &DatasetInfo) -> u64 {
    dataset.categories().map(|(id, _)| u64::from(id)).max().unwrap_or_default() + 1
}

/// The annotation of an image.
#[derive(Serialize)]
struct PanopticAnnotation {
    id: u64,
    image_id: u64,
    file_name: String,
    segments_info: Vec<Segment>,
}

#[derive(Serialize)]
struct Segment {
    id: u32,
    category_id: u64,
    area: u32,
    bbox: [i32; 4],
    iscrowd: u8,
}

impl Segment {
    fn new(id: u32, category_id: u64, mask: &Mask) -> Self {
        Self { id, category_id, area: mask.area(), bbox: mask.bbox().into(), iscrowd: 0 }
    }
}

struct PanopticScene {
    folder: String,
    files: SceneFiles,
}

impl SceneWriter for PanopticScene {
    fn view(&mut self, cx: &ImageContext, products: &Products) -> Result<()> {
        let rgb = products.get(RGB)?;
        let labels = Masks::Visible.shown_partial(cx.log, labels::partial(cx.dataset, products)?, false);
        let painted = Painted::new([rgb.width(), rgb.height()], labels.iter().map(|label| (label.id, visible(label))));
        painted.left_out().for_each(|left_out| cx.log.left_out(&left_out));
        let name = image_name(cx.scene_id, cx.view_id);
        self.files.png(&format!("{}/{name}", self.folder), &id_image(&painted.ids))?;
        self.files.image(cx, products, 1)?;
        let segments_info = segments(&painted, background_category(cx.dataset), &labels);
        self.files.annotation(&PanopticAnnotation { id: 0, image_id: 0, file_name: name, segments_info })
    }

    fn close(self: Box<Self>, _: &ImagesContext, _: &Products) -> Result<()> {
        self.files.close()
    }
}

fn visible<'a>(label: &Partial<'a>) -> &'a Mask {
    Masks::Visible.shown_of(label)
}

/// The segments of an image: objects of which it shows pixels, then the background if a pixel shows it.
fn segments(painted: &Painted, background: u64, labels: &[Partial]) -> Vec<Segment> {
    let shown: BTreeSet<InstanceId> = painted.shown().collect();
    let things = labels.iter().filter(|label| shown.contains(&label.id));
    let thing = |label: &Partial| {
        Segment::new(label.id.0.into(), label.category.into(), &painted.mask(label.id, visible(label)))
    };
    let ids = &painted.ids;
    let rest = Mask::from_fn(ids.width(), ids.height(), |x, y| *ids.at(x, y) == InstanceId::default());
    let stuff = (!rest.is_empty()).then(|| Segment::new(BACKGROUND, background, &rest));
    things.map(thing).chain(stuff).collect()
}

/// The image whose pixels say the ids of their segments.
fn id_image(ids: &Plane<InstanceId>) -> Image {
    let segment = |id: &InstanceId| if *id == InstanceId::default() { BACKGROUND } else { id.0.into() };
    let color = |id: &InstanceId| <[u8; 3]>::try_from(&segment(id).to_le_bytes()[..3]).expect("three of four bytes");
    Image {
        width: ids.width(),
        height: ids.height(),
        samples: Samples::Rgb8(ids.data().iter().flat_map(color).collect()),
    }
}

register!(CocoPanoptic);
