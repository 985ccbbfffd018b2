//! Covers of books and magazines.

use super::artwork::ArtworkPlace;
use super::carton::UvRect;
use super::design::Design;
use super::front::front;
use super::glyph::{Glyph, letters};
use super::relief::ReliefMap;
use super::scheme::ink_on;
use super::sheet::{PrintedSheet, texels_per_m, wear};
use super::text::Setting;
use super::typeface::{TextRole, Typeface};
use super::words::{LetterCase, Script};
use crate::material::photograph::Photograph;
use crate::material::{MaterialCanvas, mix, shade};
use syntable_model::random::Stream;
use syntable_model::scene::Wrap;

/// The cover of a book of `[width, height, thickness]` meters, and the texture rectangles: front, spine, back.
pub fn book(
    stream: &mut Stream,
    [width, height, thickness]: [f64; 3],
    photographs: &[Photograph],
) -> (PrintedSheet, [UvRect; 3]) {
    let total = 2.0 * width + thickness;
    let scale = texels_per_m([total, height]);
    let design = Design::draw(stream, scale, photographs);
    let title = Title::draw(stream, design.script);
    let mut canvas =
        MaterialCanvas::new((total * scale).ceil() as usize, (height * scale).ceil() as usize, design.scheme.ground);
    let [w, h] = canvas.size();
    canvas.set_finish(design.finish);
    let [a, b, c] = [width, width + thickness, total].map(|x| (x * scale) as f32);
    if stream.chance(0.25) {
        front(&design, &mut canvas, stream, [b, 0.0, c, h]);
    } else {
        title.cover(&design, &mut canvas, stream, [b, 0.0, c, h]);
    }
    design.area(&mut canvas, [0.0, 0.0, a, h], design.scheme.ground);
    let before = canvas.set_clip([0.0, 0.0, a, h]);
    let ink = design.scheme.ink;
    design.prose(&mut canvas, stream, [0.14 * a, 0.12 * h, 0.86 * a, 0.42 * h], 1.5, ink);
    design.prose(&mut canvas, stream, [0.14 * a, 0.5 * h, 0.86 * a, 0.66 * h], 1.5, ink);
    let code = [0.55 * a, 0.84 * h, 0.9 * a, 0.95 * h];
    super::barcode::bar_code(&mut canvas, stream, &design.prose, code);
    canvas.set_clip([a, 0.0, b, h]);
    let spine = if stream.chance(0.5) { design.scheme.ground } else { design.scheme.second };
    design.area(&mut canvas, [a, 0.0, b, h], spine);
    let thick = b - a;
    let setting = Setting {
        turn: std::f32::consts::FRAC_PI_2,
        ..Setting::level([0.5 * (a + b), 0.4 * h], 0.5 * thick, 0.62 * h, ink_on(spine, design.scheme.ground))
    };
    setting.draw(&mut canvas, &title.face, &title.words[0], title.is_joined);
    canvas.ellipse([0.5 * (a + b), 0.88 * h], [0.28 * thick; 2], design.scheme.accent);
    canvas.set_clip(before);
    let mut relief = ReliefMap::new(&canvas);
    let damage = stream.uniform(0.0, 0.4);
    relief.handle(stream, damage);
    relief.emboss(&canvas, 0.8);
    let hinge = (0.008 * scale) as f32;
    let folds = [[[a, 0.0], [a, h]], [[b, 0.0], [b, h]], [[0.0, 0.5], [w, 0.5]], [[0.0, h - 0.5], [w, h - 0.5]]];
    relief.crease([[b + hinge, 0.0], [b + hinge, h]], 5.0, -1.6);
    relief.crease([[a - hinge, 0.0], [a - hinge, h]], 5.0, -1.6);
    wear(&mut canvas, &mut relief, stream, design.scheme.stock, &folds);
    let [a, b] = [width * scale / f64::from(w), (width + thickness) * scale / f64::from(w)];
    let rects = [[b, 0.0, total * scale / f64::from(w), 1.0], [a, 0.0, b, 1.0], [0.0, 0.0, a, 1.0]];
    (PrintedSheet::bake(&canvas, &relief, Wrap::Clamp), rects)
}

/// The title of a book.
struct Title {
    face: Typeface,
    words: Vec<Vec<Glyph>>,
    author: Vec<Glyph>,
    is_joined: bool,
}

impl Title {
    fn draw(stream: &mut Stream, script: Script) -> Self {
        let case = LetterCase::draw(stream);
        let count = stream.integer(1, 3);
        let mut author = script.name(stream, LetterCase::Title);
        author.extend(letters(" "));
        author.extend(script.name(stream, LetterCase::Title));
        Self {
            face: Typeface::draw(stream, TextRole::Headline),
            words: (0..count).map(|_| script.name(stream, case)).collect(),
            author,
            is_joined: script.joins(),
        }
    }

    fn cover(&self, design: &Design, canvas: &mut MaterialCanvas, stream: &mut Stream, r: [f32; 4]) {
        let before = canvas.set_clip(r);
        let scheme = &design.scheme;
        let [w, h] = [r[2] - r[0], r[3] - r[1]];
        let at = |u: f32, v: f32| [r[0] + u * w, r[1] + v * h];
        let style = stream.below(4);
        let colors = [scheme.ground, scheme.second];
        design.area(canvas, r, scheme.ground);
        let (ground, top) = match style {
            0 | 1 => {
                design.artwork.draw(canvas, ArtworkPlace::Full, r, r, colors);
                let dark = shade(scheme.ground, 0.3);
                canvas.blend([r[0], r[1], r[2], r[1] + 0.5 * h], |_, y| (dark, 0.7 * (1.0 - (y - r[1]) / (0.5 * h))));
                (dark, 0.14)
            }
            2 => {
                let [x0, y0] = at(0.0, 0.45);
                design.artwork.draw(canvas, ArtworkPlace::Full, [x0, y0, r[2], r[3]], r, colors);
                canvas.rect([x0, y0 - 0.012 * h, r[2], y0], 0.0, scheme.accent);
                (scheme.ground, 0.12)
            }
            _ => {
                for _ in 0..stream.integer(2, 7) {
                    let [x0, y0] = at(stream.unit() as f32, stream.unit() as f32);
                    let size = stream.uniform(0.1, 0.5) as f32 * w;
                    let color = mix(scheme.second, scheme.accent, stream.unit() as f32);
                    match stream.below(3) {
                        0 => canvas.ellipse([x0, y0], [size; 2], color),
                        1 => canvas.rect([x0, y0, x0 + size, y0 + 0.4 * size], 0.0, color),
                        _ => canvas
                            .polygon(&[[x0, y0], [x0 + size, y0 + 0.3 * size], [x0 + 0.2 * size, y0 + size]], color),
                    }
                }
                canvas.rect([at(0.08, 0.0)[0], at(0.0, 0.1)[1], at(0.92, 0.0)[0], at(0.0, 0.5)[1]], 0.0, scheme.paper);
                (scheme.paper, 0.17)
            }
        };
        let ink = ink_on(ground, scheme.second);
        let finish = canvas.set_finish(scheme.ornament);
        for (line, word) in self.words.iter().enumerate() {
            let setting = Setting::level(at(0.5, top + 0.115 * line as f32), 0.095 * h, 0.82 * w, ink);
            setting.draw(canvas, &self.face, word, self.is_joined);
        }
        canvas.set_finish(finish);
        let low = if style == 3 { ink_on(scheme.ground, scheme.second) } else { [0.97; 3] };
        let author = Setting::level(at(0.5, 0.92), 0.04 * h, 0.7 * w, low);
        author.draw(canvas, &design.subtitle, &self.author, self.is_joined);
        canvas.set_clip(before);
    }
}

/// The cover of a magazine of `[width, height]` meters: front on the right half, back on the left one.
pub fn magazine(stream: &mut Stream, [width, height]: [f64; 2], photographs: &[Photograph]) -> PrintedSheet {
    let scale = texels_per_m([2.0 * width, height]);
    let design = Design::draw(stream, scale, photographs);
    let scheme = &design.scheme;
    let (columns, rows) = ((2.0 * width * scale).ceil() as usize, (height * scale).ceil() as usize);
    let mut canvas = MaterialCanvas::new(columns, rows, scheme.paper);
    let [w, h] = canvas.size();
    canvas.set_finish(design.finish);
    let middle = 0.5 * w;
    let page = [middle, 0.0, w, h];
    let before = canvas.set_clip(page);
    design.artwork.draw(&mut canvas, ArtworkPlace::Full, page, page, [scheme.ground, scheme.second]);
    let masthead = Typeface::draw(stream, TextRole::Headline);
    let name = Script::Latin.name(stream, LetterCase::Capitals);
    let color = if stream.chance(0.5) { [0.97; 3] } else { scheme.accent };
    let setting = Setting {
        edge: stream.chance(0.4).then(|| (shade(scheme.ground, 0.4), 0.04)),
        ..Setting::level([1.5 * middle, 0.1 * h], 0.15 * h, 0.88 * middle, color)
    };
    setting.draw(&mut canvas, &masthead, &name, false);
    // Headlines down one side.
    let (left, right) = if stream.chance(0.5) { (0.05, 0.42) } else { (0.58, 0.95) };
    let mut y = 0.24;
    while y < 0.85 {
        let height = stream.uniform(0.02, 0.042) as f32;
        let x = middle * (1.0 + 0.5 * (left + right));
        let ink = if stream.chance(0.6) { [0.97; 3] } else { scheme.accent };
        design.claim(&mut canvas, stream, [x, y * h], [height * h, (right - left) * middle], ink);
        let text = [middle * (1.0 + left), (y + 0.035) * h, middle * (1.0 + right), (y + 0.09) * h];
        design.prose(&mut canvas, stream, text, 1.5, [0.96; 3]);
        y += stream.uniform(0.11, 0.2) as f32;
    }
    let code = [middle * 1.05, 0.9 * h, middle * 1.3, 0.97 * h];
    super::barcode::bar_code(&mut canvas, stream, &design.prose, code);
    canvas.set_clip(before);
    // The back is an advertisement.
    front(&design, &mut canvas, stream, [0.0, 0.0, middle, h]);
    let mut relief = ReliefMap::new(&canvas);
    relief.handle(stream, 0.7);
    wear(&mut canvas, &mut relief, stream, scheme.stock, &[[[middle, 0.0], [middle, h]]]);
    PrintedSheet::bake(&canvas, &relief, Wrap::Clamp)
}
