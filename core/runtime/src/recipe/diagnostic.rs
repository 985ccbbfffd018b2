//! Diagnostics: what is wrong with a recipe, where, and how to fix it.

use super::code::Code;
use super::source::{SourceFile, Span};
use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet, normalize_untrusted_str};
use serde_json::{Value, json};
use std::fmt;
use std::ops::Range;
use std::sync::Arc;

/// Severity of a diagnostic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The recipe cannot be run.
    Error,
    /// The recipe can be run, but is probably not as intended.
    Warning,
}

impl Severity {
    /// `error` or `warning`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Warning => "warning",
        }
    }
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

    /// Converts to a JSON record with the keys `level`, `code`, `message`, `file`, `line`, `column`, `end_line`, `end_column`,
    /// `label`, `help`, `related`.
    pub fn to_json(&self) -> Value {
        let mut record = json!({ "level": self.severity.name(), "code": self.code.text(), "message": self.message });
        let place = |label: &Label| {
            let (line, column) = label.line_column();
            let (end_line, end_column) = label.file.line_column(label.span.end);
            json!({ "file": label.file.name(), "line": line, "column": column,
                    "end_line": end_line, "end_column": end_column, "label": label.message })
        };
        if let Some(first) = self.labels.first()
            && let (Value::Object(record), Value::Object(place)) = (&mut record, place(first))
        {
            record.extend(place);
        }
        record["help"] = json!(self.help);
        record["related"] = self.labels.iter().skip(1).map(place).collect();
        record
    }
}

/// All mistakes of a recipe that cannot be run; never empty.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Report {
    /// All errors and warnings, in reading order.
    pub diagnostics: Vec<Diagnostic>,
}

impl Report {
    /// Renders as text with the offending lines underlined and a last line that counts, with ANSI colors if `colored`.
    pub fn render(&self, colored: bool) -> String {
        let mut text: String = self.diagnostics.iter().map(|diagnostic| diagnostic.render(colored) + "\n").collect();
        text += &format!("{}; nothing was rendered\n", self.count());
        text
    }

    /// The diagnostics, in reading order.
    pub fn iter(&self) -> std::slice::Iter<'_, Diagnostic> {
        self.diagnostics.iter()
    }

    /// `2 errors, 1 warning`.
    pub fn count(&self) -> String {
        let of = |severity| self.diagnostics.iter().filter(|diagnostic| diagnostic.severity == severity).count();
        let say = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
        match (of(Severity::Error), of(Severity::Warning)) {
            (errors, 0) => say(errors, "error"),
            (errors, warnings) => format!("{}, {}", say(errors, "error"), say(warnings, "warning")),
        }
    }

    /// One record per diagnostic; see [`Diagnostic::to_json`].
    pub fn records(&self) -> Vec<Value> {
        self.diagnostics.iter().map(Diagnostic::to_json).collect()
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(false))
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
