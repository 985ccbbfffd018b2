//! Words of messages: shortened lists, listings, first sentences.

use std::fmt::Display;
pub use syntable_toml_schema::{first_sentence, listing};

/// Maximum number of items that a message names.
pub const SHOWN: usize = 10;

/// Names the first [`SHOWN`] items: `a, b, c and 7 more`. Empty if the list is empty.
pub fn some_of<T: Display>(things: impl IntoIterator<Item = T>) -> String {
    let (first, more) = first_of(things);
    let first: Vec<String> = first.iter().map(ToString::to_string).collect();
    first.join(", ") + &and_more(more)
}

/// The same with each name in backquotes.
pub fn some_names<T: Display>(names: impl IntoIterator<Item = T>) -> String {
    some_of(names.into_iter().map(|name| format!("`{name}`")))
}

/// The first [`SHOWN`] items, and the number of the others.
pub fn first_of<T>(things: impl IntoIterator<Item = T>) -> (Vec<T>, usize) {
    let mut things = things.into_iter();
    let first = things.by_ref().take(SHOWN).collect();
    (first, things.count())
}

/// The end of a shortened list: ` and 7 more`, or nothing.
pub fn and_more(more: usize) -> String {
    if more == 0 { String::new() } else { format!(" and {more} more") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_are_named_and_the_rest_counted() {
        assert_eq!(some_of::<u8>([]), "");
        assert_eq!(some_names(["a", "b"]), "`a`, `b`");
        assert_eq!(some_of(1..=SHOWN), "1, 2, 3, 4, 5, 6, 7, 8, 9, 10");
        assert_eq!(some_of(1..=SHOWN + 7), "1, 2, 3, 4, 5, 6, 7, 8, 9, 10 and 7 more");
    }
}
