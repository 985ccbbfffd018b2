//! Materials drawn from pools, and how they are laid over bodies.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use syntable_model::context::Assets;
use syntable_model::prelude::*;
use syntable_model::scene::{Material, Surface, TextureMapping};

/// How large a texture's pattern may become against its real size, either way.
const MOST_SCALE: f64 = 1000.0;

/// A material drawn from a pool, laid over a body in metres, scaled, turned and shifted at random.
pub fn drawn_surface(
    pool: &MaterialPool,
    rotation_deg: &Dist,
    scale: &Dist,
    assets: &dyn Assets,
    stream: &Stream,
) -> Result<Surface> {
    let (_, material) = assets.draw_material(pool, &mut stream.child("material"))?;
    let mut texture = stream.child("texture");
    let rotation = rotation_deg.draw(&mut texture).to_radians() as f32;
    let offset = [texture.unit() as f32, texture.unit() as f32];
    let scale = scale.draw(&mut stream.child("scale")) as f32;
    let material = match scale {
        1.0 => material,
        // Textures are shared with the original.
        _ => Arc::new(Material { tile_m: material.tile_m * scale, ..(*material).clone() }.sealed()),
    };
    Ok(Surface { material, mapping: TextureMapping::Box { rotation, offset } })
}

/// Another material for some objects, whose shape and mass stay.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OtherMaterial {
    /// Pool of materials; each object draws its own.
    from: MaterialPool,
    /// Probability that an object gets a drawn material instead of its own.
    #[serde(default = "always")]
    #[schemars(range(min = 0.0, max = 1.0))]
    probability: f64,
    /// Size of the textures against their real size.
    #[serde(default = "real_size")]
    texture_scale: Dist,
    /// Rotation of the textures, degrees.
    #[serde(default = "any_angle_deg")]
    texture_rotation_deg: Dist,
}

impl OtherMaterial {
    /// Refuses numbers that mean nothing.
    pub fn check(&self) -> Result<(), Invalid> {
        check_probability("material.probability", self.probability)?;
        check_scale("material.texture_scale", &self.texture_scale)
    }

    /// The surface of an object, if it gets another one.
    pub fn draw(&self, assets: &dyn Assets, stream: &Stream) -> Result<Option<Surface>> {
        if !stream.child("replace").chance(self.probability) {
            return Ok(None);
        }
        drawn_surface(&self.from, &self.texture_rotation_deg, &self.texture_scale, assets, stream).map(Some)
    }
}

/// Refuses what is no probability.
pub fn check_probability(key: &str, probability: f64) -> Result<(), Invalid> {
    if (0.0..=1.0).contains(&probability) {
        return Ok(());
    }
    Err(Invalid::new(key, format!("`{key} = {probability}` is outside 0 to 1")))
}

/// Refuses scales of textures that leave no picture.
pub fn check_scale(key: &str, scale: &Dist) -> Result<(), Invalid> {
    scale.within(key, 1.0 / MOST_SCALE, MOST_SCALE)
}

/// One.
pub fn always() -> f64 {
    1.0
}

/// Any angle.
pub fn any_angle_deg() -> Dist {
    Dist::Uniform(0.0, 360.0)
}

/// Textures as large as they are.
pub fn real_size() -> Dist {
    Dist::Constant(1.0)
}
