//! Metal, plastic, lacquer, board, paper and glaze.

use super::Bake;
use super::color::{SrgbColor, hsv, mix, shade};
use super::field::{ScalarField, smoothstep};
use syntable_model::random::Stream;

/// Reflectance of some metals at normal incidence, sRGB: steel, aluminum, brass, copper, dark steel, gold.
const METALS: [SrgbColor; 6] = [
    [0.77, 0.75, 0.73],
    [0.91, 0.92, 0.92],
    [0.89, 0.79, 0.54],
    [0.93, 0.72, 0.62],
    [0.5, 0.5, 0.52],
    [0.95, 0.83, 0.53],
];

fn metal_color(stream: &mut Stream) -> SrgbColor {
    let metal = *stream.pick(&METALS).unwrap_or(&METALS[0]);
    shade(metal, stream.uniform(0.85, 1.02) as f32)
}

/// Brushed metal along x, 0.2 to 0.5 m per tile.
pub fn brushed_metal(stream: &mut Stream, size: usize) -> Bake {
    let base = metal_color(stream);
    let coarse = ScalarField::fractal(size, [3, size / 6], 2, 0.7, stream);
    let fine = ScalarField::noise(size, [12, size], stream);
    let gloss = stream.uniform(0.22, 0.42) as f32;
    let line = coarse.zip(&fine, |c, f| 0.6 * c + 0.5 * f);
    Bake {
        color: line.values().iter().map(|&l| shade(base, 1.0 + 0.05 * l)).collect(),
        roughness: line.clone().map(|l| gloss + 0.07 * l),
        height: line.map(|l| 0.12 * l),
        metallic: 1.0,
        tile_m: stream.uniform(0.2, 0.5) as f32,
    }
}

/// Plain metal with smudges and hairline scratches, 0.3 to 0.6 m per tile.
pub fn metal(stream: &mut Stream, size: usize) -> Bake {
    let base = metal_color(stream);
    let smudge = ScalarField::fractal(size, [4, 4], 5, 0.55, stream);
    let [dx, dy] = [0, 1].map(|_| ScalarField::noise(size, [3, 3], stream));
    let scratch = ScalarField::fractal(size, [2, size / 5], 2, 0.8, stream).warped(&dx, &dy, size as f32 * 0.15);
    let scratch = scratch.map(|s| smoothstep(0.85, 1.0, s));
    let gloss = stream.uniform(0.1, 0.35) as f32;
    Bake {
        color: smudge.values().iter().map(|&s| shade(base, 1.0 + 0.03 * s)).collect(),
        roughness: smudge.zip(&scratch, |s, l| gloss + 0.06 * s + 0.15 * l),
        height: scratch.map(|l| -0.25 * l),
        metallic: 1.0,
        tile_m: stream.uniform(0.3, 0.6) as f32,
    }
}

/// Plastic, 0.1 to 0.25 m per tile.
pub fn plastic(stream: &mut Stream, size: usize) -> Bake {
    let neutral = stream.chance(0.4);
    let saturation = if neutral { stream.uniform(0.0, 0.08) } else { stream.uniform(0.4, 0.95) };
    let base = hsv(stream.unit(), saturation, stream.uniform(if neutral { 0.08 } else { 0.35 }, 0.9));
    let grain = ScalarField::fractal(size, [size / 7, size / 7], 2, 0.6, stream);
    let relief = if stream.chance(0.5) { stream.uniform(0.2, 0.9) as f32 } else { 0.0 };
    let gloss = stream.uniform(0.12, 0.5) as f32 + 0.1 * relief;
    Bake {
        color: grain.values().iter().map(|&g| shade(base, 1.0 + 0.02 * g)).collect(),
        roughness: grain.clone().map(|g| gloss + 0.03 * g),
        height: grain.map(|g| relief * g),
        metallic: 0.0,
        tile_m: stream.uniform(0.1, 0.25) as f32,
    }
}

/// Brown or gray board, 0.3 to 0.5 m per tile.
pub fn cardboard(stream: &mut Stream, size: usize) -> Bake {
    let base = if stream.chance(0.75) {
        hsv(stream.uniform(0.08, 0.1), stream.uniform(0.3, 0.45), stream.uniform(0.55, 0.75))
    } else {
        hsv(0.1, 0.05, stream.uniform(0.5, 0.85))
    };
    let fibers = ScalarField::fractal(size, [size / 6, size / 3], 2, 0.7, stream);
    let clouds = ScalarField::fractal(size, [4, 4], 4, 0.6, stream);
    let [near, _, id] = ScalarField::cells(size, size / 9, 1.0, stream);
    let flutes = stream.integer(40, 70) as f32;
    let relief = stream.uniform(0.0, 0.35) as f32;
    let dark = shade(base, 0.7);
    let color = (0..size * size).map(|i| {
        let speck = if id.values()[i] < 0.06 { 1.0 - smoothstep(0.1, 0.25, near.values()[i]) } else { 0.0 };
        mix(shade(base, 1.0 + 0.05 * fibers.values()[i] + 0.04 * clouds.values()[i]), dark, 0.7 * speck)
    });
    let mut i = 0;
    let height = ScalarField::from_fn(size, |x, _| {
        i += 1;
        relief * libm::sinf(std::f32::consts::TAU * flutes * x) + 0.3 * fibers.values()[i - 1]
    });
    Bake {
        color: color.collect(),
        roughness: clouds.map(|c| 0.85 + 0.05 * c),
        height,
        metallic: 0.0,
        tile_m: stream.uniform(0.3, 0.5) as f32,
    }
}

/// Glazed ceramic, 0.15 to 0.3 m per tile.
pub fn ceramic(stream: &mut Stream, size: usize) -> Bake {
    let base = match stream.below(3) {
        0 => hsv(0.1, stream.uniform(0.0, 0.1), stream.uniform(0.82, 0.93)),
        1 => hsv(stream.unit(), stream.uniform(0.2, 0.6), stream.uniform(0.5, 0.85)),
        _ => hsv(stream.uniform(0.5, 0.7), stream.uniform(0.3, 0.8), stream.uniform(0.2, 0.6)),
    };
    let speckle = if stream.chance(0.5) { stream.uniform(0.3, 0.8) as f32 } else { 0.0 };
    let ink = hsv(0.07, 0.5, 0.25);
    let [near, _, id] = ScalarField::cells(size, size / 12, 1.0, stream);
    let clouds = ScalarField::fractal(size, [3, 3], 4, 0.5, stream);
    // The glaze is the clearcoat; the body below is rough.
    let gloss = stream.uniform(0.35, 0.6) as f32;
    let color = (0..size * size).map(|i| {
        let number = id.values()[i];
        let dot =
            if number < 0.3 { 1.0 - smoothstep(0.1 + 0.4 * number, 0.2 + 0.5 * number, near.values()[i]) } else { 0.0 };
        mix(shade(base, 1.0 + 0.03 * clouds.values()[i]), ink, speckle * dot)
    });
    Bake {
        color: color.collect(),
        roughness: clouds.clone().map(|c| gloss + 0.02 * c),
        height: clouds.map(|c| 1.2 * c),
        metallic: 0.0,
        tile_m: stream.uniform(0.15, 0.3) as f32,
    }
}

/// Paint under lacquer, 0.2 to 0.4 m per tile: plain, or with flakes of random orientation.
pub fn lacquer(stream: &mut Stream, size: usize) -> Bake {
    let neutral = stream.chance(0.35);
    let saturation = if neutral { stream.uniform(0.0, 0.06) } else { stream.uniform(0.5, 0.95) };
    let base = hsv(stream.unit(), saturation, stream.uniform(if neutral { 0.06 } else { 0.25 }, 0.85));
    let flakes = if stream.chance(0.5) { stream.uniform(0.4, 1.0) as f32 } else { 0.0 };
    let peel = ScalarField::fractal(size, [size / 16, size / 16], 2, 0.5, stream);
    let [_, _, id] = ScalarField::cells(size, size / 2, 1.0, stream);
    let pale = mix(base, [0.95; 3], 0.35);
    let gloss = stream.uniform(0.35, 0.5) as f32;
    Bake {
        color: id.values().iter().map(|&i| mix(base, pale, flakes * smoothstep(0.8, 1.0, i))).collect(),
        roughness: id.clone().map(|i| gloss - 0.15 * flakes * i),
        height: peel.zip(&id, |p, i| 0.15 * p + 0.5 * flakes * i),
        metallic: 0.0,
        tile_m: stream.uniform(0.2, 0.4) as f32,
    }
}

/// Paper, 0.15 to 0.3 m per tile: white, tinted or brown; plain, with laid lines, ruled or squared.
pub fn paper(stream: &mut Stream, size: usize) -> Bake {
    let base = match stream.below(4) {
        0 => hsv(stream.uniform(0.07, 0.1), stream.uniform(0.25, 0.45), stream.uniform(0.6, 0.8)),
        1 => hsv(stream.unit(), stream.uniform(0.1, 0.5), stream.uniform(0.75, 0.93)),
        _ => hsv(stream.uniform(0.08, 0.16), stream.uniform(0.0, 0.08), stream.uniform(0.86, 0.95)),
    };
    let tile = stream.uniform(0.15, 0.3);
    let fibers = ScalarField::fractal(size, [size / 4, size / 5], 2, 0.7, stream);
    let clouds = ScalarField::fractal(size, [6, 6], 4, 0.6, stream);
    let crumple = ScalarField::fractal(size, [5, 5], 3, 0.5, stream);
    let folds = if stream.chance(0.4) { stream.uniform(1.0, 4.0) as f32 } else { 0.2 };
    let style = stream.below(4);
    // Rules 5 to 9 mm apart, a whole number of them to a tile.
    let rules = (tile / stream.uniform(0.005, 0.009)).round() as f32;
    let ink = hsv(stream.uniform(0.5, 0.7), 0.4, 0.6);
    let width = (0.05_f32).max(1.2 * rules / size as f32);
    let line = |x: f32| {
        let t = (x * rules).fract();
        1.0 - smoothstep(0.5 * width, width, t.min(1.0 - t))
    };
    let color = (0..size * size).map(|i| {
        let (x, y) = (((i % size) as f32 + 0.5) / size as f32, ((i / size) as f32 + 0.5) / size as f32);
        let mark = match style {
            0 => line(y),
            1 => line(y).max(line(x)),
            _ => 0.0,
        };
        mix(shade(base, 1.0 + 0.02 * fibers.values()[i] + 0.015 * clouds.values()[i]), ink, 0.6 * mark)
    });
    let mut i = 0;
    let height = ScalarField::from_fn(size, |_, y| {
        i += 1;
        let laid = if style == 2 { 0.12 * libm::sinf(std::f32::consts::TAU * 4.0 * rules * y) } else { 0.0 };
        0.15 * fibers.values()[i - 1] + folds * crumple.values()[i - 1] + laid
    });
    Bake {
        color: color.collect(),
        roughness: clouds.map(|c| 0.88 + 0.04 * c),
        height,
        metallic: 0.0,
        tile_m: tile as f32,
    }
}
