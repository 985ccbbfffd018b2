//! Knitted, quilted and printed textiles, and upholstery.

use super::Bake;
use super::color::{SrgbColor, hsv, mix, palette, shade};
use super::field::{ScalarField, smoothstep};
use std::f32::consts::{PI, TAU};
use syntable_model::random::Stream;

/// Texel centers in tiles, row by row.
fn positions(size: usize) -> impl Iterator<Item = (usize, f32, f32)> {
    let step = 1.0 / size as f32;
    (0..size * size).map(move |i| (i, ((i % size) as f32 + 0.5) * step, ((i / size) as f32 + 0.5) * step))
}

fn textile_color(stream: &mut Stream) -> SrgbColor {
    let muted = stream.chance(0.6);
    let saturation = if muted { stream.uniform(0.03, 0.3) } else { stream.uniform(0.4, 0.85) };
    hsv(stream.unit(), saturation, stream.uniform(0.2, 0.85))
}

/// Knitwear, 8 to 16 cm per tile: columns of V-shaped stitches, in one color, stripes or a jacquard; or ribs.
pub fn knit(stream: &mut Stream, size: usize) -> Bake {
    let columns = *stream.pick(&[16_usize, 20, 24, 32]).unwrap_or(&20);
    let rows = columns * 5 / 4;
    let (columns_f, rows_f) = (columns as f32, rows as f32);
    let [base, other] = [0, 1].map(|_| textile_color(stream));
    let pattern = stream.below(4);
    let ribs = if stream.chance(0.35) { 4 } else { 0 };
    let yarn = ScalarField::fractal(size, [size / 4, size / 4], 2, 0.7, stream);
    let clouds = ScalarField::fractal(size, [4, 4], 3, 0.5, stream);
    let (mut color, mut height) = (Vec::new(), Vec::new());
    for (i, x, y) in positions(size) {
        let (px, py) = (x * columns_f, y * rows_f);
        let (column, side) = (px as usize % columns, px.fract() - 0.5);
        // The two legs of a stitch lean towards its middle.
        let along = py + 0.9 * side.abs();
        let row = along as usize % rows;
        let across = (2.0 * side.abs() - 0.5).abs() * 2.0;
        let leg = (1.0 - across * across).max(0.0).sqrt() * (0.55 + 0.45 * libm::sinf(PI * along.fract()));
        let rib = if ribs > 0 && column % ribs < ribs / 2 { -1.8 } else { 0.0 };
        let marked = match pattern {
            0 => row * 6 / rows % 2 == 1,
            1 => (column % 8).abs_diff(4) + (row % 10).abs_diff(5) < 3,
            _ => false,
        };
        let noise = yarn.values()[i];
        height.push(2.6 * leg + 0.3 * noise + rib);
        let tone = 0.5 + 0.5 * leg + 0.06 * noise + 0.04 * clouds.values()[i] + 0.05 * rib;
        color.push(shade(if marked { other } else { base }, tone));
    }
    Bake {
        color,
        roughness: ScalarField::constant(size, stream.uniform(0.85, 1.0) as f32),
        height: ScalarField::of(size, height),
        metallic: 0.0,
        tile_m: stream.uniform(0.08, 0.16) as f32,
    }
}

/// Quilted cloth, 0.2 to 0.4 m per tile: pillows between stitched seams in squares, diamonds or channels.
pub fn quilt(stream: &mut Stream, size: usize) -> Bake {
    let count = *stream.pick(&[3.0_f32, 4.0, 6.0]).unwrap_or(&4.0);
    let style = stream.below(3);
    let base = textile_color(stream);
    let thread = mix(base, [0.9; 3], stream.uniform(0.0, 0.5) as f32);
    let puff = 0.09 * size as f32 / count;
    let wrinkles = ScalarField::fractal(size, [8, 8], 3, 0.55, stream);
    let weave = ScalarField::noise(size, [size / 2, size / 2], stream);
    let gloss = stream.uniform(0.5, 0.95) as f32;
    let (mut color, mut height, mut roughness) = (Vec::new(), Vec::new(), Vec::new());
    for (i, x, y) in positions(size) {
        let (p, q) = match style {
            0 => (x * count, y * count),
            1 => ((x + y) * count, (x - y + 1.0) * count),
            _ => (0.5, y * count),
        };
        let edge = |t: f32| (t - (t + 0.5).floor()).abs();
        let nearest = edge(p).min(edge(q));
        let seam = 1.0 - smoothstep(0.0, 0.03, nearest);
        let along = if edge(p) < edge(q) { q } else { p + x * count };
        let stitch = seam * if (along * 14.0).fract() < 0.65 { 1.0 } else { 0.0 };
        let (a, b) = (libm::sinf(PI * p.fract()), libm::sinf(PI * q.fract()));
        let pillow = if style == 2 { b } else { a * b };
        let wrinkle = wrinkles.values()[i] * (1.0 - smoothstep(0.02, 0.3, nearest));
        height.push(puff * pillow.max(0.0).sqrt() * 2.0 + 1.2 * wrinkle + 0.8 * stitch + 0.1 * weave.values()[i]);
        let tone = 1.0 - 0.3 * seam + 0.04 * weave.values()[i] + 0.03 * wrinkle;
        color.push(mix(shade(base, tone), thread, 0.8 * stitch));
        roughness.push(gloss + 0.03 * weave.values()[i]);
    }
    Bake {
        color,
        roughness: ScalarField::of(size, roughness).map(|r| r.min(1.0)),
        height: ScalarField::of(size, height),
        metallic: 0.0,
        tile_m: stream.uniform(0.2, 0.4) as f32,
    }
}

/// Table linen, 0.2 to 0.5 m per tile: checks, stripes, dots or flowers on a plain weave.
pub fn tablecloth(stream: &mut Stream, size: usize) -> Bake {
    let [ground, main, accent, _] = palette(stream);
    let cloth = if stream.chance(0.6) { hsv(0.11, stream.uniform(0.0, 0.12), 0.93) } else { ground };
    let style = stream.below(5);
    let count = *stream.pick(&[4.0_f32, 6.0, 8.0, 10.0]).unwrap_or(&6.0);
    let flowers: Vec<[f32; 5]> = (0..14).map(|_| std::array::from_fn(|_| stream.unit() as f32)).collect();
    let green = hsv(stream.uniform(0.22, 0.4), 0.55, 0.5);
    let weave = ScalarField::noise(size, [size / 2, size / 2], stream);
    let folds = ScalarField::fractal(size, [3, 3], 4, 0.5, stream);
    let (mut color, mut height) = (Vec::new(), Vec::new());
    for (i, x, y) in positions(size) {
        let half = |t: f32| (t * count).fract() < 0.5;
        let printed = match style {
            // Gingham: two half tones add up where stripes cross.
            0 => mix(cloth, main, 0.5 * (u8::from(half(x)) + u8::from(half(y))) as f32),
            1 => {
                let thin = |t: f32| (t * count).fract() < 0.08 || (t * count + 0.3).fract() < 0.05;
                let bands = 0.45 * (u8::from(half(x)) + u8::from(half(y))) as f32;
                let cover = mix(cloth, main, bands);
                if thin(x) || thin(y) { mix(cover, accent, 0.7) } else { cover }
            }
            2 => {
                let (dx, dy) = ((x * count).fract() - 0.5, (y * count + 0.5 * (x * count).floor()).fract() - 0.5);
                if dx * dx + dy * dy < 0.05 { main } else { cloth }
            }
            3 => {
                if half(x) {
                    mix(cloth, main, 0.85)
                } else {
                    cloth
                }
            }
            _ => flower_print([x, y], &flowers, [cloth, main, accent, green]),
        };
        let noise = weave.values()[i];
        color.push(shade(printed, 1.0 + 0.05 * noise + 0.02 * folds.values()[i]));
        height.push(0.35 * noise + 2.5 * folds.values()[i]);
    }
    Bake {
        color,
        roughness: ScalarField::constant(size, stream.uniform(0.75, 0.95) as f32),
        height: ScalarField::of(size, height),
        metallic: 0.0,
        tile_m: stream.uniform(0.2, 0.5) as f32,
    }
}

/// The color at a position of a tile with flowers: center, radius, turn and color of each are random numbers.
fn flower_print([x, y]: [f32; 2], flowers: &[[f32; 5]], colors: [SrgbColor; 4]) -> SrgbColor {
    let [cloth, main, accent, green] = colors;
    let wrap = |t: f32| t - (t + 0.5).floor();
    let mut color = cloth;
    for [cx, cy, size, turn, tone] in flowers {
        let radius = 0.05 + 0.06 * size;
        let (dx, dy) = (wrap(x - cx) / radius, wrap(y - cy) / radius);
        let distance = (dx * dx + dy * dy).sqrt();
        if distance > 1.7 {
            continue;
        }
        let angle = libm::atan2f(dy, dx) + turn * TAU;
        let leaf = libm::cosf(2.0 * angle);
        if leaf > 0.0 && distance < 1.6 * leaf * leaf {
            color = shade(green, 0.8 + 0.3 * distance);
        }
        let petal = 0.72 + 0.28 * libm::cosf(5.0 * angle);
        if distance < petal {
            let hue = mix(main, accent, if *tone < 0.5 { 0.0 } else { 0.9 });
            color = mix(mix(hue, [0.97; 3], 0.35), hue, distance);
        }
        if distance < 0.22 {
            color = mix(accent, [0.95, 0.8, 0.3], 0.7);
        }
    }
    color
}

/// Upholstery, 0.6 to 1.2 m per tile: cushions of woven cloth with piped seams, some with buttons.
pub fn upholstery(stream: &mut Stream, size: usize) -> Bake {
    let base = textile_color(stream);
    let fleck = mix(base, textile_color(stream), stream.uniform(0.05, 0.35) as f32);
    let count = *stream.pick(&[[1.0_f32, 1.0], [2.0, 1.0], [2.0, 2.0]]).unwrap_or(&[1.0, 1.0]);
    let buttons = stream.chance(0.35);
    let threads = (size / 4) as f32;
    let weave = ScalarField::noise(size, [size / 3, size / 3], stream);
    let wear = ScalarField::fractal(size, [3, 3], 4, 0.55, stream);
    let puff = 0.05 * size as f32;
    let pipe = 0.008;
    let (mut color, mut height) = (Vec::new(), Vec::new());
    for (i, x, y) in positions(size) {
        let (p, q) = ((x * count[0] + 0.5).fract(), (y * count[1] + 0.5).fract());
        let (ex, ey) = (p.min(1.0 - p) / count[0], q.min(1.0 - q) / count[1]);
        let edge = ex.min(ey);
        let piping = (1.0 - (edge / pipe - 1.6) * (edge / pipe - 1.6)).max(0.0).sqrt();
        let gap = 1.0 - smoothstep(0.0, 0.6 * pipe, edge);
        let pillow = (4.0 * p * (1.0 - p)).min(1.0) * (4.0 * q * (1.0 - q)).min(1.0);
        let mut rise = puff * pillow.sqrt();
        let mut dark = 0.35 * gap;
        if buttons {
            let (bx, by) = ((p * 2.0).fract() - 0.5, (q * 2.0).fract() - 0.5);
            let d = (bx * bx + by * by).sqrt();
            rise -= 0.4 * puff * libm::expf(-18.0 * d);
            dark += 0.3 * (1.0 - smoothstep(0.03, 0.06, d));
        }
        let thread = libm::sinf(TAU * threads * x) * libm::sinf(TAU * threads * y);
        let noise = weave.values()[i];
        height.push(rise + 3.0 * piping - 2.0 * gap + 0.35 * thread + 0.35 * noise + 1.5 * wear.values()[i]);
        let tone = 1.0 - dark + 0.12 * piping + 0.07 * thread + 0.05 * wear.values()[i];
        color.push(shade(mix(base, fleck, (0.5 + 0.9 * noise).clamp(0.0, 1.0)), tone));
    }
    Bake {
        color,
        roughness: ScalarField::constant(size, stream.uniform(0.85, 1.0) as f32),
        height: ScalarField::of(size, height),
        metallic: 0.0,
        tile_m: stream.uniform(0.6, 1.2) as f32,
    }
}
