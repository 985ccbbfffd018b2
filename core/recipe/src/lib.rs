//! From TOML text to stages and a plan: recipes, their diagnostics, their schema, and their resolved form.
//!
//! ```text
//! text ──► merge ──► tables ──► plan ──► Recipe + resolved text
//!   │        │         │         │
//!   └────────┴─────────┴─────────┴── every mistake of every table becomes a Diagnostic
//! ```
//!
//! - [`text`] parses files into spanned trees and words the messages about them.
//! - [`merge`] joins a recipe with the recipes that it extends, with overrides and variables, into one tree.
//! - [`tables`] validates each table of the tree against its schema and builds its stage.
//! - [`plan`] resolves which stage computes each requested product.
//! - [`schema`] generates the JSON Schema for editors, which the loader validates against, too.
//!
//! Each component of a mixture passes through the last two like a recipe of its own, and `agreement` compares their plans.
//!
//! [`load()`] passes through these in this order and returns a [`Recipe`] with warnings, or a [`Report`] of all mistakes.
//!
//! **Invariants.** Files are opened through [`Overrides`] only, and no asset is touched. Each file is parsed once and
//! each table validated once. A value keeps its file and bytes however recipes are merged. One bad table never hides the
//! mistakes of another. Loading the text in [`Recipe::resolved`] gives the same text.

mod agreement;
mod assemble;
mod component;
mod load;
mod merge;
mod one_of;
mod own_code;
mod parts;
pub mod plan;
mod recipe;
mod request;
mod resolved;
mod schema;
mod shared_pools;
mod tables;
mod text;
mod writer_paths;

pub use component::{Component, components_of, pool_name, pool_table, split_key, split_pool_name};
pub use load::{Checked, checked, load};
pub use merge::overrides::Overrides;
pub use one_of::{Chosen, OneOf};
pub use own_code::OwnCode;
pub use parts::Parts;
pub use recipe::Recipe;
pub use request::RecipeRequest;
pub use resolved::{lock_of, with_devices, with_lock, without_assets, without_lock};
pub use schema::describe::{OptionInfo, description_of, options_of};
pub use schema::editor::{editor_schema, schema_text};
pub use schema::kinds::schema;
pub use schema::lints::lints;
pub use tables::conditions::{AllObjects, ObjectCount, OnFailure, ViewConditions};
pub use tables::dataset::{CatalogAsset, CatalogLock, CatalogNames, Dataset, Lock, OnBadAsset};
pub use tables::ids::ObjectIds;
pub use tables::numbering::Numbering;
pub use tables::pool::{Center, Mass, ObjectProperties, Pool, PoolOptions, Scale, Selection};
pub use tables::references::Draw;
pub use tables::rig::Rig;
pub use tables::split::{PartSizes, Split, SplitPart};
pub use text::code::Code;
pub use text::diagnostic::{Diagnostic, Label, Severity};
pub use text::fix::{Fix, diff, fixed};
pub use text::message;
pub use text::origin::{BUILTINS, Builtin, PREFIX as BUILTIN_PREFIX, Source};
pub use text::report::Report;
pub use text::source::SourceFile;
pub use text::suggest::nearest;
