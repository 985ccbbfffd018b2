//! Inputs of a recipe from the command line and the environment, as values that tests can replace.

use std::io;
use std::path::{Path, PathBuf};

/// Overrides of a recipe, and access to variables, files and the current folder.
pub struct Overrides<'a> {
    /// Pairs of path and TOML value, such as `lights[0].count` and `3`. A word that is no TOML value is a string.
    pub set: Vec<(String, String)>,
    /// Looks up an environment variable.
    pub variable: &'a dyn Fn(&str) -> Option<String>,
    /// Reads a recipe that another one extends.
    pub read: &'a dyn Fn(&Path) -> io::Result<String>,
    /// Base of relative paths in overrides and embedded recipes.
    pub current_folder: PathBuf,
}

impl Overrides<'static> {
    /// Overrides with the environment, files and current folder of the process.
    pub fn of_process(set: Vec<(String, String)>) -> Self {
        Self {
            set,
            variable: &|name| std::env::var(name).ok(),
            read: &|path| std::fs::read_to_string(path),
            current_folder: std::env::current_dir().unwrap_or_default(),
        }
    }
}
