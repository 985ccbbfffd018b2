//! Paths of keys: `render.samples_per_pixel`, `lights[0].count`, `assets."my pool".root`.

use std::ops::Range;
use syntable_toml_schema::Step;

/// A step of a path with its bytes.
type Located = (Step, Range<usize>);

/// Parses a path. Each step comes with its bytes; an error has a message and the bytes at fault.
pub(crate) fn parse(text: &str) -> Result<Vec<Located>, (String, Range<usize>)> {
    let mut steps: Vec<Located> = Vec::new();
    let mut at = 0;
    let wrong = |message: &str, range: Range<usize>| Err((message.to_owned(), range));
    loop {
        let rest = &text[at..];
        let expect_key = steps.is_empty() || rest.starts_with('.');
        if rest.is_empty() && !steps.is_empty() {
            return Ok(steps);
        }
        if let Some(inner) = rest.strip_prefix('[').filter(|_| !steps.is_empty()) {
            let Some(length) = inner.find(']') else {
                return wrong("`[` is not closed", at..text.len());
            };
            let range = at..at + length + 2;
            match inner[..length].trim().parse() {
                Ok(index) => steps.push((Step::Index(index), range.clone())),
                Err(_) => return wrong("an index in `[ ]` is an integer from 0", range),
            }
            at = range.end;
            continue;
        }
        if !expect_key {
            return wrong("a `.` or `[` is expected here", at..text.len());
        }
        at += usize::from(!steps.is_empty());
        let rest = &text[at..];
        if let Some(quote) = rest.chars().next().filter(|c| *c == '"' || *c == '\'') {
            let Some(length) = rest[1..].find(quote) else {
                return wrong("the quote is not closed", at..text.len());
            };
            steps.push((Step::Key(rest[1..=length].to_owned()), at..at + length + 2));
            at += length + 2;
        } else {
            let length =
                rest.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '-')).unwrap_or(rest.len());
            if length == 0 {
                return wrong("a key is expected here", at..text.len());
            }
            steps.push((Step::Key(rest[..length].to_owned()), at..at + length));
            at += length;
        }
    }
}

/// Parses a path that a program wrote, such as the key of an `ConfigError`; a malformed path gives no steps.
pub(crate) fn steps(text: &str) -> Vec<Step> {
    parse(text).map_or_else(|_| Vec::new(), |steps| steps.into_iter().map(|(step, _)| step).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_toml_schema::DisplayPath;

    #[test]
    fn reads_paths_and_writes_them_back() {
        for text in ["a", "a.b-c.d_2", "lights[0].count", "a[1][2].b", "assets.\"my pool\".root"] {
            assert_eq!(DisplayPath(&steps(text)).to_string(), text);
        }
        assert_eq!(parse("a[12].b").map(|steps| steps[1].clone()), Ok((Step::Index(12), 1..5)));
        assert_eq!(steps("a.'x.y'"), [Step::Key("a".into()), Step::Key("x.y".into())]);
    }

    #[test]
    fn refuses_what_is_no_path() {
        for (text, range) in [
            ("", 0..0),
            (".a", 0..2),
            ("a.", 2..2),
            ("a[", 1..2),
            ("a[x]", 1..4),
            ("a[-1]", 1..5),
            ("a b", 1..3),
            ("a.\"b", 2..4),
            ("[0]", 0..3),
            ("é", 0..2),
        ] {
            assert_eq!(parse(text).map_err(|(_, range)| range), Err(range), "{text}");
        }
    }
}
