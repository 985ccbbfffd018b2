//! A little path tracer of balls and boxes in a closed room, so that denoisers have something true to work on: direct
//! light from a panel and a globe, bounced light, a brushed metal, checkers and stripes. Every sample is independent.

#![allow(dead_code)]

use syntable_model::context::Workers;
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    ALBEDO_MEAN, DEPTH, INSTANCE, LEAST_TINT, NORMAL_MEAN, RADIANCE, RADIANCE_GLOSS, RADIANCE_GLOSS_VARIANCE,
    RADIANCE_UNTINTED, RADIANCE_UNTINTED_VARIANCE,
};
use syntable_testing::workers::Threads;

type V = [f64; 3];

fn add(a: V, b: V) -> V {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
fn scale(a: V, s: f64) -> V {
    a.map(|x| x * s)
}
fn times(a: V, b: V) -> V {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2]]
}
fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
fn unit(a: V) -> V {
    scale(a, 1.0 / dot(a, a).sqrt())
}
/// Relative luminance of linear Rec. 709.
pub fn luminance(c: [f32; 3]) -> f32 {
    0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]
}

/// SplitMix64.
struct Random(u64);
impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A direction about `axis` with density ∝ cosᵏ.
fn lobe(axis: V, k: f64, random: &mut Random) -> V {
    let (cos, phi) = (random.next().powf(1.0 / (k + 1.0)), random.next() * std::f64::consts::TAU);
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let side = unit(cross(axis, if axis[0].abs() < 0.5 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] }));
    let other = cross(axis, side);
    add(scale(axis, cos), add(scale(side, sin * phi.cos()), scale(other, sin * phi.sin())))
}

#[derive(Clone, Copy)]
enum Shape {
    Ball(V, f64),
    /// Seen from outside.
    Box(V, V),
    /// Seen from inside.
    Room(V, V),
}

#[derive(Clone, Copy)]
enum Paint {
    Plain(V),
    Checker(V, V, f64),
    Stripes(V, V, f64),
    /// Brushed metal with the exponent of its lobe.
    Metal(V, f64),
}

struct Hit {
    t: f64,
    at: V,
    normal: V,
    body: usize,
}

const PANEL: (V, f64, f64, V) = ([0.3, 0.4, 2.6], 0.5, 0.3, [1000.0, 950.0, 850.0]);
const GLOBE: (V, f64, V) = ([-0.9, -0.3, 1.9], 0.08, [9000.0, 6500.0, 4000.0]);

fn bodies() -> Vec<(Shape, Paint)> {
    use Paint::*;
    use Shape::*;
    let mut bodies = vec![
        (Room([-2.5, -2.5, 0.0], [2.5, 2.5, 2.7]), Plain([0.72, 0.69, 0.62])),
        (Box([-0.6, -0.4, 0.7], [0.6, 0.4, 0.74]), Stripes([0.55, 0.36, 0.2], [0.35, 0.2, 0.1], 40.0)),
        (Box([-2.5, -2.5, 0.0], [2.5, 2.5, 0.001]), Checker([0.6, 0.58, 0.5], [0.25, 0.22, 0.2], 0.3)),
        (Box([-0.35, 0.1, 0.74], [-0.2, 0.22, 0.86]), Checker([0.8, 0.1, 0.08], [0.75, 0.7, 0.6], 0.03)),
        (Box([0.18, -0.3, 0.74], [0.36, -0.18, 0.80]), Plain([0.1, 0.35, 0.7])),
        (Box([0.02, 0.2, 0.74], [0.05, 0.23, 1.0]), Plain([0.8, 0.8, 0.75])),
    ];
    let paints = [
        Plain([0.7, 0.3, 0.2]),
        Metal([0.9, 0.75, 0.4], 60.0),
        Stripes([0.1, 0.5, 0.2], [0.8, 0.8, 0.3], 120.0),
        Plain([0.05, 0.05, 0.06]),
        Metal([0.8, 0.8, 0.82], 400.0),
        Plain([0.8, 0.78, 0.74]),
        Checker([0.1, 0.2, 0.6], [0.8, 0.8, 0.8], 0.02),
    ];
    let places = [
        (0.0, 0.0, 0.07),
        (0.17, 0.03, 0.06),
        (-0.15, -0.08, 0.06),
        (-0.02, -0.2, 0.05),
        (0.3, 0.18, 0.08),
        (-0.32, -0.2, 0.07),
        (0.1, -0.14, 0.04),
    ];
    bodies.extend(places.iter().zip(paints).map(|(&(x, y, r), paint)| (Ball([x, y, 0.74 + r], r), paint)));
    bodies
}

pub struct Room {
    bodies: Vec<(Shape, Paint)>,
    eye: V,
    axes: [V; 3],
    focal: f64,
    centre: [f64; 2],
    /// Size of the picture, px.
    pub size: [u32; 2],
}

/// What a camera sees.
pub struct Seen {
    pub radiance: [f64; 3],
    pub albedo: V,
    pub normal: V,
}

impl Room {
    /// A picture of `width × height` of a camera whose focal length is 600 px, looking at the table.
    pub fn new(width: u32, height: u32) -> Self {
        let (eye, target) = ([0.75, -1.0, 1.5], [0.0, 0.02, 0.78]);
        let forward = unit(add(target, scale(eye, -1.0)));
        let right = unit(cross(forward, [0.0, 0.0, 1.0]));
        let down = cross(forward, right);
        let (w, h) = (f64::from(width), f64::from(height));
        Self {
            bodies: bodies(),
            eye,
            axes: [right, down, forward],
            focal: 600.0,
            centre: [w / 2.0, h / 2.0],
            size: [width, height],
        }
    }

    fn ray(&self, u: f64, v: f64) -> V {
        let (x, y) = ((u - self.centre[0]) / self.focal, (v - self.centre[1]) / self.focal);
        add(self.axes[2], add(scale(self.axes[0], x), scale(self.axes[1], y)))
    }

    fn hit(&self, origin: V, direction: V, limit: f64) -> Option<Hit> {
        let mut best = limit;
        let mut found = None;
        for (body, &(shape, _)) in self.bodies.iter().enumerate() {
            match shape {
                Shape::Ball(centre, r) => {
                    if let Some(t) = ball(origin, direction, centre, r)
                        && t < best
                    {
                        best = t;
                        let at = add(origin, scale(direction, t));
                        found = Some((body, unit(add(at, scale(centre, -1.0)))));
                    }
                }
                Shape::Box(low, high) | Shape::Room(low, high) => {
                    let inside = matches!(shape, Shape::Room(..));
                    let (mut enter, mut leave, mut axes) = (f64::NEG_INFINITY, f64::INFINITY, [0, 0]);
                    for i in 0..3 {
                        let (a, b) = ((low[i] - origin[i]) / direction[i], (high[i] - origin[i]) / direction[i]);
                        if a.min(b) > enter {
                            (enter, axes[0]) = (a.min(b), i);
                        }
                        if a.max(b) < leave {
                            (leave, axes[1]) = (a.max(b), i);
                        }
                    }
                    let (t, axis) = if inside { (leave, axes[1]) } else { (enter, axes[0]) };
                    if enter <= leave && t > 1e-6 && t < best {
                        best = t;
                        let mut normal = [0.0; 3];
                        normal[axis] = -direction[axis].signum();
                        found = Some((body, normal));
                    }
                }
            }
        }
        let (body, normal) = found?;
        Some(Hit { t: best, at: add(origin, scale(direction, best)), normal, body })
    }

    fn emitted(&self, origin: V, direction: V, limit: f64) -> Option<V> {
        let mut nearest = limit;
        let mut found = None;
        if let Some(t) = ball(origin, direction, GLOBE.0, GLOBE.1)
            && t < nearest
        {
            nearest = t;
            found = Some(GLOBE.2);
        }
        let t = (PANEL.0[2] - origin[2]) / direction[2];
        let at = add(origin, scale(direction, t));
        if t > 1e-6
            && t < nearest
            && direction[2] > 0.0
            && (at[0] - PANEL.0[0]).abs() < PANEL.1
            && (at[1] - PANEL.0[1]).abs() < PANEL.2
        {
            found = Some(PANEL.3);
        }
        found
    }

    fn paint(&self, hit: &Hit) -> (V, Option<f64>) {
        let pick = |a: V, b: V, on: bool| if on { a } else { b };
        match self.bodies[hit.body].1 {
            Paint::Plain(c) => (c, None),
            Paint::Checker(a, b, s) => {
                let p = hit.at.map(|x| ((x + 1e-5) / s).floor() as i64);
                (pick(a, b, (p[0] + p[1] + p[2]).rem_euclid(2) == 0), None)
            }
            Paint::Stripes(a, b, k) => {
                let t = 0.5 + 0.5 * (k * (hit.at[0] + 0.3 * hit.at[2] + 0.02 * (30.0 * hit.at[1]).sin())).sin();
                (add(scale(a, t), scale(b, 1.0 - t)), None)
            }
            Paint::Metal(c, k) => (c, Some(k)),
        }
    }

    /// Light that the lamps send by a diffuse surface, one sample of each.
    fn direct(&self, hit: &Hit, random: &mut Random) -> V {
        let mut sum = [0.0; 3];
        let on_panel =
            add(PANEL.0, [PANEL.1 * (2.0 * random.next() - 1.0), PANEL.2 * (2.0 * random.next() - 1.0), 0.0]);
        let to = add(on_panel, scale(hit.at, -1.0));
        let (d2, dir) = (dot(to, to), unit(to));
        let cos = dot(dir, hit.normal) * dir[2];
        if dot(dir, hit.normal) > 0.0 && dir[2] > 0.0 && self.free(hit, dir, d2.sqrt()) {
            sum = add(sum, scale(PANEL.3, cos * 4.0 * PANEL.1 * PANEL.2 / d2));
        }
        let to = add(GLOBE.0, scale(hit.at, -1.0));
        let sin2 = GLOBE.1 * GLOBE.1 / dot(to, to);
        let cos_max = (1.0 - sin2).sqrt();
        let (cos, phi) = (1.0 - random.next() * (1.0 - cos_max), random.next() * std::f64::consts::TAU);
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let axis = unit(to);
        let side = unit(cross(axis, [0.3, 0.8, 0.52]));
        let other = cross(axis, side);
        let dir = add(scale(axis, cos), add(scale(side, sin * phi.cos()), scale(other, sin * phi.sin())));
        let facing = dot(dir, hit.normal);
        if facing > 0.0
            && let Some(t) = ball(hit.at, dir, GLOBE.0, GLOBE.1)
            && self.free(hit, dir, t)
        {
            sum = add(sum, scale(GLOBE.2, facing * std::f64::consts::TAU * (1.0 - cos_max)));
        }
        scale(sum, 1.0 / std::f64::consts::PI)
    }

    fn free(&self, hit: &Hit, dir: V, distance: f64) -> bool {
        let origin = add(hit.at, scale(hit.normal, 1e-6));
        self.hit(origin, dir, distance - 1e-5).is_none()
    }

    fn sample(&self, u: f64, v: f64, bounces: u32, random: &mut Random) -> Seen {
        let mut seen = Seen { radiance: [0.0; 3], albedo: [1.0; 3], normal: [0.0; 3] };
        let (mut origin, mut direction, mut weight) = (self.eye, unit(self.ray(u, v)), [1.0; 3]);
        // Light that reaches a diffuse surface by way of a metal is left out: caustics converge too slowly.
        let (mut counts_lamps, mut scattered) = (true, false);
        for bounce in 0..=bounces {
            let hit = self.hit(origin, direction, f64::INFINITY);
            let limit = hit.as_ref().map_or(f64::INFINITY, |hit| hit.t);
            if let Some(light) = self.emitted(origin, direction, limit) {
                if counts_lamps {
                    seen.radiance = add(seen.radiance, times(weight, light));
                }
                break;
            }
            let Some(hit) = hit else { break };
            let (color, metal) = self.paint(&hit);
            if bounce == 0 {
                seen.albedo = color;
                seen.normal = [0, 1, 2].map(|i| dot(self.axes[i], hit.normal));
            }
            if bounce == bounces {
                break;
            }
            weight = times(weight, color);
            if let Some(k) = metal {
                let mirror = add(direction, scale(hit.normal, -2.0 * dot(direction, hit.normal)));
                direction = lobe(mirror, k, random);
                if dot(direction, hit.normal) <= 0.0 {
                    break;
                }
                counts_lamps = !scattered;
            } else {
                seen.radiance = add(seen.radiance, times(weight, self.direct(&hit, random)));
                direction = lobe(hit.normal, 1.0, random);
                (counts_lamps, scattered) = (false, true);
            }
            origin = add(hit.at, scale(hit.normal, 1e-6));
        }
        seen
    }

    /// A rendered frame with all guides: `samples` paths a pixel, guides from `guide_samples` rays a pixel, or from the
    /// paths themselves if 0.
    pub fn frame(&self, samples: u32, guide_samples: u32, seed: u64) -> Frame {
        let [width, height] = self.size;
        let rows: Vec<std::sync::Mutex<Vec<_>>> = (0..height).map(|_| std::sync::Mutex::default()).collect();
        Threads(2).run(height as usize, &|y| {
            let row = (0..width).map(|x| self.pixel(x, y as u32, samples, guide_samples, seed)).collect();
            *rows[y].lock().expect("whole") = row;
        });
        let pixels: Vec<_> = rows.into_iter().flat_map(|row| row.into_inner().expect("whole")).collect();
        let plane = |f: fn(&Pixel) -> [f32; 3]| Plane::from_vec(width, height, pixels.iter().map(f).collect());
        let single = |f: fn(&Pixel) -> f32| Plane::from_vec(width, height, pixels.iter().map(f).collect());
        let mut frame = Frame::new();
        frame.put(RADIANCE, plane(|p| p.radiance)).expect("new");
        frame.put(ALBEDO_MEAN, plane(|p| p.albedo)).expect("new");
        frame.put(NORMAL_MEAN, plane(|p| p.normal)).expect("new");
        frame.put(RADIANCE_UNTINTED, plane(|p| p.untinted)).expect("new");
        frame.put(RADIANCE_UNTINTED_VARIANCE, single(|p| p.variance)).expect("new");
        // Nothing in this room is varnished.
        frame.put(RADIANCE_GLOSS, plane(|_| [0.0; 3])).expect("new");
        frame.put(RADIANCE_GLOSS_VARIANCE, single(|_| 0.0)).expect("new");
        frame.put(DEPTH, single(|p| p.depth)).expect("new");
        let ids = pixels.iter().map(|p| InstanceId(p.id)).collect();
        frame.put(INSTANCE, Plane::from_vec(width, height, ids)).expect("new");
        frame
    }

    fn pixel(&self, x: u32, y: u32, samples: u32, guide_samples: u32, seed: u64) -> Pixel {
        let mut random = Random((seed << 40) ^ (u64::from(y) << 20) ^ u64::from(x));
        random.0 = (random.next() * 9e15) as u64;
        let (px, py) = (f64::from(x), f64::from(y));
        let (mut sum, mut untinted, mut albedo, mut normal) = ([0.0; 3], [0.0; 3], [0.0; 3], [0.0; 3]);
        let (mut l, mut l2) = (0.0, 0.0);
        for _ in 0..samples {
            let seen = self.sample(px + random.next(), py + random.next(), 5, &mut random);
            sum = add(sum, seen.radiance);
            albedo = add(albedo, seen.albedo);
            normal = add(normal, seen.normal);
            let light = times(seen.radiance, seen.albedo.map(|a| 1.0 / (a + f64::from(LEAST_TINT))));
            untinted = add(untinted, light);
            let lum = dot(light, [0.2126, 0.7152, 0.0722]);
            (l, l2) = (l + lum, l2 + lum * lum);
        }
        let n = f64::from(samples);
        let mut guides = n;
        if guide_samples > 0 {
            guides = f64::from(guide_samples);
            (albedo, normal) = ([0.0; 3], [0.0; 3]);
            for i in 0..guide_samples {
                // An R2 sequence (Roberts 2018).
                let (a, b) = (0.754_877_666_2 * f64::from(i), 0.569_840_291 * f64::from(i));
                let seen = self.sample(px + (0.5 + a).fract(), py + (0.5 + b).fract(), 0, &mut random);
                albedo = add(albedo, seen.albedo);
                normal = add(normal, seen.normal);
            }
        }
        let ray = self.ray(px + 0.5, py + 0.5);
        let centre = self.hit(self.eye, ray, f64::INFINITY);
        let variance = if samples > 1 { ((l2 - l * l / n) / (n - 1.0) / n).max(0.0) as f32 } else { f32::INFINITY };
        Pixel {
            radiance: scale(sum, 1.0 / n).map(|x| x as f32),
            untinted: scale(untinted, 1.0 / n).map(|x| x as f32),
            albedo: scale(albedo, 1.0 / guides).map(|x| x as f32),
            normal: scale(normal, 1.0 / guides).map(|x| x as f32),
            variance,
            depth: centre.as_ref().map_or(f32::INFINITY, |hit| hit.t as f32),
            id: centre.map_or(0, |hit| hit.body as u16 + 1),
        }
    }
}

struct Pixel {
    radiance: [f32; 3],
    untinted: [f32; 3],
    albedo: [f32; 3],
    normal: [f32; 3],
    variance: f32,
    depth: f32,
    id: u16,
}

fn ball(origin: V, direction: V, centre: V, radius: f64) -> Option<f64> {
    let to = add(centre, scale(origin, -1.0));
    let (a, b, c) = (dot(direction, direction), dot(to, direction), dot(to, to) - radius * radius);
    let root = b * b - a * c;
    if root < 0.0 {
        return None;
    }
    let t = (b - root.sqrt()) / a;
    (t > 1e-6).then_some(t)
}
