//! Simulates depth cameras: from clean depth to measured depth.

mod model;
mod models;
mod parameters;
mod stereo;
mod surface;
mod time_of_flight;

pub use model::Model;
pub use parameters::{Common, DepthCamera, Principle, Stereo, StereoParameters, TimeOfFlight, TimeOfFlightParameters};

use crate::image_filter::{filled, normal_field, normal_pair};
use parameters::NOISE;
use std::f64::consts::FRAC_PI_2;
use surface::Surface;
use syntable_model::prelude::*;
use syntable_model::product::standard::{ALBEDO, DEPTH, DEPTH_SENSED, DEPTH_SENSOR, NORMAL};

impl Config for DepthCamera {
    type Stage = dyn Sensor;
    const KIND: &'static str = "depth_camera";
    const EXAMPLE: &'static str = "model = \"d435\"\nnoise = { uniform = [0.8, 1.2] }\nstereo = { baseline_m = 0.05 }";

    fn build(self) -> Result<Box<dyn Sensor>, ConfigError> {
        self.noise.within("noise", NOISE[0], NOISE[1])?;
        let (common, principle) = self.model.parameters();
        let common = common.overridden(&self);
        let [near, far] = common.range_m;
        if near >= far {
            return Err(ConfigError::new("range_m", format!("`range_m = [{near}, {far}]` is empty"))
                .help("write the smaller bound first"));
        }
        let name = self.model.name();
        let principle = match (principle, &self.time_of_flight, &self.stereo) {
            (Principle::TimeOfFlight(_), _, Some(_)) => {
                return Err(ConfigError::new("stereo", format!("`{name}` is not a stereo camera"))
                    .help("use `time_of_flight`, or model = \"d435\""));
            }
            (Principle::Stereo(_), Some(_), _) => {
                return Err(ConfigError::new("time_of_flight", format!("`{name}` is not a time-of-flight camera"))
                    .help("use `stereo`, or model = \"l515\" or \"azure_kinect\""));
            }
            (Principle::TimeOfFlight(flight), Some(options), _) => Principle::TimeOfFlight(flight.overridden(options)),
            (Principle::Stereo(stereo), _, Some(options)) => Principle::Stereo(stereo.overridden(options)),
            (unchanged, None, None) => unchanged,
        };
        Ok(Box::new(DepthSensor { model: self.model, noise: self.noise, dropout: self.dropout, common, principle }))
    }
}
register!(DepthCamera);

/// A depth camera with all its parameters.
struct DepthSensor {
    model: Model,
    noise: Dist,
    dropout: f64,
    common: Common,
    principle: Principle,
}

/// Values that are the same for a whole image.
struct Camera<'a> {
    common: &'a Common,
    /// Factor on the noise.
    noise: f64,
}

/// The product `depth_sensor`.
#[derive(Serialize)]
struct Report<'a> {
    model: &'static str,
    noise: f64,
    dropout: f64,
    #[serde(flatten)]
    common: &'a Common,
    #[serde(flatten)]
    principle: &'a Principle,
    /// Fraction of all pixels with a measurement.
    measured_fraction: f64,
}

/// Softness of `max_angle_deg`: standard deviation, radians.
const SOFT_ANGLE: f64 = 0.05;

impl Sensor for DepthSensor {
    fn reads(&self) -> Vec<KeyId> {
        match self.principle {
            Principle::TimeOfFlight(_) => keys![DEPTH, NORMAL, ALBEDO],
            Principle::Stereo(_) => keys![DEPTH, NORMAL],
        }
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![DEPTH_SENSED, DEPTH_SENSOR]
    }

    fn sense(&self, cx: &ViewContext, stream: &Stream, products: &mut Products) -> Result<()> {
        let (camera, workers) = (&cx.view.camera, cx.workers);
        let depth = products.get(DEPTH)?;
        let size = [depth.width(), depth.height()];
        let surface = Surface::new(camera, depth, products.get(NORMAL)?, self.common.edge_step_m, workers);
        let image = Camera { common: &self.common, noise: self.noise.draw(&mut stream.child("noise")) };
        let pixels = stream.child("pixels");
        let sensed = match &self.principle {
            Principle::TimeOfFlight(flight) => {
                let albedo = products.get(ALBEDO)?;
                filled(workers, size, |y, row: &mut [f32]| {
                    let mut stream = pixels.at(y.into());
                    for (x, out) in row.iter_mut().enumerate() {
                        *out = self.depth(&surface, [x as u32, y], &mut stream, |hit, stream| {
                            let margin = self.common.max_angle_deg.to_radians() - hit.angle();
                            let seen = self.any_angle() || passes(margin / SOFT_ANGLE, stream);
                            seen.then(|| time_of_flight::measured(flight, &image, &surface, albedo, hit, stream))?
                        });
                    }
                })
            }
            Principle::Stereo(matching) => {
                let hidden = stereo::hidden(depth, camera.intrinsics.fx, matching.baseline_m, workers);
                let field = |name: &str| normal_field(workers, size, matching.correlation_px, &stream.child(name));
                let (noise, holes) = (field("disparity"), field("holes"));
                filled(workers, size, |y, row: &mut [f32]| {
                    let mut stream = pixels.at(y.into());
                    for (x, out) in row.iter_mut().enumerate() {
                        let at = [x as u32, y];
                        if *hidden.at(at[0], y) {
                            continue;
                        }
                        *out = self.depth(&surface, at, &mut stream, |hit, stream| {
                            let margin = self.common.max_angle_deg.to_radians() - hit.angle();
                            let seen = self.any_angle() || margin > SOFT_ANGLE * f64::from(*holes.at(at[0], y));
                            let normal = f64::from(*noise.at(at[0], y));
                            seen.then(|| stereo::measured(matching, &image, &surface, hit, normal, stream))?
                        });
                    }
                })
            }
        };
        let report = self.report(image.noise, &sensed)?;
        products.put(DEPTH_SENSED, sensed)?;
        products.put(DEPTH_SENSOR, report)
    }
}

impl DepthSensor {
    /// The quantized depth of a pixel, meters, given a measurement; 0 without one.
    fn depth(
        &self,
        surface: &Surface,
        [x, y]: [u32; 2],
        stream: &mut Stream,
        measure: impl Fn(&surface::Hit, &mut Stream) -> Option<f64>,
    ) -> f32 {
        let Some(straight) = surface.hit([x, y]) else { return 0.0 };
        if self.dropout > 0.0 && stream.chance(self.dropout) {
            return 0.0;
        }
        let seen = if self.common.lateral_px > 0.0 {
            let sigma = self.common.lateral_px * (1.0 + LATERAL * steepness(straight.angle()));
            let [dx, dy] = normal_pair(stream).map(|normal| sigma * normal);
            surface.near(f64::from(x) + dx, f64::from(y) + dy)
        } else {
            Some(straight)
        };
        let [near, far] = self.common.range_m;
        let unit = self.common.unit_mm / 1000.0;
        seen.and_then(|hit| measure(&hit, stream))
            .filter(|depth| (near..=far).contains(depth))
            .map_or(0.0, |depth| ((depth / unit).round() * unit) as f32)
    }

    fn any_angle(&self) -> bool {
        self.common.max_angle_deg >= 90.0
    }

    fn report(&self, noise: f64, sensed: &Plane<f32>) -> Result<Value> {
        let measured = sensed.data().iter().filter(|depth| **depth > 0.0).count();
        Value::of(&Report {
            model: self.model.name(),
            noise,
            dropout: self.dropout,
            common: &self.common,
            principle: &self.principle,
            measured_fraction: measured as f64 / sensed.data().len().max(1) as f64,
        })
    }
}

/// Growth of lateral noise with the angle of incidence: 0.035 over 0.8, from Nguyen et al.
const LATERAL: f64 = 0.044;

/// `θ / (π/2 − θ)` for angles of incidence clamped to 85°.
fn steepness(angle: f64) -> f64 {
    let angle = angle.min(85.0_f64.to_radians());
    angle / (FRAC_PI_2 - angle)
}

/// Whether a value passes a soft limit. `margin` is its distance from the limit in standard deviations of the limit.
fn passes(margin: f64, stream: &mut Stream) -> bool {
    margin > 4.0 || (margin > -4.0 && margin > stream.normal())
}
