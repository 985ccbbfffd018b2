//! Files of BOP's layouts: their names, and the records of the JSON files together with the parts of the products that
//! they come from.

use crate::field::LenientField;
use serde::de::DeserializeOwned;
use serde_json::Value as Json;
use syntable_formats::segmentation::UncompressedRle;
use syntable_formats::{Extra, json};
use syntable_model::prelude::*;
use syntable_model::product::{BBox, DistortionRecord};
use syntable_model::scene::{SceneId, Symmetries, ViewId};

/// Cameras of a scene.
pub const SCENE_CAMERA: &str = "scene_camera.json";
/// Boxes and counts of pixels of a scene.
pub const SCENE_GT_INFO: &str = "scene_gt_info.json";
/// Poses of a scene.
pub const SCENE_GT: &str = "scene_gt.json";
/// COCO's annotations of a scene, with boxes of whole objects.
pub const SCENE_GT_COCO: &str = "scene_gt_coco.json";
/// As [`SCENE_GT_COCO`], with boxes of visible parts.
pub const SCENE_GT_COCO_MODAL: &str = "scene_gt_coco_modal.json";
/// The JSON files that are written with a scene.
pub const SCENE_FILES: [&str; 2] = [SCENE_CAMERA, SCENE_GT_INFO];
/// The files of a scene that are written at the end.
pub const FINISHED_SCENE_FILES: [&str; 3] = [SCENE_GT, SCENE_GT_COCO, SCENE_GT_COCO_MODAL];

/// The camera of the dataset.
pub const CAMERA_FILE: &str = "camera.json";
/// Name and size of the dataset.
pub const DATASET_INFO: &str = "dataset_info.json";
/// A key of it. Without the key, pixel centers are at integers.
pub const PIXEL_CENTERS: &str = "pixel_centers";
/// Names of the objects by number.
pub const OBJECTS: &str = "objects.json";
/// The objects and images on which methods are tested.
pub const TARGETS: &str = "test_targets_bop19.json";
/// Numbers of the shards of images.
pub const KEY_TO_SHARD: &str = "key_to_shard.json";

/// Folder of the meshes.
pub const MODELS: &str = "models";
/// Folder of the meshes that evaluations read.
pub const MODELS_EVAL: &str = "models_eval";
/// Sizes of the meshes, in each folder of meshes.
pub const MODELS_INFO: &str = "models_info.json";

/// Fields of a sample in a tar file, which hold the content of the files above for one image: depth.
pub const SAMPLE_DEPTH: &str = "depth.png";
/// The camera.
pub const SAMPLE_CAMERA: &str = "camera.json";
/// Poses.
pub const SAMPLE_GT: &str = "gt.json";
/// Boxes and counts of pixels.
pub const SAMPLE_GT_INFO: &str = "gt_info.json";
/// Masks of whole objects.
pub const SAMPLE_MASK: &str = "mask.json";
/// Visible masks.
pub const SAMPLE_MASK_VISIB: &str = "mask_visib.json";

/// Name of a tar file of samples.
pub fn shard_file(number: usize) -> String {
    format!("shard-{number:06}.tar")
}

/// The number in the name of a tar file of samples.
pub fn shard_number(name: &str) -> Option<u64> {
    name.strip_prefix("shard-")?.strip_suffix(".tar")?.parse().ok()
}

/// Key of an image in tar files.
pub fn key(scene: SceneId, view: ViewId) -> String {
    format!("{:06}_{:06}", scene.0, view.0)
}

/// Name of the file of a mesh.
pub fn model_file(obj_id: u64) -> String {
    format!("obj_{obj_id:06}.ply")
}

/// The number in the name of the file of a mesh.
pub fn model_number(name: &str) -> Option<u64> {
    name.strip_prefix("obj_")?.strip_suffix(".ply")?.parse().ok()
}

/// An image of a view. Masks are numbered by the object's entry in `scene_gt.json`.
#[derive(Debug, Clone, Copy)]
pub enum BopImage {
    Rgb,
    Depth,
    Mask(usize),
    MaskVisib(usize),
}

impl BopImage {
    /// Path in the scene's folder.
    pub fn path(self, view: ViewId) -> String {
        self.path_as(view, "png")
    }

    /// As [`Self::path`], with another extension: the color images of some datasets are not PNG files.
    pub fn path_as(self, view: ViewId, extension: &str) -> String {
        let view = view.0;
        match self {
            Self::Rgb => format!("rgb/{view:06}.{extension}"),
            Self::Depth => format!("depth/{view:06}.{extension}"),
            Self::Mask(object) => format!("mask/{view:06}_{object:06}.{extension}"),
            Self::MaskVisib(object) => format!("mask_visib/{view:06}_{object:06}.{extension}"),
        }
    }
}

/// Millimeters per meter.
pub const MM: f64 = 1000.0;
/// Position of the center of the first pixel in an image whose corner is (0, 0).
const PIXEL_CENTER: f64 = 0.5;
/// Positions of pixel centers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BopPixelCenters {
    /// The center of the first pixel is (0, 0), as in BlenderProc.
    #[default]
    Integers,
    /// The center of the first pixel is (0.5, 0.5), as in OpenGL and in bop_toolkit's renderers.
    HalfIntegers,
}

impl BopPixelCenters {
    /// Distance of the center of the first pixel from the origin, along each axis, px.
    pub fn first(self) -> f64 {
        match self {
            Self::Integers => 0.0,
            Self::HalfIntegers => 0.5,
        }
    }
}

/// The box of an object without pixels.
pub const NO_BOX: [i64; 4] = [-1; 4];

/// The part of the product `camera` that BOP stores.
#[derive(Debug, Serialize, Deserialize)]
pub struct CameraProduct {
    pub width: u32,
    pub height: u32,
    #[serde(rename = "K")]
    k: [[f64; 3]; 3],
    /// Missing if the dataset does not contain camera poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    world_from_camera: Option<[[f64; 4]; 4]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    camera_from_world: Option<[[f64; 4]; 4]>,
    #[serde(flatten)]
    pub distortion: DistortionRecord,
}

/// The part of the product `object_info` that BOP stores.
#[derive(Debug, Deserialize)]
pub struct ObjectInfoProduct {
    pub asset: String,
    pub camera_from_object: [[f64; 4]; 4],
    /// Number of the asset.
    #[serde(default)]
    obj_id: Option<u64>,
    /// Ratio of the object's lengths to its asset's, if they differ.
    #[serde(default)]
    pub scale: Option<f64>,
    /// Origin of the asset's file in the object frame, m.
    #[serde(default)]
    model_origin_m: [f64; 3],
}

impl ObjectInfoProduct {
    /// Maps points of the asset's file, scaled to the size of the object, to the camera, m.
    fn camera_from_model(&self) -> [[f64; 4]; 4] {
        let mut pose = self.camera_from_object;
        let [x, y, z] = self.model_origin_m;
        pose[..3].iter_mut().for_each(|row| row[3] += row[0] * x + row[1] * y + row[2] * z);
        pose
    }
}

/// The part of the product `visibility` that BOP stores.
#[derive(Debug, Deserialize)]
pub struct VisibilityProduct {
    px_count_all: u64,
    pub px_count_in_frame: u64,
    px_count_valid: u64,
    pub px_count_visib: u64,
    pub visib_fract: f64,
    silhouette_box: [i32; 4],
}

/// Reads a record of a product.
pub fn read<T: DeserializeOwned>(value: &Value, product: &str) -> Result<T> {
    json::typed(value).map_err(|error| {
        Error::new(format!("product `{product}` does not have what BOP needs: {error}"))
            .help(format!("let the annotator `{product}` provide it"))
    })
}

/// Rotation, row by row, and translation in mm of a rigid motion in meters.
fn pose(m: &[[f64; 4]; 4]) -> ([f64; 9], [f64; 3]) {
    (std::array::from_fn(|i| m[i / 3][i % 3]), std::array::from_fn(|row| m[row][3] * MM))
}

/// The rigid motion in meters of a rotation, row by row, and a translation in mm.
fn motion(rotation: &[f64; 9], translation_mm: &[f64; 3]) -> [[f64; 4]; 4] {
    let entry = |row: usize, column: usize| match (row, column) {
        (3, column) => f64::from(u8::from(column == 3)),
        (row, 3) => translation_mm[row] / MM,
        (row, column) => rotation[3 * row + column],
    };
    std::array::from_fn(|row| std::array::from_fn(|column| entry(row, column)))
}

/// An entry of `scene_camera.json`.
#[derive(Debug, Serialize, Deserialize)]
pub struct SceneCamera {
    #[serde(rename = "cam_K")]
    k: [f64; 9],
    pub depth_scale: f64,
    #[serde(rename = "cam_R_w2c", default, skip_serializing_if = "Option::is_none")]
    rotation: Option<[f64; 9]>,
    #[serde(rename = "cam_t_w2c", default, skip_serializing_if = "Option::is_none")]
    translation_mm: Option<[f64; 3]>,
}

impl SceneCamera {
    /// Maps points of the world to the camera, m.
    fn camera_from_world(&self) -> Option<[[f64; 4]; 4]> {
        Some(motion(&self.rotation?, &self.translation_mm?))
    }

    /// Maps points of the camera to the world, m.
    pub fn world_from_camera(&self) -> Option<[[f64; 4]; 4]> {
        let m = self.camera_from_world()?;
        let back = |axis: usize| -(0..3).map(|row| m[row][axis] * m[row][3]).sum::<f64>() * MM;
        let rotation = std::array::from_fn(|i| m[i % 3][i / 3]);
        Some(motion(&rotation, &[back(0), back(1), back(2)]))
    }
}

/// The part of `dataset_info.json` that is read back.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub struct BopDatasetInfo {
    /// Other programs have no such key.
    pub pixel_centers: LenientField<BopPixelCenters>,
}

/// `camera.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BopCamera {
    pub cx: f64,
    pub cy: f64,
    pub depth_scale: f64,
    pub fx: f64,
    pub fy: f64,
    pub height: u32,
    pub width: u32,
}

impl CameraProduct {
    /// The camera of an image, with the corner of the first pixel at (0, 0).
    pub fn of(camera: &SceneCamera, [width, height]: [u32; 2], centers: BopPixelCenters) -> Self {
        let [fx, skew, cx, _, fy, cy, ..] = camera.k;
        let [cx, cy] = [cx, cy].map(|at| at + (PIXEL_CENTER - centers.first()));
        Self {
            width,
            height,
            k: [[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
            world_from_camera: camera.world_from_camera(),
            camera_from_world: camera.camera_from_world(),
            distortion: DistortionRecord::default(),
        }
    }

    /// The intrinsics for these pixel centers.
    pub fn camera(&self, depth_scale: f64, centers: BopPixelCenters) -> BopCamera {
        let [[fx, _, cx], [_, fy, cy], _] = self.k;
        let [cx, cy] = [cx, cy].map(|at| at - (PIXEL_CENTER - centers.first()));
        BopCamera { cx, cy, depth_scale, fx, fy, height: self.height, width: self.width }
    }

    pub fn scene_camera(&self, depth_scale: f64, centers: BopPixelCenters) -> SceneCamera {
        let BopCamera { fx, fy, cx, cy, .. } = self.camera(depth_scale, centers);
        let (rotation, translation_mm) = self.camera_from_world.as_ref().map(pose).unzip();
        let k = [fx, self.k[0][1], cx, 0.0, fy, cy, 0.0, 0.0, 1.0];
        SceneCamera { k, depth_scale, rotation, translation_mm }
    }
}

/// An entry of `scene_gt_info.json`.
#[derive(Debug, Serialize, Deserialize)]
pub struct GroundTruthInfo {
    pub bbox_obj: [i64; 4],
    pub bbox_visib: [i64; 4],
    pub px_count_all: u64,
    pub px_count_valid: u64,
    pub px_count_visib: u64,
    pub visib_fract: f64,
}

impl VisibilityProduct {
    pub fn info(&self, visible: BBox) -> GroundTruthInfo {
        let seen = self.px_count_visib > 0;
        let bbox = |bbox: [i32; 4]| if seen { between_centers(bbox) } else { NO_BOX };
        GroundTruthInfo {
            bbox_obj: bbox(self.silhouette_box),
            bbox_visib: bbox(visible.into()),
            px_count_all: self.px_count_all,
            px_count_valid: self.px_count_valid,
            px_count_visib: self.px_count_visib,
            visib_fract: self.visib_fract,
        }
    }
}

/// A box of whole pixels as the distances between the centers of its outermost pixels.
pub fn between_centers([x, y, width, height]: [i32; 4]) -> [i64; 4] {
    [x, y, width - 1, height - 1].map(i64::from)
}

/// A line of a shard: a view.
#[derive(Debug, Serialize, Deserialize)]
pub struct ViewRecord {
    pub view: u32,
    pub camera: BopCamera,
    /// In the order of `scene_gt.json`.
    pub objects: Vec<ObjectRecord>,
}

/// An object of a view.
#[derive(Debug, Serialize, Deserialize)]
pub struct ObjectRecord {
    pub asset: String,
    /// The number of the asset, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obj_id: Option<u64>,
    rotation: [f64; 9],
    translation_mm: [f64; 3],
    pub visib_fract: f64,
    /// None if the object has no visible pixel in the image.
    pub shown: Option<ShownMask>,
}

/// The visible part of an object.
#[derive(Debug, Serialize, Deserialize)]
pub struct ShownMask {
    pub mask: UncompressedRle,
    pub area: u32,
    pub visible_box: [i32; 4],
    pub amodal_box: [i32; 4],
}

impl ObjectRecord {
    pub fn new(object: ObjectInfoProduct, visib_fract: f64, visible: &Mask, amodal: &Mask) -> Self {
        let (rotation, translation_mm) = pose(&object.camera_from_model());
        let shown = (!visible.is_empty()).then(|| ShownMask {
            mask: UncompressedRle::encode(visible),
            area: visible.area(),
            visible_box: visible.bbox().into(),
            amodal_box: amodal.bbox().into(),
        });
        Self { asset: object.asset, obj_id: object.obj_id, rotation, translation_mm, visib_fract, shown }
    }

    /// Its entry of `scene_gt.json`.
    pub fn ground_truth(&self, obj_id: u64) -> GroundTruth {
        GroundTruth { rotation: self.rotation, translation_mm: self.translation_mm, obj_id }
    }
}

/// An entry of `scene_gt.json`.
#[derive(Debug, Serialize, Deserialize)]
pub struct GroundTruth {
    #[serde(rename = "cam_R_m2c")]
    rotation: [f64; 9],
    #[serde(rename = "cam_t_m2c")]
    translation_mm: [f64; 3],
    pub obj_id: u64,
}

impl GroundTruth {
    /// Maps points of the object to the camera, m.
    pub fn pose(&self) -> [[f64; 4]; 4] {
        motion(&self.rotation, &self.translation_mm)
    }
}

/// An entry of `models_info.json`, mm. This program writes all numbers; files of other programs may lack some of them,
/// or have values of other types. `S` holds the symmetries, or the fields that may state them.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct BopModelInfo<N = LenientField<f64>, S = Extra> {
    pub diameter: N,
    pub min_x: N,
    pub min_y: N,
    pub min_z: N,
    pub size_x: N,
    pub size_y: N,
    pub size_z: N,
    #[serde(flatten)]
    pub symmetries: S,
}

impl<N, S> BopModelInfo<N, S> {
    /// The numbers by key: the diameter, the least corner of the box and its sides.
    pub fn numbers(&self) -> [(&'static str, &N); 7] {
        let Self { diameter, min_x, min_y, min_z, size_x, size_y, size_z, .. } = self;
        [
            ("diameter", diameter),
            ("min_x", min_x),
            ("min_y", min_y),
            ("min_z", min_z),
            ("size_x", size_x),
            ("size_y", size_y),
            ("size_z", size_z),
        ]
    }
}

impl BopModelInfo {
    /// Least corner and sides of the box around the mesh, mm; none if a number is missing.
    pub fn box_mm(&self) -> Option<[[f64; 3]; 2]> {
        let [_, x, y, z, width, depth, height] = self.numbers().map(|(_, number)| number.value().copied());
        Some([[x?, y?, z?], [width?, depth?, height?]])
    }

    /// The symmetries that the entry states.
    ///
    /// # Errors
    /// If the fields are not valid symmetries: the reason.
    pub fn symmetries(&self) -> Result<Symmetries, String> {
        serde_json::from_value(Json::Object(self.symmetries.clone())).map_err(|error| error.to_string())
    }
}
