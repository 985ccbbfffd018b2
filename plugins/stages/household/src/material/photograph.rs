//! Photographs that prints show crops of.

use super::color::SrgbColor;
use syntable_model::product::Plane;

/// Longest edge at which a photograph is kept, texels: prints show crops of a few hundred.
const LONGEST: usize = 640;

/// A photograph, sRGB.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Photograph {
    width: usize,
    height: usize,
    texels: Vec<[u8; 3]>,
}

impl Photograph {
    /// A photograph of an sRGB image. An image longer than 640 texels is downsampled by box averaging.
    pub fn of(image: &Plane<[u8; 3]>) -> Self {
        let (width, height) = (image.width() as usize, image.height() as usize);
        let step = width.max(height).div_ceil(LONGEST).max(1);
        let (columns, rows) = ((width / step).max(1), (height / step).max(1));
        let mut texels = Vec::with_capacity(columns * rows);
        for row in 0..rows {
            for column in 0..columns {
                let (mut sum, mut count) = ([0_u32; 3], 0);
                for y in row * step..((row + 1) * step).min(height) {
                    for x in column * step..((column + 1) * step).min(width) {
                        let texel = image.at(x as u32, y as u32);
                        sum.iter_mut().zip(texel).for_each(|(sum, byte)| *sum += u32::from(*byte));
                        count += 1;
                    }
                }
                texels.push(sum.map(|sum| ((sum + count / 2) / count.max(1)) as u8));
            }
        }
        Self { width: columns, height: rows, texels }
    }

    /// Width over height.
    pub fn aspect(&self) -> f32 {
        self.width as f32 / self.height as f32
    }

    /// Bilinear at a position in [0, 1], from the upper left corner.
    pub fn sample(&self, u: f32, v: f32) -> SrgbColor {
        let (x, y) = (u.clamp(0.0, 1.0) * self.width as f32 - 0.5, v.clamp(0.0, 1.0) * self.height as f32 - 0.5);
        let (left, top) = (x.floor().max(0.0), y.floor().max(0.0));
        let (tx, ty) = ((x - left).clamp(0.0, 1.0), (y - top).clamp(0.0, 1.0));
        let at = |column: usize, row: usize| {
            let texel = self.texels[row.min(self.height - 1) * self.width + column.min(self.width - 1)];
            texel.map(|byte| f32::from(byte) / 255.0)
        };
        let (left, top) = (left as usize, top as usize);
        let above = super::mix(at(left, top), at(left + 1, top), tx);
        super::mix(above, super::mix(at(left, top + 1), at(left + 1, top + 1), tx), ty)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_photographs_are_averaged() {
        let image = Plane::from_fn(1280, 4, |x, _| if x % 2 == 0 { [0, 100, 255] } else { [200; 3] });
        let photograph = Photograph::of(&image);
        assert_eq!((photograph.width, photograph.height), (640, 2));
        assert!(photograph.texels.iter().all(|texel| *texel == [100, 150, 228]), "{:?}", photograph.texels[0]);
    }

    #[test]
    fn samples_meet_texels_at_their_centers() {
        let photograph = Photograph::of(&Plane::from_vec(2, 1, vec![[0; 3], [255; 3]]));
        assert_eq!(photograph.sample(0.25, 0.5), [0.0; 3]);
        assert_eq!(photograph.sample(0.5, 0.5), [0.5; 3]);
        assert_eq!((photograph.sample(1.0, 0.0), photograph.aspect()), ([1.0; 3], 2.0));
    }
}
