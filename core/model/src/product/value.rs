//! The generic encoding of products, and the small product types.

use super::{BitPlane, Mask, Plane, Product};
use crate::scene::InstanceId;
use serde::Serialize;
use serde::ser::{SerializeMap, SerializeSeq};
use std::collections::BTreeMap;

/// Any product, in a form that every writer understands. The set of forms is closed.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Yes or no.
    Bool(bool),
    /// A whole number.
    Int(i64),
    /// A number.
    Float(f64),
    /// Text.
    Text(String),
    /// An array of numbers.
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

/// Serialises as JSON would have it: masks as COCO's compressed runs with their size, tensors as nested lists,
/// per-instance values keyed by the id in decimal; numbers that are not finite as null.
impl Serialize for Value {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Bool(value) => serializer.serialize_bool(*value),
            Self::Int(value) => serializer.serialize_i64(*value),
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

/// Element type of a tensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DType {
    /// Boolean, one byte.
    Bool,
    /// Unsigned, 8 bits.
    U8,
    /// Unsigned, 16 bits.
    U16,
    /// Unsigned, 32 bits.
    U32,
    /// Unsigned, 64 bits.
    U64,
    /// IEEE single.
    F32,
    /// IEEE double.
    F64,
}

impl DType {
    /// Bytes of one element.
    pub fn size(self) -> usize {
        match self {
            Self::Bool | Self::U8 => 1,
            Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
            Self::U64 | Self::F64 => 8,
        }
    }
}

/// An array of numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Tensor {
    /// Element type.
    pub dtype: DType,
    /// Names of the axes, such as `["y", "x", "channel"]`.
    pub axes: Vec<&'static str>,
    /// Lengths of the axes.
    pub shape: Vec<usize>,
    /// Elements in C order, little-endian.
    pub bytes: Vec<u8>,
}

impl Tensor {
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
            DType::U64 => Value::Int(read!(u64) as i64),
            DType::F32 => Value::Float(read!(f32).into()),
            DType::F64 => Value::Float(read!(f64)),
        }
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

/// A value of a pixel: a number or a fixed-size vector of numbers.
pub trait Pixel: Copy + Send + Sync + 'static {
    /// Element type.
    const DTYPE: DType;
    /// Numbers in a pixel; none for a plain number, so that the tensor has no channel axis.
    const CHANNELS: Option<usize>;
    /// Appends the pixel, little-endian.
    fn write(self, bytes: &mut Vec<u8>);
}

macro_rules! pixel {
    ($($t:ty => $dtype:ident),*) => {$(
        impl Pixel for $t {
            const DTYPE: DType = DType::$dtype;
            const CHANNELS: Option<usize> = None;
            fn write(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}
pixel!(u8 => U8, u16 => U16, u32 => U32, u64 => U64, f32 => F32, f64 => F64);

impl Pixel for bool {
    const DTYPE: DType = DType::Bool;
    const CHANNELS: Option<usize> = None;
    fn write(self, bytes: &mut Vec<u8>) {
        bytes.push(self.into());
    }
}

impl<P: Pixel, const N: usize> Pixel for [P; N] {
    const DTYPE: DType = P::DTYPE;
    const CHANNELS: Option<usize> = Some(N);
    fn write(self, bytes: &mut Vec<u8>) {
        self.into_iter().for_each(|number| number.write(bytes));
    }
}

impl Pixel for InstanceId {
    const DTYPE: DType = DType::U16;
    const CHANNELS: Option<usize> = None;
    fn write(self, bytes: &mut Vec<u8>) {
        self.0.write(bytes);
    }
}

impl<P: Pixel> Product for Plane<P> {
    fn encode(&self) -> Value {
        let mut bytes = Vec::with_capacity(self.data().len() * P::DTYPE.size() * P::CHANNELS.unwrap_or(1));
        self.data().iter().for_each(|pixel| pixel.write(&mut bytes));
        let (mut axes, mut shape) = (vec!["y", "x"], vec![self.height() as usize, self.width() as usize]);
        if let Some(channels) = P::CHANNELS {
            axes.push("channel");
            shape.push(channels);
        }
        Value::Tensor(Tensor { dtype: P::DTYPE, axes, shape, bytes })
    }
}

impl Product for BitPlane {
    fn encode(&self) -> Value {
        let [mx, my] = self.margin();
        Value::Tensor(Tensor {
            dtype: DType::U64,
            axes: vec!["y", "x", "word"],
            shape: vec![(self.height() + 2 * my) as usize, (self.width() + 2 * mx) as usize, self.words()],
            bytes: self.data().iter().flat_map(|word| word.to_le_bytes()).collect(),
        })
    }
}

/// A value for each annotated instance, in id order.
#[derive(Debug, Clone, PartialEq)]
pub struct PerInstance<T>(pub BTreeMap<InstanceId, T>);

impl<T> Default for PerInstance<T> {
    fn default() -> Self {
        Self(BTreeMap::new())
    }
}

impl<T> FromIterator<(InstanceId, T)> for PerInstance<T> {
    fn from_iter<I: IntoIterator<Item = (InstanceId, T)>>(items: I) -> Self {
        Self(items.into_iter().collect())
    }
}

impl<T> PerInstance<T> {
    /// The value of an instance.
    pub fn get(&self, id: InstanceId) -> Option<&T> {
        self.0.get(&id)
    }

    /// Ids and values, in id order.
    pub fn iter(&self) -> impl Iterator<Item = (InstanceId, &T)> {
        self.0.iter().map(|(&id, value)| (id, value))
    }

    /// The same instances with other values.
    pub fn map<U>(&self, mut f: impl FnMut(InstanceId, &T) -> U) -> PerInstance<U> {
        self.iter().map(|(id, value)| (id, f(id, value))).collect()
    }
}

impl<T: Clone + Into<Value> + Send + Sync + 'static> Product for PerInstance<T> {
    fn encode(&self) -> Value {
        Value::PerInstance(self.0.iter().map(|(&id, value)| (id, value.clone().into())).collect())
    }
}

impl From<Mask> for Value {
    fn from(mask: Mask) -> Self {
        Self::Mask(mask)
    }
}

impl Product for Value {
    fn encode(&self) -> Value {
        self.clone()
    }
}

/// A box of whole pixels: first column and row, and how many of each. All zeros if empty.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BBox {
    /// First column.
    pub x: i32,
    /// First row.
    pub y: i32,
    /// Columns: last − first + 1.
    pub width: i32,
    /// Rows: last − first + 1.
    pub height: i32,
}

impl From<[i32; 4]> for BBox {
    fn from([x, y, width, height]: [i32; 4]) -> Self {
        Self { x, y, width, height }
    }
}

impl From<BBox> for [i32; 4] {
    fn from(b: BBox) -> Self {
        [b.x, b.y, b.width, b.height]
    }
}

impl From<BBox> for Value {
    fn from(bbox: BBox) -> Self {
        <[i32; 4]>::from(bbox).map(i64::from).into()
    }
}

/// Who occludes whom in a view: SynTable's occlusion order adjacency matrix (OOAM), Algorithm 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OcclusionOrder {
    ids: Vec<InstanceId>,
    matrix: Vec<bool>,
}

impl OcclusionOrder {
    /// No occlusion between the given instances, which must be in id order.
    pub fn new(ids: Vec<InstanceId>) -> Self {
        let matrix = vec![false; ids.len() * ids.len()];
        Self { ids, matrix }
    }

    /// The instances of rows and columns, in id order.
    pub fn ids(&self) -> &[InstanceId] {
        &self.ids
    }

    /// Whether the instance of row `i` occludes the instance of column `j`.
    pub fn occludes(&self, i: usize, j: usize) -> bool {
        self.matrix[i * self.ids.len() + j]
    }

    /// Says that row `i` occludes column `j`.
    pub fn set(&mut self, i: usize, j: usize) {
        let n = self.ids.len();
        self.matrix[i * n + j] = true;
    }

    /// The matrix, row by row.
    pub fn matrix(&self) -> &[bool] {
        &self.matrix
    }
}

/// A matrix `[M, M]` of booleans, axes `occluder` and `occludee`, instances in id order.
impl Product for OcclusionOrder {
    fn encode(&self) -> Value {
        let n = self.ids.len();
        Value::Tensor(Tensor {
            dtype: DType::Bool,
            axes: vec!["occluder", "occludee"],
            shape: vec![n, n],
            bytes: self.matrix.iter().map(|&bit| bit.into()).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_serialise_as_json() {
        let value = Value::record([
            ("plane", Plane::from_fn(2, 1, |x, _| [x as u8, 7]).encode()),
            ("mask", Mask::from_fn(2, 1, |x, _| x == 1).into()),
            ("box", BBox::from([1, 2, 3, 4]).into()),
            ("inf", f64::INFINITY.into()),
            ("each", PerInstance::from_iter([(InstanceId(3), 0.5)]).encode()),
        ]);
        assert_eq!(
            serde_json::to_string(&value).expect("serialises"),
            r#"{"plane":[[[0,7],[1,7]]],"mask":{"size":[1,2],"counts":"11"},"box":[1,2,3,4],"inf":null,"each":{"3":0.5}}"#
        );
    }
}
