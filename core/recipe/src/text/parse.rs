//! Parses TOML into spanned tables and reports all syntax errors at once.

use crate::text::code::Code;
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::source::{SourceFile, Span};
use syntable_model::registry::RecipeValue;
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

/// Maximum number of syntax errors reported per file; later ones are mostly consequences of the first.
const MOST_ERRORS: usize = 6;

/// A parsed file, with spans in the shared space.
pub(crate) struct Parsed<'a> {
    pub table: DeTable<'a>,
    pub errors: Vec<DiagnosticBuilder>,
    /// Whether an error may have swallowed keys, so that no key can be reported as missing.
    pub keys_lost: bool,
    /// Bytes after an unclosed bracket, which the parser misreads.
    pub misread: Option<Span>,
}

/// Class of a syntax error of the `toml` crate, for a better message where one exists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SyntaxError {
    DuplicateKey,
    UnclosedBracket,
    /// A bare word, or nothing, instead of a value.
    NoValue,
    /// A string that does not end on its line, or has content that a string cannot have.
    BrokenString,
    Other,
}

/// Classifies an error. The `toml` crate exposes only words: a test below pins the words of each class.
fn classify(error: &toml::de::Error) -> SyntaxError {
    let begins = |words: &[&str]| words.iter().any(|word| error.message().starts_with(word));
    if begins(&["duplicate key"]) {
        SyntaxError::DuplicateKey
    } else if begins(&["unclosed array", "unclosed inline table"]) {
        SyntaxError::UnclosedBracket
    } else if begins(&["string values must be quoted", "invalid boolean"]) {
        SyntaxError::NoValue
    } else if begins(&["invalid basic string", "invalid literal string"]) {
        SyntaxError::BrokenString
    } else {
        SyntaxError::Other
    }
}

/// Parses a whole file.
pub(crate) fn parse_file(file: &SourceFile) -> Parsed<'_> {
    let (table, errors) = DeTable::parse_recoverable(file.text());
    let errors: Vec<(SyntaxError, toml::de::Error)> =
        errors.into_iter().map(|error| (classify(&error), error)).collect();
    let table = table.into_inner();
    let any = |wanted: fn(SyntaxError) -> bool| errors.iter().any(|(class, _)| wanted(*class));
    let keys_lost = any(|class| class != SyntaxError::DuplicateKey);
    let open = any(|class| class == SyntaxError::UnclosedBracket).then(|| unclosed_bracket(file.text())).flatten();
    let errors = diagnostics(file, &table, &errors, open);
    let misread = open.map(|at| at + file.start()..file.span().end + 1);
    Parsed { table: shift_table(table, file.start()), errors, keys_lost, misread }
}

/// Parses a value that starts at byte `at` of the shared space. A word that is not a TOML value is a string.
pub(crate) fn parse_value(text: &str, at: usize) -> Result<RecipeValue<'_>, DiagnosticBuilder> {
    let (value, errors) = DeValue::parse_recoverable(text);
    let Some(error) = errors.first() else {
        return Ok(shift(value, at));
    };
    let word = text.trim();
    if !word.starts_with(['"', '\'', '[', '{']) {
        let start = at + (text.len() - text.trim_start().len());
        return Ok(Spanned::new(start..start + word.len(), DeValue::String(word.into())));
    }
    let span = error.span().unwrap_or(0..text.len());
    Err(DiagnosticBuilder::error(Code::Syntax, at + span.start..at + span.end, error.message()))
}

fn shift(value: RecipeValue<'_>, by: usize) -> RecipeValue<'_> {
    let span = value.span();
    let value = match value.into_inner() {
        DeValue::Array(array) => DeValue::Array(array.into_iter().map(|item| shift(item, by)).collect::<DeArray>()),
        DeValue::Table(table) => DeValue::Table(shift_table(table, by)),
        scalar => scalar,
    };
    Spanned::new(span.start + by..span.end + by, value)
}

fn shift_table(table: DeTable<'_>, by: usize) -> DeTable<'_> {
    table
        .into_iter()
        .map(|(key, value)| {
            let span = key.span();
            (Spanned::new(span.start + by..span.end + by, key.into_inner()), shift(value, by))
        })
        .collect()
}

fn diagnostics(
    file: &SourceFile,
    table: &DeTable,
    errors: &[(SyntaxError, toml::de::Error)],
    open: Option<usize>,
) -> Vec<DiagnosticBuilder> {
    let text = file.text();
    let global = |span: Span| span.start + file.start()..span.end + file.start();
    // The parser takes everything after an unclosed bracket as its content, so errors after it are consequences.
    let mut diagnostics: Vec<DiagnosticBuilder> = open
        .map(|at| {
            let (what, close) = if text[at..].starts_with('[') { ("array", "]") } else { ("inline table", "}") };
            DiagnosticBuilder::error(Code::Syntax, global(at..at + 1), format!("this {what} is never closed"))
                .label(format!("opened here; add the `{close}`"))
        })
        .into_iter()
        .collect();
    for (class, error) in errors {
        let span = error.span().unwrap_or(0..0);
        if open.is_some_and(|at| span.start >= at) {
            continue;
        }
        let diagnostic = match class {
            SyntaxError::DuplicateKey => duplicate(file, table, span),
            SyntaxError::NoValue => {
                let rest = text[span.start..].split(['\n', '#']).next().unwrap_or("");
                let word = rest.split([',', ']', '}']).next().unwrap_or("").trim_end();
                let boolean = ["true", "false"].into_iter().find(|meant| strsim::damerau_levenshtein(word, meant) <= 2);
                if let Some(meant) = boolean {
                    DiagnosticBuilder::error(
                        Code::Syntax,
                        global(span.start..span.start + word.len()),
                        "a value must be TOML",
                    )
                    .label(format!("write `{meant}`, or \"{word}\" for a string"))
                } else if word.is_empty() {
                    let line = text[..span.start].rfind('\n').map_or(0, |newline| newline + 1);
                    let start = line + (text[line..span.start].len() - text[line..span.start].trim_start().len());
                    DiagnosticBuilder::error(
                        Code::Syntax,
                        global(start..text[..span.start].trim_end().len().max(start)),
                        "this key has no value",
                    )
                    .label("write a value after the `=`")
                } else {
                    DiagnosticBuilder::error(
                        Code::Syntax,
                        global(span.start..span.start + word.len()),
                        "a string needs quotes",
                    )
                    .label(format!("write \"{word}\""))
                }
            }
            SyntaxError::BrokenString => {
                let line = text[..span.start].rfind('\n').map_or(0, |newline| newline + 1);
                let rest_is_blank = text[span.start..].split('\n').next().is_some_and(|rest| rest.trim().is_empty());
                match text[line..span.start].find(['"', '\'']).filter(|_| rest_is_blank) {
                    Some(quote) => {
                        let end = text[..span.start].trim_end().len();
                        DiagnosticBuilder::error(Code::Syntax, global(line + quote..end), "this string is never closed")
                            .label("add the closing quote")
                    }
                    None => DiagnosticBuilder::error(Code::Syntax, global(span), error.message()),
                }
            }
            SyntaxError::UnclosedBracket | SyntaxError::Other => {
                DiagnosticBuilder::error(Code::Syntax, global(span), error.message())
            }
        };
        diagnostics.push(diagnostic);
    }
    diagnostics.sort_by_key(|diagnostic| diagnostic.span().start);
    diagnostics.dedup_by_key(|diagnostic| line_of(text, diagnostic.span().start - file.start()));
    diagnostics.truncate(MOST_ERRORS);
    diagnostics
}

fn line_of(text: &str, at: usize) -> usize {
    text.as_bytes()[..at.min(text.len())].iter().filter(|byte| **byte == b'\n').count()
}

/// The diagnostic for a key or header whose second occurrence is at `span`.
fn duplicate(file: &SourceFile, table: &DeTable, span: Span) -> DiagnosticBuilder {
    let text = file.text();
    let name = &text[span.clone()];
    let line_start = text[..span.start].rfind('\n').map_or(0, |newline| newline + 1);
    let line = text[line_start..].lines().next().unwrap_or("").trim();
    let first = if line.starts_with('[') {
        // Headers: the first table is merged with the second by the parser, so look for the same line.
        let header = line.split('#').next().unwrap_or(line).trim_end();
        text[..line_start]
            .match_indices(header)
            .find(|(at, _)| text[..*at].rsplit('\n').next().is_some_and(|before| before.trim().is_empty()))
            .map(|(at, _)| at..at + header.len())
    } else {
        last_key_before(table, name, span.start)
    };
    let diagnostic = DiagnosticBuilder::error(
        Code::DuplicateKey,
        span.start + file.start()..span.end + file.start(),
        format!("`{name}` is given twice"),
    )
    .label("again here; keep one of them");
    match first {
        Some(first) => diagnostic.also(first.start + file.start()..first.end + file.start(), "first given here"),
        None => diagnostic,
    }
}

/// The last key of this name before an offset, anywhere in a table.
fn last_key_before(table: &DeTable, name: &str, before: usize) -> Option<Span> {
    fn visit(value: &DeValue, name: &str, before: usize, best: &mut Option<Span>) {
        match value {
            DeValue::Table(table) => {
                for (key, value) in table.iter() {
                    let span = key.span();
                    if key.get_ref().as_ref() == name
                        && span.end <= before
                        && best.as_ref().is_none_or(|best| best.start < span.start)
                    {
                        *best = Some(span);
                    }
                    visit(value.get_ref(), name, before, best);
                }
            }
            DeValue::Array(array) => array.iter().for_each(|item| visit(item.get_ref(), name, before, best)),
            _ => {}
        }
    }
    let mut best = None;
    visit(&DeValue::Table(table.clone()), name, before, &mut best);
    best
}

/// The first bracket of a value that is never closed.
fn unclosed_bracket(text: &str) -> Option<usize> {
    let bytes = text.as_bytes();
    let mut open: Vec<usize> = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        match bytes[at] {
            b'#' => at += text[at..].find('\n').unwrap_or(text.len() - at),
            quote @ (b'"' | b'\'') => {
                let triple = bytes[at..].starts_with(&[quote; 3]);
                let mut end = at + if triple { 3 } else { 1 };
                while end < bytes.len() {
                    if bytes[end] == b'\\' && quote == b'"' {
                        end += 1;
                    } else if !triple && (bytes[end] == quote || bytes[end] == b'\n') {
                        break;
                    } else if triple && bytes[end..].starts_with(&[quote; 3]) {
                        end += 2;
                        break;
                    }
                    end += 1;
                }
                at = end;
            }
            b'[' | b'{' => open.push(at),
            b']' | b'}' => {
                open.pop();
            }
            _ => {}
        }
        at += 1;
    }
    open.first().copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::source::Sources;
    use std::path::PathBuf;

    fn check(text: &str, expected: &[(&str, &str)]) {
        let sources = Sources::default();
        sources.add("before".into(), PathBuf::new(), "x".repeat(40));
        let file = sources.add("a".into(), PathBuf::new(), text.into());
        let parsed = parse_file(file);
        let got: Vec<(&str, &str)> = parsed
            .errors
            .iter()
            .map(|diagnostic| (sources.text_of(diagnostic.span()), diagnostic.message.as_str()))
            .collect();
        assert_eq!(got, expected, "{text}");
    }

    #[test]
    fn reports_each_error_once() {
        check(
            "a = foo # bar\nb = \nc = [1, x]\n",
            &[("foo", "a string needs quotes"), ("b =", "this key has no value"), ("x", "a string needs quotes")],
        );
        check("a = tru\nb = True # c\n", &[("tru", "a value must be TOML"), ("True", "a value must be TOML")]);
        check("a = [1, 2\nb = 3\n[c]\nd = [1]\n", &[("[", "this array is never closed")]);
        check("a = \"b\nc = 'd\n", &[("\"b", "this string is never closed"), ("'d", "this string is never closed")]);
        check("a = { x = 1\nb = 3\n", &[("{", "this inline table is never closed")]);
        check("a = 1\n[b]\nc = '#['\na = 2\na = 3\n[b]\n", &[("a", "`a` is given twice"), ("b", "`b` is given twice")]);
    }

    /// Fails when the `toml` crate changes the words that [`classify`] relies on.
    #[test]
    fn the_words_of_the_toml_crate_are_known() {
        let check = |text: &str, expected: &[SyntaxError]| {
            let (_, errors) = DeTable::parse_recoverable(text);
            let got: Vec<SyntaxError> = errors.iter().map(classify).collect();
            assert_eq!(got, expected, "{text}: {errors:?}");
        };
        check("a = 1\na = 2\n", &[SyntaxError::DuplicateKey]);
        check("[a]\n[a]\n", &[SyntaxError::DuplicateKey]);
        check("a = [1, 2\n", &[SyntaxError::UnclosedBracket]);
        check("a = { b = 1\n", &[SyntaxError::UnclosedBracket]);
        check("a = word\n", &[SyntaxError::NoValue]);
        check("a = \n", &[SyntaxError::NoValue]);
        check("a = tru\n", &[SyntaxError::NoValue]);
        check("a = \"b\n", &[SyntaxError::BrokenString]);
        check("a = 'b\n", &[SyntaxError::BrokenString]);
        check("= 1\n", &[SyntaxError::Other]);
    }

    #[test]
    fn spans_are_in_the_shared_space() {
        let sources = Sources::default();
        sources.add("before".into(), PathBuf::new(), "é".into());
        let file = sources.add("a".into(), PathBuf::new(), "[a]\nb = [1, { c = 'x' }]\n".into());
        let parsed = parse_file(file);
        let inner = &parsed.table["a"].get_ref()["b"].get_ref()[1].get_ref()["c"];
        assert_eq!(sources.text_of(&inner.span()), "'x'");
    }

    #[test]
    fn bare_words_are_strings() {
        let value = |text| parse_value(text, 10).map(|value| (value.span(), value.get_ref().type_str()));
        assert_eq!(value(" foo bar").map_err(|_| ()), Ok((11..18, "string")));
        assert_eq!(value("12").map_err(|_| ()), Ok((10..12, "integer")));
        assert!(value("[1, 2").is_err());
    }
}
