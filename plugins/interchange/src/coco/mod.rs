//! COCO detection and instance segmentation.

mod read;

use crate::labels::{self, Label};
use serde_json::json;
use syntable_formats::coco::{Annotation, Category, Image as ImageRecord, Info, License};
use syntable_formats::dataset::{DatasetWriter, Layout};
use syntable_formats::encode::png::Image;
use syntable_formats::encode::view_name;
use syntable_formats::segmentation::{Rle, Segmentation};
use syntable_formats::shard::{self, Line, for_each_line};
use syntable_model::prelude::*;
use syntable_model::product::standard::RGB;
use syntable_model::scene::{SceneId, ViewId};

/// Writes COCO's layout for detection and instance segmentation.
///
/// # What it does
///
/// `segmentation`, `area` and `bbox` are those of one mask, visible or amodal, so that COCO's own tools measure what they
/// say; every annotation also has both masks, both boxes and the rate of occlusion under SynTable's names. Boxes are
/// `[x, y, width, height]` with `width = last column - first column + 1`, areas whole pixels, masks compressed run lengths.
/// Image ids are `scene · views_per_scene + view + 1`; images without objects are listed, too. Categories are `object` (1)
/// and the classes of the recipe's pools.
///
/// # Output
///
/// - `{id}/images/{scene:06}_{view:04}.png`: 8-bit RGB; `file_name` is relative to `{id}/images`.
/// - `{id}/annotations/instances_{split}.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Coco {
    /// Mask of `segmentation`, `area` and `bbox`. Objects whose visible mask is empty have no annotation with `visible`.
    pub masks: Masks,
    /// Name of the split in the annotation file's name.
    pub split: String,
}

/// A mask of each object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Masks {
    /// What the image shows of the object.
    Visible,
    /// The object without occluders.
    Amodal,
}

impl Default for Coco {
    fn default() -> Self {
        Self { masks: Masks::Amodal, split: "train".into() }
    }
}

impl Config for Coco {
    type Stage = dyn Writer;
    const KIND: &'static str = "coco";
    const EXAMPLE: &'static str = "masks = \"amodal\"\nsplit = \"train\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_path("split", &file(&self.split))?;
        Ok(Box::new(self))
    }
}

/// Name of the annotation file.
fn file(split: &str) -> String {
    format!("annotations/instances_{split}.json")
}

impl Writer for Coco {
    fn reads(&self) -> Vec<Input> {
        std::iter::once(Input::of(RGB)).chain(labels::inputs()).collect()
    }

    fn scene(&self, _: &SceneContext, output: Output) -> Result<Box<dyn SceneWriter>> {
        Ok(Box::new(CocoScene { masks: self.masks, output, shard: Vec::new() }))
    }

    fn paths(&self, of: &FileOf) -> Result<Vec<String>> {
        Ok(match (of.scene, of.view) {
            (Some(scene), Some(view)) => vec![format!("{}/images/{}", of.id, image_name(scene, view))],
            (None, None) => vec![format!("{}/{}", of.id, file(&self.split))],
            _ => Vec::new(),
        })
    }

    fn finish_options(&self) -> &'static [&'static str] {
        &["split"]
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        let path = format!("{}/{}", finish.id(), file(&self.split));
        finish.write(&path, |out| {
            let mut file = DatasetWriter::new(out, &path, Layout::Lines)?;
            file.header(&info(cx.dataset), &[license()], &categories(cx.dataset))?;
            file.images(|images| {
                for_each_line(cx.dataset, finish, |id, line| match line {
                    Line::Image { record, .. } => images.raw(&record.numbered(id)),
                    _ => Ok(()),
                })
            })?;
            let mut number = 0;
            file.annotations(|annotations| {
                for_each_line(cx.dataset, finish, |image, line| match line {
                    Line::Annotation(record) => {
                        number += 1;
                        annotations.raw(&record.numbered(number, image))
                    }
                    _ => Ok(()),
                })
            })?;
            file.finish()
        })
    }
}

fn image_name(scene: SceneId, view: ViewId) -> String {
    format!("{}.png", view_name(scene, view))
}

/// What the dataset is, without dates: files do not depend on the clock.
pub fn info(dataset: &DatasetInfo) -> Info {
    Info { description: dataset.name.clone(), contributor: dataset.program.clone(), ..Info::default() }
}

/// The one license of all images.
pub fn license() -> License {
    License { id: 1, name: "licenses of the assets".into(), ..License::default() }
}

/// The categories of the dataset.
pub fn categories(dataset: &DatasetInfo) -> Vec<Category> {
    let category = |(id, name): (u32, &str)| Category { id: id.into(), name: name.into(), ..Category::default() };
    dataset.categories().map(category).collect()
}

struct CocoScene {
    masks: Masks,
    output: Output,
    shard: Vec<u8>,
}

impl SceneWriter for CocoScene {
    fn view(&mut self, cx: &ViewContext, products: &Products) -> Result<()> {
        let (rgb, name) = (products.get(RGB)?, image_name(cx.scene.id, cx.view.id));
        Image::rgb(rgb).write(&self.output, &format!("{}/images/{name}", self.output.id()))?;
        let mut labels = labels::labels(products)?;
        labels.retain(|label| !self.masks.of(label).is_empty());
        let image = ImageRecord {
            id: 0,
            file_name: name,
            width: rgb.width(),
            height: rgb.height(),
            license: Some(1),
            ..ImageRecord::default()
        };
        shard::push_image(&mut self.shard, labels.len(), &image)?;
        labels.iter().try_for_each(|label| shard::push_annotation(&mut self.shard, &self.masks.annotation(label)))
    }

    fn close(self: Box<Self>, _: &SceneContext, _: &Products) -> Result<()> {
        self.output.write_shard(&self.shard)
    }
}

impl Masks {
    fn of<'a>(self, label: &Label<'a>) -> &'a Mask {
        match self {
            Self::Visible => label.visible,
            Self::Amodal => label.amodal,
        }
    }

    fn annotation(self, label: &Label) -> Annotation {
        let boxes = [label.visible_box, label.amodal_box].map(<[i32; 4]>::from);
        let bbox = boxes[self as usize].map(f64::from);
        let extra = json!({
            "instance_id": label.id.0,
            "visible_mask": Rle::encode(label.visible),
            "visible_bbox": boxes[0],
            "amodal_mask": Rle::encode(label.amodal),
            "amodal_bbox": boxes[1],
            "occluded_mask": Rle::encode(label.occlusion),
            "occluded_rate": label.rate,
        });
        let mask = self.of(label);
        Annotation {
            id: 0,
            image_id: 0,
            category_id: label.category.into(),
            segmentation: Some(Segmentation::Rle(Rle::encode(mask))),
            area: mask.area().into(),
            bbox,
            iscrowd: 0,
            extra: extra.as_object().cloned().unwrap_or_default(),
        }
    }
}

register!(Coco);
