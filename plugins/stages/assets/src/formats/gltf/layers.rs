//! Material extensions: clearcoat, sheen, transmission and volume, and the supported parts of specular, anisotropy and
//! unlit.
//!
//! `KHR_materials_clearcoat` stores its factor in red and its roughness in green, `KHR_materials_sheen` its color in
//! the color channels and its roughness in alpha, `KHR_materials_transmission` its factor in red. Of
//! `KHR_materials_volume` the medium is read. Its `attenuationDistance` is in world space by the extension's
//! definition, so node scales do not apply. Its thickness is for rasterizers; only zero matters here: the surface is
//! then thin-walled.

use super::specular_glossiness::SpecularGlossinessJson;
use super::uses::{Use, of_info, of_normal};
use crate::formats::within;
use gltf::json;
use gltf::json::material::NormalTexture;
use gltf::json::texture::Info;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use syntable_model::error::{Error, Result};
use syntable_model::scene::Volume;

/// The layers of a material besides its base, and what modifies or replaces the base.
#[derive(Default)]
pub struct ExtensionLayers {
    pub clearcoat: Option<ClearcoatJson>,
    pub sheen: Option<SheenJson>,
    pub transmission: Option<TransmissionJson>,
    pub volume: Option<VolumeJson>,
    pub specular: Option<SpecularJson>,
    pub anisotropy: Option<AnisotropyJson>,
    pub specular_glossiness: Option<SpecularGlossinessJson>,
    /// `KHR_materials_unlit`
    pub unlit: bool,
}

/// `KHR_materials_specular`
#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct SpecularJson {
    specular_factor: f32,
    specular_texture: Option<Info>,
    specular_color_factor: [f32; 3],
    specular_color_texture: Option<Info>,
}

impl Default for SpecularJson {
    fn default() -> Self {
        Self {
            specular_factor: 1.0,
            specular_texture: None,
            specular_color_factor: [1.0; 3],
            specular_color_texture: None,
        }
    }
}

impl SpecularJson {
    /// The index of refraction with the same reflectance at normal incidence as index `ior` times the factors. A color
    /// contributes its luminance.
    pub fn ior(&self, ior: f32) -> f32 {
        let [r, g, b] = self.specular_color_factor.map(|x| x.max(0.0));
        let tint = 0.2126 * r + 0.7152 * g + 0.0722 * b;
        let f0 = ((ior - 1.0) / (ior + 1.0)).powi(2) * unit(self.specular_factor) * tint;
        // Glass of index 3 reflects a quarter; the extension clamps at one.
        let root = f0.min(0.9).sqrt();
        (1.0 + root) / (1.0 - root)
    }

    /// Whether a part of the extension is not shown: a texture, or a colored reflection.
    pub fn is_approximate(&self) -> bool {
        let [r, g, b] = self.specular_color_factor;
        self.specular_texture.is_some() || self.specular_color_texture.is_some() || r != g || g != b
    }
}

/// `KHR_materials_anisotropy`
#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
pub struct AnisotropyJson {
    anisotropy_strength: f32,
    anisotropy_texture: Option<Info>,
}

impl AnisotropyJson {
    /// The roughness of a round highlight as wide as the geometric mean of the two widths of the stretched one. Along
    /// the stretch the extension's α is `mix(α, 1, strength²)`, across it α, the square of the roughness.
    pub fn roughness(&self, roughness: f32) -> f32 {
        let across = roughness * roughness;
        let along = across + (1.0 - across) * unit(self.anisotropy_strength).powi(2);
        (along * across).sqrt().sqrt()
    }

    /// Whether the highlight is stretched at all.
    pub fn is_stretched(&self) -> bool {
        self.anisotropy_strength > 0.0
    }

    /// Whether the strength varies over the surface.
    pub fn is_textured(&self) -> bool {
        self.anisotropy_texture.is_some()
    }
}

/// `KHR_materials_clearcoat`
#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
pub struct ClearcoatJson {
    pub clearcoat_factor: f32,
    pub clearcoat_texture: Option<Info>,
    pub clearcoat_roughness_factor: f32,
    pub clearcoat_roughness_texture: Option<Info>,
    pub clearcoat_normal_texture: Option<NormalTexture>,
}

/// `KHR_materials_sheen`
#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
pub struct SheenJson {
    pub sheen_color_factor: [f32; 3],
    pub sheen_color_texture: Option<Info>,
    pub sheen_roughness_factor: f32,
    pub sheen_roughness_texture: Option<Info>,
}

/// `KHR_materials_transmission`
#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
pub struct TransmissionJson {
    pub transmission_factor: f32,
    pub transmission_texture: Option<Info>,
}

/// `KHR_materials_volume`
#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct VolumeJson {
    thickness_factor: f32,
    attenuation_distance: Option<f32>,
    attenuation_color: [f32; 3],
}

impl Default for VolumeJson {
    fn default() -> Self {
        Self { thickness_factor: 0.0, attenuation_distance: None, attenuation_color: [1.0; 3] }
    }
}

impl ExtensionLayers {
    /// The layers of a material.
    pub fn of(material: &json::Material) -> Result<Self> {
        let Some(extensions) = &material.extensions else {
            return Ok(Self::default());
        };
        Ok(Self {
            clearcoat: parse(extensions, "KHR_materials_clearcoat")?,
            sheen: parse(extensions, "KHR_materials_sheen")?,
            transmission: parse(extensions, "KHR_materials_transmission")?,
            volume: parse(extensions, "KHR_materials_volume")?,
            specular: parse(extensions, "KHR_materials_specular")?,
            anisotropy: parse(extensions, "KHR_materials_anisotropy")?,
            specular_glossiness: parse(extensions, "KHR_materials_pbrSpecularGlossiness")?,
            unlit: extensions.others.contains_key("KHR_materials_unlit"),
        })
    }

    /// The textures of all layers.
    pub fn uses(&self) -> Result<Vec<Use>> {
        let (coat, sheen) = (self.clearcoat.as_ref(), self.sheen.as_ref());
        let infos = [
            coat.and_then(|coat| coat.clearcoat_texture.as_ref()),
            coat.and_then(|coat| coat.clearcoat_roughness_texture.as_ref()),
            sheen.and_then(|sheen| sheen.sheen_color_texture.as_ref()),
            sheen.and_then(|sheen| sheen.sheen_roughness_texture.as_ref()),
            self.transmission.as_ref().and_then(|transmission| transmission.transmission_texture.as_ref()),
        ];
        let mut uses: Vec<Use> = infos.into_iter().flatten().map(of_info).collect();
        if let Some(normal) = coat.and_then(|coat| coat.clearcoat_normal_texture.as_ref()) {
            uses.push(of_normal(normal)?);
        }
        Ok(uses)
    }

    /// The interior medium; `None` for a thin wall. Ignores a distance that is not positive.
    pub fn medium(&self) -> Option<Volume> {
        let volume = self.volume.as_ref().filter(|volume| volume.thickness_factor > 0.0)?;
        Some(Volume {
            attenuation_color: volume.attenuation_color.map(unit),
            attenuation_distance_m: volume.attenuation_distance.filter(|x| *x > 0.0).unwrap_or(f32::INFINITY),
        })
    }
}

fn parse<T: DeserializeOwned>(extensions: &json::extensions::material::Material, name: &str) -> Result<Option<T>> {
    let json = extensions.others.get(name);
    let parsed = json.map(|json| serde_json::from_value(json.clone())).transpose();
    parsed.map_err(|error| within(Error::new(error.to_string()), name))
}

/// Clamps to [0, 1]; NaN becomes 0.
pub fn unit(x: f32) -> f32 {
    if x > 0.0 { x.min(1.0) } else { 0.0 }
}
