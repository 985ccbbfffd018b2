//! Light during filtering.

use crate::planes::{Padded, Size};

/// Light of a part, without the color of the surface, and the estimate of its noise.
pub(crate) struct Signal {
    /// Linear Rec. 709, nits.
    pub color: [Padded; 3],
    /// Its luminance.
    pub luminance: Padded,
    /// Variance of the luminance.
    pub variance: Padded,
}

impl Signal {
    pub fn new(size: Size) -> Self {
        let zero = || Padded::new(size, 0.0);
        Self { color: [zero(), zero(), zero()], luminance: zero(), variance: zero() }
    }
}

/// Relative luminance of linear Rec. 709.
#[inline(always)]
pub(crate) fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}
