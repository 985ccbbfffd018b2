//! Words for prints: English ones, invented names, and invented words in other scripts.

use super::composed;
use super::glyph::{Glyph, letters};
use syntable_model::random::Stream;

/// Words on packages and books, as products and their qualities.
const PRODUCTS: [&str; 56] = [
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

/// Words of small print.
const PROSE: [&str; 48] = [
    "acid",
    "after",
    "and",
    "artificial",
    "barley",
    "best",
    "calcium",
    "contains",
    "cool",
    "day",
    "dry",
    "fat",
    "fiber",
    "flour",
    "for",
    "from",
    "in",
    "iron",
    "keep",
    "less",
    "maize",
    "may",
    "milk",
    "natural",
    "of",
    "oil",
    "open",
    "or",
    "palm",
    "place",
    "powder",
    "product",
    "protein",
    "salt",
    "serving",
    "shake",
    "sodium",
    "soy",
    "starch",
    "store",
    "sugar",
    "syrup",
    "the",
    "use",
    "vitamin",
    "water",
    "wheat",
    "with",
];

/// Short praise on packages.
const CLAIMS: [&str; 20] = [
    "100% NATURAL",
    "20% MORE",
    "BEST TASTE",
    "CRUNCHY",
    "EXTRA",
    "FAT FREE",
    "FRESH",
    "GLUTEN FREE",
    "HIGH FIBER",
    "LIGHT",
    "LOW SALT",
    "NEW!",
    "NEW RECIPE",
    "NO SUGAR",
    "ORGANIC",
    "ORIGINAL",
    "PREMIUM",
    "SALE",
    "SINCE 1894",
    "VEGAN",
];

/// Beginnings, middles and ends of invented names.
const SYLLABLES: [[&str; 12]; 3] = [
    ["Bal", "Cor", "Dri", "Fen", "Gla", "Jo", "Kel", "Mar", "Nu", "Pri", "Sol", "Vi"],
    ["a", "be", "do", "i", "la", "mi", "no", "ra", "si", "ta", "u", "ve"],
    ["co", "dia", "lin", "max", "na", "nex", "ra", "ris", "ta", "tta", "va", "zo"],
];

/// Letters that invented words of an alphabet take turns in: vowels and consonants.
const GREEK: [&str; 2] = ["αεηιουω", "βγδθκλμνπρστφχψ"];
const CYRILLIC: [&str; 2] = ["аеиоуыюя", "бвгджзклмнпрстфхцчшщ"];

/// A script that a package is printed in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Script {
    /// English and invented words in Latin letters.
    Latin,
    /// Greek letters.
    Greek,
    /// Cyrillic letters.
    Cyrillic,
    /// Square letters, as in East Asian writing.
    Square,
    /// Joined letters, as in Arabic writing.
    Joined,
    /// Letters below a line, as in Devanagari writing.
    Hanging,
}

impl Script {
    /// A random script, mostly Latin.
    pub fn draw(stream: &mut Stream) -> Self {
        match stream.below(20) {
            0 | 1 => Self::Greek,
            2 | 3 => Self::Cyrillic,
            4 | 5 => Self::Square,
            6 => Self::Joined,
            7 => Self::Hanging,
            _ => Self::Latin,
        }
    }

    /// Whether letters of the script join, so that no gap is between them.
    pub fn joins(self) -> bool {
        matches!(self, Self::Joined | Self::Hanging)
    }

    /// A name: of a brand or of a product.
    pub fn name(self, stream: &mut Stream, case: LetterCase) -> Vec<Glyph> {
        if self != Self::Latin {
            return self.invented(stream, case, [4, 8]);
        }
        let word = if stream.chance(0.5) {
            let [first, middle, last] = SYLLABLES.map(|part| *stream.pick(&part).unwrap_or(&part[0]));
            if stream.chance(0.5) { format!("{first}{last}") } else { format!("{first}{middle}{last}") }
        } else {
            product(stream).to_owned()
        };
        letters(&case.apply(&word))
    }

    /// A word of small print.
    pub fn prose(self, stream: &mut Stream) -> Vec<Glyph> {
        match self {
            Self::Latin => letters(stream.pick(&PROSE).unwrap_or(&PROSE[0])),
            _ => self.invented(stream, LetterCase::Small, [2, 9]),
        }
    }

    /// Praise of a product.
    pub fn claim(self, stream: &mut Stream) -> Vec<Glyph> {
        match self {
            Self::Latin => letters(stream.pick(&CLAIMS).unwrap_or(&CLAIMS[0])),
            _ => self.invented(stream, LetterCase::Capitals, [3, 6]),
        }
    }

    /// A word without a meaning, with a number of letters in a range.
    fn invented(self, stream: &mut Stream, case: LetterCase, [least, most]: [i64; 2]) -> Vec<Glyph> {
        let count = stream.integer(least, most);
        let spelled = |stream: &mut Stream, [vowels, consonants]: [&str; 2]| {
            let first = stream.below(2) as i64;
            let pick = |stream: &mut Stream, text: &str| {
                text.chars().nth(stream.below(text.chars().count() as u64) as usize).unwrap_or(' ')
            };
            let word: String =
                (0..count).map(|i| pick(stream, if (i + first) % 2 == 0 { vowels } else { consonants })).collect();
            letters(&case.apply(&word))
        };
        match self {
            Self::Latin => letters(&case.apply(product(stream))),
            Self::Greek => spelled(stream, GREEK),
            Self::Cyrillic => spelled(stream, CYRILLIC),
            Self::Square => (0..(count + 1) / 2).map(|_| composed::square(stream)).collect(),
            Self::Joined => (0..count).map(|_| composed::joined(stream)).collect(),
            Self::Hanging => (0..(count + 1) / 2).map(|_| composed::hanging(stream)).collect(),
        }
    }
}

/// Which letters of a word are capitals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LetterCase {
    /// All.
    Capitals,
    /// The first.
    Title,
    /// None.
    Small,
}

impl LetterCase {
    /// A random case, mostly capitals.
    pub fn draw(stream: &mut Stream) -> Self {
        *stream.pick(&[Self::Capitals, Self::Capitals, Self::Title, Self::Title, Self::Small]).unwrap_or(&Self::Title)
    }

    fn apply(self, word: &str) -> String {
        match self {
            Self::Capitals => word.to_uppercase(),
            Self::Small => word.to_lowercase(),
            Self::Title => word.chars().enumerate().fold(String::new(), |mut text, (i, letter)| {
                if i == 0 {
                    text.extend(letter.to_uppercase())
                } else {
                    text.extend(letter.to_lowercase())
                }
                text
            }),
        }
    }
}

/// An English word for a product.
fn product(stream: &mut Stream) -> &'static str {
    stream.pick(&PRODUCTS).copied().unwrap_or(PRODUCTS[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_words_can_be_printed() {
        for text in PRODUCTS.iter().chain(&PROSE).chain(&CLAIMS).chain(SYLLABLES.iter().flatten()) {
            assert_eq!(letters(text).len(), text.chars().count(), "{text}");
        }
        for text in GREEK.iter().chain(&CYRILLIC) {
            for case in [LetterCase::Capitals, LetterCase::Small] {
                let text = case.apply(text);
                assert_eq!(letters(&text).len(), text.chars().count(), "{text}");
            }
        }
        assert!(PRODUCTS.is_sorted() && PROSE.is_sorted(), "each word once, where it is looked for");
    }

    #[test]
    fn scripts_differ_and_repeat() {
        let scripts = [Script::Latin, Script::Greek, Script::Cyrillic, Script::Square, Script::Joined, Script::Hanging];
        let words: Vec<Vec<Glyph>> =
            scripts.iter().map(|script| script.name(&mut Stream::root(5), LetterCase::Title)).collect();
        for (i, word) in words.iter().enumerate() {
            assert!(!word.is_empty() && word.iter().all(|glyph| glyph.width >= 0.0), "{:?}", scripts[i]);
            assert!(!words[..i].contains(word), "{:?}", scripts[i]);
            assert_eq!(*word, scripts[i].name(&mut Stream::root(5), LetterCase::Title));
        }
    }
}
