//! The loader of a recipe's tables.

use crate::merge::overrides::Overrides;
use crate::merge::renamed::RenamedNames;
use crate::merge::variables::PathRules;
use crate::schema::kinds::Schemas;
use crate::tables::remote_paths::RemotePaths;
use crate::text::source::Sources;
use syntable_model::registry::Registry;

/// Builds the stages of one recipe.
pub(crate) struct Loader<'l, 'r> {
    pub registry: &'r Registry,
    pub schemas: &'l Schemas,
    pub overrides: &'l Overrides<'l>,
    pub sources: &'l Sources,
    pub renamed: &'l RenamedNames<'l>,
    pub paths: PathRules,
    pub remote: RemotePaths,
}
