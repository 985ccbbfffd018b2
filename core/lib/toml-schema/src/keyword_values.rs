//! Values of the keywords of a schema.

use crate::REFERENCE;
use crate::value::TomlType;
use serde_json::Value as Json;

/// The types that a schema allows; empty if it does not state them.
pub(crate) fn types(schema: &Json) -> Vec<&str> {
    match schema.get("type") {
        Some(Json::String(one)) => vec![one],
        Some(Json::Array(several)) => several.iter().filter_map(Json::as_str).collect(),
        _ => Vec::new(),
    }
}

/// The type that a schema requires, if it is the only one and messages need no further details.
pub(crate) fn sole_type(schema: &Json) -> Option<TomlType> {
    let [kind] = types(schema)[..] else { return None };
    match kind {
        _ if choices(schema).is_some() || schema.get(REFERENCE).is_some() => None,
        "string" => Some(TomlType::String),
        "integer" => Some(TomlType::Integer),
        "number" => Some(TomlType::Float),
        "boolean" => Some(TomlType::Boolean),
        "array" if array_length(schema).is_none() => Some(TomlType::Array),
        _ => None,
    }
}

pub(crate) fn array_length(schema: &Json) -> Option<u64> {
    let limit = |key: &str| schema.get(key).and_then(Json::as_u64);
    limit("minItems").filter(|least| limit("maxItems") == Some(*least))
}

/// The strings that a schema allows, if it lists them.
pub(crate) fn choices(schema: &Json) -> Option<Vec<&str>> {
    let listed = schema.get("enum").and_then(Json::as_array);
    listed
        .map(|words| words.iter().filter_map(Json::as_str).collect())
        .or_else(|| Some(vec![schema.get("const")?.as_str()?]))
}

/// The key of a table form with exactly one key, such as `of_table`.
pub(crate) fn sole_key(schema: &Json) -> Option<&str> {
    let properties = schema.get("properties")?.as_object()?;
    let required = schema.get("required")?.as_array()?;
    match (properties.len(), required.as_slice()) {
        (1, [Json::String(key)]) if constant(schema, key).is_none() => Some(key),
        _ => None,
    }
}

/// The keys of a table form that has exactly one key: its only key, or one of several alternatives.
pub(crate) fn form_keys(schema: &Json) -> Vec<&str> {
    let one_of_several = schema.get("maxProperties").and_then(Json::as_u64) == Some(1);
    let properties = schema.get("properties").and_then(Json::as_object).filter(|_| one_of_several);
    properties.map_or_else(
        || sole_key(schema).into_iter().collect(),
        |properties| properties.keys().map(String::as_str).collect(),
    )
}

/// A key of a table form whose value is one constant.
pub(crate) fn constant_key(schema: &Json) -> Option<&str> {
    let properties = schema.get("properties")?.as_object()?;
    properties.keys().map(String::as_str).find(|key| constant(schema, key).is_some())
}

pub(crate) fn constant<'j>(schema: &'j Json, key: &str) -> Option<&'j str> {
    let option = schema.get("properties")?.get(key)?;
    match choices(option)?.as_slice() {
        [word] => Some(word),
        _ => None,
    }
}
