//! Values as JSON, and readable messages for errors of JSON's parser.

use serde::de::value::{MapDeserializer, SeqDeserializer};
use serde::de::{DeserializeOwned, Error as _, IntoDeserializer, Visitor};
use serde::{Deserialize, Deserializer, Serialize, forward_to_deserialize_any};
use serde_json::Value as Json;
use serde_json::error::Category;
use serde_json::value::RawValue;
use std::cell::Cell;
use std::io::{self, Read};
use syntable_model::error::{Error, Result};
use syntable_model::product::{Products, Value};

/// Words that Python's `json` writes for floats that JSON cannot represent.
const NO_NUMBERS: [&str; 3] = ["NaN", "-Infinity", "Infinity"];

/// Maximum number of bytes from the start of a word of [`NO_NUMBERS`] to the parser's position, which is up to two
/// letters after a sign.
const BEFORE: u64 = 3;

/// A value as JSON on one line.
///
/// # Errors
/// If JSON cannot hold the value.
pub fn text(value: &impl Serialize) -> Result<String> {
    serde_json::to_string(value).map_err(unwritable)
}

/// A value as indented JSON, with a line break at the end.
///
/// # Errors
/// If JSON cannot hold the value.
pub fn pretty(value: &impl Serialize) -> Result<Vec<u8>> {
    let mut text = serde_json::to_vec_pretty(value).map_err(unwritable)?;
    text.push(b'\n');
    Ok(text)
}

/// The error of a value that JSON cannot hold.
pub fn unwritable(error: serde_json::Error) -> Error {
    Error::new(format!("cannot be written as JSON: {error}"))
}

/// A product as JSON.
///
/// # Errors
/// If it is missing, or JSON cannot hold it.
pub fn of_product(products: &Products, name: &str) -> Result<Json> {
    let json = serde_json::to_value(products.value(name)?);
    json.map_err(|error| unwritable(error).context(format!("product `{name}`")))
}

/// A value, such as a record product, as a type with the fields that the caller reads.
///
/// # Errors
/// If the fields differ.
pub fn typed<T: DeserializeOwned>(value: &impl Serialize) -> serde_json::Result<T> {
    serde_json::to_value(value).and_then(serde_json::from_value)
}

/// The value of a field; the default if it is `null`.
///
/// # Errors
/// If the field has a value of another type.
pub fn or_default<'de, D: Deserializer<'de>, T: Deserialize<'de> + Default>(
    deserializer: D,
) -> std::result::Result<T, D::Error> {
    Option::deserialize(deserializer).map(Option::unwrap_or_default)
}

/// A record product as a type with the fields that the caller reads, as by [`typed`].
///
/// # Errors
/// If the fields differ.
pub fn of_record<T: DeserializeOwned>(value: &Value) -> serde_json::Result<T> {
    T::deserialize(ValueDeserializer(value)).or_else(|_| typed(value))
}

/// Reads a value without a tree of JSON. Its errors are not shown.
struct ValueDeserializer<'de>(&'de Value);

impl<'de> IntoDeserializer<'de> for ValueDeserializer<'de> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

impl<'de> Deserializer<'de> for ValueDeserializer<'de> {
    type Error = serde::de::value::Error;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> std::result::Result<V::Value, Self::Error> {
        match self.0 {
            Value::Null => visitor.visit_unit(),
            Value::Bool(value) => visitor.visit_bool(*value),
            Value::Int(value) => visitor.visit_i64(*value),
            Value::Uint(value) => visitor.visit_u64(*value),
            Value::Float(value) if value.is_finite() => visitor.visit_f64(*value),
            Value::Float(_) => visitor.visit_unit(),
            Value::Text(value) => visitor.visit_borrowed_str(value),
            Value::List(values) => visitor.visit_seq(SeqDeserializer::new(values.iter().map(Self))),
            Value::Record(fields) => {
                let fields = fields.iter().map(|(name, value)| (name.as_str(), Self(value)));
                visitor.visit_map(MapDeserializer::new(fields))
            }
            Value::Bytes(_) | Value::Tensor(_) | Value::Mask(_) | Value::PerInstance(_) => {
                Err(Self::Error::custom("its JSON has another form"))
            }
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> std::result::Result<V::Value, Self::Error> {
        match self.0 {
            Value::Null => visitor.visit_none(),
            Value::Float(value) if !value.is_finite() => visitor.visit_none(),
            _ => visitor.visit_some(self),
        }
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct
        newtype_struct seq tuple tuple_struct map struct enum identifier ignored_any
    }
}

/// An error of the parser with its line and field. `from` is the text from the offset of [`before`] on; it may be empty
/// if unknown.
pub fn located(error: &serde_json::Error, field: Option<&str>, from: &[u8]) -> Error {
    let text = error.to_string();
    let place = format!(" at line {} column {}", error.line(), error.column());
    let field = field.map_or(String::new(), |field| format!("`{field}`: "));
    let no_number = no_number(from).filter(|_| error.classify() == Category::Syntax);
    let what = no_number.map(|word| format!("{word} is no number of JSON; write a number or `null`"));
    let what = what.unwrap_or_else(|| text.strip_suffix(&place).unwrap_or(&text).to_owned());
    Error::new(format!("{field}{what}")).at_line(error.line())
}

/// Offset of the text for [`located`], given the number of bytes that the parser has read.
pub fn before(taken: u64) -> u64 {
    taken.saturating_sub(BEFORE)
}

/// Offset in a text of an error of its parser.
pub(crate) fn place_in(text: &[u8], error: &serde_json::Error) -> usize {
    let lines = text.split_inclusive(|byte| *byte == b'\n').take(error.line().saturating_sub(1));
    (lines.map(<[u8]>::len).sum::<usize>() + error.column()).min(text.len())
}

/// The error of a parser without its place, as an error of the parser around it.
fn passed_on<E: serde::de::Error>(error: &serde_json::Error) -> E {
    let text = error.to_string();
    let place = format!(" at line {} column {}", error.line(), error.column());
    E::custom(text.strip_suffix(&place).unwrap_or(&text))
}

/// The tree of a text of JSON, which an error of [`typed`] needs: it names no place in the text.
///
/// # Errors
/// If the text is no JSON.
pub fn tree<E: serde::de::Error>(text: &RawValue) -> std::result::Result<Json, E> {
    serde_json::from_str(text.get()).map_err(|error| passed_on(&error))
}

/// The word in [`NO_NUMBERS`] that starts within the first bytes of the text, where the parser may have stopped.
fn no_number(from: &[u8]) -> Option<&'static str> {
    let starts_at = |at: u64| from.get(at as usize..).unwrap_or_default();
    let found = |word: &str| (0..BEFORE).any(|at| starts_at(at).starts_with(word.as_bytes()));
    NO_NUMBERS.into_iter().find(|word| found(word))
}

/// An upper bound of the number of values in a JSON text: elements of lists, fields of objects, and the lists and
/// objects.
pub fn values(text: &[u8]) -> u64 {
    let (mut count, mut in_text, mut is_escaped) = (1, false, false);
    for byte in text {
        match byte {
            _ if is_escaped => is_escaped = false,
            b'\\' if in_text => is_escaped = true,
            b'"' => in_text = !in_text,
            b',' | b'[' | b'{' if !in_text => count += 1,
            _ => {}
        }
    }
    count
}

/// Counts the bytes that a parser reads. The parser reads no byte after the end of an object, and none from `until` on.
pub(crate) struct CountingReader<'c, R> {
    pub from: R,
    pub at: &'c Cell<u64>,
    /// Offset where the current record must have ended.
    pub until: &'c Cell<u64>,
}

impl<R: Read> Read for CountingReader<'_, R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if self.at.get() >= self.until.get() {
            return Err(io::ErrorKind::FileTooLarge.into());
        }
        let count = self.from.read(bytes)?;
        self.at.set(self.at.get() + count as u64);
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::prelude::{PerInstance, Plane};
    use syntable_model::product::Product;
    use syntable_model::random::Stream;
    use syntable_model::scene::InstanceId;

    /// A value of any form, with up to three levels of lists and records.
    fn value(stream: &mut Stream, level: u32) -> Value {
        match stream.below(if level < 3 { 11 } else { 8 }) {
            0 => Value::Null,
            1 => Value::Bool(stream.below(2) == 1),
            2 => Value::Int(stream.below(1 << 40) as i64 - (1 << 39)),
            3 => Value::Uint(u64::MAX - stream.below(9)),
            4 => Value::Float([0.0, -1.5, 1e300, f64::NAN, f64::INFINITY][stream.below(5) as usize]),
            5 => Value::Text(["", "é\"\n"][stream.below(2) as usize].to_owned()),
            6 => Plane::from_fn(2, 2, |x, y| x as f32 + 0.5 * y as f32).encode(),
            7 => PerInstance::from_iter([(InstanceId(2), 0.5_f64)]).encode(),
            8 => Value::List((0..stream.below(4)).map(|_| value(stream, level + 1)).collect()),
            _ => Value::Record((0..stream.below(4)).map(|at| (format!("f{at}"), value(stream, level + 1))).collect()),
        }
    }

    #[test]
    fn records_read_directly_are_those_read_through_json() {
        let mut stream = Stream::root(8);
        for _ in 0..2_000 {
            let value = value(&mut stream, 0);
            let [direct, through] = [of_record::<Json>(&value), typed::<Json>(&value)].map(|read| read.ok());
            assert_eq!(direct, through, "{value:?}");
        }
    }

    #[test]
    fn values_are_counted_outside_of_texts() {
        for (text, most) in [("7", 1), ("[1,2,3]", 4), (r#"{"a,b":"[\",{","c":[]}"#, 4), (r#""a,b""#, 1), ("", 1)] {
            assert_eq!(values(text.as_bytes()), most, "{text}");
        }
        // No text has more values than the counted number.
        fn of(json: &serde_json::Value) -> u64 {
            1 + match json {
                serde_json::Value::Array(values) => values.iter().map(of).sum(),
                serde_json::Value::Object(fields) => fields.values().map(of).sum(),
                _ => 0,
            }
        }
        for text in ["[[],[[]],{}]", r#"{"a":{"b":[1,{"c":"}"}]},"d":null}"#, "[[[[1]]]]"] {
            let json = serde_json::from_str(text).expect("JSON");
            assert!(of(&json) <= values(text.as_bytes()) + 1, "{text}");
        }
    }
}
