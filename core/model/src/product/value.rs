//! The generic encoding of products, and the small product types.

use super::{BitPlane, Form, Mask, Plane, Product, Stored};
use crate::scene::InstanceId;
use half::f16;
use serde::Serialize;
use serde::ser::{SerializeMap, SerializeSeq};
use std::any::TypeId;
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
    /// Signed, 8 bits.
    I8,
    /// Signed, 16 bits.
    I16,
    /// Signed, 32 bits.
    I32,
    /// Signed, 64 bits.
    I64,
    /// IEEE half precision.
    F16,
    /// IEEE single precision.
    F32,
    /// IEEE double precision.
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

    /// Whether elements are floating-point numbers.
    pub fn is_float(self) -> bool {
        matches!(self, Self::F16 | Self::F32 | Self::F64)
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
    /// An array with named axes. Panics if the bytes are not as many as dtype and shape say.
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

impl<P: Pixel> Product for Plane<P> {
    fn encode(&self) -> Value {
        let mut bytes = Vec::with_capacity(self.data().len() * P::DTYPE.size() * P::CHANNELS.unwrap_or(1));
        self.data().iter().for_each(|pixel| pixel.write(&mut bytes));
        let size = [self.height() as usize, self.width() as usize];
        Value::Tensor(match P::CHANNELS {
            None => Tensor::new(P::DTYPE, &["y", "x"], size.to_vec(), bytes),
            Some(channels) => Tensor::new(P::DTYPE, &["y", "x", "channel"], vec![size[0], size[1], channels], bytes),
        })
    }

    fn form() -> Form {
        Form::Image { dtype: P::DTYPE, channels: P::CHANNELS }
    }

    fn is_decoded() -> bool {
        true
    }

    fn decode(stored: Stored<'_>) -> Option<Self> {
        stored.plane()
    }
}

impl Product for BitPlane {
    fn encode(&self) -> Value {
        Value::Tensor(Tensor::new(
            DType::U64,
            &["y", "x", "word"],
            vec![self.height() as usize, self.width() as usize, self.words()],
            self.data().iter().flat_map(|word| word.to_le_bytes()).collect(),
        ))
    }

    fn form() -> Form {
        Form::Tensor(DType::U64)
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

    fn form() -> Form {
        Form::PerInstance(Box::new(form_of::<T>()))
    }

    fn is_decoded() -> bool {
        super::decode::is_of_instances::<T>()
    }

    fn decode(stored: Stored<'_>) -> Option<Self> {
        stored.per_instance()
    }
}

/// The form of the value that a type of the standard ones is converted into.
fn form_of<T: 'static>() -> Form {
    let is = |id: TypeId| TypeId::of::<T>() == id;
    macro_rules! any_of {
        ($($t:ty),*) => { $(is(TypeId::of::<$t>()))||* };
    }
    if any_of!(Mask) {
        Form::Mask
    } else if any_of!(f64) {
        Form::Float
    } else if any_of!(u32, u64, i64) {
        Form::Int
    } else if any_of!(bool) {
        Form::Bool
    } else if any_of!(String, &'static str) {
        Form::Text
    } else if any_of!(BBox) {
        Form::Ints(4)
    } else {
        Form::Any
    }
}

impl<P: Pixel> From<Plane<P>> for Value {
    fn from(plane: Plane<P>) -> Self {
        plane.encode()
    }
}

impl Product for Mask {
    fn encode(&self) -> Value {
        Value::Mask(self.clone())
    }

    fn form() -> Form {
        Form::Mask
    }

    fn is_decoded() -> bool {
        true
    }

    fn decode(stored: Stored<'_>) -> Option<Self> {
        stored.mask()
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

    fn is_decoded() -> bool {
        true
    }

    fn decode(stored: Stored<'_>) -> Option<Self> {
        Some(stored.value.clone())
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

impl BBox {
    /// Whether boxes have a common pixel; one without pixels meets none.
    pub fn meets(&self, other: &Self) -> bool {
        let common =
            |at: i32, long: i32, other: i32, other_long: i32| at.max(other) < (at + long).min(other + other_long);
        common(self.x, self.width, other.x, other.width) && common(self.y, self.height, other.y, other.height)
    }
}

/// Gives the places of each pair of boxes, one of each list, that [meet](BBox::meets), in any order. Boxes are looked at from left
/// to right, so that only those are compared which have a column in common.
pub fn meeting_boxes(ones: &[BBox], others: &[BBox], mut each: impl FnMut(usize, usize)) {
    let lists = [ones, others];
    let of = |list: usize| (0..lists[list].len()).map(move |place| (list, place));
    let mut all: Vec<(usize, usize)> =
        of(0).chain(of(1)).filter(|&(list, place)| lists[list][place].width > 0).collect();
    all.sort_by_key(|&(list, place)| lists[list][place].x);
    // Places of boxes of each list that may reach the column at hand.
    let mut open: [Vec<usize>; 2] = Default::default();
    for (list, place) in all {
        let (own, other) = (&lists[list][place], lists[1 - list]);
        open[1 - list].retain(|&at| i64::from(other[at].x) + i64::from(other[at].width) > i64::from(own.x));
        for &at in &open[1 - list] {
            if own.meets(&other[at]) {
                if list == 0 { each(place, at) } else { each(at, place) }
            }
        }
        open[list].push(place);
    }
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
        let bytes = self.matrix.iter().map(|&bit| bit.into()).collect();
        Value::Tensor(Tensor::new(DType::Bool, &["occluder", "occludee"], vec![n, n], bytes))
    }

    fn form() -> Form {
        Form::Tensor(DType::Bool)
    }

    fn is_decoded() -> bool {
        true
    }

    fn decode(stored: Stored<'_>) -> Option<Self> {
        stored.order()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_meet_where_they_have_a_common_pixel() {
        let all =
            [[0, 0, 3, 3], [2, 2, 4, 4], [3, 0, 2, 2], [5, 5, 0, 0], [3, 3, 5, 5], [-2, -2, 3, 3]].map(BBox::from);
        let pixels = |b: &BBox| -> std::collections::BTreeSet<[i32; 2]> {
            (b.x..b.x + b.width).flat_map(|x| (b.y..b.y + b.height).map(move |y| [x, y])).collect()
        };
        for (a, b) in all.iter().flat_map(|a| all.iter().map(move |b| (a, b))) {
            assert_eq!(a.meets(b), !pixels(a).is_disjoint(&pixels(b)), "{a:?} {b:?}");
        }
    }

    #[test]
    fn numbers_keep_their_sign_and_size() {
        let element = |dtype, bytes: &[u8]| Tensor::new(dtype, &["i"], vec![1], bytes.to_vec()).element(0);
        assert_eq!(element(DType::U64, &[0xff; 8]), Value::Uint(u64::MAX));
        assert_eq!(element(DType::I8, &[0xff]), Value::Int(-1));
        assert_eq!(element(DType::I16, &[0, 0x80]), Value::Int(-32_768));
        // IEEE 754 binary16: 0x3555 is the nearest to one third.
        assert_eq!(element(DType::F16, &[0x55, 0x35]), Value::Float(0.333_251_953_125));
        let mut words = BitPlane::new(1, 1, 64);
        words.insert(0, 0, InstanceId(64));
        assert_eq!(serde_json::to_string(&words.encode()).expect("serializes"), "[[[9223372036854775808]]]");
    }

    #[test]
    fn forms_are_those_of_the_encodings() {
        assert_eq!(Plane::<[f16; 2]>::form(), Form::Image { dtype: DType::F16, channels: Some(2) });
        assert_eq!(PerInstance::<Mask>::form(), Form::PerInstance(Box::new(Form::Mask)));
        assert_eq!(PerInstance::<BBox>::form().to_string(), "list of 4 integers per instance");
        assert_eq!(Value::form(), Form::Any);
    }

    #[test]
    fn values_serialize_as_json() {
        let value = Value::record([
            ("plane", Plane::from_fn(2, 1, |x, _| [x as u8, 7]).encode()),
            ("mask", Mask::from_fn(2, 1, |x, _| x == 1).into()),
            ("box", BBox::from([1, 2, 3, 4]).into()),
            ("inf", f64::INFINITY.into()),
            ("each", PerInstance::from_iter([(InstanceId(3), 0.5)]).encode()),
        ]);
        assert_eq!(
            serde_json::to_string(&value).expect("serializes"),
            r#"{"plane":[[[0,7],[1,7]]],"mask":{"size":[1,2],"counts":"11"},"box":[1,2,3,4],"inf":null,"each":{"3":0.5}}"#
        );
    }

    #[test]
    fn boxes_that_meet_are_found_from_left_to_right() {
        let mut stream = crate::random::Stream::root(2);
        for _ in 0..100 {
            let mut list = || {
                let mut edge = |end| stream.below(end) as i32;
                (0..edge(9)).map(|_| BBox::from([edge(20) - 3, edge(20), edge(6), edge(6)])).collect::<Vec<BBox>>()
            };
            let (ones, others) = (list(), list());
            let mut found = Vec::new();
            meeting_boxes(&ones, &others, |one, other| found.push((one, other)));
            found.sort_unstable();
            let all = (0..ones.len()).flat_map(|one| (0..others.len()).map(move |other| (one, other)));
            assert_eq!(found, all.filter(|&(one, other)| ones[one].meets(&others[other])).collect::<Vec<_>>());
        }
    }
}
