//! Clearcoat and sheen over baked textures.

use super::color::mix;
use syntable_model::scene::{Clearcoat, Color, Encoding, Material, Scalar, Sheen};

/// Adds a clearcoat that follows the normal map below, or is smooth.
pub fn add_clearcoat(material: &mut Material, roughness: f64, follows: bool) {
    material.clearcoat = Some(Clearcoat {
        strength: Scalar::constant(1.0),
        roughness: Scalar::constant(roughness as f32),
        normal: if follows { material.normal.clone() } else { None },
    });
}

/// Adds sheen of a color between the surface's own and white.
pub fn add_sheen(material: &mut Material, strength: f64, whiteness: f64, roughness: f64) {
    let own = mean_color(material);
    let tint = mix(own, [1.0; 3], whiteness as f32);
    material.sheen = Some(Sheen {
        color: Color::constant(tint.map(|channel| channel * strength as f32)),
        roughness: Scalar::constant(roughness as f32),
    });
}

/// Mean of the base color, linear; of every 7th texel, which is enough for a tint.
fn mean_color(material: &Material) -> [f32; 3] {
    let Some(used) = &material.base_color.texture else { return material.base_color.factor };
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    for texel in used.texture.texels.chunks_exact(4).step_by(7) {
        let color = [texel[0], texel[1], texel[2]].map(|byte| f32::from(byte) / 255.0);
        let color = if used.texture.encoding == Encoding::Srgb { super::linear(color) } else { color };
        for (sum, channel) in sum.iter_mut().zip(color) {
            *sum += channel;
        }
        count += 1.0;
    }
    sum.map(|channel| channel / f32::max(count, 1.0))
}
