//! TOML values for validation, with or without spans, and paths into them.

use std::borrow::Cow;
use std::fmt;
use std::ops::Range;
use toml::de::{DeTable, DeValue};

/// A TOML value with its bytes in the text.
pub type SpannedValue<'a> = toml::Spanned<DeValue<'a>>;

/// One step of a path into a value.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Step {
    /// A key of a table; in a list of stages, the id of a stage.
    Key(String),
    /// An element of an array, from 0.
    Index(usize),
}

/// Displays a path as in TOML: `lights[0].count`, `assets."my pool".root`.
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

/// Type of a TOML value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TomlType {
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

impl TomlType {
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
    pub(crate) fn is(self, name: &str) -> bool {
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

/// A TOML value that can be validated: a value with spans from a file, or a plain value.
pub trait TomlNode: Sized {
    /// The value.
    fn view(&self) -> TomlView<'_, Self>;
    /// Bytes of the value in its text; empty for a plain value.
    fn span(&self) -> Range<usize>;
}

/// Content of a [`TomlNode`].
pub enum TomlView<'v, N> {
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

impl<N> TomlView<'_, N> {
    /// The value's type.
    pub fn of_type(&self) -> TomlType {
        match self {
            Self::String(_) => TomlType::String,
            Self::Integer(..) => TomlType::Integer,
            Self::Float(..) => TomlType::Float,
            Self::Boolean(_) => TomlType::Boolean,
            Self::Datetime => TomlType::Datetime,
            Self::Array(_) => TomlType::Array,
            Self::Table(_) => TomlType::Table,
        }
    }

    /// The text of a scalar, without quotes, or of an array of numbers; empty for others.
    pub(crate) fn text(&self) -> String
    where
        N: TomlNode,
    {
        match self {
            Self::String(text) => (*text).to_owned(),
            Self::Integer(text, _) | Self::Float(text, _) => text.clone().into_owned(),
            Self::Boolean(value) => value.to_string(),
            Self::Array(items) => {
                let number = |item: &N| match item.view() {
                    TomlView::Integer(text, _) | TomlView::Float(text, _) => Some(text.into_owned()),
                    _ => None,
                };
                let numbers: Option<Vec<String>> = items.iter().map(number).collect();
                numbers.map_or_else(String::new, |numbers| format!("[{}]", numbers.join(", ")))
            }
            Self::Datetime | Self::Table(_) => String::new(),
        }
    }
}

impl TomlNode for SpannedValue<'_> {
    fn view(&self) -> TomlView<'_, Self> {
        match self.get_ref() {
            DeValue::String(text) => TomlView::String(text),
            DeValue::Integer(integer) => {
                TomlView::Integer(integer.as_str().into(), i64::from_str_radix(integer.as_str(), integer.radix()).ok())
            }
            DeValue::Float(float) => TomlView::Float(float.as_str().into(), float.as_str().parse().unwrap_or(f64::NAN)),
            DeValue::Boolean(value) => TomlView::Boolean(*value),
            DeValue::Datetime(_) => TomlView::Datetime,
            DeValue::Array(items) => TomlView::Array(items),
            DeValue::Table(table) => TomlView::Table(spanned_members(table)),
        }
    }
    fn span(&self) -> Range<usize> {
        toml::Spanned::span(self)
    }
}

impl TomlNode for toml::Value {
    fn view(&self) -> TomlView<'_, Self> {
        match self {
            Self::String(text) => TomlView::String(text),
            Self::Integer(value) => TomlView::Integer(value.to_string().into(), Some(*value)),
            Self::Float(value) => TomlView::Float(format!("{value:?}").into(), *value),
            Self::Boolean(value) => TomlView::Boolean(*value),
            Self::Datetime(_) => TomlView::Datetime,
            Self::Array(items) => TomlView::Array(items),
            Self::Table(table) => TomlView::Table(plain_members(table)),
        }
    }
    fn span(&self) -> Range<usize> {
        0..0
    }
}

/// The members of a parsed table.
pub fn spanned_members<'v, 'a>(table: &'v DeTable<'a>) -> Vec<Member<'v, SpannedValue<'a>>> {
    let members = table.iter();
    members.map(|(key, value)| Member { key: key.get_ref().as_ref(), key_span: key.span(), value }).collect()
}

/// The members of a plain table.
pub fn plain_members(table: &toml::Table) -> Vec<Member<'_, toml::Value>> {
    table.iter().map(|(key, value)| Member { key, key_span: 0..0, value }).collect()
}
