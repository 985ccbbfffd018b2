//! The view through windows: sky over a skyline of houses and trees, hills behind it, level ground before it.

use std::f64::consts::{PI, TAU};
use syntable_model::error::Result;
use syntable_model::random::Stream;
use syntable_model::scene::EnvironmentMap;

/// Size of the map, texels: a third of a degree each, since the view behind a window is out of focus.
const SIZE: [u32; 2] = [1024, 512];

/// Irradiance of upright surfaces and of the ground, relative to π times the luminance of the sky.
const LIT: [f64; 2] = [0.4, 0.65];

/// Reflectance of facades, linear Rec. 709: plaster, brick, concrete, yellow and blue paint, timber.
const FACADES: [[f64; 3]; 6] = [
    [0.42, 0.39, 0.33],
    [0.24, 0.12, 0.085],
    [0.28, 0.28, 0.27],
    [0.38, 0.33, 0.21],
    [0.17, 0.125, 0.085],
    [0.30, 0.33, 0.36],
];
/// Reflectance of foliage.
const FOLIAGE: [[f64; 3]; 4] = [[0.045, 0.075, 0.022], [0.07, 0.095, 0.03], [0.03, 0.055, 0.028], [0.11, 0.085, 0.03]];
/// Reflectance of the ground: lawn, dry grass, asphalt, paving, gravel.
const GROUND: [[f64; 3]; 5] =
    [[0.06, 0.10, 0.03], [0.15, 0.135, 0.06], [0.09, 0.09, 0.092], [0.23, 0.21, 0.19], [0.2, 0.18, 0.15]];

/// A map of a synthetic landscape. The mean luminance of its upper half is about one.
pub fn landscape(stream: &Stream) -> Result<EnvironmentMap> {
    let landscape = Landscape::new(stream);
    let [width, height] = SIZE;
    // Upright features are drawn in the tangent of the elevation; the rows at the poles stay finite.
    let rows: Vec<MapRow> =
        (0..height).map(|y| MapRow::new(PI * (0.5 - (f64::from(y) + 0.5) / f64::from(height)))).collect();
    let columns: Vec<MapColumn> =
        (0..width).map(|x| landscape.column((f64::from(x) + 0.5) / f64::from(width))).collect();
    let texel = |row: &MapRow, column: &MapColumn| landscape.texel(row, column).map(|x| x as f32);
    let texels = rows.iter().flat_map(|row| columns.iter().map(move |column| texel(row, column))).collect();
    EnvironmentMap::new("landscape", width, height, texels)
}

/// A row of the map.
struct MapRow {
    elevation: f64,
    tangent: f64,
    /// Change of the tangent to the next row.
    step: f64,
}

impl MapRow {
    fn new(elevation: f64) -> Self {
        let tangent = libm::tan(elevation);
        Self { elevation, tangent, step: (1.0 + tangent * tangent) * PI / f64::from(SIZE[1]) }
    }
}

/// A feature in a direction.
#[derive(Clone, Copy)]
enum Feature {
    /// A house with storeys and windows of these angular sizes, tangents.
    House { color: [f64; 3], storey: f64, bay: f64, glass: f64 },
    /// A tree or a hedge.
    Foliage([f64; 3]),
}

/// A segment of a layer: from the end of the previous segment to `end`, in turns.
struct LandscapeSegment {
    start: f64,
    end: f64,
    /// Height as the tangent of the elevation; below the horizon for an empty segment.
    top: f64,
    feature: Feature,
}

/// Features at one distance.
struct LandscapeLayer {
    segments: Vec<LandscapeSegment>,
    /// Tangent of the elevation of their feet, negative.
    foot: f64,
    /// Fraction of the light that the air between adds.
    haze: f64,
    noise: ValueNoise,
}

/// A column of the map.
struct MapColumn {
    /// Azimuth, turns.
    turn: f64,
    /// Sine and cosine of it.
    toward: [f64; 2],
    /// Tangent of the elevation of the hills.
    hills: f64,
    /// Per layer: the feature, and the tangent of the elevation of its top.
    features: [Option<(Feature, f64, f64)>; 2],
}

struct Landscape {
    /// From 0, overcast, to 1, clear.
    clear: f64,
    clouds: f64,
    /// Height of the viewer above the ground outside, meters.
    eye_m: f64,
    hills: [f64; 2],
    near: [f64; 3],
    far: [f64; 3],
    /// Distance at which the ground changes, meters.
    border_m: f64,
    /// The nearest layer first.
    layers: [LandscapeLayer; 2],
    noise: ValueNoise,
}

impl Landscape {
    fn new(stream: &Stream) -> Self {
        let mut draw = stream.child("landscape");
        let pick = |draw: &mut Stream, colors: &[[f64; 3]]| draw.pick(colors).copied().unwrap_or([0.2; 3]);
        let eye_m = draw.uniform(1.6, 11.0);
        let town = draw.unit();
        let (near_m, far_m) = (draw.uniform(14.0, 40.0), draw.uniform(70.0, 160.0));
        let layers = [(near_m, 0.04, 0.6, "near"), (far_m, 0.2, 0.95, "far")];
        Self {
            clear: draw.unit(),
            clouds: draw.uniform(0.0, 0.8),
            eye_m,
            hills: [draw.uniform(-0.02, 0.06), draw.uniform(0.01, 0.08)],
            near: pick(&mut draw, &GROUND),
            far: pick(&mut draw, &GROUND),
            border_m: draw.uniform(4.0, 15.0),
            noise: ValueNoise(stream.child("noise").seed()),
            layers: layers.map(|(distance_m, haze, density, name)| {
                LandscapeLayer::new(&stream.child(name), eye_m, distance_m, haze, density, town)
            }),
        }
    }

    fn column(&self, u: f64) -> MapColumn {
        let turn = 1.0 - u;
        let (sin, cos) = libm::sincos(turn * TAU);
        let hills = self.hills[0] + self.hills[1] * self.noise.around(turn, 7, 0, 3);
        MapColumn { turn, toward: [cos, sin], hills, features: [0, 1].map(|i| self.layers[i].at(turn)) }
    }

    fn texel(&self, row: &MapRow, column: &MapColumn) -> [f64; 3] {
        let mut color = match row.tangent > 0.0 {
            true => self.sky(row, column),
            false => self.ground(row, column),
        };
        let horizon = self.sky_color(0.02);
        let cover = |top: f64| ((top - row.tangent) / row.step + 0.5).clamp(0.0, 1.0);
        if row.tangent > -0.5 * row.step {
            let hill = mix([0.03, 0.05, 0.03], horizon, 0.6);
            color = mix(color, hill, cover(column.hills));
        }
        for (layer, feature) in self.layers.iter().zip(&column.features).rev() {
            let Some((feature, top, along)) = feature else { continue };
            let shown = cover(*top) * (1.0 - cover(layer.foot));
            if shown > 0.0 {
                let own = layer.color(feature, row, column, *top, *along);
                color = mix(color, mix(own, horizon, layer.haze), shown);
            }
        }
        color
    }

    /// Radiance of the sky without clouds at the sine of an elevation.
    fn sky_color(&self, sine: f64) -> [f64; 3] {
        // Overcast skies are brightest at the zenith (CIE); clear skies, away from the sun, near the horizon.
        let overcast = 1.25 * (1.0 + 2.0 * sine) / 3.0 + 0.25;
        let clear = 0.45 + 1.1 * libm::exp(-4.0 * sine);
        let blue = mix([0.6, 0.9, 1.75], [0.93, 1.0, 1.1], libm::exp(-5.0 * sine));
        mix([0.98 * overcast, overcast, 1.03 * overcast], blue.map(|c| c * clear), self.clear)
    }

    fn sky(&self, row: &MapRow, column: &MapColumn) -> [f64; 3] {
        let sine = libm::sin(row.elevation);
        let color = self.sky_color(sine);
        // Clouds are a level sheet.
        let scale = 3.0 / (sine + 0.15);
        let [x, y] = column.toward.map(|c| c * scale * libm::cos(row.elevation));
        let sheet = self.noise.fractal([x, y], 4);
        let cloud = smooth(((sheet - 0.62 + 0.3 * self.clouds) / 0.2).clamp(0.0, 1.0));
        mix(color, [1.35, 1.35, 1.38].map(|c| c * (1.15 - 0.5 * sheet)), 0.85 * cloud * (sine * 8.0).min(1.0))
    }

    fn ground(&self, row: &MapRow, column: &MapColumn) -> [f64; 3] {
        let distance = self.eye_m / (-row.tangent).max(1e-3);
        let at = column.toward.map(|c| c * distance);
        // Omits details finer than a texel.
        let sharp = (6.0 / distance).min(1.0);
        let patches = self.noise.fractal(at.map(|x| x / 5.0), 3);
        let grain = 1.0 + 0.35 * sharp * (self.noise.fractal(at.map(|x| x * 1.5), 2) - 0.5);
        let border = ((distance - self.border_m * (0.7 + 0.6 * patches)) / (0.05 * distance) + 0.5).clamp(0.0, 1.0);
        let reflectance = mix(self.near, self.far, border);
        let lit = LIT[1] * (0.75 + 0.5 * patches) * grain;
        mix(reflectance.map(|c| c * lit), self.sky_color(0.02), 1.0 - libm::exp(-distance / 400.0))
    }
}

impl LandscapeLayer {
    fn new(stream: &Stream, eye_m: f64, distance_m: f64, haze: f64, density: f64, town: f64) -> Self {
        let mut draw = stream.clone();
        let mut segments = Vec::new();
        let mut start = 0.0;
        while start < 1.0 {
            let is_house = draw.chance(town);
            let width_m = if is_house { draw.uniform(7.0, 22.0) } else { draw.uniform(4.0, 16.0) };
            let end = start + libm::atan(width_m / distance_m) / TAU;
            let height_m = if is_house { draw.uniform(5.0, 15.0) } else { draw.uniform(3.0, 12.0) };
            let top = (height_m - eye_m) / distance_m;
            let color = *draw.pick(if is_house { &FACADES[..] } else { &FOLIAGE[..] }).unwrap_or(&[0.2; 3]);
            let shade = draw.uniform(0.7, 1.15);
            let (storey, bay) = (draw.uniform(2.7, 3.3) / distance_m, draw.uniform(1.8, 3.5) / distance_m);
            let glass = draw.uniform(0.02, 0.5);
            let color = color.map(|c| c * shade);
            let feature = match is_house {
                true => Feature::House { color, storey, bay, glass },
                false => Feature::Foliage(color),
            };
            if draw.chance(density) {
                segments.push(LandscapeSegment { start, end, top, feature });
            }
            start = end;
        }
        // The last segment ends where the first begins.
        for segment in &mut segments {
            segment.start /= start;
            segment.end /= start;
        }
        Self { segments, foot: -eye_m / distance_m, haze, noise: ValueNoise(stream.child("leaves").seed()) }
    }

    /// The feature at an azimuth, the tangent of the elevation of its top, and the distance from its side as a tangent.
    fn at(&self, turn: f64) -> Option<(Feature, f64, f64)> {
        let segment = self.segments.iter().find(|segment| (segment.start..segment.end).contains(&turn))?;
        let along = (turn - segment.start) * TAU;
        let top = match segment.feature {
            Feature::House { .. } => segment.top,
            Feature::Foliage(_) => {
                // Crowns are round, their outline is not.
                let across = (turn - segment.start) / (segment.end - segment.start) * 2.0 - 1.0;
                let height = segment.top - self.foot;
                let round = 0.55 + 0.45 * (1.0 - across * across).sqrt();
                self.foot + height * round * (0.8 + 0.4 * self.noise.around(turn, 90, 1, 3))
            }
        };
        Some((segment.feature, top, along))
    }

    fn color(&self, feature: &Feature, row: &MapRow, column: &MapColumn, top: f64, along: f64) -> [f64; 3] {
        match *feature {
            Feature::House { color, storey, bay, glass } => {
                let (below, bays) = ((top - row.tangent) / storey, along / bay);
                let [down, aside] = [below - below.floor(), bays - bays.floor()];
                let is_glass = below > 0.1 && (0.25..0.75).contains(&down) && (0.28..0.72).contains(&aside);
                let own = color.map(|c| c * LIT[0]);
                if is_glass { mix([glass * 0.5; 3], own, 0.15) } else { own }
            }
            Feature::Foliage(color) => {
                let at = [column.turn * 700.0, row.tangent * 110.0];
                let leaves = self.noise.fractal(at, 3);
                // Light falls on crowns from above.
                let height = ((row.tangent - self.foot) / (top - self.foot).max(1e-6)).clamp(0.0, 1.0);
                color.map(|c| c * LIT[0] * (0.25 + 1.5 * leaves) * (0.5 + height))
            }
        }
    }
}

/// Value noise in [0, 1].
struct ValueNoise(u64);

impl ValueNoise {
    fn lattice(&self, x: i64, y: i64) -> f64 {
        let mut h =
            self.0 ^ (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
        h = (h ^ h >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        h = (h ^ h >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((h ^ h >> 31) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn at(&self, [x, y]: [f64; 2]) -> f64 {
        let (left, low) = (x.floor(), y.floor());
        let (wx, wy) = (smooth(x - left), smooth(y - low));
        let corner = |dx: i64, dy: i64| self.lattice(left as i64 + dx, low as i64 + dy);
        let row = |dy: i64| corner(0, dy) * (1.0 - wx) + corner(1, dy) * wx;
        row(0) * (1.0 - wy) + row(1) * wy
    }

    /// Octaves of [`Self::at`].
    fn fractal(&self, [x, y]: [f64; 2], octaves: u32) -> f64 {
        let (mut sum, mut weights, mut scale) = (0.0, 0.0, 1.0);
        for octave in 0..octaves {
            let weight = 0.5_f64.powi(octave as i32);
            sum += weight * self.at([x * scale, y * scale + 37.0 * f64::from(octave)]);
            weights += weight;
            scale *= 2.0;
        }
        sum / weights
    }

    /// Octaves of noise around a circle, the first with `count` points; `row` distinguishes lines.
    fn around(&self, turn: f64, count: i64, row: i64, octaves: u32) -> f64 {
        let (mut sum, mut weights, mut count) = (0.0, 0.0, count);
        for octave in 0..octaves {
            let x = turn * count as f64;
            let left = x.floor();
            let w = smooth(x - left);
            let point =
                |dx: i64| self.lattice((left as i64 + dx).rem_euclid(count), 1000 * (row + 1) + i64::from(octave));
            let weight = 0.5_f64.powi(octave as i32);
            sum += weight * (point(0) * (1.0 - w) + point(1) * w);
            weights += weight;
            count *= 2;
        }
        sum / weights
    }
}

fn smooth(x: f64) -> f64 {
    x * x * (3.0 - 2.0 * x)
}

fn mix(a: [f64; 3], b: [f64; 3], w: f64) -> [f64; 3] {
    std::array::from_fn(|k| a[k] * (1.0 - w) + b[k] * w)
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::photometry::{level_irradiance, luminance};

    #[test]
    fn landscapes_have_a_bright_sky_over_darker_ground() {
        let mut sums = [0.0; 2];
        for seed in 0..12 {
            let stream = Stream::root(seed);
            let map = landscape(&stream).expect("sound");
            assert_eq!(map, landscape(&stream).expect("sound"), "the same stream, the same map");
            assert_ne!(map, landscape(&Stream::root(seed + 100)).expect("sound"));
            let sky = luminance(level_irradiance(&map)) / PI;
            let ground = luminance(map.irradiance(&-nalgebra::Vector3::z())) / PI;
            assert!((0.35..1.8).contains(&sky) && ground < 0.6 * sky && ground > 0.01, "{seed}: {sky} over {ground}");
            sums = [sums[0] + sky / 12.0, sums[1] + ground / 12.0];
            assert!(map.texels().iter().flatten().all(|&x| x < 4.0));
        }
        assert!((0.7..1.3).contains(&sums[0]), "{sums:?}");
    }
}
