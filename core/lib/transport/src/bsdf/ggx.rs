//! The GGX microfacet distribution with height-correlated Smith masking, isotropic, in the local frame with z along
//! the shading normal.

use std::f32::consts::PI;
use syntable_simd::functions::sin_cos_turns;
use syntable_simd::{Real, at_least, complement, inverse};
use syntable_simd::{Vec3, vec3};

/// Smallest α: rougher than a mirror by an angle too small to see, but within the range of `f32`.
pub const MIN_ALPHA: f32 = 1e-3;

/// Lower bound of divisors.
const SMALL: f32 = 1e-6;

/// The distribution at one roughness, with the terms for one outgoing direction that all incoming directions share.
#[derive(Clone, Copy, Debug)]
pub struct Ggx<T> {
    wo: Vec3<T>,
    alpha: T,
    alpha2: T,
    /// √(α² + (1 − α²) μₒ²), a term of the masking function.
    stretch: T,
    /// Fraction of the cap of visible normals below the horizon that can reflect upwards.
    bound: T,
    /// Factor from the density of normals to the density of sampled directions.
    per_density: T,
}

impl<T: Real> Ggx<T> {
    /// `wo` is unit length with z > 0.
    #[inline(always)]
    pub fn new(alpha: T, wo: Vec3<T>) -> Self {
        let alpha2 = alpha * alpha;
        let stretch = stretch(alpha2, wo.z);
        // Eto and Tokuyoshi, SIGGRAPH Asia 2023.
        let s = (wo.x * wo.x + wo.y * wo.y).sqrt() + 1.0_f32;
        let s2 = s * s;
        let bound = complement(alpha2) * s2 / (s2 + alpha2 * wo.z * wo.z);
        let per_density = inverse(at_least((bound * wo.z + stretch) * 2.0_f32, SMALL));
        Self { wo, alpha, alpha2, stretch, bound, per_density }
    }

    /// Density of microfacet normals at `h`, per steradian and projected area.
    #[inline(always)]
    pub fn density(&self, h: Vec3<T>) -> T {
        let d = h.x * h.x + h.y * h.y + self.alpha2 * h.z * h.z;
        self.alpha2 / at_least(d * d * PI, 1e-30)
    }

    /// Masking and shadowing over 4 μₒ μᵢ (Heitz, JCGT 2014), so that `density · visibility · Fresnel` is the BRDF.
    #[inline(always)]
    pub fn visibility(&self, mu_i: T) -> T {
        T::splat(0.5) / at_least(mu_i * self.stretch + self.wo.z * stretch(self.alpha2, mu_i), SMALL)
    }

    /// Samples a reflected direction from the visible normals, bounded to those that reflect upwards (Dupuy and
    /// Benyoub, HPG 2023). May still point below the horizon.
    #[inline(always)]
    pub fn sample(&self, [u, v]: [T; 2]) -> Vec3<T> {
        let standard = vec3(self.wo.x * self.alpha, self.wo.y * self.alpha, self.wo.z).normalized();
        let bound = self.bound * standard.z;
        let z = complement(v) * (bound + 1.0_f32) - bound;
        let r = at_least(complement(z * z), 0.0).sqrt();
        let (sin, cos) = sin_cos_turns(u);
        let h = vec3(r * cos + standard.x, r * sin + standard.y, z + standard.z);
        let h = vec3(h.x * self.alpha, h.y * self.alpha, h.z);
        // At the cap's edge, the sum has no direction; the normal is then straight up.
        let square = h.dot(h);
        let sound = square.gt(T::splat(1e-30));
        let h = h * inverse(T::select(sound, square, T::splat(1.0)).sqrt());
        let h = Vec3::select(sound, h, Vec3::broadcast(vec3(0.0, 0.0, 1.0)));
        h * (self.wo.dot(h) * 2.0_f32) - self.wo
    }

    /// Density of [`Self::sample`] per steradian, given the density at the half vector.
    #[inline(always)]
    pub fn pdf(&self, density: T) -> T {
        density * self.per_density
    }
}

/// √(α² + (1 − α²) μ²).
#[inline(always)]
pub fn stretch<T: Real>(alpha2: T, mu: T) -> T {
    (alpha2 + complement(alpha2) * mu * mu).sqrt()
}

/// Schlick's rise towards grazing angles, (1 − cos)⁵.
#[inline(always)]
pub fn schlick<T: Real>(cosine: T) -> T {
    let m = complement(cosine);
    let m2 = m * m;
    m2 * m2 * m
}
