//! Materials without their textures, for faces that have no texture coordinates.

use crate::files::colour::srgb_to_linear;
use syntable_model::scene::{Alpha, Encoding, Material, Texture};

/// The material with every texture replaced by its mean; none if it has no texture.
pub fn untextured(material: &Material) -> Option<Material> {
    let has = material.base_color.texture.is_some()
        || material.roughness.texture.is_some()
        || material.metallic.texture.is_some()
        || material.emission.texture.is_some()
        || material.normal.is_some();
    if !has {
        return None;
    }
    let mut plain = material.clone();
    for color in [&mut plain.base_color, &mut plain.emission] {
        if let Some(texture) = color.texture.take() {
            let mean = mean(&texture.texture);
            color.factor = std::array::from_fn(|i| color.factor[i] * mean[i]);
        }
    }
    for scalar in [&mut plain.roughness, &mut plain.metallic] {
        if let Some((texture, channel)) = scalar.texture.take() {
            scalar.factor *= mean(&texture.texture)[usize::from(channel.min(2))];
        }
    }
    plain.normal = None;
    plain.alpha = Alpha::Opaque;
    Some(plain.sealed())
}

/// Mean of the colour channels, linear.
pub fn mean(texture: &Texture) -> [f32; 3] {
    let decode: Vec<f64> = (0..=255_u8)
        .map(|value| f32::from(value) / 255.0)
        .map(|x| f64::from(if texture.encoding == Encoding::Srgb { srgb_to_linear(x) } else { x }))
        .collect();
    let mut sums = [0.0; 3];
    for texel in texture.texels.chunks_exact(4) {
        for (sum, &value) in sums.iter_mut().zip(texel) {
            *sum += decode[usize::from(value)];
        }
    }
    sums.map(|sum| (sum / (texture.texels.len() / 4) as f64) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::formats::picture::Picture;
    use std::sync::Arc;
    use syntable_model::scene::{Color, Wrap};

    #[test]
    fn the_mean_is_linear() {
        assert!(untextured(&Material::plain("a", [1.0; 3], 0.5)).is_none());
        let texels = vec![255, 0, 188, 255, 0, 0, 188, 255];
        let picture = Picture { width: 2, height: 1, texels, kind: String::new() };
        let mut material = Material::plain("a", [0.5, 1.0, 1.0], 0.5);
        let texture = picture.into_texture(Encoding::Srgb, [Wrap::Repeat; 2]);
        material.base_color.texture = Color::texture(Arc::new(texture)).texture;
        let [r, g, b] = untextured(&material).expect("had a texture").base_color.factor;
        assert!((r - 0.25).abs() < 1e-6 && g == 0.0 && (b - 0.503).abs() < 1e-3, "{r} {g} {b}");
    }
}
