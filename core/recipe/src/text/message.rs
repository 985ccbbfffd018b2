//! Messages of the program in addition to its results: one form for diagnostics, errors and warnings, in every verb.

use crate::text::diagnostic::{Diagnostic, Label};
use serde::Serialize;
use syntable_model::error::{Error, Place};

/// Something to print on standard error.
#[derive(Debug, Clone)]
pub enum Message {
    /// A mistake in a recipe.
    Diagnostic(Diagnostic),
    /// An error that is not of a recipe's text.
    Error(Error),
    /// A probable mistake.
    Warning(Error),
}

impl Message {
    /// Text for users: a diagnostic with the lines at fault underlined, with ANSI colors if `colored`, or one line.
    pub fn render(&self, colored: bool) -> String {
        match self {
            Self::Diagnostic(diagnostic) => diagnostic.render(colored),
            Self::Error(_) | Self::Warning(_) => Record::from(self).line(),
        }
    }
}

impl From<&Message> for Record {
    fn from(message: &Message) -> Self {
        match message {
            Message::Diagnostic(diagnostic) => Self::from(diagnostic),
            Message::Error(error) => Self::of(Level::Error, error),
            Message::Warning(error) => Self::of(Level::Warning, error),
        }
    }
}

/// Severity of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// The command, or a part of it, did not work.
    Error,
    /// A probable mistake. Work continues.
    Warning,
}

/// A diagnostic, error or warning as one JSON object.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Record {
    /// Severity.
    pub level: Level,
    /// Code of the diagnostic, such as `D0008`; none for errors that are not of a recipe's text.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub code: Option<String>,
    /// Description of the problem.
    pub message: String,
    /// Where.
    #[serde(flatten)]
    pub location: Option<Location>,
    /// Help messages.
    pub help: Vec<String>,
    /// Related places.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub related: Vec<Location>,
}

/// A place in a file. Lines and columns count from 1; an end is exclusive.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Location {
    /// Path or name of the file.
    pub file: String,
    /// First line.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<usize>,
    /// First column, in characters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column: Option<usize>,
    /// Last line.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub end_line: Option<usize>,
    /// Column after the last.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub end_column: Option<usize>,
    /// Offset in bytes, for files that are not text.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub byte: Option<u64>,
    /// Note on the place; may be empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub label: String,
}

impl From<&Label> for Location {
    fn from(label: &Label) -> Self {
        let (line, column) = label.line_column();
        let (end_line, end_column) = label.file.line_column(label.span.end);
        Self {
            file: label.file.name().to_owned(),
            line: Some(line),
            column: Some(column),
            end_line: Some(end_line),
            end_column: Some(end_column),
            byte: None,
            label: label.message.clone(),
        }
    }
}

impl From<&Diagnostic> for Record {
    fn from(diagnostic: &Diagnostic) -> Self {
        Self {
            level: if diagnostic.is_error() { Level::Error } else { Level::Warning },
            code: Some(diagnostic.code.text().to_owned()),
            message: diagnostic.message.clone(),
            location: diagnostic.labels.first().map(Location::from),
            help: diagnostic.help.clone(),
            related: diagnostic.labels.iter().skip(1).map(Location::from).collect(),
        }
    }
}

impl Record {
    /// One line for users: `error: what is wrong (help)`.
    pub fn line(&self) -> String {
        let level = if self.level == Level::Error { "error" } else { "warning" };
        let help = if self.help.is_empty() { String::new() } else { format!(" ({})", self.help.join("; ")) };
        format!("{level}: {}{help}", self.message)
    }

    /// The record of an error that is not of a recipe's text.
    pub fn of(level: Level, error: &Error) -> Self {
        let (line, byte) = match error.place() {
            Some(Place::Line(line)) => (Some(line), None),
            Some(Place::Byte(byte)) => (None, Some(byte)),
            None => (None, None),
        };
        let location = error.file().map(|file| Location {
            file: file.display().to_string(),
            line,
            column: None,
            end_line: None,
            end_column: None,
            byte,
            label: String::new(),
        });
        let help = error.help_text().map(str::to_owned).into_iter().collect();
        Self { level, code: None, message: error.without_help(), location, help, related: Vec::new() }
    }
}
