//! Textures, and how materials use them.

use crate::digest::Digest;
use std::sync::Arc;

/// An image that colors a surface: 8-bit RGBA, row 0 at the top.
#[derive(Debug, Clone)]
pub struct Texture {
    /// Width, texels.
    pub width: u32,
    /// Height, texels.
    pub height: u32,
    /// RGBA, row-major `[height, width, 4]`.
    pub texels: Vec<u8>,
    /// Whether the color channels are sRGB-encoded or linear. Alpha is always linear.
    pub encoding: Encoding,
    /// Continuation beyond the edges, along u and v.
    pub wrap: [Wrap; 2],
    /// Digest of the content.
    pub digest: Digest,
}

/// Meaning of color texels.
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
    /// The edge texel repeats.
    Clamp,
}

/// A texture as a material uses it.
#[derive(Debug, Clone)]
pub struct TextureRef {
    /// The texture, shared between materials and instances.
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
    /// Factor on u and v; 2 repeats the texture twice.
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
