//! Effects of a lens on linear radiance: vignetting, lateral chromatic aberration, blur.

use crate::image_filter::{convolved, filled, gaussian, rows};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use syntable_model::context::Workers;
use syntable_model::dist::Dist;
use syntable_model::error::ConfigError;
use syntable_model::product::{Plane, Value};
use syntable_model::random::Stream;
use syntable_model::scene::Intrinsics;

/// Darkening of a lens towards the corners.
///
/// A pixel keeps `cos⁴θ · (1 − mechanical · r²) · (1 + a₁r² + a₂r⁴ + a₃r⁶)` of its light. θ is the angle between its
/// ray and the optical axis, from the view's focal lengths; `cos⁴` is the natural law of a thin lens (Kang and Weiss,
/// ECCV 2000). r is the distance from the principal point over half the image diagonal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Vignetting {
    /// Strength of the natural law, from 0 to 4: the exponent of cos θ is 4 · `natural`. Lenses for phones and webcams
    /// are corrected and darken less than a plain lens.
    #[schemars(extend("minimum" = NATURAL[0], "maximum" = NATURAL[1]))]
    pub natural: Dist,
    /// Fraction of the light that the barrel blocks half a diagonal from the principal point, from 0 to 1.
    #[schemars(extend("minimum" = MECHANICAL[0], "maximum" = MECHANICAL[1]))]
    pub mechanical: Dist,
    /// Coefficients a₁, a₂, a₃ fitted to a real lens (Goldman, PAMI 2010); zero by default. Set `natural = 0` if the
    /// fit includes the natural law.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = -10.0, max = 10.0)))]
    pub radial: Option<[f64; 3]>,
}

/// Limits of `natural`.
const NATURAL: [f64; 2] = [0.0, 4.0];
/// Limits of `mechanical`.
const MECHANICAL: [f64; 2] = [0.0, 1.0];

impl Default for Vignetting {
    fn default() -> Self {
        Self { natural: Dist::Constant(1.0), mechanical: Dist::Constant(0.0), radial: None }
    }
}

impl Vignetting {
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        self.natural.within("vignetting.natural", NATURAL[0], NATURAL[1])?;
        self.mechanical.within("vignetting.mechanical", MECHANICAL[0], MECHANICAL[1])
    }

    /// Darkens the image. Returns the parameters.
    pub(super) fn apply(
        &self,
        image: &mut Plane<[f32; 3]>,
        k: &Intrinsics,
        workers: &dyn Workers,
        stream: &Stream,
    ) -> Value {
        let natural = self.natural.draw(&mut stream.child("natural"));
        let mechanical = self.mechanical.draw(&mut stream.child("mechanical"));
        let [a1, a2, a3] = self.radial.unwrap_or_default();
        let unit2 = half_diagonal(image).powi(2);
        rows(workers, image.width(), image.data_mut(), |y, row| {
            for (x, pixel) in row.iter_mut().enumerate() {
                let [dx, dy] = from_principal(k, x, y);
                // The platform's power function may differ in the last bit between systems.
                let cos2 = 1.0 / (1.0 + (dx / k.fx).powi(2) + (dy / k.fy).powi(2));
                let r2 = (dx * dx + dy * dy) / unit2;
                let fitted = 1.0 + r2 * (a1 + r2 * (a2 + r2 * a3));
                let transmitted = libm::pow(cos2, 2.0 * natural) * (1.0 - mechanical * r2).max(0.0) * fitted.max(0.0);
                *pixel = pixel.map(|v| v * transmitted as f32);
            }
        });
        Value::record([("natural", natural.into()), ("mechanical", mechanical.into()), ("radial", [a1, a2, a3].into())])
    }
}

/// Lateral chromatic aberration: the red and blue channels are slightly larger or smaller than the green channel.
///
/// Each is scaled about the principal point, with bilinear interpolation; beyond the edges of the image, edge pixels are
/// repeated. A point at a distance r from the principal point shifts outwards by `red_px · r / R` in red, with R half the
/// image diagonal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ChromaticAberration {
    /// Outward shift of red half a diagonal from the principal point, pixels, from -20 to 20; negative is inward.
    #[schemars(extend("minimum" = SHIFT_PX[0], "maximum" = SHIFT_PX[1]))]
    pub red_px: Dist,
    /// Outward shift of blue half a diagonal from the principal point, pixels, from -20 to 20; negative is inward.
    #[schemars(extend("minimum" = SHIFT_PX[0], "maximum" = SHIFT_PX[1]))]
    pub blue_px: Dist,
}

/// Limits of `red_px` and `blue_px`, pixels.
const SHIFT_PX: [f64; 2] = [-20.0, 20.0];

impl Default for ChromaticAberration {
    fn default() -> Self {
        Self { red_px: Dist::Constant(0.5), blue_px: Dist::Constant(-0.5) }
    }
}

impl ChromaticAberration {
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        self.red_px.within("chromatic_aberration.red_px", SHIFT_PX[0], SHIFT_PX[1])?;
        self.blue_px.within("chromatic_aberration.blue_px", SHIFT_PX[0], SHIFT_PX[1])
    }

    /// Scales red and blue. Returns the parameters.
    pub(super) fn apply(
        &self,
        image: &mut Plane<[f32; 3]>,
        k: &Intrinsics,
        workers: &dyn Workers,
        stream: &Stream,
    ) -> Value {
        let shifts = [("red", &self.red_px), ("blue", &self.blue_px)].map(|(n, d)| d.draw(&mut stream.child(n)));
        let unit = half_diagonal(image);
        // A tiny image with a large shift must not be turned inside out.
        let [red, blue] = shifts.map(|shift| 1.0 / (1.0 + shift / unit).max(0.1));
        let source = &*image;
        let scaled = filled(workers, [source.width(), source.height()], |y, row: &mut [[f32; 3]]| {
            for (x, pixel) in row.iter_mut().enumerate() {
                let [dx, dy] = from_principal(k, x, y);
                let at = |shrink: f64, channel: usize| {
                    bilinear(source, k.cx + dx * shrink - 0.5, k.cy + dy * shrink - 0.5, channel)
                };
                *pixel = [at(red, 0), source.at(x as u32, y)[1], at(blue, 2)];
            }
        });
        *image = scaled;
        Value::record([("red_px", shifts[0].into()), ("blue_px", shifts[1].into())])
    }
}

/// Half of an image's diagonal, pixels: the unit of distances from the principal point.
fn half_diagonal(image: &Plane<[f32; 3]>) -> f64 {
    0.5 * (f64::from(image.width()).powi(2) + f64::from(image.height()).powi(2)).sqrt()
}

/// The vector from the principal point to the center of a pixel, pixels.
fn from_principal(k: &Intrinsics, x: usize, y: u32) -> [f64; 2] {
    [x as f64 + 0.5 - k.cx, f64::from(y) + 0.5 - k.cy]
}

/// A channel at a position in pixels, where (0, 0) is the center of the first pixel; clamped at the edges.
fn bilinear(image: &Plane<[f32; 3]>, u: f64, v: f64, channel: usize) -> f32 {
    let split = |at: f64, length: u32| {
        let at = at.clamp(0.0, f64::from(length - 1));
        let low = at as u32;
        (low, (low + 1).min(length - 1), (at - f64::from(low)) as f32)
    };
    let (x0, x1, tx) = split(u, image.width());
    let (y0, y1, ty) = split(v, image.height());
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let along = |y: u32| mix(image.at(x0, y)[channel], image.at(x1, y)[channel], tx);
    mix(along(y0), along(y1), ty)
}

/// Blur of lens and focus: a Gaussian on linear radiance. The image is continued by reflection at its edges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Blur {
    /// Standard deviation of the Gaussian, pixels, from 0 to 50. The kernel is sampled at whole pixels: values below
    /// 0.3 hardly blur.
    #[schemars(extend("minimum" = SIGMA_PX[0], "maximum" = SIGMA_PX[1]))]
    pub sigma_px: Dist,
}

/// Limits of `sigma_px`, pixels.
const SIGMA_PX: [f64; 2] = [0.0, 50.0];

impl Default for Blur {
    fn default() -> Self {
        Self { sigma_px: Dist::Constant(0.6) }
    }
}

impl Blur {
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        self.sigma_px.within("blur.sigma_px", SIGMA_PX[0], SIGMA_PX[1])
    }

    /// Blurs the image. Returns the parameters.
    pub(super) fn apply(&self, image: &mut Plane<[f32; 3]>, workers: &dyn Workers, stream: &Stream) -> Value {
        let sigma = self.sigma_px.draw(&mut stream.child("sigma"));
        if sigma > 0.0 {
            *image = convolved(workers, image, &gaussian(sigma));
        }
        Value::record([("sigma_px", sigma.into())])
    }
}
