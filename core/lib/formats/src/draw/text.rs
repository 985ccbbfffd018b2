//! Text in images, in a monospaced font.

use crate::draw::DrawColor;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Point, Size};
use embedded_graphics::mono_font::iso_8859_1::FONT_7X13;
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::{Rgb888, RgbColor};
use embedded_graphics::text::{Baseline, Text};
use embedded_graphics::{Drawable, Pixel};
use std::convert::Infallible;
use syntable_model::product::Plane;

const FONT: MonoFont = FONT_7X13;
/// Width of a character, px.
pub const CHARACTER: u32 = FONT.character_size.width;
/// Height of a line, px.
pub const LINE: u32 = FONT.character_size.height + 2;

/// Draws a line of text with its top-left corner at (x, y), clipped at the image's edges.
pub fn draw(onto: &mut Plane<DrawColor>, text: &str, [x, y]: [u32; 2], [r, g, b]: DrawColor) {
    let text: String = text.chars().map(in_font).collect();
    let style = MonoTextStyle::new(&FONT, Rgb888::new(r, g, b));
    let at = Point::new(x.min(1 << 24) as i32, y.min(1 << 24) as i32);
    match Text::with_baseline(&text, at, style, Baseline::Top).draw(&mut Target(onto)) {
        Ok(_) => {}
    }
}

/// Lines of at most `columns` characters. Wrapped words continue below, indented like the first word of their line.
pub fn wrapped(text: &str, columns: usize) -> Vec<String> {
    let columns = columns.max(8);
    let mut lines = Vec::new();
    for line in text.lines() {
        let mut rest: Vec<char> = line.replace('\t', "    ").chars().collect();
        let indent = rest.iter().take_while(|letter| **letter == ' ').count().min(columns / 2);
        while rest.len() > columns {
            let space = (indent + 1..=columns).rev().find(|&at| rest[at] == ' ');
            let tail = rest.split_off(space.unwrap_or(columns));
            lines.push(rest.into_iter().collect::<String>().trim_end().to_owned());
            let tail = tail.into_iter().skip_while(|letter| *letter == ' ');
            rest = std::iter::repeat_n(' ', indent).chain(tail).collect();
        }
        lines.push(rest.into_iter().collect());
    }
    lines
}

/// The replacement for a character that the font lacks.
fn in_font(letter: char) -> char {
    match letter {
        '→' => '>',
        '←' => '<',
        '…' => '.',
        '–' | '—' | '−' => '-',
        '“' | '”' => '"',
        '‘' | '’' => '\'',
        ' '..='~' | '\u{a0}'..='ÿ' => letter,
        _ => '?',
    }
}

struct Target<'a>(&'a mut Plane<DrawColor>);

impl OriginDimensions for Target<'_> {
    fn size(&self) -> Size {
        Size::new(self.0.width(), self.0.height())
    }
}

impl DrawTarget for Target<'_> {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        let (width, height) = (self.0.width() as usize, self.0.height() as usize);
        for Pixel(Point { x, y }, color) in pixels {
            if let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y))
                && x < width
                && y < height
            {
                self.0.data_mut()[y * width + x] = [color.r(), color.g(), color.b()];
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of pixels that a text colors.
    fn ink(text: &str) -> usize {
        let mut plane = Plane::from_fn(200, 20, |_, _| [0; 3]);
        draw(&mut plane, text, [3, 2], [9, 8, 7]);
        plane.data().iter().filter(|pixel| **pixel == [9, 8, 7]).count()
    }

    #[test]
    fn letters_are_drawn_where_they_fit() {
        assert_eq!(ink("   "), 0);
        assert!(ink("|") > 5 && ink("||") == 2 * ink("|") && ink("×") != ink("?"));
        assert_eq!(ink("日"), ink("?"));
        let mut small = Plane::from_fn(10, 5, |_, _| [0; 3]);
        draw(&mut small, "MMMMMMMM", [5, 1], [255; 3]);
        draw(&mut small, "MMMMMMMM", [5000, u32::MAX], [255; 3]);
        assert!(small.data().contains(&[255; 3]) && *small.at(0, 0) == [0; 3]);
    }

    #[test]
    fn long_lines_go_on_below() {
        assert_eq!(wrapped("one two three", 8), ["one two", "three"]);
        assert_eq!(wrapped("  one two three", 8), ["  one", "  two", "  three"]);
        assert_eq!(wrapped("onetwothreefour\n\nx", 8), ["onetwoth", "reefour", "", "x"]);
        assert_eq!(wrapped("", 8), Vec::<String>::new());
        for columns in 0..30 {
            let lines = wrapped("    a word and averyveryverylongword, then more of them", columns);
            assert!(lines.iter().all(|line| line.chars().count() <= columns.max(8)), "{columns} {lines:?}");
            let text: String = lines.concat().replace(' ', "");
            assert_eq!(text, "awordandaveryveryverylongword,thenmoreofthem");
        }
    }
}
