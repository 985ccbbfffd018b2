//! Inspectors: how `syntable check --asset PATH` looks at one file or folder of any kind.

use crate::context::Log;
use crate::error::{Error, Result};
use crate::panics::guarded;
use crate::store::is_url;
use std::path::Path;

/// Knows one kind of asset file or folder. Registered with [`register_inspector!`](crate::register_inspector).
#[derive(Clone, Copy)]
pub struct Inspector {
    /// The kind of asset that it inspects, such as `OBJ mesh` or `PBR material folder`; unique.
    pub name: &'static str,
    /// Whether a path looks like its kind, from names alone. The file may still be broken, or not exist.
    pub accepts: fn(&Path) -> bool,
    /// Loads the asset and returns its facts. An error refuses the asset; warnings go to the log.
    pub inspect: fn(&Path, &dyn Log) -> Result<Inspection>,
}

/// Facts about an asset.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Inspection {
    /// Names and values in reading order: `("triangles", "5762")`.
    pub facts: Vec<(String, String)>,
}

impl Inspection {
    /// Adds a fact.
    pub fn fact(mut self, name: &str, value: impl ToString) -> Self {
        self.facts.push((name.to_owned(), value.to_string()));
        self
    }
}

inventory::collect!(Inspector);

/// All inspectors of the program, sorted by name.
pub fn inspectors() -> Vec<Inspector> {
    let mut all: Vec<Inspector> = inventory::iter::<Inspector>.into_iter().copied().collect();
    all.sort_by_key(|inspector| inspector.name);
    all
}

/// Inspects a path with the inspector that knows it.
pub fn inspect(path: &Path, log: &dyn Log) -> Result<(&'static str, Inspection)> {
    let all = inspectors();
    let Some(inspector) = all.iter().find(|inspector| (inspector.accepts)(path)) else {
        if !path.exists() {
            let missing = Error::new("no such file or folder").in_file(path);
            return Err(match path.to_str().is_some_and(is_url) {
                true => missing.help("pools read assets at URLs; this command reads files of this machine"),
                false => missing,
            });
        }
        let known: Vec<&str> = all.iter().map(|inspector| inspector.name).collect();
        return Err(Error::new("no known kind of asset")
            .in_file(path)
            .help(format!("known are: {}", known.join(", "))));
    };
    let reader = format!("the reader of {}", inspector.name);
    guarded(&reader, path, || (inspector.inspect)(path, log)).map(|inspection| (inspector.name, inspection))
}

/// Registers inspectors.
#[macro_export]
macro_rules! register_inspector {
    ($($inspector:expr),+ $(,)?) => {$(
        $crate::inventory::submit! { $inspector }
    )+};
}
