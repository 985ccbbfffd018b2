//! Pixels of images: numbers and vectors of numbers.

use super::DType;
use crate::scene::InstanceId;
use half::f16;

/// A value of a pixel: a number or a fixed-size vector of numbers.
pub trait Pixel: Copy + Send + Sync + 'static {
    /// Element type.
    const DTYPE: DType;
    /// Numbers in a pixel; none for a plain number, so that the tensor has no channel axis.
    const CHANNELS: Option<usize>;
    /// Appends the pixel, little-endian.
    fn write(self, bytes: &mut Vec<u8>);
    /// Appends many pixels, as [`write`](Self::write) appends each.
    fn write_all(pixels: &[Self], bytes: &mut Vec<u8>) {
        pixels.iter().for_each(|pixel| pixel.write(bytes));
    }
    /// The pixel of as many bytes as [`write`](Self::write) appends.
    fn read(bytes: &[u8]) -> Self;
}

/// A byte is its own encoding.
impl Pixel for u8 {
    const DTYPE: DType = DType::U8;
    const CHANNELS: Option<usize> = None;
    fn write(self, bytes: &mut Vec<u8>) {
        bytes.push(self);
    }
    fn write_all(pixels: &[Self], bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(pixels);
    }
    fn read(bytes: &[u8]) -> Self {
        bytes[0]
    }
}

macro_rules! pixel {
    ($($t:ty => $dtype:ident),*) => {$(
        impl Pixel for $t {
            const DTYPE: DType = DType::$dtype;
            const CHANNELS: Option<usize> = None;
            fn write(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }
            fn write_all(pixels: &[Self], bytes: &mut Vec<u8>) {
                let start = bytes.len();
                bytes.resize(start + size_of_val(pixels), 0);
                let places = bytes[start..].chunks_exact_mut(size_of::<$t>());
                places.zip(pixels).for_each(|(place, number)| place.copy_from_slice(&number.to_le_bytes()));
            }
            fn read(bytes: &[u8]) -> Self {
                <$t>::from_le_bytes(bytes.try_into().expect("bytes of a number"))
            }
        }
    )*};
}
pixel!(
    u16 => U16, u32 => U32, u64 => U64, i8 => I8, i16 => I16, i32 => I32, i64 => I64, f16 => F16, f32 => F32,
    f64 => F64
);

impl Pixel for bool {
    const DTYPE: DType = DType::Bool;
    const CHANNELS: Option<usize> = None;
    fn write(self, bytes: &mut Vec<u8>) {
        bytes.push(self.into());
    }
    fn read(bytes: &[u8]) -> Self {
        bytes[0] != 0
    }
}

impl<P: Pixel, const N: usize> Pixel for [P; N] {
    const DTYPE: DType = P::DTYPE;
    const CHANNELS: Option<usize> = Some(N);
    fn write(self, bytes: &mut Vec<u8>) {
        self.into_iter().for_each(|number| number.write(bytes));
    }
    fn write_all(pixels: &[Self], bytes: &mut Vec<u8>) {
        P::write_all(pixels.as_flattened(), bytes);
    }
    fn read(bytes: &[u8]) -> Self {
        let size = P::DTYPE.size();
        std::array::from_fn(|channel| P::read(&bytes[channel * size..][..size]))
    }
}

impl Pixel for InstanceId {
    const DTYPE: DType = DType::U16;
    const CHANNELS: Option<usize> = None;
    fn write(self, bytes: &mut Vec<u8>) {
        self.0.write(bytes);
    }
    fn read(bytes: &[u8]) -> Self {
        Self(u16::read(bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn each<P: Pixel>(pixels: &[P]) -> Vec<u8> {
        let mut bytes = vec![7];
        pixels.iter().for_each(|pixel| pixel.write(&mut bytes));
        bytes
    }

    fn all<P: Pixel>(pixels: &[P]) -> Vec<u8> {
        let mut bytes = vec![7];
        P::write_all(pixels, &mut bytes);
        bytes
    }

    #[test]
    fn many_pixels_are_written_as_each_is() {
        assert_eq!(all(&[[1_u8, 2, 3], [4, 5, 6]]), [7, 1, 2, 3, 4, 5, 6]);
        assert_eq!(all(&[[0.1_f32, -2.5], [f32::NAN, 4.0]]), each(&[[0.1_f32, -2.5], [f32::NAN, 4.0]]));
        assert_eq!(all(&[u64::MAX - 1, 3]), each(&[u64::MAX - 1, 3]));
        assert_eq!(all(&[f16::from_f32(0.5)]), each(&[f16::from_f32(0.5)]));
        assert_eq!(all(&[true, false]), [7, 1, 0]);
        assert_eq!(all(&[InstanceId(258)]), [7, 2, 1]);
        assert_eq!(all::<f64>(&[]), [7]);
    }
}
