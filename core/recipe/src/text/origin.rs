//! Where the text of a recipe comes from: a file, or the program, which embeds the shipped recipes
//! (`extends = "builtin:quickstart"`, `syntable run builtin:window-room`).

use crate::text::suggest::{listing, nearest};
use std::path::{Component, Path, PathBuf};
use syntable_model::error::Error;
use syntable_model::files::read_small;

/// The text of a recipe and its origin.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// Its name in diagnostics, if it has no path.
    pub name: String,
    /// Its file. Relative paths start from the file's folder, or without a file from the current folder.
    pub path: Option<PathBuf>,
    /// The text.
    pub text: String,
}

impl Source {
    /// Reads a file, or takes the embedded recipe that `builtin:NAME` means.
    pub fn read(path: impl Into<PathBuf>) -> Result<Self, Error> {
        let path = path.into();
        if let Some(name) = path.to_str().and_then(|path| path.strip_prefix(PREFIX)) {
            return Builtin::find(name).map(Builtin::source);
        }
        let bytes = read_small(&path).map_err(|error| {
            let failed = Error::io(&path, &error);
            match path
                .to_str()
                .filter(|name| BUILTINS.iter().any(|builtin| builtin.name == name.trim_end_matches(".toml")))
            {
                Some(name) => failed.help(format!(
                    "write {}{} for the recipe in the program",
                    PREFIX,
                    name.trim_end_matches(".toml")
                )),
                None => failed,
            }
        })?;
        let text = String::from_utf8(bytes).map_err(|error| {
            Error::new("the recipe is not UTF-8").in_file(&path).at_byte(error.utf8_error().valid_up_to() as u64)
        })?;
        Ok(Self::file(path, text))
    }

    /// A recipe in a file.
    pub fn file(path: impl Into<PathBuf>, text: impl Into<String>) -> Self {
        let path = path.into();
        Self { name: path.display().to_string(), path: Some(path), text: text.into() }
    }

    /// A recipe that is not in a file, such as one embedded in the program.
    pub fn embedded(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self { name: name.into(), path: None, text: text.into() }
    }
}

/// Prefix of the name of an embedded recipe, in places that also accept a path.
pub const PREFIX: &str = "builtin:";

/// A recipe that is part of the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Builtin {
    /// Its path in the folder `recipes`, without `.toml`.
    pub name: &'static str,
    /// The text.
    pub text: &'static str,
}

macro_rules! builtins {
    ($($name:literal),+ $(,)?) => {
        /// All embedded recipes, sorted by name, including recipes that need assets.
        pub const BUILTINS: &[Builtin] = &[$(Builtin {
            name: $name,
            text: include_str!(concat!("../../../../recipes/", $name, ".toml")),
        }),+];
    };
}

builtins![
    "bin-picking",
    "bop-pbr",
    "ceiling-room",
    "clutter",
    "lived-in",
    "open-sky",
    "quickstart",
    "real-objects",
    "real-surroundings",
    "shelf",
    "syntable-sim/release",
    "syntable-sim/train",
    "syntable-sim/val",
    "table-setting",
    "tote-to-shelf",
    "uoais-sim",
    "window-room",
];

impl Builtin {
    /// The embedded recipe of a name; the error lists all names.
    pub fn find(name: &str) -> Result<&'static Self, Error> {
        BUILTINS.iter().find(|builtin| builtin.name == name).ok_or_else(|| {
            let near = nearest(name, BUILTINS.iter().map(|builtin| builtin.name));
            let near = near.map_or_else(String::new, |near| format!("did you mean `{PREFIX}{near}`? "));
            let names = listing(BUILTINS.iter().map(|builtin| builtin.name));
            Error::new(format!("unknown recipe `{PREFIX}{name}`")).help(format!("{near}the names are {names}"))
        })
    }

    /// The recipe as a source. Its relative paths start from the current folder.
    pub fn source(&self) -> Source {
        Source::embedded(format!("{PREFIX}{}", self.name), self.text)
    }

    /// The first sentence of its opening comment, which names what it makes.
    pub fn summary(&self) -> String {
        let comment =
            self.text.lines().skip_while(|line| line.starts_with("#:")).map_while(|line| line.strip_prefix('#'));
        syntable_model::words::first_sentence(&comment.collect::<Vec<_>>().join(" "))
    }
}

/// The name of the embedded recipe that a path means: a name with its prefix, or, in an embedded recipe, a file next to
/// it.
pub(crate) fn name_of(path: &str, file: &str) -> Option<String> {
    if let Some(name) = path.strip_prefix(PREFIX) {
        return Some(name.to_owned());
    }
    let folder = Path::new(file.strip_prefix(PREFIX)?).parent()?;
    if path.starts_with("${") || Path::new(path).is_absolute() {
        return None;
    }
    let mut words: Vec<String> = Vec::new();
    for component in folder.join(path).components() {
        match component {
            Component::ParentDir => drop(words.pop()),
            Component::Normal(word) => words.push(word.to_string_lossy().into_owned()),
            _ => {}
        }
    }
    Some(words.join("/").trim_end_matches(".toml").to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_shipped_recipes_are_embedded() {
        let recipes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../recipes");
        let mut found = Vec::new();
        let mut folders = vec![recipes.clone()];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).expect("readable") {
                let path = entry.expect("readable").path();
                match path.extension() {
                    None if path.is_dir() => folders.push(path),
                    Some(extension) if extension == "toml" => {
                        let name = path.strip_prefix(&recipes).expect("below").with_extension("");
                        found.push(name.to_string_lossy().replace('\\', "/"));
                    }
                    _ => {}
                }
            }
        }
        found.sort();
        assert_eq!(BUILTINS.iter().map(|builtin| builtin.name).collect::<Vec<_>>(), found);
        assert!(BUILTINS.iter().all(|builtin| builtin.summary().len() > 20));
    }

    #[test]
    fn files_beside_an_embedded_recipe_are_embedded() {
        let check = |path: &str, file: &str, name: Option<&str>| {
            assert_eq!(name_of(path, file).as_deref(), name, "{path} in {file}");
        };
        check("builtin:quickstart", "my.toml", Some("quickstart"));
        check("quickstart.toml", "my.toml", None);
        check("window-room.toml", "builtin:real-objects", Some("window-room"));
        check("../quickstart.toml", "builtin:syntable-sim/val", Some("quickstart"));
        check("train.toml", "builtin:syntable-sim/val", Some("syntable-sim/train"));
        check("${BASE}/train.toml", "builtin:syntable-sim/val", None);
    }
}
