//! An open pool.

use std::collections::BTreeMap;
use syntable_model::stage::AssetSource;
use syntable_recipe::{Numbering, ObjectProperties, PoolOptions, Selection};

/// An open pool.
pub(crate) struct OpenPool<'a> {
    /// Its table in the recipe.
    pub table: &'a str,
    pub source: &'a dyn AssetSource,
    pub options: &'a PoolOptions,
    pub selection: Selection,
    /// Origin of the numbers of its objects; none if it has no objects.
    pub numbering: Option<Numbering>,
    /// Largest number of an object of the source, selected or not.
    pub last_obj_id: u32,
    /// Whether objects keep the numbers of their files but are scaled to another size.
    pub resizes_numbered: bool,
    /// Properties from the pool's table, by name of the object.
    pub properties: BTreeMap<String, ObjectProperties>,
}
