//! The keywords that the validator knows.

use serde_json::{Map, Value as Json};

/// Schema keywords that the validator checks, and annotations. Keywords that begin with `x-` are annotations, too.
pub const KEYWORDS: [&str; 29] = [
    "$ref",
    "additionalItems",
    "additionalProperties",
    "allOf",
    "anyOf",
    "const",
    "default",
    "description",
    "enum",
    "examples",
    "exclusiveMaximum",
    "exclusiveMinimum",
    "format",
    "items",
    "maxItems",
    "maxLength",
    "maxProperties",
    "maximum",
    "minItems",
    "minLength",
    "minProperties",
    "minimum",
    "multipleOf",
    "oneOf",
    "properties",
    "required",
    "title",
    "type",
    "uniqueItems",
];

/// Number formats whose ranges are known to the validator or stated in the schema.
const FORMATS: [&str; 12] =
    ["int8", "int16", "int32", "int64", "int", "uint8", "uint16", "uint32", "uint64", "uint", "float", "double"];

/// Conditions of a schema and its definitions that the validator does not check, such as `` keyword `pattern` at `name`
/// ``.
pub fn unsupported(schema: &Json, definitions: &Map<String, Json>) -> Vec<String> {
    let mut faults = Vec::new();
    unsupported_in(schema, "", definitions, &mut Vec::new(), &mut faults);
    faults
}

fn unsupported_in<'s>(
    schema: &'s Json,
    place: &str,
    definitions: &'s Map<String, Json>,
    seen: &mut Vec<&'s str>,
    faults: &mut Vec<String>,
) {
    let Some(object) = schema.as_object() else {
        if !schema.is_boolean() {
            faults.push(format!("no schema at `{place}`"));
        }
        return;
    };
    let below = |key: &str| if place.is_empty() { key.to_owned() } else { format!("{place}.{key}") };
    for (keyword, value) in object {
        let known = KEYWORDS.contains(&keyword.as_str()) || keyword.starts_with("x-");
        let fits = match keyword.as_str() {
            "format" => value.as_str().is_some_and(|format| FORMATS.contains(&format)),
            "const" => value.is_string(),
            "enum" => value.as_array().is_some_and(|words| words.iter().all(Json::is_string)),
            _ => true,
        };
        if !known || !fits {
            let value = if known { format!(": {value}") } else { String::new() };
            faults.push(format!("the unsupported keyword `{keyword}`{value} at `{place}`"));
        }
        match (keyword.as_str(), value) {
            ("properties", Json::Object(properties)) => {
                for (name, schema) in properties {
                    unsupported_in(schema, &below(name), definitions, seen, faults);
                }
            }
            ("items" | "oneOf" | "anyOf" | "allOf", Json::Array(schemas)) => {
                for schema in schemas {
                    unsupported_in(schema, place, definitions, seen, faults);
                }
            }
            ("items" | "additionalItems" | "additionalProperties", schema) => {
                unsupported_in(schema, place, definitions, seen, faults);
            }
            ("$ref", Json::String(target)) => {
                let name = target.trim_start_matches("#/definitions/");
                match definitions.get_key_value(name) {
                    None => faults.push(format!("no definition of `{target}` at `{place}`")),
                    Some((name, _)) if seen.contains(&name.as_str()) => {}
                    Some((name, schema)) => {
                        seen.push(name);
                        unsupported_in(schema, place, definitions, seen, faults);
                    }
                }
            }
            _ => {}
        }
    }
}
