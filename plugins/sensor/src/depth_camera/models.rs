//! Depth cameras by name, and what can be changed about them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use syntable_model::error::Invalid;
use syntable_model::product::Value;

/// A depth camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Model {
    /// Intel RealSense L515, scanning time of flight: 0.25 to 9 m, unit 0.25 mm; on a 95 % surface without other light
    /// a standard deviation of 2.5 mm at 1 m and 15.5 mm at 9 m. Sources: range and noise from Intel's product page and
    /// data sheet, for 640 × 480, as quoted in librealsense issues 5808, 7040, 7236 and 8947; the unit from Intel's
    /// support, issue 8058. No source was found for the 3.9 m up to which a 15 % surface is seen; from the 9 m on 95 %
    /// the inverse square of the distance gives 3.6 m.
    #[default]
    L515,
    /// Intel RealSense D435, active stereo at 848 × 480: baseline 50 mm, horizontal field of view 87° (a focal length
    /// of 447 px), 0.18 to 10 m, unit 1 mm; disparities in steps of 1/32 px with an error of 0.08 px. Sources: field of
    /// view from Intel's D400 data sheet of May 2020, table 3-42; baseline, unit and farthest depth as quoted in
    /// librealsense issues 10575, 8058 and 7996; the nearest depth is f b over the 126 px that are searched (issue 3039;
    /// Intel's A. Grunnet-Jepsen says 17 cm in issue 999), at 1280 × 720 it would be 0.27 m; the error from the same,
    /// issue 3904; the steps from Intel's white paper on subpixel linearity.
    D435,
    /// Microsoft Azure Kinect, time of flight, narrow field of view, not binned: 0.5 to 3.86 m, unit 1 mm, a standard
    /// deviation of at most 17 mm, taken here for a 15 % surface at 3.86 m; on a 95 % surface 1 mm at 1 m and 3 mm at
    /// 3 m. Sources: range and unit from Microsoft's pages "Azure Kinect DK hardware specifications" and "Azure Kinect
    /// DK depth camera"; the 17 mm are theirs too, confirmed by Tölgyessy et al. (Sensors 21, 413, 2021); the noise on
    /// bright surfaces is that of BlenderProc's code, which cites them: 0.5 mm, and 1 mm for every metre beyond 0.5 m.
    AzureKinect,
}

/// What all depth cameras have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shared {
    /// Nearest and farthest depth, m.
    pub range_m: [f64; 2],
    /// Step of the output, mm.
    pub unit_mm: f64,
    /// Lateral noise of a surface seen squarely, px of the picture.
    pub lateral_px: f64,
    /// Angle of incidence beyond which there is no measurement, degrees.
    pub max_angle_deg: f64,
    /// Least difference of depth that is an edge, m.
    pub edge_step_m: f64,
    /// Share of the pixels at an edge without measurement.
    pub edge_loss: f64,
}

/// How time of flight is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flight {
    /// σ₀, mm.
    pub floor_mm: f64,
    /// a, mm at 1 m.
    pub shot_mm: f64,
    /// b, mm at 1 m.
    pub background_mm: f64,
    /// Distance up to which a surface of `reach_reflectance` is seen, m.
    pub reach_m: f64,
    /// Reflectance of that surface.
    pub reach_reflectance: f64,
    /// Share of the measured pixels at an edge that see both sides.
    pub flying_pixels: f64,
}

/// How stereo is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Matching {
    /// Distance of the two cameras, m.
    pub baseline_m: f64,
    /// Focal length of the pictures that are matched, px.
    pub focal_length_px: f64,
    /// Standard deviation of the disparity, px.
    pub disparity_noise_px: f64,
    /// Step of the disparity, px.
    pub disparity_step_px: f64,
    /// Standard deviation of the Gaussian that correlates the noise of neighbours, px of the picture.
    pub correlation_px: f64,
}

/// What a depth camera does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Principle {
    /// Light is sent out, and its way back is timed.
    TimeOfFlight(Flight),
    /// Two pictures are matched.
    Stereo(Matching),
}

impl Model {
    /// Its name in recipes and in the output.
    pub fn name(self) -> &'static str {
        match self {
            Self::L515 => "l515",
            Self::D435 => "d435",
            Self::AzureKinect => "azure_kinect",
        }
    }

    /// Its parameters. Ranges, units and noise are published, with the exceptions and sources that each model states;
    /// `lateral_px`, `max_angle_deg`, `edge_step_m`, `edge_loss`, `flying_pixels` and `correlation_px` are our own
    /// choice.
    pub fn parameters(self) -> (Shared, Principle) {
        let shared = Shared {
            range_m: [0.25, 9.0],
            unit_mm: 0.25,
            lateral_px: 0.3,
            max_angle_deg: 80.0,
            edge_step_m: 0.02,
            edge_loss: 0.2,
        };
        match self {
            // σ₀² + a² = 2.5², σ₀² + 81 a² = 15.5² on the reference surface.
            Self::L515 => (
                shared,
                Principle::TimeOfFlight(Flight {
                    floor_mm: 1.82,
                    shot_mm: 1.71,
                    background_mm: 0.0,
                    reach_m: 3.9,
                    reach_reflectance: 0.15,
                    flying_pixels: 0.4,
                }),
            ),
            // σ₀ = 0.5 as BlenderProc has it; σ = 1 at 1 m on the reference surface and 17 at 3.86 m on one of 15 %. That
            // makes 3 at 3 m on the reference surface, as BlenderProc has it too.
            Self::AzureKinect => (
                Shared { range_m: [0.5, 3.86], unit_mm: 1.0, edge_loss: 0.4, ..shared },
                Principle::TimeOfFlight(Flight {
                    floor_mm: 0.5,
                    shot_mm: 0.852,
                    background_mm: 0.157,
                    reach_m: 3.86,
                    reach_reflectance: 0.15,
                    flying_pixels: 0.5,
                }),
            ),
            Self::D435 => (
                Shared {
                    range_m: [0.18, 10.0],
                    unit_mm: 1.0,
                    lateral_px: 0.5,
                    max_angle_deg: 75.0,
                    edge_loss: 0.4,
                    ..shared
                },
                Principle::Stereo(Matching {
                    baseline_m: 0.05,
                    focal_length_px: 447.0,
                    disparity_noise_px: 0.08,
                    disparity_step_px: 1.0 / 32.0,
                    correlation_px: 1.5,
                }),
            ),
        }
    }
}

/// Time of flight: what to change about a model that uses it.
///
/// The distance `R` along the ray has the noise `σ² = σ₀² + a² / S + b² / S²`, where `S = ρ cos θ / (0.95 R²)` is the
/// light that comes back, 1 from a surface of 95 % at 1 m that is seen squarely. The second term is the shot noise of
/// that light, the third that of background and read-out (Lange and Seitz, IEEE J. Quantum Electronics 37, 2001). The
/// reflectance ρ is the luminance of the base colour. Where `S` is weaker than from `reach_reflectance` at `reach_m`
/// there is no measurement.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TimeOfFlight {
    /// σ₀, the noise that does not depend on light, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub floor_mm: Option<f64>,
    /// a, shot noise, mm at 1 m on a 95 % surface. Grows with the distance.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub shot_mm: Option<f64>,
    /// b, noise of background and read-out, mm at 1 m on a 95 % surface. Grows with the distance squared.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub background_mm: Option<f64>,
    /// Distance up to which a surface of `reach_reflectance` is seen squarely, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub reach_m: Option<f64>,
    /// Reflectance of the surface that is seen up to `reach_m`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.001, max = 1.0))]
    pub reach_reflectance: Option<f64>,
    /// Share of the measured pixels at an edge that see both sides and measure something between.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub flying_pixels: Option<f64>,
}

/// Stereo: what to change about a model that uses it.
///
/// A depth `z` is a disparity `d = f b / z` with noise and steps: `z' = f b / round(d + σ_d n)`, hence
/// `σ_z = z² σ_d / (f b)` (Keselman et al., CVPR Workshops 2017, and Intel's white paper on tuning D400 cameras; as a
/// simulation Handa et al., ICRA 2014). With the angle of incidence the noise grows by `1 + 0.053 θ² / (π/2 − θ)²`, the
/// form and proportion of Nguyen, Izadi and Lovell (3DIMPVT 2012) at 1 m. Noise of neighbours is correlated, as they
/// share most of the window that is matched.
///
/// The view is the left camera. What the right one, `baseline_m` to its right, does not see has no measurement: a
/// shadow left of everything near, and a band at the picture's left edge.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Stereo {
    /// Distance b of the two cameras, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.001, max = 10.0))]
    pub baseline_m: Option<f64>,
    /// Focal length f of the pictures that are matched, px; it need not be the view's.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1.0, max = 100000.0))]
    pub focal_length_px: Option<f64>,
    /// Standard deviation σ_d of the disparity, px.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub disparity_noise_px: Option<f64>,
    /// Step of the disparity, px; 0 for none.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub disparity_step_px: Option<f64>,
    /// How far noise is correlated: standard deviation of a Gaussian, px of the picture; 0 for not at all.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 50.0))]
    pub correlation_px: Option<f64>,
}

/// Takes the given value, if there is one within its range.
pub(super) fn change(target: &mut f64, key: &str, value: Option<f64>, low: f64, high: f64) -> Result<(), Invalid> {
    let Some(value) = value else { return Ok(()) };
    if !(low..=high).contains(&value) {
        return Err(Invalid::new(key, format!("`{key} = {value}` is outside {low} to {high}")));
    }
    *target = value;
    Ok(())
}

impl Flight {
    pub(super) fn change(&mut self, by: &TimeOfFlight) -> Result<(), Invalid> {
        change(&mut self.floor_mm, "time_of_flight.floor_mm", by.floor_mm, 0.0, 1000.0)?;
        change(&mut self.shot_mm, "time_of_flight.shot_mm", by.shot_mm, 0.0, 1000.0)?;
        change(&mut self.background_mm, "time_of_flight.background_mm", by.background_mm, 0.0, 1000.0)?;
        change(&mut self.reach_m, "time_of_flight.reach_m", by.reach_m, 0.01, 1000.0)?;
        change(&mut self.reach_reflectance, "time_of_flight.reach_reflectance", by.reach_reflectance, 0.001, 1.0)?;
        change(&mut self.flying_pixels, "time_of_flight.flying_pixels", by.flying_pixels, 0.0, 1.0)
    }

    pub(super) fn record(&self) -> Value {
        Value::record([
            ("floor_mm", self.floor_mm.into()),
            ("shot_mm", self.shot_mm.into()),
            ("background_mm", self.background_mm.into()),
            ("reach_m", self.reach_m.into()),
            ("reach_reflectance", self.reach_reflectance.into()),
            ("flying_pixels", self.flying_pixels.into()),
        ])
    }
}

impl Matching {
    pub(super) fn change(&mut self, by: &Stereo) -> Result<(), Invalid> {
        change(&mut self.baseline_m, "stereo.baseline_m", by.baseline_m, 0.001, 10.0)?;
        change(&mut self.focal_length_px, "stereo.focal_length_px", by.focal_length_px, 1.0, 1e5)?;
        change(&mut self.disparity_noise_px, "stereo.disparity_noise_px", by.disparity_noise_px, 0.0, 100.0)?;
        change(&mut self.disparity_step_px, "stereo.disparity_step_px", by.disparity_step_px, 0.0, 100.0)?;
        change(&mut self.correlation_px, "stereo.correlation_px", by.correlation_px, 0.0, 50.0)
    }

    pub(super) fn record(&self) -> Value {
        Value::record([
            ("baseline_m", self.baseline_m.into()),
            ("focal_length_px", self.focal_length_px.into()),
            ("disparity_noise_px", self.disparity_noise_px.into()),
            ("disparity_step_px", self.disparity_step_px.into()),
            ("correlation_px", self.correlation_px.into()),
        ])
    }
}
