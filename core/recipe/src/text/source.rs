//! Texts of a recipe: files, and the pseudo-file of overrides.
//!
//! All texts of one recipe share one space of byte offsets, file after file, so that a span identifies its file however
//! values are merged. Offset 0 belongs to no file: [`NOWHERE`] is the span of values that no file holds.

use elsa::FrozenVec;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A range of bytes in the shared space.
pub(crate) type Span = Range<usize>;

/// The span of values that no file holds.
pub(crate) const NOWHERE: Span = 0..0;

/// Name of the pseudo-file of overrides.
pub(crate) const SET: &str = "<--set>";

/// Offset of the recipe itself, the first text.
const FIRST: usize = 1;

/// A text with a name.
#[derive(Debug, PartialEq, Eq)]
pub struct SourceFile {
    name: String,
    folder: PathBuf,
    text: String,
    start: usize,
}

impl SourceFile {
    /// The path as the user gave it, or `<--set>`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Base of its relative paths.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Offset of its first byte in the shared space.
    pub(crate) fn start(&self) -> usize {
        self.start
    }

    /// Whether it is the recipe itself, rather than one that it extends, or an override.
    pub(crate) fn is_root(&self) -> bool {
        self.start == FIRST
    }

    /// Its bytes in the shared space.
    pub(crate) fn span(&self) -> Span {
        self.start..self.start + self.text.len()
    }

    /// The part of a span of the shared space that is in this text, in bytes of the text, at character boundaries.
    pub(crate) fn local(&self, span: &Span) -> Range<usize> {
        let local = |offset: usize| floor(&self.text, offset.saturating_sub(self.start));
        local(span.start)..local(span.end.max(span.start))
    }

    /// Line and column of a byte of the text, both from 1; columns count characters.
    pub fn line_column(&self, offset: usize) -> (usize, usize) {
        let before = &self.text[..floor(&self.text, offset)];
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }
}

/// The texts of one recipe. Texts are only added, so that parsed tables can borrow from them.
#[derive(Default)]
pub(crate) struct Sources {
    #[expect(
        clippy::redundant_allocation,
        reason = "readers want the `Arc`, and a `FrozenVec` lends what its boxes hold"
    )]
    files: FrozenVec<Box<Arc<SourceFile>>>,
}

impl Sources {
    /// Adds a text.
    pub fn add(&self, name: String, folder: PathBuf, text: String) -> &SourceFile {
        let start = self.files.last().map_or(FIRST, |last| last.span().end + 1);
        self.files.push_get(Box::new(Arc::new(SourceFile { name, folder, text, start })))
    }

    /// Returns the file that a span belongs to.
    pub fn file_of(&self, span: &Span) -> Option<&Arc<SourceFile>> {
        self.files.iter().find(|file| file.span().start <= span.start && span.start <= file.span().end)
    }

    /// Whether two spans belong to the same file.
    pub fn is_same_file(&self, one: &Span, other: &Span) -> bool {
        let start = |span: &Span| self.file_of(span).map(|file| file.start());
        start(one) == start(other)
    }

    /// Returns the text of a span.
    #[cfg(test)]
    pub fn text_of(&self, span: &Span) -> &str {
        self.file_of(span)
            .and_then(|file| file.text.get(span.start - file.start..span.end.checked_sub(file.start)?))
            .unwrap_or("")
    }

    /// The recipe itself.
    pub fn root(&self) -> Option<&Arc<SourceFile>> {
        self.files.first()
    }
}

/// Rounds an offset down to a character boundary.
fn floor(text: &str, offset: usize) -> usize {
    let offset = offset.min(text.len());
    (0..=offset).rev().find(|&at| text.is_char_boundary(at)).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_identifies_its_file() {
        let sources = Sources::default();
        let a = sources.add("a".into(), PathBuf::new(), "x = 1\n".into());
        let b = sources.add("b".into(), PathBuf::new(), "é = 2\n".into());
        assert_eq!(sources.file_of(&(a.start() + 6..a.start() + 6)).map(|f| f.name()), Some("a"));
        assert_eq!(sources.file_of(&b.span()).map(|f| f.name()), Some("b"));
        assert_eq!(sources.text_of(&(b.start()..b.start() + 2)), "é");
        assert_eq!(sources.file_of(&NOWHERE), None);
    }

    #[test]
    fn columns_count_characters() {
        let sources = Sources::default();
        let file = sources.add("a".into(), PathBuf::new(), "# ü\nö = 1\n".into());
        let byte = file.text().find('=').expect("an equals sign");
        assert_eq!(file.line_column(byte), (2, 3));
        assert_eq!(file.line_column(usize::MAX), (3, 1));
    }
}
