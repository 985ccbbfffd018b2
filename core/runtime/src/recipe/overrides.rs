//! What the command line and the machine add to a recipe, as values that tests can replace.

use std::io;
use std::path::{Path, PathBuf};

/// Overrides of a recipe, and where its variables, files and relative paths come from.
pub struct Overrides<'a> {
    /// Paths such as `lights[0].count` or `place.objects.count`, and TOML values; a word that is no TOML value is a text.
    pub set: Vec<(String, String)>,
    /// Environment variables.
    pub variable: &'a dyn Fn(&str) -> Option<String>,
    /// Reads a recipe that another one extends.
    pub read: &'a dyn Fn(&Path) -> io::Result<String>,
    /// The folder that relative paths in overrides and in embedded recipes count from.
    pub current_folder: PathBuf,
}

impl Overrides<'static> {
    /// Overrides, with the process' environment, files and folder.
    pub fn of_process(set: Vec<(String, String)>) -> Self {
        Self {
            set,
            variable: &|name| std::env::var(name).ok(),
            read: &|path| std::fs::read_to_string(path),
            current_folder: std::env::current_dir().unwrap_or_default(),
        }
    }
}
