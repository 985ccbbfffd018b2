//! Materials as tables: factors, numbered textures, and the placement of textures on the body.

use crate::cache::SceneCache;
use crate::labels::{BlendedLabels, GLASS};
use crate::mapping::{Mapping, TextureCoordinates, UvAffine};
use crate::texture::MipTexture;
use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::digest::Digest;
use syntable_model::scene::{self, ColorMatrix, Texture, TextureMapping, TextureRef, UvTransform};
use syntable_simd::Rgb;
use syntable_simd::functions::{exp2, log2};

/// Index for a missing texture.
pub const NO_TEXTURE: u32 = u32::MAX;

/// Index for missing layers.
pub const NO_LAYERS: u32 = u32::MAX;

/// Maximum perceptual roughness of a pane. Such a surface deflects light by less than a third of a degree, so light
/// passes straight.
pub const PANE_ROUGHNESS: f32 = 0.05;

/// A texture and its placement in the coordinates of the material's mapping.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct TextureBinding {
    /// Index in [`MaterialTable::textures`], or [`NO_TEXTURE`].
    pub texture: u32,
    /// Transform from the mapping's coordinates to the texture's coordinates.
    pub transform: UvAffine,
    /// Added to the base-2 logarithm of a footprint in (u, v) to give the mip level.
    pub level_bias: f32,
}

/// A color: factor times texture.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct ColorInput {
    /// Linear Rec. 709.
    pub factor: Rgb,
    /// Texture, if any.
    pub texture: TextureBinding,
}

/// A number in [0, 1]: factor times a channel of a texture.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct ScalarInput {
    /// In [0, 1].
    pub factor: f32,
    /// Channel of the texture: 0 red … 3 alpha.
    pub channel: u32,
    /// Texture, if any.
    pub texture: TextureBinding,
}

/// A normal map in the OpenGL convention.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct NormalInput {
    /// Factor on the x and y components.
    pub strength: f32,
    /// Texture, if any.
    pub texture: TextureBinding,
}

/// A material of a body, with values clamped to their ranges.
#[derive(Clone, Copy, Debug)]
pub struct Material {
    /// Diffuse albedo of a dielectric, reflectance of a metal at normal incidence.
    pub base_color: ColorInput,
    /// Changes the base color after its texture and the vertex color.
    pub recolor: Option<ColorMatrix>,
    /// Perceptual roughness; GGX α is its square.
    pub roughness: ScalarInput,
    /// 0 dielectric … 1 metal.
    pub metallic: ScalarInput,
    /// Normal map of the base.
    pub normal: NormalInput,
    /// Emitted radiance, nits.
    pub emission: ColorInput,
    /// Reflectance of the dielectric at normal incidence.
    pub dielectric_f0: f32,
    /// Index in [`MaterialTable::layers`], or [`NO_LAYERS`].
    pub layers: u32,
    /// Meaning of the alpha channel of the base color's texture.
    pub alpha: AlphaMode,
    /// Source of the texture coordinates.
    pub mapping: Mapping,
    /// Height of the point that the environment is projected from, meters, if the material shows it.
    pub projection_height: Option<f32>,
}

/// Layers above the base, and transmission. A layer with factor 0 has no effect.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct MaterialLayers {
    /// Weight of the clearcoat.
    pub clearcoat: ScalarInput,
    /// Perceptual roughness of the clearcoat.
    pub clearcoat_roughness: ScalarInput,
    /// Normal map of the clearcoat.
    pub clearcoat_normal: NormalInput,
    /// Reflectance of the sheen.
    pub sheen_color: ColorInput,
    /// Perceptual roughness of the sheen.
    pub sheen_roughness: ScalarInput,
    /// Fraction of the light that enters the surface and is transmitted.
    pub transmission: ScalarInput,
    /// 1 if the body encloses a medium and refracts, 0 if its surfaces are thin sheets.
    pub has_volume: u32,
    /// Absorption coefficient of the medium, 1/m.
    pub absorption: Rgb,
    /// Index of refraction.
    pub ior: f32,
}

/// Meaning of alpha.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    /// Ignored.
    Opaque,
    /// The surface does not exist below the cutoff.
    Mask(f32),
    /// The surface exists with this probability, times the texture's alpha.
    Blend(f32),
}

/// Materials of a scene, with the layers and textures that they refer to by number.
#[derive(Clone, Debug, Default)]
pub struct MaterialTable {
    /// Materials, body by body in the order of their slots.
    pub materials: Vec<Material>,
    /// Layers of the materials that have any.
    pub layers: Vec<MaterialLayers>,
    /// Textures; materials with equal textures share one.
    pub textures: Vec<Arc<MipTexture>>,
    /// Whether any material shows the environment.
    pub has_projections: bool,
}

/// Base-2 logarithm of a footprint that reads the finest texels.
pub const FINEST: f32 = -100.0;

/// Builds a [`MaterialTable`].
pub(crate) struct TableBuilder<'a> {
    table: MaterialTable,
    numbers: BTreeMap<Digest, u32>,
    /// Textures that this builder has loaded, even if the cache dropped them.
    loaded: BTreeMap<Digest, Arc<MipTexture>>,
    cache: &'a SceneCache,
}

/// A number clamped to [0, 1]; NaN becomes 0.
fn unit(x: f32) -> f32 {
    if x > 0.0 { x.min(1.0) } else { 0.0 }
}

impl TextureBinding {
    /// No texture.
    pub const NONE: Self = Self {
        texture: NO_TEXTURE,
        transform: UvAffine { m: [[1.0, 0.0], [0.0, 1.0]], offset: [0.0; 2], log2_scale: 0.0 },
        level_bias: 0.0,
    };

    /// Whether the binding has a texture.
    #[inline(always)]
    pub fn is_some(&self) -> bool {
        self.texture != NO_TEXTURE
    }

    /// Linear color at texture coordinates of the mapping.
    ///
    /// # Panics
    /// Without a texture.
    #[inline(always)]
    pub fn color(&self, textures: &[Arc<MipTexture>], at: TextureCoordinates) -> Rgb {
        textures[self.texture as usize].color(self.transform.apply(at.uv), at.log2_width + self.level_bias)
    }

    /// One linear channel at texture coordinates of the mapping.
    ///
    /// # Panics
    /// Without a texture.
    #[inline(always)]
    pub fn channel(&self, textures: &[Arc<MipTexture>], at: TextureCoordinates, channel: u8) -> f32 {
        let texture = &textures[self.texture as usize];
        texture.channel(self.transform.apply(at.uv), at.log2_width + self.level_bias, channel)
    }
}

impl ColorInput {
    /// Value at texture coordinates of the mapping.
    #[inline(always)]
    pub fn at(&self, textures: &[Arc<MipTexture>], at: TextureCoordinates) -> Rgb {
        match self.texture.is_some() {
            true => self.factor * self.texture.color(textures, at),
            false => self.factor,
        }
    }
}

impl ScalarInput {
    /// A constant number.
    const fn constant(factor: f32) -> Self {
        Self { factor, channel: 0, texture: TextureBinding::NONE }
    }

    /// Value at texture coordinates of the mapping.
    #[inline(always)]
    pub fn at(&self, textures: &[Arc<MipTexture>], at: TextureCoordinates) -> f32 {
        match self.texture.is_some() {
            true => self.factor * self.texture.channel(textures, at, self.channel as u8),
            false => self.factor,
        }
    }
}

impl NormalInput {
    const NONE: Self = Self { strength: 1.0, texture: TextureBinding::NONE };
}

impl Material {
    /// Base color at texture coordinates of the mapping, where the vertex color is `tint`.
    #[inline(always)]
    pub fn base_color_at(&self, textures: &[Arc<MipTexture>], at: TextureCoordinates, tint: Rgb) -> Rgb {
        let color = self.base_color.at(textures, at) * tint;
        match &self.recolor {
            Some(matrix) => Rgb::from(matrix.apply(color.array())),
            None => color,
        }
    }

    /// Whether the material is independent of texture coordinates.
    #[inline(always)]
    pub fn is_untextured(&self) -> bool {
        !self.base_color.texture.is_some()
            && !self.roughness.texture.is_some()
            && !self.metallic.texture.is_some()
            && !self.normal.texture.is_some()
            && !self.emission.texture.is_some()
            && self.layers == NO_LAYERS
    }

    /// Whether the material has a clearcoat, sheen or transmission.
    #[inline(always)]
    pub fn is_layered(&self) -> bool {
        self.layers != NO_LAYERS
    }

    /// Whether the material emits light.
    #[inline]
    pub fn is_emissive(&self) -> bool {
        !self.emission.factor.is_black()
    }

    /// Whether the surface exists at a point, according to its finest texels. Where coverage is partial, it exists if
    /// `u` in [0, 1) is below the coverage.
    #[inline]
    pub fn is_solid(&self, textures: &[Arc<MipTexture>], uv: [f32; 2], u: f32) -> bool {
        match self.alpha {
            AlphaMode::Opaque => true,
            AlphaMode::Mask(cutoff) => self.alpha_of_texel(textures, uv) >= cutoff,
            AlphaMode::Blend(factor) => self.alpha_of_texel(textures, uv) * factor > u,
        }
    }

    /// Whether the surface exists at a point for labels, according to its alpha.
    pub fn is_labeled(&self, textures: &[Arc<MipTexture>], uv: [f32; 2], blended: BlendedLabels) -> bool {
        match (self.alpha, blended) {
            (AlphaMode::Opaque, _) => true,
            (AlphaMode::Mask(cutoff), _) => self.alpha_of_texel(textures, uv) >= cutoff,
            (AlphaMode::Blend(_), BlendedLabels::Shape) => self.alpha_of_texel(textures, uv) >= 0.5,
            (AlphaMode::Blend(factor), BlendedLabels::Coverage | BlendedLabels::Opaque) => {
                self.alpha_of_texel(textures, uv) * factor >= 0.5
            }
        }
    }

    #[inline]
    fn alpha_of_texel(&self, textures: &[Arc<MipTexture>], uv: [f32; 2]) -> f32 {
        match self.base_color.texture.is_some() {
            true => self.base_color.texture.channel(textures, TextureCoordinates { uv, log2_width: FINEST }, 3),
            false => 1.0,
        }
    }
}

impl MaterialLayers {
    /// Fraction of the entering light that is transmitted; 0 for metals.
    #[inline(always)]
    pub fn transmitted_fraction(&self, textures: &[Arc<MipTexture>], at: TextureCoordinates, metallic: f32) -> f32 {
        self.transmission.at(textures, at) * (1.0 - metallic)
    }

    /// Fraction of the light that remains after a distance in the medium, meters.
    #[inline]
    pub fn transmittance(&self, distance: f32) -> Rgb {
        self.absorption.map(|k| exp2(k * distance * -std::f32::consts::LOG2_E))
    }
}

impl MaterialTable {
    /// Layers of a material.
    #[inline(always)]
    pub fn layers(&self, material: &Material) -> Option<&MaterialLayers> {
        self.layers.get(material.layers as usize)
    }

    /// Whether a material transmits light somewhere.
    pub fn has_glass(&self, material: &Material) -> bool {
        self.layers(material).is_some_and(|layers| layers.transmission.factor > 0.0)
    }

    /// Whether a material is glass at a point, according to its finest texels: it transmits at least one half of the
    /// entering light.
    pub fn is_glass(&self, material: &Material, uv: [f32; 2]) -> bool {
        let at = TextureCoordinates { uv, log2_width: FINEST };
        self.layers(material).is_some_and(|layers| {
            layers.transmitted_fraction(&self.textures, at, material.metallic.at(&self.textures, at)) >= GLASS
        })
    }

    /// Layers of a material with panes: thin and smooth parts that transmit light straight.
    #[inline(always)]
    pub fn pane(&self, material: &Material) -> Option<&MaterialLayers> {
        let smooth = material.roughness.texture.is_some() || material.roughness.factor <= PANE_ROUGHNESS;
        let thin = |layers: &&MaterialLayers| layers.transmission.factor > 0.0 && layers.has_volume == 0;
        // The reflectance of a pane follows its shading normal, which a normal map would make depend on the footprint.
        self.layers(material).filter(thin).filter(|_| smooth && !material.normal.texture.is_some())
    }

    /// Whether a point of a material with panes is a pane, according to its finest texels.
    #[inline]
    pub fn is_pane(&self, material: &Material, at: TextureCoordinates) -> bool {
        let at = TextureCoordinates { log2_width: -100.0, ..at };
        material.roughness.at(&self.textures, at) <= PANE_ROUGHNESS
    }

    /// Emitted radiance at texture coordinates of the mapping, nits.
    #[inline(always)]
    pub fn emission(&self, material: &Material, at: TextureCoordinates) -> Rgb {
        material.emission.at(&self.textures, at)
    }
}

impl<'a> TableBuilder<'a> {
    pub fn new(cache: &'a SceneCache, loaded: BTreeMap<Digest, Arc<MipTexture>>) -> Self {
        Self { table: MaterialTable::default(), numbers: BTreeMap::new(), loaded, cache }
    }

    /// Returns the table.
    pub fn finish(self) -> MaterialTable {
        self.table
    }

    /// Number of materials so far.
    pub fn len(&self) -> usize {
        self.table.materials.len()
    }

    /// Whether the last material transmits light somewhere.
    pub fn has_glass(&self) -> bool {
        self.table.materials.last().is_some_and(|material| self.table.has_glass(material))
    }

    /// Whether the last material has panes.
    pub fn has_panes(&self) -> bool {
        self.table.materials.last().is_some_and(|material| self.table.pane(material).is_some())
    }

    /// Adds a material, and returns it.
    pub fn push(&mut self, material: &scene::Material, mapping: TextureMapping) -> &Material {
        let ior = if material.ior.is_finite() && material.ior >= 1.0 { material.ior } else { 1.5 };
        let emission = material.emission.factor.map(|x| if x > 0.0 && x.is_finite() { x } else { 0.0 });
        let emission_texture = material.emission.texture.as_ref().filter(|_| emission != [0.0; 3]);
        let flat = Material {
            base_color: self.color(&material.base_color),
            recolor: material.recolor,
            roughness: self.scalar(&material.roughness),
            metallic: self.scalar(&material.metallic),
            normal: self.normal(&material.normal),
            emission: ColorInput { factor: Rgb::from(emission), texture: self.binding(emission_texture) },
            dielectric_f0: ((ior - 1.0) / (ior + 1.0)).powi(2),
            layers: self.layers(material, ior),
            alpha: match (material.alpha, &material.base_color.texture) {
                (scene::Alpha::Mask { cutoff }, Some(_)) => AlphaMode::Mask(unit(cutoff)),
                (scene::Alpha::Blend { factor }, None) if unit(factor) == 1.0 => AlphaMode::Opaque,
                (scene::Alpha::Blend { factor }, _) => AlphaMode::Blend(unit(factor)),
                _ => AlphaMode::Opaque,
            },
            mapping: match mapping {
                TextureMapping::Uv(transform) => Mapping::Uv(UvAffine::new(&transform)),
                TextureMapping::Box { rotation, offset } => {
                    let tile =
                        if material.tile_m > 1e-6 && material.tile_m.is_finite() { material.tile_m } else { 1.0 };
                    let transform = UvAffine::new(&UvTransform { scale: [1.0; 2], rotation, offset });
                    Mapping::Box { per_m: 1.0 / tile, transform }
                }
            },
            projection_height: material.projection_height_m.filter(|height| height.is_finite()),
        };
        let number = self.table.materials.len();
        self.table.has_projections |= flat.projection_height.is_some();
        self.table.materials.push(flat);
        &self.table.materials[number]
    }

    fn layers(&mut self, material: &scene::Material, ior: f32) -> u32 {
        let coat = material.clearcoat.as_ref().filter(|coat| unit(coat.strength.factor) > 0.0);
        let sheen = material.sheen.as_ref().filter(|sheen| sheen.color.factor.map(unit) != [0.0; 3]);
        let transmission = material.transmission.as_ref().filter(|passing| passing.fraction.factor > 0.0);
        if coat.is_none() && sheen.is_none() && transmission.is_none() {
            return NO_LAYERS;
        }
        let none = ScalarInput::constant(0.0);
        let volume = transmission.and_then(|passing| passing.volume);
        let layers = MaterialLayers {
            clearcoat: coat.map_or(none, |coat| self.scalar(&coat.strength)),
            clearcoat_roughness: coat.map_or(none, |coat| self.scalar(&coat.roughness)),
            clearcoat_normal: coat.map_or(NormalInput::NONE, |coat| self.normal(&coat.normal)),
            sheen_color: sheen.map_or(ColorInput { factor: Rgb::ZERO, texture: TextureBinding::NONE }, |sheen| {
                self.color(&sheen.color)
            }),
            sheen_roughness: sheen.map_or(none, |sheen| self.scalar(&sheen.roughness)),
            transmission: transmission.map_or(none, |passing| self.scalar(&passing.fraction)),
            has_volume: u32::from(volume.is_some()),
            absorption: volume.map_or(Rgb::ZERO, |volume| absorption(&volume)),
            ior,
        };
        self.table.layers.push(layers);
        self.table.layers.len() as u32 - 1
    }

    fn color(&mut self, color: &scene::Color) -> ColorInput {
        ColorInput { factor: Rgb::from(color.factor.map(unit)), texture: self.binding(color.texture.as_ref()) }
    }

    fn scalar(&mut self, scalar: &scene::Scalar) -> ScalarInput {
        let (texture, channel) = match &scalar.texture {
            Some((texture, channel)) => (Some(texture), *channel),
            None => (None, 0),
        };
        ScalarInput { factor: unit(scalar.factor), channel: channel.into(), texture: self.binding(texture) }
    }

    fn normal(&mut self, normal: &Option<scene::NormalMap>) -> NormalInput {
        let Some(normal) = normal else { return NormalInput::NONE };
        let strength = if normal.strength.is_finite() { normal.strength } else { 1.0 };
        NormalInput { strength, texture: self.binding(Some(&normal.map)) }
    }

    fn binding(&mut self, used: Option<&TextureRef>) -> TextureBinding {
        let Some(used) = used else { return TextureBinding::NONE };
        let (texture, transform) = (self.texture(&used.texture), UvAffine::new(&used.transform));
        let level_bias = self.table.textures[texture as usize].log2_size() + transform.log2_scale;
        TextureBinding { texture, transform, level_bias }
    }

    fn texture(&mut self, texture: &Arc<Texture>) -> u32 {
        *self.numbers.entry(texture.digest).or_insert_with(|| {
            let loaded = self.loaded.get(&texture.digest).cloned();
            self.table.textures.push(loaded.unwrap_or_else(|| self.cache.texture(texture)));
            self.table.textures.len() as u32 - 1
        })
    }
}

/// Absorption coefficient of a medium, 1/m.
fn absorption(volume: &scene::Volume) -> Rgb {
    let distance = volume.attenuation_distance_m;
    let of = |left: f32| {
        if distance > 0.0 && distance.is_finite() {
            -log2(unit(left).max(1e-6)) * std::f32::consts::LN_2 / distance
        } else {
            0.0
        }
    };
    Rgb::from(volume.attenuation_color.map(of))
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::scene::{Alpha, Color, Encoding, Scalar, Transmission, Volume, Wrap};

    fn texture(name: &str, texel: [u8; 4]) -> Arc<Texture> {
        let (encoding, wrap) = (Encoding::Linear, [Wrap::Repeat; 2]);
        let digest = Digest::of(name.as_bytes());
        Arc::new(Texture { width: 1, height: 1, texels: texel.to_vec(), encoding, wrap, digest })
    }

    const AT: TextureCoordinates = TextureCoordinates { uv: [0.3, 0.7], log2_width: 0.0 };

    #[test]
    fn equal_textures_share_a_number_and_factors_are_brought_into_range() {
        let (cache, plain) = (SceneCache::default(), scene::Material::plain("m", [2.0, f32::NAN, 0.5], -1.0));
        let map = texture("map", [51, 102, 153, 204]);
        let material = scene::Material {
            base_color: Color { factor: [0.5; 3], texture: Some(map.clone().into()) },
            roughness: Scalar::texture(map, 1),
            metallic: Scalar::texture(texture("other", [255, 0, 255, 0]), 2),
            ..plain.clone()
        };
        let mut builder = TableBuilder::new(&cache, BTreeMap::new());
        let mapping = || TextureMapping::Uv(UvTransform::default());
        let first = *builder.push(&plain, mapping());
        let second = *builder.push(&material, mapping());
        let table = builder.finish();
        assert_eq!((first.base_color.factor.array(), first.roughness.factor), ([1.0, 0.0, 0.5], 0.0));
        assert!(first.is_untextured() && !second.is_untextured() && !second.is_layered());
        assert_eq!((table.materials.len(), table.textures.len()), (2, 2));
        assert_eq!(second.base_color.texture.texture, second.roughness.texture.texture);
        let color = second.base_color.at(&table.textures, AT);
        assert!((color - Rgb::from([0.1, 0.2, 0.3])).length() < 1e-6, "{color:?}");
        assert!((second.roughness.at(&table.textures, AT) - 0.4).abs() < 1e-6);
        assert_eq!(second.metallic.at(&table.textures, AT), 1.0);
    }

    #[test]
    fn alpha_of_texels_decides_where_there_is_a_surface() {
        let (cache, plain) = (SceneCache::default(), scene::Material::plain("m", [1.0; 3], 1.0));
        let with = |alpha, texture: Option<Arc<Texture>>| {
            let base_color = Color { factor: [1.0; 3], texture: texture.map(Into::into) };
            let material = scene::Material { base_color, alpha, ..plain.clone() };
            let mut builder = TableBuilder::new(&cache, BTreeMap::new());
            let flat = *builder.push(&material, TextureMapping::Uv(UvTransform::default()));
            (flat, builder.finish())
        };
        let half = || Some(texture("half", [255, 255, 255, 128]));
        let solid =
            |(material, table): &(Material, MaterialTable), u: f32| material.is_solid(&table.textures, AT.uv, u);
        assert!(solid(&with(Alpha::Mask { cutoff: 0.5 }, half()), 0.9));
        assert!(!solid(&with(Alpha::Mask { cutoff: 0.6 }, half()), 0.0));
        assert_eq!(with(Alpha::Mask { cutoff: 0.6 }, None).0.alpha, AlphaMode::Opaque, "no texture, no cut-outs");
        let blend = with(Alpha::Blend { factor: 0.5 }, half());
        assert!(solid(&blend, 0.25) && !solid(&blend, 0.26));
        assert_eq!(with(Alpha::Blend { factor: 1.0 }, None).0.alpha, AlphaMode::Opaque);
        // For labels by coverage, alpha of one half is a surface, and less is none. By shape, only the texels count.
        let quarter = || Some(texture("quarter", [255, 255, 255, 64]));
        for (alpha, texture, by_shape, by_coverage) in [
            (Alpha::Blend { factor: 0.5 }, None, true, true),
            (Alpha::Blend { factor: 0.499 }, None, true, false),
            (Alpha::Blend { factor: 0.01 }, half(), true, false),
            (Alpha::Blend { factor: 1.0 }, quarter(), false, false),
            (Alpha::Mask { cutoff: 0.2 }, quarter(), true, true),
            (Alpha::Mask { cutoff: 0.3 }, quarter(), false, false),
        ] {
            let (material, table) = with(alpha, texture);
            let labeled = |blended| material.is_labeled(&table.textures, AT.uv, blended);
            let got = [BlendedLabels::Shape, BlendedLabels::Coverage, BlendedLabels::Opaque].map(labeled);
            assert_eq!(got, [by_shape, by_coverage, by_coverage], "{alpha:?}");
        }
    }

    #[test]
    fn a_medium_absorbs_to_its_color_at_its_distance() {
        let cache = SceneCache::default();
        let volume = Volume { attenuation_color: [0.5, 0.25, 1.0], attenuation_distance_m: 0.2 };
        let material = scene::Material {
            transmission: Some(Transmission { fraction: Scalar::constant(1.0), volume: Some(volume) }),
            ..scene::Material::plain("m", [1.0; 3], 0.0)
        };
        let mut builder = TableBuilder::new(&cache, BTreeMap::new());
        let flat = *builder.push(&material, TextureMapping::Uv(UvTransform::default()));
        let table = builder.finish();
        let layers = table.layers(&flat).expect("transmits");
        assert_eq!((layers.has_volume, layers.clearcoat.factor), (1, 0.0));
        for (distance, want) in [(0.2, [0.5, 0.25, 1.0]), (0.4, [0.25, 0.0625, 1.0]), (0.0, [1.0; 3])] {
            let got = layers.transmittance(distance);
            assert!((got - Rgb::from(want)).length() < 1e-5, "{distance} m: {got:?}");
        }
    }
}
