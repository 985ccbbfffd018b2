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
    /// The pixel of as many bytes as [`write`](Self::write) appends.
    fn read(bytes: &[u8]) -> Self;
}

macro_rules! pixel {
    ($($t:ty => $dtype:ident),*) => {$(
        impl Pixel for $t {
            const DTYPE: DType = DType::$dtype;
            const CHANNELS: Option<usize> = None;
            fn write(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }
            fn read(bytes: &[u8]) -> Self {
                <$t>::from_le_bytes(bytes.try_into().expect("bytes of a number"))
            }
        }
    )*};
}
pixel!(
    u8 => U8, u16 => U16, u32 => U32, u64 => U64, i8 => I8, i16 => I16, i32 => I32, i64 => I64, f16 => F16, f32 => F32,
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
