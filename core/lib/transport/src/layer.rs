//! Evaluating materials at a hit: BSDF parameters, the selected layer, and normal maps.

use crate::bsdf::{BsdfParameters, CLEARCOAT_F0, CoatingParameters, Lobe, clearcoat_albedo, sheen_albedo, table};
use std::sync::Arc;
use syntable_prepare::{Material, MaterialLayers, MaterialTable, MipTexture, NormalInput, TextureCoordinates};
use syntable_simd::{Rgb, Vec3, max};

/// Normals of a flat normal map may be shorter than one by up to this, because they are stored in 8 bits.
const ROUNDING: f32 = 0.01;

/// The layer that a path scatters from, selected at random.
#[derive(Clone, Copy, Debug)]
pub struct LayerSample {
    /// Its scattering.
    pub lobe: Lobe,
    /// Its parameters.
    pub parameters: BsdfParameters,
    /// Weight of the layer over the probability of its selection.
    pub weight: f32,
    /// Layers above.
    pub coating: CoatingParameters,
    /// Index of refraction of the body's interior.
    pub ior: f32,
    /// Whether the clearcoat, which can have its own normal map, was selected.
    pub is_clearcoat: bool,
}

/// BSDF parameters of a material's base at a point; `tint` is the vertex color.
#[inline]
pub fn base_parameters(
    textures: &[Arc<MipTexture>],
    material: &Material,
    at: TextureCoordinates,
    tint: Rgb,
) -> BsdfParameters {
    BsdfParameters {
        base_color: material.base_color_at(textures, at, tint),
        roughness: material.roughness.at(textures, at),
        metallic: material.metallic.at(textures, at),
        dielectric_f0: material.dielectric_f0,
    }
}

/// Selects the layer that scatters a path, with `u` in [0, 1). `cosine` is the cosine between the path's direction and
/// the normal.
#[inline(always)]
pub fn sample_layer(
    table: &MaterialTable,
    material: &Material,
    at: TextureCoordinates,
    parameters: BsdfParameters,
    cosine: f32,
    u: f32,
) -> LayerSample {
    let base = LayerSample {
        lobe: Lobe::Base,
        parameters,
        weight: 1.0,
        coating: CoatingParameters::default(),
        ior: 1.0,
        is_clearcoat: false,
    };
    match table.layers(material) {
        None => base,
        Some(layers) => sample_layers(&table.textures, layers, at, base, cosine, u),
    }
}

#[inline(never)]
fn sample_layers(
    textures: &[Arc<MipTexture>],
    layers: &MaterialLayers,
    at: TextureCoordinates,
    mut sample: LayerSample,
    cosine: f32,
    mut u: f32,
) -> LayerSample {
    sample.ior = layers.ior;
    if layers.clearcoat.factor > 0.0 {
        let (strength, roughness) = (layers.clearcoat.at(textures, at), layers.clearcoat_roughness.at(textures, at));
        if strength > 0.0 {
            let probability = (strength * clearcoat_albedo(roughness, cosine, table())).clamp(0.15, 0.85);
            if u < probability {
                sample.parameters =
                    BsdfParameters { base_color: Rgb::ZERO, roughness, metallic: 0.0, dielectric_f0: CLEARCOAT_F0 };
                return LayerSample { weight: strength / probability, is_clearcoat: true, ..sample };
            }
            u = (u - probability) / (1.0 - probability);
            sample.weight = 1.0 / (1.0 - probability);
            (sample.coating.clearcoat, sample.coating.clearcoat_roughness) = (strength, roughness);
        }
    }
    if !layers.sheen_color.factor.is_black() {
        let (color, roughness) = (layers.sheen_color.at(textures, at), layers.sheen_roughness.at(textures, at));
        let strength = color.x.max(color.y).max(color.z);
        if strength > 0.0 {
            let probability = (strength * sheen_albedo(roughness, cosine)).clamp(0.15, 0.6);
            if u < probability {
                let parameters = BsdfParameters { base_color: color, roughness, metallic: 0.0, dielectric_f0: 0.0 };
                return LayerSample { lobe: Lobe::Sheen, parameters, weight: sample.weight / probability, ..sample };
            }
            u = (u - probability) / (1.0 - probability);
            sample.weight /= 1.0 - probability;
            (sample.coating.sheen, sample.coating.sheen_roughness) = (strength, roughness);
        }
    }
    if layers.transmission.factor > 0.0 {
        // Light that enters the surface is transmitted instead of scattered below it. Metals transmit no light.
        let probability = layers.transmitted_fraction(textures, at, sample.parameters.metallic);
        if u < probability {
            sample.lobe = if layers.has_volume != 0 { Lobe::Refraction } else { Lobe::ThinWalled };
        } else {
            sample.parameters.metallic = (sample.parameters.metallic / (1.0 - probability)).min(1.0);
        }
    }
    sample
}

/// The normal map of the selected layer, if it has one.
#[inline(always)]
pub fn normal_map<'a>(table: &'a MaterialTable, material: &'a Material, is_clearcoat: bool) -> Option<&'a NormalInput> {
    let input = match table.layers(material) {
        Some(layers) if is_clearcoat => &layers.clearcoat_normal,
        _ => &material.normal,
    };
    input.texture.is_some().then_some(input)
}

/// The normal of a map, given the frame of the mapping's coordinates around the unit normal `n`; and the variance per
/// axis of the slopes that are too fine for the look-up.
#[inline]
pub fn mapped_normal(
    textures: &[Arc<MipTexture>],
    map: &NormalInput,
    at: TextureCoordinates,
    (tangent, bitangent): (Vec3, Vec3),
    n: Vec3,
) -> (Vec3, f32) {
    let strength = map.strength;
    let c = map.texture.color(textures, at);
    // The more unit normals differ, the shorter their mean is (Toksvig, 2005).
    let mean = (c * 2.0 + Vec3::from([-1.0; 3])).length();
    let variance = max((1.0 - mean) / max(mean, 0.1) - ROUNDING, 0.0) * strength * strength;
    let [x, y] = [c.x, c.y].map(|c| (c * 2.0 - 1.0) * strength);
    let z = c.z * 2.0 - 1.0;
    let (along_u, along_v) = map.texture.transform.tangent_frame(tangent, bitangent);
    let along_u = (along_u - n * along_u.dot(n)).normalized_or(Vec3::ZERO);
    let along_v = (along_v - n * along_v.dot(n)).normalized_or(Vec3::ZERO);
    ((along_u * x + along_v * y + n * max(z, 0.05)).normalized_or(n), variance)
}
