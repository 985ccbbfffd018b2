//! Validation of option tables against their JSON Schema.
//!
//! The schema that a [`Config`](crate::registry::Config) derives is the one statement of its limits.
//! [`Entry::construct`](crate::registry::Entry::construct) refuses what the schema refuses; the recipe loader runs the
//! same [`Validator`] over spanned tables and turns every [`Finding`] into a diagnostic; editors read the same schema.
//!
//! The validator knows the keywords in [`KEYWORDS`]. [`unsupported`] lists all others that a schema uses: a limit that
//! nobody checks is a mistake of the plugin.

use crate::error::ConfigError;
use crate::names::{KEY_REFERENCE, REFERENCE};
use crate::product::first_sentence;
use crate::registry::RecipeValue;
use schemars::generate::SchemaSettings;
use schemars::{Schema, SchemaGenerator};
use serde_json::{Map, Value as Json};
use std::borrow::Cow;
use std::fmt;
use std::ops::Range;
use toml::de::{DeTable, DeValue};

/// Schema keywords that the validator checks or that only annotate; those that begin with `x-` annotate as well.
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

/// Number formats whose ranges the validator knows or the schema states.
const FORMATS: [&str; 12] =
    ["int8", "int16", "int32", "int64", "int", "uint8", "uint16", "uint32", "uint64", "uint", "float", "double"];

/// One step from a value into it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Step {
    /// A key of a table; in a list of stages, the id of one.
    Key(String),
    /// An element of an array, from 0.
    Index(usize),
}

/// Displays a path as TOML would write it: `lights[0].count`, `assets."my pool".root`.
pub struct DisplayPath<'a>(pub &'a [Step]);

impl fmt::Display for DisplayPath<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (position, step) in self.0.iter().enumerate() {
            match step {
                Step::Key(key) => {
                    let dot = if position > 0 { "." } else { "" };
                    if is_bare(key) { write!(f, "{dot}{key}")? } else { write!(f, "{dot}{key:?}")? }
                }
                Step::Index(index) => write!(f, "[{index}]")?,
            }
        }
        Ok(())
    }
}

/// Whether a key needs no quotes in TOML.
pub fn is_bare(key: &str) -> bool {
    !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-')
}

/// Lists names in backticks.
pub fn listing<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<String> = names.into_iter().map(|name| format!("`{name}`")).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// Type of a TOML value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Type {
    /// `"…"`
    String,
    /// `3`
    Integer,
    /// `3.5`; as a wanted type, any number.
    Float,
    /// `true`
    Boolean,
    /// `1979-05-27`
    Datetime,
    /// `[…]`
    Array,
    /// `{…}`
    Table,
}

impl Type {
    /// The type with its article: `an integer`.
    pub fn with_article(self) -> &'static str {
        match self {
            Self::String => "a string",
            Self::Integer => "an integer",
            Self::Float => "a float",
            Self::Boolean => "a boolean",
            Self::Datetime => "a date",
            Self::Array => "an array",
            Self::Table => "a table",
        }
    }

    /// Whether a value of this type is of a JSON Schema type.
    fn is(self, name: &str) -> bool {
        match self {
            Self::String => name == "string",
            Self::Integer => name == "integer" || name == "number",
            Self::Float => name == "number",
            Self::Boolean => name == "boolean",
            Self::Datetime => false,
            Self::Array => name == "array",
            Self::Table => name == "object",
        }
    }
}

/// A TOML value that can be validated: one with spans from a file, or a plain one.
pub trait Node: Sized {
    /// The value.
    fn view(&self) -> View<'_, Self>;
    /// Bytes of the value in its text; empty for a plain value.
    fn span(&self) -> Range<usize>;
}

/// What a [`Node`] holds.
pub enum View<'v, N> {
    /// A string.
    String(&'v str),
    /// An integer as written, and its value if 64 bits hold it.
    Integer(Cow<'v, str>, Option<i64>),
    /// A float as written, and its value.
    Float(Cow<'v, str>, f64),
    /// A boolean.
    Boolean(bool),
    /// A date or time.
    Datetime,
    /// An array.
    Array(&'v [N]),
    /// A table, in the order of its text.
    Table(Vec<Member<'v, N>>),
}

/// A key and its value.
pub struct Member<'v, N> {
    /// The key.
    pub key: &'v str,
    /// Bytes of the key.
    pub key_span: Range<usize>,
    /// The value.
    pub value: &'v N,
}

impl<N> View<'_, N> {
    /// The value's type.
    pub fn of_type(&self) -> Type {
        match self {
            Self::String(_) => Type::String,
            Self::Integer(..) => Type::Integer,
            Self::Float(..) => Type::Float,
            Self::Boolean(_) => Type::Boolean,
            Self::Datetime => Type::Datetime,
            Self::Array(_) => Type::Array,
            Self::Table(_) => Type::Table,
        }
    }

    /// The text of a scalar, without quotes; empty for others.
    fn text(&self) -> String {
        match self {
            Self::String(text) => (*text).to_owned(),
            Self::Integer(text, _) | Self::Float(text, _) => text.clone().into_owned(),
            Self::Boolean(value) => value.to_string(),
            Self::Datetime | Self::Array(_) | Self::Table(_) => String::new(),
        }
    }
}

impl Node for RecipeValue<'_> {
    fn view(&self) -> View<'_, Self> {
        match self.get_ref() {
            DeValue::String(text) => View::String(text),
            DeValue::Integer(integer) => {
                View::Integer(integer.as_str().into(), i64::from_str_radix(integer.as_str(), integer.radix()).ok())
            }
            DeValue::Float(float) => View::Float(float.as_str().into(), float.as_str().parse().unwrap_or(f64::NAN)),
            DeValue::Boolean(value) => View::Boolean(*value),
            DeValue::Datetime(_) => View::Datetime,
            DeValue::Array(items) => View::Array(items),
            DeValue::Table(table) => View::Table(spanned_members(table)),
        }
    }
    fn span(&self) -> Range<usize> {
        toml::Spanned::span(self)
    }
}

impl Node for toml::Value {
    fn view(&self) -> View<'_, Self> {
        match self {
            Self::String(text) => View::String(text),
            Self::Integer(value) => View::Integer(value.to_string().into(), Some(*value)),
            Self::Float(value) => View::Float(format!("{value:?}").into(), *value),
            Self::Boolean(value) => View::Boolean(*value),
            Self::Datetime(_) => View::Datetime,
            Self::Array(items) => View::Array(items),
            Self::Table(table) => View::Table(plain_members(table)),
        }
    }
    fn span(&self) -> Range<usize> {
        0..0
    }
}

/// The members of a parsed table.
pub fn spanned_members<'v, 'a>(table: &'v DeTable<'a>) -> Vec<Member<'v, RecipeValue<'a>>> {
    let members = table.iter();
    members.map(|(key, value)| Member { key: key.get_ref().as_ref(), key_span: key.span(), value }).collect()
}

/// The members of a plain table.
pub fn plain_members(table: &toml::Table) -> Vec<Member<'_, toml::Value>> {
    table.iter().map(|(key, value)| Member { key, key_span: 0..0, value }).collect()
}

/// A string or a key that names something, as its schema says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reference {
    /// What it names: `path`, `product`, `pool:object`, `pool:material`, `pool:environment`.
    pub what: String,
    /// The string or the key.
    pub text: String,
    /// Bytes of the value or of the key.
    pub span: Range<usize>,
    /// Path from the stage's table.
    pub path: Vec<Step>,
}

/// A value that its schema refuses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// Path from the stage's table to the value or key at fault.
    pub path: Vec<Step>,
    /// Bytes at fault: of the value, of an unknown key, or of the table that lacks a key.
    pub span: Range<usize>,
    /// What is wrong: lower case, no full stop.
    pub message: String,
    /// The kind of mistake, with what a message about it may add.
    pub problem: Problem,
}

impl From<Finding> for ConfigError {
    fn from(finding: Finding) -> Self {
        let invalid = Self::new(DisplayPath(&finding.path).to_string(), finding.message);
        let names = |names: &[String]| listing(names.iter().map(String::as_str));
        match finding.problem {
            Problem::OutOfRange { allowed } if !allowed.is_empty() => invalid.help(allowed),
            Problem::UnknownChoice { choices, forms, .. } if forms.is_empty() => {
                invalid.help(format!("one of {}", names(&choices)))
            }
            Problem::UnknownChoice { choices, forms, .. } => {
                invalid.help(format!("one of {}, or a table with one of {}", names(&choices), names(&forms)))
            }
            Problem::UnknownKey { known, form: false, .. } if !known.is_empty() => {
                invalid.help(format!("its options are {}", names(&known)))
            }
            Problem::UnknownKey { known: forms, .. } | Problem::NotOneForm { forms } if !forms.is_empty() => {
                invalid.help(format!("one of {}", names(&forms)))
            }
            _ => invalid,
        }
    }
}

/// Kinds of mistakes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Problem {
    /// The value has another type.
    WrongType {
        /// The one type that is wanted, unless more is asked of it or several types fit.
        wanted: Option<Type>,
        /// Type of the value.
        found: Type,
        /// Text of the value, without quotes; empty for arrays, tables and dates.
        text: String,
    },
    /// A number, a length or a count is outside its limits.
    OutOfRange {
        /// What is allowed: `at most 5`; may be empty.
        allowed: String,
    },
    /// The string is none of the choices.
    UnknownChoice {
        /// The string.
        text: String,
        /// All choices.
        choices: Vec<String>,
        /// Keys of tables that would do as well.
        forms: Vec<String>,
    },
    /// An array holds the same string twice.
    Repeated {
        /// Bytes of the first.
        first: Range<usize>,
    },
    /// The table has no such option.
    UnknownKey {
        /// The key.
        key: String,
        /// All keys that the table knows.
        known: Vec<String>,
        /// Whether the keys are alternatives of which one is given.
        form: bool,
    },
    /// A required option is missing; the path ends in its key.
    MissingKey {
        /// Its key.
        key: String,
        /// What it means: the first sentence of its description.
        meaning: Option<String>,
        /// Its choices, if it has few.
        choices: Vec<String>,
    },
    /// The table gives none or several of its alternatives.
    NotOneForm {
        /// The alternatives; empty if the message names them.
        forms: Vec<String>,
    },
}

/// Result of a validation.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Outcome {
    /// All mistakes, in the order of the text.
    pub findings: Vec<Finding>,
    /// All names of assets, products and paths.
    pub references: Vec<Reference>,
}

impl Outcome {
    fn push(&mut self, path: &[Step], span: Range<usize>, message: String, problem: Problem) {
        self.findings.push(Finding { path: path.to_vec(), span, message, problem });
    }
}

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
    /// The schema of a type; the types that it names are kept for [`definitions`](Self::definitions).
    pub fn add(&mut self, schema: impl FnOnce(&mut SchemaGenerator) -> Schema) -> Json {
        let mut schema = schema(&mut self.0);
        for transform in self.0.transforms_mut() {
            transform.transform(&mut schema);
        }
        let mut schema = schema.to_value();
        toml_only(&mut schema);
        schema
    }

    /// What `$ref` refers to, sorted by name.
    pub fn definitions(mut self) -> Map<String, Json> {
        let mut definitions = self.0.take_definitions(true);
        definitions.values_mut().for_each(toml_only);
        definitions.sort_keys();
        definitions
    }
}

/// Refuses a table that the schema of a type refuses, naming the first mistake.
pub(crate) fn check(
    owner: &str,
    schema: impl FnOnce(&mut SchemaGenerator) -> Schema,
    table: &RecipeValue,
) -> Result<(), ConfigError> {
    let mut builder = SchemaBuilder::default();
    let schema = builder.add(schema);
    let definitions = builder.definitions();
    if let Some(fault) = unsupported(&schema, &definitions).into_iter().next() {
        return Err(ConfigError::new("", format!("the schema of `{owner}` has {fault}")));
    }
    let DeValue::Table(members) = table.get_ref() else {
        return Err(ConfigError::new("", format!("`{owner}` must be a table")));
    };
    let outcome = Validator { definitions: &definitions }.table(owner, spanned_members(members), table.span(), &schema);
    outcome.findings.into_iter().next().map_or(Ok(()), |finding| Err(finding.into()))
}

/// Brings a schema into the form that suits TOML and its editors: no `null`, and one `enum` for a choice of words.
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

/// What a schema and its definitions demand that the validator does not check, such as `` keyword `pattern` at `name` ``.
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

/// Validates tables against schemas.
#[derive(Debug, Clone, Copy)]
pub struct Validator<'s> {
    /// What `$ref` refers to.
    pub definitions: &'s Map<String, Json>,
}

/// The value under validation: its path, and the name of the table that the path starts from.
#[derive(Clone, Copy)]
struct At<'p> {
    owner: &'p str,
    path: &'p [Step],
}

impl At<'_> {
    fn key(&self, key: &str) -> Vec<Step> {
        [self.path, &[Step::Key(key.to_owned())]].concat()
    }

    fn index(&self, index: usize) -> Vec<Step> {
        [self.path, &[Step::Index(index)]].concat()
    }

    /// Name of the value in messages.
    fn name(&self) -> String {
        if self.path.is_empty() { self.owner.to_owned() } else { DisplayPath(self.path).to_string() }
    }

    /// Name of the table that the value is.
    fn table(&self) -> String {
        match self.path {
            [] => self.owner.to_owned(),
            path => format!("{}.{}", self.owner, DisplayPath(path)),
        }
    }
}

impl<'s> Validator<'s> {
    /// Validates a table of options. `owner` names it in messages; `header` is where missing keys are reported.
    pub fn table<N: Node>(
        &self,
        owner: &str,
        members: Vec<Member<N>>,
        header: Range<usize>,
        schema: &'s Json,
    ) -> Outcome {
        let mut outcome = Outcome::default();
        self.members(&members, header, schema, At { owner, path: &[] }, &mut outcome);
        outcome
    }

    /// Follows `$ref`.
    pub fn target(&self, mut schema: &'s Json) -> &'s Json {
        while let Some(target) = schema.get("$ref").and_then(Json::as_str) {
            let name = target.trim_start_matches("#/definitions/");
            match self.definitions.get(name) {
                Some(definition) => schema = definition,
                None => break,
            }
        }
        schema
    }

    fn value<N: Node>(&self, value: &N, schema: &'s Json, at: At, outcome: &mut Outcome) {
        let schema = self.target(schema);
        for part in schema.get("allOf").and_then(Json::as_array).into_iter().flatten() {
            self.value(value, part, at, outcome);
        }
        for union in ["oneOf", "anyOf"] {
            if let Some(branches) = schema.get(union).and_then(Json::as_array) {
                self.union(value, branches, at, outcome);
            }
        }
        let view = value.view();
        let before = outcome.findings.len();
        self.scalar(&view, value.span(), schema, at, outcome);
        if outcome.findings.len() > before {
            return;
        }
        match view {
            View::Table(members) => self.members(&members, value.span(), schema, at, outcome),
            View::Array(items) => self.array(items, value.span(), schema, at, outcome),
            View::String(text) => {
                if let Some(what) = schema.get(REFERENCE).and_then(Json::as_str) {
                    outcome.references.push(Reference {
                        what: what.to_owned(),
                        text: text.to_owned(),
                        span: value.span(),
                        path: at.path.to_vec(),
                    });
                }
            }
            _ => {}
        }
    }

    /// Type, choices and limits of one value.
    fn scalar<N>(&self, view: &View<N>, span: Range<usize>, schema: &'s Json, at: At, outcome: &mut Outcome) {
        let name = at.name();
        let types = types(schema);
        let of_type = types.is_empty() || types.iter().any(|kind| view.of_type().is(kind));
        if !of_type || (choices(schema).is_some() && view.of_type() != Type::String) {
            return outcome.findings.push(wrong_type(
                view,
                span,
                &self.expected(schema),
                sole_type(schema),
                at.path,
                &name,
            ));
        }
        match view {
            View::String(text) => {
                if let Some(choices) = choices(schema).filter(|choices| !choices.contains(text)) {
                    return outcome.findings.push(unknown_choice(at.path, &name, text, span, &choices, &[]));
                }
                let length = text.chars().count() as u64;
                let limit = |key: &str| schema.get(key).and_then(Json::as_u64);
                if let Some(least) = limit("minLength").filter(|least| length < *least) {
                    let (message, allowed) = match least {
                        1 => (format!("`{name}` must not be empty"), String::new()),
                        _ => (format!("`{name}` has {length} characters"), format!("at least {least}")),
                    };
                    outcome.push(at.path, span, message, Problem::OutOfRange { allowed });
                } else if let Some(most) = limit("maxLength").filter(|most| length > *most) {
                    let message = format!("`{name}` has {length} characters");
                    outcome.push(at.path, span, message, Problem::OutOfRange { allowed: format!("at most {most}") });
                }
            }
            View::Integer(text, None) => {
                let allowed = format!("64-bit integers end at {}", i64::MAX);
                outcome.push(at.path, span, format!("`{name}` cannot be {text}"), Problem::OutOfRange { allowed });
            }
            View::Integer(_, Some(value)) => {
                self.limits(&value.to_string(), *value as f64, span, schema, at, outcome);
            }
            View::Float(text, value) => self.limits(text, *value, span, schema, at, outcome),
            _ => {}
        }
    }

    fn limits(&self, text: &str, number: f64, span: Range<usize>, schema: &Json, at: At, outcome: &mut Outcome) {
        let limit = |key: &str| schema.get(key).and_then(Json::as_f64);
        let format_limit = |low: bool| {
            let (least, most) = match schema.get("format").and_then(Json::as_str)? {
                "int32" => (f64::from(i32::MIN), f64::from(i32::MAX)),
                "uint32" => (0.0, f64::from(u32::MAX)),
                _ => return None,
            };
            Some(if low { least } else { most })
        };
        let least = limit("minimum").into_iter().chain(format_limit(true)).reduce(f64::max);
        let most = limit("maximum").into_iter().chain(format_limit(false)).reduce(f64::min);
        let allowed = if !number.is_finite() {
            "a finite number is needed".to_owned()
        } else if let Some(least) = least.filter(|least| number < *least) {
            format!("at least {least}")
        } else if let Some(most) = most.filter(|most| number > *most) {
            format!("at most {most}")
        } else if let Some(low) = limit("exclusiveMinimum").filter(|low| number <= *low) {
            format!("above {low}")
        } else if let Some(high) = limit("exclusiveMaximum").filter(|high| number >= *high) {
            format!("below {high}")
        } else if let Some(step) = limit("multipleOf").filter(|step| (number / step).fract() != 0.0) {
            format!("a multiple of {step}")
        } else {
            return;
        };
        outcome.push(at.path, span, format!("`{}` cannot be {text}", at.name()), Problem::OutOfRange { allowed });
    }

    fn array<N: Node>(&self, items: &[N], span: Range<usize>, schema: &'s Json, at: At, outcome: &mut Outcome) {
        let name = at.name();
        let count = items.len() as u64;
        let limit = |key: &str| schema.get(key).and_then(Json::as_u64);
        let (least, most) = (limit("minItems").unwrap_or(0), limit("maxItems").unwrap_or(u64::MAX));
        if count < least || count > most {
            let allowed = match (least, most) {
                (least, most) if least == most => format!("exactly {least}"),
                (least, _) if count < least => format!("at least {least}"),
                _ => format!("at most {most}"),
            };
            let message = match count {
                0 => format!("`{name}` must not be empty"),
                1 => format!("`{name}` has 1 element"),
                _ => format!("`{name}` has {count} elements"),
            };
            outcome.push(at.path, span, message, Problem::OutOfRange { allowed });
        }
        let unique = schema.get("uniqueItems").and_then(Json::as_bool).unwrap_or(false);
        let mut seen: Vec<(&str, Range<usize>)> = Vec::new();
        for (index, item) in items.iter().enumerate() {
            let path = at.index(index);
            let inner = At { owner: at.owner, path: &path };
            let schema = match schema.get("items") {
                Some(Json::Array(each)) => each.get(index).or(schema.get("additionalItems")),
                all => all,
            };
            if let Some(schema) = schema {
                self.value(item, schema, inner, outcome);
            }
            if let (true, View::String(text)) = (unique, item.view()) {
                match seen.iter().find(|(other, _)| *other == text) {
                    Some((_, first)) => {
                        let problem = Problem::Repeated { first: first.clone() };
                        outcome.push(&path, item.span(), format!("`{name}` names `{text}` twice"), problem);
                    }
                    None => seen.push((text, item.span())),
                }
            }
        }
    }

    fn members<N: Node>(
        &self,
        members: &[Member<N>],
        header: Range<usize>,
        schema: &'s Json,
        at: At,
        outcome: &mut Outcome,
    ) {
        let properties = schema.get("properties").and_then(Json::as_object);
        let open = schema.get("additionalProperties");
        let known = || properties.into_iter().flat_map(|properties| properties.keys().map(String::as_str));
        let keys = schema.get(KEY_REFERENCE).and_then(Json::as_str);
        for member in members {
            let path = at.key(member.key);
            outcome.references.extend(keys.map(|what| Reference {
                what: what.to_owned(),
                text: member.key.to_owned(),
                span: member.key_span.clone(),
                path: path.clone(),
            }));
            let inner = At { owner: at.owner, path: &path };
            if let Some(schema) = properties.and_then(|properties| properties.get(member.key)) {
                self.value(member.value, schema, inner, outcome);
            } else if let Some(schema) = open.filter(|schema| schema.is_object()) {
                self.value(member.value, schema, inner, outcome);
            } else if open == Some(&Json::Bool(false)) {
                // A table whose schema does not mention keys is judged by the union around it.
                let message = format!("`{}` has no option `{}`", at.table(), member.key);
                let known = known().map(str::to_owned).collect();
                let problem = Problem::UnknownKey { key: member.key.to_owned(), known, form: false };
                outcome.push(&path, member.key_span.clone(), message, problem);
            }
        }
        for key in schema.get("required").and_then(Json::as_array).into_iter().flatten().filter_map(Json::as_str) {
            if !members.iter().any(|member| member.key == key) {
                let option = properties.and_then(|properties| properties.get(key));
                let meaning = option.and_then(|option| self.meaning(option));
                let problem = Problem::MissingKey { key: key.to_owned(), meaning, choices: Vec::new() };
                outcome.push(&at.key(key), header.clone(), format!("`{}` needs `{key}`", at.table()), problem);
            }
        }
        let count = members.len() as u64;
        let limit = |key: &str| schema.get(key).and_then(Json::as_u64);
        let (least, most) = (limit("minProperties").unwrap_or(0), limit("maxProperties").unwrap_or(u64::MAX));
        if count >= least && count <= most {
            return;
        }
        let table = at.table();
        let (message, problem) = match (least, most, count) {
            (1, 1, _) => {
                let problem = Problem::NotOneForm { forms: known().map(str::to_owned).collect() };
                (format!("`{table}` needs exactly one key"), problem)
            }
            (_, _, 0) => (format!("`{table}` must not be empty"), Problem::OutOfRange { allowed: String::new() }),
            _ if count < least => {
                (format!("`{table}` has {count} keys"), Problem::OutOfRange { allowed: format!("at least {least}") })
            }
            _ => (format!("`{table}` has {count} keys"), Problem::OutOfRange { allowed: format!("at most {most}") }),
        };
        outcome.push(at.path, header, message, problem);
    }

    /// A value that may have one of several forms: picks the form that was meant, and reports its mistakes.
    fn union<N: Node>(&self, value: &N, branches: &'s [Json], at: At, outcome: &mut Outcome) {
        let mut trials: Vec<(&'s Json, Outcome)> = Vec::new();
        for branch in branches {
            let mut trial = Outcome::default();
            self.value(value, branch, at, &mut trial);
            if trial.findings.is_empty() {
                outcome.references.extend(trial.references);
                return;
            }
            trials.push((self.target(branch), trial));
        }
        let view = value.view();
        let judged = match &view {
            View::String(text) => self.word(text, value.span(), &trials, at, outcome),
            View::Table(members) => self.form(members, value.span(), &mut trials, at, outcome),
            _ => false,
        };
        if judged {
            return;
        }
        // Otherwise the form of the same type with the fewest mistakes is meant.
        let of_type = |branch: &Json| {
            let types = types(branch);
            types.is_empty() || types.iter().any(|kind| view.of_type().is(kind))
        };
        let nearest = trials
            .iter()
            .enumerate()
            .filter(|(_, (branch, _))| of_type(branch))
            .min_by_key(|(_, (_, trial))| trial.findings.len())
            .map(|(index, _)| index);
        match nearest {
            Some(index) => outcome.findings.extend(trials.swap_remove(index).1.findings),
            None => {
                let mut forms: Vec<String> = Vec::new();
                for (branch, _) in trials.iter().filter(|(branch, _)| sole_key(branch).is_none()) {
                    let form = self.expected(branch);
                    if !forms.contains(&form) {
                        forms.push(form);
                    }
                }
                let tags: Vec<&str> = trials.iter().filter_map(|(branch, _)| sole_key(branch)).collect();
                if !tags.is_empty() {
                    forms.push(format!("a table with one of {}", listing(tags)));
                }
                let expected = forms.join(" or ");
                outcome.findings.push(wrong_type(&view, value.span(), &expected, None, at.path, &at.name()));
            }
        }
    }

    /// Judges a string that fits no form, if some form is a choice of words.
    fn word(
        &self,
        text: &str,
        span: Range<usize>,
        trials: &[(&'s Json, Outcome)],
        at: At,
        outcome: &mut Outcome,
    ) -> bool {
        let words: Vec<&str> = trials.iter().flat_map(|(branch, _)| choices(branch).unwrap_or_default()).collect();
        if words.is_empty() {
            return false;
        }
        let forms: Vec<&str> = trials.iter().flat_map(|(branch, _)| form_keys(branch)).collect();
        outcome.findings.push(unknown_choice(at.path, &at.name(), text, span, &words, &forms));
        true
    }

    /// Judges a table that fits no form, if a key or a constant tells the forms apart.
    fn form<N: Node>(
        &self,
        members: &[Member<N>],
        span: Range<usize>,
        trials: &mut Vec<(&'s Json, Outcome)>,
        at: At,
        outcome: &mut Outcome,
    ) -> bool {
        let owned = |names: &[&str]| -> Vec<String> { names.iter().map(|name| (*name).to_owned()).collect() };
        let given = |key: &str| members.iter().find(|member| member.key == key);
        let name = at.name();
        let branches: Vec<&'s Json> = trials.iter().map(|(branch, _)| *branch).collect();
        let mut take = |index: usize, outcome: &mut Outcome| {
            let (_, meant) = trials.swap_remove(index);
            outcome.findings.extend(meant.findings);
            outcome.references.extend(meant.references);
        };
        // `{ of_table = … }`: the key says which form is meant.
        let tags: Vec<&str> = branches.iter().filter_map(|branch| sole_key(branch)).collect();
        let chosen: Vec<&str> = tags.iter().copied().filter(|tag| given(tag).is_some()).collect();
        if chosen.len() > 1 {
            let message = format!("`{name}` takes only one of {}", listing(chosen));
            outcome.push(at.path, span, message, Problem::NotOneForm { forms: Vec::new() });
            return true;
        }
        if let Some(index) = branches.iter().position(|branch| sole_key(branch).is_some_and(|tag| given(tag).is_some()))
        {
            take(index, outcome);
            return true;
        }
        if !tags.is_empty() {
            for member in members {
                let message = format!("`{name}` has no form `{}`", member.key);
                let problem = Problem::UnknownKey { key: member.key.to_owned(), known: owned(&tags), form: true };
                outcome.push(&at.key(member.key), member.key_span.clone(), message, problem);
            }
            if members.is_empty() {
                let message = format!("`{name}` needs exactly one key");
                outcome.push(at.path, span, message, Problem::NotOneForm { forms: owned(&tags) });
            }
            return true;
        }
        // `{ type = "a", … }`: a constant says which form is meant.
        let Some(tag) = branches.iter().find_map(|branch| constant_key(branch)) else { return false };
        let words: Vec<&str> = branches.iter().filter_map(|branch| constant(branch, tag)).collect();
        let Some(member) = given(tag) else {
            let problem = Problem::MissingKey { key: tag.to_owned(), meaning: None, choices: owned(&words) };
            outcome.push(&at.key(tag), span, format!("`{}` needs `{tag}`", at.table()), problem);
            return true;
        };
        let path = at.key(tag);
        let name = DisplayPath(&path).to_string();
        match member.value.view() {
            View::String(text) => match branches.iter().position(|branch| constant(branch, tag) == Some(text)) {
                Some(index) => take(index, outcome),
                None => outcome.findings.push(unknown_choice(&path, &name, text, member.value.span(), &words, &[])),
            },
            view => {
                let expected = format!("one of {}", listing(words));
                outcome.findings.push(wrong_type(&view, member.value.span(), &expected, None, &path, &name));
            }
        }
        true
    }

    /// The first sentence of a description.
    fn meaning(&self, schema: &'s Json) -> Option<String> {
        let all_of = schema.get("allOf").and_then(Json::as_array).and_then(|parts| parts.first());
        let own = |schema: &Json| schema.get("description").and_then(Json::as_str).map(str::to_owned);
        own(schema)
            .or_else(|| own(self.target(schema)))
            .or_else(|| own(self.target(all_of?)))
            .map(|text| first_sentence(&text))
    }

    /// The values that a schema accepts, in words.
    fn expected(&self, schema: &'s Json) -> String {
        let schema = self.target(schema);
        if let Some(words) = choices(schema) {
            return match words.as_slice() {
                [word] => format!("\"{word}\""),
                _ => format!("one of {}", listing(words)),
            };
        }
        match schema.get(REFERENCE).and_then(Json::as_str) {
            Some("path") => return "a path in quotes".into(),
            Some("product") => return "the name of a product in quotes".into(),
            Some(_) => return "the name of a pool in quotes".into(),
            None => {}
        }
        let forms: Vec<String> = types(schema)
            .iter()
            .map(|kind| match *kind {
                "object" => {
                    let keys: Vec<&str> = schema
                        .get("properties")
                        .and_then(Json::as_object)
                        .into_iter()
                        .flat_map(|properties| properties.keys().map(String::as_str))
                        .collect();
                    let one = schema.get("maxProperties").and_then(Json::as_u64) == Some(1) || keys.len() == 1;
                    match keys.is_empty() {
                        true if schema.get(KEY_REFERENCE).is_some() => "a table of weights".to_owned(),
                        true => "a table".to_owned(),
                        false if one => format!("a table with one of {}", listing(keys)),
                        false => format!("a table of {}", listing(keys)),
                    }
                }
                "array" => match array_length(schema) {
                    Some(length) => format!("an array of {length}"),
                    None => "an array".to_owned(),
                },
                "string" => "a string".to_owned(),
                "integer" => "an integer".to_owned(),
                "number" => "a number".to_owned(),
                "boolean" => "a boolean".to_owned(),
                other => other.to_owned(),
            })
            .collect();
        if forms.is_empty() { "of another form".to_owned() } else { forms.join(" or ") }
    }
}

fn wrong_type<N>(
    view: &View<N>,
    span: Range<usize>,
    expected: &str,
    wanted: Option<Type>,
    path: &[Step],
    name: &str,
) -> Finding {
    let problem = Problem::WrongType { wanted, found: view.of_type(), text: view.text() };
    Finding { path: path.to_vec(), span, message: format!("`{name}` must be {expected}"), problem }
}

fn unknown_choice(
    path: &[Step],
    name: &str,
    text: &str,
    span: Range<usize>,
    choices: &[&str],
    forms: &[&str],
) -> Finding {
    let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let problem = Problem::UnknownChoice { text: text.to_owned(), choices: owned(choices), forms: owned(forms) };
    Finding { path: path.to_vec(), span, message: format!("`{name}` cannot be \"{text}\""), problem }
}

/// The types that a schema allows; none if it does not say.
fn types(schema: &Json) -> Vec<&str> {
    match schema.get("type") {
        Some(Json::String(one)) => vec![one],
        Some(Json::Array(several)) => several.iter().filter_map(Json::as_str).collect(),
        _ => Vec::new(),
    }
}

/// The type that a schema asks for, if it asks for one type and for nothing that a message must add.
fn sole_type(schema: &Json) -> Option<Type> {
    let [kind] = types(schema)[..] else { return None };
    match kind {
        _ if choices(schema).is_some() || schema.get(REFERENCE).is_some() => None,
        "string" => Some(Type::String),
        "integer" => Some(Type::Integer),
        "number" => Some(Type::Float),
        "boolean" => Some(Type::Boolean),
        "array" if array_length(schema).is_none() => Some(Type::Array),
        _ => None,
    }
}

fn array_length(schema: &Json) -> Option<u64> {
    let limit = |key: &str| schema.get(key).and_then(Json::as_u64);
    limit("minItems").filter(|least| limit("maxItems") == Some(*least))
}

/// The strings that a schema allows, if it lists them.
fn choices(schema: &Json) -> Option<Vec<&str>> {
    let listed = schema.get("enum").and_then(Json::as_array);
    listed
        .map(|words| words.iter().filter_map(Json::as_str).collect())
        .or_else(|| Some(vec![schema.get("const")?.as_str()?]))
}

/// The key of a table form that has exactly one, such as `of_table`.
fn sole_key(schema: &Json) -> Option<&str> {
    let properties = schema.get("properties")?.as_object()?;
    let required = schema.get("required")?.as_array()?;
    match (properties.len(), required.as_slice()) {
        (1, [Json::String(key)]) if constant(schema, key).is_none() => Some(key),
        _ => None,
    }
}

/// The keys of a table form of which exactly one is given: the only one, or one of several.
fn form_keys(schema: &Json) -> Vec<&str> {
    let one_of_several = schema.get("maxProperties").and_then(Json::as_u64) == Some(1);
    let properties = schema.get("properties").and_then(Json::as_object).filter(|_| one_of_several);
    properties.map_or_else(
        || sole_key(schema).into_iter().collect(),
        |properties| properties.keys().map(String::as_str).collect(),
    )
}

/// A key of a table form whose value is one constant.
fn constant_key(schema: &Json) -> Option<&str> {
    let properties = schema.get("properties")?.as_object()?;
    properties.keys().map(String::as_str).find(|key| constant(schema, key).is_some())
}

fn constant<'j>(schema: &'j Json, key: &str) -> Option<&'j str> {
    let option = schema.get("properties")?.get(key)?;
    match choices(option)?.as_slice() {
        [word] => Some(word),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn messages(schema: &Json, text: &str) -> Vec<String> {
        let definitions = Map::new();
        let validator = Validator { definitions: &definitions };
        let table = DeTable::parse(text).expect("TOML");
        let spanned = validator.table("owner", spanned_members(table.get_ref()), table.span(), schema);
        let plain: toml::Table = toml::from_str(text).expect("TOML");
        let plain = validator.table("owner", plain_members(&plain), 0..0, schema);
        let of = |outcome: &Outcome| -> Vec<(Vec<Step>, Problem)> {
            let without_spans = |finding: &Finding| match &finding.problem {
                Problem::Repeated { .. } => Problem::Repeated { first: 0..0 },
                other => other.clone(),
            };
            outcome.findings.iter().map(|finding| (finding.path.clone(), without_spans(finding))).collect()
        };
        assert_eq!(of(&spanned), of(&plain), "{text}");
        for finding in &spanned.findings {
            assert!(finding.span.end <= text.len(), "{finding:?}");
        }
        spanned.findings.iter().map(|finding| format!("{}: {}", DisplayPath(&finding.path), finding.message)).collect()
    }

    #[test]
    fn every_keyword_refuses_at_its_limit() {
        let cases = [
            (json!({ "minimum": 2 }), "2", "1.9", "`x` cannot be 1.9"),
            (json!({ "maximum": 2 }), "2.0", "3", "`x` cannot be 3"),
            (json!({ "exclusiveMinimum": 0 }), "1e-9", "0", "`x` cannot be 0"),
            (json!({ "exclusiveMaximum": 1 }), "0.9", "1.0", "`x` cannot be 1.0"),
            (json!({ "multipleOf": 4 }), "8", "6", "`x` cannot be 6"),
            (json!({ "format": "uint32" }), "4294967295", "4294967296", "`x` cannot be 4294967296"),
            (json!({ "type": "number" }), "1", "nan", "`x` cannot be nan"),
            (json!({ "type": "integer" }), "1", "1.0", "`x` must be an integer"),
            (json!({ "type": "string" }), "''", "1", "`x` must be a string"),
            (json!({ "type": "boolean" }), "true", "'true'", "`x` must be a boolean"),
            (json!({ "type": ["integer", "array"] }), "[]", "'a'", "`x` must be an integer or an array"),
            (json!({ "minLength": 1 }), "'é'", "''", "`x` must not be empty"),
            (json!({ "maxLength": 2 }), "'éé'", "'abc'", "`x` has 3 characters"),
            (json!({ "enum": ["a", "b"] }), "'b'", "'c'", "`x` cannot be \"c\""),
            (json!({ "const": "a" }), "'a'", "'c'", "`x` cannot be \"c\""),
            (json!({ "minItems": 1 }), "[1]", "[]", "`x` must not be empty"),
            (json!({ "maxItems": 1 }), "[1]", "[1, 2]", "`x` has 2 elements"),
            (json!({ "uniqueItems": true }), "['a', 'b']", "['a', 'a']", "`x` names `a` twice"),
            (json!({ "items": { "type": "string" } }), "['a']", "[1]", "`x[0]` must be a string"),
            (
                json!({ "items": [{}], "additionalItems": { "type": "string" } }),
                "[1, 'a']",
                "[1, 2]",
                "`x[1]` must be a string",
            ),
            (json!({ "additionalProperties": false }), "{}", "{ a = 1 }", "`owner.x` has no option `a`"),
            (
                json!({ "additionalProperties": { "type": "string" } }),
                "{ a = 'b' }",
                "{ a = 1 }",
                "`x.a` must be a string",
            ),
            (json!({ "required": ["a"] }), "{ a = 1 }", "{}", "`owner.x` needs `a`"),
            (json!({ "minProperties": 1 }), "{ a = 1 }", "{}", "`owner.x` must not be empty"),
            (json!({ "maxProperties": 1 }), "{ a = 1 }", "{ a = 1, b = 2 }", "`owner.x` has 2 keys"),
            (json!({ "allOf": [{ "type": "string" }] }), "'a'", "1", "`x` must be a string"),
            (
                json!({ "oneOf": [{ "type": "string" }, { "type": "array" }] }),
                "[]",
                "1",
                "`x` must be a string or an array",
            ),
            (
                json!({ "anyOf": [{ "type": "integer", "minimum": 3 }, { "type": "string" }] }),
                "3",
                "2",
                "`x` cannot be 2",
            ),
        ];
        for (schema, good, bad, message) in cases {
            let table = json!({ "properties": { "x": schema } });
            assert_eq!(unsupported(&table, &Map::new()), Vec::<String>::new(), "{schema}");
            assert_eq!(messages(&table, &format!("x = {good}")), Vec::<String>::new(), "{schema}");
            let found = messages(&table, &format!("x = {bad}"));
            assert_eq!(found.len(), 1, "{schema}: {found:?}");
            assert!(found[0].ends_with(&format!(": {message}")), "{schema}: {found:?}");
        }
    }

    #[test]
    fn the_form_that_was_meant_is_judged() {
        let form = |key: &str| {
            json!({
                "type": "object", "required": [key], "additionalProperties": false,
                "properties": { key: { "type": "number", "maximum": 1 } }
            })
        };
        let tagged = |word: &str| {
            json!({
                "type": "object", "required": ["type"], "additionalProperties": false,
                "properties": { "type": { "const": word }, word: { "type": "number" } }
            })
        };
        let either = json!({
            "type": "object", "minProperties": 1, "maxProperties": 1, "additionalProperties": false,
            "properties": { "auto": { "type": "object" }, "stops": { "type": "number" } }
        });
        let schema = json!({ "properties": {
            "x": { "oneOf": [{ "enum": ["all"], "type": "string" }, form("fraction"), form("disk")] },
            "y": { "oneOf": [tagged("below"), tagged("above")] },
            "z": { "oneOf": [{ "enum": ["auto"], "type": "string" }, either] }
        } });
        let check = |text: &str, expected: &[&str]| assert_eq!(messages(&schema, text), expected, "{text}");
        check("x = { fraction = 2 }", &["x.fraction: `x.fraction` cannot be 2"]);
        check("x = { fractions = 2 }", &["x.fractions: `x` has no form `fractions`"]);
        check("x = { fraction = 1, disk = 1 }", &["x: `x` takes only one of `fraction`, `disk`"]);
        check("x = {}", &["x: `x` needs exactly one key"]);
        check("x = 'every'", &["x: `x` cannot be \"every\""]);
        check("x = 1", &["x: `x` must be \"all\" or a table with one of `fraction`, `disk`"]);
        check("y = { type = 'below', below = 'a' }", &["y.below: `y.below` must be a number"]);
        check("y = { type = 'beside' }", &["y.type: `y.type` cannot be \"beside\""]);
        check("y = { type = 1 }", &["y.type: `y.type` must be one of `below`, `above`"]);
        check("y = { below = 1 }", &["y.type: `owner.y` needs `type`"]);
        let help = |text: &str| {
            let (table, definitions) = (DeTable::parse(text).expect("TOML"), Map::new());
            let validator = Validator { definitions: &definitions };
            let outcome = validator.table("owner", spanned_members(table.get_ref()), table.span(), &schema);
            ConfigError::from(outcome.findings.into_iter().next().expect("a mistake")).help
        };
        let choices = "one of `all`, or a table with one of `fraction`, `disk`";
        assert_eq!(help("x = 'every'").as_deref(), Some(choices));
        assert_eq!(help("z = 'none'").as_deref(), Some("one of `auto`, or a table with one of `auto`, `stops`"));
        assert_eq!(help("x = { fractions = 2 }").as_deref(), Some("one of `fraction`, `disk`"));
        assert_eq!(help("x = {}").as_deref(), Some("one of `fraction`, `disk`"));
        assert_eq!(help("y = { type = 'beside' }").as_deref(), Some("one of `below`, `above`"));
    }

    #[test]
    fn keywords_that_nobody_checks_are_listed() {
        let definitions = json!({ "Inner": { "items": { "pattern": "a" } } });
        let schema = json!({
            "type": "object", "if": {}, "x-note": 1,
            "properties": { "a": { "$ref": "#/definitions/Inner" }, "b": { "const": 3 }, "c": { "format": "uri" } }
        });
        let faults = unsupported(&schema, definitions.as_object().expect("an object"));
        let keywords: Vec<&str> = faults.iter().filter_map(|fault| fault.split('`').nth(1)).collect();
        assert_eq!(keywords, ["if", "pattern", "const", "format"], "{faults:?}");
        assert!(faults[1].ends_with("at `a`"), "{faults:?}");
    }
}
