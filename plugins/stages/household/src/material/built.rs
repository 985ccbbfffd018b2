//! Materials of walls and floors.

use super::Bake;
use super::color::{SrgbColor, hsv, mix, shade};
use super::field::{ScalarField, smoothstep};
use syntable_model::random::Stream;

/// A random muted color: mostly white, gray or beige, as walls are.
fn wall_color(stream: &mut Stream) -> SrgbColor {
    let pale = stream.chance(0.75);
    // Few walls are strongly colored: the square prefers low saturations.
    let (hue, part) = (stream.unit(), stream.unit());
    let saturation = part * part * if pale { 0.2 } else { 0.5 };
    hsv(hue, saturation, if pale { stream.uniform(0.72, 0.93) } else { stream.uniform(0.4, 0.78) })
}

/// Concrete, 1 to 2 m per tile.
pub fn concrete(stream: &mut Stream, size: usize) -> Bake {
    let base = hsv(stream.uniform(0.05, 0.6), stream.uniform(0.0, 0.08), stream.uniform(0.38, 0.7));
    let clouds = ScalarField::fractal(size, [3, 3], 6, 0.6, stream);
    let stains = ScalarField::fractal(size, [2, 2], 3, 0.5, stream);
    let sand = ScalarField::noise(size, [size / 2, size / 2], stream);
    let [near, _, id] = ScalarField::cells(size, size / 20, 1.0, stream);
    let pits = near.zip(&id, |d, i| if i < 0.25 { 1.0 - smoothstep(0.05 + 0.3 * i, 0.09 + 0.4 * i, d) } else { 0.0 });
    let rough = stream.uniform(0.6, 0.9) as f32;
    let color = (0..size * size).map(|i| {
        let tone = 1.0 + 0.10 * clouds.values()[i] + 0.08 * stains.values()[i] + 0.04 * sand.values()[i];
        shade(base, tone * (1.0 - 0.45 * pits.values()[i]))
    });
    Bake {
        color: color.collect(),
        roughness: clouds.clone().map(|c| rough + 0.08 * c),
        height: clouds.zip(&pits, |c, p| 0.8 * c - 2.5 * p).zip(&sand, |h, s| h + 0.25 * s),
        metallic: 0.0,
        tile_m: stream.uniform(1.0, 2.0) as f32,
    }
}

/// Troweled plaster, 0.8 to 1.5 m per tile.
pub fn plaster(stream: &mut Stream, size: usize) -> Bake {
    let base = wall_color(stream);
    let [dx, dy] = [0, 1].map(|_| ScalarField::fractal(size, [4, 4], 4, 0.5, stream));
    let strokes = ScalarField::fractal(size, [10, 26], 4, 0.55, stream).warped(&dx, &dy, size as f32 * 0.06);
    let clouds = ScalarField::fractal(size, [2, 3], 4, 0.5, stream);
    let relief = stream.uniform(0.8, 2.5) as f32;
    let color = strokes.values().iter().zip(clouds.values()).map(|(&s, &c)| shade(base, 1.0 + 0.035 * s + 0.035 * c));
    Bake {
        color: color.collect(),
        roughness: ScalarField::constant(size, stream.uniform(0.75, 0.95) as f32),
        height: strokes.map(|s| relief * s),
        metallic: 0.0,
        tile_m: stream.uniform(0.8, 1.5) as f32,
    }
}

/// Rolled wall paint, 0.4 to 0.7 m per tile.
pub fn painted_wall(stream: &mut Stream, size: usize) -> Bake {
    let base = wall_color(stream);
    let peel = ScalarField::fractal(size, [size / 8, size / 8], 2, 0.5, stream);
    let drift = ScalarField::fractal(size, [2, 2], 3, 0.5, stream);
    let relief = stream.uniform(0.15, 0.6) as f32;
    let sheen = stream.uniform(0.45, 0.9) as f32;
    Bake {
        color: peel
            .values()
            .iter()
            .zip(drift.values())
            .map(|(&p, &d)| shade(base, 1.0 + 0.01 * p + 0.015 * d))
            .collect(),
        roughness: drift.map(|d| sheen + 0.04 * d),
        height: peel.map(|p| relief * p),
        metallic: 0.0,
        tile_m: stream.uniform(0.4, 0.7) as f32,
    }
}

/// Ceramic or stone tiles with grout; single tiles of 5 to 60 cm.
pub fn tiles(stream: &mut Stream, size: usize) -> Bake {
    let count = *stream.pick(&[2_usize, 2, 4, 4, 6]).unwrap_or(&2);
    let edge_m = match count {
        2 => stream.uniform(0.2, 0.6),
        4 => stream.uniform(0.1, 0.3),
        _ => stream.uniform(0.05, 0.12),
    };
    let first = wall_color(stream);
    let second = if stream.chance(0.4) { wall_color(stream) } else { first };
    let grout_color = hsv(stream.unit(), 0.05, stream.uniform(0.25, 0.8));
    let grout = stream.uniform(0.002, 0.005) / edge_m;
    let spread = stream.uniform(0.0, 0.12) as f32;
    let gloss = stream.uniform(0.08, 0.45) as f32;
    let clouds = ScalarField::fractal(size, [4, 4], 5, 0.6, stream);
    let tone: Vec<f32> = (0..count * count).map(|_| stream.uniform(-1.0, 1.0) as f32).collect();
    let tilt: Vec<[f32; 2]> =
        (0..count * count).map(|_| [0, 1].map(|_| stream.uniform(-0.008, 0.008) as f32)).collect();
    courses(size, [count, count], 0.0, grout as f32, |cell, inside, at, i| {
        let k = cell[1] * count + cell[0];
        let base = if (cell[0] + cell[1]) % 2 == 0 { first } else { second };
        let face = shade(base, 1.0 + spread * tone[k] + 0.04 * clouds.values()[i]);
        let lean = size as f32 / count as f32 * (tilt[k][0] * at[0] + tilt[k][1] * at[1]);
        (mix(grout_color, face, inside), gloss + (0.85 - gloss) * (1.0 - inside), 2.5 * inside + lean * inside)
    })
    .bake(size, (edge_m * count as f64) as f32)
}

/// Bricks in running bond, four by eight in about a meter.
pub fn brick(stream: &mut Stream, size: usize) -> Bake {
    let color = match stream.below(4) {
        0 | 1 => hsv(stream.uniform(0.01, 0.05), stream.uniform(0.4, 0.7), stream.uniform(0.4, 0.65)),
        2 => hsv(stream.uniform(0.06, 0.12), stream.uniform(0.15, 0.4), stream.uniform(0.6, 0.8)),
        _ => hsv(stream.unit(), 0.04, stream.uniform(0.6, 0.78)),
    };
    let mortar = hsv(0.1, 0.06, stream.uniform(0.45, 0.8));
    let count = [4, 12];
    let spread = stream.uniform(0.04, 0.16) as f32;
    let clouds = ScalarField::fractal(size, [12, 12], 5, 0.65, stream);
    let tone: Vec<f32> = (0..count[0] * count[1]).map(|_| stream.uniform(-1.0, 1.0) as f32).collect();
    let joint = stream.uniform(0.03, 0.05) as f32;
    courses(size, count, 0.5, joint, |cell, inside, _, i| {
        let noise = clouds.values()[i];
        let face = shade(color, 1.0 + spread * tone[cell[1] * count[0] + cell[0]] + 0.12 * noise);
        let inside = smoothstep(0.2, 0.8, inside + 0.12 * noise);
        (mix(shade(mortar, 1.0 + 0.08 * noise), face, inside), 0.85 + 0.05 * noise, 3.5 * inside + 0.7 * noise)
    })
    .bake(size, stream.uniform(0.9, 1.1) as f32)
}

struct Courses {
    color: Vec<SrgbColor>,
    roughness: Vec<f32>,
    height: Vec<f32>,
}

/// Rows of equal pieces with joints; every second row is shifted by `shift` pieces. `joint` is the joint's width as a
/// fraction of a piece's width. `shade` takes the piece, the coverage of the texel by it (0 in the joint, 1 on the
/// piece), the position in the piece in [-0.5, 0.5], and the texel's index.
fn courses(
    size: usize,
    count: [usize; 2],
    shift: f32,
    joint: f32,
    shade: impl Fn([usize; 2], f32, [f32; 2], usize) -> (SrgbColor, f32, f32),
) -> Courses {
    let texel = count[0] as f32 / size as f32;
    let aspect = count[0] as f32 / count[1] as f32;
    let mut out = Courses { color: Vec::new(), roughness: Vec::new(), height: Vec::new() };
    for y in 0..size {
        let py = (y as f32 + 0.5) / size as f32 * count[1] as f32;
        let row = py as usize % count[1];
        for x in 0..size {
            let px = (x as f32 + 0.5) / size as f32 * count[0] as f32 + shift * (row % 2) as f32;
            let (fx, fy) = (px.fract(), py.fract());
            // Distance to the piece's edge, in widths of a piece.
            let edge = fx.min(1.0 - fx).min(fy.min(1.0 - fy) * aspect);
            let inside = smoothstep(0.5 * joint, 0.5 * joint + 1.5 * texel, edge);
            let (color, roughness, height) =
                shade([px as usize % count[0], row], inside, [fx - 0.5, fy - 0.5], y * size + x);
            out.color.push(color);
            out.roughness.push(roughness);
            out.height.push(height);
        }
    }
    out
}

impl Courses {
    fn bake(self, size: usize, tile_m: f32) -> Bake {
        let [roughness, height] = [self.roughness, self.height].map(|values| ScalarField::of(size, values));
        Bake { color: self.color, roughness, height, metallic: 0.0, tile_m }
    }
}
