//! Surfaces of layers, of which a path meets one.

use super::{Bsdf, Glass, Layers, Scattered, Sheen, Substance, Veil, table};
use crate::real::{Mask, Real, inverse};
use crate::vec3::{Rgb, Vec3};

/// How a layer scatters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lobe {
    /// Metallic-roughness.
    Base = 0,
    /// Fibres.
    Sheen = 1,
    /// A thin sheet that light passes.
    Pane = 2,
    /// The interface of a filled body.
    Glass = 3,
}

/// Which layer was drawn, by lane, and what else there is to know of it.
pub(crate) struct Drawn<T> {
    /// Number of the [`Lobe`].
    pub lobe: T,
    /// What lies above it.
    pub above: Layers<T>,
    /// Index of refraction beyond over that on this side.
    pub eta: T,
}

/// Scattering by the layers that were drawn, for one outgoing direction each.
pub(crate) struct Layered<T: Real = f32> {
    veil: Veil<T>,
    sheen: Sheen<T>,
    glass: Glass<T>,
    color: Rgb<T>,
    is_sheen: T::Mask,
    is_passage: T::Mask,
}

impl<T: Real> Layered<T> {
    /// `wo` is unit length with z > 0.
    #[inline(always)]
    pub fn new(drawn: &Drawn<T>, substance: &Substance<T>, wo: Vec3<T>) -> Self {
        let is = |lobe: Lobe| {
            let number = lobe as u32 as f32;
            drawn.lobe.gt(T::splat(number - 0.5)) & drawn.lobe.lt(T::splat(number + 0.5))
        };
        let pane = is(Lobe::Pane);
        // Light that crosses a filled body meets its colour twice.
        let tint = Vec3::pick(pane, substance.base_color, substance.base_color.map(|c| c.sqrt()));
        Self {
            veil: Veil::new(drawn.above, wo.z, table()),
            sheen: Sheen::new(substance.roughness, wo),
            glass: Glass::new(wo, substance.roughness, drawn.eta, pane, tint),
            color: substance.base_color,
            is_sheen: is(Lobe::Sheen),
            is_passage: pane | is(Lobe::Glass),
        }
    }

    /// BSDF times cosine of the drawn layer, and its density. Passage has none: lights are found through it by chance.
    #[inline(always)]
    pub fn evaluate(&self, bsdf: &Bsdf<T>, wi: Vec3<T>) -> (Rgb<T>, T) {
        let ([glossy, matte], pdf) = self.lobes(bsdf, wi);
        (glossy + matte, pdf)
    }

    /// The same, what is glossy and what is matte apart. Fibres are matte.
    #[inline(always)]
    pub fn lobes(&self, bsdf: &Bsdf<T>, wi: Vec3<T>) -> ([Rgb<T>; 2], T) {
        let ([glossy, matte], mut pdf) = bsdf.lobes(wi);
        let [glossy_left, matte_left] = self.veil.left(wi.z);
        let (mut glossy, mut matte) = (glossy * glossy_left, matte * matte_left);
        let black = Vec3::all(T::splat(0.0));
        if self.is_sheen.any() {
            let (sheen, density) = self.sheen.evaluate(wi);
            // Varnish over fibres; what the fibres themselves take is no veil for them.
            matte = Vec3::pick(self.is_sheen, self.color * (sheen * glossy_left), matte);
            glossy = Vec3::pick(self.is_sheen, black, glossy);
            pdf = T::pick(self.is_sheen, density, pdf);
        }
        ([glossy, matte].map(|lobe| Vec3::pick(self.is_passage, black, lobe)), pdf)
    }

    #[inline(always)]
    pub fn sample(&self, bsdf: &Bsdf<T>, uv: [T; 2], coin: T) -> Scattered<T> {
        let (mut wi, mut specular) = bsdf.direction(uv);
        if self.is_sheen.any() {
            wi = Vec3::pick(self.is_sheen, Sheen::sample(uv), wi);
            specular = specular & !self.is_sheen;
        }
        let (value, pdf) = self.evaluate(bsdf, wi);
        let mut scattered = Scattered {
            valid: wi.z.gt(T::splat(1e-6)) & pdf.gt(T::splat(0.0)) & pdf.lt(T::splat(f32::INFINITY)),
            wi,
            weight: value * inverse(pdf),
            pdf,
            specular,
            passes: T::Mask::splat(false),
        };
        if self.is_passage.any() {
            let passed = self.glass.sample(uv, coin);
            let mine = self.is_passage;
            scattered = Scattered {
                valid: mine & passed.valid | !mine & scattered.valid,
                wi: Vec3::pick(mine, passed.wi, wi),
                weight: Vec3::pick(mine, passed.weight, scattered.weight),
                // No other strategy finds what lies beyond.
                pdf: T::pick(mine, T::splat(f32::INFINITY), pdf),
                specular: specular | mine,
                passes: mine & passed.wi.z.lt(T::splat(0.0)),
            };
        }
        scattered
    }
}
