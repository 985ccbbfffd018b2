//! Materials. The material model of SynTable matches glTF's, so most values are copied.
//!
//! glTF stores roughness and metalness in the green and blue channels of one texture, clearcoat in red and green, and
//! so on; textures with other channels are repacked. Roughness and metalness also share one texture transform: if their
//! transforms differ, the metalness texture is replaced by its mean.

use super::document::{
    EmissiveStrength, GltfClearcoat, GltfMaterial, GltfSheen, GltfTransmission, GltfVolume, Index, Ior,
    MaterialExtensions, Pbr, TextureInfo,
};
use super::glb::Glb;
use super::recolor::is_in_vertex_colors;
use super::texture::{TextureChannel, Textures, mean};
use std::collections::BTreeMap;
use syntable_model::digest::Digest;
use syntable_model::error::Result;
use syntable_model::scene::{Alpha, Color, Encoding, Material, NormalMap, Scalar};

/// Thickness of a body with an interior medium, m, for viewers that do not trace rays. Path tracers use the actual
/// geometry.
const THICKNESS_M: f32 = 0.01;

/// All materials of a file.
#[derive(Debug, Clone, Default)]
pub struct GltfMaterials {
    known: BTreeMap<Digest, Index>,
    textures: Textures,
}

impl GltfMaterials {
    /// The index of a material, written on first use.
    pub fn get(&mut self, glb: &mut Glb, material: &Material) -> Result<Index> {
        if let Some(&index) = self.known.get(&material.digest) {
            return Ok(index);
        }
        let json = self.translate(glb, material)?;
        glb.document.extensions_used.extend(json.extensions.names());
        glb.document.materials.push(json);
        let index = glb.document.materials.len() - 1;
        self.known.insert(material.digest, index);
        Ok(index)
    }

    fn translate(&mut self, glb: &mut Glb, material: &Material) -> Result<GltfMaterial> {
        let ([r, g, b], base_color_texture) = self.base_color(glb, material)?;
        let (alpha_mode, alpha_cutoff, alpha) = match material.alpha {
            // Without a texture, the mask is opaque everywhere.
            Alpha::Mask { cutoff } if material.base_color.texture.is_some() => (Some("MASK"), Some(unit(cutoff)), 1.0),
            Alpha::Blend { factor } => (Some("BLEND"), None, unit(factor)),
            _ => (None, None, 1.0),
        };
        let (rough, mut metal) = (channel(&material.roughness), channel(&material.metallic));
        let mut metallic_factor = unit(material.metallic.factor);
        if let (Some((rough, _)), Some(used)) = (rough, metal)
            && rough.transform != used.0.transform
        {
            metallic_factor *= mean(used);
            metal = None;
        }
        let mut emission = material.emission.factor.map(|x| if x > 0.0 && x.is_finite() { x } else { 0.0 });
        let brightest = emission.into_iter().fold(0.0, f32::max);
        let emissive = brightest > 0.0;
        let mut extensions = MaterialExtensions::default();
        if brightest > 1.0 {
            emission = emission.map(|x| x / brightest);
            extensions.emissive_strength = Some(EmissiveStrength { emissive_strength: brightest });
        }
        if material.ior != 1.5 && material.ior.is_finite() && material.ior >= 1.0 {
            extensions.ior = Some(Ior { ior: material.ior });
        }
        self.layers(glb, material, &mut extensions)?;
        Ok(GltfMaterial {
            name: material.name.clone(),
            pbr_metallic_roughness: Pbr {
                base_color_factor: [r, g, b, alpha],
                base_color_texture,
                metallic_factor,
                roughness_factor: unit(material.roughness.factor),
                metallic_roughness_texture: self.textures.packed(glb, [None, rough, metal, None])?,
            },
            normal_texture: self.normal(glb, &material.normal)?,
            emissive_texture: if emissive { self.color(glb, &material.emission)? } else { None },
            emissive_factor: emissive.then_some(emission),
            alpha_mode,
            alpha_cutoff,
            // The surface of a medium is closed and refracts, so it has one side.
            double_sided: extensions.volume.is_none(),
            extensions,
            extras: match material.license.as_str() {
                "" => serde_json::Value::Null,
                license => serde_json::json!({ "license": license }),
            },
        })
    }

    fn layers(&mut self, glb: &mut Glb, material: &Material, extensions: &mut MaterialExtensions) -> Result<()> {
        if let Some(coat) = &material.clearcoat {
            let (strength, rough) = (channel(&coat.strength), channel(&coat.roughness));
            extensions.clearcoat = Some(GltfClearcoat {
                clearcoat_factor: unit(coat.strength.factor),
                clearcoat_texture: self.textures.packed(glb, [strength, None, None, None])?,
                clearcoat_roughness_factor: unit(coat.roughness.factor),
                clearcoat_roughness_texture: self.textures.packed(glb, [None, rough, None, None])?,
                clearcoat_normal_texture: self.normal(glb, &coat.normal)?,
            });
        }
        if let Some(sheen) = &material.sheen {
            extensions.sheen = Some(GltfSheen {
                sheen_color_factor: sheen.color.factor.map(unit),
                sheen_color_texture: self.color(glb, &sheen.color)?,
                sheen_roughness_factor: unit(sheen.roughness.factor),
                sheen_roughness_texture: self.textures.packed(glb, [None, None, None, channel(&sheen.roughness)])?,
            });
        }
        if let Some(transmission) = &material.transmission {
            extensions.transmission = Some(GltfTransmission {
                transmission_factor: unit(transmission.fraction.factor),
                transmission_texture: self.textures.packed(glb, [channel(&transmission.fraction), None, None, None])?,
            });
            extensions.volume = transmission.volume.map(|volume| GltfVolume {
                thickness_factor: THICKNESS_M,
                attenuation_color: volume.attenuation_color.map(unit),
                attenuation_distance: Some(volume.attenuation_distance_m).filter(|m| m.is_finite() && *m > 0.0),
            });
        }
        Ok(())
    }

    /// The factor and the texture of the base color. A changed color is in the texture or in the vertex colors.
    fn base_color(&mut self, glb: &mut Glb, material: &Material) -> Result<([f32; 3], Option<TextureInfo>)> {
        let factor = material.base_color.factor.map(unit);
        match (&material.base_color.texture, &material.recolor) {
            (Some(used), Some(matrix)) => Ok(([1.0; 3], Some(self.textures.recolored(glb, used, factor, matrix)?))),
            _ if is_in_vertex_colors(material) => Ok(([1.0; 3], None)),
            _ => Ok((factor, self.color(glb, &material.base_color)?)),
        }
    }

    fn color(&mut self, glb: &mut Glb, color: &Color) -> Result<Option<TextureInfo>> {
        color.texture.as_ref().map(|used| self.textures.texture(glb, used, Encoding::Srgb)).transpose()
    }

    fn normal(&mut self, glb: &mut Glb, normal: &Option<NormalMap>) -> Result<Option<TextureInfo>> {
        let Some(NormalMap { map, strength }) = normal else { return Ok(None) };
        let info = self.textures.texture(glb, map, Encoding::Linear)?;
        Ok(Some(TextureInfo { scale: Some(*strength).filter(|scale| scale.is_finite()), ..info }))
    }
}

/// Whether a material needs tangents.
pub fn has_normal_map(material: &Material) -> bool {
    material.normal.is_some() || material.clearcoat.as_ref().is_some_and(|coat| coat.normal.is_some())
}

/// The texture channel that stores a scalar.
fn channel(scalar: &Scalar) -> Option<TextureChannel<'_>> {
    scalar.texture.as_ref().map(|(used, channel)| (used, *channel))
}

/// Clamps to [0, 1]; NaN becomes 0.
fn unit(x: f32) -> f32 {
    if x > 0.0 { x.min(1.0) } else { 0.0 }
}
