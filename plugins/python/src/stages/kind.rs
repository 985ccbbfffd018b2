//! A kind of stage that Python adds.

use crate::registry;
use crate::stages::call::with_python;
use crate::values;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use schemars::{Schema, SchemaGenerator};
use serde::Deserialize;
use std::sync::Arc;
use syntable_model::error::{ConfigError, Error};
use syntable_model::intern::intern;
use syntable_model::product::Value;
use syntable_model::registry::{ConstructError, Constructed, Entry, RecipeValue, Registry, Slot, Stage, StageFactory};
use toml::de::ValueDeserializer;

/// A kind as the decorator describes it.
#[derive(FromPyObject)]
pub struct Kind {
    /// Name in recipes.
    name: String,
    /// Module or file.
    owner: String,
    /// `__version__` of its module; `0` if it has none. Datasets record it.
    version: String,
    /// JSON Schema of the options.
    schema: String,
    /// Function from a dict of options to what the stage gets as options, and all options as TOML.
    options: Py<PyAny>,
}

/// Builds the stage from its options.
type Build = dyn Fn(Arc<Py<PyAny>>) -> Stage + Send + Sync;

struct PythonFactory {
    kind: Kind,
    schema: Schema,
    build: Box<Build>,
}

impl Kind {
    /// Name of the stage in messages and random streams.
    pub fn stage(&self, slot: Slot) -> String {
        slot.stage_name(&self.name)
    }

    /// Name in recipes.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Adds the kind to the registry. It replaces a kind that Python added under the same name.
    ///
    /// # Errors
    /// If a crate has the kind.
    pub fn add(self, slot: Slot, build: impl Fn(Arc<Py<PyAny>>) -> Stage + Send + Sync + 'static) -> PyResult<()> {
        let linked = Registry::linked().map_err(PyValueError::new_err)?;
        if let Some(other) = linked.find(slot, &self.name) {
            return Err(PyValueError::new_err(format!(
                "`{}` is a kind of `{slot}` already, from {}; pass name=… to choose another name",
                self.name, other.crate_name
            )));
        }
        let schema = serde_json::from_str::<serde_json::Value>(&self.schema).ok();
        let schema = schema.and_then(|schema| Schema::try_from(schema).ok());
        let schema = schema.ok_or_else(|| PyValueError::new_err("the schema of the options is no JSON Schema"))?;
        let (name, owner, version) = (self.name.clone(), self.owner.clone(), intern(&self.version));
        let factory = Arc::new(PythonFactory { kind: self, schema, build: Box::new(build) });
        let mut entry = Entry::added(slot, &name, &owner, factory);
        entry.crate_version = version;
        registry::add(entry);
        Ok(())
    }
}

impl StageFactory for PythonFactory {
    fn schema(&self, _: &mut SchemaGenerator) -> Schema {
        self.schema.clone()
    }

    fn construct(&self, options: RecipeValue<'_>) -> Result<Constructed, ConstructError> {
        let given = toml::Table::deserialize(ValueDeserializer::from(options)).map_err(ConstructError::Form)?;
        let invalid = |error: Error| {
            let refused = ConfigError::new("", error.without_help());
            ConstructError::Invalid(error.help_text().into_iter().fold(refused, |refused, help| refused.help(help)))
        };
        let given = Value::of(&given).map_err(invalid)?;
        let made = with_python(|py| {
            let given = values::to_python(py, given)?;
            self.kind.options.call1(py, (given,))?.extract::<(Py<PyAny>, String)>(py)
        });
        let (object, all) = made.map_err(invalid)?;
        let options = toml::from_str(&all).map_err(|error| invalid(Error::new(error.to_string())))?;
        Ok(Constructed { stage: (self.build)(Arc::new(object)), options })
    }
}
