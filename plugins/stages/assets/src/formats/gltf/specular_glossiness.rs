//! `KHR_materials_pbrSpecularGlossiness`: materials by diffuse color, specular color and glossiness, as
//! metallic-roughness.
//!
//! Let D be the diffuse color times 1 minus the largest channel of the specular color S, b the base color, and m the
//! metalness. Both models reflect the same if `D = 0.96 b (1 - m)` and `S = 0.04 (1 - m) + b m`. Eliminating b gives
//! `0.04 m² + (D / 0.96 + S - 0.08) m + 0.04 - S = 0`, where perceived brightness represents D and S. m is the larger
//! root, and 0 if S is below 0.04, less than any dielectric reflects. The two equations give two base colors; the one
//! from S has the weight m². Roughness is 1 minus glossiness.
//!
//! Textures are converted texel by texel, including factors, at the larger of their widths and of their heights, with
//! the nearest texel of the smaller one.

use gltf::json::texture::Info;
use serde::Deserialize;
use syntable_mesh::image::{DecodedImage, MAX_SIDE};
use syntable_mesh::limits::Budget;
use syntable_model::color::srgb_to_linear;
use syntable_model::error::Result;
use syntable_model::scene::Texture;

/// Reflectance of dielectrics at normal incidence.
const DIELECTRIC: f64 = 0.04;

/// `KHR_materials_pbrSpecularGlossiness`
#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct SpecularGlossinessJson {
    pub diffuse_factor: [f32; 4],
    pub diffuse_texture: Option<Info>,
    pub specular_factor: [f32; 3],
    pub glossiness_factor: f32,
    pub specular_glossiness_texture: Option<Info>,
}

impl Default for SpecularGlossinessJson {
    fn default() -> Self {
        Self {
            diffuse_factor: [1.0; 4],
            diffuse_texture: None,
            specular_factor: [1.0; 3],
            glossiness_factor: 1.0,
            specular_glossiness_texture: None,
        }
    }
}

/// Base color, linear, and metalness of linear diffuse and specular colors in [0, 1].
pub fn convert(diffuse: [f64; 3], specular: [f64; 3]) -> ([f64; 3], f64) {
    let rest = 1.0 - specular.into_iter().fold(0.0, f64::max);
    let metallic = metalness(brightness(diffuse) * rest, brightness(specular));
    let base = std::array::from_fn(|i| {
        let of_diffuse = diffuse[i] * rest / ((1.0 - DIELECTRIC) * (1.0 - metallic).max(1e-6));
        let of_specular = (specular[i] - DIELECTRIC * (1.0 - metallic)) / metallic.max(1e-6);
        let weight = metallic * metallic;
        (of_diffuse * (1.0 - weight) + of_specular * weight).clamp(0.0, 1.0)
    });
    (base, metallic)
}

/// Metalness of a diffuse and a specular reflectance.
fn metalness(diffuse: f64, specular: f64) -> f64 {
    if specular < DIELECTRIC {
        return 0.0;
    }
    let half = 0.5 * (diffuse / (1.0 - DIELECTRIC) + specular) - DIELECTRIC;
    let root = (half * half + DIELECTRIC * (specular - DIELECTRIC)).sqrt();
    ((root - half) / DIELECTRIC).clamp(0.0, 1.0)
}

/// Perceived brightness of a linear color.
fn brightness([r, g, b]: [f64; 3]) -> f64 {
    (0.299 * r * r + 0.587 * g * g + 0.114 * b * b).sqrt()
}

/// Factors of the textures, in [0, 1].
#[derive(Clone, Copy)]
pub struct Factors {
    pub diffuse: [f32; 3],
    pub specular: [f32; 3],
    pub glossiness: f32,
}

impl Factors {
    /// The images of the base color, sRGB-encoded with the alpha of the diffuse texture, and of roughness (green) and
    /// metalness (blue). The textures are sRGB-encoded; glossiness is the alpha of the second.
    pub fn apply(
        &self,
        diffuse: Option<&Texture>,
        gloss: Option<&Texture>,
        budget: &Budget,
    ) -> Result<[DecodedImage; 2]> {
        let size = |side: fn(&Texture) -> u32| diffuse.map_or(1, side).max(gloss.map_or(1, side));
        let (width, height) = (size(|texture| texture.width), size(|texture| texture.height));
        let bytes = width as usize * height as usize * 4;
        for _ in 0..2 {
            budget.image(width.into(), height.into(), MAX_SIDE)?;
        }
        let (mut base, mut rest) = (Vec::with_capacity(bytes), Vec::with_capacity(bytes));
        let decode: Vec<f64> = (0..256).map(|code| srgb_to_linear(f64::from(code) / 255.0)).collect();
        // Limits between the codes of linear values.
        let limits: Vec<f64> = (0..255).map(|code| srgb_to_linear((f64::from(code) + 0.5) / 255.0)).collect();
        let encode = |x: f64| limits.partition_point(|&limit| limit <= x) as u8;
        let texel = |texture: Option<&Texture>, x: u32, y: u32| {
            texture.map_or([255; 4], |texture| {
                let nearest = |at: u32, size: u32, of: u32| (u64::from(at) * u64::from(of) / u64::from(size)) as usize;
                let row = nearest(y, height, texture.height) * texture.width as usize;
                let at = 4 * (row + nearest(x, width, texture.width));
                std::array::from_fn(|i| texture.texels[at + i])
            })
        };
        let linear = |texel: [u8; 4], factor: [f32; 3]| {
            std::array::from_fn(|i| decode[usize::from(texel[i])] * f64::from(factor[i]))
        };
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let (color, gloss) = (texel(diffuse, x, y), texel(gloss, x, y));
            let ([r, g, b], metallic) = convert(linear(color, self.diffuse), linear(gloss, self.specular));
            let roughness = 1.0 - f64::from(self.glossiness) * f64::from(gloss[3]) / 255.0;
            base.extend([encode(r), encode(g), encode(b), color[3]]);
            rest.extend([0, (roughness * 255.0).round() as u8, (metallic * 255.0).round() as u8, 255]);
        }
        Ok([base, rest].map(|texels| DecodedImage { width, height, texels, kind: String::new() }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grays_that_were_converted_come_back() {
        for base in [0.05, 0.3, 0.8, 1.0] {
            for metallic in [0.0, 0.1, 0.5, 0.9, 1.0] {
                let specular = 0.04 * (1.0 - metallic) + base * metallic;
                let diffuse = 0.96 * base * (1.0 - metallic) / (1.0_f64 - specular).max(1e-9);
                // A diffuse color above white has no such material.
                if diffuse > 1.0 {
                    continue;
                }
                let (got, m) = convert([diffuse; 3], [specular; 3]);
                let is_near = (m - metallic).abs() < 1e-6 && got.iter().all(|x| (x - base).abs() < 1e-6);
                assert!(is_near, "base {base}, metalness {metallic}: {got:?}, {m}");
            }
        }
    }

    #[test]
    fn metalness_satisfies_both_models() {
        // By bisection: the reflectance at normal incidence of a base color with this diffuse part grows with
        // metalness.
        for (diffuse, specular) in [([0.5, 0.1, 0.2], [0.2, 0.25, 0.1]), ([0.02, 0.3, 0.9], [0.06, 0.05, 0.07])] {
            let rest = 1.0 - specular.into_iter().fold(0.0, f64::max);
            let (d, s) = (rest * brightness(diffuse), brightness(specular));
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..60 {
                let m: f64 = 0.5 * (low + high);
                let reflected = 0.04 * (1.0 - m) + m * d / (0.96 * (1.0 - m));
                (low, high) = if reflected < s { (m, high) } else { (low, m) };
            }
            let (_, metallic) = convert(diffuse, specular);
            assert!((metallic - low).abs() < 1e-9 && low > 0.01 && low < 0.9, "{metallic}, not {low}");
        }
        // Less than a dielectric reflects, and a mirror without diffuse light.
        assert_eq!(convert([0.48; 3], [0.0; 3]), ([0.5; 3], 0.0));
        let (gold, metallic) = convert([0.0; 3], [1.0, 0.77, 0.34]);
        let is_gold = gold.iter().zip([1.0, 0.77, 0.34]).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(is_gold && (metallic - 1.0).abs() < 1e-12, "{gold:?}, {metallic}");
    }
}
