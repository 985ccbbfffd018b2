//! Spoons, forks and knives, lying along x.

use super::{FamilyContext, HouseholdModel, density, ellipse};
use crate::shape::{SlotMapping, SolidShape, SweepPath, loft, sweep};
use nalgebra::{Point3, Vector3};
use std::f64::consts::PI;
use std::sync::Arc;
use syntable_model::scene::Material;

/// A section of a flat body along x.
struct CutlerySection {
    x: f64,
    /// Center, y and z.
    at: [f64; 2],
    /// Half width along y and half thickness along z.
    half: [f64; 2],
    /// Depth of the center below the edges.
    dish: f64,
}

fn skin(sections: &[CutlerySection], around: usize, per_part: usize) -> SolidShape {
    let rings: Vec<Vec<Point3<f64>>> = sections
        .iter()
        .map(|section| {
            ellipse(1.0, 1.0, around)
                .into_iter()
                .map(|[cos, sin]| {
                    let z = section.at[1] + section.half[1] * sin - section.dish * (1.0 - cos * cos);
                    Point3::new(section.x, section.at[0] + section.half[0] * cos, z)
                })
                .collect()
        })
        .collect();
    loft(&rings, SlotMapping::tile(0, 0.2), per_part)
}

fn smooth(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The handle of a piece of cutlery at `t` in [0, 1] from its end to its neck: half width and height of the center
/// line.
struct CutleryHandle {
    length: f64,
    end: f64,
    neck: f64,
    arch: f64,
    thick: f64,
}

impl CutleryHandle {
    fn draw(draw: &mut FamilyContext, length: f64) -> Self {
        let thick = draw.uniform(0.0009, 0.0014);
        Self {
            length,
            end: draw.uniform(0.0065, 0.0105),
            neck: draw.uniform(0.0025, 0.0034),
            arch: length * draw.uniform(0.03, 0.07),
            thick,
        }
    }

    fn section(&self, t: f64) -> CutlerySection {
        let round = (t / 0.06).min(1.0).sqrt().max(0.25);
        let width = round * (self.end + (self.neck - self.end) * smooth(1.15 * t));
        let z = self.arch * libm::sin(PI * (0.15 + 0.85 * t));
        CutlerySection { x: self.length * t, at: [0.0, z], half: [width, self.thick], dish: 0.0 }
    }
}

fn steel(draw: &mut FamilyContext) -> Vec<Arc<Material>> {
    let brushed = draw.appearance.chance(0.25);
    vec![if brushed { draw.metal() } else { draw.polished("cutlery") }]
}

pub fn spoon(draw: &mut FamilyContext) -> HouseholdModel {
    let length = draw.uniform(0.135, 0.215);
    let bowl = length * draw.uniform(0.27, 0.34);
    let handle = CutleryHandle::draw(draw, length - bowl);
    let (width, depth) = (bowl * draw.uniform(0.3, 0.37), bowl * draw.uniform(0.1, 0.16));
    let mut sections: Vec<CutlerySection> = (0..=16).map(|i| handle.section(f64::from(i) / 16.0)).collect();
    let neck_z = sections[16].at[1];
    for i in 1..=14 {
        let t = f64::from(i) / 14.0;
        // An egg: widest nearer to the handle, round at the tip.
        let egg = libm::pow(libm::sin(PI * libm::pow(t, 0.8)).max(0.0), 0.62);
        let half = handle.neck * (1.0 - t) + (width - 0.3 * handle.neck) * egg;
        let dish = depth * libm::pow(libm::sin(PI * t), 0.8);
        let thick = handle.thick * (1.0 - 0.3 * t);
        let at = [0.0, neck_z * (1.0 - smooth(t)) + 0.25 * depth * t];
        sections.push(CutlerySection { x: handle.length + bowl * t, at, half: [half.max(0.0012), thick], dish });
    }
    let shape = skin(&sections, 24, 5);
    let mass = shape.volume() * density::STEEL;
    let materials = steel(draw);
    HouseholdModel::new(shape, materials, mass).friction(0.35)
}

pub fn fork(draw: &mut FamilyContext) -> HouseholdModel {
    let length = draw.uniform(0.16, 0.21);
    let head = length * draw.uniform(0.32, 0.37);
    let handle = CutleryHandle::draw(draw, length - head);
    let width = draw.uniform(0.0105, 0.0135);
    let (palm, hang) = (0.42 * head, draw.uniform(0.003, 0.006));
    let mut sections: Vec<CutlerySection> = (0..=14).map(|i| handle.section(f64::from(i) / 14.0)).collect();
    let neck_z = sections[14].at[1];
    let z = |t: f64| neck_z * (1.0 - smooth(1.4 * t)) - hang * libm::sin(PI * t) + 0.35 * hang * t;
    for i in 1..=7 {
        let t = f64::from(i) / 7.0;
        let half = handle.neck + (width - handle.neck) * smooth(1.5 * t);
        let at = [0.0, z(t * palm / head)];
        sections.push(CutlerySection { x: handle.length + palm * t, at, half: [half, handle.thick], dish: 0.0 });
    }
    let mut shape = skin(&sections, 16, 5);
    let mut volume = shape.volume();
    for tine in 0..4 {
        let thin = 0.11 * width;
        let y = (width - 1.3 * thin) * (f64::from(tine) / 1.5 - 1.0);
        let path: Vec<Point3<f64>> = (0..=8)
            .map(|i| {
                let t = f64::from(i) / 8.0;
                // The outer tines start a little deeper, where the palm is still broad.
                let along = palm * 0.97 + (head - palm * 0.97) * t;
                Point3::new(handle.length + along, y, z(along / head))
            })
            .collect();
        let taper = |t: f64| [1.0, if t > 0.75 { 1.0 - 2.2 * (t - 0.75) } else { 1.0 }];
        let section = ellipse(handle.thick, 1.35 * thin, 8);
        let tine = sweep(&SweepPath::along(&path, Vector3::y()).scaled(taper), &section, SlotMapping::tile(0, 0.2), 4);
        volume += tine.volume();
        shape = shape.and(tine);
    }
    let materials = steel(draw);
    HouseholdModel::new(shape, materials, volume * density::STEEL).friction(0.35)
}

pub fn knife(draw: &mut FamilyContext) -> HouseholdModel {
    let length = draw.uniform(0.18, 0.235);
    let grip = length * draw.uniform(0.42, 0.5);
    let (half, thick) = (draw.uniform(0.0065, 0.0095), draw.uniform(0.0022, 0.0032));
    let blade = draw.uniform(0.0085, 0.0115);
    let mut sections = Vec::new();
    for i in 0..=12 {
        let t = f64::from(i) / 12.0;
        let round = (t / 0.08).min(1.0).sqrt().max(0.3);
        let width = round * half * (1.0 - 0.25 * smooth(1.3 * t));
        sections.push(CutlerySection {
            x: grip * t,
            at: [0.0, 0.0],
            half: [width, round * thick * (1.0 - 0.3 * t)],
            dish: 0.0,
        });
    }
    for i in 1..=14 {
        let t = f64::from(i) / 14.0;
        let belly = 0.75 * half + (blade - 0.75 * half) * smooth(4.0 * t);
        // The back is straight, the edge curves up to the tip.
        let tip = if t > 0.72 { 1.0 - 0.85 * ((t - 0.72) / 0.28).powi(2) } else { 1.0 };
        let width = belly * tip;
        let thin = 0.0007 + (0.7 * thick - 0.0007) * (1.0 - smooth(3.0 * t));
        let x = grip + (length - grip) * t;
        sections.push(CutlerySection { x, at: [belly - width, 0.0], half: [width, thin], dish: 0.0 });
    }
    let shape = skin(&sections, 16, 6);
    let mass = shape.volume() * density::STEEL;
    let materials = steel(draw);
    HouseholdModel::new(shape, materials, mass).friction(0.35)
}
