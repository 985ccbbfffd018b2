//! Changes of a recipe's text that remove mistakes.

use crate::text::source::SourceFile;
use std::ops::Range;
use std::sync::Arc;
use syntable_model::error::{Error, Result};
use toml::de::DeTable;

/// A change of a text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fix {
    /// The text.
    pub file: Arc<SourceFile>,
    /// The bytes of the text that `text` replaces.
    pub span: Range<usize>,
    /// The new text.
    pub text: String,
}

/// A change of the text that a diagnostic marks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Change {
    /// Replaces a word in the marked text. Quotes around it stay, unless the new word is a path of keys.
    Word { old: String, new: String },
    /// Adds a line below the marked header of a table.
    LineBelow(String),
}

impl Change {
    /// The change of a text, given the marked bytes. None if the text does not have the expected form.
    pub fn of(self, marked: Range<usize>, file: Arc<SourceFile>) -> Option<Fix> {
        match self {
            Self::Word { old, new } => {
                let start = marked.start + file.text().get(marked)?.find(&old)?;
                let end = start + old.len();
                let quote = |at: Option<usize>| {
                    at.and_then(|at| file.text().get(at..=at)).filter(|it| ["'", "\""].contains(it))
                };
                // In quotes, a path would be one key.
                let is_quoted_path =
                    new.contains('.') && quote(start.checked_sub(1)).is_some() && quote(Some(end)).is_some();
                let span = if is_quoted_path { start - 1..end + 1 } else { start..end };
                Some(Fix { span, text: new, file })
            }
            Self::LineBelow(line) => {
                let start = file.text()[..marked.start].rfind('\n').map_or(0, |newline| newline + 1);
                let length = file.text()[start..].find('\n').unwrap_or(file.text().len() - start);
                let is_header = file.text()[start..][..length].trim_start().starts_with('[');
                let end = start + length;
                is_header.then(|| Fix { span: end..end, text: format!("\n{line}"), file })
            }
        }
    }
}

/// A text with changes applied, in any order. Everything else of the text stays, byte for byte.
///
/// # Errors
/// If two changes overlap, or if the result is not TOML, for instance because the text has a new name already.
pub fn fixed(text: &str, fixes: &[Fix]) -> Result<String> {
    let mut fixes: Vec<&Fix> = fixes.iter().collect();
    fixes.sort_by_key(|fix| (fix.span.start, fix.span.end));
    fixes.dedup_by(|a, b| a.span == b.span && a.text == b.text);
    let (mut result, mut at) = (String::with_capacity(text.len()), 0);
    let by_hand = "change the names by hand, as the messages of `check` say";
    for fix in fixes {
        let before = text.get(at..fix.span.start);
        let before = before.ok_or_else(|| Error::new("two changes overlap").help(by_hand))?;
        result += before;
        result += &fix.text;
        at = fix.span.end;
    }
    result += text.get(at..).unwrap_or_default();
    let (_, errors) = DeTable::parse_recoverable(&result);
    match errors.first() {
        None => Ok(result),
        Some(error) => {
            let line = error.span().map_or(0, |span| result[..span.start.min(result.len())].matches('\n').count()) + 1;
            let what = format!("with the new names, line {line} would be wrong: {}", error.message());
            Err(Error::new(what).help(by_hand))
        }
    }
}

/// The changed lines of a text in the unified format of `diff`, without lines around them. Empty without changes.
pub fn diff(name: &str, before: &str, after: &str) -> String {
    let (old, new): (Vec<&str>, Vec<&str>) = (before.lines().collect(), after.lines().collect());
    let mut hunks = String::new();
    let (mut i, mut j) = (0, 0);
    while i < old.len() || j < new.len() {
        if i < old.len() && j < new.len() && old[i] == new[j] {
            (i, j) = (i + 1, j + 1);
            continue;
        }
        // Changes keep all lines, or add lines: the texts agree again at the nearest equal lines.
        let rest = |from: usize, to: usize| from < old.len() && to < new.len() && old[from] == new[to];
        let most = old.len() - i + new.len() - j;
        let agree = |sum: usize| (0..=sum).map(|removed| (i + removed, j + sum - removed)).find(|&(a, b)| rest(a, b));
        let (a, b) = (1..=most).find_map(agree).unwrap_or((old.len(), new.len()));
        let range = |from: usize, to: usize| match to - from {
            1 => format!("{}", from + 1),
            0 => format!("{from},0"),
            count => format!("{},{count}", from + 1),
        };
        hunks += &format!("@@ -{} +{} @@\n", range(i, a), range(j, b));
        old[i..a].iter().for_each(|line| hunks += &format!("-{line}\n"));
        new[j..b].iter().for_each(|line| hunks += &format!("+{line}\n"));
        (i, j) = (a, b);
    }
    if hunks.is_empty() { hunks } else { format!("--- {name}\n+++ {name}\n{hunks}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::source::Sources;
    use std::path::PathBuf;

    fn fixes(text: &str, changes: &[(&str, Change)]) -> Vec<Fix> {
        let sources = Sources::default();
        sources.add("a.toml".into(), PathBuf::new(), text.to_owned());
        let file = Arc::clone(sources.root().expect("a file"));
        let fix = |(marked, change): &(&str, Change)| {
            let at = text.find(marked).expect("there");
            change.clone().of(at..at + marked.len(), Arc::clone(&file)).expect("a fix")
        };
        changes.iter().map(fix).collect()
    }

    fn word(old: &str, new: &str) -> Change {
        Change::Word { old: old.into(), new: new.into() }
    }

    #[test]
    fn only_the_words_change() {
        let text = "# old stays\n[a]   # header\n  'old'=1\nlist = [ 'old', \"old\" ] # é\n";
        let list = fixes(text, &[("'old'=1", word("old", "b.c")), ("\"old\"", word("old", "new"))]);
        let fixed = fixed(text, &list).expect("TOML");
        assert_eq!(fixed, "# old stays\n[a]   # header\n  b.c=1\nlist = [ 'old', \"new\" ] # é\n");
        let kind = fixes(text, &[("[a]", Change::LineBelow("kind = \"b\"".into()))]);
        assert_eq!(super::fixed(text, &kind).expect("TOML"), text.replace("# header", "# header\nkind = \"b\""));
    }

    #[test]
    fn a_text_that_would_break_is_refused() {
        let text = "[a]\nold = 1\nnew = 2\n";
        let error = fixed(text, &fixes(text, &[("old", word("old", "new"))])).expect_err("twice");
        assert!(error.message().starts_with("with the new names, line 3 would be wrong: duplicate key"), "{error}");
        assert!(fixed(text, &fixes(text, &[("old", word("old", "b")), ("old", word("ol", "c"))])).is_err());
    }

    /// As `diff -U0` prints them.
    #[test]
    fn the_diff_has_the_changed_lines() {
        assert_eq!(diff("a", "x\ny\n", "x\ny\n"), "");
        assert_eq!(diff("a", "x\ny\nz\n", "x\nq\nz\n"), "--- a\n+++ a\n@@ -2 +2 @@\n-y\n+q\n");
        let (before, after) = ("a\nb\nc\nd\n", "A\nB\nc\nd\ne\n");
        assert_eq!(diff("f", before, after), "--- f\n+++ f\n@@ -1,2 +1,2 @@\n-a\n-b\n+A\n+B\n@@ -4,0 +5 @@\n+e\n");
    }
}
