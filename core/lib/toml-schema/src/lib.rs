//! Validates TOML tables against JSON Schema.
//!
//! A schema derived from a Rust type is the only statement of its limits. [`SchemaBuilder`] converts it to the form
//! that editors read, and [`Validator`] checks a table against it: every mistake is a [`Finding`] with its path, its
//! bytes in the text, a description and a remedy. Tables are validated with spans, straight from a parsed file, or
//! without.
//!
//! The validator knows the keywords in [`KEYWORDS`]. [`unsupported`] lists all other keywords of a schema: their limits
//! would go unchecked, so such a schema is a mistake of its author.
//!
//! ```
//! use schemars::JsonSchema;
//! use syntable_toml_schema::{SchemaBuilder, check};
//!
//! #[derive(JsonSchema)]
//! #[schemars(deny_unknown_fields)]
//! #[allow(dead_code)]
//! struct Blur {
//!     #[schemars(range(min = 0, max = 9))]
//!     radius: u32,
//! }
//!
//! let mut builder = SchemaBuilder::default();
//! let schema = builder.add(|generator| Blur::json_schema(generator));
//! let finding = check("blur", &schema, &builder.definitions(), "radius = 12").expect("TOML").remove(0);
//! assert_eq!(finding.message, "`radius` cannot be 12");
//! assert_eq!(finding.help().as_deref(), Some("at most 9"));
//! assert_eq!(finding.span, 9..11);
//! ```

mod builder;
mod finding;
mod keyword_values;
mod keywords;
mod validate;
mod value;
mod words;

pub use builder::SchemaBuilder;
pub use finding::{Finding, Outcome, Problem, Reference};
pub use keywords::{KEYWORDS, unsupported};
pub use validate::{Validator, check};
pub use value::{
    DisplayPath, Member, SpannedValue, Step, TomlNode, TomlType, TomlView, is_bare, plain_members, spanned_members,
};
pub use words::{first_sentence, listing};

/// Schema keyword for the kind of name that a string refers to, such as `path` or `pool:object`.
pub const REFERENCE: &str = "x-syntable-ref";

/// Schema keyword for the kind of name that the keys of a table refer to.
pub const KEY_REFERENCE: &str = "x-syntable-key-ref";
