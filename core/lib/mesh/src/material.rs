//! Default materials and replacements for readers.

use crate::image::DecodedImage;
use std::sync::Arc;
use syntable_model::color::srgb_to_linear;
use syntable_model::scene::{Alpha, Color, Encoding, Material, Scalar, Texture};

/// The matt material of surfaces without a material: light gray, or white for meshes with vertex colors.
pub fn default_material(vertex_colors: bool) -> Material {
    Material::plain("default", if vertex_colors { [1.0; 3] } else { [0.6; 3] }, 0.5)
}

/// The material with every texture replaced by its mean; `None` if it has no texture. Blended alpha becomes its mean,
/// and masked alpha becomes opaque. For faces without texture coordinates.
pub fn untextured(material: &Material) -> Option<Material> {
    material.textures().next()?;
    let mut flat = material.clone();
    flat.alpha = match (flat.alpha, &flat.base_color.texture) {
        (Alpha::Blend { factor }, Some(texture)) => Alpha::Blend { factor: factor * mean_of(&texture.texture, 3) },
        (Alpha::Blend { factor }, None) => Alpha::Blend { factor },
        (Alpha::Opaque | Alpha::Mask { .. }, _) => Alpha::Opaque,
    };
    flatten_color(&mut flat.base_color);
    flatten_color(&mut flat.emission);
    flatten(&mut flat.roughness);
    flatten(&mut flat.metallic);
    flat.normal = None;
    if let Some(coat) = &mut flat.clearcoat {
        flatten(&mut coat.strength);
        flatten(&mut coat.roughness);
        coat.normal = None;
    }
    if let Some(sheen) = &mut flat.sheen {
        flatten_color(&mut sheen.color);
        flatten(&mut sheen.roughness);
    }
    if let Some(transmission) = &mut flat.transmission {
        flatten(&mut transmission.fraction);
    }
    Some(flat.with_digest())
}

/// The texture of a blended material with its alpha scaled up to one, and its largest alpha before. A texture that is
/// nowhere half opaque states the transparency of the material, not a shape, so its alpha belongs into the factor.
/// `None` if a texel is half opaque, or all are clear.
pub fn full_alpha(texture: &Texture) -> Option<(Texture, f32)> {
    let largest = texture.texels.chunks_exact(4).map(|texel| texel[3]).max().filter(|&largest| largest > 0)?;
    if largest >= 128 {
        return None;
    }
    let mut texels = texture.texels.clone();
    for texel in texels.chunks_exact_mut(4) {
        texel[3] = ((u32::from(texel[3]) * 255 + u32::from(largest) / 2) / u32::from(largest)) as u8;
    }
    let image = DecodedImage { width: texture.width, height: texture.height, texels, kind: String::new() };
    Some((image.into_texture(texture.encoding, texture.wrap), f32::from(largest) / 255.0))
}

/// Blends a material by a factor times the alpha of its texture.
pub fn blend(material: &mut Material, factor: f32) {
    material.alpha = Alpha::Blend { factor };
    if let Some(used) = &mut material.base_color.texture
        && let Some((full, largest)) = full_alpha(&used.texture)
    {
        used.texture = Arc::new(full);
        material.alpha = Alpha::Blend { factor: factor * largest };
    }
}

fn flatten_color(color: &mut Color) {
    if let Some(texture) = color.texture.take() {
        let mean = mean(&texture.texture);
        color.factor = std::array::from_fn(|i| color.factor[i] * mean[i]);
    }
}

fn flatten(scalar: &mut Scalar) {
    if let Some((texture, channel)) = scalar.texture.take() {
        scalar.factor *= mean_of(&texture.texture, channel);
    }
}

/// Mean of the color channels, decoded to linear.
pub fn mean(texture: &Texture) -> [f32; 3] {
    [0, 1, 2].map(|channel| mean_of(texture, channel))
}

/// Mean of one channel, linear. Alpha is always linear.
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
    use syntable_model::scene::{Clearcoat, NormalMap, Sheen, Transmission, Wrap};

    #[test]
    fn the_mean_is_linear() {
        assert!(untextured(&Material::plain("a", [1.0; 3], 0.5)).is_none());
        let texels = vec![255, 0, 188, 255, 0, 0, 188, 255];
        let image = DecodedImage { width: 2, height: 1, texels, kind: String::new() };
        let mut material = Material::plain("a", [0.5, 1.0, 1.0], 0.5);
        let texture = image.into_texture(Encoding::Srgb, [Wrap::Repeat; 2]);
        material.base_color.texture = Color::texture(Arc::new(texture)).texture;
        let [r, g, b] = untextured(&material).expect("had a texture").base_color.factor;
        assert!((r - 0.25).abs() < 1e-6 && g == 0.0 && (b - 0.503).abs() < 1e-3, "{r} {g} {b}");
    }

    #[test]
    fn alpha_that_is_nowhere_half_belongs_into_the_factor() {
        let with = |alphas: [u8; 2]| {
            let texels = alphas.map(|alpha| [200, 100, 50, alpha]).concat();
            let image = DecodedImage { width: 2, height: 1, texels, kind: String::new() };
            let mut material = Material::plain("glass", [1.0; 3], 0.5);
            material.base_color = Color::texture(Arc::new(image.into_texture(Encoding::Srgb, [Wrap::Repeat; 2])));
            blend(&mut material, 0.5);
            let Alpha::Blend { factor } = material.alpha else { panic!("{:?}", material.alpha) };
            let texels = material.base_color.texture.expect("kept").texture.texels.clone();
            assert_eq!(texels[..3], [200, 100, 50]);
            ([texels[3], texels[7]], factor)
        };
        assert_eq!(with([10, 200]), ([10, 200], 0.5));
        let (texels, factor) = with([51, 102]);
        assert_eq!(texels, [128, 255]);
        // The product is unchanged.
        for (texel, was) in texels.into_iter().zip([51.0, 102.0]) {
            assert!((f64::from(texel) / 255.0 * f64::from(factor) - was / 255.0 * 0.5).abs() < 1e-3);
        }
        assert_eq!(with([0, 0]), ([0, 0], 0.5));
    }

    #[test]
    fn every_layer_is_flattened() {
        let texels = vec![255, 0, 188, 255, 0, 0, 188, 0];
        let image = DecodedImage { width: 2, height: 1, texels, kind: String::new() };
        let texture = Arc::new(image.into_texture(Encoding::Srgb, [Wrap::Repeat; 2]));
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
        material.transmission = Some(Transmission { fraction: Scalar::texture(texture, 1), volume: None });
        let flat = untextured(&material).expect("had textures");
        assert_eq!(flat.textures().count(), 0);
        assert_eq!(flat.alpha, Alpha::Blend { factor: 0.25 });
        assert_eq!(flat.clearcoat.expect("kept").strength.factor, 0.5);
        let sheen = flat.sheen.expect("kept");
        assert_eq!((sheen.color.factor[0], sheen.roughness.factor), (0.5, 0.5));
        assert_eq!(flat.transmission.expect("kept").fraction.factor, 0.0);
    }
}
