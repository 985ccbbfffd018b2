//! Products: the values of a view, frame, scene or dataset that renderers offer, annotators provide and writers read.
//!
//! A [`Key`] states the name, type, [`Scope`], [`Semantic`] and unit of a product, and the [`Framing`] of a rendered
//! one. [`Products`] holds the products of one view. Every product has one generic encoding, [`Value`], whose [`Form`]
//! follows from the type. A generic writer can therefore store products that it does not know, and refuses products
//! that it cannot store before anything is rendered. [`Stored`] reads products back from files.

mod bbox;
mod camera;
mod counts;
mod declared;
mod decode;
mod depths;
mod extent;
mod form;
mod framing;
mod graph;
mod id;
mod key;
mod mask;
mod models;
mod object_images;
mod occlusion_order;
mod paint;
mod per_instance;
mod pixel;
mod plane;
mod product_trait;
mod serialize;
pub mod standard;
mod store;
mod types;
mod value;

pub use bbox::{BBox, meeting_boxes};
pub use camera::{DistortionRecord, StatedCamera};
pub use counts::PixelCounts;
pub use declared::{DeclaredForm, DeclaredProduct};
pub use decode::Stored;
pub use depths::{ObjectDepths, ObjectRun};
pub use extent::{Extent, extents};
pub use form::Form;
pub use framing::{Framing, FramingError, Lighting, MAX_CANVAS, MAX_SUBPIXELS, ScenePart, ViewMoment};
pub use graph::{Graph, Layer, reversed, strong_components};
pub use id::{ProductId, ProductRef, parse_product};
pub use key::{Key, KeyId, LinkedKey, Scope, Semantic, linked};
pub use mask::Mask;
pub use models::{ObjectModel, ObjectModels};
pub use object_images::{ObjectImage, ObjectImages};
pub use occlusion_order::OcclusionOrder;
pub use paint::{Painted, masks_of};
pub use per_instance::PerInstance;
pub use pixel::Pixel;
pub use plane::{BitPlane, Plane};
pub use product_trait::Product;
pub use store::Products;
pub use value::{DType, Tensor, Value};
