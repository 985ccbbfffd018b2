//! Options of a kind in words, for the command line.

use crate::schema::kinds::Schemas;
use serde_json::Value as Json;
use syntable_model::names::SupportName;
use syntable_model::registry::{Entry, Registry};
use syntable_toml_schema::{KEY_REFERENCE, REFERENCE};

/// An option of a kind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OptionInfo {
    /// Its path in the table: `count`, or `material.from`.
    pub path: String,
    /// The allowed values, with their limits: `integer, 1 to 100`.
    pub value: String,
    /// The default as TOML; none if the option may be left out.
    pub default: Option<String>,
    /// Whether it must be given.
    pub required: bool,
    /// Its meaning.
    pub meaning: String,
}

/// The options of a kind, then the options of its tables. A source of assets also has the options of every pool.
pub fn options_of(registry: &Registry, entry: &Entry) -> Vec<OptionInfo> {
    let schemas = Schemas::of(registry);
    let Some(kind) = schemas.kind(entry.slot, entry.kind) else { return Vec::new() };
    let mut options = Vec::new();
    Describer { schemas: &schemas }.table("", &kind.options, &mut options);
    options
}

/// The whole description of a kind.
pub fn description_of(registry: &Registry, entry: &Entry) -> String {
    let schemas = Schemas::of(registry);
    let kind = schemas.kind(entry.slot, entry.kind);
    kind.and_then(|kind| kind.options["description"].as_str()).unwrap_or_default().to_owned()
}

struct Describer<'s> {
    schemas: &'s Schemas,
}

impl<'s> Describer<'s> {
    fn table(&self, parent: &str, schema: &'s Json, options: &mut Vec<OptionInfo>) {
        let required =
            |name: &str| schema["required"].as_array().is_some_and(|keys| keys.iter().any(|key| key == name));
        for (name, option) in schema["properties"].as_object().into_iter().flatten() {
            let path = if parent.is_empty() { name.clone() } else { format!("{parent}.{name}") };
            let target = self.resolve(option);
            let text = |schema: &Json| schema["description"].as_str().map(one_line);
            options.push(OptionInfo {
                value: self.value(option),
                default: option.get("default").or(target.get("default")).map(toml_like),
                required: required(name),
                meaning: text(option).or_else(|| text(target)).unwrap_or_default(),
                path: path.clone(),
            });
            // A distribution is one value with several spellings.
            if target["type"] == "object" && parent.matches('.').count() < 2 {
                self.table(&path, target, options);
            }
        }
    }

    /// Follows references, and `allOf` of one.
    fn resolve(&self, schema: &'s Json) -> &'s Json {
        let schema = self.schemas.validator().target(schema);
        match schema["allOf"].as_array().map(Vec::as_slice) {
            Some([only]) => self.resolve(only),
            _ => schema,
        }
    }

    /// The allowed values.
    fn value(&self, option: &'s Json) -> String {
        let schema = self.resolve(option);
        match schema[REFERENCE].as_str() {
            Some("path") => return "path".to_owned(),
            Some("product") => return "product".to_owned(),
            Some(SupportName::REFERENCE) => return "support".to_owned(),
            Some(other) => {
                let class = other.trim_start_matches("pool:");
                return format!("pool of {class}{}", if class == "environment" { " maps" } else { "s" });
            }
            None => {}
        }
        if let Some(words) = schema["enum"].as_array() {
            return words.iter().map(toml_like).collect::<Vec<_>>().join(" | ");
        }
        if let Some(word) = schema.get("const") {
            return toml_like(word);
        }
        if let Some(forms) = schema["oneOf"].as_array().or(schema["anyOf"].as_array()) {
            let mut forms: Vec<String> = forms.iter().map(|form| self.value(form)).collect();
            forms.dedup();
            return forms.join(" | ");
        }
        let limits = limits(option).or_else(|| limits(schema)).unwrap_or_default();
        match &schema["type"] {
            Json::Array(types) => {
                let number = types.first().and_then(Json::as_str).unwrap_or("number");
                format!("{number} or distribution{limits}")
            }
            Json::String(name) => match name.as_str() {
                "array" => match &schema["items"] {
                    Json::Array(items) => {
                        format!("[{}]", items.iter().map(|item| self.value(item)).collect::<Vec<_>>().join(", "))
                    }
                    item => {
                        let item = if item.is_object() { self.value(item) } else { "any value".to_owned() };
                        match (schema["minItems"].as_u64(), schema["maxItems"].as_u64()) {
                            (Some(least), Some(most)) if least == most => format!("{least} × {item}"),
                            _ => format!("list of {item}"),
                        }
                    }
                },
                "object" => {
                    let keys: Vec<&str> =
                        schema["properties"].as_object().into_iter().flatten().map(|(key, _)| key.as_str()).collect();
                    if schema[KEY_REFERENCE].is_string() {
                        "{ pool = weight, … }".to_owned()
                    } else if keys.is_empty() {
                        "table".to_owned()
                    } else {
                        format!("{{ {} }}", keys.join(", "))
                    }
                }
                "string" => "text".to_owned(),
                "boolean" => "true | false".to_owned(),
                other => format!("{other}{limits}"),
            },
            _ => "any value".to_owned(),
        }
    }
}

/// Limits of a number, in words.
fn limits(schema: &Json) -> Option<String> {
    let limit = |key: &str| schema.get(key).map(toml_like);
    let least = limit("minimum").or_else(|| limit("exclusiveMinimum").map(|low| format!("above {low}")));
    let most = limit("maximum").or_else(|| limit("exclusiveMaximum").map(|high| format!("below {high}")));
    match (least, most) {
        (Some(least), Some(most)) => Some(format!(", {least} to {most}")),
        (Some(least), None) if least.starts_with("above") => Some(format!(", {least}")),
        (Some(least), None) => Some(format!(", at least {least}")),
        (None, Some(most)) => Some(format!(", at most {most}")),
        (None, None) => None,
    }
}

/// A value as TOML would write it.
fn toml_like(value: &Json) -> String {
    match value {
        Json::Number(number) => match number.as_f64().filter(|float| float.fract() == 0.0 && float.abs() < 1e15) {
            Some(whole) => format!("{whole}"),
            None => number.to_string(),
        },
        other => toml::Value::try_from(other).map_or_else(|_| other.to_string(), |value| value.to_string()),
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
