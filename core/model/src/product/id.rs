//! Identities of products, and the texts that mean them in recipes and files.

use super::{Framing, FramingError};
use std::fmt;

/// Identity of a product: its name and its framing. Plans and stores look products up by it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ProductId {
    /// Name of the product; see [`KeyId::product`](crate::product::KeyId::product).
    pub product: &'static str,
    /// How it is framed.
    pub framing: Framing,
}

/// As in recipes: `coverage`, `coverage (canvas 3)`, `radiance (objects alone)`.
impl fmt::Display for ProductId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { product, framing } = self;
        if *framing == Framing::IMAGE { f.write_str(product) } else { write!(f, "{product} ({framing})") }
    }
}

/// Splits the text of a recipe into the name of a product and its framing: `coverage (canvas 3)`.
///
/// # Errors
/// If the parentheses do not hold a framing.
pub fn parse_product(text: &str) -> Result<(&str, Framing), FramingError> {
    match text.split_once(" (") {
        None => Ok((text, Framing::IMAGE)),
        Some((product, framing)) => {
            let framing = framing.strip_suffix(')').ok_or(FramingError::Words)?;
            Ok((product, framing.parse()?))
        }
    }
}

/// A reference to a product in a store: a [key](crate::product::KeyId), its [identity](ProductId), or its text, which
/// is parsed.
pub trait ProductRef: fmt::Display {
    /// Name and framing. `None` for a text that means no product.
    fn parts(&self) -> Option<(&str, Framing)>;
}

impl ProductRef for ProductId {
    fn parts(&self) -> Option<(&str, Framing)> {
        Some((self.product, self.framing))
    }
}

impl ProductRef for str {
    fn parts(&self) -> Option<(&str, Framing)> {
        parse_product(self).ok()
    }
}

impl ProductRef for String {
    fn parts(&self) -> Option<(&str, Framing)> {
        parse_product(self).ok()
    }
}

impl<T: ProductRef + ?Sized> ProductRef for &T {
    fn parts(&self) -> Option<(&str, Framing)> {
        (**self).parts()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_means_the_product_that_it_is_written_for() {
        for framing in [Framing::IMAGE, Framing::IMAGE.on_canvas(3).of_next_view()] {
            let id = ProductId { product: "coverage", framing };
            assert_eq!(id.to_string().parts(), id.parts());
        }
        for wrong in ["coverage (canvas 3", "coverage ()", "coverage (objects)", "coverage (canvas 3) "] {
            assert_eq!(wrong.parts(), None, "{wrong}");
        }
    }
}
