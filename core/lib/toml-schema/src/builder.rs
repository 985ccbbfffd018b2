//! Schemas in the form that the validator and editors share.

use schemars::generate::SchemaSettings;
use schemars::{Schema, SchemaGenerator};
use serde_json::{Map, Value as Json};

/// Generates the schemas of options in the form that the validator and editors share: draft-07, without `null`, one
/// `enum` for a choice of words.
#[derive(Debug)]
pub struct SchemaBuilder(SchemaGenerator);

impl Default for SchemaBuilder {
    fn default() -> Self {
        Self(SchemaSettings::draft07().into_generator())
    }
}

impl SchemaBuilder {
    /// The schema of a type. The types that it names are kept for [`definitions`](Self::definitions).
    pub fn add(&mut self, schema: impl FnOnce(&mut SchemaGenerator) -> Schema) -> Json {
        let mut schema = schema(&mut self.0);
        for transform in self.0.transforms_mut() {
            transform.transform(&mut schema);
        }
        let mut schema = schema.to_value();
        toml_only(&mut schema);
        schema
    }

    /// The targets of `$ref`, sorted by name.
    pub fn definitions(mut self) -> Map<String, Json> {
        let mut definitions = self.0.take_definitions(true);
        definitions.values_mut().for_each(toml_only);
        definitions.sort_keys();
        definitions
    }
}

/// Converts a schema to the form for TOML and its editors: no `null`, and one `enum` for a choice of words.
fn toml_only(schema: &mut Json) {
    match schema {
        Json::Object(object) => {
            if object.get("default") == Some(&Json::Null) {
                object.shift_remove("default");
            }
            if let Some(Json::Array(types)) = object.get_mut("type") {
                types.retain(|name| name != "null");
                if let [one] = types.as_slice() {
                    let one = one.clone();
                    object.insert("type".into(), one);
                }
            }
            for union in ["anyOf", "oneOf"] {
                if let Some(Json::Array(branches)) = object.get_mut(union) {
                    branches.retain(|branch| branch.get("type").and_then(Json::as_str) != Some("null"));
                    if branches.len() == 1 {
                        let branches = object.shift_remove(union).unwrap_or_default();
                        object.insert("allOf".into(), branches);
                    }
                }
            }
            merge_words(object);
            object.values_mut().for_each(toml_only);
        }
        Json::Array(items) => items.iter_mut().for_each(toml_only),
        _ => {}
    }
}

/// Turns a union of constant words into one `enum`, so that a wrong word gives one precise message. The meanings of the
/// words go into the description.
fn merge_words(schema: &mut Map<String, Json>) {
    let Some(branches) = schema.get("oneOf").and_then(Json::as_array) else { return };
    let (mut words, mut meanings) = (Vec::new(), Vec::new());
    for branch in branches {
        let of_branch: Vec<Json> = match (branch.get("const"), branch.get("enum").and_then(Json::as_array)) {
            (Some(word), None) => vec![word.clone()],
            (None, Some(several)) => several.clone(),
            _ => return,
        };
        for word in of_branch {
            let Some(text) = word.as_str() else { return };
            if let Some(meaning) = branch.get("description").and_then(Json::as_str) {
                meanings.push(format!("- `{text}`: {meaning}"));
            }
            words.push(word);
        }
    }
    let description = schema.get("description").and_then(Json::as_str).unwrap_or_default();
    let description = format!("{description}\n\n{}", meanings.join("\n"));
    schema.shift_remove("oneOf");
    schema.insert("type".into(), "string".into());
    schema.insert("enum".into(), words.into());
    schema.insert("description".into(), description.trim().into());
}
