//! Backgrounds that fill a box: landscapes, table tops, blurred rooms, waves.

use crate::material::{MaterialCanvas, ScalarField, SrgbColor, hsv, mix, shade};
use syntable_model::random::Stream;

/// A landscape: sky, sun, ridges and a field in perspective.
pub fn landscape(canvas: &mut MaterialCanvas, stream: &mut Stream, grain: &ScalarField, r: [f32; 4]) {
    let [w, h] = [r[2] - r[0], r[3] - r[1]];
    let evening = stream.chance(0.35);
    let high = if evening { hsv(0.06, 0.5, 0.85) } else { hsv(0.57, stream.uniform(0.4, 0.7), 0.85) };
    let low = if evening { hsv(0.12, 0.35, 0.98) } else { hsv(0.55, 0.12, 0.97) };
    let clouds = stream.uniform(0.0, 0.8) as f32;
    let horizon = stream.uniform(0.35, 0.55) as f32;
    canvas.paint(
        r,
        |_, _| -1.0,
        |x, y| {
            let t = (y - r[1]) / h;
            let sky = mix(high, low, t / horizon);
            let cloud = grain.sample((x - r[0]) / w * 50.0, t * 120.0);
            mix(sky, [0.98; 3], clouds * (1.4 * cloud).clamp(0.0, 1.0))
        },
    );
    let sun = [r[0] + stream.uniform(0.15, 0.85) as f32 * w, r[1] + (horizon - 0.12) * h];
    canvas.ellipse(sun, [0.09 * w.min(h); 2], mix(low, [1.0, 0.98, 0.85], 0.8));
    let field = hsv(stream.uniform(0.13, 0.33), stream.uniform(0.5, 0.75), stream.uniform(0.45, 0.75));
    for layer in 0..4 {
        let t = layer as f32 / 3.0;
        let top = horizon + 0.42 * (1.0 - horizon) * t * t;
        let color = mix(mix(low, shade(field, 0.7), 0.55), field, t);
        let (from, rough) = (stream.uniform(0.0, 100.0) as f32, 0.1 * (1.0 - 0.75 * t));
        canvas.paint(
            r,
            |x, y| {
                let ridge = grain.sample(from + (x - r[0]) / w * 34.0, 20.0 * layer as f32);
                r[1] + (top - rough * ridge) * h - y
            },
            |x, y| {
                let near = ((y - r[1]) / h - top).max(0.01);
                let rows = libm::sinf(9.0 * (x - r[0] - 0.5 * w) / w / (0.1 + near));
                let noise = grain.sample(0.9 * x, 0.9 * y + 31.0);
                shade(color, 0.9 + 0.12 * noise + 0.12 * rows * t + 0.3 * near)
            },
        );
    }
}

/// A blurred background of two tones with soft discs of light.
pub fn blur(canvas: &mut MaterialCanvas, stream: &mut Stream, r: [f32; 4], color: SrgbColor) {
    canvas.gradient(r, [mix(color, [1.0; 3], 0.35), shade(color, 0.6)]);
    let [w, h] = [r[2] - r[0], r[3] - r[1]];
    for _ in 0..stream.integer(4, 12) {
        let c = [r[0] + stream.unit() as f32 * w, r[1] + stream.unit() as f32 * h];
        let radius = stream.uniform(0.06, 0.25) as f32 * w.min(h);
        let strength = stream.uniform(0.08, 0.3) as f32;
        let tint = mix(color, [1.0, 0.97, 0.9], 0.75);
        canvas.blend([c[0] - radius, c[1] - radius, c[0] + radius, c[1] + radius], |x, y| {
            let d = ((x - c[0]) * (x - c[0]) + (y - c[1]) * (y - c[1])).sqrt() / radius;
            (tint, strength * (6.0 * (1.0 - d)).clamp(0.0, 1.0))
        });
    }
}

/// A table top of planks or cloth, darker to its edges.
pub fn table_top(canvas: &mut MaterialCanvas, stream: &mut Stream, grain: &ScalarField, r: [f32; 4]) {
    let [w, h] = [r[2] - r[0], r[3] - r[1]];
    let wood = stream.chance(0.6);
    let base = if wood {
        hsv(0.07, stream.uniform(0.3, 0.6), stream.uniform(0.3, 0.7))
    } else {
        hsv(stream.unit(), 0.15, 0.85)
    };
    let planks = stream.integer(3, 6) as f32;
    canvas.paint(
        r,
        |_, _| -1.0,
        |x, y| {
            let (u, v) = ((x - r[0]) / w, (y - r[1]) / h);
            let edge = 1.0 - 0.35 * (4.0 * (u - 0.5) * (u - 0.5) + 3.0 * (v - 0.5) * (v - 0.5));
            let tone = if wood {
                let row = v * planks;
                let gap = if row - row.floor() < 0.04 { 0.5 } else { 1.0 };
                let streak = grain.sample(8.0 * u + 17.0 * row.floor(), 110.0 * v);
                gap * (0.95 + 0.16 * streak)
            } else {
                let weave = libm::sinf(1.9 * x) * libm::sinf(1.9 * y);
                1.0 + 0.04 * weave + 0.06 * grain.sample(20.0 * u, 20.0 * v)
            };
            shade(base, tone * edge)
        },
    );
}

/// Translucent bands that swing across a box, as on detergents and medicine.
pub fn waves(canvas: &mut MaterialCanvas, stream: &mut Stream, r: [f32; 4], colors: [SrgbColor; 2]) {
    let [w, h] = [r[2] - r[0], r[3] - r[1]];
    for band in 0..stream.integer(3, 6) {
        let (from, amplitude) = (stream.uniform(0.2, 0.9) as f32, stream.uniform(0.05, 0.25) as f32);
        let (phase, turns) = (stream.uniform(0.0, std::f64::consts::TAU) as f32, stream.uniform(0.4, 1.1) as f32);
        let thick = stream.uniform(0.05, 0.35) as f32;
        let color = mix(colors[0], colors[1], band as f32 / 4.0);
        let alpha = stream.uniform(0.35, 0.9) as f32;
        canvas.blend(r, |x, y| {
            let (u, v) = ((x - r[0]) / w, (y - r[1]) / h);
            let middle = from + amplitude * libm::sinf(phase + std::f32::consts::TAU * turns * u) - 0.2 * u;
            let t = (v - middle) / (thick * (0.3 + u));
            let inside = ((1.0 - t.abs()) * 12.0).clamp(0.0, 1.0);
            (mix(color, [1.0; 3], 0.35 * (0.5 - 0.5 * t)), alpha * inside)
        });
    }
}

/// Drops or bubbles with highlights.
pub fn bubbles(canvas: &mut MaterialCanvas, stream: &mut Stream, r: [f32; 4], color: SrgbColor) {
    let [w, h] = [r[2] - r[0], r[3] - r[1]];
    for _ in 0..stream.integer(12, 40) {
        let c = [r[0] + stream.unit() as f32 * w, r[1] + stream.unit() as f32 * h];
        let radius = (0.01 + 0.1 * (stream.unit() * stream.unit()) as f32) * w.min(h);
        canvas.blend([c[0] - radius, c[1] - radius, c[0] + radius, c[1] + radius], |x, y| {
            let (dx, dy) = ((x - c[0]) / radius, (y - c[1]) / radius);
            let d = (dx * dx + dy * dy).sqrt();
            let shine = (1.0 - 9.0 * ((dx + 0.4) * (dx + 0.4) + (dy + 0.4) * (dy + 0.4))).max(0.0);
            let cover = ((1.0 - d) * radius + 0.5).clamp(0.0, 1.0);
            (mix(color, [1.0; 3], 0.2 + 0.3 * d + shine), cover * (0.15 + 0.7 * d * d * d + shine).min(1.0))
        });
    }
}

/// A splash: a wavy front with drops above it.
pub fn splash(canvas: &mut MaterialCanvas, stream: &mut Stream, grain: &ScalarField, r: [f32; 4], color: SrgbColor) {
    let [w, h] = [r[2] - r[0], r[3] - r[1]];
    let from = stream.uniform(0.0, 60.0) as f32;
    let top = stream.uniform(0.3, 0.5) as f32;
    let front = move |x: f32| {
        let u = (x - r[0]) / w;
        top + 0.22 * grain.sample(from + 40.0 * u, 7.0) + 0.3 * (u - 0.5) * (u - 0.5)
    };
    canvas.paint(
        r,
        |x, y| (front(x) - (y - r[1]) / h) * h,
        |x, y| {
            let slope = (front(x + 0.02 * w) - front(x - 0.02 * w)) * 14.0;
            let depth = (y - r[1]) / h - front(x);
            let fold = libm::sinf(26.0 * depth + 9.0 * grain.sample(x * 20.0 / w, from)) * libm::expf(-4.0 * depth);
            mix(shade(color, 0.8 + 0.16 * fold - 0.12 * slope), [1.0; 3], (0.25 - 5.0 * depth).clamp(0.0, 0.6))
        },
    );
    for _ in 0..stream.integer(6, 16) {
        let x = r[0] + stream.unit() as f32 * w;
        let y = r[1] + (front(x) - stream.uniform(0.02, 0.3) as f32) * h;
        let radius = stream.uniform(0.008, 0.035) as f32 * w.min(h);
        canvas.ellipse([x, y], [radius, 1.2 * radius], shade(color, 0.85));
        canvas.ellipse([x - 0.3 * radius, y - 0.4 * radius], [0.4 * radius; 2], mix(color, [1.0; 3], 0.6));
    }
}
