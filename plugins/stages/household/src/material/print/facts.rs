//! The small print of packages: nutrition tables, ingredients, addresses, marks and codes.

use super::barcode::{bar_code, square_code};
use super::glyph::letters;
use super::marks::{recycling_mark, stamp};
use super::scheme::Scheme;
use super::text::{LINE_STEP, Paragraph, flush_left};
use super::typeface::Typeface;
use super::words::Script;
use crate::material::{MaterialCanvas, SrgbColor};
use syntable_model::random::Stream;

/// Rows of a nutrition table.
const NUTRIENTS: [&str; 10] =
    ["Energy", "Fat", "saturated", "Carbohydrate", "sugars", "Fiber", "Protein", "Salt", "Calcium", "Iron"];

/// The faces and the script of small print.
#[derive(Clone, Copy)]
pub struct PrintStyle<'a> {
    /// Light face.
    pub face: &'a Typeface,
    /// Script.
    pub script: Script,
    /// Height of a capital, texels.
    pub height: f32,
}

/// A table of nutrients in a box, from its top; returns its lower edge.
pub fn nutrition_table(
    canvas: &mut MaterialCanvas,
    stream: &mut Stream,
    style: PrintStyle,
    r: [f32; 4],
    colors: [SrgbColor; 2],
) -> f32 {
    let [paper, ink] = colors;
    let height = style.height.max(3.2);
    let step = LINE_STEP * height;
    let rows = (((r[3] - r[1]) / step - 2.6) as usize).clamp(2, NUTRIENTS.len());
    let bottom = (r[1] + (rows as f32 + 2.6) * step).min(r[3]);
    let thin = (0.12 * height).max(0.6);
    canvas.rect([r[0], r[1], r[2], bottom], 0.0, paper);
    canvas.frame([r[0], r[1], r[2], bottom], 1.6 * thin, ink);
    let (left, right) = (r[0] + 0.7 * height, r[2] - 0.7 * height);
    let bold = Typeface { weight: 0.19, ..style.face.clone() };
    let title = match style.script {
        Script::Latin => letters("Nutrition Facts"),
        script => script.claim(stream),
    };
    let size = (1.5 * height).min((right - left) / bold.compose(&title, false).1.max(1.0));
    flush_left(canvas, &bold, &title, [left, r[1] + 0.6 * height], size, ink);
    canvas.rect([left, r[1] + 1.5 * step, right, r[1] + 1.5 * step + 3.0 * thin], 0.0, ink);
    for (row, name) in NUTRIENTS.iter().enumerate().take(rows) {
        let y = r[1] + (row as f32 + 2.0) * step;
        let name = if style.script == Script::Latin { letters(name) } else { style.script.prose(stream) };
        let indent = if row % 3 == 2 { height } else { 0.0 };
        let face = if row % 3 == 0 { &bold } else { style.face };
        flush_left(canvas, face, &name, [left + indent, y], height, ink);
        let amount = letters(&format!("{}.{} g", stream.integer(0, 60), stream.below(10)));
        let width = style.face.compose(&amount, false).1 * height;
        flush_left(canvas, style.face, &amount, [right - width, y], height, ink);
        canvas.rect([left, y + 1.3 * height, right, y + 1.3 * height + thin], 0.0, ink);
    }
    bottom
}

/// A side with small print: a table, ingredients, a bar code and marks, one below the other or beside each other.
pub fn facts_panel(
    canvas: &mut MaterialCanvas,
    stream: &mut Stream,
    (scheme, style): (&Scheme, PrintStyle),
    r: [f32; 4],
    [ground, ink]: [SrgbColor; 2],
) {
    let [w, h] = [r[2] - r[0], r[3] - r[1]];
    let margin = 0.07 * w.min(h);
    let (x0, x1) = (r[0] + margin, r[2] - margin);
    let mut y = r[1] + margin;
    let end = r[3] - margin;
    if x1 - x0 < 8.0 * style.height || end - y < 6.0 * style.height {
        return;
    }
    let is_wide = w > 1.1 * h;
    let (table, rest) = if is_wide {
        let split = x0 + 0.45 * (x1 - x0);
        ([x0, y, split, end], [split + margin, x1])
    } else {
        ([x0, y, x1, y + 0.42 * (end - y)], [x0, x1])
    };
    // Tables are as narrow as their amounts allow.
    let table = [table[0], table[1], table[2].min(table[0] + 34.0 * style.height.max(3.2)), table[3]];
    let paper = if stream.chance(0.6) { scheme.paper } else { ground };
    let on_paper = if paper == ground { ink } else { scheme.print_ink() };
    let bottom = nutrition_table(canvas, stream, style, table, [paper, on_paper]);
    if !is_wide {
        y = bottom + margin;
    }
    let code = (0.26 * (end - r[1])).min(0.6 * (rest[1] - rest[0])).max(10.0);
    let text_end = end - code - margin;
    if text_end > y {
        let face = style.face;
        let bold = Typeface { weight: 0.18, ..face.clone() };
        let height = style.height;
        if style.script == Script::Latin {
            flush_left(canvas, &bold, &letters("Ingredients:"), [rest[0], y], height, ink);
        }
        let paragraph = Paragraph { face, script: style.script, height, color: ink, is_centered: false };
        let split = y + 0.6 * (text_end - y);
        paragraph.fill(canvas, stream, [rest[0], y + LINE_STEP * height, rest[1], split]);
        // Further languages follow in blocks.
        let second = Paragraph { script: Script::draw(stream), height: 0.9 * height, ..paragraph };
        second.fill(canvas, stream, [rest[0], split + height, rest[1], text_end]);
    }
    let wide = (1.45 * code).min(rest[1] - rest[0]);
    let right_code = stream.chance(0.6);
    let code_x = if right_code { rest[1] - wide } else { rest[0] };
    bar_code(canvas, stream, style.face, [code_x, end - code, code_x + wide, end]);
    let free = rest[1] - rest[0] - wide - margin;
    let free_x = if right_code { rest[0] } else { rest[0] + wide + margin };
    let mark = (0.24 * code).min(0.5 * free);
    if mark > 4.0 {
        recycling_mark(canvas, [free_x + mark, end - mark], 0.9 * mark, ink);
        let is_coded = stream.chance(0.4);
        if is_coded {
            square_code(canvas, stream, [free_x, end - code], (0.55 * code).min(free), [0.06; 3]);
        } else {
            stamp(canvas, stream, style.face, [free_x, end - code], style.height.min(0.16 * free));
        }
    }
}
