//! How a material uses a texture: the texture, the set of coordinates and their transform.

use gltf::json::extensions::texture::{TextureTransform, TextureTransformOffset};
use gltf::json::texture::Info;
use gltf::json::{self, Index};
use syntable_model::error::{Error, Result};
use syntable_model::scene::UvTransform;

/// A reference to a texture with its coordinates.
#[derive(Clone)]
pub struct Use {
    /// The texture.
    pub texture: Index<json::Texture>,
    /// Set of texture coordinates.
    pub set: u32,
    /// Transform of the coordinates.
    pub transform: UvTransform,
}

/// How a texture is used.
pub fn of_info(info: &Info) -> Use {
    let transform = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.as_ref());
    of(info.index, info.tex_coord, transform)
}

/// How a normal map is used: the library parses the transform of all textures but the normal map's.
pub fn of_normal(normal: &json::material::NormalTexture) -> Result<Use> {
    let json = normal.extensions.as_ref().and_then(|extensions| extensions.others.get("KHR_texture_transform"));
    let transform: Option<TextureTransform> = json
        .map(|json| serde_json::from_value(json.clone()))
        .transpose()
        .map_err(|error| Error::new(format!("KHR_texture_transform of the normal map: {error}")))?;
    Ok(of(normal.index, normal.tex_coord, transform.as_ref()))
}

fn of(texture: Index<json::Texture>, set: u32, transform: Option<&TextureTransform>) -> Use {
    let Some(transform) = transform else {
        return Use { texture, set, transform: UvTransform::default() };
    };
    let TextureTransformOffset(offset) = transform.offset;
    Use {
        texture,
        set: transform.tex_coord.unwrap_or(set),
        transform: v_up(offset, transform.rotation.0, transform.scale.0),
    }
}

/// Converts a transform of KHR_texture_transform from v downwards to v upwards.
///
/// There `u' = c·sx·u + s·sy·v + ox` and `v' = -s·sx·u + c·sy·v + oy`, counter-clockwise in the image;
/// with `v = 1 - V` the same rotation stays, and the offset becomes `(ox + s·sy, 1 - oy - c·sy)`.
fn v_up([ox, oy]: [f32; 2], rotation: f32, [sx, sy]: [f32; 2]) -> UvTransform {
    let (s, c) = libm::sincosf(rotation);
    UvTransform { scale: [sx, sy], rotation, offset: [ox + s * sy, 1.0 - oy - c * sy] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transforms_agree_with_the_extension_when_v_is_turned_over() {
        for (offset, rotation, scale) in
            [([0.0, 0.0], 0.0, [3.0, 3.0]), ([0.0, 1.0], 1.570_796_4, [0.5, 0.5]), ([0.2, -0.3], 0.7, [2.0, -1.5])]
        {
            let ours = v_up(offset, rotation, scale);
            let (s, c) = rotation.sin_cos();
            for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.3, 0.8)] {
                let want_u = c * scale[0] * u + s * scale[1] * v + offset[0];
                let want_v = -s * scale[0] * u + c * scale[1] * v + offset[1];
                let (x, y) = (u * ours.scale[0], (1.0 - v) * ours.scale[1]);
                let got_u = c * x - s * y + ours.offset[0];
                let got_v = 1.0 - (s * x + c * y + ours.offset[1]);
                assert!((got_u - want_u).abs() < 1e-5 && (got_v - want_v).abs() < 1e-5, "{u} {v}");
            }
        }
        // The extension's own example: the lower left quarter of the image.
        let quarter = v_up([0.0, 1.0], 1.570_796_4, [0.5, 0.5]);
        let (s, c) = quarter.rotation.sin_cos();
        for (u, v) in [(0.1, 0.1), (0.9, 0.2), (0.5, 0.9)] {
            let (x, y) = (u * 0.5, v * 0.5);
            let at = [c * x - s * y + quarter.offset[0], s * x + c * y + quarter.offset[1]];
            assert!(at.iter().all(|x| (0.0..=0.5).contains(x)), "{at:?}");
        }
    }
}
