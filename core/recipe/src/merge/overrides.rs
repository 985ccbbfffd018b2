//! Inputs of a recipe from the command line and the environment, as values that tests can replace.

use std::io;
use std::path::{Path, PathBuf};
use syntable_model::stage::Input;

/// Overrides of a recipe, and access to variables, files and the current folder.
pub struct Overrides<'a> {
    /// Pairs of path and TOML value, such as `lights[0].count` and `3`. A word that is not a TOML value is a string.
    pub set: Vec<(String, String)>,
    /// Looks up an environment variable.
    pub variable: &'a dyn Fn(&str) -> Option<String>,
    /// Reads a recipe that another recipe extends.
    pub read: &'a dyn Fn(&Path) -> io::Result<String>,
    /// Whether a path that the recipe names exists; always true if that does not matter yet.
    pub exists: &'a dyn Fn(&Path) -> bool,
    /// Whether the folders and files at URLs that the recipe names are listed. Otherwise no stage can read them.
    pub opens_urls: bool,
    /// Base of relative paths in overrides and embedded recipes.
    pub current_folder: PathBuf,
    /// Whether kinds that represent others are replaced by the kinds that they choose on this machine, as a run needs
    /// it.
    pub choose: bool,
    /// Products that are wanted in addition to the products that writers read.
    pub wanted: Vec<Input>,
}

impl Overrides<'static> {
    /// Overrides with the environment, files and current folder of the process.
    pub fn of_process(set: Vec<(String, String)>) -> Self {
        Self {
            set,
            variable: &|name| std::env::var(name).ok(),
            read: &|path| {
                let text = syntable_model::files::read_small(path)?;
                String::from_utf8(text).map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8"))
            },
            exists: &|_| true,
            opens_urls: true,
            current_folder: std::env::current_dir().unwrap_or_default(),
            choose: false,
            wanted: Vec::new(),
        }
    }
}

impl Overrides<'_> {
    /// The same, with kinds that represent others replaced by the kinds that they choose on this machine.
    pub fn for_run(self) -> Self {
        Self { choose: true, ..self }
    }

    /// The same, with a mistake for every path that does not exist.
    pub fn with_existing_paths(self) -> Self {
        Self { exists: &|path| path.exists(), ..self }
    }
}
