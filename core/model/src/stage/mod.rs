//! The stages of the pipeline, one trait a file.
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

pub use annotator::Annotator;
pub use asset_source::AssetSource;
pub use camera_model::CameraModel;
pub use denoiser::{Denoised, Denoiser};
pub use light_sampler::LightSampler;
pub use placer::Placer;
pub use renderer::{RenderRequest, RenderSession, Renderer};
pub use sensor::Sensor;
pub use settler::Settler;
pub use view_sampler::{Shell, ViewSampler};
pub use writer::{Finish, Output, SceneWriter, Writer};

use crate::scene::{Scene, View};

/// What every stage may know of the dataset.
#[derive(Debug, Clone, PartialEq)]
pub struct DatasetInfo {
    /// `dataset.name` of the recipe.
    pub name: String,
    /// `dataset.seed`.
    pub seed: u64,
    /// `dataset.scenes`.
    pub scenes: u32,
    /// `dataset.views_per_scene`.
    pub views_per_scene: u32,
    /// Text of the resolved recipe.
    pub recipe: String,
    /// Name and version of the program.
    pub program: String,
}

/// Where a product is being made or written.
#[derive(Clone, Copy)]
pub struct Site<'a> {
    /// The dataset.
    pub dataset: &'a DatasetInfo,
    /// The scene.
    pub scene: &'a Scene,
    /// The view; none while scene-scoped products are made.
    pub view: Option<&'a View>,
}
