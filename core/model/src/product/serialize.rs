//! [`Value::of`]: products from types that implement [`Serialize`].
//!
//! Structs and maps become records in the order of their fields, sequences and tuples become lists, and a variant
//! without data becomes its name; any other variant becomes a record of one field, the variant's name. `None` and `()`
//! become [`Value::Null`]; fields are left out with
//! `#[serde(skip_serializing_if = "…")]`. Numbers that are not finite are kept as they are.

use super::Value;
use crate::error::Error;
use serde::Serialize;
use serde::ser::{
    SerializeMap, SerializeSeq, SerializeStruct, SerializeStructVariant, SerializeTuple, SerializeTupleStruct,
    SerializeTupleVariant,
};
use std::fmt;

impl Value {
    /// The generic encoding of anything that can be serialized. Fails for integers beyond 64 bits signed and for map
    /// keys that are neither text nor integers.
    pub fn of<T: Serialize + ?Sized>(value: &T) -> Result<Self, Error> {
        value.serialize(ToValue).map_err(|failure| failure.0)
    }
}

/// An [`Error`] as serde wants it.
#[derive(Debug)]
struct Failure(Error);

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl std::error::Error for Failure {}

impl serde::ser::Error for Failure {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self(Error::new(message.to_string()))
    }
}

type ValueResult = Result<Value, Failure>;

struct ToValue;

/// Elements of a list so far, and the variant that has the list as its data.
struct Elements {
    variant: Option<&'static str>,
    values: Vec<Value>,
}

/// Fields of a record so far, the key of a map entry whose value follows, and the variant that has the record as its data.
struct RecordFields {
    variant: Option<&'static str>,
    fields: Vec<(String, Value)>,
    key: Option<String>,
}

impl Elements {
    fn new(variant: Option<&'static str>, length: Option<usize>) -> Self {
        Self { variant, values: Vec::with_capacity(length.unwrap_or(0)) }
    }

    fn push<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Failure> {
        let index = self.values.len();
        let value = value.serialize(ToValue).map_err(|failure| inside(failure, &format!("element {index}")))?;
        self.values.push(value);
        Ok(())
    }

    fn finish(self) -> Value {
        tagged(self.variant, Value::List(self.values))
    }
}

impl RecordFields {
    fn new(variant: Option<&'static str>, length: usize) -> Self {
        Self { variant, fields: Vec::with_capacity(length), key: None }
    }

    fn push<T: Serialize + ?Sized>(&mut self, name: String, value: &T) -> Result<(), Failure> {
        let value = value.serialize(ToValue).map_err(|failure| inside(failure, &format!("field `{name}`")))?;
        self.fields.push((name, value));
        Ok(())
    }

    fn finish(self) -> Value {
        tagged(self.variant, Value::Record(self.fields))
    }
}

fn inside(failure: Failure, place: &str) -> Failure {
    Failure(failure.0.context(place))
}

fn tagged(variant: Option<&'static str>, value: Value) -> Value {
    match variant {
        Some(variant) => Value::record([(variant, value)]),
        None => value,
    }
}

fn integer<N: fmt::Display + Copy>(number: N) -> ValueResult
where
    i64: TryFrom<N>,
    u64: TryFrom<N>,
{
    let fits = i64::try_from(number).map(Value::Int).or_else(|_| u64::try_from(number).map(Value::Uint));
    fits.map_err(|_| Failure(Error::new(format!("the integer {number} does not fit into 64 bits"))))
}

impl serde::Serializer for ToValue {
    type Ok = Value;
    type Error = Failure;
    type SerializeSeq = Elements;
    type SerializeTuple = Elements;
    type SerializeTupleStruct = Elements;
    type SerializeTupleVariant = Elements;
    type SerializeMap = RecordFields;
    type SerializeStruct = RecordFields;
    type SerializeStructVariant = RecordFields;

    fn serialize_bool(self, value: bool) -> ValueResult {
        Ok(Value::Bool(value))
    }
    fn serialize_i8(self, value: i8) -> ValueResult {
        Ok(Value::Int(value.into()))
    }
    fn serialize_i16(self, value: i16) -> ValueResult {
        Ok(Value::Int(value.into()))
    }
    fn serialize_i32(self, value: i32) -> ValueResult {
        Ok(Value::Int(value.into()))
    }
    fn serialize_i64(self, value: i64) -> ValueResult {
        Ok(Value::Int(value))
    }
    fn serialize_i128(self, value: i128) -> ValueResult {
        integer(value)
    }
    fn serialize_u8(self, value: u8) -> ValueResult {
        Ok(Value::Int(value.into()))
    }
    fn serialize_u16(self, value: u16) -> ValueResult {
        Ok(Value::Int(value.into()))
    }
    fn serialize_u32(self, value: u32) -> ValueResult {
        Ok(Value::Int(value.into()))
    }
    fn serialize_u64(self, value: u64) -> ValueResult {
        integer(value)
    }
    fn serialize_u128(self, value: u128) -> ValueResult {
        integer(value)
    }
    fn serialize_f32(self, value: f32) -> ValueResult {
        Ok(Value::Float(value.into()))
    }
    fn serialize_f64(self, value: f64) -> ValueResult {
        Ok(Value::Float(value))
    }
    fn serialize_char(self, value: char) -> ValueResult {
        Ok(Value::Text(value.into()))
    }
    fn serialize_str(self, value: &str) -> ValueResult {
        Ok(Value::Text(value.to_owned()))
    }
    fn serialize_bytes(self, value: &[u8]) -> ValueResult {
        Ok(Value::Bytes(value.to_vec()))
    }
    fn serialize_none(self) -> ValueResult {
        Ok(Value::Null)
    }
    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> ValueResult {
        value.serialize(self)
    }
    fn serialize_unit(self) -> ValueResult {
        self.serialize_none()
    }
    fn serialize_unit_struct(self, _: &'static str) -> ValueResult {
        self.serialize_none()
    }
    fn serialize_unit_variant(self, _: &'static str, _: u32, variant: &'static str) -> ValueResult {
        self.serialize_str(variant)
    }
    fn serialize_newtype_struct<T: Serialize + ?Sized>(self, _: &'static str, value: &T) -> ValueResult {
        value.serialize(self)
    }
    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        value: &T,
    ) -> ValueResult {
        let mut fields = RecordFields::new(None, 1);
        fields.push(variant.to_owned(), value)?;
        Ok(fields.finish())
    }
    fn serialize_seq(self, length: Option<usize>) -> Result<Elements, Failure> {
        Ok(Elements::new(None, length))
    }
    fn serialize_tuple(self, length: usize) -> Result<Elements, Failure> {
        Ok(Elements::new(None, Some(length)))
    }
    fn serialize_tuple_struct(self, _: &'static str, length: usize) -> Result<Elements, Failure> {
        Ok(Elements::new(None, Some(length)))
    }
    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        length: usize,
    ) -> Result<Elements, Failure> {
        Ok(Elements::new(Some(variant), Some(length)))
    }
    fn serialize_map(self, length: Option<usize>) -> Result<RecordFields, Failure> {
        Ok(RecordFields::new(None, length.unwrap_or(0)))
    }
    fn serialize_struct(self, _: &'static str, length: usize) -> Result<RecordFields, Failure> {
        Ok(RecordFields::new(None, length))
    }
    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        length: usize,
    ) -> Result<RecordFields, Failure> {
        Ok(RecordFields::new(Some(variant), length))
    }
}

macro_rules! elements {
    ($($part:ident :: $push:ident),* $(,)?) => {$(
        impl $part for Elements {
            type Ok = Value;
            type Error = Failure;
            fn $push<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Failure> {
                self.push(value)
            }
            fn end(self) -> ValueResult {
                Ok(self.finish())
            }
        }
    )*};
}
elements! {
    SerializeSeq::serialize_element, SerializeTuple::serialize_element, SerializeTupleStruct::serialize_field,
    SerializeTupleVariant::serialize_field,
}

macro_rules! fields {
    ($($part:ident),*) => {$(
        impl $part for RecordFields {
            type Ok = Value;
            type Error = Failure;
            fn serialize_field<T: Serialize + ?Sized>(&mut self, name: &'static str, value: &T) -> Result<(), Failure> {
                self.push(name.to_owned(), value)
            }
            fn end(self) -> ValueResult {
                Ok(self.finish())
            }
        }
    )*};
}
fields!(SerializeStruct, SerializeStructVariant);

impl SerializeMap for RecordFields {
    type Ok = Value;
    type Error = Failure;
    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> Result<(), Failure> {
        self.key = Some(match key.serialize(ToValue)? {
            Value::Text(text) => text,
            Value::Int(number) => number.to_string(),
            other => {
                let message = format!("the map key {other:?} is neither text nor an integer");
                return Err(Failure(Error::new(message)));
            }
        });
        Ok(())
    }
    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Failure> {
        let key = self.key.take().ok_or_else(|| Failure(Error::new("a map value without a key")))?;
        self.push(key, value)
    }
    fn end(self) -> ValueResult {
        Ok(self.finish())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[derive(Serialize)]
    #[serde(rename_all = "snake_case")]
    enum Figure {
        Plain,
        Round(f64),
        Pair(i32, i32),
        Boxed { width: f32, tall: bool },
    }

    #[derive(Serialize)]
    struct Inner {
        first: u8,
        second: [f64; 2],
    }

    #[derive(Serialize)]
    struct Wrapper(&'static str);

    #[derive(Serialize)]
    struct Everything {
        zebra: bool,
        apple: i16,
        letter: char,
        name: Wrapper,
        #[serde(flatten)]
        inner: Inner,
        shapes: Vec<Figure>,
        tuple: (u32, &'static str),
        given: Option<f64>,
        #[serde(skip_serializing_if = "Option::is_none")]
        left_out: Option<f64>,
        by_number: BTreeMap<u16, bool>,
        by_name: BTreeMap<String, Vec<i64>>,
    }

    fn all() -> Everything {
        Everything {
            zebra: true,
            apple: -3,
            letter: 'λ',
            name: Wrapper("mug"),
            inner: Inner { first: 7, second: [0.1, -2.5] },
            shapes: vec![
                Figure::Plain,
                Figure::Round(1.5),
                Figure::Pair(1, -1),
                Figure::Boxed { width: 0.25, tall: false },
            ],
            tuple: (4_000_000_000, "x"),
            given: Some(3.0),
            left_out: None,
            by_number: BTreeMap::from([(2, true), (10, false)]),
            by_name: BTreeMap::from([("b".into(), vec![1, i64::MIN]), ("a".into(), vec![])]),
        }
    }

    #[test]
    fn values_are_the_records_that_one_would_write_by_hand() {
        let pair = Value::record([("pair", Value::from(vec![1_i64, -1]))]);
        let boxed = Value::record([("boxed", Value::record([("width", 0.25.into()), ("tall", false.into())]))]);
        let want = Value::record([
            ("zebra", true.into()),
            ("apple", (-3_i64).into()),
            ("letter", "λ".into()),
            ("name", "mug".into()),
            ("first", 7_i64.into()),
            ("second", [0.1, -2.5].into()),
            ("shapes", Value::List(vec!["plain".into(), Value::record([("round", 1.5.into())]), pair, boxed])),
            ("tuple", Value::List(vec![4_000_000_000_i64.into(), "x".into()])),
            ("given", 3.0.into()),
            ("by_number", Value::record([("2", true.into()), ("10", false.into())])),
            ("by_name", Value::record([("a", Value::List(vec![])), ("b", vec![1, i64::MIN].into())])),
        ]);
        assert_eq!(Value::of(&all()).expect("encodes"), want);
    }

    fn json<T: Serialize + ?Sized>(value: &T) -> String {
        serde_json::to_string(value).expect("serializes")
    }

    #[test]
    fn a_value_and_its_source_have_the_same_json() {
        assert_eq!(json(&Value::of(&all()).expect("encodes")), json(&all()));
        assert_eq!(json(&Value::of(&None::<u8>).expect("encodes")), "null");
        assert_eq!(json(&Value::of(&()).expect("encodes")), "null");
        assert_eq!(json(&Value::of(&[f64::NAN, f64::INFINITY, 1.0]).expect("encodes")), "[null,null,1.0]");
    }

    #[test]
    fn numbers_that_are_not_finite_are_kept() {
        let Ok(Value::List(values)) = Value::of(&[f64::NAN, f64::INFINITY, f64::NEG_INFINITY]) else {
            panic!("a list")
        };
        assert!(matches!(values[0], Value::Float(nan) if nan.is_nan()));
        assert_eq!(values[1..], [Value::Float(f64::INFINITY), Value::Float(f64::NEG_INFINITY)]);
        assert_eq!(Value::of(&0.1_f32).expect("encodes"), Value::Float(f64::from(0.1_f32)));
    }

    #[test]
    fn what_has_no_value_is_an_error_that_names_the_place() {
        #[derive(Serialize)]
        struct Large {
            ids: Vec<u128>,
        }
        let large = u128::from(u64::MAX);
        let Ok(Value::Record(fields)) = Value::of(&Large { ids: vec![1, large] }) else { panic!("a record") };
        assert_eq!(fields[0].1, Value::List(vec![Value::Int(1), Value::Uint(u64::MAX)]));
        let error = Value::of(&Large { ids: vec![1, large + 1] }).expect_err("too large").to_string();
        assert_eq!(error, "field `ids`: element 1: the integer 18446744073709551616 does not fit into 64 bits");
        let error = Value::of(&BTreeMap::from([([1, 2], 0)])).expect_err("a list as a key").to_string();
        assert!(error.contains("neither text nor an integer"), "{error}");
    }
}
