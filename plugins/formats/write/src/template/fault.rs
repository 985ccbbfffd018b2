//! A fault of a template.

/// A fault of a template, and its line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TemplateFault {
    /// Line of the template, from 1, if it is known.
    pub line: Option<usize>,
    /// The message, on one line.
    pub message: String,
}
