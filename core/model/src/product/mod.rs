//! Products: the values of a view (or scene) that renderers offer, annotators provide and writers want.
//!
//! A [`Key`] names a product and its type; a [`Frame`] holds the products of one view. Every product has one generic
//! encoding, [`Value`], so that a generic writer can write an annotation it has never heard of.

mod frame;
mod key;
mod mask;
mod plane;
mod serialize;
pub mod standard;
mod value;

pub use frame::Frame;
pub use key::{Key, KeyId, Product, Scope};
pub use mask::Mask;
pub use plane::{BitPlane, Plane};
pub use value::{BBox, DType, OcclusionOrder, PerInstance, Pixel, Tensor, Value};
