//! The generic encoding of products, and the small product types.

use super::{BBox, Mask};
use crate::scene::InstanceId;
use half::f16;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::ser::{SerializeMap, SerializeSeq};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

/// Any product, in a form that every writer understands.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Null: an optional value that is absent.
    Null,
    /// A truth value.
    Bool(bool),
    /// A signed integer.
    Int(i64),
    /// An unsigned integer, such as a word of a bit set.
    Uint(u64),
    /// A floating-point number.
    Float(f64),
    /// Text.
    Text(String),
    /// Bytes of a format that the product's documentation names, such as a compressed image.
    Bytes(Vec<u8>),
    /// A numeric array.
    Tensor(Tensor),
    /// A binary mask of the image.
    Mask(Mask),
    /// A list.
    List(Vec<Value>),
    /// Named fields, in order.
    Record(Vec<(String, Value)>),
    /// A value for each instance.
    PerInstance(BTreeMap<InstanceId, Value>),
}

impl Value {
    /// A record from its fields.
    pub fn record<'a>(fields: impl IntoIterator<Item = (&'a str, Value)>) -> Self {
        Self::Record(fields.into_iter().map(|(name, value)| (name.to_owned(), value)).collect())
    }
}

impl From<f64> for Value {
    fn from(value: f64) -> Self {
        Self::Float(value)
    }
}
impl From<i64> for Value {
    fn from(value: i64) -> Self {
        Self::Int(value)
    }
}
impl From<u32> for Value {
    fn from(value: u32) -> Self {
        Self::Int(value.into())
    }
}
impl From<u64> for Value {
    fn from(value: u64) -> Self {
        Self::Uint(value)
    }
}
impl From<bool> for Value {
    fn from(value: bool) -> Self {
        Self::Bool(value)
    }
}
impl From<&str> for Value {
    fn from(value: &str) -> Self {
        Self::Text(value.to_owned())
    }
}
impl From<String> for Value {
    fn from(value: String) -> Self {
        Self::Text(value)
    }
}
impl<T: Into<Value>> From<Vec<T>> for Value {
    fn from(values: Vec<T>) -> Self {
        Self::List(values.into_iter().map(Into::into).collect())
    }
}
impl<T: Into<Value>, const N: usize> From<[T; N]> for Value {
    fn from(values: [T; N]) -> Self {
        Self::List(values.into_iter().map(Into::into).collect())
    }
}

/// Serializes for JSON: masks as COCO's compressed runs with their size, tensors as nested lists, bytes as a list of
/// numbers, per-instance values keyed by the id in decimal, and numbers that are not finite as null.
impl Serialize for Value {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Null => serializer.serialize_none(),
            Self::Bool(value) => serializer.serialize_bool(*value),
            Self::Int(value) => serializer.serialize_i64(*value),
            Self::Uint(value) => serializer.serialize_u64(*value),
            Self::Bytes(value) => value.serialize(serializer),
            Self::Float(value) if value.is_finite() => serializer.serialize_f64(*value),
            Self::Float(_) => serializer.serialize_none(),
            Self::Text(value) => serializer.serialize_str(value),
            Self::Tensor(tensor) => tensor.nested(0, 0).serialize(serializer),
            Self::Mask(mask) => {
                let mut map = serializer.serialize_map(Some(2))?;
                map.serialize_entry("size", &[mask.height(), mask.width()])?;
                map.serialize_entry("counts", &mask.to_coco())?;
                map.end()
            }
            Self::List(values) => {
                let mut seq = serializer.serialize_seq(Some(values.len()))?;
                values.iter().try_for_each(|value| seq.serialize_element(value))?;
                seq.end()
            }
            Self::Record(fields) => {
                let mut map = serializer.serialize_map(Some(fields.len()))?;
                fields.iter().try_for_each(|(name, value)| map.serialize_entry(name, value))?;
                map.end()
            }
            Self::PerInstance(values) => {
                let mut map = serializer.serialize_map(Some(values.len()))?;
                values.iter().try_for_each(|(id, value)| map.serialize_entry(&id.to_string(), value))?;
                map.end()
            }
        }
    }
}

/// Element type of a tensor, by its name in NumPy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum DType {
    /// Boolean, one byte.
    #[serde(rename = "bool")]
    Bool,
    /// Unsigned, 8 bits.
    #[serde(rename = "uint8")]
    U8,
    /// Unsigned, 16 bits.
    #[serde(rename = "uint16")]
    U16,
    /// Unsigned, 32 bits.
    #[serde(rename = "uint32")]
    U32,
    /// Unsigned, 64 bits.
    #[serde(rename = "uint64")]
    U64,
    /// Signed, 8 bits.
    #[serde(rename = "int8")]
    I8,
    /// Signed, 16 bits.
    #[serde(rename = "int16")]
    I16,
    /// Signed, 32 bits.
    #[serde(rename = "int32")]
    I32,
    /// Signed, 64 bits.
    #[serde(rename = "int64")]
    I64,
    /// IEEE half precision.
    #[serde(rename = "float16")]
    F16,
    /// IEEE single precision.
    #[serde(rename = "float32")]
    F32,
    /// IEEE double precision.
    #[serde(rename = "float64")]
    F64,
}

impl DType {
    /// Bytes of one element.
    pub fn size(self) -> usize {
        match self {
            Self::Bool | Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 | Self::F16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    /// All element types.
    pub const ALL: [Self; 12] = [
        Self::Bool,
        Self::U8,
        Self::U16,
        Self::U32,
        Self::U64,
        Self::I8,
        Self::I16,
        Self::I32,
        Self::I64,
        Self::F16,
        Self::F32,
        Self::F64,
    ];

    /// Its name in NumPy.
    pub fn numpy(self) -> &'static str {
        match self {
            Self::Bool => "bool",
            Self::U8 => "uint8",
            Self::U16 => "uint16",
            Self::U32 => "uint32",
            Self::U64 => "uint64",
            Self::I8 => "int8",
            Self::I16 => "int16",
            Self::I32 => "int32",
            Self::I64 => "int64",
            Self::F16 => "float16",
            Self::F32 => "float32",
            Self::F64 => "float64",
        }
    }

    /// Whether elements are floating-point numbers.
    pub fn is_float(self) -> bool {
        matches!(self, Self::F16 | Self::F32 | Self::F64)
    }
}

impl JsonSchema for DType {
    fn schema_name() -> Cow<'static, str> {
        "DType".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "enum": Self::ALL.map(Self::numpy) })
    }
}

impl fmt::Display for DType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bool => "bool",
            Self::U8 => "u8",
            Self::U16 => "u16",
            Self::U32 => "u32",
            Self::U64 => "u64",
            Self::I8 => "i8",
            Self::I16 => "i16",
            Self::I32 => "i32",
            Self::I64 => "i64",
            Self::F16 => "f16",
            Self::F32 => "f32",
            Self::F64 => "f64",
        })
    }
}

/// A numeric array.
#[derive(Debug, Clone, PartialEq)]
pub struct Tensor {
    /// Element type.
    pub dtype: DType,
    /// Names of the axes, such as `["y", "x", "channel"]`.
    pub axes: Vec<Cow<'static, str>>,
    /// Lengths of the axes.
    pub shape: Vec<usize>,
    /// Elements in C order, little-endian.
    pub bytes: Vec<u8>,
}

impl Tensor {
    /// An array with named axes. Panics if the number of bytes does not match dtype and shape.
    pub fn new(dtype: DType, axes: &[&'static str], shape: Vec<usize>, bytes: Vec<u8>) -> Self {
        assert_eq!(axes.len(), shape.len(), "a tensor has a name for each axis");
        assert_eq!(shape.iter().product::<usize>() * dtype.size(), bytes.len(), "a tensor's bytes fit its shape");
        Self { dtype, axes: axes.iter().map(|&axis| Cow::Borrowed(axis)).collect(), shape, bytes }
    }

    /// Element at a flat index, as a value.
    pub fn element(&self, index: usize) -> Value {
        let size = self.dtype.size();
        let bytes = &self.bytes[index * size..(index + 1) * size];
        macro_rules! read {
            ($t:ty) => {
                <$t>::from_le_bytes(bytes.try_into().expect("element size"))
            };
        }
        match self.dtype {
            DType::Bool => Value::Bool(bytes[0] != 0),
            DType::U8 => Value::Int(bytes[0].into()),
            DType::U16 => Value::Int(read!(u16).into()),
            DType::U32 => Value::Int(read!(u32).into()),
            DType::U64 => Value::Uint(read!(u64)),
            DType::I8 => Value::Int(read!(i8).into()),
            DType::I16 => Value::Int(read!(i16).into()),
            DType::I32 => Value::Int(read!(i32).into()),
            DType::I64 => Value::Int(read!(i64)),
            DType::F16 => Value::Float(read!(f16).into()),
            DType::F32 => Value::Float(read!(f32).into()),
            DType::F64 => Value::Float(read!(f64)),
        }
    }

    /// The elements as nested lists; the element itself without axes.
    pub(super) fn lists(&self) -> Value {
        self.nested(0, 0)
    }

    fn nested(&self, axis: usize, offset: usize) -> Value {
        match self.shape.get(axis) {
            None => self.element(offset),
            Some(&length) => {
                let stride: usize = self.shape[axis + 1..].iter().product();
                Value::List((0..length).map(|i| self.nested(axis + 1, offset + i * stride)).collect())
            }
        }
    }
}

impl From<Mask> for Value {
    fn from(mask: Mask) -> Self {
        Self::Mask(mask)
    }
}

impl From<BBox> for Value {
    fn from(bbox: BBox) -> Self {
        <[i32; 4]>::from(bbox).map(i64::from).into()
    }
}
