//! One HDF5 file in memory.

use hdf5_pure::{
    Datatype, DatatypeByteOrder, EnumTypeBuilder, FileBuilder, FloatingPointLayout, make_f32_type, make_f64_type,
    make_i8_type, make_i16_type, make_i32_type, make_i64_type, make_u8_type, make_u16_type, make_u32_type,
    make_u64_type,
};
use syntable_formats::encode::npy::Array;
use syntable_model::error::{Error, Result};

/// Level of zlib's compression, the default of HDF5's tools.
const LEVEL: u32 = 4;
/// Maximum size of a chunk: readers cache this many bytes of a dataset by default.
const CHUNK_BYTES: usize = 1 << 20;

/// A file under construction. Its content does not depend on the clock.
pub struct Hdf5File(FileBuilder);

impl Hdf5File {
    pub fn new() -> Self {
        Self(FileBuilder::new())
    }

    /// Adds an array in compressed chunks of whole rows.
    pub fn array(&mut self, name: &str, array: &Array) -> Result<()> {
        let element = datatype(&array.descr)
            .ok_or_else(|| Error::new(format!("HDF5 has no type for elements `{}`", array.descr)))?;
        let size = element.type_size() as usize;
        let shape: Vec<u64> = array.shape.iter().map(|&length| length as u64).collect();
        let dataset = self.0.create_dataset(name);
        dataset.with_raw_data(element, array.bytes.clone(), (array.bytes.len() / size) as u64).with_shape(&shape);
        if let (Some(rows), false) = (array.shape.first(), array.bytes.is_empty()) {
            let fitting = (CHUNK_BYTES * rows / array.bytes.len()).clamp(1, *rows);
            let chunk: Vec<u64> = std::iter::once(fitting as u64).chain(shape[1..].iter().copied()).collect();
            dataset.with_chunks(&chunk);
            if size > 1 {
                dataset.with_shuffle();
            }
            dataset.with_deflate(LEVEL);
        }
        Ok(())
    }

    /// Adds a single string, as UTF-8 bytes of fixed length.
    pub fn text(&mut self, name: &str, text: &str) -> Result<()> {
        let dataset = self.0.create_dataset(name);
        dataset.with_strings(&[text]).map_err(|error| failed(&error))?.with_shape(&[]);
        Ok(())
    }

    pub fn finish(self) -> Result<Vec<u8>> {
        self.0.finish().map_err(|error| failed(&error))
    }
}

fn failed(error: &impl std::fmt::Display) -> Error {
    Error::new(format!("the HDF5 file cannot be made: {error}"))
}

/// The HDF5 type of a NumPy element type.
fn datatype(descr: &str) -> Option<Datatype> {
    Some(match descr {
        // h5py's boolean.
        "|b1" => EnumTypeBuilder::with_base(make_i8_type()).value("FALSE", 0).value("TRUE", 1).build().ok()?,
        "|u1" => make_u8_type(),
        "<u2" => make_u16_type(),
        "<u4" => make_u32_type(),
        "<u8" => make_u64_type(),
        "|i1" => make_i8_type(),
        "<i2" => make_i16_type(),
        "<i4" => make_i32_type(),
        "<i8" => make_i64_type(),
        "<f2" => half(),
        "<f4" => make_f32_type(),
        "<f8" => make_f64_type(),
        _ => return None,
    })
}

/// IEEE 754 binary16.
fn half() -> Datatype {
    Datatype::FloatingPoint {
        size: 2,
        byte_order: DatatypeByteOrder::LittleEndian,
        layout: FloatingPointLayout {
            bit_offset: 0,
            bit_precision: 16,
            exponent_location: 10,
            exponent_size: 5,
            mantissa_location: 0,
            mantissa_size: 10,
            exponent_bias: 15,
        },
    }
}
