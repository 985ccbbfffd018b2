//! Tables of text.

use std::fmt::Write as _;

/// Columns aligned by their widest cell.
pub fn table<const N: usize>(rows: &[[String; N]]) -> String {
    table_within(rows, None)
}

/// The same in lines of at most `width` characters, unless a word is longer. The text of wide columns is wrapped.
pub fn table_within<const N: usize>(rows: &[[String; N]], width: Option<usize>) -> String {
    const GAP: usize = 2;
    let longest = |i: usize, split: fn(&str) -> Vec<&str>| {
        let parts = rows.iter().flat_map(|row| split(&row[i]));
        parts.map(|part| part.chars().count()).max().unwrap_or(0)
    };
    let mut widths: [usize; N] = std::array::from_fn(|i| longest(i, |cell| vec![cell]));
    let words: [usize; N] = std::array::from_fn(|i| longest(i, |cell| cell.split(' ').collect()));
    let room = width.unwrap_or(usize::MAX).saturating_sub(GAP * (N - 1));
    while widths.iter().sum::<usize>() > room {
        let widest = (0..N).filter(|&i| widths[i] > words[i]).max_by_key(|&i| widths[i]);
        match widest {
            Some(i) => widths[i] -= 1,
            None => break,
        }
    }
    let mut out = String::new();
    for row in rows {
        let cells: [Vec<String>; N] = std::array::from_fn(|i| wrapped(&row[i], widths[i]));
        for line in 0..cells.iter().map(Vec::len).max().unwrap_or(0) {
            let parts: Vec<String> = (cells.iter().zip(widths))
                .map(|(cell, width)| format!("{:width$}", cell.get(line).map_or("", String::as_str)))
                .collect();
            let _ = writeln!(out, "{}", parts.join("  ").trim_end());
        }
    }
    out
}

/// Lines of at most `width` characters, or of one longer word.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let used = lines.last().map_or(0, |line| line.chars().count());
        if used > 0 && used + 1 + word.chars().count() > width {
            lines.push(String::new());
        }
        if let Some(line) = lines.last_mut() {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines
}
