//! Boxes in space.

use crate::matrix::pose;
use syntable_model::geometry::Point3;
use syntable_model::prelude::*;
use syntable_model::product::standard::{AMODAL_MASK, CUBOID};
use syntable_model::scene::{Body, Camera};

/// 3D box of every annotated object: the smallest box around its mesh that is parallel to the axes of the object frame,
/// called cuboid in DOPE and BOP.
///
/// `size_m` has the edge lengths along these axes. `camera_from_cuboid` and `world_from_cuboid` are the poses of the
/// box's center as 4 × 4 matrices, row by row, with the axes of the object; the camera frame follows OpenCV: x right, y
/// down, z forward. The eight corners are in meters, `corners_world_m` and `corners_camera_m`, and as (u, v) in pixels,
/// `corners_px`, with pixel centers at half-integers and with lens distortion. Corners may be outside the image. A
/// corner at or behind the plane of the camera has no pixel (`null`). In a corner's number, from 0, bit 0 is set at the
/// upper end of the x axis, bit 1 at the upper end of y, bit 2 at the upper end of z.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Cuboids {}

config!(Cuboids => dyn ViewAnnotator, "cuboids");

impl ViewAnnotator for Cuboids {
    fn reads(&self) -> Vec<KeyId> {
        keys![AMODAL_MASK]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![CUBOID]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let (camera, annotated) = (&cx.view.camera, products.get(AMODAL_MASK)?);
        let objects = cx.scene.objects().iter().filter(|body| annotated.get(body.id).is_some());
        let cuboids = objects.map(|body| Ok((body.id, Value::of(&CuboidView::new(body, camera))?)));
        let cuboids = cuboids.collect::<Result<_>>()?;
        products.put(CUBOID, cuboids)
    }
}

/// An entry of the product `cuboid`.
#[derive(Serialize)]
struct CuboidView {
    size_m: [f64; 3],
    world_from_cuboid: [[f64; 4]; 4],
    camera_from_cuboid: [[f64; 4]; 4],
    corners_world_m: [[f64; 3]; 8],
    corners_camera_m: [[f64; 3]; 8],
    corners_px: [Option<[f64; 2]>; 8],
}

impl CuboidView {
    fn new(body: &Body, camera: &Camera) -> Self {
        let bounds = body.object.mesh.bounds();
        let center = bounds.center();
        let world_from_cuboid = body.world_from_body * Pose::translation(center.x, center.y, center.z);
        let camera_from_world = camera.world_from_camera.inverse();
        let in_world = bounds.corners().map(|corner| body.world_from_body * corner);
        let in_camera = in_world.map(|corner| camera_from_world * corner);
        let pixel = |corner: Point3<f64>| (corner.z > 0.0).then(|| camera.project(&corner));
        Self {
            size_m: bounds.size().into(),
            world_from_cuboid: pose(&world_from_cuboid),
            camera_from_cuboid: pose(&(camera_from_world * world_from_cuboid)),
            corners_world_m: in_world.map(Into::into),
            corners_camera_m: in_camera.map(Into::into),
            corners_px: in_camera.map(pixel),
        }
    }
}

register!(Cuboids);
