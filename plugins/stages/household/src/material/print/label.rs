//! Labels around cans, jars, bottles and tubes.

use super::design::Design;
use super::front::front;
use super::relief::ReliefMap;
use super::scheme::Stock;
use super::sheet::{PrintedSheet, texels_per_m, wear};
use crate::material::photograph::Photograph;
use crate::material::{MaterialCanvas, PrintFinish};
use syntable_model::random::Stream;
use syntable_model::scene::Wrap;

/// The surface that a label is on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LabelKind {
    /// Paper or film on glass or plastic.
    Glued,
    /// Paper on a tin, which has ribs and dents.
    Tin,
    /// Ink on the metal of a drink can.
    Metal,
}

/// A label of some circumference and height, meters.
pub fn label(
    stream: &mut Stream,
    kind: LabelKind,
    [circumference, height]: [f64; 2],
    photographs: &[Photograph],
) -> PrintedSheet {
    let scale = texels_per_m([circumference, height]);
    let mut design = Design::draw(stream, scale, photographs);
    if kind == LabelKind::Metal {
        design.ground_finish = PrintFinish::foil(stream.uniform(0.16, 0.34) as f32);
        design.scheme.stock = Stock::Foil;
    }
    let mut canvas =
        MaterialCanvas::new((circumference * scale).ceil() as usize, (height * scale).ceil() as usize, [0.9; 3]);
    let [w, h] = canvas.size();
    canvas.set_finish(design.finish);
    design.area(&mut canvas, [0.0, 0.0, w, h], design.scheme.ground);
    let facts = [0.68 * w, 0.0, w, h];
    if stream.chance(0.35) {
        // Twice the same show side.
        for left in [0.0, 0.5 * w] {
            front(&design, &mut canvas, &mut stream.child("front"), [left, 0.0, left + 0.36 * w, h]);
        }
        design.side(&mut canvas, stream, [0.36 * w, 0.0, 0.5 * w, h]);
        design.facts(&mut canvas, stream, [0.86 * w, 0.0, w, h]);
    } else {
        // Wide designs bend around half of the body.
        let edge = (0.42 * w).max((0.9 * h).min(0.62 * w));
        front(&design, &mut canvas, stream, [0.34 * w - 0.5 * edge, 0.0, 0.34 * w + 0.5 * edge, h]);
        design.facts(&mut canvas, stream, facts);
    }
    if stream.chance(0.4) {
        let before = canvas.set_finish(design.scheme.ornament);
        let thick = stream.uniform(0.015, 0.05) as f32 * h;
        for y in [0.02 * h, 0.98 * h - thick] {
            canvas.rect([-1.0, y, w + 1.0, y + thick], 0.0, design.scheme.accent);
        }
        canvas.set_finish(before);
    }
    let mut relief = ReliefMap::new(&canvas);
    match kind {
        LabelKind::Glued => {
            let damage = stream.uniform(0.0, 0.5);
            relief.handle(stream, damage);
        }
        LabelKind::Tin => {
            let damage = stream.uniform(0.2, 1.3);
            relief.handle(stream, damage);
            if stream.chance(0.5) {
                // Rolled ribs around the middle.
                let period = (0.0045 * scale) as f32;
                relief.add([0.0, 0.25 * h, w, 0.75 * h], |_, y| {
                    0.1 * period * libm::cosf(std::f32::consts::TAU * (y - 0.5 * h) / period)
                });
            }
        }
        LabelKind::Metal => {
            let damage = stream.uniform(0.0, 1.2);
            relief.handle(stream, damage);
        }
    }
    // The overlap of a paper label.
    let seam = if kind == LabelKind::Metal { Vec::new() } else { vec![[[1.5, 0.0], [1.5, h]]] };
    wear(&mut canvas, &mut relief, stream, design.scheme.stock, &seam);
    PrintedSheet::bake(&canvas, &relief, Wrap::Repeat)
}
