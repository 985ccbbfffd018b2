//! The subset of glTF 2.0 that the writer uses, as types. Names and defaults match the standard.

use serde::Serialize;
use serde_json::Value as Json;
use std::collections::BTreeSet;
use syntable_model::geometry::Pose;

/// An index into one of the document's lists.
pub type Index = usize;

/// Whether a list is omitted: the standard does not allow empty lists.
fn none<T>(items: &[T]) -> bool {
    items.is_empty()
}

/// The JSON of a file.
#[derive(Debug, Clone, Default, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Document {
    pub asset: GltfAsset,
    #[serde(skip_serializing_if = "BTreeSet::is_empty")]
    pub extensions_used: BTreeSet<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extensions: Option<DocumentExtensions>,
    pub scene: Index,
    pub scenes: Vec<GltfSceneEntry>,
    pub nodes: Vec<GltfNode>,
    #[serde(skip_serializing_if = "none")]
    pub cameras: Vec<GltfCamera>,
    #[serde(skip_serializing_if = "none")]
    pub meshes: Vec<GltfMesh>,
    #[serde(skip_serializing_if = "none")]
    pub materials: Vec<GltfMaterial>,
    #[serde(skip_serializing_if = "none")]
    pub textures: Vec<GltfTexture>,
    #[serde(skip_serializing_if = "none")]
    pub images: Vec<GltfImage>,
    #[serde(skip_serializing_if = "none")]
    pub samplers: Vec<GltfSampler>,
    #[serde(skip_serializing_if = "none")]
    pub accessors: Vec<Accessor>,
    #[serde(skip_serializing_if = "none")]
    pub buffer_views: Vec<BufferView>,
    #[serde(skip_serializing_if = "none")]
    pub buffers: Vec<Buffer>,
}

#[derive(Debug, Clone, Default, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct GltfAsset {
    pub version: &'static str,
    pub generator: String,
    #[serde(skip_serializing_if = "String::is_empty")]
    pub copyright: String,
}

#[derive(Debug, Clone, Default, Serialize)]
pub struct DocumentExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    pub lights_punctual: PunctualLights,
}

#[derive(Debug, Clone, Default, Serialize)]
pub struct PunctualLights {
    pub lights: Vec<PunctualLight>,
}

#[derive(Debug, Clone, Serialize)]
pub struct PunctualLight {
    pub name: String,
    #[serde(rename = "type")]
    pub kind: &'static str,
    pub color: [f64; 3],
    pub intensity: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spot: Option<Spot>,
}

#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Spot {
    pub inner_cone_angle: f64,
    pub outer_cone_angle: f64,
}

#[derive(Debug, Clone, Default, Serialize)]
pub struct GltfSceneEntry {
    pub name: String,
    pub nodes: Vec<Index>,
    pub extras: Json,
}

#[derive(Debug, Clone, Default, Serialize)]
pub struct GltfNode {
    pub name: String,
    #[serde(skip_serializing_if = "none")]
    pub children: Vec<Index>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub matrix: Option<[f64; 16]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub translation: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation: Option<[f64; 4]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh: Option<Index>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<Index>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extensions: Option<NodeExtensions>,
    #[serde(skip_serializing_if = "Json::is_null")]
    pub extras: Json,
}

#[derive(Debug, Clone, Serialize)]
pub struct NodeExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    pub lights_punctual: NodeLight,
}

#[derive(Debug, Clone, Serialize)]
pub struct NodeLight {
    pub light: Index,
}

#[derive(Debug, Clone, Serialize)]
pub struct GltfCamera {
    pub name: String,
    #[serde(rename = "type")]
    pub kind: &'static str,
    pub perspective: Perspective,
    pub extras: Json,
}

#[derive(Debug, Clone, Serialize)]
pub struct Perspective {
    #[serde(rename = "aspectRatio")]
    pub aspect_ratio: f64,
    pub yfov: f64,
    pub znear: f64,
}

#[derive(Debug, Clone, Serialize)]
pub struct GltfMesh {
    pub name: String,
    pub primitives: Vec<GltfPrimitive>,
}

#[derive(Debug, Clone, Serialize)]
pub struct GltfPrimitive {
    pub attributes: GltfAttributes,
    pub indices: Index,
    pub material: Index,
}

#[derive(Debug, Clone, Default, Serialize)]
pub struct GltfAttributes {
    #[serde(rename = "POSITION")]
    pub position: Index,
    #[serde(rename = "NORMAL", skip_serializing_if = "Option::is_none")]
    pub normal: Option<Index>,
    #[serde(rename = "TANGENT", skip_serializing_if = "Option::is_none")]
    pub tangent: Option<Index>,
    #[serde(rename = "TEXCOORD_0", skip_serializing_if = "Option::is_none")]
    pub texcoord: Option<Index>,
    #[serde(rename = "COLOR_0", skip_serializing_if = "Option::is_none")]
    pub color: Option<Index>,
}

#[derive(Debug, Clone, Default, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct GltfMaterial {
    pub name: String,
    pub pbr_metallic_roughness: Pbr,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normal_texture: Option<TextureInfo>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub emissive_texture: Option<TextureInfo>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub emissive_factor: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha_mode: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha_cutoff: Option<f32>,
    pub double_sided: bool,
    #[serde(skip_serializing_if = "MaterialExtensions::is_empty")]
    pub extensions: MaterialExtensions,
    #[serde(skip_serializing_if = "Json::is_null")]
    pub extras: Json,
}

#[derive(Debug, Clone, Default, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Pbr {
    pub base_color_factor: [f32; 4],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_color_texture: Option<TextureInfo>,
    pub metallic_factor: f32,
    pub roughness_factor: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metallic_roughness_texture: Option<TextureInfo>,
}

#[derive(Debug, Clone, Default, Serialize)]
pub struct MaterialExtensions {
    #[serde(rename = "KHR_materials_clearcoat", skip_serializing_if = "Option::is_none")]
    pub clearcoat: Option<GltfClearcoat>,
    #[serde(rename = "KHR_materials_sheen", skip_serializing_if = "Option::is_none")]
    pub sheen: Option<GltfSheen>,
    #[serde(rename = "KHR_materials_transmission", skip_serializing_if = "Option::is_none")]
    pub transmission: Option<GltfTransmission>,
    #[serde(rename = "KHR_materials_volume", skip_serializing_if = "Option::is_none")]
    pub volume: Option<GltfVolume>,
    #[serde(rename = "KHR_materials_ior", skip_serializing_if = "Option::is_none")]
    pub ior: Option<Ior>,
    #[serde(rename = "KHR_materials_emissive_strength", skip_serializing_if = "Option::is_none")]
    pub emissive_strength: Option<EmissiveStrength>,
}

impl MaterialExtensions {
    fn is_empty(&self) -> bool {
        self.names().is_empty()
    }

    /// Names of the extensions in use.
    pub fn names(&self) -> Vec<&'static str> {
        [
            ("KHR_materials_clearcoat", self.clearcoat.is_some()),
            ("KHR_materials_sheen", self.sheen.is_some()),
            ("KHR_materials_transmission", self.transmission.is_some()),
            ("KHR_materials_volume", self.volume.is_some()),
            ("KHR_materials_ior", self.ior.is_some()),
            ("KHR_materials_emissive_strength", self.emissive_strength.is_some()),
        ]
        .into_iter()
        .filter_map(|(name, there)| there.then_some(name))
        .collect()
    }
}

#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct GltfClearcoat {
    pub clearcoat_factor: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clearcoat_texture: Option<TextureInfo>,
    pub clearcoat_roughness_factor: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clearcoat_roughness_texture: Option<TextureInfo>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clearcoat_normal_texture: Option<TextureInfo>,
}

#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct GltfSheen {
    pub sheen_color_factor: [f32; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sheen_color_texture: Option<TextureInfo>,
    pub sheen_roughness_factor: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sheen_roughness_texture: Option<TextureInfo>,
}

#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct GltfTransmission {
    pub transmission_factor: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transmission_texture: Option<TextureInfo>,
}

#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct GltfVolume {
    pub thickness_factor: f32,
    pub attenuation_color: [f32; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attenuation_distance: Option<f32>,
}

#[derive(Debug, Clone, Serialize)]
pub struct Ior {
    pub ior: f32,
}

#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct EmissiveStrength {
    pub emissive_strength: f32,
}

#[derive(Debug, Clone, Serialize)]
pub struct TextureInfo {
    pub index: Index,
    /// Strength; only for normal maps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extensions: Option<TextureInfoExtensions>,
}

#[derive(Debug, Clone, Serialize)]
pub struct TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub texture_transform: TextureTransform,
}

#[derive(Debug, Clone, Serialize)]
pub struct TextureTransform {
    pub offset: [f32; 2],
    pub rotation: f32,
    pub scale: [f32; 2],
}

#[derive(Debug, Clone, Serialize)]
pub struct GltfTexture {
    pub sampler: Index,
    pub source: Index,
}

#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct GltfImage {
    pub buffer_view: Index,
    pub mime_type: &'static str,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct GltfSampler {
    pub mag_filter: u32,
    pub min_filter: u32,
    pub wrap_s: u32,
    pub wrap_t: u32,
}

#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Accessor {
    pub buffer_view: Index,
    pub component_type: u32,
    pub count: usize,
    #[serde(rename = "type")]
    pub kind: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max: Option<[f32; 3]>,
}

#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct BufferView {
    pub buffer: Index,
    pub byte_offset: usize,
    pub byte_length: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<u32>,
}

#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Buffer {
    pub byte_length: usize,
}

impl GltfNode {
    /// A node at a pose.
    pub fn at(name: String, pose: &Pose) -> Self {
        Self {
            name,
            translation: Some(pose.translation.vector.into()),
            rotation: Some(pose.rotation.coords.into()),
            ..Self::default()
        }
    }
}
