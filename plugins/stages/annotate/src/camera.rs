//! The camera of a view.

use crate::matrix::pose;
use syntable_model::prelude::*;
use syntable_model::product::DistortionRecord;
use syntable_model::product::standard::CAMERA;
use syntable_model::scene::View;

/// Intrinsics and pose of the view: `K` (3 × 3) for pixel centers at half-integers, image size, `world_from_camera` and
/// `camera_from_world` (4 × 4, meters), lens distortion, depth of field and the place in a rig, if any, and the conventions in
/// words.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Camera {}

config!(Camera => dyn ViewAnnotator, "camera");

impl ViewAnnotator for Camera {
    fn reads(&self) -> Vec<KeyId> {
        keys![]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![CAMERA]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        products.put(CAMERA, Value::of(&CameraView::from(cx.view))?)
    }
}

/// The product `camera`.
#[derive(Serialize)]
struct CameraView {
    width: u32,
    height: u32,
    #[serde(rename = "K")]
    k: [[f64; 3]; 3],
    world_from_camera: [[f64; 4]; 4],
    camera_from_world: [[f64; 4]; 4],
    camera_axes: &'static str,
    world_axes: &'static str,
    length_unit: &'static str,
    // The key in published datasets, whose bytes do not change.
    #[serde(rename = "pixel_centres")] // typos: ignore
    pixel_centers: &'static str,
    #[serde(flatten)]
    distortion: DistortionRecord,
    #[serde(skip_serializing_if = "Option::is_none")]
    aperture_radius_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    focus_distance_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rig_camera: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rig_pose: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rig_from_camera: Option<[[f64; 4]; 4]>,
}

impl From<&View> for CameraView {
    fn from(View { camera, rig, .. }: &View) -> Self {
        Self {
            width: camera.intrinsics.width,
            height: camera.intrinsics.height,
            k: camera.intrinsics.matrix(),
            world_from_camera: pose(&camera.world_from_camera),
            camera_from_world: pose(&camera.world_from_camera.inverse()),
            camera_axes: "x right, y down, z forward",
            world_axes: "right-handed, z up",
            length_unit: "m",
            pixel_centers: "half-integers: the image's top-left corner is (0, 0)",
            distortion: DistortionRecord::of(camera.distortion.as_ref()),
            aperture_radius_m: camera.lens.map(|lens| lens.aperture_radius_m),
            focus_distance_m: camera.lens.map(|lens| lens.focus_distance_m),
            rig_camera: rig.as_ref().map(|rig| rig.camera.clone()),
            rig_pose: rig.as_ref().map(|rig| rig.pose),
            rig_from_camera: rig.as_ref().map(|rig| pose(&rig.rig_from_camera)),
        }
    }
}

register!(Camera);
