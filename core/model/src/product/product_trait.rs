//! The trait of products.

use super::{Form, Stored, Value};
use std::any::Any;

/// A value that can be a product.
pub trait Product: Any + Send + Sync {
    /// The generic encoding, for writers that do not know the type.
    fn encode(&self) -> Value;
    /// The form of the [encoding](Self::encode), where it follows from the type. A writer that cannot store this form
    /// is refused before anything is rendered.
    fn form() -> Form
    where
        Self: Sized,
    {
        Form::Any
    }
    /// Whether [`decode`](Self::decode) reads the product from files.
    fn is_decoded() -> bool
    where
        Self: Sized,
    {
        false
    }
    /// The product from the value in a file. `None` if the value has another type.
    fn decode(stored: Stored<'_>) -> Option<Self>
    where
        Self: Sized,
    {
        let _ = stored;
        None
    }
}

/// A product of any type.
pub trait AnyProduct: Any + Send + Sync {
    fn encode(&self) -> Value;
}

impl<T: Product> AnyProduct for T {
    fn encode(&self) -> Value {
        Product::encode(self)
    }
}
