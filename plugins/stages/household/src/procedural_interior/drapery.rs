//! Curtains and blinds.

use super::openings::casements;
use super::piece::Piece;
use super::solids::bar;
use super::tones;
use crate::material::MaterialFamily;
use crate::shape::{SlotMapping, SolidShape, rounded_box, thick_sheet};
use std::f64::consts::{PI, TAU};
use syntable_model::geometry::Point3;
use syntable_model::random::Stream;

/// The folds of hanging cloth: an irregular wave that is deeper at the hem.
struct Folds {
    count: f64,
    depth: f64,
    waves: [[f64; 3]; 3],
}

impl Folds {
    fn draw(stream: &mut Stream, width: f64) -> Self {
        let count = (width / stream.uniform(0.07, 0.13)).max(3.0);
        let wave =
            |stream: &mut Stream| [stream.uniform(0.6, 2.6), stream.uniform(0.0, TAU), stream.uniform(-0.5, 0.5)];
        Self { count, depth: stream.uniform(0.022, 0.042), waves: [0; 3].map(|_| wave(stream)) }
    }

    /// Depth towards the room at a place across in [0, 1] and a height in [0, 1] from the hem.
    fn at(&self, u: f64, v: f64) -> f64 {
        let drift = |k: usize| {
            let [length, phase, lean] = self.waves[k];
            libm::sin(TAU * length * u + phase + lean * 3.0 * v)
        };
        let phase = TAU * self.count * u + 1.3 * drift(0) + 0.6 * drift(1);
        let deep = self.depth * (0.45 + 0.55 * (1.0 - v)) * (1.0 + 0.35 * drift(2));
        let wave = libm::sin(phase);
        // Folds are round towards the room and tighter behind.
        deep * (wave + 0.22 * libm::sin(2.0 * phase + 0.8))
    }
}

/// A panel of curtain cloth between `x0` and `x1`, hanging from `top` to `hem`. `tie` gathers it at a height, towards the
/// side of its sign.
fn panel(piece: &mut Piece, cloth: u16, [x0, x1]: [f64; 2], [hem, top]: [f64; 2], tie: Option<f64>) {
    let folds = Folds::draw(&mut piece.form, x1 - x0);
    let height = top - hem;
    let sway = piece.uniform(-0.02, 0.02);
    let at = |[u, v]: [f64; 2]| {
        let z = hem + v * height;
        let mut x = x0 + u * (x1 - x0) + sway * (1.0 - v) * libm::sin(PI * u);
        let mut deep = folds.at(u, v);
        if let Some(side) = tie {
            // Gathered at 40 % of the height: the cloth narrows to a third, near one edge.
            let near =
                libm::exp(-((v - 0.4) / 0.2) * ((v - 0.4) / 0.2)) + if v < 0.4 { 0.55 * (1.0 - v / 0.4) } else { 0.0 };
            let near = near.min(1.0);
            let edge = if side > 0.0 { x1 } else { x0 };
            x = edge + (x - edge) * (1.0 - 0.66 * near);
            deep *= 1.0 + 0.4 * near;
        }
        [Point3::new(x, deep - 0.0012, z), Point3::new(x, deep + 0.0012, z)]
    };
    let columns = ((folds.count * 9.0) as usize).clamp(30, 110);
    let tile = piece.tile_m(cloth);
    let mapping = SlotMapping::tile(cloth, tile);
    piece.keep(thick_sheet([columns, 16], [columns.div_ceil(8), 8], [mapping; 3], at));
    if let Some(side) = tie {
        let edge = if side > 0.0 { x1 } else { x0 };
        let z = hem + 0.4 * height;
        let (a, b) = (edge - side * 0.36 * (x1 - x0), edge + side * 0.01);
        let depth = 1.5 * folds.depth + 0.006;
        piece.block(cloth, [a.min(b), -depth - 0.004, z - 0.03], [a.max(b), -depth, z + 0.03], 0.002);
    }
}

/// One or two panels of cloth on a rod, long or short; some in front of a window.
pub fn curtain(piece: &mut Piece) {
    let cloth = match piece.paint.below(3) {
        0 => piece.surface(&[MaterialFamily::Fabric, MaterialFamily::Velvet, MaterialFamily::Tablecloth]),
        _ => {
            let color = tones::cloth(&mut piece.paint);
            piece.cloth_of(color, &[MaterialFamily::Fabric, MaterialFamily::Fabric, MaterialFamily::Velvet])
        }
    };
    let metal = piece.metal();
    let is_long = piece.form.chance(0.65);
    let height = if is_long { piece.uniform(2.05, 2.45) } else { piece.uniform(1.0, 1.5) };
    let half = 0.5 * piece.uniform(0.8, 2.1);
    let cover = piece.uniform(0.28, 0.5) * 2.0 * half;
    let (hem, top) = (0.0, height);
    let behind = piece.form.chance(0.5) && half > 0.5;
    if piece.form.chance(0.25) {
        let all = if behind { half } else { half.min(0.7) };
        panel(piece, cloth, [-all, all], [hem, top], None);
    } else {
        let tied = piece.form.chance(0.3);
        panel(piece, cloth, [-half, -half + cover], [hem, top], tied.then_some(-1.0));
        panel(piece, cloth, [half - cover, half], [hem, top], tied.then_some(1.0));
    }
    // Folds and the handles of a window do not touch.
    let wall = if behind { 0.175 } else { 0.09 };
    let (rod, reach) = (top + 0.025, half + piece.form.uniform(0.06, 0.14));
    piece.bar(metal, [-reach, 0.0, rod], [reach, 0.0, rod], [0.011; 2]);
    for side in [-1.0, 1.0] {
        let x = side * reach;
        piece.bar(metal, [x, 0.0, rod], [x + side * 0.045, 0.0, rod], [0.021, 0.013]);
        piece.bar(metal, [x - side * 0.05, 0.0, rod], [x - side * 0.05, wall, rod], [0.007; 2]);
    }
    for number in 0..=(14.0 * half) as usize {
        let x = -half + number as f64 / (14.0 * half).floor() * 2.0 * half;
        if x.abs() < half - cover {
            continue;
        }
        piece.bar(metal, [x - 0.003, 0.0, rod], [x + 0.003, 0.0, rod], [0.017; 2]);
    }
    if behind {
        let (wide, tall) = (1.7 * half, if is_long { 0.55 * height } else { 0.8 * height });
        let center = if is_long { 0.63 * height } else { 0.5 * height };
        piece.placed([0.0, 0.0, center], 0.0, |piece| casements(piece, [wide, tall], 0.125));
    }
}

/// A venetian, roller or pleated blind; most in front of a window.
pub fn blind(piece: &mut Piece) {
    let half = 0.5 * piece.uniform(0.6, 1.6);
    let height = piece.uniform(0.9, 1.6);
    let drawn = if piece.form.chance(0.5) { 1.0 } else { piece.uniform(0.45, 0.9) };
    if drawn < 1.0 || piece.form.chance(0.7) {
        casements(piece, [2.0 * half, height], 0.072);
    }
    let hem = 0.5 * height - drawn * height;
    let top = 0.5 * height;
    match piece.form.below(4) {
        0 => roller(piece, half, [hem, top]),
        1 => pleated(piece, half, [hem, top]),
        _ => venetian(piece, half, [hem, top]),
    }
}

fn venetian(piece: &mut Piece, half: f64, [hem, top]: [f64; 2]) {
    let slats = match piece.paint.below(3) {
        0 => piece.surface(&[MaterialFamily::Timber]),
        1 => {
            let color = tones::case(&mut piece.paint);
            piece.plain("slats", color, 0.4)
        }
        _ => piece.plain("slats", [0.86, 0.85, 0.82], 0.35),
    };
    let cord = piece.plain("cord", [0.8, 0.79, 0.75], 0.9);
    let depth = *piece.form.pick(&[0.025, 0.035, 0.05]).unwrap_or(&0.025);
    let tilt = if piece.form.chance(0.2) { piece.uniform(55.0, 68.0) } else { piece.uniform(-38.0, 38.0) };
    let pitch = 0.84 * depth;
    piece.block(slats, [-half, -0.5 * depth - 0.012, top], [half, 0.5 * depth + 0.006, top + 0.045], 0.003);
    let count = (((top - hem) / pitch) as usize).clamp(6, 70);
    let pitch = (top - hem) / count as f64;
    let slat = |z: f64| {
        let at = |[u, v]: [f64; 2]| {
            let across = v - 0.5;
            let crown = 0.06 * depth * (1.0 - 4.0 * across * across);
            let point = |lift: f64| Point3::new((2.0 * u - 1.0) * half, across * depth, crown + lift);
            [point(0.0005), point(-0.0005)]
        };
        thick_sheet([1, 4], [1, 4], [SlotMapping::fit(slats); 3], at).rotated(0, tilt).translated(0.0, 0.0, z)
    };
    let mut all = SolidShape::default();
    for number in 0..count {
        let jitter = piece.form.normal() * 0.0006;
        all = all.and(slat(top - pitch * (number as f64 + 0.7) + jitter));
    }
    let tile = piece.tile_m(slats);
    piece.cluster(all.box_mapped(tile, 0));
    piece.block(slats, [-half, -0.5 * depth, hem - 0.016], [half, 0.5 * depth, hem], 0.003);
    for x in [-0.72 * half, 0.72 * half] {
        for y in [-0.52 * depth, 0.52 * depth] {
            piece.bar(cord, [x, y, hem - 0.002], [x, y, top + 0.004], [0.0009; 2]);
        }
    }
    let wand = piece.uniform(0.4, 0.8);
    let x = -0.9 * half;
    piece.bar(cord, [x, -0.5 * depth - 0.016, top - wand], [x, -0.5 * depth - 0.014, top + 0.01], [0.004; 2]);
}

fn roller(piece: &mut Piece, half: f64, [hem, top]: [f64; 2]) {
    let color = tones::cloth(&mut piece.paint);
    let cloth = piece.cloth_of(color, &[MaterialFamily::Fabric]);
    let bar_slot = piece.metal();
    piece.bar(cloth, [-half, 0.0, top + 0.01], [half, 0.0, top + 0.01], [0.024; 2]);
    for side in [-1.0, 1.0] {
        let x = side * half;
        piece.board(bar_slot, [x - 0.006, -0.03, top - 0.03], [x + 0.006, 0.055, top + 0.045]);
    }
    piece.board(cloth, [-half + 0.012, -0.0245, hem], [half - 0.012, -0.0235, top + 0.01]);
    piece.block(cloth, [-half + 0.012, -0.029, hem - 0.012], [half - 0.012, -0.018, hem + 0.01], 0.004);
    let x = 0.97 * half;
    let cord = bar(
        SlotMapping::fit(bar_slot),
        Point3::new(x, -0.03, hem.min(top - 0.6)),
        Point3::new(x, -0.03, top),
        [0.0015; 2],
    );
    piece.join(bar_slot, cord);
}

fn pleated(piece: &mut Piece, half: f64, [hem, top]: [f64; 2]) {
    let color = tones::cloth(&mut piece.paint);
    let cloth = piece.cloth_of(color, &[MaterialFamily::Fabric]);
    let pleats = (((top - hem) / piece.uniform(0.02, 0.035)) as usize).max(6);
    let at = |[u, v]: [f64; 2]| {
        let odd = ((v * 2.0 * pleats as f64).round() as usize) % 2;
        let y = if odd == 1 { -0.014 } else { 0.0 };
        let point = |lift: f64| Point3::new((2.0 * u - 1.0) * half, y + lift, hem + v * (top - hem));
        [point(-0.0006), point(0.0006)]
    };
    let sheet = thick_sheet([1, 2 * pleats], [1, 2 * pleats], [SlotMapping::tile(cloth, 0.4); 3], at);
    piece.cluster(sheet);
    for z in [hem - 0.008, top + 0.008] {
        let rail = rounded_box([2.0 * half, 0.024, 0.02], 0.003, 1, |_| SlotMapping::fit(cloth));
        piece.join(cloth, rail.translated(0.0, -0.006, z));
    }
}
