//! What a validation finds: mistakes with their place and their way out, and the names that strings refer to.

use crate::value::{Step, TomlType};
use crate::words::listing;
use std::ops::Range;

/// A string or a key that names something, as its schema says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reference {
    /// What it names: `path`, `product`, `pool:object`, `pool:material`, `pool:environment`.
    pub what: String,
    /// The string or the key.
    pub text: String,
    /// Bytes of the value or of the key.
    pub span: Range<usize>,
    /// Path from the stage's table.
    pub path: Vec<Step>,
}

/// A value that its schema refuses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// Path from the stage's table to the value or key at fault.
    pub path: Vec<Step>,
    /// Bytes at fault: of the value, of an unknown key, or of the table that lacks a key.
    pub span: Range<usize>,
    /// What is wrong: lower case, no full stop.
    pub message: String,
    /// The kind of mistake, with what a message about it may add.
    pub problem: Problem,
}

impl Finding {
    /// The way out, for messages that are one line: what is allowed, or the names to choose from.
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
        /// The one type that is wanted, unless more is asked of it or several types fit.
        wanted: Option<TomlType>,
        /// TomlType of the value.
        found: TomlType,
        /// Text of the value, without quotes; empty for arrays, tables and dates.
        text: String,
    },
    /// A number, a length or a count is outside its limits.
    OutOfRange {
        /// What is allowed: `at most 5`; may be empty.
        allowed: String,
    },
    /// The string is none of the choices.
    UnknownChoice {
        /// The string.
        text: String,
        /// All choices.
        choices: Vec<String>,
        /// Keys of tables that would do as well.
        forms: Vec<String>,
    },
    /// An array holds the same string twice.
    Repeated {
        /// Bytes of the first.
        first: Range<usize>,
    },
    /// The table has no such option.
    UnknownKey {
        /// The key.
        key: String,
        /// All keys that the table knows.
        known: Vec<String>,
        /// Whether the keys are alternatives of which one is given.
        form: bool,
    },
    /// A required option is missing; the path ends in its key.
    MissingKey {
        /// Its key.
        key: String,
        /// What it means: the first sentence of its description.
        meaning: Option<String>,
        /// Its choices, if it has few.
        choices: Vec<String>,
    },
    /// The table gives none or several of its alternatives.
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
