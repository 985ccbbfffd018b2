//! Layouts of the show side of a package.

use super::artwork::ArtworkPlace;
use super::design::Design;
use super::glyph::letters;
use super::marks::{crest, rays, seal};
use super::scheme::{Scheme, ink_on};
use super::text::{Setting, flush_left};
use crate::material::{MaterialCanvas, SrgbColor, mix, shade};
use std::f32::consts::TAU;
use syntable_model::random::Stream;

/// A panel with positions relative to it.
#[derive(Clone, Copy)]
struct Panel {
    r: [f32; 4],
}

impl Panel {
    fn w(self) -> f32 {
        self.r[2] - self.r[0]
    }
    fn h(self) -> f32 {
        self.r[3] - self.r[1]
    }
    fn at(self, u: f32, v: f32) -> [f32; 2] {
        [self.r[0] + u * self.w(), self.r[1] + v * self.h()]
    }
    fn part(self, [u0, v0, u1, v1]: [f32; 4]) -> [f32; 4] {
        let ([x0, y0], [x1, y1]) = (self.at(u0, v0), self.at(u1, v1));
        [x0, y0, x1, y1]
    }
    /// A height that suits letters: of the panel's, or of its width if that is less.
    fn letter(self, v: f32) -> f32 {
        v * self.h().min(1.3 * self.w())
    }
}

/// Draws the show side in a box, and nothing outside of it.
pub fn front(design: &Design, canvas: &mut MaterialCanvas, stream: &mut Stream, r: [f32; 4]) {
    let before = canvas.set_clip(r);
    let finish = canvas.set_finish(design.finish);
    let panel = Panel { r };
    design.area(canvas, r, design.scheme.ground);
    if panel.w() > 1.45 * panel.h() {
        wide(design, canvas, stream, panel);
        canvas.set_finish(finish);
        canvas.set_clip(before);
        return;
    }
    match design.layout {
        0 => classic(design, canvas, stream, panel),
        1 => wave(design, canvas, stream, panel),
        2 => full_bleed(design, canvas, stream, panel),
        3 => premium(design, canvas, stream, panel),
        4 => diagonal(design, canvas, stream, panel),
        5 => clinical(design, canvas, stream, panel),
        6 => burst(design, canvas, stream, panel),
        7 => pattern(design, canvas, stream, panel),
        _ => window(design, canvas, stream, panel),
    }
    canvas.set_finish(finish);
    canvas.set_clip(before);
}

/// Net weight, and a line of small print above it.
fn foot(design: &Design, canvas: &mut MaterialCanvas, stream: &mut Stream, panel: Panel, ink: SrgbColor) {
    let amount = *stream
        .pick(&["NET WT 350 g", "500 g e", "12 OZ (340g)", "1 L", "750 ml", "20 x 2 g", "250 g"])
        .unwrap_or(&"1 L");
    let height = panel.letter(0.028).max(3.0);
    let [x, y] = panel.at(0.06, 0.95);
    flush_left(canvas, &design.subtitle, &letters(amount), [x, y - height], height, ink);
    if stream.chance(0.5) {
        let text = panel.part([0.6, 0.9, 0.95, 0.98]);
        design.prose(canvas, stream, text, 1.0, ink);
    }
}

fn corner_seal(design: &Design, canvas: &mut MaterialCanvas, stream: &mut Stream, panel: Panel, v: f32) {
    if stream.chance(0.75) {
        let u = if stream.chance(0.5) { 0.82 } else { 0.18 };
        let radius = 0.15 * panel.w().min(panel.h());
        seal(canvas, stream, &design.scheme, (&design.subtitle, design.script), panel.at(u, v), radius);
    }
}

/// Logo above, product below it, artwork to the lower edge.
fn classic(design: &Design, canvas: &mut MaterialCanvas, stream: &mut Stream, panel: Panel) {
    let scheme = &design.scheme;
    let place = if stream.chance(0.6) { ArtworkPlace::OnGround } else { ArtworkPlace::Full };
    let box_ = if place == ArtworkPlace::Full { [0.0, 0.44, 1.0, 1.0] } else { [0.04, 0.42, 0.96, 0.96] };
    let halo = panel.at(0.5, 0.68);
    let bright = mix(scheme.ground, [1.0; 3], 0.35);
    let reach = 0.55 * panel.w();
    canvas.blend(panel.r, |x, y| {
        let (dx, dy) = ((x - halo[0]) / reach, (y - halo[1]) / reach);
        (bright, (1.0 - dx * dx - dy * dy).max(0.0) * 0.8)
    });
    design.artwork.draw(canvas, place, panel.part(box_), panel.r, [scheme.ground, scheme.accent]);
    design.logo(canvas, panel.at(0.5, 0.16), [0.45 * panel.w(), panel.letter(0.13)], scheme.ground);
    design.product_line(canvas, panel.at(0.5, 0.345), [panel.letter(0.06), 0.8 * panel.w()], scheme.ink);
    corner_seal(design, canvas, stream, panel, 0.55);
    let ink = if place == ArtworkPlace::Full { [0.97; 3] } else { scheme.ink };
    foot(design, canvas, stream, panel, ink);
}

/// Two colors that meet in a wave, with the artwork across it.
fn wave(design: &Design, canvas: &mut MaterialCanvas, stream: &mut Stream, panel: Panel) {
    let Scheme { ground, second, second_ink, accent, .. } = design.scheme;
    let (phase, swing) = (stream.uniform(0.0, std::f64::consts::TAU) as f32, stream.uniform(0.03, 0.09) as f32);
    let tilt = stream.uniform(-0.12, 0.12) as f32;
    let level = stream.uniform(0.45, 0.6) as f32;
    let edge = move |x: f32| {
        let u = (x - panel.r[0]) / panel.w();
        panel.r[1] + panel.h() * (level + tilt * (u - 0.5) + swing * libm::sinf(phase + 0.7 * TAU * u))
    };
    let thick = 0.03 * panel.h();
    canvas.fill(panel.r, accent, |x, y| edge(x) - thick - y);
    let finish = canvas.set_finish(design.ground_finish);
    canvas.fill(panel.r, second, |x, y| edge(x) - y);
    canvas.set_finish(finish);
    let art = panel.part([0.12, level - 0.12, 0.88, level + 0.28]);
    design.artwork.draw(canvas, ArtworkPlace::OnGround, art, panel.r, [ground, second]);
    design.logo(canvas, panel.at(0.5, 0.2), [0.45 * panel.w(), panel.letter(0.15)], ground);
    design.product_line(canvas, panel.at(0.5, 0.87), [panel.letter(0.07), 0.85 * panel.w()], second_ink);
    corner_seal(design, canvas, stream, panel, 0.42);
    foot(design, canvas, stream, panel, second_ink);
}

/// Artwork over the whole side with the logo on it.
fn full_bleed(design: &Design, canvas: &mut MaterialCanvas, stream: &mut Stream, panel: Panel) {
    let Scheme { ground, second, second_ink, .. } = design.scheme;
    design.artwork.draw(canvas, ArtworkPlace::Full, panel.r, panel.r, [ground, second]);
    let dark = shade(ground, 0.35);
    canvas.blend(panel.part([0.0, 0.0, 1.0, 0.45]), |_, y| {
        (dark, 0.75 * (1.0 - (y - panel.r[1]) / (0.45 * panel.h())).max(0.0))
    });
    design.logo(canvas, panel.at(0.5, 0.18), [0.45 * panel.w(), panel.letter(0.15)], dark);
    let strip = panel.part([0.0, 0.8, 1.0, 0.93]);
    design.area(canvas, strip, second);
    design.product_line(canvas, panel.at(0.5, 0.865), [panel.letter(0.06), 0.85 * panel.w()], second_ink);
    corner_seal(design, canvas, stream, panel, 0.66);
}

/// Fine frames, a crest, a centered name.
fn premium(design: &Design, canvas: &mut MaterialCanvas, stream: &mut Stream, panel: Panel) {
    let Scheme { ground, accent, ink, ornament, .. } = design.scheme;
    let line = if ornament.metallic > 0.0 { accent } else { ink };
    let finish = canvas.set_finish(ornament);
    let thin = (0.006 * panel.w()).max(1.0);
    canvas.frame(panel.part([0.05, 0.04, 0.95, 0.96]), 2.0 * thin, line);
    canvas.frame(panel.part([0.08, 0.06, 0.92, 0.94]), thin, line);
    crest(canvas, stream, panel.at(0.5, 0.2), 0.1 * panel.w().min(panel.h()), [line, ground]);
    design.logo(canvas, panel.at(0.5, 0.42), [0.38 * panel.w(), panel.letter(0.1)], ground);
    let y = panel.at(0.0, 0.55)[1];
    canvas.line([panel.at(0.25, 0.0)[0], y], [panel.at(0.75, 0.0)[0], y], thin, line);
    canvas.star(panel.at(0.5, 0.55), 5.0 * thin, 4, 0.6, line);
    canvas.set_finish(finish);
    design.product_line(canvas, panel.at(0.5, 0.62), [panel.letter(0.05), 0.7 * panel.w()], ink);
    if stream.chance(0.5) {
        let art = panel.part([0.25, 0.67, 0.75, 0.9]);
        design.artwork.draw(canvas, ArtworkPlace::OnGround, art, panel.r, [ground, accent]);
    } else {
        design.prose(canvas, stream, panel.part([0.2, 0.7, 0.8, 0.82]), 1.1, ink);
        design.claim(canvas, stream, panel.at(0.5, 0.88), [panel.letter(0.035), 0.6 * panel.w()], ink);
    }
}

/// A slanted band with the logo.
fn diagonal(design: &Design, canvas: &mut MaterialCanvas, stream: &mut Stream, panel: Panel) {
    let Scheme { ground, second, accent, ink, .. } = design.scheme;
    let art = panel.part([0.05, 0.5, 0.98, 0.98]);
    design.artwork.draw(canvas, ArtworkPlace::OnGround, art, panel.r, [ground, second]);
    let lift = stream.uniform(0.06, 0.16) as f32;
    let band = |v0: f32, v1: f32| {
        [panel.at(-0.01, v0 + lift), panel.at(1.01, v0 - lift), panel.at(1.01, v1 - lift), panel.at(-0.01, v1 + lift)]
    };
    canvas.polygon(&band(0.15, 0.52), accent);
    let finish = canvas.set_finish(design.ground_finish);
    canvas.polygon(&band(0.18, 0.49), second);
    canvas.set_finish(finish);
    design.logo(canvas, panel.at(0.5, 0.31), [0.44 * panel.w(), panel.letter(0.11)], second);
    design.product_line(canvas, panel.at(0.5, 0.43), [panel.letter(0.05), 0.6 * panel.w()], ink_on(second, ground));
    design.claim(canvas, stream, panel.at(0.32, 0.09), [panel.letter(0.045), 0.5 * panel.w()], ink);
    corner_seal(design, canvas, stream, panel, 0.62);
    foot(design, canvas, stream, panel, ink);
}

/// White with a colored edge and text flush left, as on medicine and electronics.
fn clinical(design: &Design, canvas: &mut MaterialCanvas, stream: &mut Stream, panel: Panel) {
    let Scheme { ground, second, accent, paper, .. } = design.scheme;
    let ink = design.scheme.print_ink();
    design.area(canvas, panel.r, paper);
    let upright = stream.chance(0.5);
    let stripe = if upright { [0.0, 0.0, 0.12, 1.0] } else { [0.0, 0.78, 1.0, 1.0] };
    let color = if ground == paper { second } else { ground };
    design.area(canvas, panel.part(stripe), color);
    let art = if upright { [0.45, 0.5, 1.0, 1.0] } else { [0.4, 0.4, 1.0, 0.78] };
    design.artwork.draw(canvas, ArtworkPlace::OnGround, panel.part(art), panel.part(art), [color, accent]);
    let left = if upright { 0.18 } else { 0.07 };
    design.logo(canvas, panel.at(0.5 * (left + 0.95), 0.14), [0.4 * panel.w(), panel.letter(0.1)], paper);
    let height = panel.letter(0.055);
    let [x, y] = panel.at(left, 0.3);
    flush_left(canvas, &design.subtitle, &design.product, [x, y], height, color);
    design.prose(canvas, stream, panel.part([left, 0.4, left + 0.5, 0.52]), 1.2, ink);
    let dose = *stream.pick(&["400 mg", "24 x", "0.5%", "USB 3.0", "60 W", "PRO 2", "10 ml"]).unwrap_or(&"24 x");
    let [x, y] = panel.at(left, 0.6);
    flush_left(canvas, &design.subtitle, &letters(dose), [x, y], 1.3 * height, ink);
    foot(design, canvas, stream, panel, if upright { ink } else { ink_on(color, paper) });
}

/// Rays behind the logo, goods below.
fn burst(design: &Design, canvas: &mut MaterialCanvas, stream: &mut Stream, panel: Panel) {
    let Scheme { ground, second, accent, ink, .. } = design.scheme;
    let bright = mix(ground, [1.0, 0.97, 0.85], 0.3);
    rays(canvas, panel.r, panel.at(0.5, 0.5), stream.integer(10, 22) as usize, bright);
    let art = panel.part([0.05, 0.5, 0.95, 1.0]);
    design.artwork.draw(canvas, ArtworkPlace::OnGround, art, panel.r, [ground, second]);
    if stream.chance(0.5) {
        canvas.star(panel.at(0.5, 0.25), 0.5 * panel.w(), 18, 0.16, accent);
        design.logo(canvas, panel.at(0.5, 0.22), [0.38 * panel.w(), panel.letter(0.12)], accent);
        let color = ink_on(accent, ground);
        design.product_line(canvas, panel.at(0.5, 0.37), [panel.letter(0.05), 0.6 * panel.w()], color);
    } else {
        design.logo(canvas, panel.at(0.5, 0.2), [0.47 * panel.w(), panel.letter(0.17)], ground);
        design.product_line(canvas, panel.at(0.5, 0.4), [panel.letter(0.065), 0.8 * panel.w()], ink);
    }
    corner_seal(design, canvas, stream, panel, 0.88);
}

/// A repeated motif with a plate for the text.
fn pattern(design: &Design, canvas: &mut MaterialCanvas, stream: &mut Stream, panel: Panel) {
    let Scheme { ground, second, accent, paper, .. } = design.scheme;
    let step = panel.w() / stream.integer(4, 9) as f32;
    let motif = stream.below(5);
    let tone = mix(ground, second, 0.35);
    let rows = (panel.h() / step) as i32 + 1;
    for row in 0..=rows {
        for column in -1..=(panel.w() / step) as i32 {
            let shift = 0.5 * (row % 2) as f32;
            let c = [panel.r[0] + (column as f32 + shift + 0.5) * step, panel.r[1] + row as f32 * step];
            match motif {
                0 => canvas.ellipse(c, [0.22 * step; 2], tone),
                1 => canvas.star(c, 0.4 * step, 5, 0.5, tone),
                2 => canvas.ring(c, 0.3 * step, 0.08 * step, tone),
                3 => canvas.line([c[0] - 0.3 * step, c[1]], [c[0] + 0.3 * step, c[1] - 0.4 * step], 0.12 * step, tone),
                _ => canvas.star(c, 0.42 * step, 8, 0.65, if column % 2 == 0 { tone } else { mix(tone, accent, 0.4) }),
            }
        }
    }
    let plate = panel.part([0.12, 0.2, 0.88, 0.8]);
    canvas.rect(plate, 0.05 * panel.w(), shade(paper, 0.96));
    let inner = 0.02 * panel.w();
    canvas.frame([plate[0] + inner, plate[1] + inner, plate[2] - inner, plate[3] - inner], 0.4 * inner, accent);
    let ink = design.scheme.print_ink();
    design.logo(canvas, panel.at(0.5, 0.34), [0.33 * panel.w(), panel.letter(0.09)], paper);
    design.product_line(canvas, panel.at(0.5, 0.48), [panel.letter(0.045), 0.62 * panel.w()], ink);
    let art = panel.part([0.22, 0.52, 0.78, 0.7]);
    design.artwork.draw(canvas, ArtworkPlace::OnGround, art, plate, [paper, second]);
    design.claim(canvas, stream, panel.at(0.5, 0.75), [panel.letter(0.03), 0.6 * panel.w()], ink);
}

/// A window that shows the goods, with text around it.
fn window(design: &Design, canvas: &mut MaterialCanvas, stream: &mut Stream, panel: Panel) {
    let Scheme { ground, second, accent, ink, .. } = design.scheme;
    let top = stream.uniform(0.4, 0.5) as f32;
    let hole = panel.part([0.14, top, 0.86, 0.88]);
    let radius = stream.uniform(0.02, 0.3) as f32 * panel.w();
    canvas.rect([hole[0] - 3.0, hole[1] - 3.0, hole[2] + 3.0, hole[3] + 3.0], radius, accent);
    // Film over the goods.
    let finish = canvas.set_finish(crate::material::PrintFinish::matt(0.08));
    canvas.rect(hole, radius, shade(second, 0.5));
    canvas.set_finish(finish);
    let margin = 0.3 * radius;
    let inside = [hole[0] + margin, hole[1] + margin, hole[2] - margin, hole[3] - margin];
    design.artwork.draw(canvas, ArtworkPlace::Full, inside, inside, [shade(ground, 0.6), second]);
    design.logo(canvas, panel.at(0.5, 0.17), [0.43 * panel.w(), panel.letter(0.13)], ground);
    let claim = design.script.claim(stream);
    let setting = Setting::level(panel.at(0.5, 0.95), panel.letter(0.035), 0.7 * panel.w(), ink);
    setting.draw(canvas, &design.subtitle, &claim, design.script.joins());
    design.product_line(canvas, panel.at(0.5, top - 0.07), [panel.letter(0.055), 0.8 * panel.w()], ink);
}

/// A side that is wider than tall: logo and text on one half, artwork on the other.
fn wide(design: &Design, canvas: &mut MaterialCanvas, stream: &mut Stream, panel: Panel) {
    let Scheme { ground, second, accent, ink, .. } = design.scheme;
    let mirrored = design.layout % 2 == 1;
    let share = if design.layout < 5 { 0.55 } else { 0.62 };
    let flip = |[u0, v0, u1, v1]: [f32; 4]| if mirrored { [1.0 - u1, v0, 1.0 - u0, v1] } else { [u0, v0, u1, v1] };
    let u = |u: f32| if mirrored { 1.0 - u } else { u };
    let art = panel.part(flip([share, 0.0, 1.0, 1.0]));
    let is_full = design.layout.is_multiple_of(3);
    if is_full {
        design.artwork.draw(canvas, ArtworkPlace::Full, art, panel.r, [ground, second]);
        let x = panel.at(u(share), 0.0)[0];
        canvas.line([x, panel.r[1]], [x, panel.r[3]], 0.02 * panel.h(), accent);
    } else {
        let center = panel.at(u(0.8), 0.5);
        if design.layout == 4 || design.layout == 7 {
            let finish = canvas.set_finish(design.ground_finish);
            canvas.ellipse(center, [0.27 * panel.w(), 0.75 * panel.h()], second);
            canvas.set_finish(finish);
        } else {
            rays(canvas, panel.r, center, 14, mix(ground, [1.0, 0.97, 0.85], 0.2));
        }
        design.artwork.draw(canvas, ArtworkPlace::OnGround, art, panel.r, [ground, second]);
    }
    let middle = u(0.5 * share);
    let half = 0.42 * share * panel.w();
    design.logo(canvas, panel.at(middle, 0.32), [half, 0.22 * panel.h()], ground);
    design.product_line(canvas, panel.at(middle, 0.65), [0.13 * panel.h(), 1.8 * half], ink);
    if stream.chance(0.6) {
        design.claim(canvas, stream, panel.at(middle, 0.84), [0.07 * panel.h(), 1.5 * half], ink);
    } else {
        let text = panel.part(flip([0.06, 0.78, share - 0.06, 0.95]));
        design.prose(canvas, stream, text, 1.0, ink);
    }
    if stream.chance(0.5) {
        let radius = 0.2 * panel.h();
        let face = (&design.subtitle, design.script);
        seal(canvas, stream, &design.scheme, face, panel.at(u(0.93), 0.22), radius);
    }
}
