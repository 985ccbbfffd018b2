//! Kinds of values of products: form, meaning and unit.

use syntable_model::product::{KeyId, Scope, Value};

pub use syntable_model::product::{Form, Semantic};

/// Kind of a product's value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ValueKind {
    /// Its form; the form of one instance's value if it is a value per instance.
    pub form: Form,
    /// Meaning of its numbers.
    pub semantic: Semantic,
    /// Unit of its numbers, such as `m`; empty if they have none.
    pub unit: &'static str,
}

impl ValueKind {
    /// The kind of a value of a product.
    pub fn of(key: &KeyId, value: &Value) -> Self {
        Self { form: Form::from(value), semantic: key.semantic, unit: key.unit }
    }

    /// The kind of a product from its key, which may leave the form open ([`Form::Any`]).
    pub fn of_key(key: &KeyId) -> Self {
        Self { form: key.form().of_one().clone(), semantic: key.semantic, unit: key.unit }
    }
}

/// A form with its article, for messages: `an f32 image`.
pub fn with_article(form: &Form) -> String {
    let name = form.to_string();
    match form {
        Form::Text | Form::Bytes => name,
        // The name starts with a vowel, or with a letter that is pronounced with one.
        _ if name.starts_with(['f', 'i']) => format!("an {name}"),
        _ => format!("a {name}"),
    }
}

/// Checks by its key whether a product can be stored in its own files; `encoder` accepts or refuses its kind. If the
/// key leaves the form open, the product is accepted here and checked again with its value.
pub fn accepts<T>(key: &KeyId, encoder: impl Fn(&ValueKind) -> Result<T, String>) -> Result<(), String> {
    if key.scope == Scope::Dataset {
        return Err("it is made once per dataset, not per view or scene; write it with jsonl or template".to_owned());
    }
    let kind = ValueKind::of_key(key);
    if kind.form == Form::Any { Ok(()) } else { encoder(&kind).map(drop) }
}
