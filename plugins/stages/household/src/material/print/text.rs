//! Lines and paragraphs of text on a canvas.

use super::glyph::Glyph;
use super::typeface::{Segment, Typeface, draw_segments};
use super::words::Script;
use crate::material::{MaterialCanvas, SrgbColor};
use syntable_model::random::Stream;

/// Where and how a line of text is set.
#[derive(Debug, Clone, Copy)]
pub struct Setting {
    /// Center of the line, texels.
    pub center: [f32; 2],
    /// Height of a capital, texels; less if the line would be wider than `most`.
    pub height: f32,
    /// Maximum width, texels.
    pub most: f32,
    /// Turn about the center, radians, clockwise.
    pub turn: f32,
    /// Sagitta of the arc that the line follows over its width; positive lines rise in the middle.
    pub bend: f32,
    /// Color of the letters.
    pub color: SrgbColor,
    /// Color and width, in heights of a capital, of an outline.
    pub edge: Option<(SrgbColor, f32)>,
    /// Color and offset, in heights of a capital, of a hard shadow to the lower right.
    pub drop: Option<(SrgbColor, f32)>,
}

impl Setting {
    /// A straight, level line.
    pub fn level(center: [f32; 2], height: f32, most: f32, color: SrgbColor) -> Self {
        Self { center, height, most, turn: 0.0, bend: 0.0, color, edge: None, drop: None }
    }

    /// Draws a line, and returns its width and height in texels.
    pub fn draw(&self, canvas: &mut MaterialCanvas, face: &Typeface, line: &[Glyph], is_joined: bool) -> [f32; 2] {
        let (segments, width) = face.compose(line, is_joined);
        let height = self.height.min(self.most / width.max(1e-3));
        self.ink(canvas, &segments, width, height);
        [width * height, height]
    }

    fn ink(&self, canvas: &mut MaterialCanvas, segments: &[Segment], width: f32, height: f32) {
        let (sin, cos) = libm::sincosf(self.turn);
        let place = |[x, y]: [f32; 2], shift: f32| {
            let t = x / width.max(1e-3) - 0.5;
            let lift = self.bend * (1.0 - 4.0 * t * t);
            let (px, py) = ((x - 0.5 * width + shift) * height, (y - 0.5 + shift - lift) * height);
            [self.center[0] + cos * px - sin * py, self.center[1] + sin * px + cos * py]
        };
        if let Some((color, offset)) = self.drop {
            let grow = self.edge.map_or(0.0, |(_, width)| width * height);
            draw_segments(canvas, segments, &|p| place(p, offset), height, grow, color);
        }
        if let Some((color, width)) = self.edge {
            draw_segments(canvas, segments, &|p| place(p, 0.0), height, width * height, color);
        }
        draw_segments(canvas, segments, &|p| place(p, 0.0), height, 0.0, self.color);
    }
}

/// A paragraph: words in lines.
#[derive(Debug, Clone)]
pub struct Paragraph<'a> {
    /// Its face.
    pub face: &'a Typeface,
    /// Its script.
    pub script: Script,
    /// Height of a capital, texels. Lines are 1.65 heights apart.
    pub height: f32,
    /// Its color.
    pub color: SrgbColor,
    /// Whether lines are centered, not flush left.
    pub is_centered: bool,
}

/// Distance between lines, heights of a capital.
pub const LINE_STEP: f32 = 1.65;

impl Paragraph<'_> {
    /// Fills a box with words; the last line is short. A line that is less than 3 texels tall would be a smear of gray:
    /// then letters are 3 texels tall.
    pub fn fill(&self, canvas: &mut MaterialCanvas, stream: &mut Stream, [x0, y0, x1, y1]: [f32; 4]) {
        let height = self.height.max(3.0);
        let step = LINE_STEP * height;
        let lines = (((y1 - y0) / step) as usize).min(60);
        let joined = self.script.joins();
        let space = 0.45 * height;
        for i in 0..lines {
            let most = if i + 1 == lines { 0.6 * (x1 - x0) } else { x1 - x0 };
            let mut words: Vec<(Vec<Segment>, f32)> = Vec::new();
            let mut total = 0.0;
            for _ in 0..40 {
                let (segments, width) = self.face.compose(&self.script.prose(stream), joined);
                let wider = total + width * height + if words.is_empty() { 0.0 } else { space };
                if wider > most {
                    break;
                }
                total = wider;
                words.push((segments, width * height));
            }
            let mut x = if self.is_centered { 0.5 * (x0 + x1 - total) } else { x0 };
            let y = y0 + i as f32 * step;
            for (segments, width) in words {
                draw_segments(
                    canvas,
                    &segments,
                    &|[px, py]| [x + px * height, y + py * height],
                    height,
                    0.0,
                    self.color,
                );
                x += width + space;
            }
        }
    }
}

/// Draws a line with its left edge at a point `[x, y]` of its top, and returns its width in texels.
pub fn flush_left(
    canvas: &mut MaterialCanvas,
    face: &Typeface,
    line: &[Glyph],
    [x, y]: [f32; 2],
    height: f32,
    color: SrgbColor,
) -> f32 {
    let (segments, width) = face.compose(line, false);
    draw_segments(canvas, &segments, &|[px, py]| [x + px * height, y + py * height], height, 0.0, color);
    width * height
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::print::glyph::letters;
    use crate::material::print::typeface::TextRole;
    use std::cell::RefCell;

    /// Texels that differ from the ground: their box, and their number.
    fn inked(canvas: &mut MaterialCanvas) -> ([usize; 4], usize) {
        let found = RefCell::new(([usize::MAX, usize::MAX, 0, 0], 0));
        canvas.map(|x, y, color| {
            if color[0] < 0.8 {
                let (bounds, count) = &mut *found.borrow_mut();
                *bounds = [bounds[0].min(x), bounds[1].min(y), bounds[2].max(x), bounds[3].max(y)];
                *count += 1;
            }
            color
        });
        found.into_inner()
    }

    #[test]
    fn lines_keep_their_width_and_small_print_is_made_of_strokes() {
        let face = Typeface::draw(&mut Stream::root(1), TextRole::Prose);
        let mut canvas = MaterialCanvas::new(300, 100, [1.0; 3]);
        let setting = Setting::level([150.0, 50.0], 60.0, 120.0, [0.0; 3]);
        let [width, height] = setting.draw(&mut canvas, &face, &letters("HONEYMOON"), false);
        let ([x0, y0, x1, y1], _) = inked(&mut canvas);
        assert!(width <= 120.1 && x0 >= 89 && x1 <= 211 && height < 60.0, "{x0} {x1} {width}");
        assert!(((y1 - y0) as f32 - height).abs() < 3.0, "{y0} {y1} {height}");
        let mut canvas = MaterialCanvas::new(200, 100, [1.0; 3]);
        let paragraph =
            Paragraph { face: &face, script: Script::Latin, height: 5.0, color: [0.0; 3], is_centered: false };
        paragraph.fill(&mut canvas, &mut Stream::root(2), [10.0, 10.0, 190.0, 90.0]);
        let ([x0, _, x1, _], count) = inked(&mut canvas);
        assert!(x0 >= 9 && x1 <= 190, "{x0} {x1}");
        // Bars of the letters' height would ink 8700 texels.
        assert!((600..6500).contains(&count), "{count}");
    }
}
