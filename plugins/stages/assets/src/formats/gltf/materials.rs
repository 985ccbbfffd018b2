//! Materials: glTF's metallic-roughness model is the program's own, so that little is converted.
//!
//! The core, `KHR_materials_ior` and `KHR_materials_emissive_strength` are read here, other extensions in [`layers`](
//! super::layers) and [`specular_glossiness`](super::specular_glossiness).

use super::buffers::GltfBuffers;
use super::items::get;
use super::layers::{ExtensionLayers, unit};
use super::specular_glossiness::{Factors, SpecularGlossinessJson, convert};
use super::uses::{Use, of_info, of_normal};
use crate::formats::within;
use gltf::json::material::AlphaMode;
use gltf::json::texture::{Info, WrappingMode};
use gltf::json::validation::Checked;
use gltf::json::{self, Index, Root};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;
use syntable_mesh::image::DecodedImage;
use syntable_mesh::material::{blend, untextured};
use syntable_mesh::paint::VertexAlpha;
use syntable_mesh::text::shorten;
use syntable_model::context::Log;
use syntable_model::digest::Digest;
use syntable_model::error::{Error, Result};
use syntable_model::scene::{
    Alpha, Clearcoat, Color, Encoding, Material, NormalMap, Scalar, Sheen, Texture, TextureRef, Transmission, Wrap,
};

type JsonMaterial = json::Material;

/// Textures of diffuse color and of specular color and glossiness, and the bits of their factors.
type SpecularTextureKey = (Option<Digest>, Option<Digest>, [u32; 7]);

/// Materials by slot, in the order in which primitives name them.
pub struct GltfMaterials<'a> {
    document: &'a Root,
    path: &'a Path,
    log: &'a dyn Log,
    /// Material, whether its faces have texture coordinates, and how many they are.
    slots: Vec<(Option<Index<JsonMaterial>>, bool, usize)>,
    warned: BTreeSet<String>,
    /// Slots by material and texture coordinates.
    known: BTreeMap<(Option<usize>, bool), u16>,
    textures: BTreeMap<(usize, bool, [u8; 2]), Option<Arc<Texture>>>,
    /// Base color, and roughness with metalness, of converted textures.
    converted: BTreeMap<SpecularTextureKey, [Arc<Texture>; 2]>,
}

impl<'a> GltfMaterials<'a> {
    /// Materials of a document; the path is for messages.
    pub fn new(document: &'a Root, path: &'a Path, log: &'a dyn Log) -> Self {
        Self {
            document,
            path,
            log,
            slots: Vec::new(),
            warned: BTreeSet::new(),
            known: BTreeMap::new(),
            textures: BTreeMap::new(),
            converted: BTreeMap::new(),
        }
    }

    /// Warns once.
    pub fn warn(&mut self, message: &str) {
        self.tell(Error::new(message));
    }

    fn tell(&mut self, warning: Error) {
        let warning = warning.in_file(self.path);
        if self.warned.insert(warning.to_string()) {
            self.log.warn(&warning);
        }
    }

    /// The slot of a material for faces with or without texture coordinates.
    pub fn slot(&mut self, material: Option<Index<JsonMaterial>>, uvs: bool, triangles: usize) -> Result<u16> {
        let key = (material.map(|index| index.value()), uvs);
        let slot = match self.known.get(&key) {
            Some(&slot) => slot,
            None => {
                let slot = u16::try_from(self.slots.len()).map_err(|_| Error::new("more than 65536 materials"))?;
                self.slots.push((material, uvs, 0));
                self.known.insert(key, slot);
                slot
            }
        };
        self.slots[usize::from(slot)].2 += triangles;
        Ok(slot)
    }

    /// The set of texture coordinates that a material uses; `None` without a texture. If textures use several sets, the
    /// base color's set applies to all, with a warning.
    pub fn uv_set(&mut self, material: Option<Index<JsonMaterial>>) -> Result<Option<u32>> {
        let Some(index) = material else {
            return Ok(None);
        };
        let material = get(&self.document.materials, index, "material")?;
        let (pbr, layers) = (&material.pbr_metallic_roughness, ExtensionLayers::of(material)?);
        let base = match &layers.specular_glossiness {
            Some(older) => [&older.diffuse_texture, &older.specular_glossiness_texture],
            None => [&pbr.base_color_texture, &pbr.metallic_roughness_texture],
        };
        let infos = base.into_iter().chain([&material.emissive_texture]);
        let mut sets: Vec<u32> = infos.flatten().map(|info| of_info(info).set).collect();
        if let Some(normal) = &material.normal_texture {
            sets.push(of_normal(normal)?.set);
        }
        sets.extend(layers.uses()?.iter().map(|used| used.set));
        if sets.iter().any(|set| *set != sets[0]) {
            self.warn(&format!(
                "material {} uses several sets of texture coordinates; set {} is used for all",
                index.value(),
                sets[0]
            ));
        }
        Ok(sets.first().copied())
    }

    /// Effect of vertex opacity for each slot.
    pub fn vertex_alpha(&self) -> Vec<VertexAlpha> {
        let meaning = |material: Option<Index<JsonMaterial>>| match material
            .and_then(|index| self.document.materials.get(index.value()))?
            .alpha_mode
        {
            Checked::Valid(AlphaMode::Mask) => Some(VertexAlpha::Masks),
            Checked::Valid(AlphaMode::Blend) => Some(VertexAlpha::Blends),
            _ => None,
        };
        self.slots.iter().map(|(material, ..)| meaning(*material).unwrap_or(VertexAlpha::Ignored)).collect()
    }

    /// Builds the materials of all slots.
    pub fn into_slots(mut self, buffers: &mut GltfBuffers<'_>) -> Result<Vec<Material>> {
        let slots = std::mem::take(&mut self.slots);
        let mut built = Vec::with_capacity(slots.len());
        for (index, uvs, triangles) in slots {
            let Some(index) = index else {
                // White and rough, as in the standard, but not metallic: no author who omits a material wants metal.
                built.push(Material::plain("default", [1.0; 3], 1.0));
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

    fn build(&mut self, json: &JsonMaterial, index: usize, buffers: &mut GltfBuffers<'_>) -> Result<Material> {
        let layers = ExtensionLayers::of(json)?;
        let name = json.name.clone().unwrap_or_else(|| format!("material {index}"));
        let mut material = Material::plain(name, [1.0; 3], 1.0);
        let alpha = match &layers.specular_glossiness {
            Some(older) => self.specular_glossiness(&mut material, older, buffers)?,
            None => self.metallic_roughness(&mut material, &json.pbr_metallic_roughness, buffers)?,
        };
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
        match json.alpha_mode {
            Checked::Valid(AlphaMode::Mask) => {
                let cutoff = json.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0);
                // The factor multiplies alpha; the cutoff is divided by it instead.
                let cutoff = if alpha > 0.0 { (cutoff / alpha).clamp(0.0, 1.0) } else { 1.0 };
                material.alpha = Alpha::Mask { cutoff };
            }
            // Many files declare blending without transparent texels.
            Checked::Valid(AlphaMode::Blend) if alpha < 1.0 || has_alpha(&material.base_color.texture) => {
                blend(&mut material, unit(alpha));
            }
            _ => {}
        }
        self.layers(&mut material, &layers, buffers)?;
        self.modify_base(&mut material, &layers);
        Ok(material.with_digest())
    }

    /// Reads the base of the core standard; returns the factor of alpha.
    fn metallic_roughness(
        &mut self,
        material: &mut Material,
        pbr: &json::material::PbrMetallicRoughness,
        buffers: &mut GltfBuffers<'_>,
    ) -> Result<f32> {
        let [r, g, b, alpha] = pbr.base_color_factor.0;
        material.base_color = Color {
            factor: [r, g, b].map(unit),
            texture: self.info(&pbr.base_color_texture, Encoding::Srgb, buffers)?,
        };
        material.roughness = Scalar::constant(unit(pbr.roughness_factor.0));
        material.metallic = Scalar::constant(unit(pbr.metallic_factor.0));
        if let Some(texture) = self.info(&pbr.metallic_roughness_texture, Encoding::Linear, buffers)? {
            material.roughness.texture = Some((texture.clone(), 1));
            material.metallic.texture = Some((texture, 2));
        }
        Ok(alpha)
    }

    /// Converts the base of the older model; returns the factor of alpha.
    fn specular_glossiness(
        &mut self,
        material: &mut Material,
        older: &SpecularGlossinessJson,
        buffers: &mut GltfBuffers<'_>,
    ) -> Result<f32> {
        let [r, g, b, alpha] = older.diffuse_factor;
        let factors = Factors {
            diffuse: [r, g, b].map(unit),
            specular: older.specular_factor.map(unit),
            glossiness: unit(older.glossiness_factor),
        };
        let diffuse = self.info(&older.diffuse_texture, Encoding::Srgb, buffers)?;
        let gloss = self.info(&older.specular_glossiness_texture, Encoding::Srgb, buffers)?;
        if let (Some(diffuse), Some(gloss)) = (&diffuse, &gloss)
            && (diffuse.transform != gloss.transform || diffuse.texture.wrap != gloss.texture.wrap)
        {
            self.warn(
                "the textures of a KHR_materials_pbrSpecularGlossiness have different transforms; both use the transform of the diffuse color",
            );
        }
        material.roughness = Scalar::constant(1.0 - factors.glossiness);
        let Some(used) = diffuse.as_ref().or(gloss.as_ref()) else {
            let (base, metallic) = convert(factors.diffuse.map(f64::from), factors.specular.map(f64::from));
            material.base_color = Color::constant(base.map(|x| x as f32));
            material.metallic = Scalar::constant(metallic as f32);
            return Ok(alpha);
        };
        let textures = [&diffuse, &gloss].map(|used| used.as_ref().map(|used| &*used.texture));
        let [base, rest] = self.converted(&factors, textures, used.texture.wrap, buffers)?;
        let used = |texture: Arc<Texture>| TextureRef { texture, transform: used.transform };
        material.base_color = Color { factor: [1.0; 3], texture: Some(used(base)) };
        material.metallic = Scalar::constant(0.0);
        if rest.texels.chunks_exact(4).any(|texel| texel[2] > 0) {
            material.metallic = Scalar { factor: 1.0, texture: Some((used(rest.clone()), 2)) };
        }
        if gloss.is_some() {
            material.roughness = Scalar { factor: 1.0, texture: Some((used(rest), 1)) };
        }
        Ok(alpha)
    }

    /// Textures of the base color and of roughness with metalness, converted once.
    fn converted(
        &mut self,
        factors: &Factors,
        [diffuse, gloss]: [Option<&Texture>; 2],
        wrap: [Wrap; 2],
        buffers: &GltfBuffers<'_>,
    ) -> Result<[Arc<Texture>; 2]> {
        let ([a, b, c], [d, e, f]) = (factors.diffuse, factors.specular);
        let bits = [a, b, c, d, e, f, factors.glossiness].map(f32::to_bits);
        let key = (diffuse.map(|texture| texture.digest), gloss.map(|texture| texture.digest), bits);
        if let Some(converted) = self.converted.get(&key) {
            return Ok(converted.clone());
        }
        let [base, rest] = factors.apply(diffuse, gloss, buffers.budget())?;
        let textures =
            [base.into_texture(Encoding::Srgb, wrap), rest.into_texture(Encoding::Linear, wrap)].map(Arc::new);
        self.converted.insert(key, textures.clone());
        Ok(textures)
    }

    /// Changes of the base by extensions. Unsupported changes become the nearest supported ones, with a warning.
    fn modify_base(&mut self, material: &mut Material, layers: &ExtensionLayers) {
        if layers.unlit {
            // The extension gives this advice to programs that light all surfaces.
            material.metallic = Scalar::constant(0.0);
            material.roughness = Scalar::constant(1.0);
            material.emission = Color::constant([0.0; 3]);
            self.warn("unlit materials are lit as matt surfaces of their color");
            return;
        }
        if let Some(specular) = &layers.specular {
            // The index also bends light in a body of glass, which the extension must not change.
            let bends = material.transmission.as_ref().is_some_and(|glass| glass.volume.is_some());
            let ior = specular.ior(material.ior);
            if specular.is_approximate() || (bends && (ior - material.ior).abs() > 1e-4) {
                self.warn(
                    "only the factors of KHR_materials_specular are supported, for the strength of the reflection",
                );
            }
            if !bends {
                material.ior = ior;
            }
        }
        if let Some(anisotropy) = layers.anisotropy.as_ref().filter(|anisotropy| anisotropy.is_stretched()) {
            if material.roughness.texture.is_none() && !anisotropy.is_textured() {
                material.roughness.factor = anisotropy.roughness(material.roughness.factor);
            }
            self.warn("stretched highlights (KHR_materials_anisotropy) become round ones");
        }
    }

    fn layers(
        &mut self,
        material: &mut Material,
        layers: &ExtensionLayers,
        buffers: &mut GltfBuffers<'_>,
    ) -> Result<()> {
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
        buffers: &mut GltfBuffers<'_>,
    ) -> Result<Scalar> {
        let texture = self.info(texture, Encoding::Linear, buffers)?;
        Ok(Scalar { factor: unit(factor), texture: texture.map(|texture| (texture, channel)) })
    }

    fn normal(
        &mut self,
        normal: &Option<json::material::NormalTexture>,
        buffers: &mut GltfBuffers<'_>,
    ) -> Result<Option<NormalMap>> {
        let Some(normal) = normal else { return Ok(None) };
        let map = self.texture(&of_normal(normal)?, Encoding::Linear, buffers)?;
        Ok(map.map(|map| NormalMap { map, strength: normal.scale }))
    }

    fn info(
        &mut self,
        info: &Option<Info>,
        encoding: Encoding,
        buffers: &mut GltfBuffers<'_>,
    ) -> Result<Option<TextureRef>> {
        match info {
            Some(info) => self.texture(&of_info(info), encoding, buffers),
            None => Ok(None),
        }
    }

    /// The image of a texture: the plain one, or else the one in WebP or KTX2.
    fn source(&self, texture: &json::Texture, index: Index<json::Texture>) -> Result<Index<json::Image>> {
        if texture.source.value() != u32::MAX as usize {
            return Ok(texture.source);
        }
        let others = texture.extensions.as_ref().map(|extensions| &extensions.others);
        let other = |extension: &str| {
            let source = others.and_then(|others| others.get(extension)?.get("source")?.as_u64());
            source.and_then(|source| u32::try_from(source).ok()).map(Index::new)
        };
        other("EXT_texture_webp").or_else(|| other("KHR_texture_basisu")).ok_or_else(|| {
            Error::unsupported(format!("texture {} has no image as PNG, JPEG, WebP or KTX2", index.value()))
                .help("convert the image to PNG: `gltf-transform png in.glb out.glb`")
        })
    }

    /// Loads a texture. A missing file or an image of an unsupported kind causes a warning, and returns `None`.
    fn texture(&mut self, used: &Use, encoding: Encoding, buffers: &mut GltfBuffers<'_>) -> Result<Option<TextureRef>> {
        let texture = get(&self.document.textures, used.texture, "texture")?;
        let source = match self.source(texture, used.texture) {
            Err(error) if error.is_unsupported() => {
                self.tell(error.with_consequence("using a constant color"));
                return Ok(None);
            }
            source => source?,
        };
        let wrap = match texture.sampler {
            Some(sampler) => {
                let sampler = get(&self.document.samplers, sampler, "sampler")?;
                [wrap(sampler.wrap_s)?, wrap(sampler.wrap_t)?]
            }
            None => [Wrap::Repeat; 2],
        };
        let key = (source.value(), encoding == Encoding::Srgb, wrap.map(|wrap| wrap as u8));
        if !self.textures.contains_key(&key) {
            let image = match buffers.image(source).transpose() {
                Some(decoded) => DecodedImage::if_supported(decoded, |error| self.tell(error))?,
                None => {
                    let image = get(&self.document.images, source, "image")?;
                    let name = shorten(image.uri.as_deref().unwrap_or_default());
                    self.warn(&format!("no texture `{name}`; a constant color is used"));
                    None
                }
            };
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
