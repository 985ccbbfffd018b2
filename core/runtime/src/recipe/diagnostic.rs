//! Diagnostics: what is wrong with a recipe, where, and how to fix it.

use super::code::Code;
use super::source::{SourceFile, Span};
use crate::message::Message;
use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet, normalize_untrusted_str};
use std::fmt;
use std::ops::Range;
use std::sync::Arc;
use syntable_model::error::Error;

/// Severity of a diagnostic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The recipe cannot be run.
    Error,
    /// The recipe can be run, but is probably not as intended.
    Warning,
}

/// A marked range of a text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Label {
    /// The text.
    pub file: Arc<SourceFile>,
    /// Bytes of the text; an empty range at the start marks the whole file.
    pub span: Range<usize>,
    /// Note beside the mark; may be empty.
    pub message: String,
}

impl Label {
    /// Line and column of its first character, from 1.
    pub fn line_column(&self) -> (usize, usize) {
        self.file.line_column(self.span.start)
    }
}

/// One mistake.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    /// Kind of mistake.
    pub code: Code,
    /// Whether it keeps the recipe from running.
    pub severity: Severity,
    /// What is wrong: lower case, no full stop.
    pub message: String,
    /// The range at fault, then related ones.
    pub labels: Vec<Label>,
    /// Notes and fixes, one line each.
    pub help: Vec<String>,
}

impl Diagnostic {
    /// Whether the recipe cannot be run because of it.
    pub fn is_error(&self) -> bool {
        self.severity == Severity::Error
    }

    /// Renders as text with the offending line underlined, ending in a newline, and with ANSI colors if `colored`.
    pub fn render(&self, colored: bool) -> String {
        let level = match self.severity {
            Severity::Error => Level::ERROR,
            Severity::Warning => Level::WARNING,
        };
        let title = level.primary_title(normalize_untrusted_str(&self.message)).id(self.code.text());
        let mut group = Group::with_title(title);
        for (index, label) in self.labels.iter().enumerate() {
            let name = label.file.name();
            if label.span.is_empty() && label.span.start == 0 && label.message.is_empty() {
                group = group.element(Origin::path(name).line(1).char_column(1));
                continue;
            }
            let kind = if index == 0 { AnnotationKind::Primary } else { AnnotationKind::Context };
            let mut mark = kind.span(label.span.clone());
            if !label.message.is_empty() {
                mark = mark.label(normalize_untrusted_str(&label.message));
            }
            group = group.element(Snippet::source(label.file.text()).path(name).annotation(mark));
        }
        for help in &self.help {
            group = group.element(Level::NOTE.no_name().message(normalize_untrusted_str(help)));
        }
        let renderer = if colored { Renderer::styled() } else { Renderer::plain() };
        let mut text = renderer.render(&[group]);
        text.push('\n');
        text
    }
}

/// All mistakes of a recipe that cannot be run; never empty. Displayed as the command line prints it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Report {
    /// All errors and warnings, in reading order.
    pub diagnostics: Vec<Diagnostic>,
    /// An error that is not of the recipe's text, such as a folder of assets that cannot be read.
    pub other: Option<Box<Error>>,
}

impl Report {
    /// The mistakes one by one, then an error that counts them.
    pub fn messages(&self) -> Vec<Message> {
        let summary = Error::new(format!("{}; nothing was rendered", self.count()));
        self.mistakes().chain([Message::Error(summary)]).collect()
    }

    /// The mistakes one by one.
    pub fn mistakes(&self) -> impl Iterator<Item = Message> {
        let other = self.other.iter().map(|error| Message::Error(Error::clone(error)));
        self.diagnostics.iter().cloned().map(Message::Diagnostic).chain(other)
    }

    /// The diagnostics, in reading order.
    pub fn iter(&self) -> std::slice::Iter<'_, Diagnostic> {
        self.diagnostics.iter()
    }

    /// `2 errors, 1 warning`.
    fn count(&self) -> String {
        let of = |severity| self.diagnostics.iter().filter(|diagnostic| diagnostic.severity == severity).count();
        let say = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
        match (of(Severity::Error) + usize::from(self.other.is_some()), of(Severity::Warning)) {
            (errors, 0) => say(errors, "error"),
            (errors, warnings) => format!("{}, {}", say(errors, "error"), say(warnings, "warning")),
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.messages().iter().try_for_each(|message| writeln!(f, "{}", message.render(false)))
    }
}

impl std::error::Error for Report {}

/// A diagnostic under construction, with spans in the shared space.
#[derive(Debug, Clone)]
pub(crate) struct DiagnosticBuilder {
    pub code: Code,
    pub severity: Severity,
    pub message: String,
    pub marks: Vec<(Span, String)>,
    pub help: Vec<String>,
}

impl DiagnosticBuilder {
    pub fn error(code: Code, span: Span, message: impl Into<String>) -> Self {
        let marks = vec![(span, String::new())];
        Self { code, severity: Severity::Error, message: message.into(), marks, help: Vec::new() }
    }

    pub fn warning(code: Code, span: Span, message: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, ..Self::error(code, span, message) }
    }

    /// Sets the note beside the range at fault.
    pub fn label(mut self, message: impl Into<String>) -> Self {
        self.marks[0].1 = message.into();
        self
    }

    /// Adds a related range.
    pub fn also(mut self, span: Span, message: impl Into<String>) -> Self {
        self.marks.push((span, message.into()));
        self
    }

    /// Adds a line of help.
    pub fn help(mut self, message: impl Into<String>) -> Self {
        self.help.push(message.into());
        self
    }

    /// The range at fault.
    pub fn span(&self) -> &Span {
        &self.marks[0].0
    }
}
