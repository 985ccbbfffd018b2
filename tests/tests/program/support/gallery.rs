//! The gallery: recipes below `book/gallery` that demonstrate each kind, and the images of the reference that are
//! rendered from them.

use super::root;
use std::path::{Path, PathBuf};
use syntable_model::registry::{Entry, Shape, Slot};

/// Slots whose kinds have an image in the reference.
pub const SLOTS: [Slot; 6] = [Slot::Assets, Slot::Camera, Slot::Views, Slot::Lights, Slot::Denoise, Slot::Sensor];

/// Folder of the recipes: `base.toml`, and `<slot>/<kind>.toml`.
pub fn recipe_folder() -> PathBuf {
    root().join("book/gallery")
}

/// Folder of the images.
pub fn image_folder() -> PathBuf {
    root().join("book/src/images/reference")
}

/// File name of the image of a kind.
pub fn image_name(slot: Slot, kind: &str) -> String {
    format!("{slot}-{kind}.jpg")
}

/// Recipes of a kind, in the order of their images: `<kind>.toml`, then each `<kind>.<variant>.toml`.
pub fn recipes(slot: Slot, kind: &str) -> Vec<PathBuf> {
    let of_kind = |path: &PathBuf| kind_of(path) == Some(kind.to_owned());
    let mut found: Vec<PathBuf> = below(&recipe_folder().join(slot.to_string())).into_iter().filter(of_kind).collect();
    // `pinhole.lens.toml` sorts before `pinhole.toml`; without the extension, it sorts after.
    found.sort_by_key(|path| path.with_extension(""));
    found
}

/// The kind that a recipe is named after.
pub fn kind_of(recipe: &Path) -> Option<String> {
    Some(recipe.file_name()?.to_str()?.strip_suffix(".toml")?.split('.').next()?.to_owned())
}

/// The files of a folder, sorted; empty if the folder does not exist.
pub fn below(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let mut found: Vec<PathBuf> = entries.map(|entry| entry.expect("readable").path()).collect();
    found.sort();
    found
}

/// The first comment of a recipe, which describes its image, on one line.
pub fn caption(recipe: &str) -> String {
    let lines = recipe.lines().skip_while(|line| line.starts_with("#:schema"));
    let words: Vec<&str> = lines.map_while(|line| line.strip_prefix('#')).map(str::trim).collect();
    words.join(" ")
}

/// The tables of a recipe that belong to a kind.
pub fn excerpt(recipe: &str, entry: &Entry) -> String {
    let mut tables: Vec<Vec<&str>> = Vec::new();
    for line in recipe.lines() {
        if line.starts_with('[') {
            tables.push(Vec::new());
        }
        if let Some(table) = tables.last_mut() {
            table.push(line);
        }
    }
    let (slot, kind) = (entry.slot, entry.kind);
    let named = format!("kind = \"{kind}\"");
    let about = |table: &&Vec<&str>| {
        let header = table[0].trim_matches(['[', ']']);
        match slot.shape() {
            Shape::Keyed => header == format!("{slot}.{kind}") || table.contains(&named.as_str()),
            _ => header == slot.to_string(),
        }
    };
    let tables: Vec<String> = tables.iter().filter(about).map(|table| table.join("\n").trim_end().to_owned()).collect();
    tables.join("\n\n")
}
