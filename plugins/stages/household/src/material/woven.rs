//! Cloth, velvet and carpet.

use super::Bake;
use super::color::{SrgbColor, hsv, mix, palette, shade};
use super::field::ScalarField;
use std::f32::consts::PI;
use syntable_model::random::Stream;

/// Weave pattern: determines the top thread where thread `x` of the warp crosses thread `y` of the weft.
#[derive(Clone, Copy)]
enum Weave {
    Plain,
    Twill,
    Basket,
}

impl Weave {
    fn warp_on_top(self, x: usize, y: usize) -> bool {
        match self {
            Self::Plain => (x + y).is_multiple_of(2),
            Self::Twill => (x + y) % 4 < 2,
            Self::Basket => (x / 2 + y / 2).is_multiple_of(2),
        }
    }
}

/// Woven cloth, 6 to 12 cm per tile: threads of half a millimeter to a millimeter at 512 texels.
pub fn fabric(stream: &mut Stream, size: usize) -> Bake {
    let threads = (size / 4).max(4) / 4 * 4;
    let weave = *stream.pick(&[Weave::Plain, Weave::Twill, Weave::Basket]).unwrap_or(&Weave::Plain);
    let [background, main, accent, _] = palette(stream);
    let stripes = |stream: &mut Stream| -> Vec<SrgbColor> {
        let period = threads / *stream.pick(&[1_usize, 2, 4]).unwrap_or(&1);
        let [a, b] = [stream.uniform(0.2, 0.6), stream.uniform(0.65, 0.95)].map(|t| (t * period as f64) as usize);
        (0..threads)
            .map(|i| match i % period {
                t if t < a => background,
                t if t < b => main,
                _ => accent,
            })
            .collect()
    };
    let plain = vec![background; threads];
    let (warp, weft) = match stream.below(4) {
        0 => (plain.clone(), plain),
        1 => (plain, vec![main; threads]),
        2 => (stripes(stream), plain),
        _ => (stripes(stream), stripes(stream)),
    };
    let slub = ScalarField::fractal(size, [threads / 2, threads / 2], 3, 0.6, stream);
    let mut height = Vec::with_capacity(size * size);
    let mut color = Vec::with_capacity(size * size);
    for y in 0..size {
        let py = (y as f32 + 0.5) / size as f32 * threads as f32;
        let (iy, ty) = (py as usize, py.fract());
        for x in 0..size {
            let px = (x as f32 + 0.5) / size as f32 * threads as f32;
            let (ix, tx) = (px as usize, px.fract());
            let warp_on_top = weave.warp_on_top(ix, iy);
            // A thread has a round cross section and rises where it is on top.
            let (across, along) = if warp_on_top { (tx, ty) } else { (ty, tx) };
            let bulge = libm::sinf(PI * across) * (0.55 + 0.45 * libm::sinf(PI * along));
            let noise = slub.values()[y * size + x];
            height.push(2.2 * bulge + 0.25 * noise);
            let thread = if warp_on_top { warp[ix] } else { weft[iy] };
            color.push(shade(thread, 0.55 + 0.42 * bulge + 0.05 * noise));
        }
    }
    Bake {
        color,
        roughness: ScalarField::constant(size, stream.uniform(0.8, 0.98) as f32),
        height: ScalarField::of(size, height),
        metallic: 0.0,
        tile_m: stream.uniform(0.06, 0.12) as f32,
    }
}

/// Carpet, 0.5 to 1 m per tile.
pub fn carpet(stream: &mut Stream, size: usize) -> Bake {
    let base = hsv(stream.unit(), stream.uniform(0.05, 0.55), stream.uniform(0.2, 0.7));
    let other = mix(hsv(stream.unit(), 0.4, stream.uniform(0.3, 0.8)), base, 0.4);
    let [near, _, id] = ScalarField::cells(size, size / 5, 1.0, stream);
    let wear = ScalarField::fractal(size, [3, 3], 4, 0.6, stream);
    let pattern = stream.below(5);
    let count = *stream.pick(&[2.0_f32, 3.0, 4.0]).unwrap_or(&2.0);
    let marked = |x: f32, y: f32| -> bool {
        let (px, py) = ((x * count).fract() - 0.5, (y * count).fract() - 0.5);
        match pattern {
            0 => px.abs() + py.abs() < 0.3,
            1 => px.abs() < 0.15,
            2 => px * px + py * py < 0.08 && px * px + py * py > 0.02,
            _ => false,
        }
    };
    let tuft = near.map(|d| 1.0 - d.min(1.0));
    let color = (0..size * size).map(|i| {
        let (x, y) = ((i % size) as f32 / size as f32, (i / size) as f32 / size as f32);
        let tone = 0.6 + 0.4 * tuft.values()[i] + 0.2 * (id.values()[i] - 0.5) + 0.06 * wear.values()[i];
        shade(if marked(x, y) { other } else { base }, tone)
    });
    Bake {
        color: color.collect(),
        roughness: ScalarField::constant(size, 1.0),
        height: tuft.zip(&id, |t, i| 3.0 * t + 1.2 * i),
        metallic: 0.0,
        tile_m: stream.uniform(0.5, 1.0) as f32,
    }
}

/// Velvet, 0.3 to 0.6 m per tile: dark at the base, its pile brushed in patches.
pub fn velvet(stream: &mut Stream, size: usize) -> Bake {
    let base = hsv(stream.unit(), stream.uniform(0.3, 0.85), stream.uniform(0.12, 0.5));
    let strokes = ScalarField::fractal(size, [4, 9], 4, 0.55, stream);
    let pile = ScalarField::fractal(size, [size / 4, size / 4], 2, 0.6, stream);
    Bake {
        color: strokes
            .values()
            .iter()
            .zip(pile.values())
            .map(|(&s, &p)| shade(base, 1.0 + 0.18 * s + 0.08 * p))
            .collect(),
        roughness: ScalarField::constant(size, stream.uniform(0.85, 1.0) as f32),
        height: strokes.zip(&pile, |s, p| 3.0 * s + 0.6 * p),
        metallic: 0.0,
        tile_m: stream.uniform(0.3, 0.6) as f32,
    }
}
