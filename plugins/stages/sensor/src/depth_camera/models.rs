//! Depth cameras on the market.

use super::model::Model;
use super::parameters::{Common, Principle, StereoParameters, TimeOfFlightParameters};

impl Model {
    /// Parameters of the model. Ranges, units and noise are published, with the exceptions and sources that each model
    /// states; `lateral_px`, `max_angle_deg`, `edge_step_m`, `edge_loss`, `flying_pixels` and `correlation_px` are
    /// estimates of our own.
    pub fn parameters(self) -> (Common, Principle) {
        let common = Common {
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
                common,
                Principle::TimeOfFlight(TimeOfFlightParameters {
                    floor_mm: 1.82,
                    shot_mm: 1.71,
                    background_mm: 0.0,
                    reach_m: 3.9,
                    reach_reflectance: 0.15,
                    flying_pixels: 0.4,
                }),
            ),
            // σ₀ = 0.5 as in BlenderProc; σ = 1 at 1 m on the reference surface and 17 at 3.86 m on a 15 % surface. The
            // result is 3 at 3 m on the reference surface, as in BlenderProc.
            Self::AzureKinect => (
                Common { range_m: [0.5, 3.86], unit_mm: 1.0, edge_loss: 0.4, ..common },
                Principle::TimeOfFlight(TimeOfFlightParameters {
                    floor_mm: 0.5,
                    shot_mm: 0.852,
                    background_mm: 0.157,
                    reach_m: 3.86,
                    reach_reflectance: 0.15,
                    flying_pixels: 0.5,
                }),
            ),
            Self::D435 => (
                Common {
                    range_m: [0.18, 10.0],
                    unit_mm: 1.0,
                    lateral_px: 0.5,
                    max_angle_deg: 75.0,
                    edge_loss: 0.4,
                    ..common
                },
                Principle::Stereo(StereoParameters {
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
