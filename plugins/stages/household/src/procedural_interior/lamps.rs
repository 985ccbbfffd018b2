//! Floor lamps, and table lamps on a small table.

use super::piece::Piece;
use super::solids::{ball, boxed, spline, tube};
use super::tones;
use crate::material::{MaterialFamily, hsv};
use crate::shape::{Lathe, Profile, SlotMapping};
use std::f64::consts::TAU;
use syntable_model::geometry::Point3;
use syntable_model::scene::Color;

/// A lamp with a shade: half of all are lit.
pub fn lamp(piece: &mut Piece) {
    match piece.form.below(5) {
        0 => tripod(piece),
        1 => arched(piece),
        2 => column(piece),
        _ => on_table(piece),
    }
}

/// A cloth or paper shade and its bulb; slots of the outside and of the light.
struct Shade {
    cloth: u16,
    bulb: u16,
    metal: u16,
}

impl Shade {
    fn new(piece: &mut Piece) -> Self {
        let color = match piece.paint.below(4) {
            0 => tones::cloth(&mut piece.paint),
            1 => hsv(0.1, 0.3, 0.75),
            _ => hsv(0.12, piece.paint.uniform(0.03, 0.14), 0.9),
        };
        let is_lit = piece.paint.chance(0.5);
        let nits = if is_lit { 500.0 * libm::pow(12.0, piece.paint.unit()) } else { 0.0 };
        let tint = crate::material::linear(color);
        let light = tones::lamplight(&mut piece.paint, nits);
        let emission: [f32; 3] = std::array::from_fn(|k| light[k] * (0.25 + 0.75 * tint[k]));
        let cloth = piece.cloth_of(color, &[MaterialFamily::Fabric]);
        let cloth = if is_lit { piece.lit(cloth, Color::constant(emission)) } else { cloth };
        let bulb = light.map(|x| (1.6 * x).min(8000.0));
        let bulb = piece.emissive([0.9; 3], 0.3, Color::constant(bulb));
        let metal = piece.metal();
        Self { cloth, bulb, metal }
    }

    /// A shade around the z axis with its lower edge at a height: lower and upper radius, and height.
    fn hang(&self, piece: &mut Piece, at: [f64; 3], [low, high, tall]: [f64; 3]) {
        let side = SlotMapping::tile(self.cloth, 0.3);
        let wall = 0.002;
        let outline = Profile::at(low, 0.0)
            .to(low + wall, 0.0, side)
            .to(high + wall, tall, side)
            .to(high, tall, side)
            .closed(side);
        let cells = [vec![[low, 0.0], [low + wall, 0.0], [high + wall, tall], [high, tall]]];
        let shade = Lathe::new(&outline).segments(48).hollow(&cells, &[], 8);
        piece.keep(shade.translated(at[0], at[1], at[2]));
        let middle = Point3::new(at[0], at[1], at[2] + 0.45 * tall);
        piece.keep(ball(SlotMapping::fit(self.bulb), middle, (0.3 * high).min(0.045)));
        // The spider that carries the shade.
        for i in 0..3 {
            let (sin, cos) = libm::sincos(TAU * f64::from(i) / 3.0);
            let z = at[2] + 0.9 * tall;
            let radius = low + 0.9 * (high - low) + 0.001;
            piece.bar(self.metal, [at[0], at[1], z], [at[0] + radius * cos, at[1] + radius * sin, z], [0.0015; 2]);
        }
        piece.bar(self.metal, [at[0], at[1], at[2] + 0.1 * tall], [at[0], at[1], at[2] + 0.92 * tall], [0.006; 2]);
    }
}

/// Sizes of a shade: a drum, a cone or a wide one.
fn sizes(piece: &mut Piece, scale: f64) -> [f64; 3] {
    let [low, high, tall] = *piece
        .form
        .pick(&[[0.2, 0.19, 0.26], [0.2, 0.12, 0.25], [0.24, 0.22, 0.2], [0.15, 0.15, 0.34], [0.22, 0.09, 0.2]])
        .unwrap_or(&[0.2, 0.19, 0.26]);
    let factor = scale * piece.uniform(0.85, 1.15);
    [low * factor, high * factor, tall * factor]
}

/// A round foot.
fn foot(piece: &mut Piece, slot: u16, radius: f64) {
    let side = SlotMapping::fit(slot);
    let outline = Profile::at(0.0, 0.0)
        .to(radius, 0.0, side)
        .to(radius, 0.016, side)
        .round(0.006)
        .to(0.03, 0.024, side)
        .to(0.014, 0.045, side)
        .to(0.0, 0.045, side);
    piece.join(slot, Lathe::new(&outline).segments(40).solid());
}

fn column(piece: &mut Piece) {
    let shade = Shade::new(piece);
    let post = if piece.paint.chance(0.3) { piece.wood(0.0) } else { shade.metal };
    let (height, size) = (piece.uniform(1.2, 1.5), sizes(piece, 1.0));
    let radius = piece.uniform(0.12, 0.16);
    foot(piece, shade.metal, radius);
    let thick = piece.uniform(0.008, 0.016);
    piece.bar(post, [0.0, 0.0, 0.03], [0.0, 0.0, height + 0.12 * size[2]], [thick; 2]);
    shade.hang(piece, [0.0, 0.0, height], size);
}

fn tripod(piece: &mut Piece) {
    let shade = Shade::new(piece);
    let legs = if piece.paint.chance(0.7) { piece.wood(0.15) } else { shade.metal };
    let (height, size) = (piece.uniform(1.0, 1.3), sizes(piece, 1.1));
    let spread = piece.uniform(0.24, 0.34);
    for i in 0..3 {
        let (sin, cos) = libm::sincos(TAU * (f64::from(i) / 3.0 + 0.08));
        piece.bar(legs, [spread * cos, spread * sin, 0.0], [-0.02 * cos, -0.02 * sin, height - 0.02], [0.011, 0.013]);
    }
    piece.bar(shade.metal, [0.0, 0.0, height - 0.07], [0.0, 0.0, height + 0.12 * size[2]], [0.02, 0.012]);
    shade.hang(piece, [0.0, 0.0, height], size);
}

fn arched(piece: &mut Piece) {
    let shade = Shade::new(piece);
    let (top, reach) = (piece.uniform(1.5, 1.9), piece.uniform(0.4, 0.8));
    let size = sizes(piece, 0.95);
    foot(piece, shade.metal, 0.16);
    let low = top - 0.16 - size[2];
    let path = spline(
        &[
            Point3::new(0.0, 0.0, 0.03),
            Point3::new(0.0, 0.0, 0.6 * top),
            Point3::new(0.0, -0.3 * reach, 0.92 * top),
            Point3::new(0.0, -0.7 * reach, top),
            Point3::new(0.0, -0.97 * reach, top - 0.06),
            Point3::new(0.0, -reach, low + 0.8 * size[2]),
        ],
        6,
    );
    piece.join(shade.metal, tube(SlotMapping::fit(shade.metal), &path, 10, 3, |_| 0.0095));
    shade.hang(piece, [0.0, -reach, low], size);
}

/// A table lamp with a turned body on a small table or stool.
fn on_table(piece: &mut Piece) {
    use MaterialFamily::{Ceramic, Marble};
    let wood = piece.wood(0.3);
    let legs = if piece.paint.chance(0.5) { wood } else { piece.metal() };
    let (radius, height) = (piece.uniform(0.18, 0.28), piece.uniform(0.42, 0.6));
    let side = SlotMapping::fit(wood);
    let plate = Profile::at(0.0, height - 0.02)
        .to(radius, height - 0.02, side)
        .round(0.004)
        .to(radius, height, side)
        .round(0.004)
        .to(0.0, height, side);
    piece.join(wood, Lathe::new(&plate).segments(40).solid());
    for i in 0..3 {
        let (sin, cos) = libm::sincos(TAU * (f64::from(i) + 0.5) / 3.0);
        let foot = [0.95 * radius * cos, 0.95 * radius * sin, 0.0];
        piece.bar(legs, foot, [0.6 * radius * cos, 0.6 * radius * sin, height - 0.015], [0.011, 0.014]);
    }
    piece.carries([0.0, 0.0, height], [0.65 * radius; 2]);
    let shade = Shade::new(piece);
    let body = match piece.paint.below(4) {
        0 => piece.wood(0.1),
        1 => shade.metal,
        2 => piece.surface(&[Ceramic, Marble]),
        _ => {
            let color = tones::cloth(&mut piece.paint);
            piece.tinted(Ceramic, color, 0.15)
        }
    };
    let (tall, wide) = (piece.uniform(0.2, 0.32), piece.uniform(0.05, 0.1));
    let side = SlotMapping::fit(body);
    let neck = 0.014;
    let (first, second) = (piece.uniform(0.6, 1.5), piece.uniform(0.1, 0.9));
    let outline = Profile::at(0.0, 0.0)
        .to(0.75 * wide, 0.0, side)
        .round(0.004)
        .to(0.75 * wide, 0.012, side)
        .curve([first * wide, 0.3 * tall], [second * wide + neck, 0.6 * tall], [neck, tall], 12, side)
        .to(neck, tall + 0.03, side)
        .to(0.0, tall + 0.03, side);
    let turned = Lathe::new(&outline).segments(36).solid();
    piece.join(body, boxed(turned).translated(0.0, 0.0, height));
    let size = sizes(piece, 0.7);
    shade.hang(piece, [0.0, 0.0, height + tall + 0.01], size);
}
