//! Armchairs, sofas, beds and cushions.

use super::piece::Piece;
use super::solids::{Softness, boxed, pillow, soft_box};
use super::tones;
use crate::family::Crumple;
use crate::material::MaterialFamily;
use crate::shape::{SlotMapping, SolidShape, thick_sheet};
use syntable_model::geometry::{Point3, Vector3};

/// A cloth for large cushions.
fn cover(piece: &mut Piece) -> u16 {
    use MaterialFamily::{Fabric, Knit, Leather, Velvet};
    match piece.paint.below(6) {
        0 => piece.surface(&[Leather]),
        _ => {
            let color = tones::cloth(&mut piece.paint);
            piece.cloth_of(color, &[Fabric, Fabric, Velvet, Knit])
        }
    }
}

/// A cushion with wrinkles, moved to a place.
fn padded(piece: &mut Piece, slot: u16, size: [f64; 3], round: f64, wrinkle: f64) -> SolidShape {
    let stream = &mut piece.form;
    let folds = Crumple::draw(stream, 5, [0.12, 0.35], wrinkle);
    let fine = Crumple::draw(stream, 4, [0.04, 0.09], 0.25 * wrinkle);
    soft_box(slot, size, Softness::of(round)).bent(|p| p + folds.at(p) + fine.at(p))
}

/// An armchair.
pub fn armchair(piece: &mut Piece) {
    let seats = piece.uniform(0.52, 0.64);
    couch(piece, 1, seats);
}

/// A sofa of two or three seats.
pub fn sofa(piece: &mut Piece) {
    let (count, wide) = (piece.form.integer(2, 3) as usize, piece.uniform(0.55, 0.75));
    couch(piece, count, wide);
}

fn couch(piece: &mut Piece, seats: usize, wide: f64) {
    let cloth = cover(piece);
    let legs = if piece.paint.chance(0.6) { piece.wood(0.1) } else { piece.metal() };
    let has_arms = seats > 1 || piece.form.chance(0.8);
    let arm = if has_arms { piece.uniform(0.08, 0.22) } else { 0.004 };
    let (a, b) = (0.5 * wide * seats as f64, 0.5 * piece.uniform(0.75, 0.92));
    let (low, seat, top) = (piece.uniform(0.08, 0.18), piece.uniform(0.4, 0.46), piece.uniform(0.72, 0.92));
    let round = piece.uniform(0.03, 0.06);
    let back = piece.uniform(0.1, 0.18);
    let mut blocks: Vec<([f64; 3], [f64; 3])> = vec![
        ([-a - 0.5 * arm, -b + 0.02, low], [a + 0.5 * arm, b - 0.02, seat - 0.13]),
        ([-a - arm, b - back, low], [a + arm, b, top - 0.06]),
    ];
    let rest = piece.uniform(0.54, 0.66);
    if has_arms {
        for side in [-1.0, 1.0] {
            let [x0, x1] = [side * a, side * (a + arm)];
            blocks.push(([x0.min(x1), -b, low], [x0.max(x1), b - 0.03, rest]));
        }
    }
    for (low, high) in blocks {
        let size: [f64; 3] = std::array::from_fn(|k| high[k] - low[k]);
        let middle: [f64; 3] = std::array::from_fn(|k| 0.5 * (low[k] + high[k]));
        let block = padded(piece, cloth, size, round.min(0.3 * size[2]).min(0.45 * size[0]), 0.003);
        piece.join(cloth, block.translated(middle[0], middle[1], middle[2]));
    }
    for seat_number in 0..seats {
        let x = -a + wide * (seat_number as f64 + 0.5);
        let deep = 2.0 * b - back + 0.01;
        let cushion = padded(piece, cloth, [wide - 0.004, deep, 0.16], 0.05, 0.006);
        piece.join(cloth, cushion.translated(x, -0.5 * back - 0.01, seat - 0.06));
        let (tall, lean) = (top - seat + 0.03, piece.uniform(9.0, 18.0));
        let cushion = padded(piece, cloth, [wide - 0.01, tall, 0.17], 0.06, 0.009);
        let cushion = cushion.rotated(0, 90.0 - lean).translated(x, b - back - 0.1, seat + 0.5 * tall);
        piece.join(cloth, cushion);
    }
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let at = [x * (a + 0.5 * arm - 0.05), y * (b - 0.08)];
        piece.bar(legs, [at[0] + 0.02 * x, at[1] + 0.02 * y, 0.0], [at[0], at[1], low + 0.03], [0.014, 0.022]);
    }
    piece.carries([0.0, -0.5 * back, seat + 0.03], [0.8 * a, 0.6 * b]);
    // One on each side, so that they do not overlap.
    for number in 0..piece.form.below(seats as u64 + 2).min(seats.min(2) as u64) {
        let side = if number % 2 == 0 { -1.0 } else { 1.0 };
        let x = side * (a - 0.24) * piece.uniform(0.6, 1.0) * if seats > 1 { 1.0 } else { 0.3 };
        let edge = piece.uniform(0.36, 0.48);
        throw_pillow(piece, edge, |shape| shape.rotated(0, -28.0).translated(x, -0.02, seat + 0.5 * edge + 0.01));
    }
    if piece.form.chance(0.35) {
        blanket(piece, [if has_arms { a + 0.5 * arm } else { 0.6 * a }, b, 0.5 * arm], [rest, top], has_arms);
    }
}

/// A loose cushion of some edge, moved by a function.
fn throw_pillow(piece: &mut Piece, edge: f64, place: impl Fn(SolidShape) -> SolidShape) {
    use MaterialFamily::{Fabric, Knit, Quilt, Tablecloth, Velvet};
    let cloth =
        if piece.paint.chance(0.3) { piece.surface(&[Fabric, Knit, Tablecloth, Velvet, Quilt]) } else { piece.cloth() };
    let tall = edge * if piece.form.chance(0.25) { 0.66 } else { 1.0 };
    let (thick, turn) = (edge * piece.uniform(0.28, 0.42), piece.uniform(-14.0, 14.0));
    let folds = Crumple::draw(&mut piece.form, 6, [0.08, 0.3], 0.006);
    let shape = pillow(SlotMapping::tile(cloth, piece.tile_m(cloth)), [edge, tall, thick]);
    let shape = shape.bent(|p| p + folds.at(p)).rotated(1, turn);
    piece.keep(place(shape));
}

/// A blanket over an arm, or over the back.
fn blanket(piece: &mut Piece, [x, b, half]: [f64; 3], [rest, top]: [f64; 2], over_arm: bool) {
    use MaterialFamily::{Fabric, Knit};
    let cloth = if piece.paint.chance(0.5) {
        piece.surface(&[Fabric, Knit])
    } else {
        let color = tones::cloth(&mut piece.paint);
        piece.cloth_of(color, &[Knit, Fabric])
    };
    let side = if piece.form.chance(0.5) { 1.0 } else { -1.0 };
    let (wide, drop) = (piece.uniform(0.3, 0.45), piece.uniform(0.22, 0.36));
    let folds = Crumple::draw(&mut piece.form, 6, [0.1, 0.4], 0.008);
    let (height, half) = if over_arm { (rest, half + 0.012) } else { (top - 0.04, 0.1) };
    let at = |[u, v]: [f64; 2]| {
        // Over a bar of half width `half`: down one side, over, and down the other.
        let total = 2.0 * drop + 2.0 * half;
        let s = v * total;
        let (across, z) = if s < drop {
            (-half - 0.006, height - (drop - s))
        } else if s < drop + 2.0 * half {
            let t = (s - drop) / (2.0 * half);
            (-half + 2.0 * half * t, height + 0.014 + 0.01 * libm::sin(std::f64::consts::PI * t))
        } else {
            (half + 0.006, height - (s - drop - 2.0 * half))
        };
        let along = wide * (u - 0.5);
        let p = Point3::new(along, across, z);
        let p = p + folds.at(p) * if z > height { 0.3 } else { 1.0 };
        let normal = if s < drop {
            -Vector3::y()
        } else if s < drop + 2.0 * half {
            Vector3::z()
        } else {
            Vector3::y()
        };
        [p + normal * 0.004, p - normal * 0.002]
    };
    let sheet = thick_sheet([14, 30], [14, 30], [SlotMapping::tile(cloth, 0.35); 3], at);
    let sheet = if over_arm {
        sheet.rotated(2, 90.0).translated(side * x, -0.1, 0.0)
    } else {
        sheet.translated(side * x, b - 0.07, 0.0)
    };
    piece.cluster(sheet);
}

/// A bed with a headboard, a mattress, a duvet and pillows; its headboard is at the back.
pub fn bed(piece: &mut Piece) {
    let wood = piece.wood(0.35);
    let linen = {
        let color = tones::cloth(&mut piece.paint);
        let pale = crate::material::mix(color, [0.92, 0.91, 0.88], 0.6);
        piece.cloth_of(pale, &[MaterialFamily::Fabric])
    };
    let duvet = match piece.paint.below(3) {
        0 => linen,
        1 => piece.surface(&[MaterialFamily::Tablecloth, MaterialFamily::Fabric]),
        _ => piece.cloth(),
    };
    let (a, b) = (0.5 * *piece.form.pick(&[0.9, 1.4, 1.6]).unwrap_or(&0.9), 1.0);
    let (rail, head) = (piece.uniform(0.26, 0.36), piece.uniform(0.8, 1.15));
    piece.block(wood, [-a - 0.03, b, 0.0], [a + 0.03, b + 0.045, head], 0.008);
    piece.block(wood, [-a - 0.03, -b - 0.03, 0.14], [a + 0.03, b, rail], 0.006);
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0)] {
        let at = [x * (a - 0.05), y * (b - 0.05)];
        piece.block(wood, [at[0] - 0.035, at[1] - 0.035, 0.0], [at[0] + 0.035, at[1] + 0.035, 0.15], 0.004);
    }
    let mattress = padded(piece, linen, [2.0 * a, 2.0 * b, 0.22], 0.05, 0.003);
    piece.join(linen, mattress.translated(0.0, 0.0, rail + 0.09));
    let top = rail + 0.2;
    let folds = Crumple::draw(&mut piece.form, 9, [0.12, 0.5], 0.022);
    let fine = Crumple::draw(&mut piece.form, 6, [0.06, 0.14], 0.006);
    let end = piece.uniform(0.25, 0.5);
    let at = |[u, v]: [f64; 2]| {
        let reach = a + 0.16;
        let s = (2.0 * u - 1.0) * reach;
        // Beyond the edges of the mattress the duvet hangs down.
        let over = (s.abs() - a).max(0.0);
        let x = s.clamp(-a - 0.03, a + 0.03);
        let y = -b - 0.02 + v * (2.0 * b - end);
        let p = Point3::new(x, y, top + 0.03 - 1.4 * over);
        let p = p + folds.at(p) + fine.at(p);
        // On the sides, its thickness is across.
        let hangs = (over / 0.06).min(1.0);
        let normal = Vector3::new(s.signum() * hangs, 0.0, 1.0 - 0.9 * hangs).normalize();
        [p + normal * 0.035, p - normal * 0.02]
    };
    piece.keep(thick_sheet([34, 40], [34, 40], [SlotMapping::tile(duvet, piece.tile_m(duvet)); 3], at));
    let pillows = if a > 0.6 { 2 } else { 1 };
    for number in 0..pillows {
        let x = (number as f64 - 0.5 * (pillows - 1) as f64) * a;
        let folds = Crumple::draw(&mut piece.form, 6, [0.1, 0.35], 0.012);
        let (lean, turn) = (piece.uniform(60.0, 80.0), piece.uniform(-6.0, 6.0));
        let shape = pillow(SlotMapping::tile(linen, piece.tile_m(linen)), [0.72, 0.46, 0.17]);
        let shape = shape.bent(|p| p + folds.at(p)).rotated(0, -lean).rotated(2, turn);
        piece.keep(shape.translated(x, b - 0.27, top + 0.14));
    }
    piece.carries([0.0, -0.3, top + 0.08], [0.7 * a, 0.5 * b]);
}

/// One to three cushions lying on each other.
pub fn cushion(piece: &mut Piece) {
    let mut z = 0.0;
    for number in 0..*piece.form.pick(&[1, 1, 2, 3]).unwrap_or(&1) {
        let edge = piece.uniform(0.38, 0.56);
        let yaw = piece.uniform(-25.0, 25.0);
        let lean = if number == 0 { 0.0 } else { piece.uniform(-4.0, 4.0) };
        throw_pillow(piece, edge, |shape| {
            let flat = shape.rotated(0, -90.0).rotated(1, lean).rotated(2, yaw);
            let floor = flat.bounds().min.z;
            let level = flat.translated(0.0, 0.0, z - floor);
            boxed(level)
        });
        z += 0.3 * edge * 0.8;
    }
}
