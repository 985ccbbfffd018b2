//! Code that a recipe brings.

use syntable_model::registry::Slot;

/// Code by the author of a recipe: a native library that the recipe names by a path next to itself, or a program.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct OwnCode {
    /// The slot of its stage.
    pub slot: Slot,
    /// The option that names its file, such as `write.images.program.file`.
    pub option: String,
    /// The option with its value, for users. A program has its interpreter and its arguments, too.
    pub shown: String,
}
