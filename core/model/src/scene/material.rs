//! Surface materials after glTF 2.0's metallic-roughness model (appendix B), as plain data.
//!
//! Every quantity is a constant factor times an optional texture, as in glTF.

use crate::digest::Digest;
use std::sync::Arc;

/// A picture that colours a surface: 8-bit RGBA, row 0 at the top.
#[derive(Debug, Clone)]
pub struct Texture {
    /// Width, texels.
    pub width: u32,
    /// Height, texels.
    pub height: u32,
    /// RGBA, row-major `[height, width, 4]`.
    pub texels: Vec<u8>,
    /// Whether the colour channels are sRGB-encoded or linear. Alpha is always linear.
    pub encoding: Encoding,
    /// What lies beyond the edges, along u and v.
    pub wrap: [Wrap; 2],
    /// Digest of the content.
    pub digest: Digest,
}

/// Meaning of colour texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// IEC 61966-2-1; decoded before filtering.
    Srgb,
    /// Used as they are.
    Linear,
}

/// Continuation of a texture beyond its edges.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// Tiles.
    Repeat,
    /// Tiles, every second one mirrored.
    Mirror,
    /// The edge texel goes on.
    Clamp,
}

/// A texture as a material uses it.
#[derive(Debug, Clone)]
pub struct TextureRef {
    /// The picture, shared between materials and instances.
    pub texture: Arc<Texture>,
    /// Moves texture coordinates before the look-up.
    pub transform: UvTransform,
}

impl From<Arc<Texture>> for TextureRef {
    fn from(texture: Arc<Texture>) -> Self {
        Self { texture, transform: UvTransform::default() }
    }
}

/// `uv ↦ rotate(uv · scale, rotation) + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UvTransform {
    /// Factor on u and v; 2 shows the picture twice.
    pub scale: [f32; 2],
    /// Counter-clockwise rotation in the (u, v) plane, v upwards, radians.
    pub rotation: f32,
    /// Added last.
    pub offset: [f32; 2],
}

impl Default for UvTransform {
    fn default() -> Self {
        Self { scale: [1.0; 2], rotation: 0.0, offset: [0.0; 2] }
    }
}

/// A colour: factor times texture. Linear Rec. 709 in [0, 1].
#[derive(Debug, Clone)]
pub struct Color {
    /// Linear factor.
    pub factor: [f32; 3],
    /// Multiplied in after decoding.
    pub texture: Option<TextureRef>,
}

impl Color {
    /// The same colour everywhere.
    pub fn constant(factor: [f32; 3]) -> Self {
        Self { factor, texture: None }
    }

    /// A picture.
    pub fn texture(texture: Arc<Texture>) -> Self {
        Self { factor: [1.0; 3], texture: Some(texture.into()) }
    }
}

/// A number in [0, 1]: factor times one channel of a texture.
#[derive(Debug, Clone)]
pub struct Scalar {
    /// Factor.
    pub factor: f32,
    /// Texture and the channel to read: 0 red … 3 alpha.
    pub texture: Option<(TextureRef, u8)>,
}

impl Scalar {
    /// The same number everywhere.
    pub fn constant(factor: f32) -> Self {
        Self { factor, texture: None }
    }

    /// One channel of a picture.
    pub fn texture(texture: Arc<Texture>, channel: u8) -> Self {
        Self { factor: 1.0, texture: Some((texture.into(), channel)) }
    }
}

/// A tangent-space normal map in the OpenGL convention: green points along +v.
#[derive(Debug, Clone)]
pub struct NormalMap {
    /// The map; linear.
    pub map: TextureRef,
    /// Factor on the x and y components.
    pub strength: f32,
}

/// How alpha, from the base colour's texture, is understood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Alpha {
    /// Ignored.
    Opaque,
    /// Below the cutoff there is no surface, for pictures and for labels alike.
    Mask {
        /// Cutoff in [0, 1].
        cutoff: f32,
    },
}

/// A surface material. Surfaces are two-sided.
#[derive(Debug, Clone)]
pub struct Material {
    /// Name within its source.
    pub name: String,
    /// Base colour: diffuse albedo of a dielectric, reflectance of a metal at normal incidence.
    pub base_color: Color,
    /// Perceptual roughness; GGX α is its square.
    pub roughness: Scalar,
    /// 0 for dielectrics, 1 for metals.
    pub metallic: Scalar,
    /// Surface detail.
    pub normal: Option<NormalMap>,
    /// Emitted radiance, nits; the factor may exceed one.
    pub emission: Color,
    /// Index of refraction of the dielectric; 1.5 reflects 4 % at normal incidence.
    pub ior: f32,
    /// Cut-outs.
    pub alpha: Alpha,
    /// Edge length of one tile of the textures when they are laid by metres rather than by uv, metres.
    pub tile_m: f32,
    /// Licence as an SPDX expression or name; empty if unknown.
    pub licence: String,
    /// Digest of everything above but the name.
    pub digest: Digest,
}

impl Material {
    /// A smooth-coloured dielectric.
    pub fn plain(name: impl Into<String>, color: [f32; 3], roughness: f32) -> Self {
        let digest = crate::digest::Hasher::new("plain material")
            .floats(color.into_iter())
            .number(f64::from(roughness))
            .finish();
        Self {
            name: name.into(),
            base_color: Color::constant(color),
            roughness: Scalar::constant(roughness),
            metallic: Scalar::constant(0.0),
            normal: None,
            emission: Color::constant([0.0; 3]),
            ior: 1.5,
            alpha: Alpha::Opaque,
            tile_m: 1.0,
            licence: String::new(),
            digest,
        }
    }
}

/// A material laid over a whole body, in place of its own.
#[derive(Debug, Clone)]
pub struct Surface {
    /// The material.
    pub material: Arc<Material>,
    /// How its textures are laid.
    pub mapping: TextureMapping,
}

/// How textures are laid on a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TextureMapping {
    /// By the mesh's texture coordinates, moved first.
    Uv(UvTransform),
    /// By the body's own axes: each face takes the two axes at right angles to its dominant normal axis, scaled by
    /// the material's [`tile_m`](Material::tile_m) and rotated.
    Box {
        /// Rotation of the picture, radians.
        rotation: f32,
        /// Shift in tiles.
        offset: [f32; 2],
    },
}
