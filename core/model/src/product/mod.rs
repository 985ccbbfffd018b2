//! Products: the values of a view, scene or dataset that renderers offer, annotators provide and writers read.
//!
//! A [`Key`] names a product, its type, its [`Semantic`] and its unit; [`Products`] holds those of one view. Every
//! product has one generic encoding, [`Value`], whose [`Form`] is known from the type, so that a generic writer can
//! store an annotation it has never heard of, and refuses one that it cannot store before anything is rendered. [`Stored`] is
//! the way back.

mod camera;
mod counts;
mod decode;
mod depths;
mod extent;
mod form;
mod graph;
mod key;
mod mask;
mod models;
mod name;
mod object_images;
mod paint;
mod plane;
mod serialize;
pub mod standard;
mod store;
mod value;

pub use camera::StatedCamera;
pub use counts::PixelCounts;
pub use decode::Stored;
pub use depths::{ObjectDepths, ObjectRun};
pub use extent::{Extent, extents};
pub use form::Form;
pub use graph::{Graph, Layer, strong_components};
pub use key::{Key, KeyId, LinkedKey, Product, Scope, Semantic, linked};
pub use mask::Mask;
pub use models::{ObjectModel, ObjectModels};
pub use name::{Lighting, MAX_CANVAS, MAX_SUBPIXELS, Name, RenderParameters, ViewMoment};
pub use object_images::{ObjectImage, ObjectImages};
pub use paint::{Painted, masks_of};
pub use plane::{BitPlane, Plane};
pub use store::Products;
pub use value::{BBox, DType, OcclusionOrder, PerInstance, Pixel, Tensor, Value, meeting_boxes};
