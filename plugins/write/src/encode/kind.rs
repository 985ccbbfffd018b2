//! What kind of value a product is: its form, what its numbers mean, and their unit.

use std::fmt;
use syntable_model::product::{DType, KeyId, Tensor, Value};

/// What the numbers of a product mean, beyond their type.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Semantic {
    /// A color: floats are linear Rec. 709, 8-bit integers are sRGB-encoded.
    Color,
    /// A distance along the optical axis; 0 or infinite where there is none.
    Depth,
    /// A unit vector of the camera frame (x right, y down, z forward); zero where there is none.
    Normal,
    /// Ids; 0 stands for none.
    Label,
    /// Pixels that are in or out.
    Mask,
    /// Anything else: numbers, records, text.
    Data,
}

/// The form of a product's [`Value`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Form {
    /// A truth value, an integer or a floating-point number.
    Number,
    /// Text.
    Text,
    /// A binary mask of the image.
    Mask,
    /// Named fields.
    Record,
    /// A list of values.
    List,
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
    PerInstance,
}

/// What kind of value a product is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Kind {
    /// Its form; the form of one instance's value if it is a value per instance.
    pub form: Form,
    /// What its numbers mean.
    pub semantic: Semantic,
    /// Unit of its numbers, such as `m`; empty if they have none.
    pub unit: &'static str,
}

impl Kind {
    /// The kind of a value of a product.
    pub fn of(key: &KeyId, value: &Value) -> Self {
        let (semantic, unit) = meaning(key.name);
        Self { form: Form::of(value), semantic, unit }
    }
}

/// Meaning and unit of the standard products' numbers.
fn meaning(product: &str) -> (Semantic, &'static str) {
    match product {
        "rgb" | "albedo" | "albedo_mean" => (Semantic::Color, ""),
        "radiance" | "radiance_noisy" | "radiance_gloss" | "radiance_untinted" => (Semantic::Color, "nit"),
        "radiance_variance" | "radiance_gloss_variance" | "radiance_untinted_variance" => (Semantic::Data, "nit²"),
        "depth" | "depth_sensed" => (Semantic::Depth, "m"),
        "normal" | "normal_mean" => (Semantic::Normal, ""),
        "instance" => (Semantic::Label, ""),
        "visible_mask" | "amodal_mask" | "occlusion_mask" => (Semantic::Mask, ""),
        _ => (Semantic::Data, ""),
    }
}

impl Form {
    /// The form of a value.
    pub fn of(value: &Value) -> Self {
        match value {
            Value::Bool(_) | Value::Int(_) | Value::Float(_) => Self::Number,
            Value::Text(_) => Self::Text,
            Value::Tensor(tensor) => Self::of_tensor(tensor),
            Value::Mask(_) => Self::Mask,
            Value::List(_) => Self::List,
            Value::Record(_) => Self::Record,
            Value::PerInstance(_) => Self::PerInstance,
        }
    }

    fn of_tensor(tensor: &Tensor) -> Self {
        let dtype = tensor.dtype;
        match (tensor.axes.as_slice(), tensor.shape.as_slice()) {
            (["y", "x"], [_, _]) => Self::Image { dtype, channels: None },
            (["y", "x", "channel"], [_, _, channels]) => Self::Image { dtype, channels: Some(*channels) },
            _ => Self::Tensor(dtype),
        }
    }
}

impl fmt::Display for Form {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number => f.write_str("number"),
            Self::Text => f.write_str("text"),
            Self::Mask => f.write_str("mask"),
            Self::Record => f.write_str("record"),
            Self::List => f.write_str("list"),
            Self::Image { dtype, channels: None } => write!(f, "{} image", name(*dtype)),
            Self::Image { dtype, channels: Some(1) } => write!(f, "{} image of 1 channel", name(*dtype)),
            Self::Image { dtype, channels: Some(channels) } => {
                write!(f, "{} image of {channels} channels", name(*dtype))
            }
            Self::Tensor(dtype) => write!(f, "{} array that is not an image", name(*dtype)),
            Self::PerInstance => f.write_str("value per instance inside another value"),
        }
    }
}

/// The element type as Rust writes it.
fn name(dtype: DType) -> &'static str {
    match dtype {
        DType::Bool => "bool",
        DType::U8 => "u8",
        DType::U16 => "u16",
        DType::U32 => "u32",
        DType::U64 => "u64",
        DType::F32 => "f32",
        DType::F64 => "f64",
    }
}
