//! Surfaces that show the environment.

use super::support::*;
use std::f64::consts::PI;
use std::sync::Arc;
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::photometry::{level_irradiance, polygon_illuminance};
use syntable_model::prelude::*;
use syntable_model::product::standard::{ALBEDO, RADIANCE};
use syntable_model::scene::{
    BodyDraft, DirectionalLight, EnvironmentLight, EnvironmentMap, Light, Material, Object, RectLight, Role,
};

/// Height of the projection, meters.
const HEIGHT: f64 = 1.5;

fn ground() -> BodyDraft {
    let material = Material { projection_height_m: Some(HEIGHT as f32), ..matte(0.25) };
    // Beyond the edge of the ground, rays meet the environment that it shows.
    body(&object("ground", sheet([4.0, 4.0]), material.with_digest()), at(0.0, 0.0, 0.0), Role::Room)
}

/// An object outside the view.
fn hidden() -> Arc<Object> {
    object("hidden", cuboid([0.1, 0.1, 0.1]), matte(0.0))
}

fn environment(map: EnvironmentMap, scale: [f64; 3]) -> Light {
    Light::Environment(EnvironmentLight { map: Arc::new(map), scale, rotation: 0.8 })
}

/// A sky that is brighter to one side, over darker ground of several colors.
fn landscape() -> EnvironmentMap {
    let texel = |i: u32| {
        let turn = f64::from(i % 64) / 64.0 * 2.0 * PI;
        match i / 64 {
            row @ 16.. => {
                let row = f64::from(row) / 32.0;
                [0.15 + 0.1 * turn.sin(), 0.2 * row, 0.1 + 0.05 * (2.0 * turn).cos()].map(|x| x as f32)
            }
            _ => [1.0 + 0.8 * turn.cos(), 1.0, 1.2].map(|x| x as f32),
        }
    };
    EnvironmentMap::new("landscape", 64, 32, (0..64 * 32).map(texel).collect()).expect("sound")
}

#[test]
fn the_ground_looks_like_the_environment_without_it() {
    let sun = DirectionalLight { towards: Vector3::new(0.6, 0.0, 0.8), half_angle: 0.02, irradiance: [1.5; 3] };
    for lights in [
        vec![environment(EnvironmentMap::constant([0.7; 3]), [2.0, 1.0, 0.0])],
        vec![environment(landscape(), [100.0, 90.0, 80.0])],
        // The light of a sun counts: the ground's color is darker, and its radiance the same.
        vec![environment(landscape(), [1.0; 3]), Light::Directional(sun)],
    ] {
        let hidden = body(&hidden(), at(0.0, 0.0, -5.0), Role::Object);
        let (with, without) = (scene([hidden.clone(), ground()]), scene([hidden]));
        // From the point of the projection, every pixel equals the pixel of the environment.
        let view = view(24, 16, 14.0, [0.0, 0.0, HEIGHT], [1.0, 0.7, 0.3], lights.clone());
        let images = [&with, &without].map(|scene| render(options(1024, 4), scene, &view, &LIGHT));
        let [with, without] = images.each_ref().map(|frame| frame.get(RADIANCE).expect("made"));
        let keep = || keep("ground", &[("with", with), ("without", without)]);
        for (k, (with, without)) in with.data().iter().zip(without.data()).enumerate() {
            for channel in 0..3 {
                let (got, want) = (with[channel], without[channel]);
                assert!((got - want).abs() <= 0.02 * want, "pixel {k}: {with:?}, not {without:?}; {}", keep());
            }
        }
        let mean = |plane: &Plane<[f32; 3]>| plane.data().iter().flatten().map(|&x| f64::from(x)).sum::<f64>();
        assert!((mean(with) / mean(without) - 1.0).abs() < 2e-3, "{}", keep());
    }
}

#[test]
fn what_is_above_the_ground_casts_its_shadow() {
    // A black sheet over the origin hides a fraction of the light that Lambert's formula gives.
    for (half, height) in [(0.5_f64, 0.8), (2.0, 1.0)] {
        let roof = object("roof", sheet([half as f32; 2]), matte(0.0));
        let scene = scene([body(&roof, at(0.0, 0.0, height), Role::Object), ground()]);
        let mut texels = vec![[3.0; 3]; 64 * 32];
        texels[64 * 16..].fill([0.6; 3]);
        let map = EnvironmentMap::new("two", 64, 32, texels).expect("sound");
        // Steeply from the side, under the roof.
        let view = view(4, 4, 3000.0, [half + 0.6, 0.0, 0.3], [0.0; 3], vec![environment(map, [1.0; 3])]);
        let corners = RectLight {
            center: Point3::new(0.0, 0.0, height),
            half_u: Vector3::new(half, 0.0, 0.0),
            half_v: Vector3::new(0.0, half, 0.0),
            radiance: [0.0; 3],
        }
        .corners();
        let hidden = polygon_illuminance(&corners, Point3::origin(), Vector3::z()) / PI;
        let frame = render(options(1024, 4), &scene, &view, &LIGHT);
        let data = frame.get(RADIANCE).expect("made").data();
        let got = data.iter().map(|pixel| f64::from(pixel[1])).sum::<f64>() / data.len() as f64;
        let want = 0.6 * (1.0 - hidden);
        assert!((got - want).abs() < 0.01 * want, "{got}, not {want}: {hidden} is hidden");
    }
}

#[test]
fn the_albedo_of_the_ground_matches_its_view() {
    let scene = scene([body(&hidden(), at(0.0, 0.0, -5.0), Role::Object), ground()]);
    let albedo = |lights: Vec<Light>| {
        let view = view(1, 1, 100.0, [0.5, 0.5, 2.0], [0.5, 0.2, 0.0], lights);
        render(options(1, 1), &scene, &view, &[ALBEDO.id()]).get(ALBEDO).expect("made").data()[0]
    };
    let map = landscape();
    let sum = level_irradiance(&map);
    let light = EnvironmentLight { map: Arc::new(map), scale: [5.0; 3], rotation: 0.8 };
    let seen = light.radiance(&Vector3::new(0.5, 0.2, -HEIGHT).normalize());
    let got = albedo(vec![Light::Environment(light)]);
    for channel in 0..3 {
        let want = PI * seen[channel] / (5.0 * sum[channel]);
        assert!((f64::from(got[channel]) / want - 1.0).abs() < 1e-2, "{got:?}: {channel}, not {want}");
    }
    // The albedo is limited to 1.
    let mut texels = vec![[0.1; 3]; 64 * 32];
    texels[64 * 16..].fill([0.6; 3]);
    let bright = EnvironmentMap::new("bright below", 64, 32, texels).expect("sound");
    assert_eq!(albedo(vec![environment(bright, [1.0; 3])]), [1.0; 3]);
    // Without an environment, the ground has its own color.
    assert_eq!(albedo(Vec::new()), [0.25; 3]);
}
