//! Lights of a view, checked and converted.

use crate::cache::SceneCache;
use crate::environment::{EnvironmentDistribution, look_up, mean_luminance};
use std::f32::consts::{FRAC_1_PI, PI, TAU};
use std::sync::Arc;
use syntable_model::error::{Error, Result};
use syntable_model::photometry::{level_irradiance, luminance};
use syntable_model::scene::{self, DirectionalLight, EnvironmentLight, EnvironmentMap};
use syntable_simd::functions::{acos, atan2_turns, sin_cos_turns};
use syntable_simd::{Basis, Rgb, Vec3, vec3};

/// Lights of a view, without lights that have no radiance. Emissive bodies are lights too, but belong to the scene.
#[derive(Clone, Debug, Default)]
pub struct LightTable {
    /// Lights with a shape.
    pub area: Vec<AreaLight>,
    /// Lights infinitely far away.
    pub distant: Vec<DistantLight>,
    /// Windows, by the numbers of [`RectLight::window`].
    pub windows: Vec<WindowPattern>,
}

/// Index for a light without a window.
pub const NO_WINDOW: u32 = u32::MAX;

/// A light with a shape, world.
#[derive(Clone, Copy, Debug)]
pub enum AreaLight {
    /// A sphere.
    Sphere(SphereLight),
    /// A one-sided rectangle.
    Rect(RectLight),
    /// A one-sided disk.
    Disk(DiskLight),
}

/// A sphere that emits the same radiance everywhere.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct SphereLight {
    /// World, meters.
    pub center: Vec3,
    /// Meters.
    pub radius: f32,
    /// Nits.
    pub radiance: Rgb,
    /// Luminance of the radiance, nits.
    pub luminance: f32,
}

/// A one-sided rectangle that emits the same radiance everywhere, or has the pattern of a window.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct RectLight {
    /// World, meters.
    pub center: Vec3,
    /// Unit vector along one edge.
    pub x: Vec3,
    /// Unit vector along the other edge.
    pub y: Vec3,
    /// Unit vector out of the emitting side.
    pub normal: Vec3,
    /// Half lengths of the edges along `x` and `y`, meters.
    pub half: [f32; 2],
    /// Nits. For a window, an estimate of the mean, for selecting lights.
    pub radiance: Rgb,
    /// Luminance of the radiance, nits.
    pub luminance: f32,
    /// Index in [`LightTable::windows`], or [`NO_WINDOW`].
    pub window: u32,
}

/// Pattern of a window.
#[derive(Clone, Debug)]
pub struct WindowPattern {
    /// Extents of the panes along the edges x and y of the rectangle, meters from the center. A point is in a pane if
    /// both of its coordinates are in such an extent.
    pub spans: [Vec<[f32; 2]>; 2],
    /// Map behind the panes.
    pub view: PlacedMap,
    /// Radiance elsewhere, nits.
    pub frame_radiance: Rgb,
}

/// A one-sided disk that emits the same radiance everywhere.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct DiskLight {
    /// World, meters.
    pub center: Vec3,
    /// Unit vector out of the emitting side.
    pub normal: Vec3,
    /// Meters.
    pub radius: f32,
    /// Nits.
    pub radiance: Rgb,
    /// Luminance of the radiance, nits.
    pub luminance: f32,
}

/// A light infinitely far away.
#[derive(Clone, Debug)]
pub enum DistantLight {
    /// A round patch of constant radiance, such as the sun.
    Cone(ConeLight),
    /// An environment map.
    Environment(PlacedEnvironment),
}

/// A round patch of the sky of constant radiance.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct ConeLight {
    /// Unit vector towards the center of the patch, world.
    pub axis: Vec3,
    /// Sine of the half angle.
    pub sin: f32,
    /// One minus the cosine of the half angle.
    pub height: f32,
    /// Nits.
    pub radiance: Rgb,
    /// Luminance of the irradiance on a plane that faces the light, lux.
    pub illuminance: f32,
}

/// An environment map, scaled and rotated.
#[derive(Clone, Debug)]
pub struct PlacedMap {
    /// The map.
    pub map: Arc<EnvironmentMap>,
    /// Radiance of a texel of value one, nits.
    pub scale: Rgb,
    /// Sine and cosine of the rotation about world z.
    pub rotation: (f32, f32),
}

/// An environment map that is sampled as a light.
#[derive(Clone, Debug)]
pub struct PlacedEnvironment {
    /// The map in the world.
    pub placed: PlacedMap,
    /// Distribution of the map, for sampling.
    pub distribution: Arc<EnvironmentDistribution>,
    /// Mean luminance over all directions, nits.
    pub luminance: f32,
}

impl LightTable {
    /// Checks and converts lights.
    ///
    /// # Errors
    /// If a light is invalid. The error names its number.
    pub fn new(lights: &[scene::Light], cache: &SceneCache) -> Result<Self> {
        let mut table = Self::default();
        for (number, light) in lights.iter().enumerate() {
            table.add(light, cache).map_err(|error| error.context(format!("light {number}")))?;
        }
        Ok(table)
    }

    fn add(&mut self, light: &scene::Light, cache: &SceneCache) -> Result<()> {
        let radiance = match light {
            scene::Light::Sphere(light) => light.radiance,
            scene::Light::Rect(light) => light.radiance,
            scene::Light::Disk(light) => light.radiance,
            scene::Light::Directional(light) => light.irradiance,
            scene::Light::Environment(light) => light.scale,
            scene::Light::Window(light) => {
                check_radiance(light.frame_radiance)?;
                light.view.scale
            }
        };
        check_radiance(radiance)?;
        let is_black = radiance == [0.0; 3];
        let area = match light {
            scene::Light::Sphere(light) => sphere(light)?,
            scene::Light::Rect(light) => AreaLight::Rect(rect(light)?),
            scene::Light::Disk(light) => disk(light)?,
            scene::Light::Directional(light) => {
                let distant = directional(light)?;
                self.distant.extend((!is_black).then_some(distant));
                return Ok(());
            }
            scene::Light::Environment(light) => {
                let distant = DistantLight::Environment(environment(light, cache)?);
                self.distant.extend((!is_black).then_some(distant));
                return Ok(());
            }
            scene::Light::Window(light) => {
                // A window without a map is black, and still hides the background.
                let (rect, pattern) = window(light, self.windows.len() as u32)?;
                self.windows.push(pattern);
                self.area.push(AreaLight::Rect(rect));
                return Ok(());
            }
        };
        self.area.extend((!is_black).then_some(area));
        Ok(())
    }
}

impl AreaLight {
    /// Emitted radiance, nits.
    #[inline(always)]
    pub fn radiance(&self) -> Rgb {
        match self {
            Self::Sphere(sphere) => sphere.radiance,
            Self::Rect(rect) => rect.radiance,
            Self::Disk(disk) => disk.radiance,
        }
    }
}

impl DistantLight {
    /// Samples a direction. Returns its density per steradian, too.
    #[inline]
    pub fn sample(&self, uv: [f32; 2]) -> (Vec3, f32) {
        match self {
            Self::Cone(cone) => {
                let t = uv[0] * cone.height;
                let sin = (t * (2.0 - t)).max(0.0).sqrt();
                let (s, c) = sin_cos_turns(uv[1]);
                (Basis::around(cone.axis).to_world(vec3(sin * c, sin * s, 1.0 - t)), 1.0 / (TAU * cone.height))
            }
            Self::Environment(environment) => {
                let ([u, v], density) = environment.distribution.sample(uv);
                let (sin_theta, cos_theta) = sin_cos_turns(0.5 * v);
                let (s, c) = sin_cos_turns(0.5 - u);
                let local = vec3(sin_theta * c, sin_theta * s, cos_theta);
                let (sin, cos) = environment.placed.rotation;
                let direction = vec3(cos * local.x - sin * local.y, sin * local.x + cos * local.y, local.z);
                (direction, per_steradian(density, sin_theta))
            }
        }
    }

    /// Radiance from a unit direction, and the density of [`Self::sample`].
    #[inline]
    pub fn radiance(&self, direction: Vec3) -> (Rgb, f32) {
        match self {
            Self::Cone(cone) => {
                let across = cone.axis.cross(direction);
                let hit = direction.dot(cone.axis) > 0.0 && across.dot(across) <= cone.sin * cone.sin;
                if hit { (cone.radiance, 1.0 / (TAU * cone.height)) } else { (Rgb::ZERO, 0.0) }
            }
            Self::Environment(environment) => {
                let uv = environment.placed.coordinates(direction);
                let sin_theta = (1.0 - direction.z * direction.z).max(0.0).sqrt();
                let density = per_steradian(environment.distribution.density(uv), sin_theta);
                (environment.placed.look_up(uv), density)
            }
        }
    }

    /// An upper estimate of the irradiance on a plane with unit normal `n`, unshadowed.
    #[inline]
    pub fn importance(&self, n: Vec3) -> f32 {
        match self {
            Self::Cone(cone) => cone.illuminance * (n.dot(cone.axis) + cone.sin).clamp(0.0, 1.0),
            Self::Environment(environment) => PI * environment.luminance,
        }
    }
}

impl PlacedMap {
    /// Radiance from a unit direction, nits.
    #[inline]
    pub fn radiance(&self, direction: Vec3) -> Rgb {
        self.look_up(self.coordinates(direction))
    }

    /// Radiance at coordinates in the map, nits.
    #[inline]
    fn look_up(&self, uv: [f32; 2]) -> Rgb {
        look_up(&self.map, uv) * self.scale
    }

    /// Coordinates in the map of a unit direction.
    #[inline]
    fn coordinates(&self, direction: Vec3) -> [f32; 2] {
        let (sin, cos) = self.rotation;
        let (x, y) = (cos * direction.x + sin * direction.y, cos * direction.y - sin * direction.x);
        [0.5 - atan2_turns(y, x), acos(direction.z) * FRAC_1_PI]
    }
}

impl WindowPattern {
    /// Radiance at a point of the window `rect` towards a viewer who sees it in a unit direction, nits.
    pub fn radiance(&self, rect: &RectLight, point: Vec3, direction: Vec3) -> Rgb {
        let from_center = point - rect.center;
        let is_inside = |spans: &[[f32; 2]], x: f32| spans.iter().any(|&[low, high]| low <= x && x <= high);
        let [columns, rows] = &self.spans;
        match is_inside(columns, from_center.dot(rect.x)) && is_inside(rows, from_center.dot(rect.y)) {
            true => self.view.radiance(direction),
            false => self.frame_radiance,
        }
    }
}

/// The environment of a view on surfaces that show it by reflecting it
/// ([`Material::projection_height_m`](scene::Material::projection_height_m)).
#[derive(Clone, Debug)]
pub struct ProjectedEnvironment {
    maps: Vec<PlacedMap>,
    /// Albedo per nit of environment.
    per_nit: Rgb,
}

impl ProjectedEnvironment {
    /// The environment maps of a view; `None` without maps, or if distant lights leave a horizontal plane dark.
    ///
    /// With the albedo `ρ = π L / E`, a diffuse surface under the irradiance E of all distant lights has the radiance
    /// L.
    pub fn new(lights: &[scene::Light], table: &LightTable) -> Option<Self> {
        let mut sum = [0.0; 3];
        for light in lights {
            let (factor, irradiance) = match light {
                scene::Light::Environment(light) => (light.scale, level_irradiance(&light.map)),
                scene::Light::Directional(light) => ([light.towards.z.max(0.0); 3], light.irradiance),
                _ => continue,
            };
            for (channel, sum) in sum.iter_mut().enumerate() {
                *sum += factor[channel] * irradiance[channel];
            }
        }
        let maps: Vec<_> = table
            .distant
            .iter()
            .filter_map(|light| match light {
                DistantLight::Environment(environment) => Some(environment.placed.clone()),
                DistantLight::Cone(_) => None,
            })
            .collect();
        // Light of low color temperature may have no blue.
        let is_lit = sum.iter().any(|&e| e > 1e-12);
        let per_nit = color(sum.map(|e| if e > 1e-12 { std::f64::consts::PI / e } else { 0.0 }));
        (is_lit && !maps.is_empty()).then_some(Self { maps, per_nit })
    }

    /// The maps.
    pub fn maps(&self) -> &[PlacedMap] {
        &self.maps
    }

    /// Albedo per nit of the maps' radiance.
    pub fn per_nit(&self) -> Rgb {
        self.per_nit
    }

    /// Albedo of a point, seen from a height above the world's origin, meters.
    #[inline(never)]
    pub fn albedo(&self, height: f32, point: Vec3) -> Rgb {
        let direction = (point - vec3(0.0, 0.0, height)).normalized_or(vec3(0.0, 0.0, -1.0));
        let radiance = self.maps.iter().fold(Rgb::ZERO, |sum, map| sum + map.radiance(direction));
        (radiance * self.per_nit).map(|albedo| albedo.clamp(0.0, 1.0))
    }
}

/// Converts a density over the unit square of a map to one per steradian: dω = 2π² sin θ du dv.
#[inline]
fn per_steradian(density: f32, sin_theta: f32) -> f32 {
    density / (TAU * PI * sin_theta.max(1e-6))
}

fn sphere(light: &scene::SphereLight) -> Result<AreaLight> {
    if !(light.radius > 0.0 && light.radius.is_finite() && finite(light.center.coords.as_ref())) {
        return Err(Error::new(format!("a sphere at {} of radius {} m", light.center, light.radius))
            .help("give it a finite center and a radius above 0"));
    }
    let radiance = color(light.radiance);
    let center = vector(light.center.coords.as_ref());
    Ok(AreaLight::Sphere(SphereLight {
        center,
        radius: light.radius as f32,
        radiance,
        luminance: radiance.luminance(),
    }))
}

fn check_radiance(radiance: [f64; 3]) -> Result<()> {
    if radiance.iter().all(|&x| x >= 0.0 && (x as f32).is_finite()) {
        return Ok(());
    }
    Err(Error::new(format!("a radiance of {radiance:?} nits")).help("give it a finite, non-negative radiance"))
}

fn window(light: &scene::WindowLight, number: u32) -> Result<(RectLight, WindowPattern)> {
    let widths = [light.frame_m, light.bar_m];
    if !widths.iter().all(|width| (0.0..f64::INFINITY).contains(width)) || light.panes.iter().any(|&n| n > 1000) {
        let message = format!("a window of {:?} panes, frame and bars of {widths:?} m", light.panes);
        return Err(Error::new(message).help("give it at most 1000 panes per side, and non-negative widths"));
    }
    let mut rect = rect(&light.rect([0.0; 3]))?;
    let spans = [0, 1].map(|axis| light.spans(axis).iter().map(|span| span.map(|x| x as f32)).collect::<Vec<_>>());
    let view = placed(&light.view)?;
    let frame_radiance = color(light.frame_radiance);
    let glass: f32 = spans.iter().zip(rect.half).map(|(spans, half)| covered(spans) / (2.0 * half)).product();
    rect.radiance = view.scale * (mean_luminance(&view.map) * glass) + frame_radiance * (1.0 - glass);
    rect.luminance = rect.radiance.luminance();
    rect.window = number;
    Ok((rect, WindowPattern { spans, view, frame_radiance }))
}

/// Total length of the spans.
fn covered(spans: &[[f32; 2]]) -> f32 {
    spans.iter().map(|[low, high]| high - low).sum()
}

fn rect(light: &scene::RectLight) -> Result<RectLight> {
    let (u, v) = (light.half_u.norm(), light.half_v.norm());
    let upright = light.half_u.dot(&light.half_v).abs() <= 1e-4 * u * v;
    if !(u > 0.0 && v > 0.0 && upright && (u + v).is_finite() && finite(light.center.coords.as_ref())) {
        return Err(Error::new(format!("a rectangle with half edges {:?} and {:?}", light.half_u, light.half_v))
            .help("give it two edges at right angles, neither of length 0"));
    }
    let radiance = color(light.radiance);
    Ok(RectLight {
        center: vector(light.center.coords.as_ref()),
        x: vector((light.half_u / u).as_ref()),
        y: vector((light.half_v / v).as_ref()),
        normal: vector(light.normal().as_ref()),
        half: [u as f32, v as f32],
        radiance,
        luminance: radiance.luminance(),
        window: NO_WINDOW,
    })
}

fn disk(light: &scene::DiskLight) -> Result<AreaLight> {
    let length = light.normal.norm();
    let sound = light.radius > 0.0 && light.radius.is_finite() && finite(light.center.coords.as_ref());
    if !(sound && is_unit(length)) {
        return Err(Error::new(format!(
            "a disk at {} of radius {} m and normal {:?}",
            light.center, light.radius, light.normal
        ))
        .help("give it a finite center, a radius above 0 and a normal of length 1"));
    }
    let radiance = color(light.radiance);
    Ok(AreaLight::Disk(DiskLight {
        center: vector(light.center.coords.as_ref()),
        normal: vector((light.normal / length).as_ref()),
        radius: light.radius as f32,
        radiance,
        luminance: radiance.luminance(),
    }))
}

fn directional(light: &DirectionalLight) -> Result<DistantLight> {
    let length = light.towards.norm();
    if !(is_unit(length) && (1e-5..=1.5).contains(&light.half_angle)) {
        return Err(Error::new(format!(
            "a distant light towards {:?} of half angle {}",
            light.towards, light.half_angle
        ))
        .help("give it a direction of length 1 and a half angle from 0.00001 to 1.5 radians"));
    }
    let half = libm::sin(0.5 * light.half_angle);
    Ok(DistantLight::Cone(ConeLight {
        axis: vector((light.towards / length).as_ref()),
        sin: libm::sin(light.half_angle) as f32,
        height: (2.0 * half * half) as f32,
        radiance: color(light.radiance()),
        illuminance: luminance(light.irradiance) as f32,
    }))
}

fn environment(light: &EnvironmentLight, cache: &SceneCache) -> Result<PlacedEnvironment> {
    let placed = placed(light)?;
    let distribution = cache.environment(&light.map);
    Ok(PlacedEnvironment { luminance: distribution.luminance * placed.scale.luminance(), placed, distribution })
}

fn placed(light: &EnvironmentLight) -> Result<PlacedMap> {
    if !light.rotation.is_finite() {
        return Err(Error::new(format!("an environment rotated by {}", light.rotation)).help("give it a finite angle"));
    }
    let turns = light.rotation / std::f64::consts::TAU;
    Ok(PlacedMap {
        map: light.map.clone(),
        scale: color(light.scale),
        rotation: sin_cos_turns((turns - turns.floor()) as f32),
    })
}

fn is_unit(length: f64) -> bool {
    (0.99..1.01).contains(&length)
}

fn finite(x: &[f64; 3]) -> bool {
    x.iter().all(|&x| (x as f32).is_finite())
}

fn vector(x: &[f64; 3]) -> Vec3 {
    Vec3::from(x.map(|x| x as f32))
}

fn color(x: [f64; 3]) -> Rgb {
    Rgb::from(x.map(|x| x as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::geometry::{Point3, Vector3};

    #[test]
    fn a_cone_has_the_density_of_its_solid_angle_and_the_irradiance_of_the_light() {
        let half_angle = 0.3_f64;
        let towards = Vector3::new(0.6, 0.0, 0.8);
        let sun = scene::Light::Directional(DirectionalLight { towards, half_angle, irradiance: [100.0; 3] });
        let table = LightTable::new(&[sun], &SceneCache::default()).expect("sound");
        let solid_angle = std::f64::consts::TAU * (1.0 - half_angle.cos());
        let axis = vec3(0.6, 0.0, 0.8);
        let (radiance, density) = table.distant[0].radiance(axis);
        assert!((f64::from(density) * solid_angle - 1.0).abs() < 1e-5);
        // E = π L sin² a.
        let irradiance = std::f64::consts::PI * half_angle.sin().powi(2) * f64::from(radiance.x);
        assert!((irradiance - 100.0).abs() < 1e-3, "{irradiance}");
        for i in 0..100 {
            let (direction, sampled) = table.distant[0].sample([i as f32 / 100.0, (i * 37 % 100) as f32 / 100.0]);
            assert!(sampled == density && f64::from(direction.dot(axis)) > half_angle.cos() - 1e-5);
        }
    }

    #[test]
    fn an_environment_is_rotated_about_z_counter_clockwise() {
        // The center column looks along +x, where the second of four columns ends.
        let texels = (0..8).map(|i| if i % 4 == 1 { [8.0; 3] } else { [0.0; 3] }).collect();
        let map = Arc::new(EnvironmentMap::new("test", 4, 2, texels).expect("sound"));
        let toward = |turns: f64| {
            let (sin, cos) = (turns * std::f64::consts::TAU).sin_cos();
            vec3(cos as f32, sin as f32, 0.0)
        };
        // Seen from above, columns advance clockwise: the middle of the second is at an eighth of a turn.
        for rotation in [0.0, 0.25, 0.6] {
            let light =
                EnvironmentLight { map: map.clone(), scale: [2.0; 3], rotation: rotation * std::f64::consts::TAU };
            let table = LightTable::new(&[scene::Light::Environment(light)], &SceneCache::default()).expect("sound");
            let bright = table.distant[0].radiance(toward(0.125 + rotation)).0;
            let dark = table.distant[0].radiance(toward(0.625 + rotation)).0;
            assert!((bright.x - 16.0).abs() < 1e-2 && dark.x.abs() < 1e-2, "{rotation}: {bright:?} {dark:?}");
        }
    }

    #[test]
    fn unsound_lights_are_named_and_black_ones_left_out() {
        let center = Point3::origin();
        let sphere =
            |radius, nits: f64| scene::Light::Sphere(scene::SphereLight { center, radius, radiance: [nits; 3] });
        let cache = SceneCache::default();
        let table = LightTable::new(&[sphere(1.0, 0.0), sphere(2.0, 3.0)], &cache).expect("sound");
        assert_eq!(table.area.len(), 1);
        assert_eq!(table.area[0].radiance(), Rgb::ONE * 3.0);
        for (light, want) in [(sphere(0.0, 1.0), "radius 0 m"), (sphere(1.0, -1.0), "non-negative")] {
            let error = LightTable::new(&[sphere(1.0, 1.0), light], &cache).expect_err(want).to_string();
            assert!(error.contains("light 1") && error.contains(want), "{error}");
        }
    }
}
