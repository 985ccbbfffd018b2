//! From clean depth to what a depth camera measures.

mod models;
mod stereo;
mod surface;
mod time_of_flight;

pub use models::{Flight, Matching, Model, Principle, Shared, Stereo, TimeOfFlight};

use crate::grid::{filled, normal_field, normal_pair};
use crate::view;
use models::change;
use std::f64::consts::FRAC_PI_2;
use surface::Surface;
use syntable_model::prelude::*;
use syntable_model::product::standard::{ALBEDO, DEPTH, DEPTH_SENSED, DEPTH_SENSOR, NORMAL};

/// Makes the depth that a depth camera of a given model would measure, beside the clean depth: in metres along the
/// optical axis, in whole steps of the camera's unit, 0 where there is no measurement. `depth_sensor` in the output has
/// all parameters.
///
/// The view takes the place of the depth camera: give `[camera]` its resolution and field of view. Every pixel
///
/// 1. is taken from a little aside: lateral noise of `lateral_px · (1 + 0.044 θ / (π/2 − θ))`, which grows with the angle
///    of incidence θ as Nguyen, Izadi and Lovell measured (3DIMPVT 2012);
/// 2. has no measurement beyond `max_angle_deg`, with `edge_loss` at an edge, with `dropout` anywhere;
/// 3. is measured by time of flight or stereo, as told at `time_of_flight` and `stereo`;
/// 4. has no measurement outside `range_m`, and is rounded to `unit_mm`.
///
/// Edges are steps of more than `edge_step_m` beyond the slope of the surfaces. Not modelled are gloss and glass, light
/// that comes by several ways, sunlight, motion and systematic errors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DepthCamera {
    /// The camera; all parameters that are left out are its own.
    pub model: Model,
    /// Factor on the noise along the ray; 1 is the camera's own, 0 is none.
    pub noise: Dist,
    /// Share of all pixels without measurement for no visible reason.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub dropout: f64,
    /// Nearest and farthest depth that is measured, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = 0.0, max = 1000.0)))]
    pub range_m: Option<[f64; 2]>,
    /// Step of the measured depth, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub unit_mm: Option<f64>,
    /// Standard deviation of the lateral noise on surfaces that are seen squarely, px of the picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 20.0))]
    pub lateral_px: Option<f64>,
    /// Angle between ray and normal beyond which there is no measurement, degrees; 90 for no limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1.0, max = 90.0))]
    pub max_angle_deg: Option<f64>,
    /// Least step of depth that is an edge, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0001, max = 100.0))]
    pub edge_step_m: Option<f64>,
    /// Share of the pixels on either side of an edge without measurement.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub edge_loss: Option<f64>,
    /// Changes to a time-of-flight camera: `l515`, `azure_kinect`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_of_flight: Option<TimeOfFlight>,
    /// Changes to a stereo camera: `d435`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stereo: Option<Stereo>,
}

impl Default for DepthCamera {
    fn default() -> Self {
        Self {
            model: Model::default(),
            noise: Dist::Constant(1.0),
            dropout: 0.0,
            range_m: None,
            unit_mm: None,
            lateral_px: None,
            max_angle_deg: None,
            edge_step_m: None,
            edge_loss: None,
            time_of_flight: None,
            stereo: None,
        }
    }
}

impl Config for DepthCamera {
    type Stage = dyn Sensor;
    const KIND: &'static str = "depth_camera";
    const EXAMPLE: &'static str = "model = \"d435\"\nnoise = { uniform = [0.8, 1.2] }\nstereo = { baseline_m = 0.05 }";
    fn build(self) -> Result<Box<dyn Sensor>, Invalid> {
        let (mut shared, mut principle) = self.model.parameters();
        self.noise.within("noise", 0.0, 100.0)?;
        let mut dropout = 0.0;
        change(&mut dropout, "dropout", Some(self.dropout), 0.0, 1.0)?;
        if let Some([near, far]) = self.range_m {
            if !(0.0..far).contains(&near) || far > 1000.0 {
                let message = format!("`range_m = [{near}, {far}]` is no range within 0 to 1000 m");
                return Err(Invalid::new("range_m", message).help("write the smaller bound first"));
            }
            shared.range_m = [near, far];
        }
        change(&mut shared.unit_mm, "unit_mm", self.unit_mm, 0.001, 1000.0)?;
        change(&mut shared.lateral_px, "lateral_px", self.lateral_px, 0.0, 20.0)?;
        change(&mut shared.max_angle_deg, "max_angle_deg", self.max_angle_deg, 1.0, 90.0)?;
        change(&mut shared.edge_step_m, "edge_step_m", self.edge_step_m, 1e-4, 100.0)?;
        change(&mut shared.edge_loss, "edge_loss", self.edge_loss, 0.0, 1.0)?;
        let name = self.model.name();
        match (&mut principle, &self.time_of_flight, &self.stereo) {
            (Principle::TimeOfFlight(_), _, Some(_)) => {
                return Err(Invalid::new("stereo", format!("`{name}` is no stereo camera"))
                    .help("use `time_of_flight`, or model = \"d435\""));
            }
            (Principle::Stereo(_), Some(_), _) => {
                return Err(Invalid::new("time_of_flight", format!("`{name}` does not time light"))
                    .help("use `stereo`, or model = \"l515\" or \"azure_kinect\""));
            }
            (Principle::TimeOfFlight(flight), Some(by), _) => flight.change(by)?,
            (Principle::Stereo(matching), _, Some(by)) => matching.change(by)?,
            _ => {}
        }
        Ok(Box::new(DepthSensor { model: self.model, noise: self.noise, dropout, shared, principle }))
    }
}
register!(DepthCamera);

/// A depth camera with all its parameters.
struct DepthSensor {
    model: Model,
    noise: Dist,
    dropout: f64,
    shared: Shared,
    principle: Principle,
}

/// What holds for a whole picture.
struct Camera<'a> {
    shared: &'a Shared,
    /// Factor on the noise.
    noise: f64,
}

/// How sharp the limit of steep angles is: standard deviation, radians.
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

    fn sense(&self, site: &Site, context: &Context, frame: &mut Frame) -> Result<()> {
        let camera = &view(site)?.camera;
        let (depth, workers, stream) = (frame.get(DEPTH)?, context.workers, &context.stream);
        let size = [depth.width(), depth.height()];
        let surface = Surface::new(camera, depth, frame.get(NORMAL)?, self.shared.edge_step_m, workers);
        let picture = Camera { shared: &self.shared, noise: self.noise.draw(&mut stream.child("noise")) };
        let pixels = stream.child("pixels");
        let sensed = match &self.principle {
            Principle::TimeOfFlight(flight) => {
                let albedo = frame.get(ALBEDO)?;
                filled(workers, size, |y, row: &mut [f32]| {
                    let mut stream = pixels.at(y.into());
                    for (x, out) in row.iter_mut().enumerate() {
                        *out = self.depth(&surface, [x as u32, y], &mut stream, |hit, stream| {
                            let margin = self.shared.max_angle_deg.to_radians() - hit.angle();
                            let seen = self.any_angle() || passes(margin / SOFT_ANGLE, stream);
                            seen.then(|| time_of_flight::measured(flight, &picture, &surface, albedo, hit, stream))?
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
                            let margin = self.shared.max_angle_deg.to_radians() - hit.angle();
                            let seen = self.any_angle() || margin > SOFT_ANGLE * f64::from(*holes.at(at[0], y));
                            let normal = f64::from(*noise.at(at[0], y));
                            seen.then(|| stereo::measured(matching, &picture, &surface, hit, normal, stream))?
                        });
                    }
                })
            }
        };
        let report = self.report(picture.noise, &sensed);
        frame.put(DEPTH_SENSED, sensed)?;
        frame.put(DEPTH_SENSOR, report)
    }
}

impl DepthSensor {
    /// The depth of a pixel as it is put out, given how it is measured.
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
        let seen = if self.shared.lateral_px > 0.0 {
            let sigma = self.shared.lateral_px * (1.0 + LATERAL * steepness(straight.angle()));
            let [dx, dy] = normal_pair(stream).map(|normal| sigma * normal);
            surface.near(f64::from(x) + dx, f64::from(y) + dy)
        } else {
            Some(straight)
        };
        let [near, far] = self.shared.range_m;
        let unit = self.shared.unit_mm / 1000.0;
        seen.and_then(|hit| measure(&hit, stream))
            .filter(|depth| (near..=far).contains(depth))
            .map_or(0.0, |depth| ((depth / unit).round() * unit) as f32)
    }

    fn any_angle(&self) -> bool {
        self.shared.max_angle_deg >= 90.0
    }

    fn report(&self, noise: f64, sensed: &Plane<f32>) -> Value {
        let shared = &self.shared;
        let measured = sensed.data().iter().filter(|depth| **depth > 0.0).count();
        let (name, parameters) = match &self.principle {
            Principle::TimeOfFlight(flight) => ("time_of_flight", flight.record()),
            Principle::Stereo(matching) => ("stereo", matching.record()),
        };
        Value::record([
            ("model", self.model.name().into()),
            ("noise", noise.into()),
            ("dropout", self.dropout.into()),
            ("range_m", shared.range_m.into()),
            ("unit_mm", shared.unit_mm.into()),
            ("lateral_px", shared.lateral_px.into()),
            ("max_angle_deg", shared.max_angle_deg.into()),
            ("edge_step_m", shared.edge_step_m.into()),
            ("edge_loss", shared.edge_loss.into()),
            (name, parameters),
            ("measured_share", (measured as f64 / sensed.data().len().max(1) as f64).into()),
        ])
    }
}

/// Growth of lateral noise with the angle: 0.035 over 0.8, of Nguyen et al.
const LATERAL: f64 = 0.044;

/// `θ / (π/2 − θ)`, held below 85°: how much of a pixel's depth is slope.
fn steepness(angle: f64) -> f64 {
    let angle = angle.min(85.0_f64.to_radians());
    angle / (FRAC_PI_2 - angle)
}

/// Whether something passes a limit that is not sharp: `margin` is how far it is from the limit, in the limit's standard
/// deviations.
fn passes(margin: f64, stream: &mut Stream) -> bool {
    margin > 4.0 || (margin > -4.0 && margin > stream.normal())
}
