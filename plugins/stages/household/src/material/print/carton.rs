//! Prints of cartons and of everything that is wrapped around a body.

use super::design::Design;
use super::front::front;
use super::marks::stamp;
use super::relief::ReliefMap;
use super::scheme::Stock;
use super::sheet::{PrintedSheet, texels_per_m, wear};
use crate::material::photograph::Photograph;
use crate::material::{MaterialCanvas, PrintFinish, mix, shade};
use syntable_model::random::Stream;
use syntable_model::scene::Wrap;

/// A rectangle in texture coordinates: u0, v0 (lower left), u1, v1.
pub type UvRect = [f64; 4];

/// The unfolded walls and lids of a carton of `[x, y, z]` meters, and the texture rectangle of each side: -x, +x, -y,
/// +y, -z, +z.
pub fn carton(stream: &mut Stream, [sx, sy, sz]: [f64; 3], photographs: &[Photograph]) -> (PrintedSheet, [UvRect; 6]) {
    // In a row: front (-y), right (+x), back (+y), left (-x); top above and bottom below the front.
    let (width, height) = (2.0 * (sx + sy), sz + 2.0 * sy);
    let scale = texels_per_m([width, height]);
    let texels = |meters: f64| (meters * scale) as f32;
    let design = Design::draw(stream, scale, photographs);
    let (columns, rows) = ((width * scale).ceil() as usize, (height * scale).ceil() as usize);
    let mut canvas = MaterialCanvas::new(columns, rows, design.scheme.ground);
    let at = [0.0, sx, sx + sy, 2.0 * sx + sy, width];
    let wall = |i: usize| [texels(at[i]), texels(sy), texels(at[i + 1]), texels(sy + sz)];
    let rects = [
        [at[3], sy, at[4], sy + sz],
        [at[1], sy, at[2], sy + sz],
        [at[0], sy, at[1], sy + sz],
        [at[2], sy, at[3], sy + sz],
        [0.0, sy + sz, sx, height],
        [0.0, 0.0, sx, sy],
    ];
    canvas.set_finish(design.finish);
    front(&design, &mut canvas, stream, wall(0));
    let narrow = |canvas: &mut MaterialCanvas, stream: &mut Stream, i: usize, facts: f64| {
        if stream.chance(facts) { design.facts(canvas, stream, wall(i)) } else { design.side(canvas, stream, wall(i)) }
    };
    narrow(&mut canvas, stream, 1, 0.6);
    if stream.chance(0.6) {
        front(&design, &mut canvas, stream, wall(2));
    } else {
        design.facts(&mut canvas, stream, wall(2));
    }
    narrow(&mut canvas, stream, 3, 0.4);
    let lids = [[0.0, 0.0, texels(sx), texels(sy)], [0.0, texels(sy + sz), texels(sx), texels(height)]];
    lids.iter().for_each(|lid| design.lid(&mut canvas, stream, *lid));
    let (top, bottom, right) = (texels(sy), texels(sy + sz), texels(width));
    let mut folds: Vec<[[f32; 2]; 2]> = at.iter().map(|x| [[texels(*x), top], [texels(*x), bottom]]).collect();
    folds.extend([top, bottom].map(|y| [[0.0, y], [right, y]]));
    let mut relief = ReliefMap::new(&canvas);
    let damage = stream.uniform(0.0, 1.0);
    relief.handle(stream, damage);
    wear(&mut canvas, &mut relief, stream, design.scheme.stock, &folds);
    let [w, h] = canvas.size().map(f64::from);
    let uv = rects.map(|[x0, y0, x1, y1]| [x0 * scale / w, 1.0 - y1 * scale / h, x1 * scale / w, 1.0 - y0 * scale / h]);
    (PrintedSheet::bake(&canvas, &relief, Wrap::Clamp), uv)
}

/// The body that a print is wrapped around.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WrapKind {
    /// A bag of film with crimped, sealed ends: wrinkles.
    Film,
    /// A drink carton with a roof.
    DrinkCarton,
    /// A carrier bag of paper or film: a large logo, few inks.
    CarrierBag,
    /// A shipping box of brown board.
    ShippingBox,
}

/// A print that runs around a body once: panels of some widths, meters, left to right, of one height, meters. Even
/// panels are shown, odd ones carry facts.
pub fn wrapped(
    stream: &mut Stream,
    kind: WrapKind,
    widths: &[f64],
    height: f64,
    photographs: &[Photograph],
) -> PrintedSheet {
    let total: f64 = widths.iter().sum();
    let scale = texels_per_m([total, height]);
    let mut design = Design::draw(stream, scale, photographs);
    if kind == WrapKind::ShippingBox {
        design.scheme = board(stream, &design);
        design.ground_finish = PrintFinish::matt(0.88);
        design.finish = design.ground_finish;
    } else if design.scheme.stock == Stock::Foil && kind != WrapKind::Film {
        design.ground_finish.metallic = 0.0;
        design.scheme.stock = Stock::Gloss;
    }
    let (columns, rows) = ((total * scale).ceil() as usize, (height * scale).ceil() as usize);
    let mut canvas = MaterialCanvas::new(columns, rows, design.scheme.ground);
    let [w, h] = canvas.size();
    canvas.set_finish(design.ground_finish);
    canvas.rect([0.0, 0.0, w, h], 0.0, design.scheme.ground);
    canvas.set_finish(design.finish);
    // The part of the height that is sealed or folded at the top.
    let head = match kind {
        WrapKind::Film => 0.07,
        WrapKind::DrinkCarton => 0.2,
        WrapKind::CarrierBag | WrapKind::ShippingBox => 0.0,
    } * h;
    let foot = if kind == WrapKind::Film { h - 0.6 * head } else { h };
    let mut folds = Vec::new();
    let mut left = 0.0;
    for (i, width) in widths.iter().enumerate() {
        let right = left + (width * scale) as f32;
        let r = [left, head, right, foot];
        match (kind, i % 2) {
            (WrapKind::CarrierBag, 0) => carrier(&design, &mut canvas, stream, r),
            (WrapKind::CarrierBag, _) => {}
            (WrapKind::ShippingBox, side) => shipping(&design, &mut canvas, stream, r, side == 1),
            (_, 0) => front(&design, &mut canvas, stream, r),
            _ => design.facts(&mut canvas, stream, r),
        }
        if kind == WrapKind::DrinkCarton {
            design.logo(
                &mut canvas,
                [0.5 * (left + right), 0.65 * head],
                [0.36 * (right - left), 0.24 * head],
                design.scheme.ground,
            );
            folds.push([[left, 0.0], [left, h]]);
        }
        if kind == WrapKind::ShippingBox {
            folds.push([[left, 0.0], [left, h]]);
        }
        left = right;
    }
    let mut relief = ReliefMap::new(&canvas);
    match kind {
        WrapKind::Film => {
            wrinkle(&mut relief, stream, [w, h]);
            let period = (0.0022 * scale) as f32;
            relief.crimp(0.5 * head, 0.5 * head, period.max(4.0));
            relief.crimp(h - 0.3 * head, 0.3 * head, period.max(4.0));
            stamp(&mut canvas, stream, &design.prose, [0.55 * w, 0.1 * head], design.small.max(3.0));
        }
        WrapKind::CarrierBag => wrinkle(&mut relief, stream, [w, h]),
        WrapKind::DrinkCarton => {
            folds.push([[0.0, head], [w, head]]);
            relief.handle(stream, 0.6);
        }
        WrapKind::ShippingBox => relief.handle(stream, 1.2),
    }
    wear(&mut canvas, &mut relief, stream, design.scheme.stock, &folds);
    PrintedSheet::bake(&canvas, &relief, Wrap::Repeat)
}

/// Long creases of film, mostly from the ends and the corners.
fn wrinkle(relief: &mut ReliefMap, stream: &mut Stream, [w, h]: [f32; 2]) {
    relief.handle(stream, 1.5);
    for _ in 0..stream.integer(14, 36) {
        let x = stream.unit() as f32 * w;
        let from = if stream.chance(0.5) { 0.06 * h } else { 0.95 * h };
        let length = stream.uniform(0.05, 0.3) as f32 * h;
        let end = if from < 0.5 * h { from + length } else { from - length };
        let shift = stream.uniform(-0.05, 0.05) as f32 * w;
        let height = stream.uniform(1.0, 3.5) as f32 * if stream.chance(0.5) { 1.0 } else { -1.0 };
        relief.crease([[x, from], [x + shift, end]], stream.uniform(4.0, 12.0) as f32, height);
    }
}

/// The colors of a shipping box: brown board with one ink.
fn board(stream: &mut Stream, design: &Design) -> super::scheme::Scheme {
    let ground =
        crate::material::hsv(stream.uniform(0.075, 0.1), stream.uniform(0.33, 0.47), stream.uniform(0.52, 0.7));
    let ink = if stream.chance(0.7) { mix(ground, [0.06; 3], 0.85) } else { shade(design.scheme.ground, 0.6) };
    super::scheme::Scheme {
        ground,
        ink,
        second: ground,
        second_ink: ink,
        accent: ground,
        accent_ink: ink,
        paper: ground,
        ornament: PrintFinish::matt(0.88),
        stock: Stock::Kraft,
    }
}

/// The show side of a carrier bag: a logo, seldom more.
fn carrier(design: &Design, canvas: &mut MaterialCanvas, stream: &mut Stream, r: [f32; 4]) {
    let [w, h] = [r[2] - r[0], r[3] - r[1]];
    if stream.chance(0.3) {
        front(design, canvas, stream, r);
        return;
    }
    let middle = [0.5 * (r[0] + r[2]), r[1] + 0.45 * h];
    design.logo(canvas, middle, [0.36 * w, 0.12 * h], design.scheme.ground);
    design.product_line(canvas, [middle[0], r[1] + 0.66 * h], [0.035 * h, 0.5 * w], design.scheme.ink);
}

/// A wall of a shipping box: logo, handling marks, a label, tape.
fn shipping(design: &Design, canvas: &mut MaterialCanvas, stream: &mut Stream, r: [f32; 4], is_narrow: bool) {
    let [w, h] = [r[2] - r[0], r[3] - r[1]];
    let ink = design.scheme.ink;
    let at = |u: f32, v: f32| [r[0] + u * w, r[1] + v * h];
    let before = canvas.set_clip(r);
    if !is_narrow || stream.chance(0.3) {
        let setting_box = [0.3 * w, 0.14 * h];
        design.logo(canvas, at(0.5, 0.4), setting_box, design.scheme.ground);
    }
    // Arrows that point up.
    let size = (0.12 * h).min(0.12 * w);
    for i in 0..2 {
        let [x, y] = at(0.84, 0.72);
        let x = x + 1.1 * size * (i as f32 - 0.5);
        canvas.polygon(&[[x - 0.4 * size, y], [x, y - 0.6 * size], [x + 0.4 * size, y]], ink);
        canvas.rect([x - 0.14 * size, y, x + 0.14 * size, y + 0.6 * size], 0.0, ink);
    }
    let [x, y] = at(0.84, 0.72);
    canvas.line([x - size, y + 0.75 * size], [x + size, y + 0.75 * size], 0.1 * size, ink);
    if stream.chance(0.55) {
        // A label with an address and a code.
        let corner = at(stream.uniform(0.06, 0.3) as f32, stream.uniform(0.1, 0.4) as f32);
        let [lw, lh] = [(0.11 * design.texels_per_m).min(0.45 * w), (0.09 * design.texels_per_m).min(0.5 * h)];
        let label = [corner[0], corner[1], corner[0] + lw, corner[1] + lh];
        let finish = canvas.set_finish(PrintFinish::matt(0.5));
        canvas.rect(label, 1.0, [0.93; 3]);
        let dark = [0.1; 3];
        let text = [label[0] + 0.06 * lw, label[1] + 0.08 * lh, label[2] - 0.3 * lw, label[1] + 0.5 * lh];
        design.prose(canvas, stream, text, 1.3, dark);
        canvas.frame(
            [label[2] - 0.24 * lw, label[1] + 0.08 * lh, label[2] - 0.06 * lw, label[1] + 0.3 * lh],
            1.0,
            dark,
        );
        let code = [label[0] + 0.06 * lw, label[1] + 0.55 * lh, label[2] - 0.06 * lw, label[3] - 0.06 * lh];
        super::barcode::bar_code(canvas, stream, &design.prose, code);
        canvas.set_finish(finish);
    }
    if stream.chance(0.5) {
        // Tape over the upper edge.
        let finish = canvas.set_finish(PrintFinish::matt(0.16));
        let half = (0.024 * design.texels_per_m).min(0.2 * w);
        let [x, _] = at(0.5, 0.0);
        let color = mix(design.scheme.ground, [0.62, 0.45, 0.25], 0.6);
        canvas.rect([x - half, r[1], x + half, r[1] + 0.22 * h], 0.0, color);
        canvas.set_finish(finish);
    }
    canvas.set_clip(before);
}
