//! Materials drawn from pools, and their texture mapping.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use syntable_model::context::Assets;
use syntable_model::prelude::*;
use syntable_model::scene::{Material, MaterialOverride, TextureMapping};

/// Limits of the scale of textures relative to their real size.
pub const TEXTURE_SCALE: [f64; 2] = [1e-3, 1e3];

/// Draws a material from pools and its texture mapping: box projection in meters with random rotation, scale and
/// offset.
pub fn draw_material(
    pools: &MaterialPools,
    rotation_deg: &Dist,
    scale: &Dist,
    assets: &dyn Assets,
    stream: &Stream,
) -> Result<MaterialOverride> {
    let (_, material) = assets.draw_material(pools, &mut stream.child("material"))?;
    let mut texture = stream.child("texture");
    let rotation = rotation_deg.draw(&mut texture).to_radians() as f32;
    let offset = [texture.unit() as f32, texture.unit() as f32];
    let scale = scale.draw(&mut stream.child("scale")) as f32;
    let material = match scale {
        1.0 => material,
        // The images are shared with the original.
        _ => Arc::new(Material { tile_m: material.tile_m * scale, ..(*material).clone() }.with_digest()),
    };
    Ok(MaterialOverride { material, mapping: TextureMapping::Box { rotation, offset } })
}

/// Replaces the material of some objects. Shape and mass stay.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MaterialReplacement {
    /// Pools of materials. Each object draws its own.
    from: MaterialPools,
    /// Probability that an object gets a drawn material instead of its own.
    #[serde(default = "always")]
    #[schemars(range(min = 0.0, max = 1.0))]
    probability: f64,
    /// Scale of the textures relative to their real size, 0.001 to 1000.
    #[serde(default = "real_size")]
    #[schemars(extend("minimum" = TEXTURE_SCALE[0], "maximum" = TEXTURE_SCALE[1]))]
    texture_scale: Dist,
    /// Rotation of the textures on the object, degrees.
    #[serde(default = "any_angle_deg")]
    texture_rotation_deg: Dist,
}

impl MaterialReplacement {
    /// Checks the texture scale.
    pub fn check(&self) -> Result<(), ConfigError> {
        check_scale("material.texture_scale", &self.texture_scale)
    }

    /// Draws the material of an object; `None` if it keeps its own.
    pub fn draw(&self, assets: &dyn Assets, stream: &Stream) -> Result<Option<MaterialOverride>> {
        if !stream.child("replace").chance(self.probability) {
            return Ok(None);
        }
        draw_material(&self.from, &self.texture_rotation_deg, &self.texture_scale, assets, stream).map(Some)
    }
}

/// Refuses texture scales outside their limits.
pub fn check_scale(key: &str, scale: &Dist) -> Result<(), ConfigError> {
    scale.within(key, TEXTURE_SCALE[0], TEXTURE_SCALE[1])
}

/// The default of probabilities.
pub fn always() -> f64 {
    1.0
}

/// The default of texture rotations, degrees.
pub fn any_angle_deg() -> Dist {
    Dist::Uniform(0.0, 360.0)
}

/// The default of texture scales.
pub fn real_size() -> Dist {
    Dist::Constant(1.0)
}
