//! Results of a validation: mistakes with their place and remedy, and the names that strings refer to.

use crate::value::{Step, TomlType};
use crate::words::listing;
use std::ops::Range;

/// A string or a key that is a name according to its schema.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reference {
    /// Kind of the name: `path`, `product`, `pool:object`, `pool:material`, `pool:environment`.
    pub what: String,
    /// The string or the key.
    pub text: String,
    /// Bytes of the value or of the key.
    pub span: Range<usize>,
    /// Path from the stage's table.
    pub path: Vec<Step>,
}

/// A mistake in a value, found by its schema.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// Path from the stage's table to the faulty value or key.
    pub path: Vec<Step>,
    /// Faulty bytes: of the value, of an unknown key, or of the table that lacks a key.
    pub span: Range<usize>,
    /// Description of the mistake: lower case, no full stop.
    pub message: String,
    /// The kind of mistake, with details for messages.
    pub problem: Problem,
}

impl Finding {
    /// The remedy, for messages on one line: the allowed range, or the names to choose from.
    pub fn help(&self) -> Option<String> {
        let names = |names: &[String]| listing(names.iter().map(String::as_str));
        match &self.problem {
            Problem::OutOfRange { allowed } if !allowed.is_empty() => Some(allowed.clone()),
            Problem::UnknownChoice { choices, forms, .. } if forms.is_empty() => {
                Some(format!("one of {}", names(choices)))
            }
            Problem::UnknownChoice { choices, forms, .. } => {
                Some(format!("one of {}, or a table with one of {}", names(choices), names(forms)))
            }
            Problem::UnknownKey { known, form: false, .. } if !known.is_empty() => {
                Some(format!("its options are {}", names(known)))
            }
            Problem::UnknownKey { known: forms, .. } | Problem::NotOneForm { forms } if !forms.is_empty() => {
                Some(format!("one of {}", names(forms)))
            }
            _ => None,
        }
    }
}

/// Kinds of mistakes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Problem {
    /// The value has another type.
    WrongType {
        /// The wanted type, if it is the only one and the schema has no further conditions.
        wanted: Option<TomlType>,
        /// Type of the value.
        found: TomlType,
        /// Text of the value, without quotes; empty for tables, dates, and arrays of other values than numbers.
        text: String,
        /// The key of a table that takes the value, if the option accepts such a table: `integers` for `[12, 24]`.
        key: Option<String>,
        /// Number of elements of the wanted array, if an array of this length is the only form.
        length: Option<u64>,
    },
    /// A number, a length or a count is outside its limits.
    OutOfRange {
        /// The allowed range: `at most 5`; may be empty.
        allowed: String,
    },
    /// The string is not one of the choices.
    UnknownChoice {
        /// The string.
        text: String,
        /// All choices.
        choices: Vec<String>,
        /// Keys of tables that are also accepted.
        forms: Vec<String>,
    },
    /// An array has the same string twice.
    Repeated {
        /// Bytes of the first occurrence.
        first: Range<usize>,
    },
    /// The table has no such option.
    UnknownKey {
        /// The key.
        key: String,
        /// All keys that the table accepts.
        known: Vec<String>,
        /// Whether the keys are alternatives, and exactly one must be set.
        form: bool,
    },
    /// A required option is missing; the path ends in its key.
    MissingKey {
        /// Its key.
        key: String,
        /// Its meaning: the first sentence of its description.
        meaning: Option<String>,
        /// Its choices, if it has few.
        choices: Vec<String>,
    },
    /// The table sets none or several of its alternatives.
    NotOneForm {
        /// The alternatives; empty if the message names them.
        forms: Vec<String>,
    },
}

/// Result of a validation.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Outcome {
    /// All mistakes, in the order of the text.
    pub findings: Vec<Finding>,
    /// All names of assets, products and paths.
    pub references: Vec<Reference>,
}

impl Outcome {
    pub(crate) fn push(&mut self, path: &[Step], span: Range<usize>, message: String, problem: Problem) {
        self.findings.push(Finding { path: path.to_vec(), span, message, problem });
    }
}
