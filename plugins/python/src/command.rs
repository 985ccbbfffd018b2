//! The command `syntable`, in this process.

use crate::registry::whole;
use pyo3::prelude::*;
use syntable_program::Program;

/// Runs a command line, with the program's name first. Returns its exit code. Signals are handled as by the program.
#[pyfunction]
pub fn main(py: Python<'_>, arguments: Vec<std::ffi::OsString>) -> u8 {
    py.detach(|| match whole().and_then(|registry| Ok(Program::linked()?.with_registry(registry).with_plugins())) {
        Ok(program) => program.run_with(arguments),
        Err(clash) => syntable_program::refused(clash),
    })
}
