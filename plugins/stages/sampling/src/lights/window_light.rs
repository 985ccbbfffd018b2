//! Daylight through windows.

use crate::lights::brightness::check_temperature;
use crate::lights::brightness::limits::{ILLUMINANCE_LX, LUMINANCE_NITS, TEMPERATURE_K};
use crate::lights::landscape::landscape;
use crate::lights::per::Per;
use nalgebra::{Point3, Vector3};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;
use syntable_model::geometry::Aabb;
use syntable_model::photometry::{blackbody, level_irradiance, luminance, polygon_illuminance};
use syntable_model::prelude::*;
use syntable_model::scene::{self, Body, Camera, EnvironmentLight, EnvironmentMap, Light, RectLight, Role, Support};

/// Gap between a window and its wall, meters.
const BEFORE_WALL_M: f64 = 0.01;

/// Minimum distance of a window from the edges of its wall, meters.
const MARGIN_M: f64 = 0.1;

/// Number of places along a wall that are compared.
const PLACES: usize = 16;

/// Bodies up to this far from a wall hide the windows in it, meters.
const HIDES_WITHIN_M: f64 = 0.8;

/// A blind reaches this far beyond its window, meters.
const OVERHANG_M: f64 = 0.04;

/// A window behind a curtain down to the floor ends at this height, meters.
const SILL_M: f64 = 0.15;

/// Illuminance on the inside of a window's frame, relative to that at the support: a figure for rooms with light walls.
const FRAME_ILLUMINANCE: f64 = 0.35;

/// Reflectance of frames, linear Rec. 709: white paint, pine, oak, anthracite.
const FRAMES: [[f64; 3]; 4] = [[0.75, 0.74, 0.71], [0.45, 0.29, 0.14], [0.2, 0.11, 0.05], [0.05, 0.05, 0.055]];

/// Maximum fraction of a window's shorter side, or of a pane, that frame and bars cover.
const MAX_FRAME: f64 = 0.2;

/// Number of cells along each side of a window for the sum over its view.
const CELLS: f64 = 48.0;

/// Daylight through windows in a row, just in front of a wall of the room.
///
/// All windows of a view have the same size. With `pattern = "view"`, they have a frame with glazing bars and a view
/// behind them, as from a house: sky, houses, trees, ground. The view is far away, so it moves with the viewer, and the
/// sky lights the floor more than the ceiling. `brightness.illuminance_lx` is the illuminance of all windows together
/// at the center of the support, such as the tabletop, on a horizontal plane, whatever their pattern. Where a wall is
/// too short or too low, windows are fewer or smaller. Of 16 places along a wall, windows get the first at which no furniture hides
/// them, or else the one at which it hides the least. Windows of `behind` are behind bodies, such as blinds.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct WindowLight {
    /// Whether windows are sampled per `view` or once per `scene`.
    per: Per,
    /// Name of the support that the windows are around. If left out, it is the first that a step of `[[place]]` sets.
    #[serde(skip_serializing_if = "Option::is_none")]
    support: Option<SupportName>,
    /// Number of walls with windows, from 0 to 4, chosen at random. With 0, the scene has no window and needs no room.
    #[schemars(extend("minimum" = WALLS[0], "maximum" = WALLS[1]))]
    walls: IntDist,
    /// Number of windows in a wall, sampled per wall, from 1 to 100.
    #[schemars(extend("minimum" = COUNT[0], "maximum" = COUNT[1]))]
    count: IntDist,
    /// Pools of bodies in front of walls, such as blinds and curtains: a window is behind each of them, and nowhere else. `walls`,
    /// `count`, sizes and places are then not used.
    #[serde(skip_serializing_if = "Option::is_none")]
    behind: Option<ObjectPools>,
    /// Width of a window, meters, from 0.05 to 1000.
    #[schemars(extend("minimum" = SIZE_M[0], "maximum" = SIZE_M[1]))]
    width_m: Dist,
    /// Height of a window, meters, from 0.05 to 1000.
    #[schemars(extend("minimum" = SIZE_M[0], "maximum" = SIZE_M[1]))]
    height_m: Dist,
    /// Height of the lower edge above the floor, meters, from 0 to 1000.
    #[schemars(extend("minimum" = GAP_M[0], "maximum" = GAP_M[1]))]
    sill_m: Dist,
    /// Gap between neighboring windows, meters, from 0 to 1000.
    #[schemars(extend("minimum" = GAP_M[0], "maximum" = GAP_M[1]))]
    spacing_m: Dist,
    /// Pattern of the windows.
    pattern: Pattern,
    /// Pools of environment maps for the view behind windows of `pattern = "view"`, such as photographs of streets,
    /// rotated at random. The maps keep their own colors, and should not show the sun. Without pools, the view is
    /// synthetic.
    #[serde(skip_serializing_if = "Option::is_none")]
    from: Option<EnvironmentPools>,
    /// Maximum edge of a pane, meters, from 0.05 to 1000. Larger windows have several panes side by side and above each
    /// other.
    #[schemars(extend("minimum" = SIZE_M[0], "maximum" = SIZE_M[1]))]
    pane_m: Dist,
    /// Width of the frame, meters, from 0 to 1; at most a fifth of a window's shorter side.
    #[schemars(extend("minimum" = FRAME_M[0], "maximum" = FRAME_M[1]))]
    frame_m: Dist,
    /// Width of the glazing bars between panes, meters, from 0 to 1; at most a fifth of a pane.
    #[schemars(extend("minimum" = FRAME_M[0], "maximum" = FRAME_M[1]))]
    bar_m: Dist,
    /// Color temperature of the daylight, kelvin, from 1000 to 40,000.
    #[schemars(extend("minimum" = TEMPERATURE_K[0], "maximum" = TEMPERATURE_K[1]))]
    temperature_k: Dist,
    /// Brightness: `{ illuminance_lx = 800 }` of all windows together, or `{ luminance_nits = 5000 }` of the sky. Zero
    /// brightness leaves the windows out.
    brightness: WindowBrightness,
}

/// Pattern of windows.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Pattern {
    /// A frame with panes, and behind them a landscape or a map of `from`.
    #[default]
    View,
    /// A frame with panes, and behind them an even sky.
    Panes,
    /// An evenly bright rectangle.
    Plain,
}

/// Limits of `walls`.
const WALLS: [i64; 2] = [0, 4];
/// Limits of `count`.
const COUNT: [i64; 2] = [1, 100];
/// Limits of `width_m` and `height_m`, meters.
const SIZE_M: [f64; 2] = [0.05, 1000.0];
/// Limits of `sill_m` and `spacing_m`, meters.
const GAP_M: [f64; 2] = [0.0, 1000.0];
/// Limits of `frame_m` and `bar_m`, meters.
const FRAME_M: [f64; 2] = [0.0, 1.0];

/// Brightness of windows, as one of two photometric quantities.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum WindowBrightness {
    /// Unoccluded illuminance of all windows together at the center of the support on a horizontal plane, lux, from 0
    /// to 10⁷.
    IlluminanceLx(#[schemars(extend("minimum" = ILLUMINANCE_LX[0], "maximum" = ILLUMINANCE_LX[1]))] Dist),
    /// Luminance of the sky in the windows, nits (cd/m²), from 0 to 10¹⁰. For a view, the luminance of an even sky with
    /// the same illuminance on open ground.
    LuminanceNits(#[schemars(extend("minimum" = LUMINANCE_NITS[0], "maximum" = LUMINANCE_NITS[1]))] Dist),
}

impl Default for WindowLight {
    fn default() -> Self {
        Self {
            per: Per::default(),
            support: None,
            walls: IntDist::Constant(1),
            count: IntDist::Integers(1, 3),
            behind: None,
            width_m: Dist::Uniform(0.8, 2.0),
            height_m: Dist::Uniform(1.0, 1.6),
            sill_m: Dist::Uniform(0.7, 1.0),
            spacing_m: Dist::Uniform(0.3, 1.0),
            pattern: Pattern::default(),
            from: None,
            pane_m: Dist::Uniform(0.5, 1.3),
            frame_m: Dist::Uniform(0.04, 0.09),
            bar_m: Dist::Uniform(0.02, 0.06),
            temperature_k: Dist::Uniform(5000.0, 7500.0),
            brightness: WindowBrightness::IlluminanceLx(Dist::LogUniform(200.0, 3000.0)),
        }
    }
}

impl Config for WindowLight {
    type Stage = dyn LightSampler;
    const KIND: &'static str = "window_light";
    const EXAMPLE: &'static str = "walls = 1\ncount = { integers = [1, 3] }\n\
        temperature_k = { uniform = [5000, 7500] }\n\
        brightness = { illuminance_lx = { log_uniform = [200, 3000] } }";
    const RENAMED: &'static [(&'static str, &'static str)] =
        &[("illuminance_lx", "brightness.illuminance_lx"), ("luminance_nits", "brightness.luminance_nits")];

    fn build(self) -> Result<Box<dyn LightSampler>, ConfigError> {
        self.walls.within("walls", WALLS[0], WALLS[1])?;
        self.count.within("count", COUNT[0], COUNT[1])?;
        self.width_m.within("width_m", SIZE_M[0], SIZE_M[1])?;
        self.height_m.within("height_m", SIZE_M[0], SIZE_M[1])?;
        self.sill_m.within("sill_m", GAP_M[0], GAP_M[1])?;
        self.spacing_m.within("spacing_m", GAP_M[0], GAP_M[1])?;
        self.pane_m.within("pane_m", SIZE_M[0], SIZE_M[1])?;
        self.frame_m.within("frame_m", FRAME_M[0], FRAME_M[1])?;
        self.bar_m.within("bar_m", FRAME_M[0], FRAME_M[1])?;
        if self.from.is_some() && self.pattern != Pattern::View {
            let message = "`from` is the view behind windows of `pattern = \"view\"`, and they have another pattern";
            return Err(ConfigError::new("from", message));
        }
        check_temperature("temperature_k", &self.temperature_k)?;
        match &self.brightness {
            WindowBrightness::IlluminanceLx(lux) => {
                lux.within("brightness.illuminance_lx", ILLUMINANCE_LX[0], ILLUMINANCE_LX[1])?;
            }
            WindowBrightness::LuminanceNits(nits) => {
                nits.within("brightness.luminance_nits", LUMINANCE_NITS[0], LUMINANCE_NITS[1])?;
            }
        }
        Ok(Box::new(self))
    }
}
register!(WindowLight);

impl LightSampler for WindowLight {
    fn once_per_scene(&self) -> bool {
        self.per == Per::Scene
    }

    fn needs(&self) -> Option<Part> {
        let (WindowBrightness::IlluminanceLx(brightness) | WindowBrightness::LuminanceNits(brightness)) =
            &self.brightness;
        let shines = brightness.range().1 > 0.0;
        (shines && (self.behind.is_some() || self.walls.range().1 > 0)).then_some(Part::Walls)
    }

    fn lights(&self, scene: &Scene, _: &Camera, _: &Shell, context: &Context) -> Result<Vec<Light>> {
        let stream = &context.stream;
        let draw = |name: &str, dist: &Dist| dist.draw(&mut stream.child(name));
        let wanted = self.walls.draw(&mut stream.child("walls")).max(0) as usize;
        let (lux, nits) = match &self.brightness {
            WindowBrightness::IlluminanceLx(lux) => (draw("brightness", lux), None),
            WindowBrightness::LuminanceNits(nits) => (0.0, Some(draw("brightness", nits))),
        };
        if (wanted == 0 && self.behind.is_none()) || nits.unwrap_or(lux) <= 0.0 {
            return Ok(Vec::new());
        }
        let support = scene.support(self.support.as_ref())?;
        let mut walls = Wall::all(&scene.room_around(&support.center()));
        if walls.is_empty() {
            return Err(no_wall(scene, support));
        }
        let fittings = fittings(scene);
        let mut windows = Vec::new();
        if let Some(pools) = &self.behind {
            let names: Vec<&str> = pools.names().iter().map(|name| context.assets.pool_name(name)).collect();
            let hung = fittings.iter().filter(|(pool, _)| names.contains(&pool.as_str()));
            windows.extend(hung.filter_map(|(_, bounds)| window_behind(bounds, &walls)));
            if windows.is_empty() {
                return Ok(Vec::new());
            }
        } else {
            stream.child("which").shuffle(&mut walls);
            walls.truncate(wanted);
            let size = [draw("width", &self.width_m), draw("height", &self.height_m)];
            let (sill, spacing) = (draw("sill", &self.sill_m), draw("spacing", &self.spacing_m));
            for (i, wall) in walls.iter().enumerate() {
                let stream = stream.child("wall").at(i as u64);
                let count = self.count.draw(&mut stream.child("count")).max(1) as usize;
                let mut places = stream.child("place");
                windows.extend(wall.free_windows((count, size, sill, spacing), &fittings, &mut places));
            }
        }
        let lit = support.center();
        let per_nit: f64 = windows.iter().map(|window| polygon_illuminance(&window.corners(), lit, Vector3::z())).sum();
        if nits.is_none() && per_nit <= 0.0 {
            let message = format!("no window reaches above the {} at {:.2} m", support.name, lit.z);
            return Err(Error::unlucky(message).help("make `sill_m` or `height_m` larger"));
        }
        let color = blackbody(draw("temperature", &self.temperature_k));
        if self.pattern == Pattern::Plain {
            let luminance = nits.unwrap_or(lux / per_nit);
            let radiance = color.map(|channel| channel * luminance);
            return Ok(windows.into_iter().map(|window| Light::Rect(RectLight { radiance, ..window })).collect());
        }
        let view = self.view(color, context)?;
        let mut windows: Vec<_> = windows.iter().map(|window| self.glazed(window, &view, context)).collect();
        // Per unit of the view's scale, and per nit of the frames.
        let through: f64 = windows.iter().map(|window| illuminance_of_panes(window, lit)).sum();
        let panes = windows.iter().flat_map(scene::WindowLight::glass);
        let glass: f64 = panes.map(|pane| polygon_illuminance(&pane.corners(), lit, Vector3::z())).sum();
        if nits.is_none() && through <= 0.0 {
            let message = format!("the view `{}` is dark above the horizon", view.map.name);
            return Err(Error::unlucky(message).help("remove it from its pool, or leave `from` out"));
        }
        // Frames reflect a part of the illuminance E: E = scale · through + of_frames · E.
        let reflectance = stream.child("frame").pick(&FRAMES).copied().unwrap_or(FRAMES[0]);
        let frame = reflectance.map(|channel| channel * FRAME_ILLUMINANCE / PI);
        let of_frames = luminance(frame) * (per_nit - glass).max(0.0);
        let scale = nits.unwrap_or(lux * (1.0 - of_frames) / through);
        let lux = scale * through / (1.0 - of_frames);
        for window in &mut windows {
            window.view.scale = view.scale.map(|channel| channel * scale);
            window.frame_radiance = frame.map(|channel| channel * lux);
        }
        Ok(windows.into_iter().map(Light::Window).collect())
    }
}

impl WindowLight {
    /// The view behind the windows, scaled to an illuminance of π on open ground.
    fn view(&self, color: [f64; 3], context: &Context) -> Result<EnvironmentLight> {
        let stream = context.stream.child("view");
        let (map, color, rotation) = match (self.pattern, &self.from) {
            (Pattern::View, Some(pools)) => {
                let (_, map) = context.assets.draw_environment(pools, &mut stream.child("asset"))?;
                (map, [1.0; 3], stream.child("rotation").uniform(0.0, TAU))
            }
            (Pattern::View, None) => (Arc::new(landscape(&stream)?), color, stream.child("rotation").uniform(0.0, TAU)),
            _ => (Arc::new(EnvironmentMap::constant([1.0; 3])), color, 0.0),
        };
        let open = luminance(level_irradiance(&map)) / PI;
        if open <= 0.0 {
            let message = format!("the environment map `{}` has no light above the horizon", map.name);
            return Err(Error::unlucky(message).help("remove it from its pool, or leave `from` out"));
        }
        Ok(EnvironmentLight { map, scale: color.map(|channel| channel / open), rotation })
    }

    /// A window with frame and panes; the frame is black.
    fn glazed(&self, window: &RectLight, view: &EnvironmentLight, context: &Context) -> scene::WindowLight {
        let draw = |name: &str, dist: &Dist| dist.draw(&mut context.stream.child(name));
        let size = [2.0 * window.half_u.norm(), 2.0 * window.half_v.norm()];
        let pane_m = draw("pane", &self.pane_m);
        let panes = size.map(|edge| ((edge / pane_m).ceil() as u32).clamp(1, 1000));
        let frame_m = draw("frame_width", &self.frame_m).min(MAX_FRAME * size[0].min(size[1]));
        let pane = (size[0] / f64::from(panes[0])).min(size[1] / f64::from(panes[1]));
        scene::WindowLight {
            center: window.center,
            half_u: window.half_u,
            half_v: window.half_v,
            view: view.clone(),
            panes,
            frame_m,
            bar_m: draw("bar_width", &self.bar_m).min(MAX_FRAME * pane),
            frame_radiance: [0.0; 3],
        }
    }
}

/// Illuminance of a window's panes at a point on a horizontal plane: a sum over cells, each by Lambert's formula with
/// the view's luminance in the direction of the cell's center.
fn illuminance_of_panes(window: &scene::WindowLight, point: Point3<f64>) -> f64 {
    let mut sum = 0.0;
    for pane in window.glass() {
        let count = |pane: f64, window: f64| (CELLS * pane / window).ceil().max(1.0) as u32;
        let columns = count(pane.half_u.norm(), window.half_u.norm());
        let rows = count(pane.half_v.norm(), window.half_v.norm());
        let (half_u, half_v) = (pane.half_u / f64::from(columns), pane.half_v / f64::from(rows));
        for row in 0..rows {
            for column in 0..columns {
                let [x, y] = [(column, columns), (row, rows)].map(|(i, n)| 2.0 * f64::from(i) + 1.0 - f64::from(n));
                let center = pane.center + half_u * x + half_v * y;
                let cell = RectLight { center, half_u, half_v, radiance: [0.0; 3] };
                let form_factor = polygon_illuminance(&cell.corners(), point, Vector3::z());
                if form_factor > 0.0 {
                    sum += form_factor * luminance(window.view.radiance(&(center - point).normalize()));
                }
            }
        }
    }
    sum
}

/// The bodies that may be in front of a wall: their pools, and their bounds in the world.
fn fittings(scene: &Scene) -> Vec<(String, Aabb)> {
    let still = scene.bodies().iter().filter(|body| body.role != Role::Room && body.role != Role::Object);
    still.map(|body| (body.asset.pool.clone(), body.world_bounds())).collect()
}

/// The window behind a body, in the nearest of some walls; none if a body is smaller than the edges of a window.
fn window_behind(bounds: &Aabb, walls: &[Wall]) -> Option<RectLight> {
    let depth = |wall: &Wall| (bounds.center() - wall.foot).dot(&wall.inwards).abs();
    let wall = walls.iter().min_by(|a, b| depth(a).total_cmp(&depth(b)))?;
    let center = bounds.center();
    let across = (center - wall.foot).dot(&wall.along);
    let half = bounds.size().dot(&wall.along.abs()) / 2.0 - OVERHANG_M;
    let (low, high) = (bounds.min.z.max(wall.foot.z + SILL_M), bounds.max.z - OVERHANG_M);
    let up = Vector3::z() * ((low + high) / 2.0 - wall.foot.z);
    (half > 0.05 && high - low > 0.1).then(|| RectLight {
        center: wall.foot + wall.along * across + up + wall.inwards * BEFORE_WALL_M,
        half_u: wall.along * half,
        half_v: Vector3::z() * ((high - low) / 2.0),
        radiance: [0.0; 3],
    })
}

/// The error for a support without a wall beside it. Without walls, no other draw of the scene has one either.
fn no_wall(scene: &Scene, support: &Support) -> Error {
    let bounds = |body: &Body| Aabb::of(body.object.mesh.bounds().corners().map(|p| body.world_from_body * p));
    // A floor or ceiling is wider than it is thick; a wall is upright.
    let stands = |part: &Aabb| {
        let size = part.max - part.min;
        size.z > size.x.min(size.y)
    };
    let room = || scene.bodies().iter().filter(|body| body.role == Role::Room).map(bounds);
    let help = "place a room with walls, or use the light `environment` instead of `window_light`";
    let Some(walls) =
        room().filter(stands).reduce(|all, wall| Aabb { min: all.min.inf(&wall.min), max: all.max.sup(&wall.max) })
    else {
        let what = if room().next().is_none() { "the scene has no room" } else { "the room is a floor without walls" };
        return Error::new(format!("the scene has no wall for a window: {what}")).help(help);
    };
    let (name, center) = (&support.name, support.center());
    Error::unlucky(format!(
        "no wall is beside the support `{name}`: its center is at ({:.2}, {:.2}, {:.2}) m, and the walls of the room span \
         ({:.2}, {:.2}, {:.2}) m to ({:.2}, {:.2}, {:.2}) m",
        center.x, center.y, center.z, walls.min.x, walls.min.y, walls.min.z, walls.max.x, walls.max.y, walls.max.z
    ))
    .help("make the table smaller or the room larger, so that the support is inside")
}

/// The inner face of a wall.
struct Wall {
    /// Center of its lower edge.
    foot: Point3<f64>,
    /// Unit normal that points into the room.
    inwards: Vector3<f64>,
    /// Unit vector to the right, seen from inside.
    along: Vector3<f64>,
    length: f64,
    height: f64,
}

impl Wall {
    /// The walls of a room. A side without a wall is assumed 20 m away.
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

    /// The row of windows with the smallest hidden area, out of some rows at random places. Bodies in front hide windows.
    fn free_windows(
        &self,
        (count, size, sill, spacing): (usize, [f64; 2], f64, f64),
        bodies: &[(String, Aabb)],
        stream: &mut Stream,
    ) -> Vec<RectLight> {
        let hidden = |windows: &[RectLight]| -> f64 {
            windows.iter().flat_map(|window| bodies.iter().map(|(_, bounds)| self.overlap(window, bounds))).sum()
        };
        let mut best: Option<(f64, Vec<RectLight>)> = None;
        for _ in 0..PLACES {
            let windows = self.windows(count, size, sill, spacing, stream);
            let area = hidden(&windows);
            if best.as_ref().is_none_or(|(least, _)| area < *least) {
                best = Some((area, windows));
            }
            if area == 0.0 {
                break;
            }
        }
        best.map(|(_, windows)| windows).unwrap_or_default()
    }

    /// Area of a window that a body near the wall hides from the middle of the room, square meters.
    fn overlap(&self, window: &RectLight, bounds: &Aabb) -> f64 {
        let nearest = bounds.corners().into_iter().map(|p| (p - self.foot).dot(&self.inwards));
        if nearest.fold(f64::INFINITY, f64::min) > HIDES_WITHIN_M {
            return 0.0;
        }
        let apart = bounds.center() - window.center;
        let half = bounds.size() / 2.0;
        let shared = |axis: Vector3<f64>, window: f64| {
            let (body, at) = (half.dot(&axis.abs()), apart.dot(&axis));
            ((at + body).min(window) - (at - body).max(-window)).max(0.0)
        };
        shared(self.along, window.half_u.norm()) * shared(Vector3::z(), window.half_v.norm())
    }

    /// A row with the largest possible number of windows, at least one, at a random position along the wall. Their
    /// radiance is zero.
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
                    center: self.foot + self.along * at + up + self.inwards * BEFORE_WALL_M,
                    half_u: self.along * (width / 2.0),
                    half_v: Vector3::z() * (height / 2.0),
                    radiance: [0.0; 3],
                }
            })
            .collect()
    }
}
