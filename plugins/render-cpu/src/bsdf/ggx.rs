//! The GGX microfacet distribution with height-correlated Smith masking, isotropic, in the local frame with z along
//! the shading normal.

use crate::approx::sin_cos_turns;
use crate::vec3::{Vec3, max, vec3};
use std::f32::consts::PI;

/// Smallest α: rougher than a mirror by an angle too small to see, but within the range of `f32`.
pub(super) const MIN_ALPHA: f32 = 1e-3;

/// Cosines below this count as this, to keep quotients finite.
const MIN_COS: f32 = 1e-6;

/// Density of microfacet normals, per steradian and projected area.
#[inline(always)]
pub(super) fn density(alpha2: f32, h: Vec3) -> f32 {
    let d = h.x * h.x + h.y * h.y + alpha2 * h.z * h.z;
    alpha2 / max(PI * d * d, 1e-30)
}

/// √(α² + (1 − α²) μ²): what masking is made of.
#[inline(always)]
pub(super) fn stretch(alpha2: f32, mu: f32) -> f32 {
    (alpha2 + (1.0 - alpha2) * mu * mu).sqrt()
}

/// Masking and shadowing over 4 μₒ μᵢ (Heitz, JCGT 2014), so that `density · visibility · Fresnel` is the BRDF.
#[inline(always)]
pub(super) fn visibility(alpha2: f32, mu_o: f32, mu_i: f32) -> f32 {
    0.5 / max(mu_i * stretch(alpha2, mu_o) + mu_o * stretch(alpha2, mu_i), MIN_COS)
}

/// Schlick's rise towards grazing angles, (1 − cos)⁵.
#[inline(always)]
pub(super) fn schlick(cosine: f32) -> f32 {
    let m = 1.0 - cosine;
    let m2 = m * m;
    m2 * m2 * m
}

/// Samples a reflected direction from the visible normals, bounded to those that reflect upwards (Dupuy and Benyoub,
/// HPG 2023; Eto and Tokuyoshi, SIGGRAPH Asia 2023). May still point below the horizon.
#[inline(always)]
pub(super) fn sample(alpha: f32, wo: Vec3, [u, v]: [f32; 2]) -> Vec3 {
    let standard = vec3(wo.x * alpha, wo.y * alpha, wo.z).normalized();
    let bound = cap_bound(alpha, wo) * standard.z;
    let z = (1.0 - v) * (1.0 + bound) - bound;
    let r = max(1.0 - z * z, 0.0).sqrt();
    let (sin, cos) = sin_cos_turns(u);
    let h = vec3(r * cos + standard.x, r * sin + standard.y, z + standard.z);
    let h = vec3(h.x * alpha, h.y * alpha, h.z).normalized_or(vec3(0.0, 0.0, 1.0));
    h * (2.0 * wo.dot(h)) - wo
}

/// Density of [`sample`] per steradian, given the distribution's density at the half vector.
#[inline(always)]
pub(super) fn pdf(alpha: f32, wo: Vec3, density: f32) -> f32 {
    let t = stretch(alpha * alpha, wo.z);
    density / max(2.0 * (cap_bound(alpha, wo) * wo.z + t), MIN_COS)
}

/// Share of the spherical cap below the horizon that can reflect upwards.
#[inline(always)]
fn cap_bound(alpha: f32, wo: Vec3) -> f32 {
    let s = 1.0 + (wo.x * wo.x + wo.y * wo.y).sqrt();
    let (a2, s2) = (alpha * alpha, s * s);
    (1.0 - a2) * s2 / (s2 + a2 * wo.z * wo.z)
}
