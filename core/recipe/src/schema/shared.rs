//! Equal parts of a schema as definitions, each stated once.
//!
//! Options of a kind and of its draft, limits of distributions and tables without `kind` repeat the same parts. Shared
//! parts make the schema short. They also make editors fast: tombi reads the whole schema again at each reference that
//! points into a definition (`#/definitions/…/properties/…`), so every reference names a definition.

use serde_json::{Map, Value as Json, json};
use std::collections::HashMap;

/// How references to definitions begin.
pub const DEFINITIONS: &str = "#/definitions/";

/// Length of a reference, and of what a definition adds to its part, bytes.
const REFERENCE_BYTES: usize = 24;
const DEFINITION_BYTES: usize = 8;

/// Keywords whose values are maps of schemas.
const MAPS: [&str; 3] = ["definitions", "properties", "patternProperties"];

/// Keywords whose values are schemas or lists of schemas.
const SCHEMAS: [&str; 10] =
    ["items", "additionalProperties", "propertyNames", "if", "then", "else", "not", "anyOf", "oneOf", "allOf"];

/// Replaces references into definitions by the parts that they point to, and then equal parts by references to a
/// definition. Numbers of base 36 name the new definitions, in the order of their first use.
pub fn share(schema: &mut Json) {
    let definitions = schema["definitions"].clone();
    resolve_pointers(schema, &definitions);
    let mut uses = HashMap::new();
    count(schema, &mut uses);
    let mut sharing = Sharing { uses, names: HashMap::new(), shared: Vec::new() };
    let mut own = schema["definitions"].take();
    own.as_object_mut().into_iter().flat_map(Map::values_mut).for_each(|definition| sharing.below(definition));
    sharing.below(schema);
    if let Some(own) = own.as_object_mut() {
        own.extend(sharing.shared.into_iter().enumerate().map(|(index, part)| (name(index), part)));
    }
    schema["definitions"] = own;
}

/// Calls a function for each direct part of a schema that is a schema itself.
pub fn for_each_part(schema: &mut Json, visit: &mut dyn FnMut(&mut Json)) {
    for (keyword, value) in schema.as_object_mut().into_iter().flatten() {
        match value {
            Json::Object(parts) if MAPS.contains(&keyword.as_str()) => parts.values_mut().for_each(&mut *visit),
            Json::Array(parts) if SCHEMAS.contains(&keyword.as_str()) => parts.iter_mut().for_each(&mut *visit),
            part if SCHEMAS.contains(&keyword.as_str()) => visit(part),
            _ => {}
        }
    }
}

fn resolve_pointers(schema: &mut Json, definitions: &Json) {
    for_each_part(schema, &mut |part| {
        while let Some(path) = part["$ref"].as_str().and_then(|target| target.strip_prefix(DEFINITIONS))
            && let Some(target) = definitions.pointer(&format!("/{path}")).filter(|_| path.contains('/'))
        {
            *part = target.clone();
        }
        resolve_pointers(part, definitions);
    });
}

/// Counts equal parts. Parts of a repeated part count once, because they are shared with it.
fn count(schema: &mut Json, uses: &mut HashMap<String, usize>) {
    for_each_part(schema, &mut |part| {
        let uses_of_part = uses.entry(part.to_string()).or_default();
        *uses_of_part += 1;
        if *uses_of_part == 1 {
            count(part, uses);
        }
    });
}

/// The number from 1 in digits and letters: most references are a letter shorter than with digits alone.
fn name(index: usize) -> String {
    const BASE: usize = 36;
    let (mut rest, mut name) = (index + 1, String::new());
    while rest > 0 {
        let digit = char::from_digit((rest % BASE) as u32, BASE as u32).expect("below the base");
        name.insert(0, digit);
        rest /= BASE;
    }
    name
}

struct Sharing {
    /// The number of uses of each part, by its text.
    uses: HashMap<String, usize>,
    /// The index of each shared part.
    names: HashMap<String, usize>,
    shared: Vec<Json>,
}

impl Sharing {
    /// Shares the parts of a schema.
    fn below(&mut self, schema: &mut Json) {
        for_each_part(schema, &mut |part| {
            let text = part.to_string();
            let uses = self.uses.get(&text).copied().unwrap_or_default();
            let shared = text.len() + DEFINITION_BYTES + uses * REFERENCE_BYTES;
            let is_shared = uses * text.len() > shared && part.get("$ref").is_none();
            if !is_shared {
                self.below(part);
                return;
            }
            let index = match self.names.get(&text) {
                Some(index) => *index,
                None => {
                    let index = self.shared.len();
                    self.names.insert(text, index);
                    self.shared.push(Json::Null);
                    let mut whole = part.take();
                    self.below(&mut whole);
                    self.shared[index] = whole;
                    index
                }
            };
            *part = json!({ "$ref": format!("{DEFINITIONS}{}", name(index)) });
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The schema without references to shared parts.
    fn expanded(schema: &mut Json, definitions: &Json) {
        for_each_part(schema, &mut |part| {
            let name = part["$ref"].as_str().and_then(|target| target.strip_prefix(DEFINITIONS)).map(str::to_owned);
            if let Some(name) = name.filter(|name| name.len() <= 2) {
                *part = definitions[name].clone();
            }
            expanded(part, definitions);
        });
    }

    #[test]
    fn sharing_keeps_the_meaning() {
        let limit =
            json!({ "type": "number", "minimum": 1.0, "maximum": 10.0, "description": "A length that is long." });
        let range = json!({ "type": "array", "items": limit, "minItems": 2, "maxItems": 2 });
        let kind = json!({ "properties": { "size": range, "other": { "anyOf": [limit, { "const": "none" }] } } });
        let whole = json!({
            "properties": { "a": { "$ref": "#/definitions/kind" }, "b": { "$ref": "#/definitions/kind/properties/size" } },
            "definitions": { "kind": kind, "draft": kind }
        });
        let mut schema = whole.clone();
        share(&mut schema);
        let text = schema.to_string();
        assert!(!text.contains("kind/properties") && text.matches("A length that is long.").count() == 1, "{text}");
        let definitions = schema["definitions"].clone();
        expanded(&mut schema, &definitions);
        assert_eq!(schema["properties"]["b"], range);
        assert_eq!(schema["definitions"]["kind"], kind);
        assert_eq!(schema["definitions"]["draft"], kind);
        assert_eq!(schema["properties"]["a"], whole["properties"]["a"]);
    }
}
