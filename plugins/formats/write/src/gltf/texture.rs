//! Images, embedded as PNG, each image once.

use super::document::{
    GltfImage, GltfSampler, GltfTexture, Index, TextureInfo, TextureInfoExtensions, TextureTransform,
};
use super::glb::Glb;
use std::borrow::Cow;
use std::collections::BTreeMap;
use syntable_formats::encode::png::{self, PngSamples};
use syntable_model::color::{linear_to_srgb, srgb_to_linear};
use syntable_model::digest::{Digest, Hasher};
use syntable_model::error::Result;
use syntable_model::scene::{ColorMatrix, Encoding, Texture, TextureRef, UvTransform, Wrap};

const LINEAR: u32 = 9_729;
const LINEAR_MIPMAP_LINEAR: u32 = 9_987;

/// One channel of a texture.
pub type TextureChannel<'a> = (&'a TextureRef, u8);

/// The images and textures of a file.
#[derive(Debug, Clone, Default)]
pub struct Textures {
    images: BTreeMap<Digest, Index>,
    textures: BTreeMap<(Index, Index), Index>,
}

impl Textures {
    /// Adds a texture with its colors in the given encoding.
    pub fn texture(&mut self, glb: &mut Glb, used: &TextureRef, encoding: Encoding) -> Result<TextureInfo> {
        let texture = &*used.texture;
        let key = Hasher::new("texture").digest(texture.digest).bytes(&[encoding as u8]).finish();
        self.info(glb, key, used, || png::PngImage {
            width: texture.width,
            height: texture.height,
            samples: samples(encoded(texture, encoding)),
        })
    }

    /// Adds a texture whose colors, times a factor, are changed by a matrix.
    pub fn recolored(
        &mut self,
        glb: &mut Glb,
        used: &TextureRef,
        factor: [f32; 3],
        matrix: &ColorMatrix,
    ) -> Result<TextureInfo> {
        let texture = &*used.texture;
        let key = Hasher::new("recolored").digest(texture.digest).floats(factor.into_iter());
        let key = key.floats(matrix.0.as_flattened().iter().copied()).finish();
        self.info(glb, key, used, || {
            let linear: [f32; 256] = std::array::from_fn(|code| match texture.encoding {
                Encoding::Linear => code as f32 / 255.0,
                Encoding::Srgb => srgb_to_linear(code as f32 / 255.0),
            });
            let texels = texture.texels.chunks_exact(4).flat_map(|texel| {
                let color = std::array::from_fn(|channel| factor[channel] * linear[usize::from(texel[channel])]);
                let [r, g, b] = matrix.apply(color).map(|x| (linear_to_srgb(x) * 255.0).round() as u8);
                [r, g, b, texel[3]]
            });
            let samples = samples(Cow::Owned(texels.collect()));
            png::PngImage { width: texture.width, height: texture.height, samples }
        })
    }

    /// Adds a texture whose channels come from other textures; a channel without a source is white. A texture that
    /// already has the right channels is used unchanged; otherwise a new image is packed, as large as the largest
    /// source. The transform of the first source applies.
    pub fn packed(&mut self, glb: &mut Glb, channels: [Option<TextureChannel<'_>>; 4]) -> Result<Option<TextureInfo>> {
        let Some((first, _)) = channels.iter().flatten().next() else { return Ok(None) };
        let ready = |(target, channel): (usize, &Option<TextureChannel<'_>>)| match channel {
            Some((used, channel)) => {
                usize::from(*channel) == target
                    && used.texture.digest == first.texture.digest
                    && (used.texture.encoding == Encoding::Linear || target == 3)
            }
            None => true,
        };
        if channels.iter().enumerate().all(ready) {
            return self.texture(glb, first, first.texture.encoding).map(Some);
        }
        let mut hasher = Hasher::new("packed");
        for channel in &channels {
            hasher = match channel {
                Some((used, channel)) => hasher.digest(used.texture.digest).bytes(&[*channel]),
                None => hasher.text("white"),
            };
        }
        let pack = || {
            let side = |side: fn(&Texture) -> u32| channels.iter().flatten().map(|(used, _)| side(&used.texture)).max();
            let (width, height) = (side(|t| t.width).unwrap_or(1), side(|t| t.height).unwrap_or(1));
            let mut texels = vec![255_u8; 4 * width as usize * height as usize];
            for (target, channel) in channels.iter().enumerate() {
                let Some((used, channel)) = channel else { continue };
                let texture = &*used.texture;
                let from = encoded(texture, Encoding::Linear);
                let scaled = |at: u32, from: u32, to: u32| (u64::from(at) * u64::from(from) / u64::from(to)) as usize;
                for (i, texel) in texels.chunks_exact_mut(4).enumerate() {
                    let (x, y) = (i as u32 % width, i as u32 / width);
                    let (x, y) = (scaled(x, texture.width, width), scaled(y, texture.height, height));
                    texel[target] = from[4 * (y * texture.width as usize + x) + usize::from((*channel).min(3))];
                }
            }
            png::PngImage { width, height, samples: samples(Cow::Owned(texels)) }
        };
        self.info(glb, hasher.finish(), first, pack).map(Some)
    }

    fn info(
        &mut self,
        glb: &mut Glb,
        key: Digest,
        used: &TextureRef,
        image: impl FnOnce() -> png::PngImage,
    ) -> Result<TextureInfo> {
        let source = match self.images.get(&key) {
            Some(&image) => image,
            None => {
                let buffer_view = glb.view(image().encode()?, None);
                glb.document.images.push(GltfImage { buffer_view, mime_type: "image/png" });
                self.images.insert(key, glb.document.images.len() - 1);
                glb.document.images.len() - 1
            }
        };
        let [wrap_s, wrap_t] = used.texture.wrap.map(|wrap| match wrap {
            Wrap::Repeat => 10_497,
            Wrap::Mirror => 33_648,
            Wrap::Clamp => 33_071,
        });
        let wanted = GltfSampler { mag_filter: LINEAR, min_filter: LINEAR_MIPMAP_LINEAR, wrap_s, wrap_t };
        let samplers = &mut glb.document.samplers;
        let sampler = samplers.iter().position(|sampler| *sampler == wanted).unwrap_or_else(|| {
            samplers.push(wanted);
            samplers.len() - 1
        });
        let textures = &mut glb.document.textures;
        let index = *self.textures.entry((sampler, source)).or_insert_with(|| {
            textures.push(GltfTexture { sampler, source });
            textures.len() - 1
        });
        let extensions = transform(&used.transform).map(|texture_transform| {
            glb.document.extensions_used.insert("KHR_texture_transform");
            TextureInfoExtensions { texture_transform }
        });
        Ok(TextureInfo { index, scale: None, extensions })
    }
}

/// Converts a texture transform with v up to KHR_texture_transform, with v down; none for the identity.
///
/// In KHR_texture_transform, `u' = c·sx·u + s·sy·V + ox` and `V' = -s·sx·u + c·sy·V + oy`. With `V = 1 - v`, the
/// rotation stays and the offset `(x, y)` becomes `(x - s·sy, 1 - y - c·sy)`.
fn transform(uv: &UvTransform) -> Option<TextureTransform> {
    if *uv == UvTransform::default() {
        return None;
    }
    let sane = |x: f32, or: f32| if x.is_finite() { x } else { or };
    let ([sx, sy], rotation) = (uv.scale.map(|x| sane(x, 1.0)), sane(uv.rotation, 0.0));
    let [x, y] = uv.offset.map(|x| sane(x, 0.0));
    let (s, c) = libm::sincos(f64::from(rotation));
    let (s, c) = (s as f32, c as f32);
    Some(TextureTransform { offset: [x - s * sy, 1.0 - y - c * sy], rotation, scale: [sx, sy] })
}

/// Texels with their colors in the given encoding.
fn encoded(texture: &Texture, wanted: Encoding) -> Cow<'_, [u8]> {
    if texture.encoding == wanted {
        return Cow::Borrowed(&texture.texels);
    }
    let code: Vec<u8> = (0..=255_u8)
        .map(|value| f64::from(value) / 255.0)
        .map(|x| match wanted {
            Encoding::Linear => srgb_to_linear(x),
            Encoding::Srgb => linear_to_srgb(x),
        })
        .map(|x| (x * 255.0).round() as u8)
        .collect();
    let texels = texture.texels.chunks_exact(4);
    Cow::Owned(
        texels
            .flat_map(|t| [code[usize::from(t[0])], code[usize::from(t[1])], code[usize::from(t[2])], t[3]])
            .collect(),
    )
}

/// Texels as RGB if all are opaque, otherwise as RGBA.
fn samples(texels: Cow<'_, [u8]>) -> PngSamples {
    if texels.chunks_exact(4).all(|texel| texel[3] == 255) {
        PngSamples::Rgb8(texels.chunks_exact(4).flat_map(|texel| [texel[0], texel[1], texel[2]]).collect())
    } else {
        PngSamples::Rgba8(texels.into_owned())
    }
}

/// Mean of a channel, as a linear value in [0, 1].
pub fn mean((used, channel): TextureChannel<'_>) -> f32 {
    let texels = encoded(&used.texture, Encoding::Linear);
    let channel = usize::from(channel.min(3));
    let sum: u64 = texels.chunks_exact(4).map(|texel| u64::from(texel[channel])).sum();
    (sum as f64 / (texels.len() as f64 / 4.0 * 255.0)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transforms_agree_with_the_extension_when_v_is_flipped() {
        let uv = UvTransform { scale: [2.0, -1.5], rotation: 0.7, offset: [0.2, -0.3] };
        let there = transform(&uv).expect("not the identity");
        let (s, c) = there.rotation.sin_cos();
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.3, 0.8)] {
            let (x, y) = (u * uv.scale[0], v * uv.scale[1]);
            let want = [c * x - s * y + uv.offset[0], s * x + c * y + uv.offset[1]];
            let (x, y) = (u * there.scale[0], (1.0 - v) * there.scale[1]);
            let got = [c * x + s * y + there.offset[0], 1.0 - (-s * x + c * y + there.offset[1])];
            assert!((got[0] - want[0]).abs() < 1e-5 && (got[1] - want[1]).abs() < 1e-5, "{got:?} {want:?}");
        }
        assert!(transform(&UvTransform::default()).is_none());
    }
}
