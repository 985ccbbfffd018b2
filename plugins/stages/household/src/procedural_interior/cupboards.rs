//! The kinds of closed cabinets.

use super::cabinets::{dresser, sideboard, wardrobe};
use super::kitchens::{kitchen, refrigerator};
use super::piece::Piece;

/// A sideboard, dresser, wardrobe, kitchen unit or refrigerator.
pub fn cupboard(piece: &mut Piece) {
    match piece.form.below(8) {
        0 | 1 => sideboard(piece),
        2 | 3 => dresser(piece),
        4 => wardrobe(piece),
        5 | 6 => kitchen(piece),
        _ => refrigerator(piece),
    }
}
