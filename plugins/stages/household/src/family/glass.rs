//! Drinking glasses: hollow solids of clear or tinted glass.

use super::vessel::{Hollow, curve};
use super::{FamilyContext, HouseholdModel, density};
use crate::material::{LICENSE, SrgbColor, hsv, linear, mix};
use crate::shape::{Lathe, Profile, SlotMapping, WallCell};
use std::sync::Arc;
use syntable_model::random::Stream;
use syntable_model::scene::{Color, Material, Scalar, Transmission, Volume};

const GLASS: SlotMapping = SlotMapping::fit(0);

/// Attenuation distance of the tint, meters.
const TINT_M: f32 = 0.02;

/// A transmissive solid with a tinted interior medium.
pub fn clear_solid(name: &str, tint: SrgbColor, ior: f64, roughness: f64) -> Arc<Material> {
    let volume = Volume { attenuation_color: linear(tint), attenuation_distance_m: TINT_M };
    let transmission = Transmission { fraction: Scalar::constant(1.0), volume: Some(volume) };
    let material = Material {
        base_color: Color::constant([1.0; 3]),
        roughness: Scalar::constant(roughness as f32),
        ior: ior as f32,
        transmission: Some(transmission),
        license: LICENSE.to_owned(),
        ..Material::plain(name, [1.0; 3], 0.0)
    };
    Arc::new(material.with_digest())
}

/// Mostly clear, sometimes green, blue, amber or rose; rarely frosted.
pub fn glass(stream: &mut Stream) -> Arc<Material> {
    let hues = [0.38, 0.55, 0.09, 0.95];
    let hue = *stream.pick(&hues).unwrap_or(&hues[0]);
    let depth = stream.uniform(0.3, 0.9);
    let tint = if stream.chance(0.7) { [0.97, 0.99, 0.98] } else { mix([1.0; 3], hsv(hue, 0.6, 0.85), depth as f32) };
    let roughness = if stream.chance(0.12) { stream.uniform(0.15, 0.4) } else { stream.uniform(0.0, 0.03) };
    clear_solid("glass", tint, stream.uniform(1.48, 1.56), roughness)
}

pub fn drinking_glass(draw: &mut FamilyContext) -> HouseholdModel {
    let wine = draw.form.chance(0.35);
    let shape = if wine { stemmed(draw) } else { tumbler(draw) };
    let mass = shape.volume() * density::GLASS;
    let material = glass(&mut draw.appearance);
    // A tumbler has a slot for its inside.
    let materials = if wine { vec![material] } else { vec![material.clone(), material] };
    HouseholdModel::new(shape, materials, mass).friction(0.4)
}

fn tumbler(draw: &mut FamilyContext) -> super::SolidShape {
    let (r, h) = (draw.uniform(0.031, 0.043), draw.uniform(0.08, 0.15));
    let foot = r * draw.uniform(0.75, 1.0);
    let wall = draw.uniform(0.0016, 0.0028);
    let belly = r * draw.uniform(0.98, 1.1);
    let outside = curve([[foot, 0.0], [foot + 0.5 * (belly - foot), 0.3 * h], [belly, 0.7 * h], [r, h]], 6);
    Hollow { outside, wall, bottom: draw.uniform(0.004, 0.009), cells: 2, sectors: 12 }.shape()
}

/// A bowl on a stem on a foot.
fn stemmed(draw: &mut FamilyContext) -> super::SolidShape {
    let (foot, stem) = (draw.uniform(0.03, 0.037), draw.uniform(0.0035, 0.005));
    let (low, depth) = (draw.uniform(0.055, 0.095), draw.uniform(0.075, 0.11));
    let (belly, rim) = (draw.uniform(0.042, 0.054), draw.uniform(0.028, 0.036));
    let (wall, base) = (draw.uniform(0.0013, 0.002), draw.uniform(0.006, 0.009));
    let high = low + depth;
    let outside = curve([[stem, low], [belly, low], [belly, low + 0.5 * depth], [rim, high]], 9);
    let inside = curve(
        [[0.0, low + base], [belly - 1.5 * wall, low + base], [belly - wall, low + 0.5 * depth], [rim - wall, high]],
        9,
    );
    let mut outline = Profile::at(0.0, 0.0).to(foot, 0.0, GLASS).to(foot, 0.0022, GLASS).round(0.001).curve(
        [0.4 * foot, 0.004],
        [stem, 0.006],
        [stem, 0.022],
        5,
        GLASS,
    );
    for p in &outside {
        outline = outline.to(p[0], p[1], GLASS);
    }
    outline = outline.round(0.4 * wall);
    for p in inside.iter().rev() {
        outline = outline.to(p[0], p[1], GLASS);
        if p[1] == high {
            outline = outline.round(0.4 * wall);
        }
    }
    // The bottom of the bowl is solid up to where the inside begins to rise.
    let cell = |from: usize, to: usize| -> WallCell { [&outside[from..=to], &inside[from..=to]].concat() };
    let bottom: WallCell = [&outside[..=2], &inside[..=1], &[[0.0, low]]].concat();
    let plate: WallCell =
        vec![[0.0, 0.0], [foot, 0.0], [foot, 0.0022], [0.45 * foot, 0.004], [stem, 0.008], [0.0, 0.008]];
    let shaft: WallCell = vec![[0.0, 0.006], [stem, 0.006], [stem, low], [0.0, low]];
    Lathe::new(&outline).segments(48).hollow(&[cell(1, 5), cell(5, 9)], &[bottom, plate, shaft], 12)
}
