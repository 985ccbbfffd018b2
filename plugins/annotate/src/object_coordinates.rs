//! Normalized object coordinates.

use syntable_model::prelude::*;
use syntable_model::product::standard::{
    AMODAL_MASK, AMODAL_OBJECT_COORDINATES, OBJECT_COORDINATES, OBJECT_DEPTHS, VISIBLE_MASK,
};
use syntable_model::product::{ObjectImage, ObjectImages};
use syntable_model::scene::{Body, Camera};

/// Normalized object coordinates (NOCS, Wang et al. 2019): where on the object a pixel is, in the object's own box. The
/// center of the box is (0.5, 0.5, 0.5), a difference of 1 is the length of its diagonal, and the axes are those of the
/// object frame, so that every coordinate of a point is within [0, 1].
///
/// `object_coordinates` is of what the image shows, `amodal_object_coordinates` of every annotated object's first surface,
/// hidden or not. Both are zero where there is none.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectCoordinates {}

impl Config for ObjectCoordinates {
    type Stage = dyn Annotator;
    const KIND: &'static str = "object_coordinates";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn Annotator>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl Annotator for ObjectCoordinates {
    fn reads(&self) -> Vec<KeyId> {
        keys![VISIBLE_MASK, AMODAL_MASK, OBJECT_DEPTHS]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![OBJECT_COORDINATES, AMODAL_OBJECT_COORDINATES]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let (visible, depths) = (products.get(VISIBLE_MASK)?, products.get(OBJECT_DEPTHS)?);
        let [width, height] = [depths.width(), depths.height()];
        let mut seen = Plane::from_vec(width, height, vec![[0.0; 3]; width as usize * height as usize]);
        let mut amodal = ObjectImages::new(width, height);
        for (id, mask) in products.get(AMODAL_MASK)?.iter() {
            let Some(body) = cx.scene.body(id) else { continue };
            let place = on_body(body, &cx.view.camera);
            let image = ObjectImage::of_mask(mask, [0.0; 3], |pixel| Some(place(pixel, depths.of(id, pixel)?)));
            for pixel in visible.get(id).into_iter().flat_map(Mask::pixels) {
                if let Some(place) = image.at(pixel as u32 % width, pixel as u32 / width) {
                    seen.data_mut()[pixel] = *place;
                }
            }
            amodal.insert(id, image);
        }
        products.put(OBJECT_COORDINATES, seen)?;
        products.put(AMODAL_OBJECT_COORDINATES, amodal)
    }
}

/// Where on a body its depth puts a pixel, by the pixel's index; zero beyond what the lens shows.
fn on_body(body: &Body, camera: &Camera) -> impl Fn(usize, f32) -> [f32; 3] {
    let body_from_camera = body.world_from_body.inverse() * camera.world_from_camera;
    let bounds = body.object.mesh.bounds();
    let (center, diagonal) = (bounds.center(), bounds.size().norm());
    let turn = body_from_camera.rotation.to_rotation_matrix().into_inner() / diagonal;
    let start = (body_from_camera.translation.vector - center.coords) / diagonal;
    let width = camera.intrinsics.width as usize;
    move |pixel, depth| {
        let [u, v] = [pixel % width, pixel / width].map(|edge| edge as f64 + 0.5);
        let Some(ray) = camera.unproject(u, v) else { return [0.0; 3] };
        let place = turn * ray * f64::from(depth) + start;
        // Rounding may lead out of the box.
        std::array::from_fn(|axis| (place[axis] + 0.5).clamp(0.0, 1.0) as f32)
    }
}

register!(ObjectCoordinates);
