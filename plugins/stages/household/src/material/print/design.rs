//! The design that the panels of one product share: colors, faces, logo and artwork.

use super::artwork::Artwork;
use super::facts::{PrintStyle, facts_panel};
use super::glyph::Glyph;
use super::marks::{crest, ribbon, stamp};
use super::scheme::{Scheme, Stock, ink_on};
use super::text::{Paragraph, Setting};
use super::typeface::{TextRole, Typeface};
use super::words::{LetterCase, Script};
use crate::material::photograph::Photograph;
use crate::material::{MaterialCanvas, PrintFinish, SrgbColor, mix, shade};
use syntable_model::random::Stream;

/// Number of layouts of the show side.
pub const LAYOUTS: u64 = 9;

/// The design of one product.
pub struct Design<'a> {
    /// Colors and stock.
    pub scheme: Scheme,
    /// Face of claims and product names.
    pub subtitle: Typeface,
    /// Face of small print.
    pub prose: Typeface,
    /// Script of most text.
    pub script: Script,
    /// Layout of the show side, below [`LAYOUTS`].
    pub layout: u64,
    /// Illustration or photograph.
    pub artwork: Artwork<'a>,
    /// The product's name below the brand.
    pub product: Vec<Glyph>,
    /// Finish of large areas of ink.
    pub ground_finish: PrintFinish,
    /// Finish of letters and artwork.
    pub finish: PrintFinish,
    /// Resolution of the print, texels per meter.
    pub texels_per_m: f32,
    /// Height of a capital of small print, texels.
    pub small: f32,
    logo: Logo,
}

/// The name of a brand as it is always written.
struct Logo {
    face: Typeface,
    word: Vec<Glyph>,
    style: u64,
    turn: f32,
    bend: f32,
    is_joined: bool,
}

impl<'a> Design<'a> {
    /// A random design; `texels_per_m` is the resolution of the print.
    pub fn draw(stream: &mut Stream, texels_per_m: f64, photographs: &'a [Photograph]) -> Self {
        let scheme = Scheme::draw(stream);
        let script = Script::draw(stream);
        let logo_script = if stream.chance(0.75) { Script::Latin } else { script };
        let case = LetterCase::draw(stream);
        let logo = Logo {
            face: Typeface::draw(stream, TextRole::Headline),
            word: logo_script.name(stream, case),
            style: stream.below(8),
            turn: if stream.chance(0.3) { stream.uniform(-0.22, 0.02) as f32 } else { 0.0 },
            bend: if stream.chance(0.25) { stream.uniform(0.2, 0.5) as f32 } else { 0.0 },
            is_joined: logo_script.joins(),
        };
        let [low, high] = scheme.stock.roughness();
        let roughness = stream.uniform(low, high) as f32;
        let product_case = LetterCase::draw(stream);
        let metallic = if scheme.stock == Stock::Foil { 1.0 } else { 0.0 };
        Self {
            subtitle: Typeface::draw(stream, TextRole::Subtitle),
            prose: Typeface::draw(stream, TextRole::Prose),
            layout: stream.below(LAYOUTS),
            artwork: Artwork::new(&stream.child("artwork"), photographs),
            product: script.name(stream, product_case),
            ground_finish: PrintFinish { roughness, metallic },
            finish: PrintFinish::matt((roughness + stream.uniform(-0.08, 0.12) as f32).clamp(0.08, 0.95)),
            texels_per_m: texels_per_m as f32,
            small: (0.0016 * texels_per_m) as f32,
            scheme,
            script,
            logo,
        }
    }

    /// Fills a box with a large area of ink.
    pub fn area(&self, canvas: &mut MaterialCanvas, r: [f32; 4], color: SrgbColor) {
        let finish = if color == self.scheme.paper { self.finish } else { self.ground_finish };
        let before = canvas.set_finish(finish);
        canvas.rect(r, 0.0, color);
        canvas.set_finish(before);
    }

    /// The logo in a box of half extents around a point, on a ground of some color.
    pub fn logo(&self, canvas: &mut MaterialCanvas, center: [f32; 2], [hx, hy]: [f32; 2], ground: SrgbColor) {
        // A plate is at most this much wider than tall.
        let hx = hx.min(3.4 * hy);
        let Logo { face, word, style, turn, bend, is_joined } = &self.logo;
        let scheme = &self.scheme;
        let ink = ink_on(ground, scheme.second);
        let mut setting = Setting::level(center, 1.7 * hy, 2.0 * hx, ink);
        (setting.turn, setting.bend) = (*turn, *bend);
        let before = canvas.set_finish(scheme.ornament);
        match style {
            1 => {
                setting.color = if ink[0] > 0.5 { [0.98; 3] } else { scheme.accent };
                let edge = if ink[0] > 0.5 { shade(scheme.ground, 0.45) } else { ink };
                setting.edge = Some((edge, 0.09));
                setting.drop = Some((shade(edge, 0.5), 0.08));
            }
            2 => {
                canvas.ellipse(center, [hx, hy], scheme.accent_ink);
                canvas.ellipse(center, [0.96 * hx, 0.92 * hy], scheme.accent);
                (setting.color, setting.height, setting.most) = (scheme.accent_ink, 0.95 * hy, 1.5 * hx);
            }
            3 => {
                ribbon(canvas, center, [0.78 * hx, 0.62 * hy], scheme.accent);
                (setting.color, setting.height, setting.most) = (scheme.accent_ink, 0.8 * hy, 1.4 * hx);
                (setting.turn, setting.bend) = (0.0, 0.0);
            }
            4 => {
                let [x, y] = center;
                let plate = [x - hx, y - 0.85 * hy, x + hx, y + 0.85 * hy];
                canvas.rect(plate, 0.3 * hy, scheme.second_ink);
                let inner = [plate[0] + 0.06 * hy, plate[1] + 0.06 * hy, plate[2] - 0.06 * hy, plate[3] - 0.06 * hy];
                canvas.rect(inner, 0.27 * hy, scheme.second);
                (setting.color, setting.height, setting.most) = (scheme.second_ink, 0.95 * hy, 1.75 * hx);
                setting.bend = 0.0;
            }
            5 => {
                let [x, y] = center;
                let lean = 0.35 * hy;
                let corners = [
                    [x - hx + lean, y - 0.8 * hy],
                    [x + hx + lean, y - 0.8 * hy],
                    [x + hx - lean, y + 0.8 * hy],
                    [x - hx - lean, y + 0.8 * hy],
                ];
                canvas.polygon(&corners, scheme.accent);
                (setting.color, setting.height, setting.most) = (scheme.accent_ink, 1.0 * hy, 1.6 * hx);
                (setting.turn, setting.bend) = (0.0, 0.0);
            }
            6 => {
                let [x, y] = center;
                let sweep = |t: f32| [x + hx * (2.0 * t - 1.0), y + hy * (0.9 - 0.5 * t * t)];
                for i in 0..24 {
                    let t = i as f32 / 24.0;
                    let width = 0.22 * hy * libm::sinf(std::f32::consts::PI * t) + 0.5;
                    canvas.line(sweep(t), sweep(t + 1.0 / 24.0), width, scheme.accent);
                }
                setting.center[1] -= 0.12 * hy;
            }
            _ => {}
        }
        setting.draw(canvas, face, word, *is_joined);
        canvas.set_finish(before);
    }

    /// The product's name, centered.
    pub fn product_line(
        &self,
        canvas: &mut MaterialCanvas,
        center: [f32; 2],
        [height, most]: [f32; 2],
        color: SrgbColor,
    ) {
        Setting::level(center, height, most, color).draw(canvas, &self.subtitle, &self.product, self.script.joins());
    }

    /// A claim of the face for claims, centered.
    pub fn claim(
        &self,
        canvas: &mut MaterialCanvas,
        stream: &mut Stream,
        center: [f32; 2],
        [height, most]: [f32; 2],
        color: SrgbColor,
    ) {
        let claim = self.script.claim(stream);
        Setting::level(center, height, most, color).draw(canvas, &self.subtitle, &claim, self.script.joins());
    }

    /// A paragraph of small print; `scale` is over the usual height.
    pub fn prose(&self, canvas: &mut MaterialCanvas, stream: &mut Stream, r: [f32; 4], scale: f32, color: SrgbColor) {
        let paragraph = Paragraph {
            face: &self.prose,
            script: self.script,
            height: scale * self.small,
            color,
            is_centered: stream.chance(0.4),
        };
        paragraph.fill(canvas, stream, r);
    }

    /// The style of small print.
    pub fn print_style(&self) -> PrintStyle<'_> {
        PrintStyle { face: &self.prose, script: self.script, height: self.small }
    }

    /// A side with facts.
    pub fn facts(&self, canvas: &mut MaterialCanvas, stream: &mut Stream, r: [f32; 4]) {
        let before = canvas.set_clip(r);
        let scheme = &self.scheme;
        let is_paper = stream.chance(0.45);
        let (ground, ink) = if is_paper { (scheme.paper, scheme.print_ink()) } else { (scheme.ground, scheme.ink) };
        self.area(canvas, r, ground);
        let h = r[3] - r[1];
        let w = r[2] - r[0];
        if stream.chance(0.6) && h > 0.7 * w {
            let head = [r[0], r[1], r[2], r[1] + 0.14 * h];
            self.area(canvas, head, scheme.second);
            self.logo(canvas, [0.5 * (r[0] + r[2]), r[1] + 0.07 * h], [0.42 * w, 0.055 * h], scheme.second);
            facts_panel(canvas, stream, (scheme, self.print_style()), [r[0], head[3], r[2], r[3]], [ground, ink]);
        } else {
            facts_panel(canvas, stream, (scheme, self.print_style()), r, [ground, ink]);
        }
        canvas.set_clip(before);
    }

    /// A lid or a bottom: logo, date and a few lines, or plain.
    pub fn lid(&self, canvas: &mut MaterialCanvas, stream: &mut Stream, r: [f32; 4]) {
        let before = canvas.set_clip(r);
        let [w, h] = [r[2] - r[0], r[3] - r[1]];
        let [x, y] = [0.5 * (r[0] + r[2]), 0.5 * (r[1] + r[3])];
        let ground = if stream.chance(0.7) { self.scheme.ground } else { self.scheme.second };
        self.area(canvas, r, ground);
        // The seam of the flap.
        let seam = r[1] + stream.uniform(0.5, 0.9) as f32 * h;
        canvas.line([r[0], seam], [r[2], seam], 1.0, shade(ground, 0.6));
        match stream.below(3) {
            0 => self.logo(canvas, [x, y], [0.36 * w, 0.3 * h], ground),
            1 => {
                self.logo(canvas, [x - 0.15 * w, y], [0.28 * w, 0.3 * h], ground);
                let at = [r[0] + 0.72 * w, r[1] + 0.4 * h];
                canvas.rect([at[0] - 2.0, at[1] - 2.0, r[2] - 0.04 * w, r[1] + 0.7 * h], 1.0, self.scheme.paper);
                stamp(canvas, stream, &self.prose, at, self.small.max(3.0));
            }
            _ => {
                let ink = ink_on(ground, self.scheme.second);
                self.product_line(canvas, [x, y], [0.3 * h, 0.7 * w], ink);
            }
        }
        canvas.set_clip(before);
    }

    /// A narrow side: logo, claims in a list, or the logo along the side.
    pub fn side(&self, canvas: &mut MaterialCanvas, stream: &mut Stream, r: [f32; 4]) {
        let before = canvas.set_clip(r);
        let scheme = &self.scheme;
        let [w, h] = [r[2] - r[0], r[3] - r[1]];
        let x = 0.5 * (r[0] + r[2]);
        let ground = if stream.chance(0.7) { scheme.ground } else { scheme.second };
        let ink = ink_on(ground, scheme.second);
        self.area(canvas, r, ground);
        self.logo(canvas, [x, r[1] + 0.14 * h], [0.42 * w, (0.09 * h).min(0.25 * w)], ground);
        self.product_line(canvas, [x, r[1] + 0.27 * h], [(0.05 * h).min(0.13 * w), 0.8 * w], ink);
        if stream.chance(0.5) {
            let most = 0.2 * w.min(h);
            for i in 0..3 {
                let y = r[1] + h * (0.4 + 0.18 * i as f32);
                canvas.ellipse([x, y], [most.min(0.075 * h); 2], scheme.accent);
                self.claim(canvas, stream, [x, y], [0.3 * most, 0.8 * w], ink_on(scheme.accent, scheme.ground));
            }
        } else {
            crest(canvas, stream, [x, r[1] + 0.42 * h], (0.2 * w).min(0.09 * h), [mix(ground, ink, 0.7), ground]);
            let text = [r[0] + 0.12 * w, r[1] + 0.55 * h, r[2] - 0.12 * w, r[3] - 0.08 * h];
            self.prose(canvas, stream, text, 1.2, ink);
        }
        canvas.set_clip(before);
    }
}
