//! Objects without their occluders.

use crate::rgb_camera::{Developer, Development};
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    AMODAL_MASK, APPEARANCE, APPEARANCE_BOX, COVERAGE, EXPOSURE, OPACITY, RADIANCE,
};
use syntable_model::product::{BBox, Lighting, ObjectImage, ObjectImages};

/// Appearance of every annotated object without its occluders: color and opacity, for amodal completion, de-occlusion
/// and compositing.
///
/// # Behavior
///
/// All objects of a view are rendered at once, each in its own window, with the samples, denoiser, exposure, white
/// balance and tone curve of the image. With `in_scene`, unoccluded parts of an object have the same colors as in the
/// image, apart from the denoiser's errors. Effects of lens and image sensor that are random or involve neighboring
/// pixels are omitted: vignetting, color fringes, blur, noise and JPEG.
///
/// Opacity is the fraction of a pixel that the object covers, so edges are soft. A threshold of one half gives the
/// amodal mask, apart from pixels at edges. Colors are not premultiplied. Reflections in mirrors and light through
/// glass belong to the object with the mirror or glass, at full opacity.
///
/// A window is two pixels larger than the object's amodal mask on every side, and ends at the edges of the image. If a
/// lens with an aperture blurs the object further, the window cuts the blur off.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Appearance {
    /// Light on the objects: with `in_scene` (the default) the others still cast shadows and reflect light; with
    /// `alone`, the lights of the view illuminate the object, and no other body exists.
    pub lighting: Lighting,
}

impl Default for Appearance {
    fn default() -> Self {
        Self { lighting: Lighting::InScene }
    }
}

config!(Appearance => dyn ViewAnnotator, "appearance", "lighting = \"in_scene\"");

impl ViewAnnotator for Appearance {
    fn reads(&self) -> Vec<KeyId> {
        let (radiance, opacity) = (RADIANCE.of_objects(self.lighting), OPACITY.of_objects(self.lighting));
        keys![radiance, opacity, COVERAGE, AMODAL_MASK, EXPOSURE]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![APPEARANCE, APPEARANCE_BOX]
    }

    fn annotate(&self, _: &ViewContext, products: &mut Products) -> Result<()> {
        let (coverage, annotated) = (products.get(COVERAGE)?, products.get(AMODAL_MASK)?);
        let atlas = Atlas::of(coverage);
        let radiance = products.get(RADIANCE.of_objects(self.lighting))?;
        let opacity = products.get(OPACITY.of_objects(self.lighting))?;
        let developer = Development::recorded(products.get(EXPOSURE)?)?.developer();
        let mut images = ObjectImages::new(coverage.width(), coverage.height());
        let mut boxes = PerInstance::default();
        for (id, _) in annotated.iter() {
            let image = match atlas.tile(id) {
                Some(tile) => {
                    let (radiance, opacity) = (Atlas::cut(radiance, tile), Atlas::cut(opacity, tile));
                    let pixels = developed(&developer, &radiance, &opacity);
                    ObjectImage { x: tile.window.x as u32, y: tile.window.y as u32, pixels }
                }
                None => ObjectImage { x: 0, y: 0, pixels: Plane::from_vec(0, 0, Vec::new()) },
            };
            boxes.0.insert(id, box_of(&image));
            images.insert(id, image);
        }
        products.put(APPEARANCE, images)?;
        products.put(APPEARANCE_BOX, boxes)
    }
}

/// Colors and opacity of an object, from its premultiplied radiance.
fn developed(developer: &Developer, radiance: &Plane<[f32; 3]>, opacity: &Plane<f32>) -> Plane<[u8; 4]> {
    let pixels = radiance.data().iter().zip(opacity.data()).map(|(nits, &opacity)| {
        let alpha = (255.0 * opacity + 0.5) as u8;
        if alpha == 0 {
            return [0; 4];
        }
        let [r, g, b] = developer.code(nits.map(|nits| nits / opacity));
        [r, g, b, alpha]
    });
    Plane::from_vec(radiance.width(), radiance.height(), pixels.collect())
}

/// The box of the pixels that are not transparent, in the view.
fn box_of(image: &ObjectImage<[u8; 4]>) -> BBox {
    let seen = |x: u32, y: u32| image.pixels.at(x, y)[3] > 0;
    let (columns, rows) = (0..image.pixels.width(), 0..image.pixels.height());
    let shown: Vec<u32> = columns.clone().filter(|&x| rows.clone().any(|y| seen(x, y))).collect();
    let lines: Vec<u32> = rows.filter(|&y| columns.clone().any(|x| seen(x, y))).collect();
    match (shown.first(), shown.last(), lines.first(), lines.last()) {
        (Some(left), Some(right), Some(top), Some(bottom)) => {
            let [x, y] = [image.x + left, image.y + top].map(|edge| edge as i32);
            BBox { x, y, width: (right + 1 - left) as i32, height: (bottom + 1 - top) as i32 }
        }
        _ => BBox::default(),
    }
}

register!(Appearance);
