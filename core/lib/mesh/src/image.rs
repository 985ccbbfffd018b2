//! Images for textures: 8 bits per channel, identified by their content, not by their name.

use syntable_model::digest::Hasher;
use syntable_model::scene::{Encoding, Texture, Wrap};

/// Maximum width and height, pixels.
pub const MAX_SIDE: u64 = 16_384;

/// An 8-bit RGBA image, row 0 at the top.
#[derive(Debug, Clone)]
pub struct DecodedImage {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// RGBA, row-major `[height, width, 4]`.
    pub texels: Vec<u8>,
    /// Format, channels and bit depth of the file, such as `PNG Rgb16`.
    pub kind: String,
}

impl DecodedImage {
    /// Inverts the green channel: converts normal maps between the DirectX and the OpenGL convention.
    pub fn flip_green(&mut self) {
        for texel in self.texels.chunks_exact_mut(4) {
            texel[1] = 255 - texel[1];
        }
    }

    /// Mean of every channel in [0, 1], as encoded.
    pub fn mean(&self) -> [f64; 4] {
        let count = f64::from(self.width) * f64::from(self.height) * 255.0;
        let mut sums = [0_u64; 4];
        for texel in self.texels.chunks_exact(4) {
            for (sum, &value) in sums.iter_mut().zip(texel) {
                *sum += u64::from(value);
            }
        }
        sums.map(|sum| sum as f64 / count)
    }

    /// Whether any pixel is not opaque.
    pub fn has_alpha(&self) -> bool {
        self.texels.chunks_exact(4).any(|texel| texel[3] != 255)
    }

    /// Converts the image to a texture.
    pub fn into_texture(self, encoding: Encoding, wrap: [Wrap; 2]) -> Texture {
        let Self { width, height, texels, .. } = self;
        let digest = Hasher::new("texture")
            .number(width.into())
            .number(height.into())
            .bytes(&[encoding as u8, wrap[0] as u8, wrap[1] as u8])
            .bytes(&texels)
            .finish();
        Texture { width, height, texels, encoding, wrap, digest }
    }
}
