//! Rectangular and round lights under the ceiling.

use crate::lights::brightness::limits::{TEMPERATURE_K, TINT};
use crate::lights::brightness::{Brightness, LightColor};
use crate::lights::per::Per;
use nalgebra::{Point3, Vector3};
use std::f64::consts::PI;
use syntable_model::photometry::{disk_illuminance, flux_luminance, polygon_illuminance};
use syntable_model::prelude::*;
use syntable_model::scene::{Camera, DiskLight, Light, RectLight, Support};

/// Gap between a light and the ceiling, meters.
const BELOW_CEILING_M: f64 = 0.01;

/// Height above the support without a ceiling and without `height_m`, meters.
const WITHOUT_CEILING_M: f64 = 3.0;

/// Rectangular or round lights that face down from the ceiling: one large panel, a few smaller ones, or a grid of
/// downlights.
///
/// The lights form a horizontal grid above the support, such as the table, `spacing_m` apart, just below the ceiling or
/// at `height_m`. All have the same luminance. `brightness.illuminance_lx` is the illuminance of all lights together at
/// the center of the support on a plane that faces the center of the grid, by Lambert's formula for polygons, so rooms
/// of different heights have the same light there.
///
/// The released program uses `size_m = [15, 15]`, `height_m = 5`, `shift_m = 0` and white light, here
/// `temperature_k = 6500`. Its intensity, uniform in 100 to 1500, is not an illuminance;
/// `recipes/syntable-sim/release.toml` takes the same numbers as lux.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CeilingLight {
    /// Whether lights are sampled per `view` or once per `scene`.
    per: Per,
    /// Name of the support that the lights are above. If left out, it is the first that a step of `[[place]]` sets.
    #[serde(skip_serializing_if = "Option::is_none")]
    support: Option<SupportName>,
    /// Number of lights, from 0 to 1000.
    #[schemars(extend("minimum" = COUNT[0], "maximum" = COUNT[1]))]
    count: IntDist,
    /// Outline of the lights.
    shape: CeilingShape,
    /// Extent of each light along world x and y, meters; for a disk, its diameter twice.
    #[schemars(inner(range(min = 0.01, max = 1000.0)))]
    size_m: [f64; 2],
    /// Height above the floor, meters, limited by the ceiling. Default: just below the ceiling, or 3 m above the
    /// support without a ceiling.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.1, max = 1000.0))]
    height_m: Option<f64>,
    /// Distance between the centers of neighboring lights, meters.
    #[schemars(range(min = 0.0, max = 1000.0))]
    spacing_m: f64,
    /// Largest offset of the grid from the center of the support along x and along y, meters. Offsets are uniform in
    /// ±`shift_m`.
    #[schemars(range(min = 0.0, max = 1000.0))]
    shift_m: f64,
    /// Color temperature, kelvin, from 1000 to 40,000.
    #[schemars(extend("minimum" = TEMPERATURE_K[0], "maximum" = TEMPERATURE_K[1]))]
    temperature_k: Dist,
    /// Factor of the light's red, green and blue, drawn for each of the three, 0 to 1: `{ uniform = [0.5, 1] }` gives pale colors. A
    /// filter darkens: `brightness` is the brightness without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = TINT[0], "maximum" = TINT[1]))]
    tint: Option<Dist>,
    /// Brightness: `{ illuminance_lx = 500 }` of all lights together, `{ luminance_nits = 3000 }` or
    /// `{ luminous_flux_lm = 800 }` of each light. Zero brightness switches the lights off.
    brightness: Brightness,
}

/// Limits of `count`.
const COUNT: [i64; 2] = [0, 1000];

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
            support: None,
            count: IntDist::Constant(1),
            shape: CeilingShape::Rect,
            size_m: [2.0, 2.0],
            height_m: None,
            spacing_m: 3.0,
            shift_m: 0.5,
            temperature_k: Dist::Uniform(2000.0, 6500.0),
            tint: None,
            brightness: Brightness::IlluminanceLx(Dist::Uniform(100.0, 2000.0)),
        }
    }
}

impl Config for CeilingLight {
    type Stage = dyn LightSampler;
    const KIND: &'static str = "ceiling_light";
    const EXAMPLE: &'static str = "size_m = [2.0, 2.0]\ntemperature_k = { uniform = [2000, 6500] }\n\
        brightness = { illuminance_lx = { uniform = [100, 2000] } }";
    const RENAMED: &'static [(&'static str, &'static str)] = &[
        ("illuminance_lx", "brightness.illuminance_lx"),
        ("luminance_nits", "brightness.luminance_nits"),
        ("luminous_flux_lm", "brightness.luminous_flux_lm"),
    ];

    fn build(self) -> Result<Box<dyn LightSampler>, ConfigError> {
        self.count.within("count", COUNT[0], COUNT[1])?;
        if self.shape == CeilingShape::Disk && self.size_m[0] != self.size_m[1] {
            let message = format!("a disk of `size_m = {:?}` would be an ellipse", self.size_m);
            return Err(ConfigError::new("size_m", message).help("write its diameter twice"));
        }
        self.color().check()?;
        self.brightness.check()?;
        Ok(Box::new(self))
    }
}
register!(CeilingLight);

impl LightSampler for CeilingLight {
    fn needs(&self) -> Option<Part> {
        self.support.is_none().then_some(Part::MainSupport)
    }

    fn once_per_scene(&self) -> bool {
        self.per == Per::Scene
    }

    fn lights(&self, scene: &Scene, _: &Camera, _: &Shell, context: &Context) -> Result<Vec<Light>> {
        let stream = &context.stream;
        let count = self.count.draw(&mut stream.child("count")).max(0) as usize;
        let mut shift = stream.child("shift");
        let [x, y] = [0, 1].map(|_| shift.uniform(-self.shift_m, self.shift_m));
        let support = scene.support(self.support.as_ref())?;
        let lit = support.center();
        let height = self.height(scene, support);
        if height <= lit.z + 0.01 {
            let message =
                format!("the ceiling lights at {height:.2} m are not above the {} at {:.2} m", support.name, lit.z);
            return Err(Error::unlucky(message).help("make `height_m` or the room's `height_m` larger"));
        }
        let grid_center = Point3::new(lit.x + x, lit.y + y, height);
        let centers: Vec<Point3<f64>> =
            grid(count, self.spacing_m).into_iter().map(|[dx, dy]| grid_center + Vector3::new(dx, dy, 0.0)).collect();
        let luminance = self.brightness.draw(
            &mut stream.child("brightness"),
            |lux| {
                let facing = (grid_center - lit).normalize();
                let per_nit: f64 = centers.iter().map(|&center| self.illuminance(center, lit, facing)).sum();
                lux / per_nit.max(1e-12)
            },
            |lumens| flux_luminance(lumens, self.area()),
        );
        let color = self.color().draw(stream);
        let radiance = color.map(|channel| channel * luminance);
        let light = |center: &Point3<f64>| match self.shape {
            CeilingShape::Rect => Light::Rect(RectLight { radiance, ..self.rect(*center) }),
            CeilingShape::Disk => {
                let radius = self.size_m[0] / 2.0;
                Light::Disk(DiskLight { center: *center, normal: -Vector3::z(), radius, radiance })
            }
        };
        Ok(if luminance > 0.0 { centers.iter().map(light).collect() } else { Vec::new() })
    }
}

impl CeilingLight {
    fn color(&self) -> LightColor<'_> {
        LightColor { temperature_k: &self.temperature_k, tint: self.tint.as_ref() }
    }

    /// A rectangle of zero radiance.
    fn rect(&self, center: Point3<f64>) -> RectLight {
        // u × v points down.
        let (half_u, half_v) =
            (Vector3::new(self.size_m[0] / 2.0, 0.0, 0.0), Vector3::new(0.0, -self.size_m[1] / 2.0, 0.0));
        RectLight { center, half_u, half_v, radiance: [0.0; 3] }
    }

    /// Area of one light, m².
    fn area(&self) -> f64 {
        match self.shape {
            CeilingShape::Rect => self.size_m[0] * self.size_m[1],
            CeilingShape::Disk => PI / 4.0 * self.size_m[0] * self.size_m[0],
        }
    }

    /// Illuminance per nit of one light at a point on a plane, lux.
    fn illuminance(&self, center: Point3<f64>, point: Point3<f64>, normal: Vector3<f64>) -> f64 {
        match self.shape {
            CeilingShape::Rect => polygon_illuminance(&self.rect(center).corners(), point, normal),
            CeilingShape::Disk => disk_illuminance(center, -Vector3::z(), self.size_m[0] / 2.0, point, normal),
        }
    }

    /// Height of the lights above the floor, meters.
    fn height(&self, scene: &Scene, support: &Support) -> f64 {
        // The ceiling is the lowest part of the room above the center of the support.
        let ceiling =
            Some(scene.room_around(&support.center()).max.z - BELOW_CEILING_M).filter(|height| height.is_finite());
        match (self.height_m, ceiling) {
            (Some(height), Some(ceiling)) => height.min(ceiling),
            (Some(height), None) => height,
            (None, Some(ceiling)) => ceiling,
            (None, None) => support.height() + WITHOUT_CEILING_M,
        }
    }
}

/// Points of a grid around the origin, as square as possible; the last row is centered.
fn grid(count: usize, spacing: f64) -> Vec<[f64; 2]> {
    let columns = (count as f64).sqrt().ceil().max(1.0) as usize;
    let rows = count.div_ceil(columns);
    (0..count)
        .map(|i| {
            let (row, column) = (i / columns, i % columns);
            let in_row = columns.min(count - row * columns);
            let center = |i: usize, n: usize| (i as f64 - (n as f64 - 1.0) / 2.0) * spacing;
            [center(column, in_row), center(row, rows)]
        })
        .collect()
}
