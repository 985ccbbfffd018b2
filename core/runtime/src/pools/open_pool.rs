//! An open pool.

use std::collections::BTreeMap;
use syntable_model::stage::AssetSource;
use syntable_recipe::{Numbering, ObjectProperties, PoolOptions, Selection};

/// An open pool.
pub(crate) struct OpenPool<'a> {
    pub source: &'a dyn AssetSource,
    pub options: &'a PoolOptions,
    pub selection: Selection,
    /// Where the numbers of its objects come from; none if it has no objects.
    pub numbering: Option<Numbering>,
    /// Largest number of an object of the source, taken or not.
    pub last_obj_id: u32,
    /// Whether objects have the numbers of their files, and another size than these.
    pub resizes_numbered: bool,
    /// What the pool's table states of its objects, by name.
    pub properties: BTreeMap<String, ObjectProperties>,
}
