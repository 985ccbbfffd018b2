//! Color schemes of products, and the stock that they are printed on.

use crate::material::{PrintFinish, SrgbColor, hsv, mix, shade};
use syntable_model::random::Stream;

/// The material below the ink.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stock {
    /// Board with a glossy coat.
    Gloss,
    /// Uncoated board.
    Matt,
    /// Brown board with few inks.
    Kraft,
    /// Metal foil, or metal, with inks that let it shine through.
    Foil,
}

impl Stock {
    /// The range of the roughness of printed regions.
    pub fn roughness(self) -> [f64; 2] {
        match self {
            Self::Gloss => [0.14, 0.38],
            Self::Matt => [0.45, 0.7],
            Self::Kraft => [0.75, 0.92],
            Self::Foil => [0.16, 0.34],
        }
    }
}

/// The colors of one product.
#[derive(Debug, Clone)]
pub struct Scheme {
    /// The ground of the show side, and letters on it.
    pub ground: SrgbColor,
    /// Letters on the ground.
    pub ink: SrgbColor,
    /// A second large area.
    pub second: SrgbColor,
    /// Letters on the second area.
    pub second_ink: SrgbColor,
    /// Small bright areas.
    pub accent: SrgbColor,
    /// Letters on the accent.
    pub accent_ink: SrgbColor,
    /// White, or the bare stock.
    pub paper: SrgbColor,
    /// Finish of lines and emblems that may be foil.
    pub ornament: PrintFinish,
    /// The material below the ink.
    pub stock: Stock,
}

/// Hues of brands, in turns: reds, orange, yellows, greens, blues, purple, pink.
const HUES: [f64; 14] = [0.0, 0.99, 0.01, 0.06, 0.11, 0.14, 0.3, 0.38, 0.45, 0.55, 0.6, 0.64, 0.78, 0.92];

/// Gold and silver.
const METALS: [SrgbColor; 2] = [[0.83, 0.68, 0.36], [0.78, 0.78, 0.8]];

/// Perceived brightness in [0, 1].
pub fn luminance(color: SrgbColor) -> f32 {
    0.3 * color[0] + 0.59 * color[1] + 0.11 * color[2]
}

/// White, or a dark shade of a color, whichever reads better on a ground.
pub fn ink_on(ground: SrgbColor, tint: SrgbColor) -> SrgbColor {
    if luminance(ground) < 0.58 { [0.97, 0.97, 0.95] } else { mix(shade(tint, 0.28), [0.05; 3], 0.3) }
}

impl Scheme {
    /// A random scheme.
    pub fn draw(stream: &mut Stream) -> Self {
        let hue = stream.pick(&HUES).copied().unwrap_or(0.0) + stream.uniform(-0.015, 0.015);
        let turn = stream.pick(&[0.5, 0.45, 0.55, 0.33, 0.12, -0.12, 0.16]).copied().unwrap_or(0.5);
        let brand = hsv(hue, stream.uniform(0.75, 0.98), stream.uniform(0.45, 0.88));
        let other = hsv(hue + turn, stream.uniform(0.7, 0.98), stream.uniform(0.55, 0.95));
        let yellow = hsv(stream.uniform(0.12, 0.155), stream.uniform(0.7, 0.95), 0.95);
        let white = [0.93 + 0.03 * stream.unit() as f32; 3];
        let accent = if stream.chance(0.4) { yellow } else { other };
        let gloss = if stream.chance(0.7) { Stock::Gloss } else { Stock::Matt };
        match stream.below(10) {
            // A brand color all over, white letters.
            0..=3 => Self::of([brand, white, accent], white, gloss),
            // White with a brand color.
            4 => Self::of([white, brand, accent], white, gloss),
            // Two strong colors.
            5 => Self::of([brand, other, yellow], white, gloss),
            // Pastel.
            6 => {
                let pale = hsv(hue, stream.uniform(0.12, 0.35), stream.uniform(0.82, 0.95));
                Self::of([pale, hsv(hue + turn, 0.3, 0.85), shade(brand, 0.8)], white, Stock::Matt)
            }
            // Brown board with one or two inks.
            7 => {
                let board = hsv(stream.uniform(0.075, 0.1), stream.uniform(0.32, 0.48), stream.uniform(0.55, 0.72));
                let ink = mix(shade(brand, 0.5), [0.08; 3], 0.3);
                let mut scheme = Self::of([board, ink, shade(brand, 0.9)], board, Stock::Kraft);
                scheme.ink = ink;
                scheme
            }
            // Dark with gold or silver.
            8 => {
                let dark = hsv(hue, stream.uniform(0.2, 0.8), stream.uniform(0.05, 0.22));
                let metal = *stream.pick(&METALS).unwrap_or(&METALS[0]);
                let mut scheme = Self::of([dark, shade(dark, 1.8), metal], [0.9, 0.87, 0.8], gloss);
                scheme.ink = metal;
                scheme.ornament = PrintFinish::foil(0.28);
                scheme
            }
            // Inks on foil.
            _ => {
                let bright = mix(brand, [0.9; 3], 0.15);
                let mut scheme = Self::of([bright, [0.82, 0.82, 0.83], accent], white, Stock::Foil);
                scheme.ornament = PrintFinish::foil(0.2);
                scheme
            }
        }
    }

    fn of([ground, second, accent]: [SrgbColor; 3], paper: SrgbColor, stock: Stock) -> Self {
        Self {
            ground,
            ink: ink_on(ground, second),
            second,
            second_ink: ink_on(second, ground),
            accent,
            accent_ink: ink_on(accent, ground),
            paper,
            ornament: PrintFinish::matt(0.3),
            stock,
        }
    }

    /// The ink of small print on paper.
    pub fn print_ink(&self) -> SrgbColor {
        if self.stock == Stock::Kraft { self.ink } else { mix(shade(self.ground, 0.25), [0.06; 3], 0.6) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_read_on_their_grounds() {
        for seed in 0..200 {
            let scheme = Scheme::draw(&mut Stream::root(seed));
            for (ground, ink) in [
                (scheme.ground, scheme.ink),
                (scheme.second, scheme.second_ink),
                (scheme.accent, scheme.accent_ink),
                (scheme.paper, scheme.print_ink()),
            ] {
                assert!((luminance(ground) - luminance(ink)).abs() > 0.2, "{seed}: {scheme:?}");
            }
        }
    }
}
