//! Pot plants: palms and rosettes, bushes, and tall ones with a trunk or upright blades.

use super::piece::Piece;
use super::solids::{bar, boxed, spline, tube};
use super::tones;
use crate::material::{MaterialFamily, SrgbColor, hsv, leaf};
use crate::shape::{Lathe, Profile, SlotMapping, SolidShape, thick_sheet};
use std::f64::consts::{PI, TAU};
use syntable_model::geometry::{Point3, Vector3};

/// The form of a leaf: its blade's length and width, its droop, its fold along the middle rib, and its outline's widest
/// place in (0, 1).
#[derive(Debug, Clone, Copy)]
struct LeafForm {
    length: f64,
    width: f64,
    droop: f64,
    fold: f64,
    widest: f64,
    rows: usize,
}

/// A leaf from a point along a direction; `up` is its upper side.
fn blade(slot: u16, form: LeafForm, at: Point3<f64>, along: Vector3<f64>, up: Vector3<f64>) -> SolidShape {
    let along = along.normalize();
    let side = along.cross(&up).try_normalize(1e-6).unwrap_or_else(|| along.cross(&Vector3::x()).normalize());
    let up = side.cross(&along);
    let power = libm::log(0.5) / libm::log(form.widest);
    let place = |[u, v]: [f64; 2]| {
        let across = 2.0 * u - 1.0;
        let outline = libm::sin(PI * libm::pow(v.clamp(0.012, 0.985), power));
        let half = 0.5 * form.width * outline.max(0.03);
        // The blade bends down along a circle.
        let angle = form.droop * v;
        let (reach, drop) = if form.droop.abs() < 1e-3 {
            (v, 0.0)
        } else {
            (libm::sin(angle) / form.droop, (1.0 - libm::cos(angle)) / form.droop)
        };
        let normal = up * libm::cos(angle) + along * libm::sin(angle);
        let ripple = 0.05 * form.width * libm::sin(9.0 * v) * across;
        let p = at + along * (form.length * reach) - up * (form.length * drop)
            + side * (half * across)
            + normal * (form.fold * half * across.abs() + ripple);
        [p + normal * 0.0004, p - normal * 0.0004]
    };
    thick_sheet([2, form.rows], [2, form.rows], [SlotMapping::fit(slot); 3], place).without_parts()
}

/// Leaves of two or three close greens.
fn greens(piece: &mut Piece) -> [u16; 3] {
    let (hue, saturation) = (piece.paint.uniform(0.22, 0.38), piece.paint.uniform(0.35, 0.7));
    let value = piece.paint.uniform(0.24, 0.5);
    let tip: SrgbColor = match piece.paint.below(4) {
        0 => hsv(0.16, 0.4, 0.75),
        1 => hsv(0.9, 0.4, 0.5),
        _ => hsv(hue, saturation, value * 1.3),
    };
    let gloss = piece.paint.uniform(0.42, 0.7);
    [0.82, 1.0, 1.2].map(|tone| {
        let color = hsv(hue + piece.paint.uniform(-0.015, 0.015), saturation, value * tone);
        let texture = leaf(&mut piece.paint, color, tip);
        piece.image(texture, gloss)
    })
}

/// A pot with earth, and perhaps a saucer. Returns the height and the radius of the earth.
fn pot(piece: &mut Piece, radius: f64) -> [f64; 2] {
    use MaterialFamily::{Ceramic, Concrete, Plastic};
    let slot = match piece.paint.below(4) {
        0 => piece.tinted(Ceramic, hsv(0.05, 0.6, 0.62), 0.85),
        1 => piece.surface(&[Ceramic, Concrete]),
        2 => {
            let color = tones::paint(&mut piece.paint);
            piece.tinted(Ceramic, color, 0.3)
        }
        _ => {
            let color = tones::case(&mut piece.paint);
            piece.tinted(Plastic, color, 0.4)
        }
    };
    let earth = piece.tinted(Concrete, hsv(0.07, 0.45, 0.14), 0.95);
    let height = radius * piece.uniform(1.5, 2.2);
    let foot = radius * piece.uniform(0.65, 0.95);
    let wall = 0.006;
    let side = SlotMapping::fit(slot);
    let belly = foot + 0.5 * (radius - foot) + radius * piece.uniform(-0.02, 0.14);
    let is_rimmed = piece.form.chance(0.4);
    let outline = Profile::at(0.0, 0.0).to(foot, 0.0, side).round(0.01);
    let outline = outline.curve([belly, 0.3 * height], [radius, 0.6 * height], [radius, 0.86 * height], 8, side);
    let outline = if is_rimmed {
        outline.to(radius + 0.01, 0.862 * height, side).to(radius + 0.012, height, side)
    } else {
        outline.to(radius, height, side)
    };
    let outline = outline.round(0.002).to(radius - wall, height, side).round(0.002);
    let outline = outline.to(radius - wall, 0.84 * height, side).to(0.0, 0.84 * height, side);
    piece.join(slot, Lathe::new(&outline).segments(32).solid());
    let level = 0.9 * height;
    let ground = Profile::at(0.0, 0.83 * height)
        .to(radius - wall - 0.0005, 0.83 * height, SlotMapping::fit(earth))
        .to(radius - wall - 0.0005, level, SlotMapping::fit(earth))
        .to(0.0, level + 0.008, SlotMapping::fit(earth));
    piece.join(earth, Lathe::new(&ground).segments(24).solid());
    if piece.form.chance(0.4) {
        let saucer = Profile::at(0.0, -0.012)
            .to(1.1 * foot, -0.012, side)
            .to(1.25 * foot, 0.012, side)
            .to(1.2 * foot, 0.012, side)
            .to(1.06 * foot, -0.004, side)
            .to(0.0, -0.004, side);
        piece.join(slot, Lathe::new(&saucer).segments(32).solid());
    }
    [level, radius - wall]
}

/// A plant in a pot.
pub fn plant(piece: &mut Piece) {
    let radius = piece.uniform(0.09, 0.19);
    let [earth, room] = pot(piece, radius);
    let slots = greens(piece);
    let stem = piece.tinted(MaterialFamily::Timber, hsv(0.09, 0.35, 0.35), 0.85);
    match piece.form.below(6) {
        0 | 1 => palm(piece, slots, stem, earth),
        2 => rosette(piece, slots, earth, room),
        3 => swords(piece, slots, earth, room),
        4 => broad(piece, slots, stem, earth),
        _ => bush(piece, slots, stem, earth),
    }
}

/// Arching fronds with leaflets on both sides.
fn palm(piece: &mut Piece, slots: [u16; 3], stem: u16, earth: f64) {
    let fronds = piece.form.integer(7, 11);
    let (rise, spread) = (piece.uniform(0.55, 1.05), piece.uniform(0.3, 0.55));
    let mut foliage = SolidShape::default();
    for number in 0..fronds {
        let yaw = TAU * (number as f64 * 0.382 + piece.uniform(-0.05, 0.05));
        let out = Vector3::new(libm::cos(yaw), libm::sin(yaw), 0.0);
        let inner = number as f64 / fronds as f64;
        let (up, away) = (rise * (1.1 - 0.5 * inner), spread * (0.35 + 0.75 * inner));
        let start = Point3::new(0.0, 0.0, earth - 0.02) + out * 0.02;
        let path = spline(
            &[
                start,
                start + Vector3::z() * (0.55 * up) + out * (0.12 * away),
                start + Vector3::z() * (0.95 * up) + out * (0.5 * away),
                start + Vector3::z() * (0.92 * up) + out * away,
                start + Vector3::z() * (0.7 * up) + out * (1.3 * away),
            ],
            5,
        );
        let last = path.len() - 1;
        foliage = foliage.and(tube(SlotMapping::tile(stem, 0.1), &path, 5, 8, |t| 0.0045 - 0.0034 * t));
        let slot = slots[number as usize % 3];
        for i in 7..=last {
            let t = i as f64 / last as f64;
            let along = (path[i] - path[i - 1]).normalize();
            let side = along.cross(&Vector3::z()).try_normalize(1e-6).unwrap_or_else(Vector3::x);
            let up = side.cross(&along);
            let length = 0.26 * rise * libm::sin(PI * (0.18 + 0.74 * t));
            let form = LeafForm { length, width: 0.022, droop: 0.7, fold: 0.25, widest: 0.4, rows: 3 };
            for sign in [-1.0, 1.0] {
                let jitter = piece.uniform(-0.1, 0.1);
                let direction = side * sign + along * (0.75 + jitter) + up * (0.25 + jitter);
                foliage = foliage.and(blade(slot, form, path[i], direction, up));
            }
        }
    }
    piece.cluster(foliage);
}

/// Long leaves from one middle.
fn rosette(piece: &mut Piece, slots: [u16; 3], earth: f64, room: f64) {
    let count = piece.form.integer(22, 40);
    let (length, width) = (piece.uniform(0.3, 0.6), piece.uniform(0.018, 0.05));
    let droop = piece.uniform(0.8, 2.2);
    let mut foliage = SolidShape::default();
    for number in 0..count {
        let age = (number as f64 + 0.5) / count as f64;
        let yaw = TAU * number as f64 * 0.382;
        let rise = 1.35 - 0.9 * age + piece.uniform(-0.1, 0.1);
        let (sin, cos) = libm::sincos(yaw);
        let along = Vector3::new(cos * libm::cos(rise), sin * libm::cos(rise), libm::sin(rise));
        let at = Point3::new(0.3 * room * cos * age, 0.3 * room * sin * age, earth - 0.01);
        let length = length * piece.uniform(0.75, 1.1);
        let form = LeafForm { length, width, droop: droop * (0.5 + 0.6 * age), fold: 0.35, widest: 0.35, rows: 7 };
        foliage = foliage.and(blade(slots[number as usize % 3], form, at, along, Vector3::z()));
    }
    piece.cluster(foliage);
}

/// Upright stiff blades.
fn swords(piece: &mut Piece, slots: [u16; 3], earth: f64, room: f64) {
    let count = piece.form.integer(9, 18);
    let height = piece.uniform(0.35, 0.8);
    let mut foliage = SolidShape::default();
    for number in 0..count {
        let yaw = TAU * number as f64 * 0.382;
        let t = libm::sqrt((number as f64 + 0.5) / count as f64);
        let (sin, cos) = libm::sincos(yaw);
        let at = Point3::new(0.62 * room * t * cos, 0.62 * room * t * sin, earth - 0.02);
        let lean = 0.22 * t;
        let along = Vector3::new(lean * cos, lean * sin, 1.0);
        let turn = yaw + piece.uniform(-1.2, 1.2);
        let up = Vector3::new(libm::cos(turn), libm::sin(turn), 0.0);
        let length = height * piece.uniform(0.6, 1.1);
        let form = LeafForm {
            length,
            width: piece.uniform(0.04, 0.06),
            droop: piece.uniform(-0.15, 0.25),
            fold: 0.3,
            widest: 0.45,
            rows: 7,
        };
        foliage = foliage.and(blade(slots[number as usize % 3], form, at, along, up));
    }
    piece.cluster(foliage);
}

/// Few large leaves on long stalks.
fn broad(piece: &mut Piece, slots: [u16; 3], stem: u16, earth: f64) {
    let count = piece.form.integer(16, 32);
    let height = piece.uniform(0.4, 1.0);
    let mut foliage = SolidShape::default();
    for number in 0..count {
        let yaw = TAU * (number as f64 * 0.382 + piece.uniform(-0.06, 0.06));
        let out = Vector3::new(libm::cos(yaw), libm::sin(yaw), 0.0);
        let age = number as f64 / count as f64;
        let (up, away) = (height * (1.05 - 0.7 * age), 0.1 + 0.3 * age + piece.uniform(-0.04, 0.06));
        let start = Point3::new(0.0, 0.0, earth - 0.01) + out * 0.015;
        let end = start + Vector3::z() * up + out * away;
        let path = spline(&[start, start + Vector3::z() * (0.6 * up) + out * (0.25 * away), end], 4);
        foliage = foliage.and(tube(SlotMapping::tile(stem, 0.1), &path, 5, 8, |t| 0.004 - 0.0015 * t));
        let length = piece.uniform(0.17, 0.34);
        let form = LeafForm {
            length,
            width: length * 0.62,
            droop: piece.uniform(0.3, 1.1),
            fold: 0.22,
            widest: 0.38,
            rows: 8,
        };
        let along = out + Vector3::z() * piece.uniform(-0.35, 0.5);
        foliage = foliage.and(blade(slots[number as usize % 3], form, end, along, Vector3::z()));
    }
    piece.cluster(foliage);
}

/// A trunk or several stems with many oval leaves.
fn bush(piece: &mut Piece, slots: [u16; 3], stem: u16, earth: f64) {
    let stems = piece.form.integer(1, 4);
    let trunk = piece.uniform(0.1, 0.7) * if stems == 1 { 1.0 } else { 0.35 };
    let (crown, size) = (piece.uniform(0.35, 0.75), piece.uniform(0.065, 0.12));
    let mut foliage = SolidShape::default();
    let branches = 26 / stems;
    for number in 0..stems {
        let yaw = TAU * number as f64 / stems as f64 + piece.uniform(0.0, 1.0);
        let lean = Vector3::new(libm::cos(yaw), libm::sin(yaw), 0.0) * if stems == 1 { 0.02 } else { 0.12 };
        let start = Point3::new(0.0, 0.0, earth - 0.02) + lean * 0.2;
        let top = start + Vector3::z() * (trunk + 0.8 * crown) + lean;
        piece.join(stem, bar(SlotMapping::fit(stem), start, top, [0.012, 0.005]));
        for branch in 0..branches {
            let t = (branch as f64 + 0.5) / branches as f64;
            let from =
                start + (top - start) * (trunk / (trunk + 0.8 * crown) + t * 0.8 * crown / (trunk + 0.8 * crown));
            let yaw = TAU * branch as f64 * 0.382 + yaw;
            let rise = piece.uniform(0.0, 0.9) + 0.5 * t;
            let along =
                Vector3::new(libm::cos(yaw) * libm::cos(rise), libm::sin(yaw) * libm::cos(rise), libm::sin(rise));
            let length = crown * piece.uniform(0.3, 0.55) * (1.0 - 0.35 * t);
            let end = from + along * length;
            foliage = foliage.and(bar(SlotMapping::fit(stem), from, end, [0.0035, 0.0015]));
            for leaf_number in 0..10 {
                let s = 0.25 + 0.75 * leaf_number as f64 / 9.0;
                let turn = TAU * leaf_number as f64 * 0.382;
                let side = along.cross(&Vector3::z()).try_normalize(1e-6).unwrap_or_else(Vector3::x);
                let around = side * libm::cos(turn) + side.cross(&along) * libm::sin(turn);
                let direction = along * 0.5 + around + Vector3::z() * 0.15;
                let length = size * piece.uniform(0.7, 1.15);
                let form = LeafForm { length, width: 0.5 * length, droop: 0.6, fold: 0.25, widest: 0.45, rows: 4 };
                let slot = slots[(leaf_number + branch as usize) % 3];
                foliage = foliage.and(blade(slot, form, from + (end - from) * s, direction, Vector3::z()));
            }
        }
    }
    piece.keep(boxed(foliage));
}
