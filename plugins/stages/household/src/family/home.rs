//! Books, toys and small objects of the household.

use super::{FamilyContext, HouseholdModel, density};
use crate::material::{
    MaterialFamily, SurfaceFinish, ball as ball_print, book as book_print, hsv, remote as remote_print, vivid,
};
use crate::shape::{Lathe, Profile, SlotMapping, extrude, rounded_box, rounded_polygon, star};
use std::f64::consts::PI;
use std::sync::Arc;

pub fn book(draw: &mut FamilyContext) -> HouseholdModel {
    let width = draw.uniform(0.11, 0.2);
    let height = width * draw.uniform(1.3, 1.55);
    let thick = draw.uniform(0.012, 0.045);
    let hard = draw.form.chance(0.5);
    let (board, lip) = if hard { (0.0026, 0.0035) } else { (0.0009, 0.0004) };
    let (print, [front, spine, back]) = book_print(&mut draw.appearance, [width, height, thick], draw.photographs);
    // The edges of a cover show a strip of its print.
    let strip = |[u0, v0, u1, v1]: [f64; 4]| [u0 + 0.01 * (u1 - u0), v0, u0 + 0.02 * (u1 - u0), v1];
    let cover = |z: f64, show: usize, print: [f64; 4]| {
        let size = [width, height, board];
        let mut parts = [strip(print); 6];
        parts[show] = print;
        rounded_box(size, 0.45 * board, 1, |side| SlotMapping::fit(side as u16))
            .in_atlas(&parts)
            .translated(0.0, 0.0, z)
    };
    let top = cover(0.5 * (thick - board), 5, front);
    let bottom = cover(0.5 * (board - thick), 4, back);
    let mut parts = [strip(spine); 6];
    parts[0] = spine;
    let hinge = rounded_box([1.2 * board, height, thick], 0.4 * board, 1, |side| SlotMapping::fit(side as u16));
    let hinge = hinge.rotated_uv(0).in_atlas(&parts).translated(-0.5 * width + 0.6 * board, 0.0, 0.0);
    let pages = rounded_box([width - 2.0 * lip, height - 2.0 * lip, thick - 1.2 * board], 0.0008, 1, |_| {
        SlotMapping::tile(1, 0.05)
    });
    let shape = pages.and(top).and(bottom).and(hinge);
    let bounds = shape.bounds();
    let shape = shape.without_parts().with_part(bounds.corners().to_vec());
    let mass = width * height * thick * density::PAPER * draw.uniform(0.85, 1.1);
    let page = draw.materials.get(MaterialFamily::Cardboard, 6);
    let paper = SurfaceFinish::plain(hsv(0.12, draw.appearance.uniform(0.04, 0.16), 0.88), 0.9, 0.0).detailed(&page);
    let materials = vec![draw.sheet(&print), Arc::new(paper.named("pages"))];
    HouseholdModel::new(shape, materials, mass).friction(0.4)
}

pub fn ball(draw: &mut FamilyContext) -> HouseholdModel {
    // Table tennis, golf, tennis, rubber, soft: radius and mass at that radius.
    const BALLS: [[f64; 2]; 5] = [[0.02, 0.0027], [0.0213, 0.046], [0.033, 0.058], [0.045, 0.09], [0.06, 0.13]];
    let [usual, mass] = *draw.form.pick(&BALLS).unwrap_or(&BALLS[2]);
    let factor = draw.uniform(0.95, 1.08);
    let r = usual * factor;
    let steps = 24;
    let outline = (1..=steps).fold(Profile::at(0.0, -r), |outline, i| {
        let (sin, cos) = libm::sincos(PI * f64::from(i) / f64::from(steps));
        outline.to(if i == steps { 0.0 } else { r * sin }, -r * cos, SlotMapping::fit(0))
    });
    let shape = Lathe::new(&outline).segments(48).solid();
    let texture = ball_print(&mut draw.appearance);
    let material = SurfaceFinish::printed(texture, draw.appearance.uniform(0.2, 0.8));
    let material = if draw.appearance.chance(0.5) {
        let detail = draw.material(MaterialFamily::Leather);
        material.detailed(&detail)
    } else {
        material
    };
    HouseholdModel::new(shape, vec![Arc::new(material.named("ball"))], mass * factor * factor).friction(0.6)
}

pub fn block(draw: &mut FamilyContext) -> HouseholdModel {
    let edge = draw.uniform(0.028, 0.042);
    let grain = SlotMapping::tile(0, 0.35);
    let bevel = 0.0012;
    let h = edge * draw.uniform(0.5, 1.0);
    let shape = match draw.form.below(6) {
        0 => rounded_box([edge; 3], 0.002, 2, |_| grain),
        1 => rounded_box([edge * draw.uniform(1.8, 3.0), edge, edge * draw.uniform(0.4, 1.0)], 0.002, 2, |_| grain),
        2 => {
            let (r, h) = (0.5 * edge, edge * draw.uniform(0.8, 2.0));
            let outline =
                Profile::at(0.0, 0.0).to(r, 0.0, grain).round(0.0015).to(r, h, grain).round(0.0015).to(0.0, h, grain);
            Lathe::new(&outline).segments(48).solid()
        }
        3 => {
            let wide = edge * draw.uniform(1.2, 2.0);
            let roof = rounded_polygon(&[[-0.5 * wide, 0.0], [0.5 * wide, 0.0], [0.0, 0.6 * wide]], 0.0015);
            extrude(&roof, [0.0, h], bevel, grain, grain).rotated(0, 90.0)
        }
        4 => {
            let tips = draw.form.integer(5, 8) as usize;
            let (inner, outer) = (edge * draw.uniform(0.45, 0.6), edge * draw.uniform(0.8, 1.0));
            extrude(&rounded_polygon(&star(tips, inner, outer), 0.002), [0.0, 0.6 * h], bevel, grain, grain)
        }
        _ => {
            // An arch: a bar with a round gate.
            let (half, gate) = (edge * draw.uniform(0.9, 1.2), 0.5 * edge);
            let mut arch = vec![[-half, 0.0]];
            for i in 0..=16 {
                let (sin, cos) = libm::sincos(PI * (1.0 - f64::from(i) / 16.0));
                arch.push([gate * cos, gate * sin]);
            }
            arch.extend([[half, 0.0], [half, 1.6 * gate], [-half, 1.6 * gate]]);
            extrude(&arch, [0.0, h], bevel, grain, grain).rotated(0, 90.0)
        }
    };
    let mass = shape.volume() * density::WOOD * draw.uniform(0.8, 1.15);
    let material = if draw.appearance.chance(0.4) {
        draw.material(MaterialFamily::Timber)
    } else {
        let color = vivid(&mut draw.appearance);
        let detail = draw.material(MaterialFamily::Timber);
        Arc::new(
            SurfaceFinish::plain(color, draw.appearance.uniform(0.25, 0.55), 0.0)
                .detailed(&detail)
                .named("painted wood"),
        )
    };
    HouseholdModel::new(shape, vec![material], mass).friction(0.5)
}

pub fn sponge(draw: &mut FamilyContext) -> HouseholdModel {
    let size = [draw.uniform(0.085, 0.115), draw.uniform(0.06, 0.075), draw.uniform(0.02, 0.035)];
    let rough = draw.uniform(0.006, 0.009);
    let foam = rounded_box(size, 0.004, 2, |_| SlotMapping::tile(0, 0.12));
    let pad = rounded_box([size[0] - 0.001, size[1] - 0.001, rough], 0.0015, 2, |_| SlotMapping::tile(1, 0.05));
    let pad = pad.translated(0.0, 0.0, 0.5 * size[2] + 0.35 * rough);
    let shape = foam.dense(draw.uniform(40.0, 140.0)).and(pad.dense(180.0));
    let mass = shape.moments().total;
    let detail = draw.materials.get(MaterialFamily::Concrete, 6);
    let fibers = draw.materials.get(MaterialFamily::Carpet, 6);
    let color = vivid(&mut draw.appearance);
    let pad_color = hsv(draw.appearance.uniform(0.25, 0.62), 0.7, draw.appearance.uniform(0.2, 0.45));
    let foam_material = SurfaceFinish::plain(color, 0.95, 0.0).detailed(&detail).named("foam");
    let pad_material = SurfaceFinish::plain(pad_color, 0.95, 0.0).detailed(&fibers).named("scourer");
    HouseholdModel::new(shape, vec![Arc::new(foam_material), Arc::new(pad_material)], mass).friction(0.7)
}

pub fn remote(draw: &mut FamilyContext) -> HouseholdModel {
    let (width, length, h) = (draw.uniform(0.036, 0.052), draw.uniform(0.13, 0.21), draw.uniform(0.015, 0.024));
    let taper = draw.uniform(0.0, 0.12);
    let mapping = |side: usize| if side == 5 { SlotMapping::fit(0) } else { SlotMapping::tile(1, 0.1) };
    let shape = rounded_box([width, length, h], 0.4 * h, 3, mapping).bent(|mut p| {
        // Narrower at the foot.
        p.x *= 1.0 - taper * (0.5 - p.y / length);
        p
    });
    let mass = shape.volume() * draw.uniform(550.0, 900.0);
    let texture = remote_print(&mut draw.appearance, length / width);
    let color = hsv(draw.appearance.unit(), 0.05, draw.appearance.uniform(0.06, 0.25));
    let materials = vec![draw.printed(texture, [0.35, 0.6]), draw.plastic_of("case", color)];
    HouseholdModel::new(shape, materials, mass).friction(0.45)
}
