//! Shoes.

use super::piece::Piece;
use super::solids::{Softness, circle, soft_box, tube};
use super::tones;
use crate::material::{MaterialFamily, hsv};
use crate::shape::{SlotMapping, SolidShape, loft};
use syntable_model::geometry::{Point3, Vector3};

/// Half width of a shoe by the position from heel to toe, in parts of the largest.
const WIDTHS: [[f64; 2]; 9] = [
    [0.0, 0.5],
    [0.03, 0.7],
    [0.1, 0.86],
    [0.25, 0.9],
    [0.42, 0.84],
    [0.65, 1.0],
    [0.82, 0.93],
    [0.94, 0.66],
    [1.0, 0.3],
];
/// Height of the upper over its toe cap, in parts of the toe cap's height.
const TOES: [[f64; 2]; 6] = [[0.0, 0.86], [0.06, 1.0], [0.6, 1.08], [0.8, 0.94], [0.94, 0.7], [1.0, 0.3]];
/// How much of the collar's height the upper has.
const RISES: [[f64; 2]; 6] = [[0.0, 0.94], [0.06, 1.0], [0.32, 1.0], [0.44, 0.72], [0.56, 0.3], [0.7, 0.0]];
/// Rings from heel to toe.
const RINGS: usize = 22;

/// The value at a position of a line through points.
fn along(line: &[[f64; 2]], at: f64) -> f64 {
    let after = line.iter().position(|point| point[0] >= at).unwrap_or(line.len() - 1).max(1);
    let ([t0, v0], [t1, v1]) = (line[after - 1], line[after]);
    v0 + (v1 - v0) * ((at - t0) / (t1 - t0)).clamp(0.0, 1.0)
}

/// The form that both shoes of a pair have, meters.
struct Last {
    length: f64,
    half_width: f64,
    sole: f64,
    toe: f64,
    collar: f64,
    has_laces: bool,
}

impl Last {
    /// Middle and half width at a position from heel to toe. Shoes bend inwards; `side` is 1 for the right one.
    fn plan(&self, side: f64, t: f64) -> [f64; 2] {
        let bend = (t - 0.35).max(0.0);
        [-side * 0.5 * self.half_width * bend * bend, self.half_width * along(&WIDTHS, t)]
    }

    fn y(&self, t: f64) -> f64 {
        self.length * (0.5 - t)
    }

    /// Height of the upper above the floor.
    fn top(&self, t: f64) -> f64 {
        self.sole + self.toe * along(&TOES, t) + self.collar * along(&RISES, t)
    }

    /// Positions of rings, nearer to each other at the ends.
    fn stations() -> impl DoubleEndedIterator<Item = f64> {
        (0..RINGS).map(|i| {
            let t = i as f64 / (RINGS - 1) as f64;
            t * t * (3.0 - 2.0 * t) * 0.6 + t * 0.4
        })
    }

    /// The upper: round sections from heel to toe.
    fn upper(&self, side: f64, slot: u16) -> SolidShape {
        const AROUND: usize = 14;
        let ring = |t: f64| {
            let ([x, half], top) = (self.plan(side, t), self.top(t));
            let bottom = 0.6 * self.sole;
            let point = |i: usize| {
                let (sin, cos) = libm::sincos(std::f64::consts::PI * i as f64 / AROUND as f64);
                let across = half * cos.signum() * libm::pow(cos.abs(), 0.75);
                // The collar is narrower than the sole.
                let height = (top - bottom) * libm::pow(sin, 0.7);
                let taper = 1.0 - 0.22 * (height / (self.toe + self.collar)).min(1.0);
                Point3::new(x + across * taper, self.y(t), bottom + height)
            };
            (0..=AROUND).map(point).collect::<Vec<_>>()
        };
        loft(&Self::stations().map(ring).collect::<Vec<_>>(), SlotMapping::fit(slot), 1)
    }

    /// The sole: a plate that is a little wider than the upper.
    fn plate(&self, side: f64, slot: u16) -> SolidShape {
        let rim = 0.004;
        let level = |z: f64, inset: f64| {
            let edge = |t: f64, sign: f64| {
                let [x, half] = self.plan(side, t);
                Point3::new(x + sign * (half + rim - inset), self.y(t) + (0.5 - t) * 2.0 * (rim - inset), z)
            };
            let right = Self::stations().rev().map(|t| edge(t, 1.0));
            right.chain(Self::stations().map(|t| edge(t, -1.0))).collect::<Vec<_>>()
        };
        let bevel = 0.1 * self.sole;
        let rings = [level(0.0, 0.003), level(bevel, 0.0), level(self.sole - bevel, 0.0), level(self.sole, 0.003)];
        loft(&rings, SlotMapping::fit(slot), 3)
    }
}

/// A pair of shoes: low or ankle-high, with laces or without; of cloth or leather.
pub fn shoes(piece: &mut Piece) {
    let color = tones::cloth(&mut piece.paint);
    let upper = match piece.paint.below(4) {
        0 => piece.cloth_of(color, &[MaterialFamily::Fabric, MaterialFamily::Knit]),
        1 => piece.tinted(MaterialFamily::Leather, hsv(0.07, 0.5, 0.06), 0.3),
        2 => piece.surface(&[MaterialFamily::Leather]),
        _ => piece.tinted(MaterialFamily::Leather, color, 0.45),
    };
    let light = hsv(0.12, piece.paint.uniform(0.0, 0.25), piece.paint.uniform(0.7, 0.9));
    let sole = match piece.paint.below(3) {
        0 => piece.plain("sole", light, 0.6),
        1 => piece.plain("sole", hsv(0.07, 0.5, 0.3), 0.7),
        _ => piece.plain("sole", [0.04; 3], 0.6),
    };
    let lining = piece.plain("lining", [0.05; 3], 0.95);
    let lace =
        if piece.paint.chance(0.6) { piece.plain("lace", light, 0.8) } else { piece.plain("lace", [0.05; 3], 0.8) };
    let length = piece.uniform(0.24, 0.31);
    let last = Last {
        length,
        half_width: length * piece.uniform(0.16, 0.185),
        sole: piece.uniform(0.014, 0.034),
        toe: piece.uniform(0.04, 0.052),
        collar: if piece.form.chance(0.35) { piece.uniform(0.05, 0.09) } else { piece.uniform(0.012, 0.03) },
        has_laces: piece.form.chance(0.7),
    };
    for side in [-1.0, 1.0] {
        let at = [side * piece.uniform(0.075, 0.11), piece.uniform(-0.05, 0.05), 0.0];
        let yaw = piece.uniform(-8.0, 8.0);
        piece.placed(at, yaw, |piece| shoe(piece, &last, side, [upper, sole, lining, lace]));
    }
}

fn shoe(piece: &mut Piece, last: &Last, side: f64, [upper, sole, lining, lace]: [u16; 4]) {
    piece.join(sole, last.plate(side, sole));
    piece.join(upper, last.upper(side, upper));
    // The opening: a dark plate in a padded rim.
    let (middle, top) = (0.2, last.top(0.2));
    let [x, half] = last.plan(side, middle);
    let opening = [0.62 * half, 0.15 * last.length];
    let soft = Softness { corner: 0.95 * opening[0], edge: 0.003, bulge: -0.002, bow: 0.0 };
    let plate = soft_box(lining, [2.0 * opening[0], 2.0 * opening[1], 0.014], soft);
    piece.join(lining, plate.translated(x, last.y(middle), top - 0.005));
    let mut rim = circle(Point3::new(x, last.y(middle), top), Vector3::x() * opening[0], Vector3::y() * opening[1], 24);
    rim.push(rim[0]);
    piece.join(upper, tube(SlotMapping::fit(upper), &rim, 8, 4, |_| 0.0055));
    if last.has_laces {
        for i in 0..5 {
            let t = 0.41 + 0.05 * f64::from(i);
            let ([x, half], z) = (last.plan(side, t), last.top(t) - 0.001);
            let reach = 0.42 * half;
            piece.bar(lace, [x - reach, last.y(t), z], [x + reach, last.y(t), z], [0.0028; 2]);
        }
    }
}
