//! Named points of objects in the image.

use syntable_model::geometry::Point3;
use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_MASK, DEPTH, KEYPOINTS};
use syntable_model::scene::{Camera, Keypoint};

/// A pixel sees a point if their directions differ by at most this, as a tangent. Distortion can project points into
/// the image that the lens does not show.
const SAME_DIRECTION: f64 = 1e-6;

/// Keypoints of the annotated objects: the named points in the files beside their meshes (`mesh_folder`), in the order
/// of the file. Objects without such a file have no keypoints.
///
/// Each keypoint has a `name`, its position in the world `point_world_m`, its pixel `uv_px` (pixel centers at
/// half-integers, with lens distortion; `null` if the camera cannot see it, for example behind the camera), `depth_m`
/// along the optical axis, and COCO's `visibility`: 0 outside the image, 1 in the image but hidden, 2 visible. A point
/// is hidden if its depth exceeds the depth of its pixel by more than `tolerance_m`: another body or the object itself
/// hides it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Keypoints {
    /// Maximum distance of a visible point behind the surface that the image shows, meters.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub tolerance_m: f64,
}

impl Default for Keypoints {
    fn default() -> Self {
        Self { tolerance_m: 0.01 }
    }
}

config!(Keypoints => dyn ViewAnnotator, "keypoints", "tolerance_m = 0.01");

impl ViewAnnotator for Keypoints {
    fn reads(&self) -> Vec<KeyId> {
        keys![AMODAL_MASK, DEPTH]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![KEYPOINTS]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let (annotated, depth) = (products.get(AMODAL_MASK)?, products.get(DEPTH)?);
        let camera = &cx.view.camera;
        let camera_from_world = camera.world_from_camera.inverse();
        let mut keypoints = PerInstance::default();
        for body in cx.scene.objects().iter().filter(|body| annotated.get(body.id).is_some()) {
            let view = |keypoint: &Keypoint| {
                let in_world = body.world_from_body * keypoint.point;
                let in_camera = camera_from_world * in_world;
                let uv_px = pixel(camera, &in_camera);
                Value::of(&KeypointView {
                    name: &keypoint.name,
                    point_world_m: in_world.into(),
                    uv_px,
                    depth_m: in_camera.z,
                    visibility: self.visibility(camera, uv_px, in_camera.z, depth),
                })
            };
            let views = body.object.keypoints.iter().map(view).collect::<Result<_>>()?;
            keypoints.0.insert(body.id, Value::List(views));
        }
        products.put(KEYPOINTS, keypoints)
    }
}

impl Keypoints {
    fn visibility(&self, camera: &Camera, uv_px: Option<[f64; 2]>, depth_m: f64, image: &Plane<f32>) -> u8 {
        let Some([u, v]) = uv_px.filter(|uv| camera.intrinsics.contains(*uv)) else { return 0 };
        let surface_m = f64::from(*image.at(u as u32, v as u32));
        if surface_m > 0.0 && surface_m < depth_m - self.tolerance_m { 1 } else { 2 }
    }
}

/// The pixel at which a point of the camera frame appears, inside the image or not.
#[inline]
pub(crate) fn pixel(camera: &Camera, point: &Point3<f64>) -> Option<[f64; 2]> {
    if point.z <= 0.0 {
        return None;
    }
    let [u, v] = camera.project(point);
    if camera.distortion.is_none() {
        return Some([u, v]);
    }
    let direction = camera.unproject(u, v)?;
    let apart = (direction - point.coords / point.z).norm();
    (apart <= SAME_DIRECTION * direction.norm()).then_some([u, v])
}

/// An entry of the product `keypoints`.
#[derive(Serialize)]
struct KeypointView<'a> {
    name: &'a str,
    point_world_m: [f64; 3],
    uv_px: Option<[f64; 2]>,
    depth_m: f64,
    visibility: u8,
}

register!(Keypoints);
