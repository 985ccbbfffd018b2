//! Textures: 8-bit texels with their mip levels, filtered bilinearly in linear light.
//!
//! The finest level is the texture of the scene, shared; coarser levels halve it (odd sizes round down) with a box
//! filter, in linear light, and are kept in the encoding of the texture. A look-up decodes four texels by table.

use std::sync::{Arc, LazyLock};
use syntable_model::color::srgb_to_linear;
use syntable_model::digest::Digest;
use syntable_model::scene::{Encoding, Texture, Wrap};
use syntable_simd::functions::{floor, log2_rough};
use syntable_simd::{Rgb, vec3};

/// A texture with its mip levels, row 0 at the top.
#[derive(Debug)]
pub struct MipTexture {
    base: Arc<Texture>,
    /// Texels of the coarser levels, one level after the other.
    coarse: Vec<[u8; 4]>,
    levels: Vec<MipLevel>,
    decode: &'static [f32; 256],
}

/// Size of a mip level.
#[derive(Clone, Copy, Debug)]
pub struct MipLevel {
    /// Width, texels.
    pub width: u32,
    /// Height, texels.
    pub height: u32,
    /// Position of the first texel in `coarse`, or [`FINEST`].
    start: usize,
}

/// Marks the level with the texels of the scene's texture.
const FINEST: usize = usize::MAX;

/// sRGB and linear decoding of 8 bits to [0, 1].
static DECODE: LazyLock<[[f32; 256]; 2]> = LazyLock::new(|| {
    let plain = std::array::from_fn(|i| i as f32 / 255.0);
    let srgb = std::array::from_fn(|i| srgb_to_linear(i as f64 / 255.0) as f32);
    [srgb, plain]
});

/// Decoded values of the 8-bit codes.
pub fn decoding(encoding: Encoding) -> &'static [f32; 256] {
    &DECODE[match encoding {
        Encoding::Srgb => 0,
        Encoding::Linear => 1,
    }]
}

impl MipTexture {
    /// Computes the coarser levels. A texture without texels, or with a wrong number of texels, is white.
    pub fn new(texture: &Arc<Texture>) -> Self {
        let (width, height) = (texture.width, texture.height);
        let sound = width > 0 && height > 0 && texture.texels.len() == width as usize * height as usize * 4;
        let base = if sound {
            texture.clone()
        } else {
            Arc::new(Texture { width: 1, height: 1, texels: vec![255; 4], ..Texture::clone(texture) })
        };
        let decode = decoding(base.encoding);
        let mut mips = Self {
            levels: vec![MipLevel { width: base.width, height: base.height, start: FINEST }],
            base,
            coarse: Vec::new(),
            decode,
        };
        while let Some(&last) = mips.levels.last()
            && (last.width > 1 || last.height > 1)
        {
            mips.halve(last);
        }
        mips
    }

    fn halve(&mut self, from: MipLevel) {
        let (width, height) = ((from.width / 2).max(1), (from.height / 2).max(1));
        let start = self.coarse.len();
        let span = |i: u32, n: u32, whole: u32| (i * whole / n)..(((i + 1) * whole).div_ceil(n)).min(whole);
        for y in 0..height {
            for x in 0..width {
                let (mut sum, mut count) = ([0.0_f32; 4], 0.0_f32);
                for sy in span(y, height, from.height) {
                    for sx in span(x, width, from.width) {
                        let texel = self.texels(from)[sy as usize * from.width as usize + sx as usize];
                        for c in 0..3 {
                            sum[c] += self.decode[usize::from(texel[c])];
                        }
                        sum[3] += f32::from(texel[3]) / 255.0;
                        count += 1.0;
                    }
                }
                let mean = sum.map(|s| s / count);
                let encode = |v: f32| nearest(self.decode, v);
                let texel = [encode(mean[0]), encode(mean[1]), encode(mean[2]), (mean[3] * 255.0 + 0.5) as u8];
                self.coarse.push(texel);
            }
        }
        self.levels.push(MipLevel { width, height, start });
    }

    /// Digest of the texture.
    pub fn digest(&self) -> Digest {
        self.base.digest
    }

    /// Size in memory, bytes, including the finest level.
    pub fn size(&self) -> usize {
        self.base.texels.len() + size_of_val(&self.coarse[..])
    }

    /// Half the base-2 logarithm of the number of texels of the finest level.
    pub fn log2_size(&self) -> f32 {
        0.5 * log2_rough(self.base.width as f32 * self.base.height as f32)
    }

    /// Levels, the finest first.
    pub fn levels(&self) -> &[MipLevel] {
        &self.levels
    }

    /// Whether color texels are sRGB-encoded. Alpha is always linear.
    pub fn encoding(&self) -> Encoding {
        self.base.encoding
    }

    /// Continuation beyond the edges, along u and v.
    pub fn wrap(&self) -> [Wrap; 2] {
        self.base.wrap
    }

    /// RGBA texels of a level, row by row, in the texture's encoding. Texels of the next levels may follow.
    #[inline(always)]
    pub fn texels(&self, level: MipLevel) -> &[[u8; 4]] {
        match level.start {
            FINEST => self.base.texels.as_chunks().0,
            start => &self.coarse[start..],
        }
    }

    /// The four texels around (u, v), v upwards, and the weights of the right and lower ones. `level` counts from the
    /// finest, 0, and is rounded.
    #[inline(always)]
    fn footprint(&self, [u, v]: [f32; 2], level: f32) -> ([[u8; 4]; 4], f32, f32) {
        let number = if level > 0.0 { ((level + 0.5) as usize).min(self.levels.len() - 1) } else { 0 };
        let level = self.levels[number];
        let (x0, x1, wx) = axis(u, level.width, self.base.wrap[0]);
        let (y0, y1, wy) = axis(1.0 - v, level.height, self.base.wrap[1]);
        let texels = self.texels(level);
        let (upper, lower) = (y0 as usize * level.width as usize, y1 as usize * level.width as usize);
        let taps = [upper + x0 as usize, upper + x1 as usize, lower + x0 as usize, lower + x1 as usize];
        let taps = taps.map(|index| texels[index]);
        (taps, wx, wy)
    }

    /// Linear color at (u, v).
    #[inline]
    pub fn color(&self, uv: [f32; 2], level: f32) -> Rgb {
        let (taps, wx, wy) = self.footprint(uv, level);
        let [a, b, c, d] = taps.map(|t| {
            vec3(self.decode[usize::from(t[0])], self.decode[usize::from(t[1])], self.decode[usize::from(t[2])])
        });
        a.lerp(b, wx).lerp(c.lerp(d, wx), wy)
    }

    /// One channel at (u, v): 0 red … 3 alpha. Alpha is never sRGB-encoded.
    #[inline]
    pub fn channel(&self, uv: [f32; 2], level: f32, channel: u8) -> f32 {
        let (taps, wx, wy) = self.footprint(uv, level);
        let channel = usize::from(channel & 3);
        let decode = if channel == 3 { &DECODE[1] } else { self.decode };
        let [a, b, c, d] = taps.map(|t| decode[usize::from(t[channel])]);
        let (top, bottom) = (a + (b - a) * wx, c + (d - c) * wx);
        top + (bottom - top) * wy
    }
}

/// Neighboring texels along one axis, and the weight of the second.
#[inline(always)]
fn axis(u: f32, size: u32, wrap: Wrap) -> (u32, u32, f32) {
    let last = size - 1;
    let (folded, tiles) = match wrap {
        Wrap::Repeat => (floor(u).1, true),
        Wrap::Mirror => {
            let half = floor(u * 0.5).1 * 2.0;
            (if half > 1.0 { 2.0 - half } else { half }, false)
        }
        Wrap::Clamp => (u.clamp(0.0, 1.0), false),
    };
    let (whole, weight) = floor(folded * size as f32 - 0.5);
    let (first, second) = (whole, whole + 1);
    if tiles {
        let first = if first < 0 { last } else { (first as u32).min(last) };
        let second = if second as u32 > last { 0 } else { second as u32 };
        (first, second, weight)
    } else {
        ((first.max(0) as u32).min(last), (second.max(0) as u32).min(last), weight)
    }
}

/// The code with the nearest decoded value.
fn nearest(decode: &[f32; 256], value: f32) -> u8 {
    let above = decode.partition_point(|&d| d < value).min(255);
    let below = above.saturating_sub(1);
    if value - decode[below] < decode[above] - value { below as u8 } else { above as u8 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: u32, height: u32, encoding: Encoding, wrap: Wrap, f: impl Fn(u32, u32) -> u8) -> MipTexture {
        let texels =
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| [f(x, y), 0, 255, f(x, y)]);
        let texels = texels.collect();
        MipTexture::new(&Arc::new(Texture {
            width,
            height,
            texels,
            encoding,
            wrap: [wrap; 2],
            digest: Digest::of(b""),
        }))
    }

    fn check(texture: &MipTexture, uv: [f32; 2], level: f32, want: f32) {
        let got = texture.channel(uv, level, 0);
        assert!((got - want).abs() < 2e-3, "{uv:?} level {level}: {got}, not {want}");
        assert!((texture.color(uv, level).x - got).abs() < 1e-6);
    }

    #[test]
    fn texel_centers_and_row_order() {
        // Row 0 of the image is at v = 1.
        let t = image(2, 2, Encoding::Linear, Wrap::Clamp, |x, y| (x * 100 + y * 50) as u8);
        check(&t, [0.25, 0.75], 0.0, 0.0);
        check(&t, [0.75, 0.75], 0.0, 100.0 / 255.0);
        check(&t, [0.25, 0.25], 0.0, 50.0 / 255.0);
        check(&t, [0.5, 0.5], 0.0, 75.0 / 255.0);
    }

    #[test]
    fn wraps() {
        for (wrap, want) in [(Wrap::Repeat, 40.0), (Wrap::Mirror, 200.0), (Wrap::Clamp, 200.0)] {
            let t = image(4, 1, Encoding::Linear, wrap, |x, _| [40, 80, 120, 200][x as usize]);
            check(&t, [1.125, 0.5], 0.0, want / 255.0);
        }
        let t = image(4, 1, Encoding::Linear, Wrap::Mirror, |x, _| [40, 80, 120, 200][x as usize]);
        check(&t, [-0.375, 0.5], 0.0, 80.0 / 255.0);
        check(&t, [1.625, 0.5], 0.0, 80.0 / 255.0);
        // Between the last and the first texel of a tile.
        let t = image(4, 1, Encoding::Linear, Wrap::Repeat, |x, _| [40, 80, 120, 200][x as usize]);
        check(&t, [0.0, 0.5], 0.0, 120.0 / 255.0);
        check(&t, [-7.0, 0.5], 0.0, 120.0 / 255.0);
    }

    #[test]
    fn srgb_is_filtered_in_linear_light() {
        let t = image(2, 1, Encoding::Srgb, Wrap::Clamp, |x, _| 255 * x as u8);
        check(&t, [0.5, 0.5], 0.0, 0.5);
        // 188 is the code nearest to one half.
        check(&t, [0.5, 0.5], 1.0, 0.5029);
        assert!((t.channel([0.5, 0.5], 0.0, 3) - 0.5).abs() < 1e-6, "alpha is linear");
    }

    #[test]
    fn levels_keep_the_mean_of_any_size() {
        let t = image(37, 21, Encoding::Linear, Wrap::Repeat, |x, y| ((x * 7 + y * 13) % 251) as u8);
        let mean =
            (0..21).flat_map(|y| (0..37).map(move |x| (x * 7 + y * 13) % 251)).sum::<u32>() as f32 / 777.0 / 255.0;
        assert!((t.channel([0.3, 0.9], 99.0, 0) - mean).abs() < 0.03);
        assert_eq!(t.levels.len(), 6);
    }

    #[test]
    fn wild_coordinates_stay_inside() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            let t = image(5, 3, Encoding::Srgb, wrap, |x, y| (x * y) as u8);
            for u in [-1e30_f32, -1e7, -1.0, -1e-9, 1.0 - 1e-7, 1.0, 1e7, 1e30] {
                t.color([u, -u], 0.0);
            }
        }
    }
}
