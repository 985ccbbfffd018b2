//! Crockery and pans: hollow solids, open at the top. Their collision parts leave the cavity free.

use super::{FamilyContext, HouseholdModel, density, ellipse};
use crate::material::{MaterialFamily, SurfaceFinish, bands, hsv, shade, vivid};
use crate::shape::{Lathe, Profile, SlotMapping, SolidShape, SweepPath, WallCell, sweep};
use nalgebra::{Point3, Vector3};
use std::sync::Arc;
use syntable_model::scene::Material;

/// A wall of even thickness around a hollow, on a flat bottom.
pub(super) struct Hollow {
    /// The outside from the foot's edge at z = 0 up to the rim, (radius, height).
    pub(super) outside: Vec<[f64; 2]>,
    pub(super) wall: f64,
    pub(super) bottom: f64,
    /// Number of convex cells of the wall along its height, and around it.
    pub(super) cells: usize,
    pub(super) sectors: usize,
}

/// Roughness below a glaze.
const BODY: f64 = 0.5;

const OUTSIDE: SlotMapping = SlotMapping::fit(0);
const INSIDE: SlotMapping = SlotMapping::fit(1);

impl Hollow {
    pub(super) fn shape(&self) -> SolidShape {
        let inside = self.inside();
        let mut outline = Profile::at(0.0, 0.0).to(self.outside[0][0], 0.0, INSIDE).round(0.35 * self.wall);
        for (i, p) in self.outside.iter().enumerate().skip(1) {
            outline = outline.to(p[0], p[1], OUTSIDE);
            if i + 1 == self.outside.len() {
                outline = outline.round(0.45 * self.wall);
            }
        }
        // Down the inside, to where the bottom begins.
        let mut above = inside[inside.len() - 1];
        outline = outline.to(above[0], above[1], INSIDE).round(0.45 * self.wall);
        for &p in inside.iter().rev().skip(1) {
            if p[1] <= self.bottom {
                let t = (above[1] - self.bottom) / (above[1] - p[1]).max(1e-9);
                above = [above[0] + t * (p[0] - above[0]), self.bottom];
                break;
            }
            outline = outline.to(p[0], p[1], INSIDE);
            above = p;
        }
        outline = outline.to(above[0], self.bottom, INSIDE).round(1.2 * self.wall).to(0.0, self.bottom, INSIDE);
        let floor: WallCell = [[0.0, 0.0], self.outside[0], [above[0], self.bottom], [0.0, self.bottom]].to_vec();
        let last = self.outside.len() - 1;
        let cuts: Vec<usize> = (0..=self.cells).map(|i| i * last / self.cells).collect();
        let cells: Vec<WallCell> =
            cuts.windows(2).map(|cut| [&self.outside[cut[0]..=cut[1]], &inside[cut[0]..=cut[1]]].concat()).collect();
        Lathe::new(&outline).segments(48).hollow(&cells, &[floor], self.sectors)
    }

    /// The outside moved inwards by the wall's thickness, level at the rim.
    fn inside(&self) -> Vec<[f64; 2]> {
        let last = self.outside.len() - 1;
        (0..=last)
            .map(|i| {
                let (a, b) = (self.outside[i.saturating_sub(1)], self.outside[(i + 1).min(last)]);
                let (dr, dz) = (b[0] - a[0], b[1] - a[1]);
                let length = libm::hypot(dr, dz).max(1e-12);
                let [r, z] = self.outside[i];
                if i == last && dz > dr {
                    return [r - self.wall * length / dz, z];
                }
                [r - self.wall * dz / length, z + self.wall * dr / length]
            })
            .collect()
    }
}

/// A cubic Bézier curve of `steps` segments.
pub(super) fn curve(p: [[f64; 2]; 4], steps: usize) -> Vec<[f64; 2]> {
    (0..=steps)
        .map(|i| {
            let t = i as f64 / steps as f64;
            let s = 1.0 - t;
            let weights = [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t];
            std::array::from_fn(|k| weights.iter().zip(&p).map(|(w, q)| w * q[k]).sum())
        })
        .collect()
}

/// A decorated outside and a matching plain inside.
fn glazed(draw: &mut FamilyContext) -> Vec<Arc<Material>> {
    let outside = draw.printed_crockery();
    let inside = match draw.appearance.below(3) {
        0 => hsv(0.1, 0.05, 0.93),
        1 => vivid(&mut draw.appearance),
        _ => hsv(0.1, 0.12, draw.appearance.uniform(0.5, 0.9)),
    };
    let gloss = draw.appearance.uniform(0.06, 0.25);
    vec![outside, Arc::new(SurfaceFinish::plain(inside, BODY, 0.0).glazed(gloss).named("glaze"))]
}

impl FamilyContext<'_> {
    fn printed_crockery(&mut self) -> Arc<Material> {
        if self.appearance.chance(0.2) {
            return self.material(MaterialFamily::Ceramic);
        }
        let texture = bands(&mut self.appearance);
        let gloss = self.appearance.uniform(0.06, 0.25);
        Arc::new(SurfaceFinish::printed(texture, BODY).glazed(gloss).named("print"))
    }
}

pub fn mug(draw: &mut FamilyContext) -> HouseholdModel {
    let (r, h) = (draw.uniform(0.036, 0.047), draw.uniform(0.078, 0.115));
    let (foot, belly) = (r * draw.uniform(0.78, 1.0), r * draw.uniform(0.95, 1.08));
    let wall = draw.uniform(0.0032, 0.0048);
    let outside = curve([[foot, 0.0], [belly, 0.25 * h], [belly, 0.7 * h], [r, h]], 8);
    let body = Hollow { outside: outside.clone(), wall, bottom: 1.3 * wall, cells: 2, sectors: 12 };
    let shape = body.shape();
    // The handle starts and ends inside the wall.
    let (low, high) = (h * draw.uniform(0.16, 0.26), h * draw.uniform(0.74, 0.86));
    let reach = draw.uniform(0.022, 0.034);
    let radius_at = |z: f64| {
        let pair = outside.windows(2).find(|pair| pair[1][1] >= z).unwrap_or(&outside[outside.len() - 2..]);
        pair[0][0] + (pair[1][0] - pair[0][0]) * (z - pair[0][1]) / (pair[1][1] - pair[0][1])
    };
    let square = draw.uniform(0.55, 1.0);
    let path: Vec<Point3<f64>> = (0..=14)
        .map(|i| {
            let t = f64::from(i) / 14.0;
            let (sin, cos) = libm::sincos(std::f64::consts::PI * t);
            let z = low + (high - low) * (0.5 - 0.5 * cos.signum() * libm::pow(cos.abs(), square));
            let root = radius_at(low) + (radius_at(high) - radius_at(low)) * t - 0.5 * wall;
            Point3::new(root + reach * libm::pow(sin.max(0.0), 0.7 * square), 0.0, z)
        })
        .collect();
    let (thick, broad) = (draw.uniform(0.0035, 0.005), draw.uniform(0.005, 0.0085));
    let handle = sweep(&SweepPath::along(&path, Vector3::y()), &ellipse(thick, broad, 12), INSIDE, 4);
    let volume = shape.volume() + 0.95 * handle.volume();
    let materials = glazed(draw);
    HouseholdModel::new(shape.and(handle), materials, volume * density::CERAMIC).friction(0.45)
}

pub fn cup(draw: &mut FamilyContext) -> HouseholdModel {
    let (r, h) = (draw.uniform(0.032, 0.045), draw.uniform(0.075, 0.15));
    let foot = r * draw.uniform(0.65, 0.95);
    let kind = draw.form.below(3);
    let wall = [draw.uniform(0.0016, 0.0026), draw.uniform(0.0012, 0.0018), draw.uniform(0.003, 0.0042)][kind as usize];
    let outside = curve([[foot, 0.0], [foot + 0.3 * (r - foot), h / 3.0], [r, 2.0 * h / 3.0], [r, h]], 6);
    let shape = Hollow { outside, wall, bottom: 1.5 * wall, cells: 1, sectors: 12 }.shape();
    let (materials, rho) = match kind {
        0 => {
            let color = vivid(&mut draw.appearance);
            (vec![draw.plastic_of("plastic", color), draw.plastic_of("plastic", shade(color, 0.9))], density::PLASTIC)
        }
        1 => (vec![draw.metal(), draw.polished("steel")], density::STEEL),
        _ => (glazed(draw), density::CERAMIC),
    };
    let mass = shape.volume() * rho;
    HouseholdModel::new(shape, materials, mass).friction(0.45)
}

pub fn bowl(draw: &mut FamilyContext) -> HouseholdModel {
    let (r, foot) = (draw.uniform(0.06, 0.095), draw.uniform(0.45, 0.65));
    let h = r * draw.uniform(0.6, 0.9);
    let wall = draw.uniform(0.0032, 0.005);
    let outside =
        curve([[foot * r, 0.0], [draw.uniform(0.8, 0.95) * r, 0.08 * h], [r, draw.uniform(0.4, 0.7) * h], [r, h]], 12);
    let shape = Hollow { outside, wall, bottom: 1.4 * wall, cells: 3, sectors: 12 }.shape();
    let (materials, rho) = if draw.form.chance(0.2) {
        (vec![draw.metal(), draw.polished("steel")], 0.4 * density::STEEL)
    } else {
        (glazed(draw), density::CERAMIC)
    };
    let mass = shape.volume() * rho;
    HouseholdModel::new(shape, materials, mass).friction(0.45)
}

pub fn plate(draw: &mut FamilyContext) -> HouseholdModel {
    let (r, foot) = (draw.uniform(0.085, 0.14), draw.uniform(0.55, 0.66));
    let h = draw.uniform(0.018, 0.03);
    let wall = draw.uniform(0.004, 0.0058);
    let lip = draw.uniform(0.7, 0.8);
    let outside = curve([[foot * r, 0.0], [lip * r, 0.0], [lip * r, 0.55 * (h - wall)], [r, h - 0.5 * wall]], 9);
    let shape = Hollow { outside, wall, bottom: wall, cells: 2, sectors: 12 }.shape();
    let mut materials = glazed(draw);
    // The decorated side of a plate is its inside.
    materials.swap(0, 1);
    let mass = shape.volume() * density::CERAMIC;
    HouseholdModel::new(shape, materials, mass).friction(0.45)
}

pub fn pan(draw: &mut FamilyContext) -> HouseholdModel {
    let (r, h) = (draw.uniform(0.085, 0.13), draw.uniform(0.032, 0.05));
    let wall = draw.uniform(0.0022, 0.0032);
    let foot = draw.uniform(0.78, 0.88) * r;
    let outside = curve([[foot, 0.0], [foot + 0.6 * (r - foot), 0.1 * h], [r, 0.6 * h], [r, h]], 8);
    let shape = Hollow { outside, wall, bottom: 1.5 * wall, cells: 2, sectors: 12 }.shape();
    let length = draw.uniform(0.14, 0.19);
    let rise = draw.uniform(0.01, 0.035);
    let path: Vec<Point3<f64>> = (0..=10)
        .map(|i| {
            let t = f64::from(i) / 10.0;
            Point3::new(r - 0.5 * wall + length * t, 0.0, 0.72 * h + rise * libm::pow((1.2 * t).min(1.0), 1.5))
        })
        .collect();
    let width = draw.uniform(0.009, 0.013);
    let grip = SweepPath::along(&path, Vector3::y()).scaled(|t| {
        let swell = if t < 0.25 { 0.55 + 1.2 * t } else { 0.85 + 0.2 * (t - 0.25) };
        let end = (1.0 - t).min(0.08) / 0.08;
        [swell * (0.5 + 0.5 * end), swell * (0.5 + 0.5 * end)]
    });
    let handle = sweep(&grip, &ellipse(0.007, width, 14), SlotMapping::fit(2), 5);
    // The wall is aluminum and steel.
    let shape = shape.dense(0.55 * density::STEEL).and(handle.dense(density::PLASTIC));
    let mass = shape.moments().total;
    let coat = hsv(draw.appearance.unit(), 0.08, draw.appearance.uniform(0.06, 0.2));
    let outer = if draw.appearance.chance(0.5) {
        draw.metal()
    } else {
        let color = vivid(&mut draw.appearance);
        draw.plain("enamel", color, 0.2)
    };
    let materials = vec![outer, draw.plain("coating", coat, 0.35), draw.plastic_of("grip", hsv(0.0, 0.0, 0.08))];
    HouseholdModel::new(shape, materials, mass).friction(0.4)
}
