//! The form of a product's encoding, known from its type alone.

use super::value::{DType, Tensor, Value};
use std::fmt;

/// The form of a product's [`Value`](super::Value).
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Form {
    /// A truth value.
    Bool,
    /// An integer.
    Int,
    /// A floating-point number.
    Float,
    /// Text.
    Text,
    /// Bytes of a format that the product's documentation names.
    Bytes,
    /// A binary mask of the image.
    Mask,
    /// Named fields.
    Record,
    /// A list of values.
    List,
    /// A list of records.
    Records,
    /// A fixed-length list of integers, such as a box.
    Ints(usize),
    /// One value per pixel, row 0 at the top: axes `y`, `x` and, with channels, `channel`.
    Image {
        /// Type of one number.
        dtype: DType,
        /// Numbers per pixel; none for a plain number without a channel axis.
        channels: Option<usize>,
    },
    /// A numeric array that is not an image.
    Tensor(DType),
    /// A value for each instance.
    PerInstance(Box<Form>),
    /// Not known from the type.
    Any,
}

impl Form {
    /// The form of one instance's value, or the form itself.
    pub fn of_one(&self) -> &Self {
        match self {
            Self::PerInstance(form) => form,
            form => form,
        }
    }
}

impl fmt::Display for Form {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool => f.write_str("truth value"),
            Self::Int => f.write_str("integer"),
            Self::Float => f.write_str("number"),
            Self::Text => f.write_str("text"),
            Self::Bytes => f.write_str("bytes"),
            Self::Mask => f.write_str("mask"),
            Self::Record => f.write_str("record"),
            Self::List => f.write_str("list"),
            Self::Records => f.write_str("list of records"),
            Self::Ints(length) => write!(f, "list of {length} integers"),
            Self::Image { dtype, channels: None } => write!(f, "{dtype} image"),
            Self::Image { dtype, channels: Some(1) } => write!(f, "{dtype} image of 1 channel"),
            Self::Image { dtype, channels: Some(channels) } => write!(f, "{dtype} image of {channels} channels"),
            Self::Tensor(dtype) => write!(f, "{dtype} array"),
            Self::PerInstance(form) => write!(f, "{form} per instance"),
            Self::Any => f.write_str("value"),
        }
    }
}

impl From<&Value> for Form {
    /// The form that a value has.
    fn from(value: &Value) -> Self {
        match value {
            Value::Null => Self::Any,
            Value::Bool(_) => Self::Bool,
            Value::Int(_) | Value::Uint(_) => Self::Int,
            Value::Float(_) => Self::Float,
            Value::Text(_) => Self::Text,
            Value::Bytes(_) => Self::Bytes,
            Value::Mask(_) => Self::Mask,
            Value::Record(_) => Self::Record,
            Value::List(values) if !values.is_empty() && values.iter().all(|it| matches!(it, Value::Record(_))) => {
                Self::Records
            }
            Value::List(_) => Self::List,
            Value::PerInstance(_) => Self::PerInstance(Box::new(Self::Any)),
            Value::Tensor(Tensor { dtype, axes, shape, .. }) => {
                let axes: Vec<&str> = axes.iter().map(|axis| &**axis).collect();
                match (axes.as_slice(), shape.as_slice()) {
                    (["y", "x"], [_, _]) => Self::Image { dtype: *dtype, channels: None },
                    (["y", "x", "channel"], [_, _, channels]) => {
                        Self::Image { dtype: *dtype, channels: Some(*channels) }
                    }
                    _ => Self::Tensor(*dtype),
                }
            }
        }
    }
}
