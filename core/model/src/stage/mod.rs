//! The stages of the pipeline, one trait per file.
//!
//! asset sources → placers → settler → per view: view sampler, camera, light samplers, renderer, denoiser → sensors →
//! annotators → writers.
//!
//! All traits are object-safe and take `&self`: a stage never changes after it was built, and what a run needs to
//! remember lives in values that it returns. Randomness is handed in.

mod annotator;
mod asset_source;
mod camera_model;
mod denoiser;
mod light_sampler;
mod placer;
mod renderer;
mod sensor;
mod settler;
mod view_sampler;
mod writer;

pub use annotator::{Annotator, DatasetAnnotator, RecordedScene, SceneAnnotator, ViewProducts};
pub use asset_source::{AssetLimits, AssetSource};
pub use camera_model::CameraModel;
pub use denoiser::Denoiser;
pub use light_sampler::LightSampler;
pub use placer::{Placer, TabletopUse};
pub use renderer::{Bodies, RenderRequest, RenderSession, Renderer, Window};
pub use sensor::Sensor;
pub use settler::Settler;
pub use view_sampler::{Shell, ViewSampler};
pub use writer::{Accepts, FileOf, Finish, Input, Output, RESERVED, SceneWriter, Writer, check_path, shard_path};

use crate::product::KeyId;

/// What every stage may know of the dataset.
#[derive(Debug, Clone, PartialEq)]
pub struct DatasetInfo {
    /// `dataset.name` of the recipe.
    pub name: String,
    /// `dataset.seed`.
    pub seed: u64,
    /// `dataset.scenes`.
    pub scenes: u32,
    /// `dataset.views_per_scene`; in what belongs to one scene, the number of its views. A dataset that has grown may have
    /// fewer in its first scenes.
    pub views_per_scene: u32,
    /// Text of the resolved recipe, without the digests of its inputs.
    pub recipe: String,
    /// Name and version of the program.
    pub program: String,
}

/// A product that a stage replaces: readers of `product` get the new one, and the stage itself reads the original under
/// the key `original`, as anybody else can.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Replacement {
    /// The product, which the stage provides anew.
    pub product: KeyId,
    /// Key of the same type under which the original is kept.
    pub original: KeyId,
}
