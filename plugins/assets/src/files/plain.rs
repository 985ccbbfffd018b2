//! Materials without their textures, for faces that have no texture coordinates.

use crate::files::colour::srgb_to_linear;
use syntable_model::scene::{Alpha, Color, Encoding, Material, Scalar, Texture};

/// The material with every texture replaced by its mean; none if it has no texture. Where alpha is blended, its mean
/// too; a cut-out becomes whole.
pub fn untextured(material: &Material) -> Option<Material> {
    material.textures().next()?;
    let mut plain = material.clone();
    plain.alpha = match (plain.alpha, &plain.base_color.texture) {
        (Alpha::Blend { factor }, Some(texture)) => Alpha::Blend { factor: factor * mean_of(&texture.texture, 3) },
        (Alpha::Blend { factor }, None) => Alpha::Blend { factor },
        (Alpha::Opaque | Alpha::Mask { .. }, _) => Alpha::Opaque,
    };
    even_color(&mut plain.base_color);
    even_color(&mut plain.emission);
    even(&mut plain.roughness);
    even(&mut plain.metallic);
    plain.normal = None;
    if let Some(coat) = &mut plain.clearcoat {
        even(&mut coat.strength);
        even(&mut coat.roughness);
        coat.normal = None;
    }
    if let Some(sheen) = &mut plain.sheen {
        even_color(&mut sheen.color);
        even(&mut sheen.roughness);
    }
    if let Some(transmission) = &mut plain.transmission {
        even(&mut transmission.share);
    }
    Some(plain.sealed())
}

fn even_color(color: &mut Color) {
    if let Some(texture) = color.texture.take() {
        let mean = mean(&texture.texture);
        color.factor = std::array::from_fn(|i| color.factor[i] * mean[i]);
    }
}

fn even(scalar: &mut Scalar) {
    if let Some((texture, channel)) = scalar.texture.take() {
        scalar.factor *= mean_of(&texture.texture, channel);
    }
}

/// Mean of the colour channels, linear.
pub fn mean(texture: &Texture) -> [f32; 3] {
    [0, 1, 2].map(|channel| mean_of(texture, channel))
}

/// Mean of one channel, linear; alpha always is.
fn mean_of(texture: &Texture, channel: u8) -> f32 {
    let encoded = texture.encoding == Encoding::Srgb && channel < 3;
    let decode: Vec<f64> = (0..=255_u8)
        .map(|value| f32::from(value) / 255.0)
        .map(|x| f64::from(if encoded { srgb_to_linear(x) } else { x }))
        .collect();
    let channel = usize::from(channel.min(3));
    let sum: f64 = texture.texels.chunks_exact(4).map(|texel| decode[usize::from(texel[channel])]).sum();
    (sum / (texture.texels.len() / 4) as f64) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::formats::picture::Picture;
    use std::sync::Arc;
    use syntable_model::scene::{Clearcoat, NormalMap, Sheen, Transmission, Wrap};

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

    #[test]
    fn every_layer_becomes_even() {
        let texels = vec![255, 0, 188, 255, 0, 0, 188, 0];
        let picture = Picture { width: 2, height: 1, texels, kind: String::new() };
        let texture = Arc::new(picture.into_texture(Encoding::Srgb, [Wrap::Repeat; 2]));
        let mut material = Material::plain("a", [1.0; 3], 0.5);
        material.alpha = Alpha::Blend { factor: 0.5 };
        material.base_color = Color::texture(texture.clone());
        material.clearcoat = Some(Clearcoat {
            strength: Scalar::texture(texture.clone(), 0),
            roughness: Scalar::constant(0.1),
            normal: Some(NormalMap { map: texture.clone().into(), strength: 1.0 }),
        });
        material.sheen =
            Some(Sheen { color: Color::texture(texture.clone()), roughness: Scalar::texture(texture.clone(), 3) });
        material.transmission = Some(Transmission { share: Scalar::texture(texture, 1), volume: None });
        let plain = untextured(&material).expect("had textures");
        assert_eq!(plain.textures().count(), 0);
        assert_eq!(plain.alpha, Alpha::Blend { factor: 0.25 });
        assert_eq!(plain.clearcoat.expect("kept").strength.factor, 0.5);
        let sheen = plain.sheen.expect("kept");
        assert_eq!((sheen.color.factor[0], sheen.roughness.factor), (0.5, 0.5));
        assert_eq!(plain.transmission.expect("kept").share.factor, 0.0);
    }
}
