//! Synthetic datasets for unseen-object amodal instance segmentation.
//!
//! This crate links every stock plugin and names every verb of the program as a function. It prints nothing, reads no arguments and
//! handles no signals: progress goes to a [`Reporter`], and a [`Stop`] ends work early.
//!
//! ```
//! use syntable::model::product::standard::VISIBLE_MASK;
//! use syntable::{GenerateOptions, Quiet, RecipeRequest, Registry, generate};
//!
//! let request = RecipeRequest::new("builtin:quickstart").set("dataset.scenes", "1").set("camera.resolution", "[96, 72]");
//! let recipe = request.load(&Registry::linked()?, &["visible_mask"], &Quiet)?;
//! let options = GenerateOptions { products: vec!["visible_mask".into()], ..GenerateOptions::default() };
//! generate(&recipe, &options, &Quiet, &mut |sample| {
//!     let masks = sample.products.get(VISIBLE_MASK)?;
//!     let pixels: u32 = masks.iter().map(|(_, mask)| mask.area()).sum();
//!     println!("view {}: {} objects on {pixels} of {} pixels", sample.view.id.0, masks.iter().count(), 96 * 72);
//!     Ok(())
//! })?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A dataset can be written to any [`store`], such as memory:
//!
//! ```
//! use std::sync::Arc;
//! use syntable::store::MemStore;
//! use syntable::{DiskCache, Quiet, RecipeRequest, Registry, RunOptions, run, verify};
//!
//! let request = RecipeRequest::new("builtin:quickstart")
//!     .set("dataset.scenes", "1")
//!     .set("dataset.views_per_scene", "1")
//!     .set("camera.resolution", "[32, 24]");
//! let recipe = request.load(&Registry::linked()?, &[], &Quiet)?;
//! let store = Arc::new(MemStore::default());
//! run(&recipe, &RunOptions::new(Arc::clone(&store), 2, DiskCache::none()), &Quiet)?;
//! let image = store.get("data/mono/rgb/0_0.png").expect("the image of view 0 of scene 0");
//! assert!(image.starts_with(b"\x89PNG") && verify(store, 2)?.whole());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | verb | function |
//! | --- | --- |
//! | – | [`generate`], [`Generator`]: samples in memory |
//! | `run` | [`run`] |
//! | `merge`, `verify` | [`merge`], [`verify`] |
//! | `check` | [`check`], [`check_assets`] |
//! | `validate` | [`validate`] |
//! | `convert` | [`convert`] |
//! | `eval` | [`evaluate`] |
//! | `stats` | [`stats::compare`] |
//! | `report`, `view` | [`report::make::make`], [`view::Viewer`] |
//! | `preview` | [`preview::Preview`] |

use syntable_annotate as _;
use syntable_assets as _;
use syntable_denoise as _;
use syntable_exec as _;
#[cfg(feature = "hdf5")]
use syntable_hdf5 as _;
use syntable_household as _;
use syntable_interchange as _;
#[cfg(feature = "object-store")]
use syntable_object_store as _;
#[cfg(feature = "parquet")]
use syntable_parquet as _;
use syntable_physics as _;
use syntable_placement as _;
use syntable_render_cpu as _;
#[cfg(feature = "gpu")]
use syntable_render_wgpu as _;
use syntable_sampling as _;
use syntable_sensor as _;
use syntable_write as _;

/// Crates of stages and formats that this crate links.
pub const STOCK_CRATES: [&str; 15] = [
    "syntable-annotate",
    "syntable-assets",
    "syntable-denoise",
    "syntable-exec",
    "syntable-hdf5",
    "syntable-household",
    "syntable-interchange",
    "syntable-parquet",
    "syntable-physics",
    "syntable-placement",
    "syntable-render-cpu",
    "syntable-render-wgpu",
    "syntable-sampling",
    "syntable-sensor",
    "syntable-write",
];

model::inventory::submit! { model::registry::StockCrates(&STOCK_CRATES) }

pub use syntable_evaluate::{self as evaluation, EvaluateOptions, Evaluation, evaluate, evaluate_detections};
pub use syntable_model as model;
pub use syntable_model::error::Error;
pub use syntable_model::reader::Source as DatasetSource;
pub use syntable_model::registry::Registry;
pub use syntable_model::store;
pub use syntable_recipe::{self as recipe, Recipe, RecipeRequest};
pub use syntable_report::preview::{self, PreviewOptions};
pub use syntable_report::{report, stats, view};
pub use syntable_runtime::cache::DiskCache;
pub use syntable_runtime::check::{CheckedRecipe, check, check_assets};
pub use syntable_runtime::conversion::{Conversion, ConvertOptions, convert};
pub use syntable_runtime::generate::{GenerateOptions, Generated, Generator, Sample, SceneService, generate};
pub use syntable_runtime::images::ImageWork;
pub use syntable_runtime::left_out::LeftOutReport;
pub use syntable_runtime::run::progress::{Event, Quiet, Reporter};
pub use syntable_runtime::run::stop::Stop;
pub use syntable_runtime::run::{MergeOptions, RunOptions, RunOutcome, Verified, merge, run, verify};
pub use syntable_runtime::validate::{ValidatedDataset, validate_path as validate};
pub use syntable_runtime::workers::{self, Pool};
