//! NumPy files (format 1.0).

use super::kind::{Form, Semantic, ValueKind, with_article};
use std::borrow::Cow;
use syntable_model::error::{Error, Result};
use syntable_model::product::{DType, KeyId, Mask, Tensor, Value};
use syntable_model::scene::InstanceId;

/// Refuses a kind of value that is not an array of numbers. A refusal is a reason and a remedy.
pub fn check(kind: &ValueKind) -> Result<(), String> {
    match kind.form {
        Form::Text | Form::Bytes | Form::Record | Form::Records | Form::PerInstance(_) => Err(format!(
            "a NumPy file holds numbers of one shape, not {}; write it with jsonl",
            with_article(&kind.form)
        )),
        _ => Ok(()),
    }
}

/// The writers of this crate for a form that no image file can store.
pub fn other_writer(form: &Form) -> &'static str {
    match check(&ValueKind { form: form.clone(), semantic: Semantic::Data, unit: "" }) {
        Ok(()) => "npy or jsonl",
        Err(_) => "jsonl",
    }
}

/// The arrays of a product.
pub enum NpyArrays {
    /// The array of a value.
    One(Array),
    /// A value per instance: the values of all instances along the first axis, and the ids of the instances.
    PerInstance {
        /// The values, in id order.
        values: Array,
        /// The ids.
        ids: Array,
    },
}

/// The arrays of a product; `size` is the height and width of an image without instances. An error names the product.
pub fn arrays(product: &str, key: &KeyId, value: &Value, size: [usize; 2]) -> Result<NpyArrays> {
    let array = |value: &Value| {
        check(&ValueKind::of(key, value)).map_err(Error::new)?;
        Array::of(value)
    };
    let explain = |error: Error| error.context(format!("product `{product}`"));
    match value {
        Value::PerInstance(each) => {
            let values = if each.is_empty() {
                Array::stack_of_none(key.form().of_one(), size)
            } else {
                Array::stack(each.values().map(array)).map_err(explain)?
            };
            Ok(NpyArrays::PerInstance { values, ids: Array::ids(each.keys().copied()) })
        }
        value => array(value).map(NpyArrays::One).map_err(explain),
    }
}

/// The arrays of a product of numbers. `None` for records, lists without a fixed form, and text, which are better
/// written as JSON. If the key determines the form, the decision depends on the key alone, so all values are written
/// alike.
pub fn arrays_of_numbers(product: &str, key: &KeyId, value: &Value, size: [usize; 2]) -> Option<NpyArrays> {
    check(&ValueKind::of_key(key)).ok().and_then(|()| arrays(product, key, value, size).ok())
}

/// The element type with this NumPy descriptor.
pub fn dtype(text: &str) -> Option<DType> {
    DType::ALL.into_iter().find(|dtype| descr(*dtype) == text)
}

/// The NumPy descriptor of an element type.
pub fn descr(dtype: DType) -> &'static str {
    match dtype {
        DType::Bool => "|b1",
        DType::U8 => "|u1",
        DType::U16 => "<u2",
        DType::U32 => "<u4",
        DType::U64 => "<u8",
        DType::I8 => "|i1",
        DType::I16 => "<i2",
        DType::I32 => "<i4",
        DType::I64 => "<i8",
        DType::F16 => "<f2",
        DType::F32 => "<f4",
        DType::F64 => "<f8",
    }
}

/// Descriptor of texts, which the number of letters follows.
pub const TEXT: &str = "<U";
/// Bytes of a letter of a text: UTF-32.
pub const LETTER_BYTES: usize = 4;

/// The text of an element. None if a letter is invalid.
pub fn text_of(element: &[u8]) -> Option<String> {
    let letters = element.as_chunks().0.iter().map(|bytes| char::from_u32(u32::from_le_bytes(*bytes)));
    let text: Option<String> = letters.collect();
    text.map(|text| text.trim_end_matches('\0').to_owned())
}

/// An array: NumPy descriptor of its element type, shape, and elements in C order, little-endian.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Array {
    /// Element type, such as `<f8`, `|b1` or `<U9`.
    pub descr: Cow<'static, str>,
    /// Lengths of the axes; none for a single number.
    pub shape: Vec<usize>,
    /// The elements in C order.
    pub bytes: Vec<u8>,
}

impl Array {
    /// A matrix of f64.
    pub fn matrix_f64(rows: usize, columns: usize, elements: impl Iterator<Item = f64>) -> Self {
        Self { descr: "<f8".into(), shape: vec![rows, columns], bytes: elements.flat_map(f64::to_le_bytes).collect() }
    }

    /// The array of a tensor, a mask, a number, or nested lists of numbers of one shape.
    pub fn of(value: &Value) -> Result<Self> {
        match value {
            Value::Tensor(tensor) => Ok(Self::of_tensor(tensor)),
            Value::Mask(mask) => Ok(Self::of_mask(mask)),
            Value::Bool(value) => Ok(Self { descr: "|b1".into(), shape: vec![], bytes: vec![(*value).into()] }),
            Value::Int(value) => Ok(Self { descr: "<i8".into(), shape: vec![], bytes: value.to_le_bytes().to_vec() }),
            Value::Uint(value) => Ok(Self { descr: "<u8".into(), shape: vec![], bytes: value.to_le_bytes().to_vec() }),
            Value::Float(value) => Ok(Self { descr: "<f8".into(), shape: vec![], bytes: value.to_le_bytes().to_vec() }),
            Value::List(values) => Self::stack(values.iter().map(Self::of)),
            Value::Null => Ok(Self { descr: "<f8".into(), shape: vec![], bytes: f64::NAN.to_le_bytes().to_vec() }),
            Value::Bytes(_) => Err(Error::new("bytes are not an array")),
            Value::Text(_) => Err(Error::new("text is not an array")),
            Value::Record(_) => Err(Error::new("a record is not an array")),
            Value::PerInstance(_) => Err(Error::new("values per instance inside another value are not an array")),
        }
    }

    /// Stacks arrays of one shape and type along a new first axis. Without arrays, the result is an empty f64 array.
    pub fn stack(arrays: impl Iterator<Item = Result<Self>>) -> Result<Self> {
        let mut stacked: Option<Self> = None;
        let mut count = 0;
        for array in arrays {
            let array = array?;
            count += 1;
            match &mut stacked {
                None => stacked = Some(array),
                Some(first) if (&first.descr, &first.shape) == (&array.descr, &array.shape) => {
                    first.bytes.extend(array.bytes);
                }
                Some(first) => {
                    return Err(Error::new(format!(
                        "elements {:?} of {} and {:?} of {} do not make an array; write them with jsonl",
                        first.shape, first.descr, array.shape, array.descr
                    )));
                }
            }
        }
        let mut stacked = stacked.unwrap_or(Self { descr: "<f8".into(), shape: vec![], bytes: vec![] });
        stacked.shape.insert(0, count);
        Ok(stacked)
    }

    /// The array for zero instances whose values have this form, in an image of this height and width: the first axis
    /// has length 0. Values of unknown form count as numbers.
    pub fn stack_of_none(form: &Form, [height, width]: [usize; 2]) -> Self {
        let (descr, rest) = match *form {
            Form::Mask => ("|b1", vec![height, width]),
            Form::Image { dtype, channels } => (descr(dtype), [height, width].into_iter().chain(channels).collect()),
            Form::Ints(length) => ("<i8", vec![length]),
            Form::Int => ("<i8", vec![]),
            Form::Bool => ("|b1", vec![]),
            _ => ("<f8", vec![]),
        };
        Self { descr: descr.into(), shape: [vec![0], rest].concat(), bytes: Vec::new() }
    }

    /// A single text.
    pub fn text(text: &str) -> Self {
        Self { shape: vec![], ..Self::texts(&[text]) }
    }

    /// Texts, `[N]`, padded with zeros to the longest one, as NumPy stores them.
    pub fn texts(texts: &[&str]) -> Self {
        let letters = texts.iter().map(|text| text.chars().count()).max().unwrap_or(0).max(1);
        let letter = |letter: Option<char>| u32::from(letter.unwrap_or('\0')).to_le_bytes();
        let padded = |text: &&str| {
            let mut rest = text.chars();
            (0..letters).flat_map(|_| letter(rest.next())).collect::<Vec<u8>>()
        };
        let bytes = texts.iter().flat_map(padded).collect();
        Self { descr: format!("{TEXT}{letters}").into(), shape: vec![texts.len()], bytes }
    }

    /// The elements of an array of 64-bit or truth values as floats; none for other elements.
    pub fn as_f64(&self) -> Option<Vec<f64>> {
        let words = || self.bytes.as_chunks().0.iter().copied();
        Some(match &*self.descr {
            "<f8" => words().map(f64::from_le_bytes).collect(),
            "<i8" => words().map(|bytes| i64::from_le_bytes(bytes) as f64).collect(),
            "<u8" => words().map(|bytes| u64::from_le_bytes(bytes) as f64).collect(),
            "|b1" => self.bytes.iter().map(|&bit| bit.into()).collect(),
            _ => return None,
        })
    }

    /// Instance ids, `[N]` of u16.
    pub fn ids(ids: impl Iterator<Item = InstanceId>) -> Self {
        let bytes: Vec<u8> = ids.flat_map(|id| id.0.to_le_bytes()).collect();
        Self { descr: "<u2".into(), shape: vec![bytes.len() / 2], bytes }
    }

    fn of_tensor(tensor: &Tensor) -> Self {
        Self { descr: descr(tensor.dtype).into(), shape: tensor.shape.clone(), bytes: tensor.bytes.clone() }
    }

    fn of_mask(mask: &Mask) -> Self {
        let plane = mask.to_plane();
        let bytes = plane.data().iter().map(|&bit| bit.into()).collect();
        Self { descr: "|b1".into(), shape: vec![mask.height() as usize, mask.width() as usize], bytes }
    }

    /// The bytes of a `.npy` file, equal to the output of `numpy.save`.
    pub fn encode(&self) -> Vec<u8> {
        const PREFIX: usize = 10;
        const ALIGNMENT: usize = 64;
        // NumPy reserves space for the first length to grow to this number of digits.
        const GROWTH_DIGITS: usize = 21;
        let shape = match self.shape.as_slice() {
            [] => "()".to_owned(),
            [length] => format!("({length},)"),
            lengths => format!("({})", lengths.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
        };
        let mut header = format!("{{'descr': '{}', 'fortran_order': False, 'shape': {shape}, }}", self.descr);
        if let Some(first) = self.shape.first() {
            header.push_str(&" ".repeat(GROWTH_DIGITS.saturating_sub(first.to_string().len())));
        }
        let padding = ALIGNMENT - (PREFIX + header.len() + 1) % ALIGNMENT;
        header.push_str(&" ".repeat(padding % ALIGNMENT));
        header.push('\n');
        let length = u16::try_from(header.len()).expect("an array has few axes");
        let mut file = Vec::with_capacity(PREFIX + header.len() + self.bytes.len());
        file.extend_from_slice(b"\x93NUMPY\x01\x00");
        file.extend_from_slice(&length.to_le_bytes());
        file.extend_from_slice(header.as_bytes());
        file.extend_from_slice(&self.bytes);
        file
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::product::{PerInstance, Plane, Product};

    #[test]
    fn the_order_matrix_has_a_header_of_128_bytes() {
        let file = Array::matrix_f64(2, 2, [0.0, 1.0, 0.0, 0.0].into_iter()).encode();
        assert_eq!(file.len(), 128 + 32);
        assert_eq!(&file[..10], b"\x93NUMPY\x01\x00\x76\x00");
        assert!(file[10..].starts_with(b"{'descr': '<f8', 'fortran_order': False, 'shape': (2, 2), }"));
        assert_eq!(&file[128..144], [0.0_f64.to_le_bytes(), 1.0_f64.to_le_bytes()].concat());
    }

    #[test]
    fn values_become_arrays() {
        let check = |value: Value, descr: &str, shape: &[usize], bytes: usize| {
            let array = Array::of(&value).expect("an array");
            assert_eq!((&*array.descr, array.shape.as_slice(), array.bytes.len()), (descr, shape, bytes));
        };
        check(Plane::from_fn(3, 2, |x, _| [x as f32; 3]).encode(), "<f4", &[2, 3, 3], 72);
        check(Mask::empty(3, 2).into(), "|b1", &[2, 3], 6);
        check(1.5.into(), "<f8", &[], 8);
        check([[1_i64, 2], [3, 4]].into(), "<i8", &[2, 2], 32);
        check(Value::List(vec![]), "<f8", &[0], 0);
        check(Plane::from_fn(2, 2, |x, _| -(x as i8)).encode(), "|i1", &[2, 2], 4);
        check(Plane::from_fn(2, 2, |x, _| -(x as i16)).encode(), "<i2", &[2, 2], 8);
        check(Plane::from_fn(2, 2, |x, _| [-(x as i32); 2]).encode(), "<i4", &[2, 2, 2], 32);
        check(Plane::from_fn(2, 2, |x, _| -i64::from(x)).encode(), "<i8", &[2, 2], 32);
        check(Plane::from_fn(2, 2, |x, _| u64::from(x)).encode(), "<u8", &[2, 2], 32);
        check(Plane::from_fn(2, 2, |x, _| exr::prelude::f16::from_f32(x as f32)).encode(), "<f2", &[2, 2], 8);
        check(u64::MAX.into(), "<u8", &[], 8);
        for (value, want) in [
            ("text".into(), "text is not an array"),
            (
                Value::List(vec![1_i64.into(), 1.5.into()]),
                "elements [] of <i8 and [] of <f8 do not make an array; write them with jsonl",
            ),
            (PerInstance::<f64>::default().encode(), "values per instance inside another value are not an array"),
        ] {
            assert_eq!(Array::of(&value).expect_err("refused").to_string(), want);
        }
    }
    /// Without instances, type and shape equal the array with instances, except for the first length.
    #[test]
    fn no_instances_make_an_array_of_the_same_type() {
        fn check<T: Clone + Into<Value> + Send + Sync + 'static>(one: T) -> Array {
            let array = Array::of(&one.into()).expect("an array");
            let none = Array::stack_of_none(PerInstance::<T>::form().of_one(), [2, 3]);
            assert_eq!((&*none.descr, &none.shape[1..], none.shape[0]), (&*array.descr, array.shape.as_slice(), 0));
            none
        }
        check(Mask::empty(3, 2));
        check(Mask::empty(3, 2).bbox());
        assert_eq!(check(0.5).shape, [0]);
        check(7_u32);
        check(true);
    }
}
