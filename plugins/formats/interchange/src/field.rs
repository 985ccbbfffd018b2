//! Fields of records that other programs may write differently.

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value as Json;

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

impl<T> From<T> for LenientField<T> {
    fn from(value: T) -> Self {
        Self::Is(value)
    }
}

impl<'de, T: for<'a> Deserialize<'a>> Deserialize<'de> for LenientField<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let json = Json::deserialize(deserializer)?;
        Ok(match json.is_null() {
            true => Self::Missing,
            false => serde_json::from_value(json).map_or_else(|error| Self::Other(error.to_string()), Self::Is),
        })
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
