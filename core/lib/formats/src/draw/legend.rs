//! The legend below a sheet of images: what its rows, panels and colors mean.

use crate::draw::text::{self, CHARACTER, LINE};
use crate::draw::{DrawColor, color, paste};
use syntable_model::prelude::*;
use syntable_model::product::Plane;

/// Width of a sheet below which it has no legend, px: few words would fit.
const LEAST_WIDTH: u32 = 40 * CHARACTER;
/// Edge of a sample of color, px.
const SAMPLE: u32 = 9;
/// Distance of a text from its sample, px.
const PADDING: u32 = 6;
/// Distance of the legend from the borders, px.
const MARGIN: u32 = 6;
/// Color inside an outlined sample.
const BACKGROUND: DrawColor = [24; 3];
/// Color of the text.
const CAPTION: DrawColor = [190; 3];

/// Sample of color before a text of a legend.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LegendSample {
    /// None.
    None,
    /// A filled square, as of a mask.
    Filled,
    /// The outline of a square.
    Outlined,
}

/// A legend, broken into lines: each text with its left edge and its sample.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Legend(Vec<Vec<(u32, LegendSample, &'static str)>>);

impl Legend {
    /// Breaks texts into lines of a width. The legend of a narrow sheet is empty.
    pub fn new(items: &[(LegendSample, &'static str)], width: u32) -> Self {
        let mut lines: Vec<Vec<(u32, LegendSample, &'static str)>> = Vec::new();
        if width < LEAST_WIDTH {
            return Self(lines);
        }
        let mut x = width;
        for &(sample, text) in items {
            let needed = before(sample) + text.len() as u32 * CHARACTER;
            if x + needed + MARGIN > width {
                lines.push(Vec::new());
                x = MARGIN;
            }
            lines.last_mut().into_iter().for_each(|line| line.push((x, sample, text)));
            x += needed + 2 * CHARACTER;
        }
        Self(lines)
    }

    /// Height with the margin below, px; 0 if it is empty.
    pub fn height(&self) -> u32 {
        if self.0.is_empty() { 0 } else { self.0.len() as u32 * LINE + MARGIN }
    }

    /// Draws it from a row of the sheet on.
    pub fn draw(&self, sheet: &mut Plane<DrawColor>, y: u32) {
        for (line, y) in self.0.iter().zip((y..).step_by(LINE as usize)) {
            for &(x, sample, words) in line {
                if sample != LegendSample::None {
                    paste(sheet, &drawn(sample), x, y + (LINE - SAMPLE) / 2);
                }
                text::draw(sheet, words, [x + before(sample), y], CAPTION);
            }
        }
    }
}

/// Width of a sample with its distance from the text, px.
fn before(sample: LegendSample) -> u32 {
    if sample == LegendSample::None { 0 } else { SAMPLE + PADDING }
}

fn drawn(sample: LegendSample) -> Plane<DrawColor> {
    let is_edge = |at: u32| at == 0 || at == SAMPLE - 1;
    Plane::from_fn(SAMPLE, SAMPLE, |i, j| {
        if sample == LegendSample::Filled || is_edge(i) || is_edge(j) { color(InstanceId(1)) } else { BACKGROUND }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const ITEMS: [(LegendSample, &str); 3] = [
        (LegendSample::None, "A row is a view."),
        (LegendSample::Filled, "visible masks by object"),
        (LegendSample::Outlined, "amodal outlines"),
    ];

    #[test]
    fn no_text_is_cut_at_the_right_edge() {
        assert_eq!(Legend::new(&ITEMS, LEAST_WIDTH - 1).height(), 0);
        for width in LEAST_WIDTH..700 {
            let legend = Legend::new(&ITEMS, width);
            assert_eq!(legend.0.iter().map(Vec::len).sum::<usize>(), ITEMS.len());
            for line in &legend.0 {
                let (x, sample, words) = line.last().copied().expect("a text");
                assert!(x + before(sample) + words.len() as u32 * CHARACTER + MARGIN <= width, "{width}: {words}");
            }
        }
    }

    #[test]
    fn samples_have_the_color_of_an_instance() {
        let mut sheet = Plane::from_fn(700, 40, |_, _| BACKGROUND);
        let legend = Legend::new(&ITEMS, 700);
        assert_eq!(legend.height(), LINE + MARGIN);
        legend.draw(&mut sheet, 0);
        let of_instance = sheet.data().iter().filter(|pixel| **pixel == color(InstanceId(1))).count() as u32;
        assert_eq!(of_instance, SAMPLE * SAMPLE + 4 * (SAMPLE - 1));
        assert!(sheet.data().contains(&CAPTION));
    }
}
