//! Parameters of depth cameras, each declared once: as a value, and as the option that overrides it.

use super::model::Model;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use syntable_model::dist::Dist;

/// Declares `$Values`, parameters of a camera, and `$Options`, with the same fields as options that override them, and
/// options of its own with their defaults.
macro_rules! parameters {
    (
        $(#[$options_meta:meta])*
        options $Options:ident { $($(#[$own_meta:meta])* $own:ident: $Own:ty = $default:expr,)* }
        $(#[doc = $values_doc:literal])*
        values $Values:ident {
            $($(#[doc = $doc:literal])* $(#[schemars($($limits:tt)*)])? $name:ident: $Type:ty,)*
        }
    ) => {
        $(#[$options_meta])*
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields, default)]
        pub struct $Options {
            $($(#[$own_meta])* pub $own: $Own,)*
            $(
                $(#[doc = $doc])*
                $(#[schemars($($limits)*)])?
                #[serde(skip_serializing_if = "Option::is_none")]
                pub $name: Option<$Type>,
            )*
        }

        impl Default for $Options {
            fn default() -> Self {
                Self { $($own: $default,)* $($name: None,)* }
            }
        }

        $(#[doc = $values_doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Serialize)]
        pub struct $Values {
            $($(#[doc = $doc])* pub $name: $Type,)*
        }

        impl $Values {
            /// These parameters, with the values that the options override.
            pub(super) fn overridden(self, options: &$Options) -> Self {
                Self { $($name: options.$name.unwrap_or(self.$name),)* }
            }
        }
    };
}

/// Limits of `noise`.
pub(super) const NOISE: [f64; 2] = [0.0, 100.0];

parameters! {
    /// Simulates the depth that a depth camera measures: meters along the optical axis, quantized to the unit of the
    /// camera, 0 without a measurement. The clean depth stays. The product `depth_sensor` records all parameters.
    ///
    /// The view replaces the depth camera: give `[camera]` its resolution and field of view. Every pixel
    ///
    /// 1. is displaced sideways: lateral noise of `lateral_px · (1 + 0.044 θ / (π/2 − θ))`, which grows with the angle of
    ///    incidence θ as Nguyen, Izadi and Lovell measured (3DIMPVT 2012);
    /// 2. has no measurement beyond `max_angle_deg`, with probability `edge_loss` at an edge, and with probability
    ///    `dropout` anywhere;
    /// 3. is measured by time of flight or by stereo, as described at `time_of_flight` and `stereo`;
    /// 4. has no measurement outside `range_m`, and is rounded to `unit_mm`.
    ///
    /// Edges are depth steps of more than `edge_step_m` beyond the slope of the surfaces. Not modeled: glossy and
    /// transparent surfaces, multipath, sunlight, motion and systematic errors.
    options DepthCamera {
        /// Camera model; the model sets the default of each parameter.
        model: Model = Model::default(),
        /// Factor on the axial noise, from 0 to 100: 1 is the noise of the model, 0 is none. Sampled per view.
        #[schemars(extend("minimum" = NOISE[0], "maximum" = NOISE[1]))]
        noise: Dist = Dist::Constant(1.0),
        /// Fraction of all pixels that have no measurement, at random.
        #[schemars(range(min = 0.0, max = 1.0))]
        dropout: f64 = 0.0,
        /// Overrides parameters of a time-of-flight camera: `l515` or `azure_kinect`.
        #[serde(skip_serializing_if = "Option::is_none")]
        time_of_flight: Option<TimeOfFlight> = None,
        /// Overrides parameters of a stereo camera: `d435`.
        #[serde(skip_serializing_if = "Option::is_none")]
        stereo: Option<Stereo> = None,
    }

    /// Parameters that all depth cameras have.
    values Common {
        /// Smallest and largest measured depth, meters.
        #[schemars(inner(range(min = 0.0, max = 1000.0)))]
        range_m: [f64; 2],
        /// Quantization step of the measured depth, millimeters.
        #[schemars(range(min = 0.001, max = 1000.0))]
        unit_mm: f64,
        /// Standard deviation of the lateral noise at normal incidence, pixels of the image.
        #[schemars(range(min = 0.0, max = 20.0))]
        lateral_px: f64,
        /// Maximum angle of incidence, between ray and normal, that is measured, degrees; 90 for no limit.
        #[schemars(range(min = 1.0, max = 90.0))]
        max_angle_deg: f64,
        /// Minimum depth step that counts as an edge, meters.
        #[schemars(range(min = 0.0001, max = 100.0))]
        edge_step_m: f64,
        /// Fraction of the pixels on either side of an edge that have no measurement.
        #[schemars(range(min = 0.0, max = 1.0))]
        edge_loss: f64,
    }
}

parameters! {
    /// Overrides the parameters of a time-of-flight model.
    ///
    /// The distance `R` along the ray has the noise `σ² = σ₀² + a² / S + b² / S²`, where `S = ρ cos θ / (0.95 R²)` is
    /// the returned light: 1 from a 95 % surface at 1 m and normal incidence. The second term is the shot noise of this
    /// light, the third the noise of background and read-out (Lange and Seitz, IEEE J. Quantum Electronics 37, 2001).
    /// The reflectance ρ is the luminance of the albedo. A pixel has no measurement if `S` is below the light from a
    /// surface of `reach_reflectance` at `reach_m`.
    options TimeOfFlight {}

    /// Parameters of a time-of-flight measurement.
    values TimeOfFlightParameters {
        /// σ₀, noise that does not depend on light, millimeters.
        #[schemars(range(min = 0.0, max = 1000.0))]
        floor_mm: f64,
        /// a, shot noise, millimeters at 1 m on a 95 % surface. Grows with the distance.
        #[schemars(range(min = 0.0, max = 1000.0))]
        shot_mm: f64,
        /// b, noise of background and read-out, millimeters at 1 m on a 95 % surface. Grows with the distance squared.
        #[schemars(range(min = 0.0, max = 1000.0))]
        background_mm: f64,
        /// Maximum distance at which a surface of `reach_reflectance` is measured at normal incidence, meters.
        #[schemars(range(min = 0.01, max = 1000.0))]
        reach_m: f64,
        /// Reflectance of the surface that `reach_m` refers to.
        #[schemars(range(min = 0.001, max = 1.0))]
        reach_reflectance: f64,
        /// Fraction of the measured pixels at an edge that see both sides and measure a depth in between.
        #[schemars(range(min = 0.0, max = 1.0))]
        flying_pixels: f64,
    }
}

parameters! {
    /// Overrides the parameters of a stereo model.
    ///
    /// A depth `z` is a disparity `d = f b / z` with noise and quantization: `z' = f b / round(d + σ_d n)`, hence
    /// `σ_z = z² σ_d / (f b)` (Keselman et al., CVPR Workshops 2017, and Intel's white paper on tuning D400 cameras; as a
    /// simulation Handa et al., ICRA 2014). With the angle of incidence the noise grows by
    /// `1 + 0.053 θ² / (π/2 − θ)²`, the form and proportion of Nguyen, Izadi and Lovell (3DIMPVT 2012) at 1 m. The noise
    /// of neighboring pixels is correlated, because they share most of the matching window.
    ///
    /// The view is the left camera. Points that the right camera, `baseline_m` to its right, does not see have no
    /// measurement: a shadow left of near objects, and a band along the left edge of the image.
    options Stereo {}

    /// Parameters of a stereo measurement.
    values StereoParameters {
        /// Distance b between the two cameras, meters.
        #[schemars(range(min = 0.001, max = 10.0))]
        baseline_m: f64,
        /// Focal length f of the images that are matched, pixels; it may differ from the view's.
        #[schemars(range(min = 1.0, max = 100000.0))]
        focal_length_px: f64,
        /// Standard deviation σ_d of the disparity, pixels.
        #[schemars(range(min = 0.0, max = 100.0))]
        disparity_noise_px: f64,
        /// Quantization step of the disparity, pixels; 0 for none.
        #[schemars(range(min = 0.0, max = 100.0))]
        disparity_step_px: f64,
        /// Correlation length of the noise: standard deviation of a Gaussian, pixels of the image; 0 for none.
        #[schemars(range(min = 0.0, max = 50.0))]
        correlation_px: f64,
    }
}

/// How a depth camera measures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Principle {
    /// The travel time of light.
    TimeOfFlight(TimeOfFlightParameters),
    /// The disparity between two images.
    Stereo(StereoParameters),
}
