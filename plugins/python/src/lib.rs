//! The private module `syntable._syntable` of the Python package. The package in `python/syntable` is the public side: it names,
//! types and documents everything, and this crate does the work.
//!
//! Work runs on threads of its own, without Python's global lock. The calling thread waits for it, shows progress and handles
//! signals.

mod command;
mod dataset;
mod errors;
mod generator;
mod masks;
mod recipe;
mod registry;
mod run_dataset;
mod sample;
mod scenes;
mod stages;
mod values;
mod verbs;
mod work;

use pyo3::prelude::*;

/// The private part of the package.
#[pymodule]
mod _syntable {
    #[pymodule_export]
    use super::command::main;
    #[pymodule_export]
    use super::dataset::Dataset;
    #[pymodule_export]
    use super::generator::Generator;
    #[pymodule_export]
    use super::masks::{Mask, masks_of};
    #[pymodule_export]
    use super::recipe::{Recipe, builtin_recipes};
    #[pymodule_export]
    use super::sample::Sample;
    #[pymodule_export]
    use super::scenes::Scenes;
    #[pymodule_export]
    use super::stages::{
        FinishedDataset, SceneAssets, SceneOutput, add_annotator, add_asset_source, add_light, add_placer, add_sensor,
        add_writer, end_calls, missing_product,
    };
    #[pymodule_export]
    use super::verbs::{Viewer, convert, evaluate, merge, plan, preview, report, run, stats, status, validate, verify};
    use super::*;

    /// Whether a name is a URL, and not a path of this machine.
    #[pyfunction]
    fn is_url(name: &str) -> bool {
        syntable_model::store::is_url(name)
    }

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
