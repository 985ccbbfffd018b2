//! The lines of a file.

use syntable_model::prelude::*;

/// Keys of [`JsonlRecord`] and [`JsonlView`], which products must not use as names.
pub const KEYS: [&str; 3] = ["scene", "view", VIEWS];
/// Key of the views of a scene.
pub const VIEWS: &str = "views";

/// A line: a view, a scene with or without its views, or, without any of these, the dataset. `P` is a map of products
/// by name.
#[derive(Serialize, Deserialize)]
pub struct JsonlRecord<P> {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scene: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub view: Option<u32>,
    #[serde(flatten)]
    pub products: P,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub views: Option<Vec<JsonlView<P>>>,
}

/// A view in the line of its scene.
#[derive(Serialize, Deserialize)]
pub struct JsonlView<P> {
    pub view: u32,
    #[serde(flatten)]
    pub products: P,
}
