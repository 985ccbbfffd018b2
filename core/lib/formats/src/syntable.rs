//! SynTable's annotations.
//!
//! SynTable has two forms of annotations; [`SynTableImage`] and [`SynTableAnnotation`] read both:
//!
//! - **coco**, the form of new datasets: one record per image, true areas, rates in full precision, camera, object
//!   poses and label policy. [`SynTableImage`] and [`SynTableAnnotation`] write it.
//! - **syntable_1**, the form of SynTable's release and of UOAIS-Sim: the image's record is repeated for every
//!   annotation. [`SynTableImage`] without its optional fields and [`syntable_1::SynTable1Annotation`] write it.

use crate::Extra;
use crate::segmentation::Rle;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value as Json;
use std::path::Path;
use syntable_model::error::{Error, Result};
use syntable_model::stage::DatasetInfo;

/// A SynTable annotation file.
pub type SynTableDataset = crate::dataset::AnnotationDataset<SynTableImage, SynTableAnnotation>;

/// Id of the category `object`: the category of objects without a class, and of all objects in the syntable_1 form.
pub const OBJECT_CATEGORY: u64 = DatasetInfo::OBJECT.0 as u64;

/// Name of the section of scenes.
pub const SCENES: &str = "scenes";

/// Folder of the views' files, relative to the dataset.
pub const VIEWS: &str = "data/mono";

/// Whether a folder has SynTable's layout: annotation files at its top describe the views in [`VIEWS`].
pub fn is_root(folder: &Path) -> bool {
    folder.join(VIEWS).is_dir()
}

/// Path of a view's 8-bit RGB image, relative to the dataset.
pub fn rgb_path(scene: u32, view: u32, extension: &str) -> String {
    format!("data/mono/rgb/{scene}_{view}.{extension}")
}

/// Path of a view's 16-bit depth image, relative to the dataset: whole millimeters along the optical axis.
pub fn depth_path(scene: u32, view: u32) -> String {
    format!("data/mono/depth/{scene}_{view}.png")
}

/// Path of a view's occlusion order, relative to the dataset: a float64 NumPy array of `[N, N]`, 1 where the object of
/// the row occludes the object of the column. N counts the annotations of the image in the order of the file.
pub fn occlusion_order_path(scene: u32, view: u32) -> String {
    format!("data/mono/occlusion_order/{scene}_{view}.npy")
}

/// An image. Only the coco form has the fields from `scene_id` on.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SynTableImage {
    /// From 1, unique in the file: `scene · views_per_scene + view + 1` with the recipe's `dataset.views_per_scene`.
    /// Scenes that failed or have fewer views leave gaps. 0 in a scene's shard, before the file is merged.
    pub id: u64,
    /// Path of the 8-bit RGB image, relative to the dataset.
    pub file_name: String,
    /// Path of the 16-bit depth image, relative to the dataset. Missing in files without depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_file_name: Option<String>,
    /// Path of the occlusion order matrix, relative to the dataset. Missing in UOAIS-Sim.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub occlusion_order_file_name: Option<String>,
    /// Width, px.
    pub width: u32,
    /// Height, px.
    pub height: u32,
    /// Date in any form.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub date_captured: Option<String>,
    /// Id of the image's license.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub license: Option<u64>,
    /// Empty.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coco_url: Option<String>,
    /// Empty.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flickr_url: Option<String>,
    /// Number of the scene, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene_id: Option<u32>,
    /// Number of the view in its scene, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub view_id: Option<u32>,
    /// Instances of the image's annotations, in the order of the file: rows and columns of the occlusion order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub instance_ids: Option<Vec<u16>>,
    /// Millimeters per step of the depth image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_unit_mm: Option<u32>,
    /// The product `camera`; [`SynTableImage::camera`] reads it.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "present")]
    pub camera: Option<Json>,
    /// The product `exposure`.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "present")]
    pub exposure: Option<Json>,
    /// The product `denoiser`.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "present")]
    pub denoiser: Option<Json>,
    /// The product `label_policy`: how labels treat the image frame, the table and hidden objects.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "present")]
    pub label_policy: Option<Json>,
    /// Fields that this type does not know.
    #[serde(flatten)]
    pub extra: Extra,
}

impl SynTableImage {
    /// The camera, if the file has it.
    pub fn camera(&self) -> Result<Option<SynTableCamera>> {
        self.camera.as_ref().map(|camera| typed(camera, format!("image {}: `camera`", self.id))).transpose()
    }
}

/// An object in an image. Optional fields belong to the coco form.
///
/// Visible (V), amodal (A) and occluded (O) masks have the size of the image, and O is A without V.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SynTableAnnotation {
    /// From 1, unique in the file. 0 in a scene's shard, before the file is merged.
    pub id: u64,
    /// The image's id. 0 in a scene's shard, before the file is merged.
    pub image_id: u64,
    /// The object's class, or [`OBJECT_CATEGORY`]; 0 marks the background in SynTable's own files.
    pub category_id: u64,
    /// Id of the object in its scene, the same in all views.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub instance_id: Option<u16>,
    /// Name of the asset. Not unique within an image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object_name: Option<String>,
    /// Box of V, or of A if the dataset was written with `bbox = "amodal"`, px.
    pub bbox: [i32; 4],
    /// Box of V, px; zeros if nothing is visible.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub visible_bbox: Option<[i32; 4]>,
    /// Box of A, px.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amodal_bbox: Option<[i32; 4]>,
    /// Width of the image, px.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub width: Option<u32>,
    /// Height of the image, px.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height: Option<u32>,
    /// 0: an annotation is one object.
    #[serde(default)]
    pub iscrowd: u8,
    /// Pixels of A. 0 in the syntable_1 form.
    #[serde(default)]
    pub area: u64,
    /// Pixels of V.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub visible_area: Option<u64>,
    /// Pixels of O.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub occluded_area: Option<u64>,
    /// Pixels of O over pixels of A, in [0, 1]. Two decimals in the syntable_1 form. Missing if objects have only
    /// visible masks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub occluded_rate: Option<f64>,
    /// The rate with two decimals, as in the syntable_1 form.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub occluded_rate_rounded: Option<f64>,
    /// A; V if objects have only visible masks.
    pub segmentation: Rle,
    /// V.
    pub visible_mask: Rle,
    /// O; empty if the object is not occluded. Missing if objects have only visible masks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub occluded_mask: Option<Rle>,
    /// The product `object_info` of the object, null if it has none; [`SynTableAnnotation::object`] reads it.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "present")]
    pub object: Option<Json>,
    /// Fields that this type does not know.
    #[serde(flatten)]
    pub extra: Extra,
}

impl SynTableAnnotation {
    /// Name, category and pose of the object, if the file has them.
    pub fn object(&self) -> Result<Option<SynTableObject>> {
        let object = self.object.as_ref().filter(|object| !object.is_null());
        object.map(|object| typed(object, format!("annotation {}: `object`", self.id))).transpose()
    }
}

/// The form of SynTable's release.
pub mod syntable_1 {
    use super::{Deserialize, Extra, Rle, Serialize};

    /// Id of the only object that the release's renderer sees when it renders an amodal mask, in all its published
    /// annotations.
    pub const RENDERER_ID: u64 = 10;

    /// An object in an image, with the fields of SynTable's release in its order.
    ///
    /// Two fields do not hold the values that their names suggest, and programs that read the release must not trust
    /// them: `area` is 0, and `segmentation.area` is the sum of the renderer's ids over the mask, [`RENDERER_ID`] times
    /// its area.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    pub struct SynTable1Annotation {
        /// From 1, unique in the file. 0 in a scene's shard, before the file is merged.
        pub id: u64,
        /// The image's id. 0 in a scene's shard, before the file is merged.
        pub image_id: u64,
        /// 1 for an object; 0 marks the background.
        pub category_id: u64,
        /// Box of the visible mask, px.
        pub bbox: [i32; 4],
        /// Width of the image, px.
        pub width: u32,
        /// Height of the image, px.
        pub height: u32,
        /// Name of the asset. Not unique within an image.
        pub object_name: String,
        /// 0: an annotation is one object.
        pub iscrowd: u8,
        /// The amodal mask.
        pub segmentation: Rle,
        /// 0.
        pub area: u64,
        /// The visible mask.
        pub visible_mask: Rle,
        /// Box of the visible mask, px.
        pub visible_bbox: [i32; 4],
        /// The occluded mask; empty if the object is not occluded.
        pub occluded_mask: Rle,
        /// Occluded pixels over amodal pixels, in [0, 1], with two decimals.
        pub occluded_rate: f64,
        /// Fields that this type does not know.
        #[serde(flatten)]
        pub extra: Extra,
    }
}

/// A matrix `[R t; 0 1]` that maps points of one frame to another, m, row by row.
pub type PoseMatrix = [[f64; 4]; 4];

/// The camera of a view. Axes: x right, y down, z forward.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SynTableCamera {
    /// Width of the image, px.
    pub width: u32,
    /// Height of the image, px.
    pub height: u32,
    /// Intrinsics `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]`, px. (0, 0) is the top left corner of the image.
    #[serde(rename = "K")]
    pub k: [[f64; 3]; 3],
    /// Maps points of the camera to the world (right-handed, z up).
    pub world_from_camera: PoseMatrix,
    /// Other fields, such as lens distortion.
    #[serde(flatten)]
    pub extra: Extra,
}

/// A scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SynTableScene {
    /// Number of the scene, from 0; `scene_id` of its images.
    pub id: u32,
    /// The bodies of the scene, in the order of their ids.
    pub bodies: Vec<SynTableBody>,
    /// Fields that this type does not know.
    #[serde(flatten)]
    pub extra: Extra,
}

/// A body of a scene: an object, a distractor, the table or a part of the room.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SynTableBody {
    /// Its id in the product `instance`; of objects, `instance_id` of their annotations.
    pub id: u16,
    /// `object`, `distractor`, `support` or `room`.
    pub role: String,
    /// Id of the pool of its asset.
    pub pool: String,
    /// Name of the asset in its pool.
    pub name: String,
    /// Category of the asset.
    pub category: String,
    /// Names of its materials.
    pub materials: Vec<String>,
    /// Maps points of the body to the world (right-handed, z up).
    pub world_from_body: PoseMatrix,
    /// Fields that this type does not know.
    #[serde(flatten)]
    pub extra: Extra,
}

impl SynTableDataset {
    /// The scenes of the file; none in the syntable_1 form.
    pub fn scenes(&self) -> Result<Vec<SynTableScene>> {
        self.extra.get(SCENES).map_or(Ok(Vec::new()), |scenes| typed(scenes, format!("`{SCENES}`")))
    }
}

/// Name and pose of an annotated object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SynTableObject {
    /// Name of the asset in its pool.
    pub name: String,
    /// Category of the asset; empty if it has none.
    #[serde(default)]
    pub category: String,
    /// Maps points of the object's mesh to the world (right-handed, z up).
    pub world_from_object: PoseMatrix,
    /// Maps points of the object's mesh to the camera (x right, y down, z forward).
    pub camera_from_object: PoseMatrix,
    /// Other fields, such as the mass.
    #[serde(flatten)]
    pub extra: Extra,
}

fn typed<T: for<'de> Deserialize<'de>>(value: &Json, what: String) -> Result<T> {
    serde_path_to_error::deserialize(value)
        .map_err(|error| Error::new(format!("{what}: `{}`: {}", error.path(), error.inner())))
}

/// A field whose value may be null, which differs from a missing field.
fn present<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Json>, D::Error> {
    Json::deserialize(deserializer).map(Some)
}
