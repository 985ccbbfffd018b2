//! The legend below a sheet of images: what its rows, panels and colors mean.

use crate::draw::text::{self, CHARACTER, LINE};
use crate::draw::{BACKGROUND, CAPTION, DrawColor, color, paste};
use syntable_model::prelude::*;
use syntable_model::product::Plane;

/// Edge of a sample of color, px.
const SAMPLE: u32 = 9;
/// Distance of a text from its sample, px.
const PADDING: u32 = 6;
/// Distance of the legend from the borders, px.
const MARGIN: u32 = 6;

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
    /// Breaks texts into lines of a width. If a text is longer than a line, the legend is empty.
    pub fn new(items: &[(LegendSample, &'static str)], width: u32) -> Self {
        let mut lines: Vec<Vec<(u32, LegendSample, &'static str)>> = Vec::new();
        if items.iter().any(|&item| 2 * MARGIN + length(item) > width) {
            return Self(lines);
        }
        let mut x = width;
        for &(sample, text) in items {
            let needed = length((sample, text));
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

/// Length of a text with its sample, px.
fn length((sample, text): (LegendSample, &str)) -> u32 {
    before(sample) + text.len() as u32 * CHARACTER
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
        let least = 2 * MARGIN + ITEMS.map(length).into_iter().max().expect("texts");
        assert_eq!(Legend::new(&ITEMS, least - 1).height(), 0);
        for width in least..700 {
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
