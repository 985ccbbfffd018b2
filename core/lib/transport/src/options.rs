//! Options shared by all path tracers.

use crate::components::Light;
use crate::film::SampleBudget;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use syntable_prepare::labels::BlendedLabels;

/// Options of path tracing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PathTracing {
    /// Paths per pixel. Noise falls with the square root; powers of two are stratified best.
    #[schemars(range(min = 1, max = 1_048_576))]
    pub samples_per_pixel: u32,
    /// Maximum path depth. 1 renders only direct illumination, 0 only emitters.
    #[schemars(range(min = 0, max = 256))]
    pub max_bounces: u32,
    /// Bounces after which Russian roulette may end faint paths: a little more noise in much less time.
    #[schemars(range(min = 1, max = 257))]
    pub russian_roulette_from: u32,
    /// Maximum luminance of one indirect contribution to a path, nits. Removes fireflies, and some true light with
    /// them; without it the image is unbiased.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_indirect_luminance_nits: Option<f64>,
    /// Minimum perceptual roughness of surfaces after the first rough bounce (path-space regularization, Kaplanyan and
    /// Dachsbacher, 2013). About 0.3 blurs caustics, which otherwise become fireflies, without losing light; directly
    /// visible surfaces and mirror images stay unchanged. 0 disables it.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub regularize: f64,
    /// How dielectrics divide light between gloss and color.
    pub dielectrics: Dielectrics,
    /// Reconstruction filter: the weight of light by its distance from the center of a pixel.
    pub pixel_filter: PixelFilter,
    /// Noise below which a tile of 16 × 16 pixels gets no further samples: the ratio of standard error to luminance,
    /// such as 0.02. `samples_per_pixel` is then the maximum. Without it, all pixels get the same number of samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub noise: Option<f64>,
    /// Time limit per image, seconds; every requested component of light has the same limit in addition.
    /// `samples_per_pixel` is then the maximum. The number of samples depends on the machine and its load, so such
    /// images are not reproducible; `render_report` has the number.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub time_s: Option<f64>,
    /// The surface that labels show where light passes through another. `shape` (the default): the first surface,
    /// including glass. A surface that blends by alpha (glTF `BLEND`, MTL `d`) exists wherever the alpha of its texture
    /// is at least one half, however transparent the material is overall. `coverage`: the first surface whose alpha
    /// covers at least one half of the background; this includes glass. `opaque`: the first opaque surface. A surface
    /// that transmits at least one half of the entering light does not exist either, so an object of glass has no mask
    /// and hides nothing. The product `label_policy` states the choice.
    pub blended_labels: BlendedLabels,
}

/// Model of a dielectric's two lobes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Dielectrics {
    /// Light crosses the surface on its way in and out, and multiple reflections between microfacets are kept: white
    /// reflects all light (Kulla and Conty, 2017).
    #[default]
    EnergyConserving,
    /// The plain mix of glTF 2.0, appendix B.2: the Fresnel term of the half vector, once, and no multiple scattering.
    /// Matches viewers of glTF: light 10° above a smooth surface is 1.5 times as bright.
    Gltf,
}

/// Reconstruction filter of pixels. Each pixel draws the positions of its own paths from the filter, so the noise of
/// neighbors is independent, as denoisers require (Shirley, 1991).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PixelFilter {
    /// Mean over the area of the pixel, as an ideal sensor sees it. Slanted edges have steps.
    Box,
    /// Weight that falls linearly to 0 one pixel from the center: edges are smooth, textures a little softer.
    #[default]
    Tent,
}

impl Default for PathTracing {
    fn default() -> Self {
        Self {
            samples_per_pixel: 64,
            max_bounces: 8,
            russian_roulette_from: 3,
            max_indirect_luminance_nits: None,
            regularize: 0.0,
            dielectrics: Dielectrics::default(),
            pixel_filter: PixelFilter::default(),
            noise: None,
            time_s: None,
            blended_labels: BlendedLabels::Shape,
        }
    }
}

/// Defines a kind with the options of path tracing and its own documentation.
#[macro_export]
macro_rules! path_tracing_kind {
    ($(#[doc = $doc:literal])* $name:ident) => {
        $(#[doc = $doc])*
        #[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(transparent)]
        pub struct $name(pub $crate::PathTracing);

        impl schemars::JsonSchema for $name {
            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($name).into()
            }

            fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
                let mut schema = <$crate::PathTracing as schemars::JsonSchema>::json_schema(generator);
                let lines: &[&str] = &[$($doc),*];
                let lines: Vec<&str> = lines.iter().map(|line| line.trim()).collect();
                schema.insert("description".into(), lines.join("\n").into());
                schema
            }
        }
    };
}

/// Options of light transport, in the form that paths read.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Planned samples per pixel; with more samples, textures are read at finer levels.
    pub samples: u32,
    /// Maximum path depth.
    pub max_bounces: u32,
    /// Bounces after which Russian roulette may end paths, at least 1.
    pub roulette_from: u32,
    /// Maximum luminance of one indirect contribution, nits; infinite without a limit.
    pub max_indirect_luminance_nits: f32,
    /// Minimum perceptual roughness after the first rough bounce.
    pub regularize: f32,
    /// Reconstruction filter of pixels.
    pub filter: PixelFilter,
    /// Model of a dielectric's two lobes.
    pub dielectrics: Dielectrics,
    /// Whether surfaces cast shadows.
    pub shadows: bool,
}

impl PathTracing {
    /// Options for paths that gather this component of light.
    pub fn settings(&self, light: Light) -> Settings {
        Settings {
            samples: self.samples_per_pixel,
            max_bounces: match light {
                Light::All => self.max_bounces,
                Light::Direct | Light::Unshadowed => self.max_bounces.min(1),
            },
            roulette_from: self.russian_roulette_from.max(1),
            max_indirect_luminance_nits: self.max_indirect_luminance_nits.map_or(f32::INFINITY, |nits| nits as f32),
            regularize: self.regularize as f32,
            filter: self.pixel_filter,
            dielectrics: self.dielectrics,
            shadows: light != Light::Unshadowed,
        }
    }

    /// Limits on samples and time. Every component of light has the full time limit, and the same number of samples in
    /// all of its pixels.
    pub fn budget(&self, light: Light) -> SampleBudget {
        match light {
            Light::All => SampleBudget { samples: self.samples_per_pixel, noise: self.noise, seconds: self.time_s },
            Light::Direct | Light::Unshadowed => {
                SampleBudget { samples: self.samples_per_pixel, noise: None, seconds: self.time_s }
            }
        }
    }

    /// The cost of a view in one line, for `syntable plan`.
    pub fn cost(&self) -> String {
        let Self { samples_per_pixel, max_bounces, .. } = self;
        format!(
            "{samples_per_pixel} paths per pixel of up to {max_bounces} bounces; labels cost less than one path per pixel"
        )
    }
}

impl Settings {
    /// Growth of a camera ray's cone, meters per meter, from the angle of a pixel. The samples of a pixel share its
    /// area, so each may see finer detail than the pixel.
    pub fn spread(&self, pixel_angle: f32) -> f32 {
        pixel_angle * (1.0 / (self.samples as f32).sqrt()).max(0.25)
    }
}
