//! Glowing rectangles under the ceiling.

use crate::radius::check_bounds;
use crate::sphere_lights::check_light;
use nalgebra::{Point3, Vector3};
use syntable_model::geometry::Aabb;
use syntable_model::photometry::{blackbody, polygon_illuminance};
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, Light, RectLight, Role};

/// Free space between a light and the ceiling, metres.
const BELOW_CEILING_M: f64 = 0.01;

/// Height above the tabletop where there is no ceiling and no `height_m`, metres.
const WITHOUT_CEILING_M: f64 = 3.0;

/// Rectangular lights that shine down from the ceiling, drawn anew for every view.
///
/// The lights hang level in a grid over the table, `spacing_m` apart, just below the room's ceiling or at `height_m`.
/// All have one luminance. Their brightness is the illuminance in lux that all of them together would give, with
/// nothing in between, at the middle of the tabletop on a plane that faces the middle of the lights, by Lambert's
/// formula for polygons. In rooms of differing height the light on the table is thus the same.
///
/// The released program uses `size_m = [15, 15]`, `height_m = 5`, `shift_m = 0`, `temperature_k = 6500` and
/// `luminance_nits = { uniform = [100, 1500] }`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CeilingLight {
    /// How many lights there are, drawn for each view.
    count: IntDist,
    /// Extent of each light along world x and y, metres.
    #[schemars(inner(range(min = 0.01, max = 1000.0)))]
    size_m: [f64; 2],
    /// Height above the floor, metres; just below the ceiling if it is left out, and never above that. Without a
    /// ceiling, 3 m above the tabletop.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.1, max = 1000.0))]
    height_m: Option<f64>,
    /// Distance between the middles of neighbouring lights, metres.
    #[schemars(range(min = 0.0, max = 1000.0))]
    spacing_m: f64,
    /// How far the middle of all lights may lie from above the table's middle, along x and y, metres: drawn uniformly to
    /// both sides.
    #[schemars(range(min = 0.0, max = 1000.0))]
    shift_m: f64,
    /// Colour temperature, kelvin.
    temperature_k: Dist,
    /// Illuminance that all lights together give at the middle of the tabletop on a plane facing them, lux. With 0 lx
    /// there is no light.
    illuminance_lx: Dist,
    /// Luminance of the lights' surface, nits (cd/m²); takes the place of `illuminance_lx` if given.
    #[serde(skip_serializing_if = "Option::is_none")]
    luminance_nits: Option<Dist>,
}

impl Default for CeilingLight {
    fn default() -> Self {
        Self {
            count: IntDist::Constant(1),
            size_m: [2.0, 2.0],
            height_m: None,
            spacing_m: 3.0,
            shift_m: 0.5,
            temperature_k: Dist::Uniform(2000.0, 6500.0),
            illuminance_lx: Dist::Uniform(100.0, 2000.0),
            luminance_nits: None,
        }
    }
}

impl Config for CeilingLight {
    type Stage = dyn LightSampler;
    const KIND: &'static str = "ceiling_light";
    const EXAMPLE: &'static str =
        "size_m = [2.0, 2.0]\ntemperature_k = { uniform = [2000, 6500] }\nilluminance_lx = { uniform = [100, 2000] }";

    fn build(self) -> Result<Box<dyn LightSampler>, Invalid> {
        self.count.within("count", 0, 1000)?;
        for edge in self.size_m {
            check_bounds("size_m", "size_m", [edge, edge], 0.01)?;
        }
        check_bounds("spacing_m", "spacing_m", [self.spacing_m; 2], 0.0)?;
        if let Some(height) = self.height_m {
            check_bounds("height_m", "height_m", [height; 2], 0.1)?;
        }
        check_bounds("shift_m", "shift_m", [self.shift_m; 2], 0.0)?;
        check_light(&self.temperature_k, &self.illuminance_lx, self.luminance_nits.as_ref())?;
        Ok(Box::new(self))
    }
}
register!(CeilingLight);

impl LightSampler for CeilingLight {
    fn lights(&self, scene: &Scene, _: &Camera, _: &Shell, context: &Context) -> Result<Vec<Light>> {
        let stream = &context.stream;
        let count = self.count.draw(&mut stream.child("count")).max(0) as usize;
        let mut shift = stream.child("shift");
        let [x, y] = [0, 1].map(|_| shift.uniform(-self.shift_m, self.shift_m));
        let tabletop = scene.tabletop.centre();
        let height = self.height(scene);
        if height <= tabletop.z + 0.01 {
            let message =
                format!("the ceiling lights at {height:.2} m are not above the tabletop at {:.2} m", tabletop.z);
            return Err(Error::new(message).help("make `height_m` or the room's `height_m` larger"));
        }
        let middle = Point3::new(tabletop.x + x, tabletop.y + y, height);
        let mut lights: Vec<RectLight> = grid(count, self.spacing_m)
            .into_iter()
            .map(|[dx, dy]| RectLight {
                centre: middle + Vector3::new(dx, dy, 0.0),
                // u × v points down.
                half_u: Vector3::new(self.size_m[0] / 2.0, 0.0, 0.0),
                half_v: Vector3::new(0.0, -self.size_m[1] / 2.0, 0.0),
                radiance: [0.0; 3],
            })
            .collect();
        let mut brightness = stream.child("brightness");
        let luminance = match &self.luminance_nits {
            Some(nits) => nits.draw(&mut brightness),
            None => {
                let facing = (middle - tabletop).normalize();
                let per_nit: f64 =
                    lights.iter().map(|light| polygon_illuminance(&light.corners(), tabletop, facing)).sum();
                self.illuminance_lx.draw(&mut brightness) / per_nit.max(1e-12)
            }
        };
        let color = blackbody(self.temperature_k.draw(&mut stream.child("temperature")));
        for light in &mut lights {
            light.radiance = color.map(|channel| channel * luminance);
        }
        Ok(if luminance > 0.0 { lights.into_iter().map(Light::Rect).collect() } else { Vec::new() })
    }
}

impl CeilingLight {
    /// Height of the lights above the floor.
    fn height(&self, scene: &Scene) -> f64 {
        let tabletop = scene.tabletop.centre();
        // The ceiling is the lowest part of the room over the table's middle.
        let ceiling = scene
            .bodies()
            .iter()
            .filter(|body| body.role == Role::Room)
            .map(|body| Aabb::of(body.object.mesh.bounds().corners().map(|p| body.world_from_body * p)))
            .filter(|b| (0..2).all(|k| b.min[k] <= tabletop[k] && tabletop[k] <= b.max[k]) && b.min.z > tabletop.z)
            .map(|b| b.min.z - BELOW_CEILING_M)
            .reduce(f64::min);
        match (self.height_m, ceiling) {
            (Some(height), Some(ceiling)) => height.min(ceiling),
            (Some(height), None) => height,
            (None, Some(ceiling)) => ceiling,
            (None, None) => tabletop.z + WITHOUT_CEILING_M,
        }
    }
}

/// Places of a grid as square as can be, around the origin; the last row is centred.
fn grid(count: usize, spacing: f64) -> Vec<[f64; 2]> {
    let columns = (count as f64).sqrt().ceil().max(1.0) as usize;
    let rows = count.div_ceil(columns);
    (0..count)
        .map(|i| {
            let (row, column) = (i / columns, i % columns);
            let in_row = columns.min(count - row * columns);
            let place = |i: usize, n: usize| (i as f64 - (n as f64 - 1.0) / 2.0) * spacing;
            [place(column, in_row), place(row, rows)]
        })
        .collect()
}
