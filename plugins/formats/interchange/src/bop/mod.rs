//! The format of the BOP benchmark for 6D object pose estimation.

mod check;
mod files;
mod finish;
mod meshes;
mod model;
mod read;
mod record;
mod scene;
mod shard;
mod surface;
mod write;

use crate::family::write::check_split;
pub use record::BopPixelCenters;
use record::{MODELS, MODELS_EVAL};
use syntable_formats::depth::DepthSource;
use syntable_formats::encode::rgb::RgbFiles;
use syntable_model::prelude::*;

/// Writes BOP's scenewise layout or its tar files, which bop_toolkit and the methods of the BOP challenge read.
///
/// # Behavior
///
/// Each scene of the dataset is a BOP scene, and each view is one of its images. Lengths are in millimeters. Poses map
/// the model frame to the camera frame: x right, y down, z forward. The model frame is the frame of the asset's file,
/// wherever the pool puts the center of the object. Evaluations with a benchmark's own models therefore fit, provided
/// that the pool leaves `scale` at 1.
///
/// `cam_K` has pixel centers at integers, as in BlenderProc's files and in `project_pts` and `depth_im_to_dist_im` of bop_toolkit:
/// its `cx` and `cy` are the values of the product `camera` minus 0.5. The renderers of bop_toolkit follow OpenGL, with pixel
/// centers at half-integers, so their images are half a pixel off. `pixel_centers = "half_integers"` is for evaluations that
/// render, such as VSD; `dataset_info.json` then says so, and the reader follows it.
///
/// `obj_id` is the number of the asset in its pool: the number in the file name (`bop_models`), the number in the
/// pool's `ids`, or the position of the asset among all assets of the pool. It depends neither on the drawn assets nor
/// on the part of a split, so parts, splits and growing datasets agree. `objects.json` maps numbers to names.
/// Conversions keep the numbers of the dataset; without numbers, objects are numbered in the order of their names, with
/// a warning.
///
/// `models` adds the meshes of the assets, in millimeters and in the model frame, with vertex colors or a texture, and
/// with the symmetries in the pool's `models_info.json`. A model of one textured material has the texture; a model of
/// several materials has their colors at its vertices. The `diameter` is the exact maximum distance of two vertices.
/// `.syntable` keeps the models of each scene for the end of the run. Scenes with the same model share its files by
/// hard links, if the file system supports them: each model and each texture is stored once.
///
/// A split named `test` or `test_…` has the targets of BOP Challenge 2019: for each image and model, the number of
/// instances whose visible fraction is at least one tenth.
///
/// With `layout = "webdataset"`, images are in tar files for sequential reading, up to 1000 images each. They are
/// written at the end of the run, when `obj_id` is known, from copies in `.syntable`, which double the disk space.
///
/// `mask` is the amodal mask, `mask_visib` the visible mask. Both are exact, without the depth tolerance of masks that
/// are estimated from depth images. `px_count_all` and `bbox_obj` extend one image size beyond every edge. Boxes of
/// `scene_gt_info.json` have `width = last column - first column`; boxes of `scene_gt_coco.json` are one pixel wider
/// and higher.
///
/// # Limits
///
/// A pose of BOP has no scale. Recipes whose placers vary the sizes of objects, by their option `scale`, are refused. The
/// conversion of such a dataset leaves these objects out and counts them, and ends with exit code 3.
///
/// BOP lists all objects of a scene, including hidden ones: for that, set `objects` to `all` here and in the annotators
/// `object_info` and `visibility`. BOP has no lens distortion, so distorted images are refused. `mask` includes the
/// parts that table and room hide, even if `table_and_room` of the annotator `masks` is `clip`. A dataset made with
/// `clip` cannot be converted to BOP.
///
/// # Output
///
/// In `{id}`: `camera.json`, `dataset_info.json`, `objects.json`, with a test split `test_targets_bop19.json`, with
/// models `models/obj_{obj_id:06}.ply`, its texture `models/obj_{obj_id:06}.png` and `models/models_info.json`, the
/// same in `models_eval`. A dataset of several cameras, which differ in image size or intrinsics, has no
/// `camera.json`: `scene_camera.json` has the intrinsics of each image. In `{id}/{split}/{scene:06}`:
///
/// - `rgb/{view:06}.png`, or `.jpg`: 8-bit RGB.
/// - `depth/{view:06}.png`: 16-bit multiples of `depth_scale` along the optical axis; 0 without a surface or measurement.
/// - `mask/{view:06}_{object:06}.png`, `mask_visib/{view:06}_{object:06}.png`: 0 and 255; `object` counts the entries of
///   `scene_gt.json` from 0.
/// - `scene_camera.json`, `scene_gt.json`, `scene_gt_info.json`.
/// - `scene_gt_coco.json` with boxes of whole objects, `scene_gt_coco_modal.json` with boxes of visible masks; both
///   have visible masks.
///
/// With `layout = "webdataset"`, in `{id}/{split}_web`: `shard-000000.tar` and so on, and `key_to_shard.json`, the
/// number of the shard of each image. A sample has the key `{scene:06}_{view:04}` and the members `rgb.png` (or `rgb.jpg`),
/// `depth.png`, `camera.json`, `gt.json`, `gt_info.json`, `mask.json` and `mask_visib.json`: the image's entries of the
/// files above, and the masks as uncompressed run lengths by the number of the object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Bop {
    /// Folder of the scenes: `train_pbr` for rendered training images, `test` for images of a benchmark.
    pub split: String,
    /// Step of depth images, mm. 0.1 mm reaches 6.55 m, 1 mm reaches 65.5 m. Depths beyond 65535 steps are stored as
    /// 65535; the run counts them, and ends with exit code 3.
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub depth_scale: f64,
    /// Depth that is written.
    #[serde(skip_serializing_if = "DepthSource::is_default")]
    pub depth: DepthSource,
    /// Objects to list.
    pub objects: BopObjects,
    /// How images are stored.
    pub layout: BopLayout,
    /// Meshes of the assets to write.
    pub models: BopMeshes,
    /// Files of the color images. The training images of the benchmark, BOP-PBR, are JPEG files.
    #[serde(skip_serializing_if = "RgbFiles::is_default")]
    pub rgb: RgbFiles,
    /// Positions of pixel centers, which decide the principal point of `cam_K` and `camera.json`.
    pub pixel_centers: BopPixelCenters,
}

/// How images are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BopLayout {
    /// A folder per scene.
    Scenewise,
    /// Tar files of samples.
    Webdataset,
}

/// The meshes of the assets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BopMeshes {
    /// No meshes.
    None,
    /// The folder `models`.
    Models,
    /// The folders `models` and `models_eval`, with the same meshes: evaluations read `models_eval`.
    ModelsAndEval,
}

impl BopMeshes {
    /// Folders of meshes.
    fn folders(self) -> &'static [&'static str] {
        match self {
            Self::None => &[],
            Self::Models => &[MODELS],
            Self::ModelsAndEval => &[MODELS, MODELS_EVAL],
        }
    }
}

/// A set of objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BopObjects {
    /// Objects that have an amodal mask in the view.
    Annotated,
    /// All objects of the scene, as BOP's datasets do.
    All,
}

impl Default for Bop {
    fn default() -> Self {
        Self {
            split: "train_pbr".into(),
            depth_scale: 0.1,
            depth: DepthSource::default(),
            objects: BopObjects::Annotated,
            layout: BopLayout::Scenewise,
            models: BopMeshes::None,
            rgb: RgbFiles::default(),
            pixel_centers: BopPixelCenters::default(),
        }
    }
}

impl Config for Bop {
    type Stage = dyn Writer;
    const KIND: &'static str = "bop";
    const EXAMPLE: &'static str = "split = \"train_pbr\"\ndepth_scale = 0.1";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_split(&self.split)?;
        self.rgb.check()?;
        Ok(Box::new(self))
    }
}

register!(Bop);
