//! Recipes.

use crate::errors::{self, exception};
use crate::registry::registry;
use crate::work::check_process;
use pyo3::prelude::*;
use pyo3::types::PyList;
use std::path::PathBuf;
use std::sync::Arc;
use syntable_model::stage::Input;
use syntable_recipe::{BUILTINS, Diagnostic, Overrides, RecipeRequest, Report, Source, checked, load};

/// The text of a recipe, and changes to it.
#[pyclass(frozen, module = "syntable._syntable")]
#[derive(Clone)]
pub struct Recipe {
    source: Source,
    /// Keys with their values as TOML.
    changes: Vec<(String, String)>,
}

/// The arguments of [`Recipe::of_parts`]: name, path, text and changes.
type Parts = (String, Option<PathBuf>, String, Vec<(String, String)>);

/// A loaded recipe and its warnings.
pub type Loaded = (Arc<syntable_recipe::Recipe>, Vec<Diagnostic>);

impl Recipe {
    fn overrides(&self, wanted: &[String]) -> Overrides<'static> {
        let wanted = wanted.iter().map(|name| Input::named(name.as_str())).collect();
        Overrides { wanted, ..Overrides::of_process(self.changes.clone()) }
    }

    /// Loads the recipe for work on this machine, with these products in addition to what its writers read.
    ///
    /// # Errors
    /// With all mistakes at once.
    pub fn load(&self, py: Python<'_>, wanted: &[String]) -> PyResult<Loaded> {
        check_process(py)?;
        let registry = registry(py)?;
        let loaded = py.detach(|| {
            let overrides = self.overrides(wanted);
            load(&registry, self.source.clone(), &overrides.for_run().with_existing_paths())
        });
        let (recipe, warnings) = loaded.map_err(|report| errors::of_recipe(py, &report))?;
        Ok((Arc::new(recipe), warnings))
    }

    /// The recipe as functions of the library take it.
    pub fn request(&self) -> RecipeRequest {
        let set = self.changes.iter().map(|(key, value)| format!("{key}={value}")).collect();
        RecipeRequest {
            recipe: self.source.path.clone(),
            source: Some(self.source.clone()),
            set,
            ..RecipeRequest::default()
        }
    }

    /// The recipe without its mistakes, or its mistakes. Nothing is opened.
    pub fn checked(&self, py: Python<'_>) -> PyResult<Result<(syntable_recipe::Recipe, Vec<Diagnostic>), Report>> {
        let registry = registry(py)?;
        Ok(py.detach(|| checked(&registry, self.source.clone(), &self.overrides(&[])).recipe))
    }
}

#[pymethods]
impl Recipe {
    /// The recipe in a file, or `builtin:NAME`.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let source = Source::read(path).map_err(|error| exception(py, &error.of_request()))?;
        Ok(Self { source, changes: Vec::new() })
    }

    /// A recipe that is not in a file.
    #[staticmethod]
    fn of_text(name: &str, text: &str) -> Self {
        Self { source: Source::embedded(name, text), changes: Vec::new() }
    }

    /// A recipe from its parts, as pickle stores them.
    #[staticmethod]
    fn of_parts(name: String, path: Option<PathBuf>, text: String, changes: Vec<(String, String)>) -> Self {
        Self { source: Source { name, path, text }, changes }
    }

    /// The same recipe with a key set to a TOML value.
    fn with_change(&self, key: String, value: String) -> Self {
        let mut changed = self.clone();
        changed.changes.push((key, value));
        changed
    }

    /// Name in messages: the path, or a name that is not a path.
    #[getter]
    fn name(&self) -> &str {
        &self.source.name
    }

    /// The text without changes.
    #[getter]
    fn text(&self) -> &str {
        &self.source.text
    }

    /// Keys with their values as TOML.
    #[getter]
    fn changes(&self) -> Vec<(String, String)> {
        self.changes.clone()
    }

    /// Finds all mistakes. Returns the warnings.
    fn check<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        match self.checked(py)? {
            Ok((_, warnings)) => errors::list(py, &warnings),
            Err(report) => Err(errors::of_recipe(py, &report)),
        }
    }

    /// The whole recipe as TOML: with everything that it extends, all changes and all defaults.
    fn resolved(&self, py: Python<'_>) -> PyResult<String> {
        match self.checked(py)? {
            Ok((recipe, _)) => Ok(recipe.resolved),
            Err(report) => Err(errors::of_recipe(py, &report)),
        }
    }

    /// Numbers of scenes and of views per scene.
    fn size(&self, py: Python<'_>) -> PyResult<(u32, u32)> {
        match self.checked(py)? {
            Ok((recipe, _)) => Ok((recipe.dataset.scenes, recipe.dataset.views_per_scene)),
            Err(report) => Err(errors::of_recipe(py, &report)),
        }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Parts)> {
        let Source { name, path, text } = self.source.clone();
        Ok((py.get_type::<Self>().getattr("of_parts")?, (name, path, text, self.changes.clone())))
    }
}

/// Names of the recipes in the program, with what each is.
#[pyfunction]
pub fn builtin_recipes() -> Vec<(String, String)> {
    BUILTINS.iter().map(|recipe| (recipe.name.to_owned(), recipe.summary())).collect()
}
