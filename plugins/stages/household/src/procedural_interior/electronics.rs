//! Screens, keyboards, laptops and loudspeakers, and a desk that carries them.

use super::piece::Piece;
use super::solids::{Softness, rounded, soft_box, spline, tube};
use super::tones;
use crate::material::{MaterialFamily, hsv, screen_image};
use crate::shape::{Lathe, Profile, SlotMapping, SolidShape, loft};
use syntable_model::geometry::Point3;
use syntable_model::scene::Color;

/// A monitor or television on its stand.
pub fn screen(piece: &mut Piece) {
    let is_television = piece.form.chance(0.5);
    display(piece, is_television);
}

/// A display with its stand: its lowest point is at z = 0. Returns its width.
fn display(piece: &mut Piece, is_television: bool) -> f64 {
    let diagonal = if is_television { piece.uniform(0.8, 1.5) } else { piece.uniform(0.53, 0.82) };
    let aspect =
        if is_television { 16.0 / 9.0 } else { *piece.form.pick(&[1.6, 1.778, 1.778, 2.33]).unwrap_or(&1.778) };
    let tall = diagonal / libm::sqrt(1.0 + aspect * aspect);
    let (a, b) = (0.5 * tall * aspect, 0.5 * tall);
    let color = if is_television { hsv(0.6, 0.05, 0.04) } else { tones::case(&mut piece.paint) };
    let case = piece.tinted(MaterialFamily::Plastic, color, 0.4);
    let stand = if piece.paint.chance(0.5) { case } else { piece.metal() };
    let glass = glass(piece, aspect);
    let bezel = piece.uniform(0.004, 0.016);
    let chin = bezel + if piece.form.chance(0.4) { piece.uniform(0.004, 0.02) } else { 0.0 };
    let (thick, low) =
        (piece.uniform(0.02, 0.035), if is_television { piece.uniform(0.04, 0.08) } else { piece.uniform(0.08, 0.16) });
    let tilt = if is_television { 0.0 } else { piece.uniform(0.0, 8.0) };
    let middle = low + chin + b;
    // The panel around the origin, tilted back with its top.
    let mut panel =
        rounded([-a - bezel, 0.0, -b - chin], [a + bezel, thick, b + bezel], 0.003, |_| SlotMapping::fit(case));
    panel = panel.box_mapped(0.3, 0);
    let bulk = rounded([-0.55 * a, 0.8 * thick, -0.7 * b], [0.55 * a, thick + 0.025, 0.4 * b], 0.01, |_| {
        SlotMapping::fit(case)
    });
    let side = |side| if side == 2 { SlotMapping::fit(glass) } else { SlotMapping::tile(case, 0.3) };
    let pane = rounded([-a, -0.0012, -b], [a, 0.004, b], 0.0006, side);
    let all = panel.and(bulk.box_mapped(0.3, 0)).and(pane).rotated(0, -tilt);
    piece.keep(all.translated(0.0, 0.0, middle));
    if is_television && piece.form.chance(0.6) {
        // Two feet near the ends.
        for side in [-1.0, 1.0] {
            let x = side * 0.7 * a;
            for y in [-0.11, 0.12] {
                piece.bar(stand, [x, y, 0.0], [x, 0.5 * thick, middle - b + 0.02], [0.007, 0.011]);
            }
        }
    } else {
        let wide = 0.5 * if is_television { 0.5 * a } else { 0.11_f64.max(0.3 * a) };
        if piece.form.chance(0.5) {
            piece.block(stand, [-wide, -0.09, 0.0], [wide, 0.13, 0.012], 0.004);
        } else {
            let side = SlotMapping::fit(stand);
            let disc =
                Profile::at(0.0, 0.0).to(0.115, 0.0, side).to(0.113, 0.01, side).round(0.003).to(0.0, 0.014, side);
            piece.join(stand, Lathe::new(&disc).segments(36).solid().translated(0.0, 0.03, 0.0));
        }
        piece.block(stand, [-0.03, thick + 0.012, 0.005], [0.03, thick + 0.035, middle], 0.005);
    }
    2.0 * a
}

/// The glass of a screen: dark, or lit with an image.
fn glass(piece: &mut Piece, aspect: f64) -> u16 {
    let image = screen_image(&mut piece.paint, aspect, piece.photographs);
    let gloss = piece.paint.uniform(0.05, 0.3);
    let nits = piece.paint.uniform(80.0, 300.0) as f32;
    let light = if piece.form.chance(0.5) {
        Color { factor: [nits; 3], ..Color::texture(image) }
    } else {
        Color::constant([0.0; 3])
    };
    piece.emissive([0.018, 0.018, 0.02], gloss, light)
}

/// A keyboard.
pub fn keyboard(piece: &mut Piece) {
    let color = tones::case(&mut piece.paint);
    let case = piece.tinted(MaterialFamily::Plastic, color, 0.45);
    let keys = if piece.paint.chance(0.6) {
        case
    } else {
        let color = tones::case(&mut piece.paint);
        piece.tinted(MaterialFamily::Plastic, color, 0.5)
    };
    let pitch = 0.019;
    let full = piece.form.chance(0.6);
    let columns = if full { 21.5 } else { 15.0 };
    let (a, b) = (0.5 * pitch * columns + 0.008, 0.5 * pitch * 6.3 + 0.006);
    let rise = piece.uniform(0.0, 5.0);
    let mut all = rounded([-a, -b, 0.0], [a, b, 0.014], 0.004, |_| SlotMapping::fit(case)).box_mapped(0.3, 0);
    let x0 = -0.5 * pitch * columns;
    for row in 0..6 {
        let y = b - 0.006 - pitch * (row as f64 + 0.5 + if row > 0 { 0.3 } else { 0.0 });
        for (from, wide) in widths(row, full) {
            all = all.and(key(keys, [x0 + pitch * from, y], [pitch * wide, pitch], 0.0135, 0.006));
        }
    }
    piece.cluster(all.rotated(0, rise));
}

/// Left edges and widths of the keys of a row, in pitches.
fn widths(row: usize, full: bool) -> Vec<(f64, f64)> {
    let main: &[f64] = match row {
        0 => &[1.0, -1.0, 1.0, 1.0, 1.0, 1.0, -0.5, 1.0, 1.0, 1.0, 1.0, -0.5, 1.0, 1.0, 1.0, 1.0],
        1 => &[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.0],
        2 => &[1.5, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.5],
        3 => &[1.75, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.25],
        4 => &[2.25, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.75],
        _ => &[1.25, 1.25, 1.25, 6.25, 1.25, 1.25, 1.25, 1.25],
    };
    let mut keys = Vec::new();
    let mut x = 0.0;
    for wide in main {
        if *wide > 0.0 {
            keys.push((x, *wide));
        }
        x += wide.abs();
    }
    keys.retain(|(x, wide)| x + wide < 15.01);
    if full && row > 0 {
        let middle: &[f64] = match row {
            1 | 2 | 5 => &[0.0, 1.0, 2.0],
            4 => &[1.0],
            _ => &[],
        };
        keys.extend(middle.iter().map(|x| (15.25 + 0.66 * x, 0.66)));
        keys.extend([0.0, 1.0, 2.0, 3.0].map(|x| (17.5 + x, 1.0)));
    }
    keys
}

/// A key cap that narrows towards its top, hollow enough to look pressed by fingers.
fn key(slot: u16, [x, y]: [f64; 2], [wide, deep]: [f64; 2], z: f64, tall: f64) -> SolidShape {
    let gap = 0.0008;
    let ring = |inset: f64, z: f64| {
        let (x0, x1) = (x + gap + inset, x + wide - gap - inset);
        let (y0, y1) = (y - 0.5 * deep + gap + inset, y + 0.5 * deep - gap - inset);
        vec![Point3::new(x0, y0, z), Point3::new(x1, y0, z), Point3::new(x1, y1, z), Point3::new(x0, y1, z)]
    };
    loft(&[ring(0.0, z - 0.001), ring(0.0, z + 0.3 * tall), ring(0.0018, z + tall)], SlotMapping::tile(slot, 0.2), 4)
}

/// An open laptop.
pub fn laptop(piece: &mut Piece) {
    let case = match piece.paint.below(3) {
        0 => piece.surface(&[MaterialFamily::BrushedMetal]),
        1 => piece.plain("aluminum", hsv(0.6, 0.02, 0.7), 0.35),
        _ => piece.plain("case", hsv(0.6, 0.05, 0.06), 0.45),
    };
    let keys = piece.plain("keys", [0.03; 3], 0.5);
    let (a, b) = (0.5 * piece.uniform(0.3, 0.37), 0.5 * piece.uniform(0.21, 0.25));
    let glass = glass(piece, a / b);
    let open = piece.uniform(8.0, 32.0);
    piece.block(case, [-a, -b, 0.0], [a, b, 0.014], 0.004);
    let mut caps = SolidShape::default();
    let pitch = 0.0185;
    for row in 0..5 {
        let y = b - 0.03 - pitch * row as f64;
        let mut x = -7.0 * pitch;
        let widths: &[f64] = if row == 4 { &[1.0, 1.0, 1.25, 5.5, 1.25, 1.0, 1.0, 1.0, 1.0] } else { &[1.0; 14] };
        for wide in widths {
            caps = caps.and(key(keys, [x, y], [pitch * wide, pitch], 0.0142, 0.0014));
            x += pitch * wide;
        }
    }
    piece.cluster(caps);
    piece.board(keys, [-0.055, -b + 0.012, 0.0135], [0.055, -b + 0.078, 0.0142]);
    let lid = rounded([-a, 0.0, 0.0], [a, 0.007, 2.0 * b], 0.003, |_| SlotMapping::fit(case)).box_mapped(0.3, 0);
    let side = |side| if side == 2 { SlotMapping::fit(glass) } else { SlotMapping::tile(keys, 0.3) };
    let pane = rounded([-a + 0.007, -0.0006, 0.014], [a - 0.007, 0.003, 2.0 * b - 0.007], 0.0004, side);
    piece.keep(lid.and(pane).rotated(0, -open).translated(0.0, b - 0.004, 0.012));
    piece.bar(keys, [-0.7 * a, b - 0.002, 0.012], [0.7 * a, b - 0.002, 0.012], [0.006; 2]);
}

/// A loudspeaker box with its drivers.
pub fn loudspeaker(piece: &mut Piece) {
    let body = if piece.paint.chance(0.6) { piece.wood(0.5) } else { piece.plain("case", [0.03; 3], 0.4) };
    let cone = piece.plain("cone", hsv(0.6, 0.05, 0.05), 0.6);
    let trim = piece.metal();
    let is_tall = piece.form.chance(0.5);
    let a = 0.5 * piece.uniform(0.16, 0.24);
    let height = if is_tall { piece.uniform(0.8, 1.1) } else { a * piece.uniform(2.9, 3.6) };
    let b = a * piece.uniform(1.1, 1.5);
    piece.block(body, [-a, -b, 0.012], [a, b, height], 0.005);
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let at = [x * (a - 0.025), y * (b - 0.025)];
        piece.bar(cone, [at[0], at[1], 0.0], [at[0], at[1], 0.014], [0.012; 2]);
    }
    let mut z = height - 0.2 * a - 0.04;
    let mut drivers = vec![0.28 * a.max(0.08)];
    drivers.extend(vec![0.78 * a; if is_tall { piece.form.integer(2, 3) as usize } else { 1 }]);
    for radius in drivers {
        z -= radius;
        let (rim, dome) = (SlotMapping::fit(trim), SlotMapping::fit(cone));
        let outline = Profile::at(0.0, -0.004)
            .to(radius, -0.004, rim)
            .to(radius, 0.004, rim)
            .to(0.94 * radius, 0.006, rim)
            .to(0.9 * radius, 0.003, dome)
            .to(0.84 * radius, 0.007, dome)
            .to(0.78 * radius, 0.003, dome)
            .to(0.36 * radius, -0.003, dome)
            .to(0.3 * radius, 0.002, dome)
            .to(0.0, 0.006, dome);
        let driver = Lathe::new(&outline).segments(36).solid();
        piece.keep(driver.rotated(0, 90.0).translated(0.0, -b, z));
        z -= radius + 0.02;
    }
    piece.carries([0.0, 0.0, height], [0.8 * a, 0.8 * b]);
}

/// A desk against a wall with a monitor or laptop, a keyboard, a mouse and cables.
pub fn desk(piece: &mut Piece) {
    let top = if piece.paint.chance(0.7) { piece.wood(0.35) } else { piece.surface(&[MaterialFamily::Laminate]) };
    let legs = piece.metal();
    let dark = piece.plain("cable", [0.03; 3], 0.5);
    let (a, b, height) = (0.5 * piece.uniform(1.0, 1.6), 0.5 * piece.uniform(0.6, 0.75), piece.uniform(0.71, 0.76));
    piece.block(top, [-a, -b, height - 0.026], [a, b, height], 0.003);
    for side in [-1.0, 1.0] {
        let x = side * (a - 0.06);
        for y in [-b + 0.05, b - 0.05] {
            piece.block(legs, [x - 0.02, y - 0.02, 0.0], [x + 0.02, y + 0.02, height - 0.024], 0.003);
        }
        piece.block(legs, [x - 0.019, -b + 0.06, height - 0.06], [x + 0.019, b - 0.06, height - 0.024], 0.003);
    }
    let x = piece.uniform(-0.25, 0.25) * a;
    if piece.form.chance(0.75) {
        let yaw = piece.uniform(-8.0, 8.0);
        piece.placed([x, b - 0.22, height], yaw, |piece| {
            display(piece, false);
        });
        let (shift, yaw) = (piece.uniform(-0.05, 0.05), piece.uniform(-6.0, 6.0));
        piece.placed([x + shift, -b + 0.2, height], yaw, keyboard);
        let at = Point3::new(x + 0.3, -b + 0.2, height);
        let mouse =
            soft_box(dark, [0.062, 0.11, 0.034], Softness { corner: 0.03, edge: 0.014, bulge: 0.005, bow: 0.003 });
        piece.join(dark, mouse.translated(at.x, at.y, at.z + 0.017));
        let path = [
            Point3::new(x, b - 0.15, height + 0.02),
            Point3::new(x + 0.04, b - 0.02, height + 0.008),
            Point3::new(x + 0.06, b + 0.004, height - 0.1),
            Point3::new(x + 0.12, b - 0.02, 0.25),
            Point3::new(x + 0.2, b - 0.05, 0.01),
        ];
        piece.join(dark, tube(SlotMapping::fit(dark), &spline(&path, 5), 6, 5, |_| 0.004));
    } else {
        let yaw = piece.uniform(-20.0, 20.0);
        piece.placed([x, -b + 0.24, height], yaw, laptop);
    }
    let side = if x > 0.0 { -1.0 } else { 1.0 };
    piece.carries([side * 0.68 * a, 0.0, height], [0.25 * a, 0.8 * b]);
}
