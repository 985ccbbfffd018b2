//! The data model of SynTable: everything that a plugin needs.
//!
//! SynTable turns a *recipe* into a dataset for unseen-object amodal instance segmentation. The pipeline has fixed
//! slots:
//!
//! ```text
//! asset sources → placers → settler → [ per view: view sampler, camera, light samplers, renderer, denoiser ]
//!   → sensors → annotators → writers
//! ```
//!
//! Everything after the settled [`Scene`](scene::Scene) is a [product]: a typed value under a [`Key`].
//! Renderers offer products, annotators make new products from them, and writers request products. The program computes
//! only the requested products and those that they are made from.
//!
//! A whole plugin, with its options, its key and its registration:
//!
//! ```
//! use syntable_model::prelude::*;
//! use syntable_model::product::standard::INSTANCE;
//!
//! products! {
//!     /// Visible pixels per instance, counted at pixel centers.
//!     pub const VISIBLE_AREA: Key<PerInstance<u32>> = view("visible_area").unit("px");
//! }
//!
//! /// Counts the visible pixels of every instance.
//! #[derive(Serialize, Deserialize, JsonSchema)]
//! #[serde(deny_unknown_fields, default)]
//! pub struct VisibleArea {
//!     /// Instances with fewer visible pixels are left out.
//!     min_pixels: u32,
//! }
//!
//! impl Default for VisibleArea {
//!     fn default() -> Self {
//!         Self { min_pixels: 1 }
//!     }
//! }
//!
//! impl Config for VisibleArea {
//!     type Stage = dyn ViewAnnotator;
//!     const KIND: &'static str = "visible_area";
//!     const EXAMPLE: &'static str = "min_pixels = 16";
//!     fn build(self) -> Result<Box<dyn ViewAnnotator>, ConfigError> {
//!         Ok(Box::new(self))
//!     }
//! }
//!
//! impl ViewAnnotator for VisibleArea {
//!     fn reads(&self) -> Vec<KeyId> {
//!         keys![INSTANCE]
//!     }
//!     fn provides(&self) -> Vec<KeyId> {
//!         keys![VISIBLE_AREA]
//!     }
//!     fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
//!         let (objects, mut area) = (cx.scene.objects(), PerInstance::default());
//!         for &id in products.get(INSTANCE)?.data() {
//!             if objects.iter().any(|object| object.id == id) {
//!                 *area.0.entry(id).or_insert(0) += 1;
//!             }
//!         }
//!         area.0.retain(|_, pixels| *pixels >= self.min_pixels);
//!         products.put(VISIBLE_AREA, area)
//!     }
//! }
//! register!(VisibleArea);
//! # fn main() {}
//! ```
//!
//! **Invariants.** This crate starts no thread and prints nothing. It reads TOML only as the options of one stage
//! ([`registry`]); the crate `syntable-recipe` handles files, inheritance and diagnostics. Stages receive their random
//! numbers, and no stage has a clock. Everything that reaches a file is ordered by id, never by hash or thread.

pub mod check;
pub mod color;
pub mod context;
pub mod digest;
pub mod dist;
pub mod error;
pub mod files;
mod find_dataset;
pub mod geometry;
pub mod inspect;
pub mod intern;
pub mod left_out;
pub mod length_unit;
pub mod limits;
pub mod linked;
pub mod mirror;
pub mod names;
pub mod natural;
pub mod panics;
pub mod photometry;
pub mod pools;
pub mod product;
pub mod random;
pub mod reader;
pub mod registry;
pub mod rule;
pub mod scene;
pub mod shown;
pub mod stage;
pub mod store;
pub mod unique;
pub mod user_cache;
pub mod words;

pub use inventory;
pub use product::Key;

/// The ids of some keys: what `reads()` and `provides()` return.
#[macro_export]
macro_rules! keys {
    ($($key:expr),* $(,)?) => { vec![$($key.id()),*] };
}

/// Items that nearly every plugin needs.
pub mod prelude {
    pub use crate::context::{
        Context, DatasetContext, FrameContext, ImageContext, ImagesContext, Log, SceneContext, ViewContext,
    };
    pub use crate::dist::{Dist, IntDist};
    pub use crate::error::{ConfigError, Error, Result};
    pub use crate::geometry::Pose;
    pub use crate::left_out::LeftOut;
    pub use crate::names::{AssetPath, EnvironmentPool, MaterialPool, ObjectPool, ProductName, SupportName};
    pub use crate::pools::{EnvironmentPools, MaterialPools, ObjectPools, Pools};
    pub use crate::product::{Key, KeyId, Mask, PerInstance, Plane, Products, Semantic, Value};
    pub use crate::random::Stream;
    pub use crate::registry::Config;
    pub use crate::scene::{InstanceId, Scene, SceneBuilder, View};
    pub use crate::stage::*;
    pub use crate::{config, keys, products, register};
    pub use schemars::JsonSchema;
    pub use serde::{Deserialize, Serialize};
}
