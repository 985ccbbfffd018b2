//! Diagnostics: the mistakes of a recipe, their places, and how to fix them.

use crate::text::code::Code;
use crate::text::fix::{Change, Fix};
use crate::text::source::{SourceFile, Sources, Span};
use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet, normalize_untrusted_str};
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
    /// Description of the mistake: lower case, no full stop.
    pub message: String,
    /// The range at fault, then related ones.
    pub labels: Vec<Label>,
    /// Notes and fixes, one line each.
    pub help: Vec<String>,
    /// The change of the text that removes the mistake, if the program knows it.
    pub fix: Option<Fix>,
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

/// A diagnostic under construction, with spans in the shared space.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct DiagnosticBuilder {
    pub code: Code,
    pub severity: Severity,
    pub message: String,
    pub marks: Vec<(Span, String)>,
    pub help: Vec<String>,
    /// The change of the marked text that removes the mistake.
    pub change: Option<Box<Change>>,
}

impl DiagnosticBuilder {
    pub fn error(code: Code, span: Span, message: impl Into<String>) -> Self {
        let marks = vec![(span, String::new())];
        Self { code, severity: Severity::Error, message: message.into(), marks, help: Vec::new(), change: None }
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

    /// Names the component of a mixture that it is about. A recipe that is no mixture has a component without a name.
    pub fn name_component(&mut self, id: &str) {
        if !id.is_empty() {
            self.help.push(format!("found in the component `{id}` of the mixture"));
        }
    }

    /// Adds the change of the marked text that removes the mistake.
    pub fn change(mut self, change: Change) -> Self {
        self.change = Some(Box::new(change));
        self
    }

    /// The diagnostic: spans become labels. [`NOWHERE`](super::source::NOWHERE) has none, so that the diagnostic is about the recipe.
    pub fn build(self, sources: &Sources) -> Diagnostic {
        let label = |(span, message): (Span, String)| {
            let file = Arc::clone(sources.file_of(&span)?);
            Some(Label { span: file.local(&span), file, message })
        };
        let fix = self.change.zip(self.marks.first()).and_then(|(change, (span, _))| {
            let file = Arc::clone(sources.file_of(span)?);
            change.of(file.local(span), file)
        });
        let mut labels: Vec<Label> = self.marks.into_iter().filter_map(label).collect();
        if labels.is_empty()
            && let Some(root) = sources.root()
        {
            labels.push(Label { file: Arc::clone(root), span: 0..0, message: String::new() });
        }
        Diagnostic { code: self.code, severity: self.severity, message: self.message, labels, help: self.help, fix }
    }

    /// The range at fault.
    pub fn span(&self) -> &Span {
        &self.marks[0].0
    }
}
