//! What kind of value a product is: its form, what its numbers mean, and their unit.

use syntable_model::product::{KeyId, Scope, Value};

pub use syntable_model::product::{Form, Semantic};

/// What kind of value a product is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ValueKind {
    /// Its form; the form of one instance's value if it is a value per instance.
    pub form: Form,
    /// What its numbers mean.
    pub semantic: Semantic,
    /// Unit of its numbers, such as `m`; empty if they have none.
    pub unit: &'static str,
}

impl ValueKind {
    /// The kind of a value of a product.
    pub fn of(key: &KeyId, value: &Value) -> Self {
        Self { form: Form::from(value), semantic: key.semantic, unit: key.unit }
    }

    /// The kind of a product, as far as its key says.
    pub fn of_key(key: &KeyId) -> Self {
        Self { form: key.form().of_one().clone(), semantic: key.semantic, unit: key.unit }
    }
}

/// A form with its article, for messages: `an f32 image`.
pub fn with_article(form: &Form) -> String {
    let name = form.to_string();
    match form {
        Form::Text | Form::Bytes => name,
        // Said as a letter or as a word that starts with a vowel.
        _ if name.starts_with(['f', 'i']) => format!("an {name}"),
        _ => format!("a {name}"),
    }
}

/// Checks by its key whether a product can be stored in files of its own, given what an encoder says to its kind. What
/// the key does not say is checked again when the value is there.
pub fn accepts<T>(key: &KeyId, encoder: impl Fn(&ValueKind) -> Result<T, String>) -> Result<(), String> {
    if key.scope == Scope::Dataset {
        return Err("it is made once per dataset, not per view or scene; write it with jsonl or template".to_owned());
    }
    let kind = ValueKind::of_key(key);
    if kind.form == Form::Any { Ok(()) } else { encoder(&kind).map(drop) }
}
