//! Datasets whose files disappear while programs make them.

use crate::run::dataset::layout;
use syntable_model::error::{Error, Result};
use syntable_model::store::StoreFolder;

/// The error of a dataset without a recipe, which had one when its scenes were made.
pub fn vanished(dataset: &StoreFolder) -> Error {
    let message = "the dataset vanished: it has scenes, and no recipe.toml any longer";
    Error::new(message).in_file(dataset.name()).help(
        "another program deleted or moved its files: restore them, or delete the rest, and the same command begins the dataset again",
    )
}

/// Refuses a dataset whose recipe was there and is gone.
pub fn check_remains(dataset: &StoreFolder) -> Result<()> {
    if dataset.has(&layout::recipe())? { Ok(()) } else { Err(vanished(dataset)) }
}
