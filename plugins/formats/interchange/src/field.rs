//! Fields of records that other programs may write differently.

use serde::de::{Error as _, MapAccess};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::value::RawValue;
use syntable_formats::json;

/// A field that may be missing, or have a value of another type. A wrong type is an error for code that reads the
/// field, but not for code that opens the file. `null` counts as missing.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum LenientField<T> {
    /// The record lacks the field.
    #[default]
    Missing,
    /// Its value.
    Is(T),
    /// The reason why the value has the wrong type.
    Other(String),
}

impl<T> LenientField<T> {
    /// Whether the record lacks the field.
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::Missing)
    }

    /// Its value; none if the field is missing or has another type.
    pub fn value(&self) -> Option<&T> {
        if let Self::Is(value) = self { Some(value) } else { None }
    }

    /// Its value; none if the field is missing.
    ///
    /// # Errors
    /// If the value has another type: the reason.
    pub fn get(&self) -> Result<Option<&T>, &str> {
        match self {
            Self::Missing => Ok(None),
            Self::Is(value) => Ok(Some(value)),
            Self::Other(reason) => Err(reason),
        }
    }
}

impl<T: for<'a> Deserialize<'a>> LenientField<T> {
    /// Reads the value of this field of a record. A value that follows `null` replaces it.
    ///
    /// # Errors
    /// If the record has two values of the field, or a value is no JSON.
    pub fn read<'de, A: MapAccess<'de>>(&mut self, name: &'static str, fields: &mut A) -> Result<(), A::Error> {
        self.read_by(|text| serde_json::from_str(text).ok(), name, fields)
    }

    /// As [`read`](Self::read), by a function that reads values without faults.
    pub fn read_by<'de, A: MapAccess<'de>>(
        &mut self,
        of_text: impl Fn(&str) -> Option<T>,
        name: &'static str,
        fields: &mut A,
    ) -> Result<(), A::Error> {
        let text: Box<RawValue> = fields.next_value()?;
        match std::mem::replace(self, Self::of_text(&text, of_text)?) {
            Self::Missing => Ok(()),
            _ => Err(A::Error::duplicate_field(name)),
        }
    }

    fn of_text<E: serde::de::Error>(text: &RawValue, of_text: impl Fn(&str) -> Option<T>) -> Result<Self, E> {
        if text.get() == "null" {
            return Ok(Self::Missing);
        }
        if let Some(value) = of_text(text.get()) {
            return Ok(Self::Is(value));
        }
        let read = serde_json::from_value(json::tree(text)?);
        Ok(read.map_or_else(|error| Self::Other(error.to_string()), Self::Is))
    }
}

impl<T> From<T> for LenientField<T> {
    fn from(value: T) -> Self {
        Self::Is(value)
    }
}

impl<'de, T: for<'a> Deserialize<'a>> Deserialize<'de> for LenientField<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = Box::<RawValue>::deserialize(deserializer)?;
        Self::of_text(&text, |text| serde_json::from_str(text).ok())
    }
}

impl<T: Serialize> Serialize for LenientField<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.value().serialize(serializer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, Default, Deserialize, Serialize)]
    #[serde(default)]
    struct OrderRecord {
        #[serde(skip_serializing_if = "LenientField::is_missing")]
        order: LenientField<u64>,
    }

    #[test]
    fn values_of_other_types_are_errors_of_those_who_read_them() {
        let order = |text: &str| serde_json::from_str::<OrderRecord>(text).expect("opens").order;
        assert_eq!(order("{}"), LenientField::Missing);
        assert_eq!(order(r#"{"order":null}"#), LenientField::Missing);
        assert_eq!(order(r#"{"order":3}"#).get(), Ok(Some(&3)));
        let odd = order(r#"{"order":[3]}"#);
        assert!(!odd.is_missing() && odd.value().is_none());
        assert!(odd.get().is_err_and(|reason| reason.contains("expected u64")), "{odd:?}");
        let written = |order| serde_json::to_string(&OrderRecord { order }).expect("JSON");
        assert_eq!([written(LenientField::Missing), written(7.into())], ["{}", r#"{"order":7}"#]);
    }
}
