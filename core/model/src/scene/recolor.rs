//! A change of the colors of a body.

use crate::photometry::luminance;
use serde::Serialize;

/// A change of the base colors of a body.
///
/// It acts on a linear Rec. 709 color `c` with luminance `Y(c)`. The hue turns `c` about the gray axis by an angle, so that 120°
/// swaps the channels in a circle, and then adds the gray that brings the luminance back: `h = R c + (Y(c) − Y(R c))`. The
/// saturation scales the distance from the gray of the same luminance: `s = Y(h) + saturation · (h − Y(h))`. The brightness
/// multiplies: `brightness · s`. Channels outside of [0, 1] are clamped at the end.
///
/// The three parts commute. Without clamping, gray stays gray, and the luminance changes by the factor `brightness` alone.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Recolor {
    /// Angle of the turn about the gray axis, degrees. A turn of 120° makes red green, and green blue.
    pub hue_deg: f64,
    /// Factor of the distance from gray, at least 0.
    pub saturation: f64,
    /// Factor of the whole color, at least 0.
    pub brightness: f64,
}

/// A change of linear Rec. 709 colors, row by row. Results are clamped to [0, 1].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ColorMatrix(pub [[f32; 3]; 3]);

impl Recolor {
    /// The three parts as one matrix.
    pub fn matrix(&self) -> ColorMatrix {
        let (sin, cos) = libm::sincos(self.hue_deg.to_radians());
        // Rodrigues' formula for a turn about (1, 1, 1) / √3.
        let (shared, odd) = ((1.0 - cos) / 3.0, sin / libm::sqrt(3.0));
        let turned = [[cos + shared, shared - odd, shared + odd], [shared + odd, cos + shared, shared - odd]];
        let turned = [turned[0], turned[1], [shared - odd, shared + odd, cos + shared]];
        let column = |column: usize| -> [f64; 3] {
            let basis: [f64; 3] = std::array::from_fn(|row| f64::from(u8::from(row == column)));
            let turned: [f64; 3] = std::array::from_fn(|row| turned[row][column]);
            let gray = luminance(basis);
            let hue = turned.map(|x| x + gray - luminance(turned));
            hue.map(|x| self.brightness * (gray + self.saturation * (x - gray)))
        };
        let columns = [0, 1, 2].map(column);
        ColorMatrix(std::array::from_fn(|row| std::array::from_fn(|column| columns[column][row] as f32)))
    }
}

impl ColorMatrix {
    /// The color that replaces a color.
    pub fn apply(&self, color: [f32; 3]) -> [f32; 3] {
        self.0.map(|row| (row[0] * color[0] + row[1] * color[1] + row[2] * color[2]).clamp(0.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(recolor: [f64; 3], color: [f32; 3], want: [f64; 3]) {
        let [hue_deg, saturation, brightness] = recolor;
        let got = Recolor { hue_deg, saturation, brightness }.matrix().apply(color);
        let is_near = (0..3).all(|channel| (f64::from(got[channel]) - want[channel]).abs() < 1e-6);
        assert!(is_near, "{recolor:?} of {color:?}: {got:?}, not {want:?}");
    }

    #[test]
    fn gray_keeps_its_hue_and_brightness_multiplies() {
        for hue_deg in [-180.0, -37.0, 0.0, 90.0, 240.0] {
            for saturation in [0.0, 0.5, 3.0] {
                check([hue_deg, saturation, 1.0], [0.3; 3], [f64::from(0.3_f32); 3]);
                check([hue_deg, saturation, 2.0], [0.3; 3], [2.0 * f64::from(0.3_f32); 3]);
            }
        }
        check([0.0, 1.0, 0.5], [0.8, 0.2, 0.4], [0.4, 0.1, 0.2]);
        check([0.0, 1.0, 4.0], [0.5, 0.125, 0.0], [1.0, 0.5, 0.0]);
    }

    #[test]
    fn a_third_of_a_turn_swaps_the_channels_up_to_gray() {
        // Y = 0.2126 · 0.5 + 0.7152 · 0.4 + 0.0722 · 0.3 = 0.41404; of the channels in a circle, (0.3, 0.5, 0.4), 0.45026.
        let gray = 0.414_04 - 0.450_26;
        check([120.0, 1.0, 1.0], [0.5, 0.4, 0.3], [0.3 + gray, 0.5 + gray, 0.4 + gray]);
        // Two thirds of a turn: (0.4, 0.3, 0.5), Y = 0.3357.
        let gray = 0.414_04 - 0.335_7;
        check([240.0, 1.0, 1.0], [0.5, 0.4, 0.3], [0.4 + gray, 0.3 + gray, 0.5 + gray]);
        check([-120.0, 1.0, 1.0], [0.5, 0.4, 0.3], [0.4 + gray, 0.3 + gray, 0.5 + gray]);
        check([360.0, 1.0, 1.0], [0.5, 0.4, 0.3], [0.5, 0.4, 0.3]);
        // Without saturation, only the luminance is left.
        check([77.0, 0.0, 1.0], [0.5, 0.4, 0.3], [0.414_04; 3]);
    }

    #[test]
    fn luminance_stays_where_nothing_is_clamped() {
        for hue_deg in (0..24).map(|step| f64::from(step) * 15.0) {
            let got = Recolor { hue_deg, saturation: 1.1, brightness: 0.7 }.matrix().apply([0.55, 0.45, 0.6]);
            let want = 0.7 * luminance([0.55, 0.45, 0.6]);
            assert!((luminance(got.map(f64::from)) - want).abs() < 1e-6, "{hue_deg}°: {got:?}");
        }
    }
}
