//! D2S amodal.

mod read;

use crate::annotation_file::{self, Listed, SceneFiles, check_split, merge, policy};
use crate::coco::Masks;
use crate::labels::{self, Label};
use crate::order::{self, Order};
use syntable_formats::coco::categories;
use syntable_formats::segmentation::Rle;
use syntable_model::prelude::*;
use syntable_model::product::standard::RGB;

/// Writes the layout of D2SA, MVTec's amodal annotations of D2S.
///
/// # What it does
///
/// The annotation file has COCO's structure. `segmentation`, `area` and `bbox` are those of the amodal mask;
/// `visible_mask` is beside it, and `invisible_mask` if the object is occluded. Masks are compressed run lengths.
/// `occlude_rate` is the hidden fraction of the amodal mask, `occl_depth` the number of objects in the longest chain of
/// occluders in front of it, 0 if nothing occludes it. `amodal_region.order` counts the objects of an image from 1 from
/// front to back: each comes after all that occlude it; where objects occlude each other, directly or in a circle, the
/// one whose nearest visible pixel is nearest comes first. `amodal_base`, which repeats the image's record, is left
/// out. Images without objects are listed.
///
/// # Output
///
/// - `{id}/images/{scene:06}_{view:04}.png`: 8-bit RGB.
/// - `{id}/annotations/D2S_amodal_{split}.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct D2sa {
    /// Name of the split in the annotation file's name.
    pub split: String,
}

impl Default for D2sa {
    fn default() -> Self {
        Self { split: "training".into() }
    }
}

impl Config for D2sa {
    type Stage = dyn Writer;
    const KIND: &'static str = "d2sa";
    const EXAMPLE: &'static str = "split = \"training\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_split(&self.split)?;
        Ok(Box::new(self))
    }
}

/// How the name of the annotation file begins.
pub(crate) const FILE: &str = "D2S_amodal_";

impl D2sa {
    fn file(&self) -> String {
        format!("annotations/{FILE}{}.json", self.split)
    }
}

impl Writer for D2sa {
    fn reads(&self) -> Vec<Input> {
        [Input::of(RGB), policy()].into_iter().chain(order::inputs()).chain(labels::inputs()).collect()
    }

    fn scene(&self, _: &ImagesContext, output: Output) -> Result<Box<dyn SceneWriter>> {
        Ok(Box::new(D2saScene { files: SceneFiles::new(output) }))
    }

    fn paths(&self, of: &FileOf) -> Result<Vec<String>> {
        Ok(annotation_file::paths(of, &[self.file()]))
    }

    fn finish_options(&self) -> &'static [&'static str] {
        &["split"]
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        merge(cx, finish, &self.file(), Some(&categories(cx.dataset)), Listed::All)
    }
}

/// An object.
#[derive(Serialize)]
struct Annotation<'a> {
    id: u64,
    image_id: u64,
    category_id: u32,
    iscrowd: bool,
    area: f64,
    bbox: [f64; 4],
    segmentation: Rle,
    visible_mask: Rle,
    #[serde(skip_serializing_if = "Option::is_none")]
    invisible_mask: Option<Rle>,
    occlude_rate: f64,
    occl_depth: usize,
    amodal_region: Region<'a>,
}

#[derive(Serialize)]
struct Region<'a> {
    name: &'a str,
    area: f64,
    #[serde(rename = "isStuff")]
    is_stuff: u8,
    bbox: [f64; 4],
    order: usize,
}

struct D2saScene {
    files: SceneFiles,
}

impl SceneWriter for D2saScene {
    fn view(&mut self, cx: &ImageContext, products: &Products) -> Result<()> {
        let labels = Masks::Amodal.shown(cx.log, labels::labels(cx.dataset, products)?);
        let order = Order::of(products, &labels)?;
        let sorted = order.front_to_back();
        let layers = order.layers(&sorted);
        self.files.image(cx, products, labels.len())?;
        sorted
            .iter()
            .enumerate()
            .try_for_each(|(at, &i)| self.files.annotation(&annotation(cx.dataset, &labels[i], at + 1, layers[i])?))
    }

    fn close(self: Box<Self>, _: &ImagesContext, _: &Products) -> Result<()> {
        self.files.close()
    }
}

fn annotation<'a>(dataset: &'a DatasetInfo, label: &Label, order: usize, layer: usize) -> Result<Annotation<'a>> {
    let area = label.amodal.area().into();
    let bbox = <[i32; 4]>::from(label.amodal_box).map(f64::from);
    Ok(Annotation {
        id: 0,
        image_id: 0,
        category_id: label.category,
        iscrowd: false,
        area,
        bbox,
        segmentation: Rle::encode(label.amodal),
        visible_mask: Rle::encode(label.visible),
        invisible_mask: (!label.occlusion.is_empty()).then(|| Rle::encode(label.occlusion)),
        occlude_rate: label.rate,
        occl_depth: layer,
        amodal_region: Region { name: dataset.category(label.category)?.1, area, is_stuff: 0, bbox, order },
    })
}

register!(D2sa);
