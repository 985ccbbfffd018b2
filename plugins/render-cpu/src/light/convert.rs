//! From the model's lights to those of the renderer, checked.

use super::distant::{Cone, Distant, PlacedSky};
use super::{Disk, Lights, Rect, Shape, Sphere};
use crate::approx::sin_cos_turns;
use crate::cache::SceneCache;
use crate::vec3::{Rgb, Vec3};
use crate::world::World;
use syntable_model::error::{Error, Result};
use syntable_model::photometry::luminance;
use syntable_model::scene::{self, DirectionalLight, DiskLight, EnvironmentLight, RectLight, SphereLight};

impl<'a> Lights<'a> {
    /// Checks and converts; lights without radiance are left out. Bodies of the world that glow are lights too.
    pub fn new(lights: &[scene::Light], world: &'a World, cache: &SceneCache) -> Result<Self> {
        let mut made = Self { emitters: world.emitters(), world: Some(world), ..Self::default() };
        made.add(lights, cache)?;
        Ok(made)
    }

    /// Lights of no world.
    #[cfg(test)]
    pub fn alone(lights: &[scene::Light]) -> Result<Self> {
        let mut made = Self::default();
        made.add(lights, &SceneCache::new())?;
        Ok(made)
    }

    fn add(&mut self, lights: &[scene::Light], cache: &SceneCache) -> Result<()> {
        for (number, light) in lights.iter().enumerate() {
            let radiance = match light {
                scene::Light::Sphere(light) => light.radiance,
                scene::Light::Rect(light) => light.radiance,
                scene::Light::Disk(light) => light.radiance,
                scene::Light::Directional(light) => light.irradiance,
                scene::Light::Environment(light) => light.scale,
            };
            let name = |error: Error| error.context(format!("light {number}"));
            if !radiance.iter().all(|&x| x >= 0.0 && (x as f32).is_finite()) {
                return Err(name(
                    Error::new(format!("a radiance of {radiance:?} nits")).help("radiance is finite and not negative"),
                ));
            }
            let added = match light {
                scene::Light::Sphere(light) => sphere(light).map(|shape| self.shapes.push(shape)),
                scene::Light::Rect(light) => rect(light).map(|shape| self.shapes.push(shape)),
                scene::Light::Disk(light) => disk(light).map(|shape| self.shapes.push(shape)),
                scene::Light::Directional(light) => directional(light).map(|distant| self.distant.push(distant)),
                scene::Light::Environment(light) => environment(light, cache).map(|distant| self.distant.push(distant)),
            };
            added.map_err(name)?;
            if radiance == [0.0; 3] {
                match light {
                    scene::Light::Directional(_) | scene::Light::Environment(_) => drop(self.distant.pop()),
                    _ => drop(self.shapes.pop()),
                }
            }
        }
        Ok(())
    }
}

fn sphere(light: &SphereLight) -> Result<Shape> {
    if !(light.radius > 0.0 && light.radius.is_finite() && finite(light.centre.coords.as_ref())) {
        return Err(Error::new(format!("a sphere at {} of radius {} m", light.centre, light.radius))
            .help("give it a finite place and a radius above 0"));
    }
    let radiance = color(light.radiance);
    let centre = vector(light.centre.coords.as_ref());
    Ok(Shape::Sphere(Sphere { centre, radius: light.radius as f32, radiance, luminance: radiance.luminance() }))
}

fn rect(light: &RectLight) -> Result<Shape> {
    let (u, v) = (light.half_u.norm(), light.half_v.norm());
    let upright = light.half_u.dot(&light.half_v).abs() <= 1e-4 * u * v;
    if !(u > 0.0 && v > 0.0 && upright && (u + v).is_finite() && finite(light.centre.coords.as_ref())) {
        return Err(Error::new(format!("a rectangle with half edges {:?} and {:?}", light.half_u, light.half_v))
            .help("give it two edges at right angles, neither of length 0"));
    }
    let radiance = color(light.radiance);
    Ok(Shape::Rect(Rect {
        centre: vector(light.centre.coords.as_ref()),
        x: vector((light.half_u / u).as_ref()),
        y: vector((light.half_v / v).as_ref()),
        normal: vector(light.normal().as_ref()),
        half: [u as f32, v as f32],
        radiance,
        luminance: radiance.luminance(),
    }))
}

fn disk(light: &DiskLight) -> Result<Shape> {
    let length = light.normal.norm();
    let sound = light.radius > 0.0 && light.radius.is_finite() && finite(light.centre.coords.as_ref());
    if !(sound && is_unit(length)) {
        return Err(Error::new(format!(
            "a disk at {} of radius {} m and normal {:?}",
            light.centre, light.radius, light.normal
        ))
        .help("give it a finite place, a radius above 0 and a normal of length 1"));
    }
    let radiance = color(light.radiance);
    Ok(Shape::Disk(Disk {
        centre: vector(light.centre.coords.as_ref()),
        normal: vector((light.normal / length).as_ref()),
        radius: light.radius as f32,
        radiance,
        luminance: radiance.luminance(),
    }))
}

fn directional(light: &DirectionalLight) -> Result<Distant> {
    let length = light.towards.norm();
    if !(is_unit(length) && (1e-5..=1.5).contains(&light.half_angle)) {
        return Err(Error::new(format!(
            "a distant light towards {:?} of half angle {}",
            light.towards, light.half_angle
        ))
        .help("give it a direction of length 1 and half an angle of 0.00001 to 1.5 radians"));
    }
    let half = (0.5 * light.half_angle).sin();
    Ok(Distant::Cone(Cone {
        axis: vector((light.towards / length).as_ref()),
        sin: light.half_angle.sin() as f32,
        height: (2.0 * half * half) as f32,
        radiance: color(light.radiance()),
        illuminance: luminance(light.irradiance) as f32,
    }))
}

fn environment(light: &EnvironmentLight, cache: &SceneCache) -> Result<Distant> {
    if !light.rotation.is_finite() {
        return Err(Error::new(format!("an environment turned by {}", light.rotation)).help("give a finite angle"));
    }
    let sky = cache.sky(&light.map);
    let turns = light.rotation / std::f64::consts::TAU;
    let scale = color(light.scale);
    Ok(Distant::Sky(PlacedSky {
        luminance: sky.luminance * scale.luminance(),
        sky,
        scale,
        turn: sin_cos_turns((turns - turns.floor()) as f32),
    }))
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
