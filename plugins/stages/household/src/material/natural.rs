//! Wood, stone and leather.

use super::Bake;
use super::color::{SrgbColor, hsv, mix, shade};
use super::field::{ScalarField, smoothstep};
use std::f32::consts::TAU;
use syntable_model::random::Stream;

/// Dark and light wood of some species, sRGB.
const SPECIES: [[SrgbColor; 2]; 8] = [
    [[0.62, 0.45, 0.27], [0.84, 0.69, 0.48]], // pine
    [[0.47, 0.32, 0.18], [0.71, 0.54, 0.35]], // oak
    [[0.22, 0.14, 0.09], [0.43, 0.29, 0.19]], // walnut
    [[0.42, 0.20, 0.11], [0.63, 0.37, 0.23]], // cherry
    [[0.72, 0.57, 0.40], [0.89, 0.78, 0.61]], // maple
    [[0.13, 0.09, 0.07], [0.28, 0.20, 0.15]], // wenge
    [[0.45, 0.41, 0.37], [0.67, 0.63, 0.57]], // washed gray
    [[0.36, 0.16, 0.10], [0.52, 0.27, 0.17]], // mahogany
];

/// Grain of wood along x: a darkness in [0, 1] and fibers in [-1, 1].
fn grain(stream: &mut Stream, size: usize, rings: i64) -> [ScalarField; 2] {
    let bend = ScalarField::fractal(size, [2, 5], 4, 0.5, stream);
    let fibers = ScalarField::fractal(size, [6, 110], 2, 0.6, stream);
    let streaks = ScalarField::fractal(size, [2, 28], 3, 0.6, stream);
    // The rings swerve by several of their widths: a plank is not cut along the trunk.
    let wave = stream.uniform(0.04, 0.12) as f32 * rings as f32;
    let mut i = 0;
    let darkness = ScalarField::from_fn(size, |_, y| {
        let phase = rings as f32 * y + wave * bend.values()[i];
        i += 1;
        0.5 + 0.5 * libm::sinf(TAU * phase)
    });
    // Late wood is narrow.
    let darkness = darkness.map(|t| t * t * t).zip(&streaks, |t, s| 0.55 * t + 0.25 + 0.22 * s);
    [darkness.zip(&fibers, |t, f| (t + 0.12 * f).clamp(0.0, 1.0)), fibers]
}

fn wood_colors(stream: &mut Stream) -> [SrgbColor; 2] {
    let species = *stream.pick(&SPECIES).unwrap_or(&SPECIES[0]);
    let factor = stream.uniform(0.88, 1.1) as f32;
    species.map(|color| shade(color, factor))
}

/// One piece of wood, 0.5 to 0.8 m per tile.
pub fn timber(stream: &mut Stream, size: usize) -> Bake {
    let [dark, light] = wood_colors(stream);
    let rings = stream.integer(30, 60);
    let [darkness, fibers] = grain(stream, size, rings);
    let gloss = stream.uniform(0.25, 0.65) as f32;
    Bake {
        color: darkness.values().iter().map(|&t| mix(light, dark, t)).collect(),
        roughness: darkness.clone().map(|t| gloss + 0.12 * t),
        height: fibers.zip(&darkness, |f, t| 0.10 * f - 0.25 * t),
        metallic: 0.0,
        tile_m: stream.uniform(0.5, 0.8) as f32,
    }
}

/// Floor boards along x, 0.9 to 1.2 m per tile.
pub fn boards(stream: &mut Stream, size: usize) -> Bake {
    let [dark, light] = wood_colors(stream);
    let rings = stream.integer(60, 100);
    let [darkness, fibers] = grain(stream, size, rings);
    let rows = stream.integer(6, 10) as usize;
    let gap = (stream.uniform(0.001, 0.002) as f32).max(1.0 / size as f32);
    let gloss = stream.uniform(0.25, 0.6) as f32;
    let spread = stream.uniform(0.05, 0.2) as f32;
    // Each row of boards is cut at one place and takes its grain from elsewhere.
    let rows: Vec<[f32; 5]> = (0..rows).map(|_| std::array::from_fn(|_| stream.unit() as f32)).collect();
    let (mut color, mut roughness, mut height) = (Vec::new(), Vec::new(), Vec::new());
    let n = size as f32;
    for y in 0..size {
        let across = (y as f32 + 0.5) / n * rows.len() as f32;
        let row = rows[across as usize % rows.len()];
        let edge = across.fract().min(1.0 - across.fract()) / rows.len() as f32;
        for x in 0..size {
            let from_cut = ((x as f32 + 0.5) / n - row[0]).rem_euclid(1.0);
            let second = from_cut > 0.35 + 0.3 * row[1];
            let cut = from_cut.min(1.0 - from_cut).min((from_cut - 0.35 - 0.3 * row[1]).abs());
            let [shift, tone] = if second { [row[2], row[3]] } else { [row[3], row[4]] };
            let (sx, sy) = (x + (shift * n) as usize, y + (tone * n) as usize);
            let (t, fiber) = (darkness.at(sx, sy), fibers.at(sx, sy));
            let groove = 1.0 - smoothstep(0.5 * gap, 1.5 * gap, edge.min(cut));
            let board = shade(mix(light, dark, t), 1.0 + spread * (2.0 * tone - 1.0));
            color.push(mix(board, shade(dark, 0.5), groove));
            roughness.push(gloss + 0.12 * t + 0.3 * groove);
            height.push(0.08 * fiber - 0.2 * t - 2.5 * groove);
        }
    }
    Bake {
        color,
        roughness: ScalarField::of(size, roughness),
        height: ScalarField::of(size, height),
        metallic: 0.0,
        tile_m: stream.uniform(0.9, 1.2) as f32,
    }
}

/// Marble, 0.6 to 1.2 m per tile.
pub fn marble(stream: &mut Stream, size: usize) -> Bake {
    let hue = stream.uniform(0.02, 0.65);
    let pale = stream.chance(0.7);
    let (ground, vein) = if pale {
        (hsv(hue, stream.uniform(0.0, 0.12), stream.uniform(0.78, 0.93)), hsv(hue, 0.15, stream.uniform(0.3, 0.55)))
    } else {
        (hsv(hue, stream.uniform(0.1, 0.5), stream.uniform(0.1, 0.35)), hsv(hue, 0.1, stream.uniform(0.6, 0.9)))
    };
    let [dx, dy] = [0, 1].map(|_| ScalarField::fractal(size, [3, 3], 4, 0.55, stream));
    let amount = size as f32 * stream.uniform(0.05, 0.12) as f32;
    let thin = stream.uniform(14.0, 30.0) as f32;
    let veins = ScalarField::fractal(size, [3, 4], 3, 0.5, stream).warped(&dx, &dy, amount);
    let fine = ScalarField::fractal(size, [7, 7], 2, 0.5, stream).warped(&dy, &dx, amount);
    let clouds = ScalarField::fractal(size, [4, 4], 4, 0.5, stream);
    let gloss = stream.uniform(0.06, 0.3) as f32;
    let strength = stream.uniform(0.5, 0.95) as f32;
    let mark = veins
        .map(|x| libm::expf(-thin * x.abs()))
        .zip(&fine, |a, x| (a + 0.45 * libm::expf(-2.0 * thin * x.abs())).min(1.0));
    let mark = mark.zip(&clouds, |m, c| (strength * m * (0.6 + 0.5 * c) + 0.08 * (c + 0.5)).clamp(0.0, 1.0));
    Bake {
        color: mark.values().iter().map(|&t| mix(ground, vein, t)).collect(),
        roughness: mark.clone().map(|t| gloss + 0.06 * t),
        height: ScalarField::constant(size, 0.0),
        metallic: 0.0,
        tile_m: stream.uniform(0.6, 1.2) as f32,
    }
}

/// Polished granite, 0.15 to 0.25 m per tile: grains of some millimeters.
pub fn granite(stream: &mut Stream, size: usize) -> Bake {
    let hue = stream.unit();
    let base = hsv(hue, stream.uniform(0.02, 0.25), stream.uniform(0.3, 0.7));
    let pale = mix(base, [0.92, 0.9, 0.88], 0.4);
    let dark = shade(base, stream.uniform(0.3, 0.6) as f32);
    let tint = mix(base, hsv(hue, stream.uniform(0.2, 0.5), stream.uniform(0.35, 0.75)), 0.6);
    let [_, _, coarse] = ScalarField::cells(size, size / 12, 1.0, stream);
    let [_, _, fine] = ScalarField::cells(size, size / 5, 1.0, stream);
    let drift = ScalarField::fractal(size, [5, 5], 4, 0.6, stream);
    let gloss = stream.uniform(0.06, 0.25) as f32;
    let color = coarse.values().iter().zip(fine.values()).zip(drift.values()).map(|((&a, &b), &d)| {
        let grain = match a + 0.2 * d {
            t if t < 0.22 => dark,
            t if t < 0.55 => base,
            t if t < 0.8 => pale,
            _ => tint,
        };
        mix(
            shade(grain, 0.85 + 0.3 * b),
            if b < 0.18 { dark } else { pale },
            if !(0.18..0.8).contains(&b) { 0.6 } else { 0.0 },
        )
    });
    Bake {
        color: color.collect(),
        roughness: fine.clone().map(|b| gloss + 0.1 * b),
        height: ScalarField::constant(size, 0.0),
        metallic: 0.0,
        tile_m: stream.uniform(0.15, 0.25) as f32,
    }
}

/// Grained leather, 0.12 to 0.25 m per tile.
pub fn leather(stream: &mut Stream, size: usize) -> Bake {
    let color = if stream.chance(0.65) {
        hsv(stream.uniform(0.02, 0.09), stream.uniform(0.4, 0.75), stream.uniform(0.15, 0.6))
    } else {
        hsv(stream.unit(), stream.uniform(0.0, 0.6), stream.uniform(0.1, 0.75))
    };
    let [first, second, id] = ScalarField::cells(size, size / 11, 0.9, stream);
    let [dx, dy] = [0, 1].map(|_| ScalarField::fractal(size, [8, 8], 3, 0.5, stream));
    let wear = ScalarField::fractal(size, [4, 4], 4, 0.55, stream);
    let gloss = stream.uniform(0.35, 0.6) as f32;
    let pebble = second.zip(&first, |b, a| smoothstep(0.0, 0.45, b - a)).warped(&dx, &dy, 3.0);
    let tone: Vec<SrgbColor> = pebble
        .values()
        .iter()
        .zip(wear.values())
        .zip(id.values())
        .map(|((&p, &w), &i)| shade(color, 0.72 + 0.25 * p + 0.12 * w + 0.08 * i))
        .collect();
    Bake {
        color: tone,
        roughness: pebble.clone().map(|p| gloss + 0.2 * (1.0 - p)),
        height: pebble.map(|p| 2.2 * p),
        metallic: 0.0,
        tile_m: stream.uniform(0.12, 0.25) as f32,
    }
}
