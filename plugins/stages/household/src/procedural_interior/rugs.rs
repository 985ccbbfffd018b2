//! Rugs.

use super::piece::Piece;
use super::solids::rounded;
use super::tones;
use crate::material::MaterialFamily;
use crate::shape::{Lathe, Profile, SlotMapping, SolidShape};

/// A rug of pile or cloth: round, or a rectangle. Some rectangles have a border, and some have fringes.
pub fn rug(piece: &mut Piece) {
    use MaterialFamily::{Carpet, Fabric, Knit};
    let field = if piece.paint.chance(0.5) {
        piece.surface(&[Carpet, Fabric, Knit])
    } else {
        let color = tones::cloth(&mut piece.paint);
        piece.cloth_of(color, &[Carpet, Fabric])
    };
    let thick = piece.uniform(0.005, 0.016);
    if piece.form.chance(0.25) {
        let radius = piece.uniform(0.4, 0.85);
        let side = SlotMapping::fit(field);
        let disc =
            Profile::at(0.0, 0.0).to(radius, 0.0, side).to(radius, thick, side).round(0.4 * thick).to(0.0, thick, side);
        piece.join(field, Lathe::new(&disc).segments(72).solid());
        return;
    }
    let (a, b) = (0.5 * piece.uniform(0.6, 1.4), 0.5 * piece.uniform(1.0, 2.1));
    if piece.form.chance(0.5) {
        let color = tones::cloth(&mut piece.paint);
        let border = piece.cloth_of(color, &[Carpet, Fabric]);
        let wide = piece.uniform(0.03, 0.14);
        piece.block(border, [-a, -b, 0.0], [a, b, thick], 0.3 * thick);
        let height = thick + 0.0015;
        piece.block(field, [wide - a, wide - b, 0.0], [a - wide, b - wide, height], 0.3 * thick);
    } else {
        piece.block(field, [-a, -b, 0.0], [a, b, thick], 0.3 * thick);
    }
    if piece.form.chance(0.4) {
        let thread = piece.tinted(Fabric, [0.78, 0.74, 0.66], 0.95);
        let long = piece.uniform(0.025, 0.06);
        for end in [-1.0, 1.0] {
            let fringe = fringe(piece, thread, [a, long]);
            piece.cluster(fringe.rotated(2, if end > 0.0 { 0.0 } else { 180.0 }).translated(0.0, end * b, 0.0));
        }
    }
}

/// Threads along x that reach in +y.
fn fringe(piece: &mut Piece, thread: u16, [half, long]: [f64; 2]) -> SolidShape {
    const GAP: f64 = 0.011;
    let count = (2.0 * half / GAP) as usize;
    (0..count).fold(SolidShape::default(), |shape, i| {
        let x = GAP * (i as f64 + 0.5) - half;
        let (reach, yaw) = (long * piece.uniform(0.8, 1.0), piece.uniform(-14.0, 14.0));
        let strand = rounded([-0.002, -0.004, 0.0005], [0.002, reach, 0.0035], 0.0, |_| SlotMapping::tile(thread, 0.1));
        shape.and(strand.rotated(2, yaw).translated(x, 0.0, 0.0))
    })
}
