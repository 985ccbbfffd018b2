//! The contact sheet: a row per scene, a column per view, with captions. A cell without an image states the reason.

use super::cell::GAP;
use super::shot::Shot;
use std::sync::Arc;
use syntable_formats::draw::legend::{Legend, LegendSample};
use syntable_formats::draw::text::{self, CHARACTER, LINE};
use syntable_formats::draw::{self, BACKGROUND, CAPTION, DrawColor};
use syntable_formats::encode::png::PngImage;
use syntable_model::error::Result;
use syntable_model::product::Plane;

/// Distance of a text from the border of its cell, px.
const PADDING: u32 = 6;
/// Width of a sheet of mistakes, characters.
const COLUMNS: usize = 120;
/// Maximum number of lines of a text.
const MAX_LINES: usize = 200;

/// Text field of the PNG file that identifies a sheet.
const MARK: (&str, &str) = ("Software", "syntable preview");
/// Bytes at the start of a file within which the mark is.
const MARKED: usize = 256;

const EMPTY: DrawColor = [38; 3];
const OUTDATED: DrawColor = [120; 3];
const MISTAKE: DrawColor = [255, 150, 130];

/// Cell of a view.
#[derive(Debug, Clone, PartialEq)]
pub enum SheetCell {
    /// Nothing yet.
    Waiting,
    /// An image, current or outdated.
    Image {
        /// The image, with its labels next to it.
        image: Arc<Shot>,
        /// Whether all inputs of the image are unchanged.
        is_current: bool,
    },
    /// The reason for a missing image.
    Failed(String),
}

impl SheetCell {
    /// Whether it has an image of the current recipe.
    pub fn is_current(&self) -> bool {
        matches!(self, Self::Image { is_current: true, .. })
    }
}

/// Views of scenes.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    /// Numbers of the scenes: one row each.
    pub scenes: Vec<u32>,
    /// Numbers of the views: one column each.
    pub views: Vec<u32>,
    /// The cells, row by row.
    pub cells: Vec<SheetCell>,
    /// Size of a cell as long as no image is known, px.
    pub expected: [u32; 2],
    /// Whether labels are next to the images.
    pub labels: bool,
}

/// The legend of a sheet: what its rows, columns and colors mean.
fn legend(labels: bool) -> Vec<(LegendSample, &'static str)> {
    let mut items = vec![(LegendSample::None, "A row is a scene, a column is a view.")];
    if labels {
        items.extend([
            (LegendSample::None, "Left: the image."),
            (LegendSample::Filled, "Middle: visible masks by object."),
            (LegendSample::Outlined, "Right: amodal outlines;"),
            (LegendSample::Filled, "filled: occluded parts."),
        ]);
    }
    items
}

impl Sheet {
    /// Draws the sheet.
    pub fn draw(&self) -> Plane<DrawColor> {
        let columns = self.views.len().max(1);
        let size = |cell: &SheetCell| match cell {
            SheetCell::Image { image, .. } => [image.cell.width(), image.cell.height()],
            _ => self.images().next().map_or(self.expected, |image| [image.cell.width(), image.cell.height()]),
        };
        let sizes: Vec<[u32; 2]> = self.cells.iter().map(size).collect();
        let largest = |sizes: &mut dyn Iterator<Item = &[u32; 2]>, axis: usize| sizes.map(|size| size[axis]).max();
        let widths: Vec<u32> =
            (0..columns).map(|x| largest(&mut sizes.iter().skip(x).step_by(columns), 0).unwrap_or(0)).collect();
        let heights: Vec<u32> = sizes.chunks(columns).map(|row| largest(&mut row.iter(), 1).unwrap_or(0)).collect();
        let whole = |sizes: &[u32], more: u32| sizes.iter().map(|size| size + more + GAP).sum::<u32>() + GAP;
        let width = whole(&widths, 0);
        let legend = Legend::new(&legend(self.labels), width);
        let mut sheet = Plane::from_fn(width, whole(&heights, LINE) + legend.height(), |_, _| BACKGROUND);
        let mut y = GAP;
        for (row, height) in heights.iter().enumerate() {
            let mut x = GAP;
            for (column, width) in widths.iter().enumerate() {
                let index = row * columns + column;
                if let (Some(cell), Some(view)) = (self.cells.get(index), self.views.get(column)) {
                    let caption = format!("scene {}, view {view}", self.scenes[row]);
                    put(&mut sheet, cell, &caption, [x, y], [*width, *height]);
                }
                x += width + GAP;
            }
            y += height + LINE + GAP;
        }
        legend.draw(&mut sheet, y);
        sheet
    }

    fn images(&self) -> impl Iterator<Item = &Arc<Shot>> {
        self.cells.iter().filter_map(|cell| match cell {
            SheetCell::Image { image, .. } => Some(image),
            _ => None,
        })
    }
}

/// Draws a cell below its caption.
fn put(sheet: &mut Plane<DrawColor>, cell: &SheetCell, caption: &str, [x, y]: [u32; 2], [width, height]: [u32; 2]) {
    let fits = (width / CHARACTER) as usize;
    let mut say = |text: String, color: DrawColor| {
        text::draw(sheet, &text.chars().take(fits).collect::<String>(), [x, y], color);
    };
    match cell {
        SheetCell::Waiting => say(format!("{caption}: waiting"), OUTDATED),
        SheetCell::Image { is_current: true, .. } => say(caption.to_owned(), CAPTION),
        SheetCell::Image { .. } => say(format!("{caption}: before the change"), OUTDATED),
        SheetCell::Failed(_) => say(format!("{caption}: failed"), MISTAKE),
    }
    let below = y + LINE;
    match cell {
        SheetCell::Image { image, is_current: true } => draw::paste(sheet, &image.cell, x, below),
        SheetCell::Image { image, .. } => {
            draw::paste(sheet, &image.cell.map(|pixel| pixel.map(|v| v / 2 + 12)), x, below);
        }
        SheetCell::Waiting => draw::paste(sheet, &Plane::from_fn(width, height, |_, _| EMPTY), x, below),
        SheetCell::Failed(reason) => {
            let columns = width.saturating_sub(2 * PADDING) / CHARACTER;
            let rows = height.saturating_sub(2 * PADDING) / LINE;
            let mut panel = Plane::from_fn(width, height, |_, _| EMPTY);
            write_lines(&mut panel, &text::wrapped(reason, columns as usize), rows as usize);
            draw::paste(sheet, &panel, x, below);
        }
    }
}

/// A sheet with the errors of a recipe instead of images.
pub fn mistakes(said: &str) -> Plane<DrawColor> {
    let lines = text::wrapped(said, COLUMNS);
    let rows = lines.len().min(MAX_LINES);
    let mut sheet =
        Plane::from_fn(COLUMNS as u32 * CHARACTER + 2 * PADDING, rows as u32 * LINE + 2 * PADDING, |_, _| BACKGROUND);
    write_lines(&mut sheet, &lines, rows);
    sheet
}

/// Writes the lines that fit. The last line then states the number of missing lines.
fn write_lines(panel: &mut Plane<DrawColor>, lines: &[String], rows: usize) {
    let left_out = if lines.len() > rows { lines.len() - rows + 1 } else { 0 };
    let shown = lines.len() - left_out;
    let more = (left_out > 0).then(|| format!("... and {left_out} more lines"));
    for (row, line) in lines[..shown].iter().chain(&more).enumerate() {
        text::draw(panel, line, [PADDING, PADDING + row as u32 * LINE], MISTAKE);
    }
}

/// Encodes a sheet as PNG. Equal pixels give equal bytes.
pub fn png(sheet: &Plane<DrawColor>) -> Result<Vec<u8>> {
    PngImage::rgb(sheet).encode_with(&[MARK])
}

/// Whether bytes are a sheet.
pub fn is_png(bytes: &[u8]) -> bool {
    let (keyword, text) = MARK;
    let chunk = [b"tEXt", keyword.as_bytes(), b"\0", text.as_bytes()].concat();
    bytes[..bytes.len().min(MARKED)].windows(chunk.len()).any(|part| part == chunk)
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::scene::InstanceId;

    fn sheet(cells: Vec<SheetCell>) -> Sheet {
        Sheet { scenes: vec![0, 1], views: vec![0, 1], cells, expected: [80, 60], labels: false }
    }

    fn image(width: u32, height: u32, value: u8) -> SheetCell {
        let cell = Plane::from_fn(width, height, |_, _| [value; 3]);
        SheetCell::Image { image: Arc::new(Shot { cell, details: None }), is_current: true }
    }

    #[test]
    fn cells_lie_in_a_grid_below_their_captions() {
        let drawn = sheet(vec![image(90, 40, 200), image(80, 50, 201), SheetCell::Waiting, image(10, 10, 202)]).draw();
        // Columns of 90 and 80 pixels; rows of 50 pixels and, for waiting cells, of 40 pixels.
        assert_eq!((drawn.width(), drawn.height()), (3 * GAP + 170, 3 * GAP + 2 * LINE + 90));
        let at = |x: u32, y: u32| drawn.at(x, y)[0];
        assert_eq!(at(GAP, GAP + LINE), 200);
        assert_eq!(at(GAP + 89, GAP + LINE + 39), 200);
        assert_eq!(at(GAP + 89, GAP + LINE + 40), BACKGROUND[0]);
        assert_eq!(at(2 * GAP + 90, GAP + LINE), 201);
        assert_eq!(at(GAP, 2 * GAP + 2 * LINE + 50), EMPTY[0]);
        assert_eq!(at(2 * GAP + 90, 2 * GAP + 2 * LINE + 50), 202);
        let caption = (0..90).flat_map(|x| (0..LINE).map(move |y| (x, y)));
        assert!(caption.into_iter().any(|(x, y)| *drawn.at(GAP + x, GAP + y) == CAPTION));
    }

    #[test]
    fn what_failed_is_told_in_its_cell_and_what_is_outdated_is_dark() {
        let reason = "settle: ".to_owned() + &"the pile does not come to rest; ".repeat(40);
        let SheetCell::Image { image: old, .. } = image(120, 90, 200) else { return };
        let old = SheetCell::Image { image: old, is_current: false };
        let drawn = sheet(vec![old, SheetCell::Failed(reason), SheetCell::Waiting, SheetCell::Waiting]).draw();
        assert_eq!(drawn.at(GAP, GAP + LINE), &[112; 3]);
        let of = |color: DrawColor| drawn.data().iter().filter(|pixel| **pixel == color).count();
        assert!(of(MISTAKE) > 300, "{}", of(MISTAKE));
        // No text extends beyond the cell.
        let right = (0..drawn.height()).filter(|&y| *drawn.at(drawn.width() - GAP, y) == MISTAKE).count();
        assert_eq!(right, 0);
    }

    #[test]
    fn a_wide_sheet_explains_its_rows_and_colors() {
        let of = |width: u32, labels: bool| {
            let cells = vec![image(width, 40, 200), SheetCell::Waiting];
            Sheet { scenes: vec![0], views: vec![0, 1], cells, expected: [width, 40], labels }.draw()
        };
        let plain = |drawn: &Plane<DrawColor>| drawn.height() - 2 * GAP - LINE - 40;
        assert_eq!(plain(&of(100, true)), 0);
        assert_eq!(plain(&of(300, false)), LINE + GAP);
        // Two or three lines of at most 85 characters.
        let drawn = of(300, true);
        assert!(drawn.data().contains(&draw::color(InstanceId(1))));
        assert!(plain(&drawn) > LINE + GAP && plain(&drawn) < 4 * LINE, "{}", plain(&drawn));
    }

    #[test]
    fn mistakes_are_cut_where_they_are_too_many() {
        let [few, many] = [3, 1000].map(|count| mistakes(&"error: no\n".repeat(count)));
        assert_eq!(few.height(), 3 * LINE + 2 * PADDING);
        assert_eq!(many.height(), MAX_LINES as u32 * LINE + 2 * PADDING);
        assert_eq!(png(&few).expect("encodes"), png(&few).expect("encodes"));
    }
}
