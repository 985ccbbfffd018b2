//! A finished print: wear and relief added, baked to textures.

use super::relief::ReliefMap;
use super::scheme::Stock;
use crate::material::{MaterialCanvas, PrintFinish, ScalarField, SrgbColor, SurfaceFinish, mix, shade};
use std::sync::Arc;
use syntable_model::random::Stream;
use syntable_model::scene::{Color, Material, NormalMap, Scalar, Texture, Wrap};

/// Maximum number of texels of a print. Color takes four bytes a texel, relief one.
pub const MOST_TEXELS: f64 = 500_000.0;

/// Longest edge of a print, texels.
pub const LONGEST: f64 = 1280.0;

/// Maximum number of texels per meter: the size of the dots of offset print that a close view resolves.
const FINEST: f64 = 4500.0;

/// Texels per meter of a print of some extents, meters.
pub fn texels_per_m([width, height]: [f64; 2]) -> f64 {
    (LONGEST / width.max(height)).min((MOST_TEXELS / (width * height)).sqrt()).min(FINEST)
}

/// The textures of a print.
pub struct PrintedSheet {
    /// Color, with roughness in the alpha channel.
    pub color: Arc<Texture>,
    /// Normal map, with the metallic part in the alpha channel.
    pub relief: Arc<Texture>,
    is_foil: bool,
}

impl PrintedSheet {
    /// Bakes a canvas and its relief.
    pub fn bake(canvas: &MaterialCanvas, relief: &ReliefMap, wrap: Wrap) -> Self {
        Self {
            color: canvas.finish_with_roughness(wrap),
            relief: relief.texture(canvas, wrap),
            is_foil: canvas.has_foil(),
        }
    }

    /// Mean color of the lowest rows: the stock's, where a print ends above its edge.
    pub fn edge_color(&self) -> SrgbColor {
        let row = 4 * self.color.width as usize;
        let texels = &self.color.texels[self.color.texels.len() - 4 * row..];
        let mut sum = [0.0_f32; 3];
        for texel in texels.chunks_exact(4) {
            sum.iter_mut().zip(texel).for_each(|(sum, byte)| *sum += f32::from(*byte) / 255.0);
        }
        sum.map(|sum| sum / (texels.len() / 4) as f32)
    }

    /// The material of the print; a clearcoat of some roughness covers it all.
    pub fn material(&self, name: &str, clearcoat: Option<f64>) -> Material {
        let finish = SurfaceFinish {
            base_color: Color::texture(self.color.clone()),
            roughness: Scalar::texture(self.color.clone(), 3),
            normal: Some(NormalMap { map: self.relief.clone().into(), strength: 1.0 }),
            clearcoat,
            ..SurfaceFinish::plain([1.0; 3], 1.0, 0.0)
        };
        let mut material = finish.named(name);
        if self.is_foil {
            material.metallic = Scalar::texture(self.relief.clone(), 3);
        }
        material.with_digest()
    }
}

/// Paper grain, uneven ink, bleached folds and scuffs. `folds` are lines where the print bends.
pub fn wear(
    canvas: &mut MaterialCanvas,
    relief: &mut ReliefMap,
    stream: &mut Stream,
    stock: Stock,
    folds: &[[[f32; 2]; 2]],
) {
    let fine = ScalarField::fractal(128, [48, 48], 2, 0.7, stream);
    let broad = ScalarField::fractal(64, [4, 4], 3, 0.6, stream);
    let [w, h] = canvas.size();
    let grain = match stock {
        Stock::Gloss => 0.012,
        Stock::Matt => 0.025,
        Stock::Kraft => 0.07,
        Stock::Foil => 0.02,
    };
    let uneven = stream.uniform(0.01, 0.05) as f32;
    let smudge = stream.uniform(0.02, 0.09) as f32;
    canvas.map_all(|x, y, color, finish| {
        let noise = fine.at(x, y);
        let cloud = broad.sample(x as f32 / w * 64.0, y as f32 / h * 64.0);
        let roughness = (finish.roughness + smudge * cloud + grain * noise).clamp(0.05, 1.0);
        (shade(color, 1.0 + grain * noise + uneven * cloud), PrintFinish { roughness, ..finish })
    });
    let age = (stream.unit() * stream.unit()) as f32;
    let bare = if stock == Stock::Kraft { [0.55, 0.42, 0.29] } else { [0.88, 0.86, 0.82] };
    canvas.set_finish(PrintFinish::matt(0.85));
    for &[a, b] in folds {
        let reach = 1.0 + 3.0 * age;
        let bounds = [a[0].min(b[0]) - reach, a[1].min(b[1]) - reach, a[0].max(b[0]) + reach, a[1].max(b[1]) + reach];
        let upright = (b[0] - a[0]).abs() < (b[1] - a[1]).abs();
        canvas.blend(bounds, |x, y| {
            let away = if upright { (x - a[0]).abs() } else { (y - a[1]).abs() } / reach;
            let noise = fine.sample(x + 0.3 * y, y) + 1.2 * broad.sample(x / w * 640.0, y / h * 640.0);
            (bare, (0.25 + 0.75 * age) * (0.7 * noise + 0.25 - 0.9 * away).clamp(0.0, 0.7))
        });
        relief.crease([a, b], 4.0, -1.2);
    }
    let scuffs = (age * stream.uniform(0.0, 14.0) as f32) as usize;
    for _ in 0..scuffs {
        let a = [stream.unit() as f32 * w, stream.unit() as f32 * h];
        let (sin, cos) = libm::sincosf(stream.uniform(0.0, std::f64::consts::TAU) as f32);
        let length = stream.uniform(4.0, 60.0) as f32;
        let b = [a[0] + length * cos, a[1] + length * sin];
        let (squared, width) = (length * length, stream.uniform(0.4, 1.6) as f32);
        let bounds = [a[0].min(b[0]) - 2.0, a[1].min(b[1]) - 2.0, a[0].max(b[0]) + 2.0, a[1].max(b[1]) + 2.0];
        let strength = stream.uniform(0.1, 0.55) as f32;
        canvas.blend(bounds, |x, y| {
            let t = (((x - a[0]) * (b[0] - a[0]) + (y - a[1]) * (b[1] - a[1])) / squared).clamp(0.0, 1.0);
            let (px, py) = (x - a[0] - t * (b[0] - a[0]), y - a[1] - t * (b[1] - a[1]));
            let d = (px * px + py * py).sqrt() / width;
            (bare, strength * (1.0 - d).max(0.0) * (0.6 + fine.sample(3.0 * x, 3.0 * y)).clamp(0.0, 1.0))
        });
    }
    let tint = mix(bare, [0.3, 0.25, 0.2], 0.7);
    for _ in 0..stream.below(3) {
        let c = [stream.unit() as f32 * w, stream.unit() as f32 * h];
        let radius = stream.uniform(0.02, 0.12) as f32 * w.min(h);
        canvas.blend([c[0] - radius, c[1] - radius, c[0] + radius, c[1] + radius], |x, y| {
            let d = ((x - c[0]) * (x - c[0]) + (y - c[1]) * (y - c[1])).sqrt() / radius;
            let ragged = broad.sample(x / w * 400.0, y / h * 400.0);
            (tint, 0.22 * age * (1.0 - d + 0.4 * ragged).clamp(0.0, 1.0))
        });
    }
}
