//! Products that recipes or users declare while the program runs.

use super::{DType, Form, Framing, Key, KeyId, Mask, PerInstance, Plane, Product, Scope, Semantic, Value, linked};
use crate::error::Error;
use crate::intern::intern;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A product of each view whose type is known only while the program runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DeclaredProduct {
    /// Form of its value.
    pub form: DeclaredForm,
    /// Type of the numbers of an image or a tensor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dtype: Option<DType>,
    /// Channels of an image, 1 to 4. Without it, an image has no axis of channels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 4))]
    pub channels: Option<u8>,
    /// Meaning of the numbers of an image, for viewers and writers.
    #[serde(default, skip_serializing_if = "is_data")]
    pub meaning: Semantic,
    /// Unit of its numbers, such as `m`.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub unit: String,
    /// Its meaning, in a sentence.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub doc: String,
}

fn is_data(meaning: &Semantic) -> bool {
    *meaning == Semantic::Data
}

/// Form of a [`DeclaredProduct`], under its name in Python.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[expect(missing_docs, reason = "each name says its form, and recipes list names alone")]
pub enum DeclaredForm {
    #[serde(rename = "bool")]
    Bool,
    #[serde(rename = "int")]
    Int,
    #[serde(rename = "float")]
    Float,
    #[serde(rename = "str")]
    Text,
    #[serde(rename = "dict")]
    Record,
    #[serde(rename = "list")]
    List,
    #[serde(rename = "bool per object")]
    BoolPerObject,
    #[serde(rename = "int per object")]
    IntPerObject,
    #[serde(rename = "float per object")]
    FloatPerObject,
    #[serde(rename = "str per object")]
    TextPerObject,
    #[serde(rename = "dict per object")]
    RecordPerObject,
    #[serde(rename = "list per object")]
    ListPerObject,
    #[serde(rename = "Mask per object")]
    MaskPerObject,
    #[serde(rename = "image")]
    Image,
    #[serde(rename = "tensor")]
    Tensor,
}

impl DeclaredForm {
    /// The name of a form without a type of numbers.
    fn of(form: &Form) -> Option<Self> {
        Some(match form {
            Form::Bool => Self::Bool,
            Form::Int => Self::Int,
            Form::Float => Self::Float,
            Form::Text => Self::Text,
            Form::Record => Self::Record,
            Form::List => Self::List,
            Form::PerInstance(one) => match &**one {
                Form::Bool => Self::BoolPerObject,
                Form::Int => Self::IntPerObject,
                Form::Float => Self::FloatPerObject,
                Form::Text => Self::TextPerObject,
                Form::Record => Self::RecordPerObject,
                Form::List => Self::ListPerObject,
                Form::Mask => Self::MaskPerObject,
                _ => return None,
            },
            _ => return None,
        })
    }
}

impl DeclaredProduct {
    /// The key of the product with this name.
    ///
    /// # Errors
    /// If it is no name of a product, the form needs other options, or a linked crate has a product of this name with
    /// another type.
    pub fn key(&self, name: &str) -> Result<KeyId, Error> {
        let refuse = |message: &str| Error::new(format!("`{name}`: {message}"));
        let is_of_name = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        if !name.starts_with(|c: char| c.is_ascii_lowercase()) || !name.chars().all(is_of_name) {
            return Err(refuse("the name of a product has lower-case letters, digits and underscores")
                .help("begin it with a letter, as in `dark_pixels`"));
        }
        let has_numbers = matches!(self.form, DeclaredForm::Image | DeclaredForm::Tensor);
        match self.dtype {
            None if has_numbers => {
                return Err(refuse("images and tensors have a type of numbers").help("add dtype = \"float32\""));
            }
            Some(_) if !has_numbers => return Err(refuse("only images and tensors have a dtype")),
            _ => {}
        }
        if self.form != DeclaredForm::Image && (self.channels.is_some() || !is_data(&self.meaning)) {
            return Err(refuse("only images have channels and a meaning"));
        }
        let mut key = self.of_form(name).ok_or_else(|| refuse("an image has 1 to 4 channels"))?;
        (key.unit, key.semantic) = (intern(&self.unit), self.meaning);
        match linked().iter().find(|other| other.product == key.product) {
            Some(other) if other.type_id() == key.type_id() && other.scope == key.scope => Ok(*other),
            Some(other) => {
                let message = format!("`{name}` is a product of the library: {}", other.kind_of_value());
                Err(Error::new(message).help("choose another name"))
            }
            None => Ok(key),
        }
    }

    /// The declaration of a product that no linked crate defines, whose [`key`](Self::key) is this key. None for other
    /// products, and for forms that cannot be declared.
    pub fn of(key: &KeyId) -> Option<Self> {
        if key.scope != Scope::View || key.framing != Framing::IMAGE || linked().iter().any(|it| it.is(key.product)) {
            return None;
        }
        let (form, dtype, channels) = match key.form() {
            Form::Image { dtype, channels } => {
                let channels = channels.map(u8::try_from).transpose().ok()?;
                (DeclaredForm::Image, Some(dtype), channels)
            }
            Form::Tensor(dtype) => (DeclaredForm::Tensor, Some(dtype), None),
            form => (DeclaredForm::of(&form)?, None, None),
        };
        let (meaning, unit, doc) = (key.semantic, key.unit.to_owned(), key.doc());
        Some(Self { form, dtype, channels, meaning, unit, doc })
    }

    fn of_form(&self, name: &str) -> Option<KeyId> {
        let value = |form: fn() -> Form| Some(self.typed::<Value>(name).form(form).id());
        let each = |form: fn() -> Form| Some(self.typed::<PerInstance<Value>>(name).form(form).id());
        match self.form {
            DeclaredForm::Bool => value(|| Form::Bool),
            DeclaredForm::Int => value(|| Form::Int),
            DeclaredForm::Float => value(|| Form::Float),
            DeclaredForm::Text => value(|| Form::Text),
            DeclaredForm::Record => value(|| Form::Record),
            DeclaredForm::List => value(|| Form::List),
            DeclaredForm::BoolPerObject => Some(self.typed::<PerInstance<bool>>(name).id()),
            DeclaredForm::IntPerObject => Some(self.typed::<PerInstance<i64>>(name).id()),
            DeclaredForm::FloatPerObject => Some(self.typed::<PerInstance<f64>>(name).id()),
            DeclaredForm::TextPerObject => Some(self.typed::<PerInstance<String>>(name).id()),
            DeclaredForm::MaskPerObject => Some(self.typed::<PerInstance<Mask>>(name).id()),
            DeclaredForm::RecordPerObject => each(|| Form::PerInstance(Box::new(Form::Record))),
            DeclaredForm::ListPerObject => each(|| Form::PerInstance(Box::new(Form::List))),
            DeclaredForm::Tensor => self.tensor(name),
            DeclaredForm::Image => self.image(name),
        }
    }

    fn typed<T: Product>(&self, name: &str) -> Key<T> {
        Key::view(intern(name), intern(&self.doc))
    }

    fn tensor(&self, name: &str) -> Option<KeyId> {
        macro_rules! of_dtypes {
            ($($dtype:ident),*) => {
                match self.dtype? {
                    $(DType::$dtype => Some(self.typed::<Value>(name).form(|| Form::Tensor(DType::$dtype)).id()),)*
                }
            };
        }
        of_dtypes!(Bool, U8, U16, U32, U64, I8, I16, I32, I64, F16, F32, F64)
    }

    fn image(&self, name: &str) -> Option<KeyId> {
        macro_rules! of_dtypes {
            ($($dtype:ident => $type:ty),*) => {
                match (self.dtype?, self.channels) {
                    $((DType::$dtype, None) => Some(self.typed::<Plane<$type>>(name).id()),
                    (DType::$dtype, Some(1)) => Some(self.typed::<Plane<[$type; 1]>>(name).id()),
                    (DType::$dtype, Some(2)) => Some(self.typed::<Plane<[$type; 2]>>(name).id()),
                    (DType::$dtype, Some(3)) => Some(self.typed::<Plane<[$type; 3]>>(name).id()),
                    (DType::$dtype, Some(4)) => Some(self.typed::<Plane<[$type; 4]>>(name).id()),)*
                    _ => None,
                }
            };
        }
        of_dtypes!(Bool => bool, U8 => u8, U16 => u16, U32 => u32, U64 => u64, I8 => i8, I16 => i16, I32 => i32,
            I64 => i64, F16 => half::f16, F32 => f32, F64 => f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(json: serde_json::Value) -> Result<KeyId, Error> {
        serde_json::from_value::<DeclaredProduct>(json).expect("a declaration").key("heat")
    }

    #[test]
    fn forms_give_types() {
        let heat =
            of(serde_json::json!({ "form": "image", "dtype": "float32", "channels": 2, "unit": "K" })).expect("a key");
        assert_eq!((heat.type_name().as_str(), heat.unit), ("Plane<[f32; 2]>", "K"));
        let share =
            of(serde_json::json!({ "form": "float per object", "doc": "Share of dark pixels." })).expect("a key");
        assert_eq!((share.type_name().as_str(), share.doc().as_str()), ("PerInstance<f64>", "Share of dark pixels."));
        let tensor = of(serde_json::json!({ "form": "tensor", "dtype": "int8" })).expect("a key");
        assert_eq!(tensor.form(), Form::Tensor(DType::I8));
    }

    #[test]
    fn a_key_gives_its_declaration() {
        for form in [
            "bool",
            "int",
            "float",
            "str",
            "dict",
            "list",
            "bool per object",
            "int per object",
            "float per object",
            "str per object",
            "dict per object",
            "list per object",
            "Mask per object",
        ] {
            let json = serde_json::json!({ "form": form, "unit": "K", "doc": "Heat." });
            let declared: DeclaredProduct = serde_json::from_value(json.clone()).expect("a declaration");
            let key = declared.key("heat").expect("a key");
            assert_eq!(DeclaredProduct::of(&key), Some(declared), "{json}");
        }
        for json in [
            serde_json::json!({ "form": "image", "dtype": "float16", "channels": 2, "meaning": "color" }),
            serde_json::json!({ "form": "image", "dtype": "bool" }),
            serde_json::json!({ "form": "tensor", "dtype": "uint64" }),
        ] {
            let declared: DeclaredProduct = serde_json::from_value(json).expect("a declaration");
            let key = declared.key("heat").expect("a key");
            assert_eq!(DeclaredProduct::of(&key), Some(declared));
        }
        assert_eq!(DeclaredProduct::of(&crate::product::standard::RGB.id()), None, "a linked crate defines it");
    }

    #[test]
    fn names_are_in_snake_case() {
        let declared: DeclaredProduct = serde_json::from_value(serde_json::json!({ "form": "int" })).expect("a form");
        for wrong in ["", "Heat", "2d", "a b", "a/b", "ü", "a (canvas 3)"] {
            assert!(declared.key(wrong).expect_err("refused").to_string().contains("lower-case"), "{wrong}");
        }
        assert!(declared.key("heat_2").is_ok());
    }

    #[test]
    fn contradictions_are_refused() {
        for (wrong, word) in [
            (serde_json::json!({ "form": "image" }), "dtype"),
            (serde_json::json!({ "form": "float", "dtype": "int8" }), "dtype"),
            (serde_json::json!({ "form": "image", "dtype": "int8", "channels": 5 }), "1 to 4"),
            (serde_json::json!({ "form": "tensor", "dtype": "int8", "channels": 2 }), "channels"),
        ] {
            let error = of(wrong).expect_err("refused").to_string();
            assert!(error.contains("`heat`") && error.contains(word), "{error}");
        }
        let taken = DeclaredProduct {
            form: DeclaredForm::Int,
            dtype: None,
            channels: None,
            meaning: Semantic::Data,
            unit: String::new(),
            doc: String::new(),
        };
        assert!(taken.key("rgb").expect_err("taken").to_string().contains("another name"));
    }
}
