//! How a surface scatters light: glTF 2.0's metallic-roughness model, made exactly energy-conserving.
//!
//! Three lobes, all reciprocal:
//! - **specular**: GGX with height-correlated Smith masking and Schlick's Fresnel term;
//! - **multiple scattering** between microfacets, which Smith's model leaves out (Kulla and Conty, 2017; the Fresnel
//!   average after Fdez-Agüera, JCGT 2019), so that rough metals do not darken;
//! - **diffuse**: Lambert's, weighted by what the dielectric interface lets in and out,
//!   `(1 − Eₛ(μₒ)) (1 − Eₛ(μᵢ)) / (1 − Ēₛ)`, where Eₛ is the albedo of the two lobes above.
//!
//! A white dielectric and a white metal of any roughness reflect all light, nothing more and nothing less. Reflectance
//! rises to one at grazing angles, as Schlick has it, unless it is below 2 % at normal incidence: no real surface is,
//! so it then fades with it (Lagarde and de Rousiers, 2014), and a dielectric with index 1 is purely diffuse.

mod albedo;
mod ggx;
#[cfg(test)]
mod tests;

pub(crate) use albedo::prepare;

use crate::approx::sin_cos_turns;
use crate::vec3::{Rgb, Vec3, max, min, vec3};
use albedo::{Albedo, Row};
use std::f32::consts::FRAC_1_PI;

/// Cosine-weighted mean of Schlick's rise.
const SCHLICK_MEAN: f32 = 1.0 / 21.0;

/// What a material is at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Substance {
    /// Diffuse albedo of the dielectric, reflectance of the metal at normal incidence.
    pub base_color: Rgb,
    /// Perceptual roughness in [0, 1]; α is its square.
    pub roughness: f32,
    /// 0 dielectric … 1 metal.
    pub metallic: f32,
    /// Reflectance of the dielectric at normal incidence.
    pub dielectric_f0: f32,
}

/// Scattering at a point, for one outgoing direction. Directions are local: z along the shading normal, away from the
/// surface on both sides.
#[derive(Clone, Debug)]
pub(crate) struct Bsdf {
    wo: Vec3,
    alpha: f32,
    f0: Rgb,
    f90: f32,
    row: Row<'static>,
    /// Factor of the multiple-scattering lobe, (1 − E(μₒ)) included.
    multiple: Rgb,
    /// Factor of the diffuse lobe, (1 − Eₛ(μₒ)) included.
    diffuse: Rgb,
    dielectric: Interface,
    /// Probability of sampling the specular lobe.
    specular_share: f32,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scattered {
    pub wi: Vec3,
    /// BSDF times cosine over density.
    pub weight: Rgb,
    /// Density per steradian.
    pub pdf: f32,
    /// Whether the specular lobe was sampled.
    pub specular: bool,
}

/// Reflection at a dielectric's surface: at normal incidence, at grazing incidence, after more than one bounce.
#[derive(Clone, Copy, Debug)]
struct Interface {
    f0: f32,
    f90: f32,
    multiple: f32,
}

impl Interface {
    /// Albedo, multiple scattering included.
    #[inline(always)]
    fn albedo(&self, lobe: Albedo) -> f32 {
        self.f0 * lobe.facing + self.f90 * lobe.grazing + self.multiple * max(1.0 - lobe.white(), 0.0)
    }
}

/// Share of the light that leaves after more than one bounce, of that which Smith's model loses (Kulla and Conty).
#[inline(always)]
fn multiple_reflectance(f0: f32, f90: f32, albedo_mean: f32) -> f32 {
    let fresnel_mean = f0 + (f90 - f0) * SCHLICK_MEAN;
    fresnel_mean * fresnel_mean * albedo_mean / max(1.0 - fresnel_mean * (1.0 - albedo_mean), 1e-6)
}

impl Bsdf {
    /// `wo` is unit length with z > 0.
    #[inline]
    pub fn new(substance: &Substance, wo: Vec3) -> Self {
        let Substance { base_color, roughness, metallic, dielectric_f0 } = *substance;
        let (row, mean) = albedo::at_roughness(roughness);
        let own = row.at(wo.z);
        let lost = max(1.0 - own.white(), 0.0);
        let lost_mean = max(1.0 - mean.white(), 1e-4);

        let dielectric = {
            let f90 = min(50.0 * dielectric_f0, 1.0);
            Interface { f0: dielectric_f0, f90, multiple: multiple_reflectance(dielectric_f0, f90, mean.white()) }
        };
        let f0 = Rgb::splat(dielectric_f0).lerp(base_color, metallic);
        let f90 = dielectric.f90 + (1.0 - dielectric.f90) * metallic;
        let per_lost = FRAC_1_PI / lost_mean;
        let metal = base_color.map(|f0| multiple_reflectance(f0, 1.0, mean.white()));
        let multiple_full = Rgb::splat(dielectric.multiple).lerp(metal, metallic);

        let through_mean = max(1.0 - dielectric.albedo(mean), 1e-4);
        let body = base_color * ((1.0 - metallic) * max(1.0 - dielectric.albedo(own), 0.0));

        let specular = (f0 * own.facing).luminance() + f90 * own.grazing;
        let rest = body.luminance() + multiple_full.luminance() * lost;
        let share = specular / max(specular + rest, 1e-6);
        Self {
            wo,
            alpha: max(roughness * roughness, ggx::MIN_ALPHA),
            f0,
            f90,
            row,
            multiple: multiple_full * (lost * per_lost),
            diffuse: body * (FRAC_1_PI / through_mean),
            dielectric,
            specular_share: if rest <= 1e-4 {
                1.0
            } else if specular <= 0.0 {
                0.0
            } else {
                min(max(share, 0.05), 0.95)
            },
        }
    }

    /// BSDF times the cosine of `wi`, and the density of sampling it. `wi` is unit length with z > 0.
    #[inline]
    pub fn evaluate(&self, wi: Vec3) -> (Rgb, f32) {
        let h = (self.wo + wi).normalized();
        let alpha2 = self.alpha * self.alpha;
        let density = ggx::density(alpha2, h);
        let rise = ggx::schlick(self.wo.dot(h));
        let fresnel = self.f0 + (Rgb::splat(self.f90) - self.f0) * rise;
        let specular = fresnel * (density * ggx::visibility(alpha2, self.wo.z, wi.z));
        let albedo = self.row.at(wi.z);
        let multiple = self.multiple * max(1.0 - albedo.white(), 0.0);
        let through = 1.0 - self.dielectric.albedo(albedo);
        let diffuse = self.diffuse * max(through, 0.0);
        let pdf = self.specular_share * ggx::pdf(self.alpha, self.wo, density)
            + (1.0 - self.specular_share) * wi.z * FRAC_1_PI;
        ((specular + multiple + diffuse) * wi.z, pdf)
    }

    /// Samples a direction; none if it points into the surface.
    #[inline]
    pub fn sample(&self, [u, v]: [f32; 2]) -> Option<Scattered> {
        let share = self.specular_share;
        let specular = u < share;
        let wi = if specular {
            ggx::sample(self.alpha, self.wo, [u / share, v])
        } else {
            let r2 = (u - share) / (1.0 - share);
            let (sin, cos) = sin_cos_turns(v);
            let r = r2.sqrt();
            vec3(r * cos, r * sin, max(1.0 - r2, 0.0).sqrt())
        };
        if wi.z < 1e-6 || wi.z.is_nan() {
            return None;
        }
        let (value, pdf) = self.evaluate(wi);
        (pdf > 0.0 && pdf < f32::INFINITY).then(|| Scattered { wi, weight: value * (1.0 / pdf), pdf, specular })
    }
}
