//! Daylight through windows.

use crate::brightness::{Brightness, check_temperature, complete};
use crate::per::Per;
use crate::radius::check_bounds;
use crate::room::inside;
use nalgebra::{Point3, Vector3};
use syntable_model::geometry::Aabb;
use syntable_model::photometry::{blackbody, polygon_illuminance};
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, Light, RectLight};

/// Free space between a window and its wall, metres.
const BEFORE_WALL_M: f64 = 0.01;

/// Least distance of a window from the room's edges, metres.
const MARGIN_M: f64 = 0.1;

/// Daylight through windows: bright rectangles in a row just before a wall of the room.
///
/// All windows of a view have one size and one luminance, that of the sky which is seen through them. Their brightness
/// is the illuminance in lux that all of them together would give, with nothing in between, at the middle of the
/// tabletop on a level plane, by Lambert's formula for polygons. Where a wall is too short or too low, fewer windows
/// are there, or smaller ones.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct WindowLight {
    /// Whether it is drawn anew for every `view`, or once for all views of a `scene`.
    per: Per,
    /// How many walls have windows; which ones is random.
    walls: IntDist,
    /// How many windows a wall has, drawn for each wall.
    count: IntDist,
    /// Width of a window, metres.
    width_m: Dist,
    /// Height of a window, metres.
    height_m: Dist,
    /// Height of the lower edge above the floor, metres.
    sill_m: Dist,
    /// Distance between neighbouring windows, metres.
    spacing_m: Dist,
    /// Colour temperature of the daylight, kelvin.
    temperature_k: Dist,
    /// Illuminance that all windows together give at the middle of the tabletop on a level plane, lux. With 0 lx there
    /// is no light. Log-uniform in 200 to 3000 lx unless brightness is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    illuminance_lx: Option<Dist>,
    /// Luminance of the sky in the windows, nits (cd/m²); takes the place of `illuminance_lx` if given.
    #[serde(skip_serializing_if = "Option::is_none")]
    luminance_nits: Option<Dist>,
}

impl Default for WindowLight {
    fn default() -> Self {
        Self {
            per: Per::default(),
            walls: IntDist::Constant(1),
            count: IntDist::Integers(1, 3),
            width_m: Dist::Uniform(0.8, 2.0),
            height_m: Dist::Uniform(1.0, 1.6),
            sill_m: Dist::Uniform(0.7, 1.0),
            spacing_m: Dist::Uniform(0.3, 1.0),
            temperature_k: Dist::Uniform(5000.0, 7500.0),
            illuminance_lx: None,
            luminance_nits: None,
        }
    }
}

impl Config for WindowLight {
    type Stage = dyn LightSampler;
    const KIND: &'static str = "window_light";
    const EXAMPLE: &'static str = "walls = 1\ncount = { integers = [1, 3] }\ntemperature_k = { uniform = [5000, 7500] }\n\
        illuminance_lx = { log_uniform = [200, 3000] }";

    fn completed(mut self) -> Self {
        complete(&mut self.illuminance_lx, &self.luminance_nits, &None, Dist::LogUniform(200.0, 3000.0));
        self
    }

    fn build(self) -> Result<Box<dyn LightSampler>, Invalid> {
        self.walls.within("walls", 0, 4)?;
        self.count.within("count", 1, 100)?;
        for (key, dist, least) in [
            ("width_m", &self.width_m, 0.05),
            ("height_m", &self.height_m, 0.05),
            ("sill_m", &self.sill_m, 0.0),
            ("spacing_m", &self.spacing_m, 0.0),
        ] {
            let (low, high) = dist.range();
            check_bounds(key, key, [low, high], least)?;
        }
        check_temperature(&self.temperature_k)?;
        let light = self.completed();
        light.brightness().check()?;
        Ok(Box::new(light))
    }
}
register!(WindowLight);

impl LightSampler for WindowLight {
    fn once_per_scene(&self) -> bool {
        self.per == Per::Scene
    }

    fn lights(&self, scene: &Scene, _: &Camera, _: &Shell, context: &Context) -> Result<Vec<Light>> {
        let stream = &context.stream;
        let draw = |name: &str, dist: &Dist| dist.draw(&mut stream.child(name));
        let room = inside(scene);
        let mut walls = Wall::all(&room);
        if walls.is_empty() {
            return Err(Error::new("there is no wall for a window")
                .help("place a room, or take the light kind `environment` instead of `window_light`"));
        }
        stream.child("which").shuffle(&mut walls);
        walls.truncate(self.walls.draw(&mut stream.child("walls")).max(0) as usize);
        let size = [draw("width", &self.width_m), draw("height", &self.height_m)];
        let (sill, spacing) = (draw("sill", &self.sill_m), draw("spacing", &self.spacing_m));
        let mut windows = Vec::new();
        for (i, wall) in walls.iter().enumerate() {
            let stream = stream.child("wall").at(i as u64);
            let count = self.count.draw(&mut stream.child("count")).max(1) as usize;
            windows.extend(wall.windows(count, size, sill, spacing, &mut stream.child("place")));
        }
        let tabletop = scene.tabletop.centre();
        let per_nit: f64 =
            windows.iter().map(|window| polygon_illuminance(&window.corners(), tabletop, Vector3::z())).sum();
        let luminance = self.brightness().draw(
            &mut stream.child("brightness"),
            |lux| if lux > 0.0 { lux / per_nit } else { 0.0 },
            |_| 0.0,
        );
        if !luminance.is_finite() && !windows.is_empty() {
            let message = format!("no window reaches above the tabletop at {:.2} m", tabletop.z);
            return Err(Error::new(message).help("make `sill_m` or `height_m` larger"));
        }
        let color = blackbody(draw("temperature", &self.temperature_k));
        let radiance = color.map(|channel| channel * luminance);
        let lit = windows.into_iter().map(|window| Light::Rect(RectLight { radiance, ..window }));
        Ok(if luminance > 0.0 { lit.collect() } else { Vec::new() })
    }
}

impl WindowLight {
    fn brightness(&self) -> Brightness<'_> {
        Brightness {
            illuminance_lx: self.illuminance_lx.as_ref(),
            luminance_nits: self.luminance_nits.as_ref(),
            luminous_flux_lm: None,
        }
    }
}

/// The inner face of a wall.
struct Wall {
    /// The middle of its lower edge.
    foot: Point3<f64>,
    /// Into the room.
    inwards: Vector3<f64>,
    /// To the right, seen from inside.
    along: Vector3<f64>,
    length: f64,
    height: f64,
}

impl Wall {
    /// The walls of a room; a room that is open sideways or upwards counts as 20 m there.
    fn all(room: &Aabb) -> Vec<Self> {
        const OPEN_M: f64 = 20.0;
        let limit = |low: f64, high: f64| match (low.is_finite(), high.is_finite()) {
            (true, true) => [low, high],
            (true, false) => [low, low + OPEN_M],
            (false, true) => [high - OPEN_M, high],
            (false, false) => [-OPEN_M / 2.0, OPEN_M / 2.0],
        };
        let extent: [[f64; 2]; 2] = [0, 1].map(|axis| limit(room.min[axis], room.max[axis]));
        let floor = if room.min.z.is_finite() { room.min.z } else { 0.0 };
        let height = if room.max.z.is_finite() { room.max.z - floor } else { OPEN_M };
        let mut walls = Vec::new();
        for axis in 0..2 {
            for (place, side) in [(room.min[axis], 1.0), (room.max[axis], -1.0)] {
                if !place.is_finite() {
                    continue;
                }
                let [low, high] = extent[1 - axis];
                let mut foot = Point3::new(0.0, 0.0, floor);
                (foot[axis], foot[1 - axis]) = (place, (low + high) / 2.0);
                let mut inwards = Vector3::zeros();
                inwards[axis] = side;
                // along × up points into the room.
                walls.push(Self { foot, inwards, along: Vector3::z().cross(&inwards), length: high - low, height });
            }
        }
        walls
    }

    /// As many windows as fit, at least one, in a row whose place along the wall is random; dark.
    fn windows(
        &self,
        count: usize,
        [width, height]: [f64; 2],
        sill: f64,
        spacing: f64,
        stream: &mut Stream,
    ) -> Vec<RectLight> {
        let free = (self.length - 2.0 * MARGIN_M).max(0.05);
        let width = width.min(free);
        let count = count.min((1.0 + (free - width) / (width + spacing)).floor() as usize).max(1);
        let row = count as f64 * width + (count as f64 - 1.0) * spacing;
        let shift = stream.uniform(-0.5, 0.5) * (free - row).max(0.0);
        // A low ceiling lowers the windows before it shortens them.
        let top = (self.height - MARGIN_M).max(0.05);
        let height = height.min(top);
        let sill = sill.min(top - height);
        (0..count)
            .map(|i| {
                let at = shift - row / 2.0 + width / 2.0 + i as f64 * (width + spacing);
                let up = Vector3::z() * (sill + height / 2.0);
                RectLight {
                    centre: self.foot + self.along * at + up + self.inwards * BEFORE_WALL_M,
                    half_u: self.along * (width / 2.0),
                    half_v: Vector3::z() * (height / 2.0),
                    radiance: [0.0; 3],
                }
            })
            .collect()
    }
}
