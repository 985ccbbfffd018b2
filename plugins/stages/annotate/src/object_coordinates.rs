//! Normalized object coordinates.

use syntable_model::geometry::{Matrix3, Vector3};
use syntable_model::prelude::*;
use syntable_model::product::ObjectImages;
use syntable_model::product::standard::{
    AMODAL_MASK, AMODAL_OBJECT_COORDINATES, INSTANCE, OBJECT_COORDINATES, OBJECT_DEPTHS,
};
use syntable_model::scene::{Body, Camera};

/// Normalized object coordinates (NOCS, Wang et al. 2019): the position of a pixel's surface point in the object's own
/// box. The center of the box is (0.5, 0.5, 0.5), a difference of 1 is the length of its diagonal, and the axes are the
/// axes of the object frame, so that every coordinate is within [0, 1].
///
/// `object_coordinates` shows the visible surfaces, `amodal_object_coordinates` every annotated object's first surface,
/// visible or hidden. Both are zero elsewhere.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectCoordinates {}

config!(ObjectCoordinates => dyn ViewAnnotator, "object_coordinates");

impl ViewAnnotator for ObjectCoordinates {
    fn reads(&self) -> Vec<KeyId> {
        keys![INSTANCE, AMODAL_MASK, OBJECT_DEPTHS]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![OBJECT_COORDINATES, AMODAL_OBJECT_COORDINATES]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let (masks, hits) = (products.get(AMODAL_MASK)?, products.get(OBJECT_DEPTHS)?);
        let camera = &cx.view.camera;
        let (frames, rays) = (Frames::of(cx.scene, camera, masks), camera.rays());
        let amodal = ObjectImages::of_hits(masks, hits, [0.0; 3], |id| {
            let (frame, rays) = (frames.get(id).copied(), &rays);
            move |[x, y], depth| match (frame, rays.at(x, y)) {
                (Some(frame), Some((right, down))) => frame.place(Vector3::new(right, down, 1.0) * f64::from(depth)),
                _ => [0.0; 3],
            }
        });
        let seen = amodal.seen(products.get(INSTANCE)?);
        products.put(OBJECT_COORDINATES, seen)?;
        products.put(AMODAL_OBJECT_COORDINATES, amodal)
    }
}

/// The frames of the boxes of bodies, by instance id.
struct Frames(Vec<Option<BoxFrame>>);

impl Frames {
    fn of(scene: &Scene, camera: &Camera, masks: &PerInstance<Mask>) -> Self {
        let mut frames = Vec::new();
        for (id, body) in masks.iter().filter_map(|(id, _)| Some((id, scene.body(id)?))) {
            frames.resize_with(usize::from(id.0) + 1, || None);
            frames[usize::from(id.0)] = Some(BoxFrame::of(body, camera));
        }
        Self(frames)
    }

    fn get(&self, id: InstanceId) -> Option<&BoxFrame> {
        self.0.get(usize::from(id.0))?.as_ref()
    }
}

/// From the frame of a camera to the box of a body.
#[derive(Clone, Copy)]
struct BoxFrame {
    turn: Matrix3<f64>,
    start: Vector3<f64>,
}

impl BoxFrame {
    fn of(body: &Body, camera: &Camera) -> Self {
        let body_from_camera = body.world_from_body.inverse() * camera.world_from_camera;
        let bounds = body.object.mesh.bounds();
        let (center, diagonal) = (bounds.center(), bounds.size().norm());
        Self {
            turn: body_from_camera.rotation.to_rotation_matrix().into_inner() / diagonal,
            start: (body_from_camera.translation.vector - center.coords) / diagonal,
        }
    }

    /// The coordinates of a point of the camera frame.
    fn place(&self, point: Vector3<f64>) -> [f32; 3] {
        let place = self.turn * point + self.start;
        // Rounding may move the point out of the box.
        std::array::from_fn(|axis| (place[axis] + 0.5).clamp(0.0, 1.0) as f32)
    }
}

register!(ObjectCoordinates);
