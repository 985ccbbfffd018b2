//! Scattering at surfaces: glTF 2.0's metallic-roughness model, made exactly energy-conserving.
//!
//! Three lobes, all reciprocal:
//! - **specular**: GGX with height-correlated Smith masking and Schlick's Fresnel term;
//! - **multiple scattering** between microfacets, which Smith's model leaves out (Kulla and Conty, 2017; the Fresnel
//!   average after Fdez-Agüera, JCGT 2019), so that rough metals do not darken;
//! - **diffuse**: Lambertian, weighted by the transmission of the dielectric interface on the way in and out,
//!   `(1 − Eₛ(μₒ)) (1 − Eₛ(μᵢ)) / (1 − Ēₛ)`, where Eₛ is the albedo of the two lobes above.
//!
//! Above these may be [clearcoat](coating) and [sheen], and light may be [transmitted](transmission) instead of being
//! scattered. A path scatters from one of these layers, selected at random with a known probability; the others only
//! attenuate it.
//!
//! A white dielectric and a white metal of any roughness reflect exactly all light. Reflectance rises to one at grazing
//! angles, as in Schlick's approximation, unless it is below 2 % at normal incidence. No real surface has such a low
//! value, so it then fades with the reflectance at normal incidence (Lagarde and de Rousiers, 2014), and a dielectric
//! with index 1 is purely diffuse.

pub mod albedo;
pub mod coating;
pub mod ggx;
mod layered;
pub mod sheen;
#[cfg(test)]
mod tests;
pub mod transmission;

use crate::options::Dielectrics;
pub use albedo::{AlbedoTable, table};
pub use coating::{CLEARCOAT_F0, CoatingParameters, clearcoat_albedo, sheen_albedo};
pub use layered::{LayerInputs, Layered, Lobe};
pub use sheen::sheen_table;
pub use transmission::pane_transmittance;

use coating::CoatingAttenuation;
use sheen::Sheen;
use transmission::Transmission;

use albedo::{Albedo, Row};
use ggx::Ggx;
use std::f32::consts::FRAC_1_PI;
use syntable_simd::functions::sin_cos_turns;
use syntable_simd::{Mask as _, Real, at_least, at_most, complement, inverse, max, min};
use syntable_simd::{Rgb, Vec3, vec3};

/// Cosine-weighted mean of Schlick's rise.
const SCHLICK_MEAN: f32 = 1.0 / 21.0;

/// BSDF parameters of a shading point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfParameters<T = f32> {
    /// Diffuse albedo of the dielectric, reflectance of the metal at normal incidence.
    pub base_color: Rgb<T>,
    /// Perceptual roughness in [0, 1]; α is its square.
    pub roughness: T,
    /// 0 dielectric … 1 metal.
    pub metallic: T,
    /// Reflectance of the dielectric at normal incidence.
    pub dielectric_f0: T,
}

/// Scattering at a point, for one outgoing direction. Directions are local: z along the shading normal, away from the
/// surface on both sides.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf<T: Real = f32> {
    table: &'static AlbedoTable,
    wo: Vec3<T>,
    ggx: Ggx<T>,
    row: Row<T>,
    f0: Rgb<T>,
    f90: T,
    /// Factor of the multiple-scattering lobe, including (1 − E(μₒ)).
    multiple: Rgb<T>,
    /// Factor of the diffuse lobe, including (1 − Eₛ(μₒ)).
    diffuse: Rgb<T>,
    dielectric: Interface<T>,
    /// Whether the lobes are mixed as in glTF.
    plain: bool,
    /// Probability of sampling the specular lobe.
    specular_probability: T,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample<T: Real> {
    /// Whether the sample is valid.
    pub valid: T::Mask,
    /// Incoming direction, local.
    pub wi: Vec3<T>,
    /// BSDF times cosine over density.
    pub weight: Rgb<T>,
    /// Density per steradian.
    pub pdf: T,
    /// Whether the specular lobe was sampled.
    pub specular: T::Mask,
    /// Whether it continues on the other side of the surface.
    pub transmitted: T::Mask,
    /// Whether glass reflected light that it could also have transmitted.
    pub reflected: T::Mask,
}

/// Reflection at a dielectric's surface.
#[derive(Clone, Copy, Debug)]
pub struct Interface<T> {
    /// Reflectance at normal incidence.
    pub f0: T,
    /// Reflectance at grazing incidence.
    pub f90: T,
    /// Reflectance of light after several reflections.
    pub multiple: T,
}

impl<T: Real> Interface<T> {
    /// Albedo including multiple scattering.
    #[inline(always)]
    pub fn albedo(&self, lobe: Albedo<T>) -> T {
        self.f0 * lobe.facing + self.f90 * lobe.grazing + self.multiple * at_least(complement(lobe.white()), 0.0)
    }
}

/// Fraction of the light lost by Smith's model that leaves after more than one bounce (Kulla and Conty).
#[inline(always)]
pub fn multiple_reflectance<T: Real>(f0: T, f90: T, mean_albedo: T) -> T {
    let fresnel_mean = f0 + (f90 - f0) * SCHLICK_MEAN;
    fresnel_mean * fresnel_mean * mean_albedo / at_least(complement(fresnel_mean * complement(mean_albedo)), 1e-6)
}

impl<T: Real> Bsdf<T> {
    /// `wo` is unit length with z > 0.
    #[inline(always)]
    pub fn new(
        parameters: &BsdfParameters<T>,
        wo: Vec3<T>,
        table: &'static AlbedoTable,
        dielectrics: Dielectrics,
    ) -> Self {
        let BsdfParameters { base_color, roughness, metallic, dielectric_f0 } = *parameters;
        let row = Row::new(roughness);
        let (own, mean) = (row.at(table, wo.z), row.mean(table));
        let lost = at_least(complement(own.white()), 0.0);
        let lost_mean = at_least(complement(mean.white()), 1e-4);

        let dielectric = {
            let f90 = at_most(dielectric_f0 * 50.0_f32, 1.0);
            Interface { f0: dielectric_f0, f90, multiple: multiple_reflectance(dielectric_f0, f90, mean.white()) }
        };
        let f0 = Rgb::all(dielectric_f0).lerp(base_color, metallic);
        let f90 = dielectric.f90 + complement(dielectric.f90) * metallic;
        let one = T::splat(1.0);
        let metal = vec3(
            multiple_reflectance(base_color.x, one, mean.white()),
            multiple_reflectance(base_color.y, one, mean.white()),
            multiple_reflectance(base_color.z, one, mean.white()),
        );
        let multiple = Rgb::all(dielectric.multiple).lerp(metal, metallic);

        let through_mean = at_least(complement(dielectric.albedo(mean)), 1e-4);
        let body = base_color * (complement(metallic) * at_least(complement(dielectric.albedo(own)), 0.0));

        let specular = (f0 * own.facing).luminance() + f90 * own.grazing;
        let rest = body.luminance() + multiple.luminance() * lost;
        let probability = min(at_least(specular / at_least(specular + rest, 1e-6), 0.05), T::splat(0.95));
        let probability = T::select(specular.le(T::splat(0.0)), T::splat(0.0), probability);
        let plain = dielectrics == Dielectrics::Gltf;
        let (multiple, diffuse) = match plain {
            true => (Rgb::all(T::splat(0.0)), base_color * (complement(metallic) * FRAC_1_PI)),
            false => {
                (multiple * (lost * (T::splat(FRAC_1_PI) / lost_mean)), body * (T::splat(FRAC_1_PI) / through_mean))
            }
        };
        Self {
            table,
            wo,
            plain,
            ggx: Ggx::new(at_least(roughness * roughness, ggx::MIN_ALPHA), wo),
            row,
            f0,
            f90,
            multiple,
            diffuse,
            dielectric,
            specular_probability: T::select(rest.le(T::splat(1e-4)), one, probability),
        }
    }

    /// BSDF times the cosine of `wi`, for the glossy lobes and for the diffuse lobe; and the density of sampling `wi`,
    /// which is unit length with z > 0.
    #[inline(always)]
    pub fn lobes(&self, wi: Vec3<T>) -> ([Rgb<T>; 2], T) {
        let h = self.wo + wi;
        let h = h * inverse(max(h.dot(h), T::splat(1e-20)).sqrt());
        let density = self.ggx.density(h);
        let rise = ggx::schlick(self.wo.dot(h));
        let fresnel = self.f0 + (Rgb::all(self.f90) - self.f0) * rise;
        let specular = fresnel * (density * self.ggx.visibility(wi.z));
        let albedo = self.row.at(self.table, wi.z);
        let multiple = self.multiple * at_least(complement(albedo.white()), 0.0);
        let reflected = match self.plain {
            true => self.dielectric.f0 + (self.dielectric.f90 - self.dielectric.f0) * rise,
            false => self.dielectric.albedo(albedo),
        };
        let diffuse = self.diffuse * at_least(complement(reflected), 0.0);
        let pdf = self.specular_probability * self.ggx.pdf(density)
            + complement(self.specular_probability) * wi.z * FRAC_1_PI;
        ([(specular + multiple) * wi.z, diffuse * wi.z], pdf)
    }

    /// BSDF times the cosine of `wi`, and the density of sampling it. `wi` is unit length with z > 0.
    #[inline(always)]
    pub fn evaluate(&self, wi: Vec3<T>) -> (Rgb<T>, T) {
        let ([glossy, matte], pdf) = self.lobes(wi);
        (glossy + matte, pdf)
    }

    /// Samples a direction, which may point into the surface. Returns whether it sampled the specular lobe, too.
    #[inline(always)]
    pub fn direction(&self, [u, v]: [T; 2]) -> (Vec3<T>, T::Mask) {
        let probability = self.specular_probability;
        let specular = u.lt(probability);
        let glossy = self.ggx.sample([u / at_least(probability, 1e-6), v]);
        let r2 = (u - probability) / at_least(complement(probability), 1e-6);
        let (sin, cos) = sin_cos_turns(v);
        let r = at_least(r2, 0.0).sqrt();
        let matte = vec3(r * cos, r * sin, at_least(complement(r2), 0.0).sqrt());
        (Vec3::select(specular, glossy, matte), specular)
    }

    /// Samples a direction.
    #[inline(always)]
    pub fn sample(&self, uv: [T; 2]) -> BsdfSample<T> {
        let (wi, specular) = self.direction(uv);
        let (value, pdf) = self.evaluate(wi);
        let valid = wi.z.gt(T::splat(1e-6)) & pdf.gt(T::splat(0.0)) & pdf.lt(T::splat(f32::INFINITY));
        let no = T::Mask::splat(false);
        BsdfSample { valid, wi, weight: value * inverse(pdf), pdf, specular, transmitted: no, reflected: no }
    }
}
