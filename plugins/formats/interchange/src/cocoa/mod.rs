//! COCO-Amodal.

mod read;

use crate::annotation_file::{self, Listed, SceneFiles, check_split, image_name, merge, policy};
use crate::coco::Masks;
use crate::labels::{self, Label};
use crate::order::{self, Order};
use crate::outlines;
use syntable_formats::coco::categories;
use syntable_formats::segmentation::Rle;
use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_OUTLINE, RGB};

/// Writes the layout of COCO-Amodal (COCOA), one annotation per image with its objects from front to back.
///
/// # What it does
///
/// `regions` has the objects from front to back, each after all that occlude it; `order` counts them from 1. Where
/// objects occlude each other, directly or in a circle, the one whose nearest visible pixel is nearest comes first.
/// `depth_constraint` lists the pairs `i-j` of which i occludes j and comes before it, by `order`.
///
/// `segmentation` is one polygon around the amodal mask: its parts are linked at their nearest corners, its holes
/// filled. The annotator `outlines` says how close it is. `area` and `occlude_rate` are those of the masks.
/// `visible_mask` and `invisible_mask`, compressed run lengths, are there if the object is occluded. `name` is the
/// object's category, `isStuff` 0, and `url` the image's file name. Images without objects are left out, so that the
/// n-th annotation is that of the n-th image.
///
/// # Output
///
/// - `{id}/images/{scene:06}_{view:04}.png`: 8-bit RGB.
/// - `{id}/annotations/COCO_amodal_{split}.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Cocoa {
    /// Name of the split in the annotation file's name.
    pub split: String,
}

impl Default for Cocoa {
    fn default() -> Self {
        Self { split: "train2014".into() }
    }
}

impl Config for Cocoa {
    type Stage = dyn Writer;
    const KIND: &'static str = "cocoa";
    const EXAMPLE: &'static str = "split = \"train2014\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_split(&self.split)?;
        Ok(Box::new(self))
    }
}

/// How the name of the annotation file begins.
pub(crate) const FILE: &str = "COCO_amodal_";

impl Cocoa {
    fn file(&self) -> String {
        format!("annotations/{FILE}{}.json", self.split)
    }
}

impl Writer for Cocoa {
    fn reads(&self) -> Vec<Input> {
        let own = [Input::of(RGB), Input::of(AMODAL_OUTLINE), policy()];
        own.into_iter().chain(order::inputs()).chain(labels::inputs()).collect()
    }

    fn scene(&self, _: &ImagesContext, output: Output) -> Result<Box<dyn SceneWriter>> {
        Ok(Box::new(CocoaScene { files: SceneFiles::new(output) }))
    }

    fn paths(&self, of: &FileOf) -> Result<Vec<String>> {
        Ok(annotation_file::paths(of, &[self.file()]))
    }

    fn finish_options(&self) -> &'static [&'static str] {
        &["split"]
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        merge(cx, finish, &self.file(), Some(&categories(cx.dataset)), Listed::Annotated)
    }
}

/// The annotation of an image.
#[derive(Serialize)]
struct ImageAnnotation<'a> {
    id: u64,
    image_id: u64,
    url: String,
    author: &'a str,
    size: usize,
    depth_constraint: String,
    regions: Vec<Region<'a>>,
}

/// An object.
#[derive(Serialize)]
struct Region<'a> {
    segmentation: Vec<f64>,
    name: &'a str,
    area: f64,
    #[serde(rename = "isStuff")]
    is_stuff: u8,
    occlude_rate: f64,
    order: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    visible_mask: Option<Rle>,
    #[serde(skip_serializing_if = "Option::is_none")]
    invisible_mask: Option<Rle>,
}

struct CocoaScene {
    files: SceneFiles,
}

impl SceneWriter for CocoaScene {
    fn view(&mut self, cx: &ImageContext, products: &Products) -> Result<()> {
        let labels = Masks::Amodal.shown(cx.log, labels::labels(cx.dataset, products)?);
        outlines::report_holes(cx.log, products, Masks::Amodal, labels.iter().map(|label| label.id))?;
        let order = Order::of(products, &labels)?;
        let sorted = order.front_to_back();
        let region = |(at, &i): (usize, &usize)| region(cx.dataset, products, at + 1, &labels[i]);
        let regions = sorted.iter().enumerate().map(region).collect::<Result<Vec<_>>>()?;
        self.files.image(cx, products, usize::from(!regions.is_empty()))?;
        if regions.is_empty() {
            return Ok(());
        }
        self.files.annotation(&ImageAnnotation {
            id: 0,
            image_id: 0,
            url: image_name(cx.scene_id, cx.view_id),
            author: &cx.dataset.program,
            size: regions.len(),
            depth_constraint: constraints(&order, &sorted).join(","),
            regions,
        })
    }

    fn close(self: Box<Self>, _: &ImagesContext, _: &Products) -> Result<()> {
        self.files.close()
    }
}

fn region<'a>(dataset: &'a DatasetInfo, products: &Products, order: usize, label: &Label) -> Result<Region<'a>> {
    let is_occluded = !label.occlusion.is_empty();
    let mask = |mask: &Mask| is_occluded.then(|| Rle::encode(mask));
    Ok(Region {
        segmentation: outlines::ring(products, Masks::Amodal, label.id)?.into_flattened(),
        name: dataset.category(label.category)?.1,
        area: label.amodal.area().into(),
        is_stuff: 0,
        occlude_rate: label.rate,
        order,
        visible_mask: mask(label.visible),
        invisible_mask: mask(label.occlusion),
    })
}

/// The pairs `i-j` of places in `sorted`, from 1, of which the first occludes the second.
fn constraints(order: &Order, sorted: &[usize]) -> Vec<String> {
    let pairs = (0..sorted.len()).flat_map(|i| (i + 1..sorted.len()).map(move |j| (i, j)));
    let occluding = pairs.filter(|&(i, j)| order.occludes(sorted[i], sorted[j]));
    occluding.map(|(i, j)| format!("{}-{}", i + 1, j + 1)).collect()
}

register!(Cocoa);
