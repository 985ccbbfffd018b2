//! Materials: glTF's metallic-roughness model is the program's own, so that little is converted.
//!
//! The core, `KHR_materials_ior` and `KHR_materials_emissive_strength` are read here, other extensions in [`layers`](
//! super::layers).

use super::buffers::Buffers;
use super::get;
use super::layers::Layers;
use super::uses::{Use, of_info, of_normal};
use crate::formats::within;
use gltf::json::material::AlphaMode;
use gltf::json::texture::{Info, WrappingMode};
use gltf::json::validation::Checked;
use gltf::json::{self, Index, Root};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use syntable_mesh::material::{default_material, untextured};
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::scene::{
    Alpha, Clearcoat, Color, Encoding, Material, NormalMap, Scalar, Sheen, Texture, TextureRef, Transmission, Wrap,
};

type JsonMaterial = json::Material;

/// Materials by slot, in the order in which primitives name them.
pub struct Materials<'a> {
    document: &'a Root,
    path: &'a Path,
    log: &'a dyn Log,
    /// Material, whether its faces have texture coordinates, and how many they are.
    slots: Vec<(Option<Index<JsonMaterial>>, bool, usize)>,
    warned: Vec<String>,
    textures: BTreeMap<(usize, bool, [u8; 2]), Option<Arc<Texture>>>,
}

impl<'a> Materials<'a> {
    /// Materials of a document; the path is for messages.
    pub fn new(document: &'a Root, path: &'a Path, log: &'a dyn Log) -> Self {
        Self { document, path, log, slots: Vec::new(), warned: Vec::new(), textures: BTreeMap::new() }
    }

    /// Warns once.
    pub fn warn(&mut self, message: &str) {
        if !self.warned.iter().any(|warned| warned == message) {
            self.warned.push(message.to_owned());
            self.log.warn(&Error::new(message).in_file(self.path));
        }
    }

    /// The slot of a material for faces with or without texture coordinates.
    pub fn slot(&mut self, material: Option<Index<JsonMaterial>>, uvs: bool, triangles: usize) -> Result<u16> {
        let same = |slot: &(Option<Index<JsonMaterial>>, bool, usize)| {
            (slot.0.map(|index| index.value()), slot.1) == (material.map(|index| index.value()), uvs)
        };
        let slot = match self.slots.iter().position(same) {
            Some(slot) => slot,
            None => {
                self.slots.push((material, uvs, 0));
                self.slots.len() - 1
            }
        };
        self.slots[slot].2 += triangles;
        u16::try_from(slot).map_err(|_| Error::new("more than 65536 materials"))
    }

    /// The set of texture coordinates that a material uses; none if it has no texture. Where textures use several sets,
    /// that of the base color counts, after a warning.
    pub fn uv_set(&mut self, material: Option<Index<JsonMaterial>>) -> Result<Option<u32>> {
        let Some(index) = material else {
            return Ok(None);
        };
        let material = get(&self.document.materials, index, "material")?;
        let pbr = &material.pbr_metallic_roughness;
        let infos = [&pbr.base_color_texture, &pbr.metallic_roughness_texture, &material.emissive_texture];
        let mut sets: Vec<u32> = infos.into_iter().flatten().map(|info| of_info(info).set).collect();
        if let Some(normal) = &material.normal_texture {
            sets.push(of_normal(normal)?.set);
        }
        sets.extend(Layers::of(material)?.uses()?.iter().map(|used| used.set));
        if sets.iter().any(|set| *set != sets[0]) {
            self.warn(&format!(
                "material {} uses several sets of texture coordinates; set {} is used for all",
                index.value(),
                sets[0]
            ));
        }
        Ok(sets.first().copied())
    }

    /// Builds the materials of all slots.
    pub fn into_slots(mut self, buffers: &mut Buffers<'_>) -> Result<Vec<Material>> {
        let slots = std::mem::take(&mut self.slots);
        let mut built = Vec::with_capacity(slots.len());
        for (index, uvs, triangles) in slots {
            let Some(index) = index else {
                // The default material of glTF is white metal; a matt gray shows shapes better.
                built.push(default_material(false));
                continue;
            };
            let json = get(&self.document.materials, index, "material")?;
            let material = self
                .build(json, index.value(), buffers)
                .map_err(|error| within(error, format!("material {}", index.value())))?;
            built.push(match untextured(&material) {
                Some(plain) if !uvs => {
                    self.warn(&format!(
                        "{triangles} faces have no texture coordinates; the mean color of the texture is used for them"
                    ));
                    plain
                }
                _ => material,
            });
        }
        Ok(built)
    }

    fn build(&mut self, json: &JsonMaterial, index: usize, buffers: &mut Buffers<'_>) -> Result<Material> {
        let pbr = &json.pbr_metallic_roughness;
        let [r, g, b, alpha] = pbr.base_color_factor.0;
        let name = json.name.clone().unwrap_or_else(|| format!("material {index}"));
        let mut material = Material::plain(name, [r, g, b].map(unit), unit(pbr.roughness_factor.0));
        material.base_color.texture = self.info(&pbr.base_color_texture, Encoding::Srgb, buffers)?;
        material.metallic = Scalar::constant(unit(pbr.metallic_factor.0));
        if let Some(texture) = self.info(&pbr.metallic_roughness_texture, Encoding::Linear, buffers)? {
            material.roughness.texture = Some((texture.clone(), 1));
            material.metallic.texture = Some((texture, 2));
        }
        material.normal = self.normal(&json.normal_texture, buffers)?;
        let extensions = json.extensions.as_ref();
        let strength = extensions.and_then(|e| e.emissive_strength.as_ref()).map_or(1.0, |e| e.emissive_strength.0);
        material.emission = Color {
            factor: json.emissive_factor.0.map(|x| (x * strength).max(0.0)),
            texture: self.info(&json.emissive_texture, Encoding::Srgb, buffers)?,
        };
        if let Some(ior) = extensions.and_then(|e| e.ior.as_ref()).map(|e| e.ior.0).filter(|ior| *ior >= 1.0) {
            material.ior = ior;
        }
        material.alpha = match json.alpha_mode {
            Checked::Valid(AlphaMode::Mask) => {
                let cutoff = json.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0);
                // The factor multiplies alpha; the cutoff is divided by it instead.
                Alpha::Mask { cutoff: if alpha > 0.0 { (cutoff / alpha).clamp(0.0, 1.0) } else { 1.0 } }
            }
            // Many files declare blending without transparent texels.
            Checked::Valid(AlphaMode::Blend) if alpha < 1.0 || has_alpha(&material.base_color.texture) => {
                Alpha::Blend { factor: unit(alpha) }
            }
            _ => Alpha::Opaque,
        };
        self.layers(&mut material, &Layers::of(json)?, buffers)?;
        Ok(material.with_digest())
    }

    fn layers(&mut self, material: &mut Material, layers: &Layers, buffers: &mut Buffers<'_>) -> Result<()> {
        if let Some(coat) = layers.clearcoat.as_ref().filter(|coat| coat.clearcoat_factor > 0.0) {
            material.clearcoat = Some(Clearcoat {
                strength: self.scalar(coat.clearcoat_factor, &coat.clearcoat_texture, 0, buffers)?,
                roughness: self.scalar(
                    coat.clearcoat_roughness_factor,
                    &coat.clearcoat_roughness_texture,
                    1,
                    buffers,
                )?,
                normal: self.normal(&coat.clearcoat_normal_texture, buffers)?,
            });
        }
        if let Some(sheen) = layers.sheen.as_ref().filter(|sheen| sheen.sheen_color_factor.iter().any(|&x| x > 0.0)) {
            material.sheen = Some(Sheen {
                color: Color {
                    factor: sheen.sheen_color_factor.map(unit),
                    texture: self.info(&sheen.sheen_color_texture, Encoding::Srgb, buffers)?,
                },
                // Color and roughness usually come from one image; alpha is linear in either encoding.
                roughness: Scalar {
                    factor: unit(sheen.sheen_roughness_factor),
                    texture: self
                        .info(&sheen.sheen_roughness_texture, Encoding::Srgb, buffers)?
                        .map(|texture| (texture, 3)),
                },
            });
        }
        if let Some(glass) = layers.transmission.as_ref().filter(|glass| glass.transmission_factor > 0.0) {
            material.transmission = Some(Transmission {
                fraction: self.scalar(glass.transmission_factor, &glass.transmission_texture, 0, buffers)?,
                volume: layers.medium(),
            });
        }
        Ok(())
    }

    /// A factor and one channel of a linear image.
    fn scalar(
        &mut self,
        factor: f32,
        texture: &Option<Info>,
        channel: u8,
        buffers: &mut Buffers<'_>,
    ) -> Result<Scalar> {
        let texture = self.info(texture, Encoding::Linear, buffers)?;
        Ok(Scalar { factor: unit(factor), texture: texture.map(|texture| (texture, channel)) })
    }

    fn normal(
        &mut self,
        normal: &Option<json::material::NormalTexture>,
        buffers: &mut Buffers<'_>,
    ) -> Result<Option<NormalMap>> {
        let Some(normal) = normal else { return Ok(None) };
        let map = self.texture(&of_normal(normal)?, Encoding::Linear, buffers)?;
        Ok(map.map(|map| NormalMap { map, strength: normal.scale }))
    }

    fn info(
        &mut self,
        info: &Option<Info>,
        encoding: Encoding,
        buffers: &mut Buffers<'_>,
    ) -> Result<Option<TextureRef>> {
        match info {
            Some(info) => self.texture(&of_info(info), encoding, buffers),
            None => Ok(None),
        }
    }

    /// Loads a texture. A missing file is a warning and gives none.
    fn texture(&mut self, used: &Use, encoding: Encoding, buffers: &mut Buffers<'_>) -> Result<Option<TextureRef>> {
        let texture = get(&self.document.textures, used.texture, "texture")?;
        if texture.source.value() == u32::MAX as usize {
            return Err(Error::new(format!("texture {} has no PNG or JPEG source", used.texture.value()))
                .help("KTX2 and WebP are not read; save the image as PNG beside them"));
        }
        let wrap = match texture.sampler {
            Some(sampler) => {
                let sampler = get(&self.document.samplers, sampler, "sampler")?;
                [wrap(sampler.wrap_s)?, wrap(sampler.wrap_t)?]
            }
            None => [Wrap::Repeat; 2],
        };
        let key = (texture.source.value(), encoding == Encoding::Srgb, wrap.map(|wrap| wrap as u8));
        if !self.textures.contains_key(&key) {
            let image = buffers.image(texture.source)?;
            if image.is_none() {
                let image = get(&self.document.images, texture.source, "image")?;
                let name = image.uri.as_deref().unwrap_or_default();
                self.warn(&format!("no texture `{name}`; a constant color is used"));
            }
            self.textures.insert(key, image.map(|image| Arc::new(image.into_texture(encoding, wrap))));
        }
        let texture = self.textures.get(&key).cloned().flatten();
        Ok(texture.map(|texture| TextureRef { texture, transform: used.transform }))
    }
}

/// Whether any texel of a texture is not opaque.
fn has_alpha(texture: &Option<TextureRef>) -> bool {
    texture.as_ref().is_some_and(|used| used.texture.texels.chunks_exact(4).any(|texel| texel[3] != 255))
}

fn wrap(mode: Checked<WrappingMode>) -> Result<Wrap> {
    match mode {
        Checked::Valid(WrappingMode::Repeat) => Ok(Wrap::Repeat),
        Checked::Valid(WrappingMode::MirroredRepeat) => Ok(Wrap::Mirror),
        Checked::Valid(WrappingMode::ClampToEdge) => Ok(Wrap::Clamp),
        Checked::Invalid => Err(Error::new("a sampler with an unknown wrap mode")),
    }
}

/// Clamps to [0, 1]; NaN becomes 0.
pub fn unit(x: f32) -> f32 {
    if x > 0.0 { x.min(1.0) } else { 0.0 }
}
