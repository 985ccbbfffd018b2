//! What a lens does to light: vignetting, lateral chromatic aberration, blur. All on linear radiance.

use crate::grid::{convolved, filled, gaussian, rows};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use syntable_model::context::Workers;
use syntable_model::dist::Dist;
use syntable_model::error::Invalid;
use syntable_model::product::{Plane, Value};
use syntable_model::random::Stream;
use syntable_model::scene::Intrinsics;

/// Light that a lens loses towards the corners.
///
/// A pixel keeps `cos⁴θ · (1 − mechanical · r²) · (1 + a₁r² + a₂r⁴ + a₃r⁶)` of its light. θ is the angle between its
/// ray and the optical axis, from the view's focal lengths; `cos⁴` is the natural law of a thin lens (Kang and Weiss,
/// ECCV 2000). r is the distance from the principal point over half the picture's diagonal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Vignetting {
    /// Share of the natural law: the exponent of cos θ is 4 · `natural`. Lenses for phones and webcams are corrected
    /// and lose less than a plain one.
    pub natural: Dist,
    /// Light that the barrel takes away, as a share, at a corner half a diagonal from the principal point.
    pub mechanical: Dist,
    /// Coefficients a₁, a₂, a₃ of a law fitted to a real lens (Goldman, PAMI 2010); give `natural = 0`
    /// beside it if the fit has the natural law in it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = -10.0, max = 10.0)))]
    pub radial: Option<[f64; 3]>,
}

impl Default for Vignetting {
    fn default() -> Self {
        Self { natural: Dist::Constant(1.0), mechanical: Dist::Constant(0.0), radial: None }
    }
}

impl Vignetting {
    pub(super) fn check(&self) -> Result<(), Invalid> {
        self.natural.within("vignetting.natural", 0.0, 4.0)?;
        self.mechanical.within("vignetting.mechanical", 0.0, 1.0)?;
        match self.radial.into_iter().flatten().find(|a| !(-10.0..=10.0).contains(a)) {
            Some(a) => Err(Invalid::new("vignetting.radial", format!("the coefficient {a} is outside -10 to 10"))),
            None => Ok(()),
        }
    }

    /// Darkens the picture; tells how.
    pub(super) fn apply(
        &self,
        picture: &mut Plane<[f32; 3]>,
        k: &Intrinsics,
        workers: &dyn Workers,
        stream: &Stream,
    ) -> Value {
        let natural = self.natural.draw(&mut stream.child("natural"));
        let mechanical = self.mechanical.draw(&mut stream.child("mechanical"));
        let [a1, a2, a3] = self.radial.unwrap_or_default();
        let unit2 = half_diagonal(picture).powi(2);
        rows(workers, picture.width(), picture.data_mut(), |y, row| {
            for (x, pixel) in row.iter_mut().enumerate() {
                let [dx, dy] = from_principal(k, x, y);
                // The powers of a system's own library may differ in their last bit.
                let cos2 = 1.0 / (1.0 + (dx / k.fx).powi(2) + (dy / k.fy).powi(2));
                let r2 = (dx * dx + dy * dy) / unit2;
                let fitted = 1.0 + r2 * (a1 + r2 * (a2 + r2 * a3));
                let kept = libm::pow(cos2, 2.0 * natural) * (1.0 - mechanical * r2).max(0.0) * fitted.max(0.0);
                *pixel = pixel.map(|v| v * kept as f32);
            }
        });
        Value::record([("natural", natural.into()), ("mechanical", mechanical.into()), ("radial", [a1, a2, a3].into())])
    }
}

/// Lateral chromatic aberration: red and blue pictures a little larger or smaller than the green one.
///
/// Each is scaled about the principal point, with bilinear interpolation; what lies beyond the frame is taken from its
/// edge. Points and edges at a distance r from the principal point shift outwards by `red_px · r / R` in red, R being
/// half the picture's diagonal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ChromaticAberration {
    /// Outward shift of red half a diagonal from the principal point, px; negative is inward.
    pub red_px: Dist,
    /// Outward shift of blue half a diagonal from the principal point, px; negative is inward.
    pub blue_px: Dist,
}

impl Default for ChromaticAberration {
    fn default() -> Self {
        Self { red_px: Dist::Constant(0.5), blue_px: Dist::Constant(-0.5) }
    }
}

impl ChromaticAberration {
    pub(super) fn check(&self) -> Result<(), Invalid> {
        self.red_px.within("chromatic_aberration.red_px", -20.0, 20.0)?;
        self.blue_px.within("chromatic_aberration.blue_px", -20.0, 20.0)
    }

    /// Scales red and blue; tells how.
    pub(super) fn apply(
        &self,
        picture: &mut Plane<[f32; 3]>,
        k: &Intrinsics,
        workers: &dyn Workers,
        stream: &Stream,
    ) -> Value {
        let shifts = [("red", &self.red_px), ("blue", &self.blue_px)].map(|(n, d)| d.draw(&mut stream.child(n)));
        let unit = half_diagonal(picture);
        // A tiny picture with a large shift must not be turned inside out.
        let [red, blue] = shifts.map(|shift| 1.0 / (1.0 + shift / unit).max(0.1));
        let source = &*picture;
        let scaled = filled(workers, [source.width(), source.height()], |y, row: &mut [[f32; 3]]| {
            for (x, pixel) in row.iter_mut().enumerate() {
                let [dx, dy] = from_principal(k, x, y);
                let at = |shrink: f64, channel: usize| {
                    bilinear(source, k.cx + dx * shrink - 0.5, k.cy + dy * shrink - 0.5, channel)
                };
                *pixel = [at(red, 0), source.at(x as u32, y)[1], at(blue, 2)];
            }
        });
        *picture = scaled;
        Value::record([("red_px", shifts[0].into()), ("blue_px", shifts[1].into())])
    }
}

/// Half of a picture's diagonal, px: the unit of distances from the principal point.
fn half_diagonal(picture: &Plane<[f32; 3]>) -> f64 {
    0.5 * (f64::from(picture.width()).powi(2) + f64::from(picture.height()).powi(2)).sqrt()
}

/// The way from the principal point to the middle of a pixel, px.
fn from_principal(k: &Intrinsics, x: usize, y: u32) -> [f64; 2] {
    [x as f64 + 0.5 - k.cx, f64::from(y) + 0.5 - k.cy]
}

/// A channel at a place in pixels, where (0, 0) is the centre of the first one; held at the frame.
fn bilinear(picture: &Plane<[f32; 3]>, u: f64, v: f64, channel: usize) -> f32 {
    let split = |at: f64, length: u32| {
        let at = at.clamp(0.0, f64::from(length - 1));
        let low = at as u32;
        (low, (low + 1).min(length - 1), (at - f64::from(low)) as f32)
    };
    let (x0, x1, tx) = split(u, picture.width());
    let (y0, y1, ty) = split(v, picture.height());
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let along = |y: u32| mix(picture.at(x0, y)[channel], picture.at(x1, y)[channel], tx);
    mix(along(y0), along(y1), ty)
}

/// Blur of lens and focus: a Gaussian on linear light. At the frame the picture goes on as its mirror image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Blur {
    /// Standard deviation of the Gaussian, px. The kernel is sampled at whole pixels: below 0.3 px there is next to no
    /// blur.
    pub sigma_px: Dist,
}

impl Default for Blur {
    fn default() -> Self {
        Self { sigma_px: Dist::Constant(0.6) }
    }
}

impl Blur {
    pub(super) fn check(&self) -> Result<(), Invalid> {
        self.sigma_px.within("blur.sigma_px", 0.0, 50.0)
    }

    /// Blurs the picture; tells how.
    pub(super) fn apply(&self, picture: &mut Plane<[f32; 3]>, workers: &dyn Workers, stream: &Stream) -> Value {
        let sigma = self.sigma_px.draw(&mut stream.child("sigma"));
        if sigma > 0.0 {
            *picture = convolved(workers, picture, &gaussian(sigma));
        }
        Value::record([("sigma_px", sigma.into())])
    }
}
