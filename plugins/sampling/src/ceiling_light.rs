//! Glowing rectangles and disks under the ceiling.

use crate::brightness::{Brightness, check_temperature, complete};
use crate::per::Per;
use crate::radius::check_bounds;
use crate::room::inside;
use nalgebra::{Point3, Vector3};
use std::f64::consts::PI;
use syntable_model::photometry::{blackbody, disk_illuminance, flux_luminance, polygon_illuminance};
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, DiskLight, Light, RectLight};

/// Free space between a light and the ceiling, metres.
const BELOW_CEILING_M: f64 = 0.01;

/// Height above the tabletop where there is no ceiling and no `height_m`, metres.
const WITHOUT_CEILING_M: f64 = 3.0;

/// Rectangular or round lights that shine down from the ceiling: one large panel, a few
/// smaller ones, or a grid of down-lights.
///
/// The lights hang level in a grid over the table, `spacing_m` apart, just below the room's ceiling or at `height_m`.
/// All have one luminance. Their brightness is the illuminance in lux that all of them together would give, with
/// nothing in between, at the middle of the tabletop on a plane that faces the middle of the lights, by Lambert's
/// formula for polygons. In rooms of differing height the light on the table is thus the same.
///
/// The released program uses `size_m = [15, 15]`, `height_m = 5`, `shift_m = 0` and white light, here
/// `temperature_k = 6500`. Its intensity, uniform in 100 to 1500, is no illuminance;
/// `recipes/syntable-sim/release.toml` takes the same numbers as lux.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CeilingLight {
    /// Whether it is drawn anew for every `view`, or once for all views of a `scene`.
    per: Per,
    /// How many lights there are.
    count: IntDist,
    /// Whether the lights are rectangles or disks.
    shape: CeilingShape,
    /// Extent of each light along world x and y, metres; of a disk, both are its diameter.
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
    /// there is no light. Uniform in 100 to 2000 lx unless brightness is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    illuminance_lx: Option<Dist>,
    /// Luminance of the lights' surface, nits (cd/m²); takes the place of `illuminance_lx` if given.
    #[serde(skip_serializing_if = "Option::is_none")]
    luminance_nits: Option<Dist>,
    /// Luminous flux of each light, lumens, as on a lamp's box; in place of the above.
    #[serde(skip_serializing_if = "Option::is_none")]
    luminous_flux_lm: Option<Dist>,
}

/// Outline of ceiling lights.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CeilingShape {
    /// Rectangles.
    #[default]
    Rect,
    /// Disks.
    Disk,
}

impl Default for CeilingLight {
    fn default() -> Self {
        Self {
            per: Per::default(),
            count: IntDist::Constant(1),
            shape: CeilingShape::Rect,
            size_m: [2.0, 2.0],
            height_m: None,
            spacing_m: 3.0,
            shift_m: 0.5,
            temperature_k: Dist::Uniform(2000.0, 6500.0),
            illuminance_lx: None,
            luminance_nits: None,
            luminous_flux_lm: None,
        }
    }
}

impl Config for CeilingLight {
    type Stage = dyn LightSampler;
    const KIND: &'static str = "ceiling_light";
    const EXAMPLE: &'static str =
        "size_m = [2.0, 2.0]\ntemperature_k = { uniform = [2000, 6500] }\nilluminance_lx = { uniform = [100, 2000] }";

    fn completed(mut self) -> Self {
        let usual = Dist::Uniform(100.0, 2000.0);
        complete(&mut self.illuminance_lx, &self.luminance_nits, &self.luminous_flux_lm, usual);
        self
    }

    fn build(self) -> Result<Box<dyn LightSampler>, Invalid> {
        self.count.within("count", 0, 1000)?;
        for edge in self.size_m {
            check_bounds("size_m", "size_m", [edge, edge], 0.01)?;
        }
        if self.shape == CeilingShape::Disk && self.size_m[0] != self.size_m[1] {
            let message = format!("a disk of `size_m = {:?}` would be an ellipse", self.size_m);
            return Err(Invalid::new("size_m", message).help("write its diameter twice"));
        }
        check_bounds("spacing_m", "spacing_m", [self.spacing_m; 2], 0.0)?;
        if let Some(height) = self.height_m {
            check_bounds("height_m", "height_m", [height; 2], 0.1)?;
        }
        check_bounds("shift_m", "shift_m", [self.shift_m; 2], 0.0)?;
        check_temperature(&self.temperature_k)?;
        let light = self.completed();
        light.brightness().check()?;
        Ok(Box::new(light))
    }
}
register!(CeilingLight);

impl LightSampler for CeilingLight {
    fn once_per_scene(&self) -> bool {
        self.per == Per::Scene
    }

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
        let places: Vec<Point3<f64>> =
            grid(count, self.spacing_m).into_iter().map(|[dx, dy]| middle + Vector3::new(dx, dy, 0.0)).collect();
        let luminance = self.brightness().draw(
            &mut stream.child("brightness"),
            |lux| {
                let facing = (middle - tabletop).normalize();
                let per_nit: f64 = places.iter().map(|&place| self.illuminance(place, tabletop, facing)).sum();
                lux / per_nit.max(1e-12)
            },
            |lumens| flux_luminance(lumens, self.area()),
        );
        let color = blackbody(self.temperature_k.draw(&mut stream.child("temperature")));
        let radiance = color.map(|channel| channel * luminance);
        let light = |place: &Point3<f64>| match self.shape {
            CeilingShape::Rect => Light::Rect(RectLight { radiance, ..self.rect(*place) }),
            CeilingShape::Disk => {
                let radius = self.size_m[0] / 2.0;
                Light::Disk(DiskLight { centre: *place, normal: -Vector3::z(), radius, radiance })
            }
        };
        Ok(if luminance > 0.0 { places.iter().map(light).collect() } else { Vec::new() })
    }
}

impl CeilingLight {
    fn brightness(&self) -> Brightness<'_> {
        Brightness {
            illuminance_lx: self.illuminance_lx.as_ref(),
            luminance_nits: self.luminance_nits.as_ref(),
            luminous_flux_lm: self.luminous_flux_lm.as_ref(),
        }
    }

    /// A rectangle around a place, dark.
    fn rect(&self, centre: Point3<f64>) -> RectLight {
        // u × v points down.
        let (half_u, half_v) =
            (Vector3::new(self.size_m[0] / 2.0, 0.0, 0.0), Vector3::new(0.0, -self.size_m[1] / 2.0, 0.0));
        RectLight { centre, half_u, half_v, radiance: [0.0; 3] }
    }

    /// Area of one light, m².
    fn area(&self) -> f64 {
        match self.shape {
            CeilingShape::Rect => self.size_m[0] * self.size_m[1],
            CeilingShape::Disk => PI / 4.0 * self.size_m[0] * self.size_m[0],
        }
    }

    /// Illuminance per nit of one light at a point on a plane, lux.
    fn illuminance(&self, place: Point3<f64>, point: Point3<f64>, normal: Vector3<f64>) -> f64 {
        match self.shape {
            CeilingShape::Rect => polygon_illuminance(&self.rect(place).corners(), point, normal),
            CeilingShape::Disk => disk_illuminance(place, -Vector3::z(), self.size_m[0] / 2.0, point, normal),
        }
    }

    /// Height of the lights above the floor.
    fn height(&self, scene: &Scene) -> f64 {
        let tabletop = scene.tabletop.centre();
        // The ceiling is the lowest part of the room over the table's middle.
        let ceiling = Some(inside(scene).max.z - BELOW_CEILING_M).filter(|height| height.is_finite());
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
