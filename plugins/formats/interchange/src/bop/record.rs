//! What is written to BOP's JSON files, and what of the products it is made from.

use serde::de::DeserializeOwned;
use syntable_formats::segmentation::UncompressedRle;
use syntable_model::prelude::*;
use syntable_model::product::BBox;

/// Millimeters per meter.
pub const MM: f64 = 1000.0;
/// Position of the center of the first pixel in an image whose corner is (0, 0); it is 0 in BOP's matrices.
const PIXEL_CENTER: f64 = 0.5;
/// A box of nothing.
pub const NO_BOX: [i64; 4] = [-1; 4];

/// The part of the product `camera` that BOP has.
#[derive(Debug, Serialize, Deserialize)]
pub struct CameraView {
    pub width: u32,
    pub height: u32,
    #[serde(rename = "K")]
    k: [[f64; 3]; 3],
    /// Missing where a dataset does not say where cameras are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    world_from_camera: Option<[[f64; 4]; 4]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    camera_from_world: Option<[[f64; 4]; 4]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distortion_k1_k2_p1_p2_k3: Option<[f64; 5]>,
}

/// The part of the product `object_info` that BOP has.
#[derive(Debug, Deserialize)]
pub struct ObjectView {
    pub asset: String,
    pub camera_from_object: [[f64; 4]; 4],
    /// Number of the asset.
    #[serde(default)]
    obj_id: Option<u64>,
    /// Origin of the asset's file in the object frame, m.
    #[serde(default)]
    model_origin_m: [f64; 3],
}

impl ObjectView {
    /// Maps points of the asset's file, at the size of the object, to the camera, m.
    fn camera_from_model(&self) -> [[f64; 4]; 4] {
        let mut pose = self.camera_from_object;
        let [x, y, z] = self.model_origin_m;
        pose[..3].iter_mut().for_each(|row| row[3] += row[0] * x + row[1] * y + row[2] * z);
        pose
    }
}

/// The part of the product `visibility` that BOP has.
#[derive(Debug, Deserialize)]
pub struct VisibilityView {
    px_count_all: u64,
    pub px_count_in_frame: u64,
    px_count_valid: u64,
    pub px_count_visib: u64,
    pub visib_fract: f64,
    silhouette_box: [i32; 4],
}

/// Reads a record of a product.
pub fn read<T: DeserializeOwned>(value: &Value, product: &str) -> Result<T> {
    serde_json::to_value(value).and_then(serde_json::from_value).map_err(|error| {
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

/// `camera.json`.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Camera {
    pub cx: f64,
    pub cy: f64,
    pub depth_scale: f64,
    pub fx: f64,
    pub fy: f64,
    pub height: u32,
    pub width: u32,
}

impl CameraView {
    /// The camera of an image, with the corner of the first pixel at (0, 0).
    pub fn of(camera: &SceneCamera, [width, height]: [u32; 2]) -> Self {
        let [fx, skew, cx, _, fy, cy, ..] = camera.k;
        Self {
            width,
            height,
            k: [[fx, skew, cx + PIXEL_CENTER], [0.0, fy, cy + PIXEL_CENTER], [0.0, 0.0, 1.0]],
            world_from_camera: camera.world_from_camera(),
            camera_from_world: camera.camera_from_world(),
            distortion_k1_k2_p1_p2_k3: None,
        }
    }

    /// The intrinsics with the center of the first pixel at (0, 0).
    pub fn camera(&self, depth_scale: f64) -> Camera {
        let [[fx, _, cx], [_, fy, cy], _] = self.k;
        let (cx, cy) = (cx - PIXEL_CENTER, cy - PIXEL_CENTER);
        Camera { cx, cy, depth_scale, fx, fy, height: self.height, width: self.width }
    }

    pub fn scene_camera(&self, depth_scale: f64) -> SceneCamera {
        let Camera { fx, fy, cx, cy, .. } = self.camera(depth_scale);
        let (rotation, translation_mm) = self.camera_from_world.as_ref().map(pose).unzip();
        let k = [fx, self.k[0][1], cx, 0.0, fy, cy, 0.0, 0.0, 1.0];
        SceneCamera { k, depth_scale, rotation, translation_mm }
    }
}

/// An entry of `scene_gt_info.json`.
#[derive(Debug, Serialize, Deserialize)]
pub struct Info {
    pub bbox_obj: [i64; 4],
    pub bbox_visib: [i64; 4],
    pub px_count_all: u64,
    pub px_count_valid: u64,
    pub px_count_visib: u64,
    pub visib_fract: f64,
}

impl VisibilityView {
    pub fn info(&self, visible: BBox) -> Info {
        let seen = self.px_count_visib > 0;
        let bbox = |bbox: [i32; 4]| if seen { between_centers(bbox) } else { NO_BOX };
        Info {
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
    pub camera: Camera,
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
    /// None if the image does not show it.
    pub shown: Option<Shown>,
}

/// What the image shows of an object.
#[derive(Debug, Serialize, Deserialize)]
pub struct Shown {
    pub mask: UncompressedRle,
    pub area: u32,
    pub visible_box: [i32; 4],
    pub amodal_box: [i32; 4],
}

impl ObjectRecord {
    pub fn new(object: ObjectView, visib_fract: f64, visible: &Mask, amodal: &Mask) -> Self {
        let (rotation, translation_mm) = pose(&object.camera_from_model());
        let shown = (!visible.is_empty()).then(|| Shown {
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
