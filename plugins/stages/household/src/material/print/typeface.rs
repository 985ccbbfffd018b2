//! Typefaces: how the strokes of letters become ink.

use super::glyph::Glyph;
use crate::material::{MaterialCanvas, SrgbColor};
use syntable_model::random::Stream;

/// The look of letters. Lengths are in heights of a capital.
#[derive(Debug, Clone, PartialEq)]
pub struct Typeface {
    /// Width of vertical strokes.
    pub weight: f32,
    /// Width of horizontal strokes over the width of vertical ones.
    pub contrast: f32,
    /// Factor on the width of letters.
    pub stretch: f32,
    /// Shift to the right of the top over the baseline.
    pub slant: f32,
    /// Length of the bars across the ends of vertical strokes; 0 without serifs.
    pub serif: f32,
    /// Whether the ends of strokes are round.
    pub is_round: bool,
    /// Gap between letters, beside the strokes' own width.
    pub gap: f32,
}

/// The part that a line of text has in a design.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TextRole {
    /// The name of a brand: heavy or unusual.
    Headline,
    /// The name of a product and claims.
    Subtitle,
    /// Small print.
    Prose,
}

/// One piece of a letter's stroke, in heights of a capital.
#[derive(Debug, Clone, Copy)]
pub struct Segment {
    /// Ends; x from the start of the line, y from the capitals' top.
    pub ends: [[f32; 2]; 2],
    /// Width of the ink.
    pub width: f32,
    /// The ends that are cut square.
    pub cut: [bool; 2],
}

impl Typeface {
    /// A random face for a role.
    pub fn draw(stream: &mut Stream, role: TextRole) -> Self {
        let heavy = role == TextRole::Headline && stream.chance(0.8);
        let weight = match role {
            TextRole::Headline if heavy => stream.uniform(0.17, 0.25),
            TextRole::Headline => stream.uniform(0.07, 0.15),
            TextRole::Subtitle => stream.uniform(0.09, 0.17),
            TextRole::Prose => stream.uniform(0.1, 0.13),
        } as f32;
        let is_round = stream.chance(0.25);
        let serif = if !is_round && stream.chance(0.35) { stream.uniform(0.07, 0.13) as f32 } else { 0.0 };
        let contrast = if serif > 0.0 { stream.uniform(0.35, 0.9) } else { stream.uniform(0.7, 1.0) } as f32;
        let stretch = match stream.below(4) {
            0 => stream.uniform(0.62, 0.8),
            1 => stream.uniform(1.1, 1.3),
            _ => stream.uniform(0.9, 1.05),
        } as f32;
        let slanted =
            role == TextRole::Headline && stream.chance(0.4) || role == TextRole::Subtitle && stream.chance(0.2);
        let slant = if slanted { stream.uniform(0.12, 0.28) as f32 } else { 0.0 };
        let gap =
            if role == TextRole::Subtitle && stream.chance(0.2) { 0.3 } else { stream.uniform(0.09, 0.14) as f32 };
        // Heavy letters are wider, or their counters fill.
        let stretch = stretch * (1.0 + 1.2 * (weight - 0.12).max(0.0));
        Self { weight, contrast: contrast.min(1.0), stretch, slant, serif, is_round, gap }
    }

    /// The pieces of a line of letters and the line's width. Joined scripts have no gaps.
    pub fn compose(&self, line: &[Glyph], is_joined: bool) -> (Vec<Segment>, f32) {
        let mut segments = Vec::new();
        let mut x = 0.0;
        // Strokes stay between the capitals' top and the baseline.
        let inner = |y: f32| 0.5 * self.weight + y * (1.0 - self.weight);
        for glyph in line {
            let left = x + if is_joined { 0.0 } else { 0.5 * self.weight };
            for stroke in &glyph.strokes {
                let points: Vec<[f32; 2]> = stroke
                    .iter()
                    .map(|&[px, py]| [left + self.stretch * px + self.slant * (1.0 - py), inner(py)])
                    .collect();
                self.ink(&points, &mut segments);
            }
            x = left + self.stretch * glyph.width;
            x += if is_joined { 0.0 } else { 0.5 * self.weight + self.gap };
        }
        (segments, if is_joined { x } else { (x - self.gap).max(0.0) })
    }

    /// Adds the pieces of one stroke.
    fn ink(&self, points: &[[f32; 2]], segments: &mut Vec<Segment>) {
        let last = points.len() - 2;
        for (i, pair) in points.windows(2).enumerate() {
            let [dx, dy] = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
            let length = (dx * dx + dy * dy).sqrt();
            let level = if length > 1e-6 { dx.abs() / length } else { 0.0 };
            let width = self.weight * (1.0 - (1.0 - self.contrast) * level * level);
            // A dot is round, or it would have no extent.
            let is_cut = !self.is_round && length > 1e-6;
            let cut = [is_cut && i == 0, is_cut && i == last];
            segments.push(Segment { ends: [pair[0], pair[1]], width, cut });
            for (end, at) in [(cut[0], pair[0]), (cut[1], pair[1])] {
                if self.serif > 0.0 && end && dy.abs() > 1.4 * dx.abs() {
                    let half = 0.5 * self.weight + self.serif;
                    let ends = [[at[0] - half, at[1]], [at[0] + half, at[1]]];
                    segments.push(Segment { ends, width: 0.6 * self.weight * self.contrast, cut: [true; 2] });
                }
            }
        }
    }
}

/// Draws pieces. `place` maps points in heights of a capital to texels; `grow` texels are added to the width on both
/// sides, for outlines.
pub fn draw_segments(
    canvas: &mut MaterialCanvas,
    segments: &[Segment],
    place: &dyn Fn([f32; 2]) -> [f32; 2],
    height: f32,
    grow: f32,
    color: SrgbColor,
) {
    for segment in segments {
        let cut = segment.cut.map(|is_cut| is_cut && grow <= 0.0);
        canvas.stroke(segment.ends.map(place), segment.width * height + 2.0 * grow, cut, color);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::print::glyph::letters;

    fn face() -> Typeface {
        Typeface { weight: 0.1, contrast: 1.0, stretch: 1.0, slant: 0.0, serif: 0.0, is_round: false, gap: 0.1 }
    }

    #[test]
    fn a_line_is_as_wide_as_its_letters_and_gaps() {
        let word = letters("EH");
        let (segments, width) = face().compose(&word, false);
        let sum = word.iter().map(|glyph| glyph.width + 0.1).sum::<f32>() + 0.1;
        assert!((width - sum).abs() < 1e-6, "{width} {sum}");
        for segment in &segments {
            for [x, y] in segment.ends {
                assert!((0.049..=width - 0.049).contains(&x) && (0.049..=0.951).contains(&y), "{segment:?}");
            }
        }
    }

    #[test]
    fn serifs_add_bars_and_slant_moves_tops() {
        let word = letters("I");
        let serif = Typeface { serif: 0.1, ..face() };
        assert_eq!(serif.compose(&word, false).0.len(), face().compose(&word, false).0.len() + 2);
        let slanted = Typeface { slant: 0.2, ..face() }.compose(&word, false).0;
        let [top, foot] = slanted[0].ends;
        assert!((top[0] - foot[0] - 0.2).abs() < 1e-6, "{top:?} {foot:?}");
    }
}
