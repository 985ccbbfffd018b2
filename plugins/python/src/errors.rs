//! Errors of the library as exceptions of the package.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use syntable_cli::with_options;
use syntable_model::error::{Error, Place};
use syntable_recipe::{Diagnostic, Report};

/// The Python module with the classes of the exceptions.
const CLASSES: &str = "syntable.errors";

/// The exception for an error.
pub fn exception(py: Python<'_>, error: &Error) -> PyErr {
    made(py, error).unwrap_or_else(|failed| failed)
}

/// Arguments of functions that are truth values: messages ask for them to be true.
const SWITCHES: [&str; 5] = ["allow_code", "overwrite", "repair", "retry_failed", "rewrite"];

/// A message with arguments of functions for the options that it names: each argument has the name of its field.
pub fn with_arguments(message: &str) -> String {
    let argument = |name: &str| if SWITCHES.contains(&name) { format!("`{name}=True`") } else { format!("`{name}`") };
    with_options(message, argument).into_owned()
}

fn made(py: Python<'_>, error: &Error) -> PyResult<PyErr> {
    let fields = fields(py, error)?;
    let class = py.import(CLASSES)?.getattr("SyntableError")?;
    Ok(PyErr::from_value(class.call((with_arguments(&error.to_string()),), Some(&fields))?))
}

fn fields<'py>(py: Python<'py>, error: &Error) -> PyResult<Bound<'py, PyDict>> {
    let fields = PyDict::new(py);
    fields.set_item("message", with_arguments(error.message()))?;
    fields.set_item("file", error.file().map(|file| file.display().to_string()))?;
    let line = if let Some(Place::Line(line)) = error.place() { Some(line) } else { None };
    fields.set_item("line", line)?;
    fields.set_item("help", error.help_text().map(with_arguments))?;
    // As the exit code of a command.
    fields.set_item("temporary", !error.is_permanent())?;
    Ok(fields)
}

/// The exception for all mistakes of a recipe.
pub fn of_recipe(py: Python<'_>, report: &Report) -> PyErr {
    of_report(py, report).unwrap_or_else(|failed| failed)
}

fn of_report(py: Python<'_>, report: &Report) -> PyResult<PyErr> {
    let Some(diagnostics) = diagnostics(py, report.iter())? else {
        // The recipe could not be read.
        return match &report.other {
            Some(error) => made(py, &error.clone().of_request()),
            None => made(py, &Error::new(report.to_string())),
        };
    };
    let fields = PyDict::new(py);
    fields.set_item("diagnostics", diagnostics)?;
    let class = py.import(CLASSES)?.getattr("RecipeError")?;
    Ok(PyErr::from_value(class.call((report.to_string().trim_end(),), Some(&fields))?))
}

/// Diagnostics as objects of the package; none if empty.
fn diagnostics<'py, 'd>(
    py: Python<'py>,
    all: impl Iterator<Item = &'d Diagnostic>,
) -> PyResult<Option<Bound<'py, PyList>>> {
    let class = py.import(CLASSES)?.getattr("Diagnostic")?;
    let list = PyList::empty(py);
    for diagnostic in all {
        list.append(of_diagnostic(py, &class, diagnostic)?)?;
    }
    Ok(Some(list).filter(|list| !list.is_empty()))
}

fn of_diagnostic<'py>(
    py: Python<'py>,
    class: &Bound<'py, PyAny>,
    diagnostic: &Diagnostic,
) -> PyResult<Bound<'py, PyAny>> {
    let fields = PyDict::new(py);
    let place = diagnostic.labels.first().map(|label| (label.file.name().to_owned(), label.line_column()));
    fields.set_item("code", diagnostic.code.text())?;
    fields.set_item("severity", if diagnostic.is_error() { "error" } else { "warning" })?;
    fields.set_item("message", &diagnostic.message)?;
    fields.set_item("file", place.as_ref().map(|(file, _)| file))?;
    fields.set_item("line", place.as_ref().map(|(_, (line, _))| line))?;
    fields.set_item("column", place.as_ref().map(|(_, (_, column))| column))?;
    fields.set_item("help", &diagnostic.help)?;
    fields.set_item("text", diagnostic.render(false))?;
    class.call((), Some(&fields))
}

/// Diagnostics as a list of objects of the package.
pub fn list<'py>(py: Python<'py>, all: &[Diagnostic]) -> PyResult<Bound<'py, PyList>> {
    Ok(diagnostics(py, all.iter())?.unwrap_or_else(|| PyList::empty(py)))
}
