//! Worktops, laminate, cork and stitched leather.

use super::Bake;
use super::color::{hsv, mix, shade};
use super::field::{ScalarField, smoothstep};
use super::natural;
use syntable_model::random::Stream;

/// Laminate panels with joints, 0.8 to 1.6 m per tile: plain, speckled or printed with wood.
pub fn laminate(stream: &mut Stream, size: usize) -> Bake {
    let style = stream.below(3);
    let wood = natural::timber(&mut stream.child("wood"), size);
    let neutral = stream.chance(0.6);
    let saturation = if neutral { stream.uniform(0.0, 0.1) } else { stream.uniform(0.2, 0.6) };
    let base = hsv(stream.unit(), saturation, stream.uniform(0.3, 0.93));
    let speck = mix(base, hsv(stream.unit(), 0.2, stream.uniform(0.1, 0.9)), 0.6);
    let count = *stream.pick(&[[1_usize, 1], [2, 1], [1, 2], [2, 2]]).unwrap_or(&[1, 1]);
    let tile_m = stream.uniform(0.8, 1.6) as f32;
    let joint = (0.0012 / tile_m).max(0.8 / size as f32);
    let [near, _, id] = ScalarField::cells(size, size / 6, 1.0, stream);
    let clouds = ScalarField::fractal(size, [4, 4], 4, 0.55, stream);
    let pores = ScalarField::noise(size, [size / 3, size / 3], stream);
    let gloss = stream.uniform(0.2, 0.55) as f32;
    let tones: Vec<f32> = (0..4).map(|_| stream.uniform(-0.04, 0.04) as f32).collect();
    let (mut color, mut roughness, mut height) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..size * size {
        let [x, y] = [i % size, i / size].map(|k| (k as f32 + 0.5) / size as f32);
        // Tiles meet in the middle of a panel.
        let (px, py) = (x * count[0] as f32 + 0.5, y * count[1] as f32 + 0.5);
        let panel = px as usize % count[0] + 2 * (py as usize % count[1]);
        let edge = |t: f32, n: usize| t.fract().min(1.0 - t.fract()) / n as f32;
        let nearest = edge(px, count[0]).min(edge(py, count[1]));
        let groove = 1.0 - smoothstep(0.5 * joint, 1.5 * joint, nearest);
        let printed = match style {
            0 => shade(base, 1.0 + 0.02 * clouds.values()[i]),
            1 => {
                let dot = if id.values()[i] < 0.4 { 1.0 - smoothstep(0.15, 0.4, near.values()[i]) } else { 0.0 };
                mix(base, speck, dot)
            }
            _ => wood.color[i],
        };
        color.push(mix(shade(printed, 1.0 + tones[panel]), shade(base, 0.25), 0.8 * groove));
        roughness.push((gloss + 0.03 * clouds.values()[i] + 0.3 * groove).clamp(0.05, 1.0));
        height.push(0.12 * pores.values()[i] - 2.2 * groove);
    }
    let [roughness, height] = [roughness, height].map(|values| ScalarField::of(size, values));
    Bake { color, roughness, height, metallic: 0.0, tile_m }
}

/// Cork, 0.2 to 0.5 m per tile: pressed granules of several browns.
pub fn cork(stream: &mut Stream, size: usize) -> Bake {
    let hue = stream.uniform(0.07, 0.1);
    let pale = hsv(hue, stream.uniform(0.4, 0.55), stream.uniform(0.62, 0.82));
    let dark = hsv(hue - 0.01, 0.6, stream.uniform(0.2, 0.4));
    let [near, next, id] = ScalarField::cells(size, size / stream.integer(8, 16) as usize, 1.0, stream);
    let [_, _, fine] = ScalarField::cells(size, size / 4, 1.0, stream);
    let clouds = ScalarField::fractal(size, [5, 5], 4, 0.6, stream);
    let color = (0..size * size).map(|i| {
        let number = id.values()[i];
        let gap = 1.0 - smoothstep(0.02, 0.12, next.values()[i] - near.values()[i]);
        let bark = if fine.values()[i] < 0.07 { 0.8 } else { 0.0 };
        let body = shade(mix(pale, dark, 0.45 * number * number), 0.94 + 0.16 * (number - 0.5));
        shade(mix(mix(body, dark, bark), shade(dark, 0.8), 0.5 * gap), 1.0 + 0.05 * clouds.values()[i])
    });
    Bake {
        color: color.collect(),
        roughness: clouds.map(|c| 0.85 + 0.05 * c),
        height: near
            .zip(&next, |a, b| 1.4 * smoothstep(0.0, 0.25, b - a))
            .zip(&fine, |h, f| h - if f < 0.12 { 1.2 } else { 0.0 }),
        metallic: 0.0,
        tile_m: stream.uniform(0.2, 0.5) as f32,
    }
}

/// Leather sewn from panels, 0.4 to 0.8 m per tile: double seams with thread, creases along them.
pub fn stitched_leather(stream: &mut Stream, size: usize) -> Bake {
    let hide = natural::leather(stream, size);
    let thread = hsv(stream.unit(), stream.uniform(0.0, 0.4), stream.uniform(0.1, 0.95));
    let count = *stream.pick(&[[1.0_f32, 1.0], [2.0, 1.0], [3.0, 1.0], [2.0, 2.0]]).unwrap_or(&[1.0, 1.0]);
    let tile_m = stream.uniform(0.4, 0.8) as f32;
    let folds = ScalarField::fractal(size, [5, 14], 4, 0.55, stream);
    // Stitches of 5 mm, a whole number of them to a tile.
    let stitches = (tile_m / 0.005).round();
    let (aside, wide) = ((0.006 / tile_m).max(3.0 / size as f32), (0.0012 / tile_m).max(0.9 / size as f32));
    let puff = 0.025 * size as f32;
    let (mut color, mut roughness, mut height) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..size * size {
        let [x, y] = [i % size, i / size].map(|k| (k as f32 + 0.5) / size as f32);
        let edge = |t: f32, n: f32| (t * n + 0.5).fract().min(1.0 - (t * n + 0.5).fract()) / n;
        let (ex, ey) = (edge(x, count[0]), edge(y, count[1]));
        let (nearest, along) = if ex < ey { (ex, y) } else { (ey, x) };
        let groove = 1.0 - smoothstep(0.3 * aside, 0.7 * aside, nearest);
        let line = 1.0 - smoothstep(0.6 * wide, 1.4 * wide, (nearest - aside).abs());
        let stitch = line * if (along * stitches).fract() < 0.7 { 1.0 } else { 0.0 };
        let swell = (nearest / (10.0 * aside)).min(1.0);
        let crease = folds.values()[i] * libm::expf(-nearest / (5.0 * aside));
        color.push(mix(shade(hide.color[i], 1.0 - 0.45 * groove + 0.05 * crease), thread, stitch));
        roughness.push((hide.roughness.values()[i] + 0.2 * stitch + 0.1 * groove).min(1.0));
        height.push(
            hide.height.values()[i] + puff * (swell * (2.0 - swell)).sqrt() + 2.5 * crease + 1.2 * stitch - 1.5 * line,
        );
    }
    let [roughness, height] = [roughness, height].map(|values| ScalarField::of(size, values));
    Bake { color, roughness, height, metallic: 0.0, tile_m }
}

/// A used worktop, 0.6 to 1.2 m per tile: wood or composite with scratches, rings of cups and stains.
pub fn worktop(stream: &mut Stream, size: usize) -> Bake {
    let mut top =
        if stream.chance(0.6) { natural::timber(stream, size) } else { laminate_without_joints(stream, size) };
    let stain = hsv(stream.uniform(0.05, 0.1), 0.6, stream.uniform(0.1, 0.3));
    let pale = stream.chance(0.5);
    let blots = ScalarField::fractal(size, [4, 4], 5, 0.6, stream);
    let rings: Vec<[f32; 4]> =
        (0..stream.integer(1, 5)).map(|_| std::array::from_fn(|_| stream.unit() as f32)).collect();
    let threshold = stream.uniform(0.4, 1.1) as f32;
    let tile_m = stream.uniform(0.6, 1.2) as f32;
    let wrap = |t: f32| t - (t + 0.5).floor();
    let mut gloss = vec![0.0; size * size];
    for (i, gloss) in gloss.iter_mut().enumerate() {
        let [x, y] = [i % size, i / size].map(|k| (k as f32 + 0.5) / size as f32);
        let blot = 0.22 * smoothstep(threshold, threshold + 0.6, blots.values()[i]);
        let mark = rings.iter().fold(0.0_f32, |mark, [cx, cy, edge, strength]| {
            let radius = (0.03 + 0.02 * edge) / tile_m;
            let (dx, dy) = (wrap(x - cx), wrap(y - cy));
            let off = ((dx * dx + dy * dy).sqrt() - radius).abs() * tile_m / 0.0025;
            let broken = (0.5 + 0.8 * blots.at(i % size + 37, i / size + (cx * 99.0) as usize)).clamp(0.0, 1.0);
            mark.max((0.25 + 0.5 * strength) * broken * (1.0 - off).max(0.0))
        });
        let tint = if pale { mix(top.color[i], [0.9; 3], 0.8) } else { stain };
        top.color[i] = mix(mix(top.color[i], stain, blot), tint, mark);
        *gloss += 0.15 * blot + 0.2 * mark;
    }
    let mut cuts = vec![0.0_f32; size * size];
    for _ in 0..stream.integer(12, 70) {
        scratch(stream, size, &mut cuts);
    }
    for (i, cut) in cuts.iter().enumerate() {
        let light = mix(top.color[i], [0.85, 0.8, 0.72], 0.5);
        top.color[i] = mix(top.color[i], light, 0.6 * cut);
        gloss[i] += 0.2 * cut;
    }
    top.roughness = top.roughness.zip(&ScalarField::of(size, gloss), |a, b| (a + b).clamp(0.05, 1.0));
    top.height = top.height.zip(&ScalarField::of(size, cuts), |a, b| a - 0.8 * b);
    top.tile_m = tile_m;
    top
}

fn laminate_without_joints(stream: &mut Stream, size: usize) -> Bake {
    let base = hsv(stream.uniform(0.05, 0.6), stream.uniform(0.0, 0.15), stream.uniform(0.35, 0.9));
    let clouds = ScalarField::fractal(size, [6, 6], 5, 0.6, stream);
    let grain = ScalarField::noise(size, [size / 2, size / 2], stream);
    let gloss = stream.uniform(0.25, 0.5) as f32;
    let tones = clouds.values().iter().zip(grain.values());
    Bake {
        color: tones.map(|(c, g)| shade(base, 1.0 + 0.04 * c + 0.05 * g)).collect(),
        roughness: clouds.map(|c| gloss + 0.04 * c),
        height: grain.map(|g| 0.15 * g),
        metallic: 0.0,
        tile_m: 1.0,
    }
}

/// A slightly bent scratch that wraps around the tile's edges.
fn scratch(stream: &mut Stream, size: usize, cuts: &mut [f32]) {
    let n = size as f32;
    let (mut x, mut y) = (stream.unit() as f32 * n, stream.unit() as f32 * n);
    let mut angle = stream.uniform(0.0, std::f64::consts::TAU) as f32;
    let turn = stream.uniform(-0.012, 0.012) as f32;
    let (length, depth) = ((stream.uniform(0.03, 0.35) as f32 * n) as usize, stream.uniform(0.2, 1.0) as f32);
    for step in 0..length {
        let t = step as f32 / length as f32;
        let strength = depth * (4.0 * t * (1.0 - t)).min(1.0);
        let (column, row) = (x.rem_euclid(n) as usize % size, y.rem_euclid(n) as usize % size);
        let cell = &mut cuts[row * size + column];
        *cell = cell.max(strength);
        let (sin, cos) = libm::sincosf(angle);
        (x, y, angle) = (x + cos, y + sin, angle + turn);
    }
}
