//! Products that stages in Python provide and read.

use crate::registry::whole;
use half::f16;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use syntable_model::intern::intern;
use syntable_model::product::{DType, Form, Key, KeyId, Mask, PerInstance, Plane, Product, Semantic, Value, linked};
use syntable_recipe::nearest;
use syntable_recipe::plan::available;

/// A product as Python declares it.
#[derive(FromPyObject)]
pub struct Declared {
    name: String,
    doc: String,
    unit: String,
    /// Word for the form: `float`, `image`, `float per object`.
    form: String,
    /// Element type of an array; empty if it is none.
    dtype: String,
    channels: Option<usize>,
    /// Word for the meaning, or nothing.
    meaning: String,
}

impl Declared {
    /// The key of the product.
    ///
    /// # Errors
    /// If no type of the library has the form, or the library has the product with another type.
    pub fn key(&self) -> PyResult<KeyId> {
        let unknown = || PyValueError::new_err(format!("`{}`: no product has the form {self:?}", self.name));
        let mut key = self.of_form().ok_or_else(unknown)?;
        key.unit = intern(&self.unit);
        key.semantic = match self.meaning.as_str() {
            "color" => Semantic::Color,
            "depth" => Semantic::Depth,
            "normal" => Semantic::Normal,
            "label" => Semantic::Label,
            "mask" => Semantic::Mask,
            _ => Semantic::Data,
        };
        match linked().into_iter().find(|other| other.product == key.product) {
            Some(other) if other.type_id() == key.type_id() && other.scope == key.scope => Ok(other),
            Some(other) => Err(PyValueError::new_err(format!(
                "`{}` is a product of the library: {}; choose another name",
                self.name,
                other.kind_of_value()
            ))),
            None => Ok(key),
        }
    }

    fn of_form(&self) -> Option<KeyId> {
        let value = |form: fn() -> Form| Some(self.of::<Value>().form(form).id());
        let each = |form: fn() -> Form| Some(self.of::<PerInstance<Value>>().form(form).id());
        match self.form.as_str() {
            "bool" => value(|| Form::Bool),
            "int" => value(|| Form::Int),
            "float" => value(|| Form::Float),
            "str" => value(|| Form::Text),
            "dict" => value(|| Form::Record),
            "list" => value(|| Form::List),
            "bool per object" => Some(self.of::<PerInstance<bool>>().id()),
            "int per object" => Some(self.of::<PerInstance<i64>>().id()),
            "float per object" => Some(self.of::<PerInstance<f64>>().id()),
            "str per object" => Some(self.of::<PerInstance<String>>().id()),
            "Mask per object" => Some(self.of::<PerInstance<Mask>>().id()),
            "dict per object" => each(|| Form::PerInstance(Box::new(Form::Record))),
            "list per object" => each(|| Form::PerInstance(Box::new(Form::List))),
            "tensor" => self.tensor(),
            "image" => self.image(),
            _ => None,
        }
    }

    fn of<T: Product>(&self) -> Key<T> {
        Key::view(intern(&self.name), intern(&self.doc))
    }

    fn tensor(&self) -> Option<KeyId> {
        macro_rules! of_dtypes {
            ($($name:literal => $dtype:ident),*) => {
                match self.dtype.as_str() {
                    $($name => Some(self.of::<Value>().form(|| Form::Tensor(DType::$dtype)).id()),)*
                    _ => None,
                }
            };
        }
        of_dtypes!("bool" => Bool, "uint8" => U8, "uint16" => U16, "uint32" => U32, "uint64" => U64, "int8" => I8,
            "int16" => I16, "int32" => I32, "int64" => I64, "float16" => F16, "float32" => F32, "float64" => F64)
    }

    fn image(&self) -> Option<KeyId> {
        macro_rules! of_types {
            ($($name:literal => $type:ty),*) => {
                match (self.dtype.as_str(), self.channels) {
                    $(($name, None) => Some(self.of::<Plane<$type>>().id()),
                    ($name, Some(1)) => Some(self.of::<Plane<[$type; 1]>>().id()),
                    ($name, Some(2)) => Some(self.of::<Plane<[$type; 2]>>().id()),
                    ($name, Some(3)) => Some(self.of::<Plane<[$type; 3]>>().id()),
                    ($name, Some(4)) => Some(self.of::<Plane<[$type; 4]>>().id()),)*
                    _ => None,
                }
            };
        }
        of_types!("bool" => bool, "uint8" => u8, "uint16" => u16, "uint32" => u32, "uint64" => u64, "int8" => i8,
            "int16" => i16, "int32" => i32, "int64" => i64, "float16" => f16, "float32" => f32, "float64" => f64)
    }
}

impl std::fmt::Debug for Declared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let words = [&self.dtype, &self.form].into_iter().filter(|word| !word.is_empty());
        f.write_str(&words.map(String::as_str).collect::<Vec<_>>().join(" "))?;
        self.channels.map_or(Ok(()), |channels| write!(f, " of {channels} channels"))
    }
}

/// The keys of products that a stage reads.
///
/// # Errors
/// If no stage provides a product. The message suggests a similar name.
pub fn named(names: &[String]) -> PyResult<Vec<KeyId>> {
    let linked = linked();
    let find = |keys: &[KeyId], name: &str| {
        let exact = keys.iter().find(|key| key.is(name)).copied();
        exact.or_else(|| keys.iter().find_map(|key| key.parse(name)))
    };
    let mut provided: Option<Vec<KeyId>> = None;
    let mut found = Vec::new();
    for name in names {
        if let Some(key) = find(&linked, name) {
            found.push(key);
            continue;
        }
        if provided.is_none() {
            let registry = whole().map_err(PyRuntimeError::new_err)?;
            provided = Some(available(&registry).into_iter().map(|(key, _)| key).collect());
        }
        let provided = provided.as_deref().unwrap_or_default();
        found.push(find(provided, name).ok_or_else(|| {
            let known = linked.iter().chain(provided).map(|key| key.product);
            let near = nearest(name, known).map_or_else(String::new, |near| format!(": did you mean `{near}`?"));
            PyValueError::new_err(format!(
                "no stage provides `{name}`{near} (`syntable list products` lists all; define a stage in Python before the \
                 stages that read its products)"
            ))
        })?);
    }
    Ok(found)
}
