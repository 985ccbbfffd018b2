//! Lines and numbers of text formats, with line numbers for errors.

use std::borrow::Cow;
use syntable_model::error::{Error, Result};

/// A line of text. A continued line has the number of its first part.
pub struct TextLine<'a> {
    /// Number of the line, from 1.
    pub number: usize,
    /// Its text without the line end.
    pub text: Cow<'a, str>,
    /// Whether the line ends the file without a line end.
    pub last: bool,
}

/// Splits bytes into lines. Line ends are LF or CRLF, a byte-order mark is skipped, and a backslash at the end of
/// a line joins the next one. Bytes that are not UTF-8 become replacement characters.
pub fn lines(bytes: &[u8]) -> impl Iterator<Item = TextLine<'_>> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut rest = bytes;
    let mut number = 0;
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let first = number + 1;
        let mut joined: Option<String> = None;
        loop {
            let end = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
            let line = rest[..end].strip_suffix(b"\r").unwrap_or(&rest[..end]);
            let last = end == rest.len();
            rest = rest.get(end + 1..).unwrap_or(&[]);
            number += 1;
            match line.strip_suffix(b"\\") {
                Some(part) if !rest.is_empty() => {
                    let joined = joined.get_or_insert_default();
                    joined.push_str(&String::from_utf8_lossy(part));
                    joined.push(' ');
                }
                _ => {
                    let end = String::from_utf8_lossy(line);
                    let text = match joined {
                        Some(joined) => Cow::Owned(joined + &end),
                        None => end,
                    };
                    return Some(TextLine { number: first, text, last });
                }
            }
        }
    })
}

/// Parses a finite number that fits single precision.
pub fn finite(token: &str, what: &str) -> Result<f32> {
    match token.parse::<f32>() {
        Ok(number) if number.is_finite() => Ok(number),
        Ok(_) => Err(Error::new(format!("non-finite {what}: `{}`", shorten(token)))),
        Err(_) => Err(Error::new(format!("`{}` is not a number", shorten(token)))),
    }
}

/// Shortens a token for a message: 40 characters, control characters replaced.
pub fn shorten(token: &str) -> String {
    let clean: String = token.chars().take(40).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if token.chars().nth(40).is_some() { clean + "…" } else { clean }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_joined_and_numbered() {
        let got: Vec<(usize, String)> = lines(b"\xef\xbb\xbfa\r\n\nb \\\r\n c\\\n d\ne\\")
            .map(|line| (line.number, line.text.into_owned()))
            .collect();
        let want = [(1, "a"), (2, ""), (3, "b   c  d"), (6, "e\\")];
        assert_eq!(got, want.map(|(n, text)| (n, text.to_owned())));
        assert_eq!(lines(b"").count(), 0);
    }

    #[test]
    fn numbers_are_finite() {
        assert_eq!(finite("3.0000e-02", "vertex").ok(), Some(0.03));
        for (token, want) in
            [("1e400", "non-finite vertex"), ("nan", "non-finite"), ("-inf", "non-finite"), ("x", "not a number")]
        {
            let error = finite(token, "vertex").expect_err(token).to_string();
            assert!(error.contains(want) && error.contains(token), "{error}");
        }
        let long = format!("1e{}", "9".repeat(1 << 20));
        assert!(finite(&long, "vertex").expect_err("infinite").to_string().len() < 100);
    }
}
