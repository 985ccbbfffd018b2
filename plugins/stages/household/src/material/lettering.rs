//! Words and letters for prints.

use syntable_model::random::Stream;

/// Words on packages and books.
const WORDS: [&str; 56] = [
    "ALMONDS",
    "ALPINE",
    "APPLE",
    "BAKERY",
    "BARLEY",
    "BEANS",
    "BISCUIT",
    "BUTTER",
    "CEREAL",
    "CHERRY",
    "CITRUS",
    "CLASSIC",
    "COAST",
    "COCOA",
    "COFFEE",
    "COOKIES",
    "CORN",
    "CRACKERS",
    "CRISP",
    "DELUXE",
    "ESPRESSO",
    "FAMILY",
    "FARMHOUSE",
    "FRESH",
    "GARDEN",
    "GINGER",
    "GOLDEN",
    "GRANOLA",
    "HARVEST",
    "HONEY",
    "JUICE",
    "KITCHEN",
    "LEMON",
    "LENTILS",
    "MAPLE",
    "MEADOW",
    "MINT",
    "MORNING",
    "MUSTARD",
    "NATURAL",
    "NORDIC",
    "OATS",
    "OLIVES",
    "ORCHARD",
    "ORGANIC",
    "PASTA",
    "PEPPER",
    "RICE",
    "ROYAL",
    "SAUCE",
    "SOAP",
    "SOUP",
    "SUGAR",
    "TOMATO",
    "VALLEY",
    "VANILLA",
];

/// The letters that have strokes.
pub const ALPHABET: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZ";

/// Strokes of the letters A to Z, separated by spaces. A stroke joins nodes of a grid of 3 × 5, `a` to `o` row by row.
const STROKES: [&str; 26] = [
    "mdbfo gi",
    "ma abfh gh hlnm",
    "fbdjnl",
    "ma abflnm",
    "camo gh",
    "cam gh",
    "fbdjnlih",
    "am gi co",
    "bn",
    "clnj",
    "am cgo",
    "amo",
    "maeco",
    "maoc",
    "bdjnlfb",
    "mabfhg",
    "bdjnlfb ko",
    "mabfhg ho",
    "fbdhlnj",
    "ac bn",
    "ajnlc",
    "anc", // typos: ignore
    "amkoc",
    "ao cm",
    "ahc hn",
    "acmo",
];

/// A word.
pub fn word(stream: &mut Stream) -> &'static str {
    stream.pick(&WORDS).copied().unwrap_or(WORDS[0])
}

/// Strokes of a letter: points with x in 0 to 1 and y from 0 at its top to 1 at its foot. Only capital letters have
/// strokes.
pub fn strokes(letter: char) -> impl Iterator<Item = Vec<[f32; 2]>> {
    let index = (letter as usize).wrapping_sub('A' as usize);
    let point = |node: u8| {
        let node = node - b'a';
        [f32::from(node % 3) / 2.0, f32::from(node / 3) / 4.0]
    };
    STROKES
        .get(index)
        .into_iter()
        .flat_map(|letter| letter.split(' '))
        .map(move |stroke| stroke.bytes().map(point).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_letter_of_a_word_has_strokes_of_its_own() {
        let mut seen: Vec<Vec<Vec<[f32; 2]>>> = Vec::new();
        for letter in 'A'..='Z' {
            let shape: Vec<_> = strokes(letter).collect();
            assert!(shape.iter().all(|stroke| stroke.len() >= 2), "{letter}");
            assert!(shape.iter().flatten().flatten().all(|x| (0.0..=1.0).contains(x)), "{letter}");
            assert!(!seen.contains(&shape), "{letter}");
            seen.push(shape);
        }
        assert!(WORDS.iter().all(|word| word.chars().all(|letter| strokes(letter).count() > 0)));
        assert!(WORDS.is_sorted(), "each word once, where it is looked for");
        assert_eq!(strokes('a').count() + strokes('7').count(), 0);
    }
}
