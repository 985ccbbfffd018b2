//! UOAIS-Sim.

use crate::annotation_file::{Listed, SceneFiles, check_split, image_name, merge, policy};
use crate::coco::Masks;
use crate::depth::DepthSource;
use crate::labels::{self, Label};
use syntable_formats::Extra;
use syntable_formats::coco::Category;
use syntable_formats::read::SUPERCATEGORY;
use syntable_formats::segmentation::Rle;
use syntable_model::prelude::*;
use syntable_model::product::standard::RGB;

/// The one category, which UOAIS-Net knows.
const CATEGORY: u64 = 1;

/// Writes the layout of UOAIS-Sim, from which UOAIS-Net is trained.
///
/// # What it does
///
/// The folder `{id}` takes the place of `datasets/UOAIS-Sim`. The annotation file has what UOAIS-Net's loader reads,
/// and nothing else: `segmentation` (amodal), `visible_mask` and `occluded_mask` are compressed run lengths, `bbox` and
/// `area` those of the amodal mask, `occluded_rate` is the hidden fraction of it. The one category is `object` (1).
/// Image ids are `scene · views_per_scene + view + 1`.
///
/// **Images must have 640 × 480 pixels** for UOAIS-Net's default recipe: it distorts depth as an image of this size,
/// and loading fails with any other. Its range of depth, `DEPTH_RANGE`, must be set to that of the dataset, such as 250
/// to 2500 mm.
///
/// # Output
///
/// - `{id}/{split}/rgb/{scene:06}_{view:04}.png`: 8-bit RGB.
/// - `{id}/{split}/depth/{scene:06}_{view:04}.png`: 16-bit depth along the optical axis, whole millimeters; 0 where
///   there is none.
/// - `{id}/annotations/coco_anns_uoais_sim_{split}.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Uoais {
    /// `train` or `val`: folder of the images, and part of the annotation file's name.
    pub split: String,
    /// Depth that is written.
    pub depth: DepthSource,
    /// Leaves images without annotations out of the annotation file: UOAIS-Net's evaluation fails at them. Their image
    /// files are written all the same.
    pub skip_empty_images: bool,
}

impl Default for Uoais {
    fn default() -> Self {
        Self { split: "train".into(), depth: DepthSource::default(), skip_empty_images: true }
    }
}

impl Config for Uoais {
    type Stage = dyn Writer;
    const KIND: &'static str = "uoais";
    const EXAMPLE: &'static str = "split = \"train\"\nskip_empty_images = true";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_split(&self.split)?;
        if self.split == ANNOTATIONS {
            let message = format!("`{ANNOTATIONS}` is the folder of the annotation file");
            return Err(ConfigError::new("split", message).help("write `train` or `val`"));
        }
        Ok(Box::new(self))
    }
}

/// Folder of the annotation file inside the writer's folder.
const ANNOTATIONS: &str = "annotations";

/// How the name of the annotation file begins.
pub(crate) const FILE: &str = "coco_anns_uoais_sim_";

impl Uoais {
    fn file(&self) -> String {
        format!("{ANNOTATIONS}/{FILE}{}.json", self.split)
    }
}

/// Path of the color image, relative to the folder of the split.
fn rgb_path(image: &str) -> String {
    format!("rgb/{image}")
}

/// Path of the depth image, relative to the folder of the split.
fn depth_path(image: &str) -> String {
    format!("depth/{image}")
}

impl Writer for Uoais {
    fn reads(&self) -> Vec<Input> {
        [Input::of(RGB), self.depth.input(), policy()].into_iter().chain(labels::inputs()).collect()
    }

    fn scene(&self, _: &ImagesContext, output: Output) -> Result<Box<dyn SceneWriter>> {
        Ok(Box::new(UoaisScene { config: self.clone(), files: SceneFiles::new(output) }))
    }

    fn paths(&self, of: &FileOf) -> Result<Vec<String>> {
        Ok(match (of.scene, of.view) {
            (Some(scene), Some(view)) => {
                let image = image_name(scene, view);
                [rgb_path(&image), depth_path(&image)].map(|path| format!("{}/{}/{path}", of.id, self.split)).to_vec()
            }
            (None, None) => vec![format!("{}/{}", of.id, self.file())],
            _ => Vec::new(),
        })
    }

    fn finish_options(&self) -> &'static [&'static str] {
        &["skip_empty_images"]
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        let listed = if self.skip_empty_images { Listed::Annotated } else { Listed::All };
        let (name, supercategory) = ("object".into(), SUPERCATEGORY.into());
        let category = Category { id: CATEGORY, name, supercategory, ..Category::default() };
        merge(cx, finish, &self.file(), Some(&[category]), listed)
    }
}

/// An object, with what UOAIS-Net's loader and evaluator read.
#[derive(Serialize)]
struct Annotation {
    id: u64,
    image_id: u64,
    category_id: u64,
    bbox: [i32; 4],
    area: u32,
    iscrowd: u8,
    segmentation: Rle,
    visible_mask: Rle,
    occluded_mask: Rle,
    occluded_rate: f64,
}

impl Annotation {
    fn of(label: &Label) -> Self {
        Self {
            id: 0,
            image_id: 0,
            category_id: CATEGORY,
            bbox: label.amodal_box.into(),
            area: label.amodal.area(),
            iscrowd: 0,
            segmentation: Rle::encode(label.amodal),
            visible_mask: Rle::encode(label.visible),
            occluded_mask: Rle::encode(label.occlusion),
            occluded_rate: label.rate,
        }
    }
}

struct UoaisScene {
    config: Uoais,
    files: SceneFiles,
}

impl SceneWriter for UoaisScene {
    fn view(&mut self, cx: &ImageContext, products: &Products) -> Result<()> {
        let Self { config, files } = self;
        let image = image_name(cx.scene_id, cx.view_id);
        files.png(&format!("{}/{}", config.split, depth_path(&image)), &config.depth.image(products)?)?;
        let labels = Masks::Amodal.shown(cx.log, labels::labels(cx.dataset, products)?);
        let extra = Extra::from_iter([("depth_file_name".to_owned(), depth_path(&image).into())]);
        files.image_in(&config.split, rgb_path(&image), products, labels.len(), extra)?;
        labels.iter().try_for_each(|label| files.annotation(&Annotation::of(label)))
    }

    fn close(self: Box<Self>, _: &ImagesContext, _: &Products) -> Result<()> {
        self.files.close()
    }
}

register!(Uoais);
