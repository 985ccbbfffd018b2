//! Radiance, compared with closed forms.

use super::support::*;
use std::f64::consts::PI;
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::photometry::{polygon_illuminance, sphere_luminance};
use syntable_model::prelude::*;
use syntable_model::product::standard::RADIANCE;
use syntable_model::scene::{Color, Light, Material, RectLight, Role, Scalar, SphereLight};
use syntable_transport::PathTracing;

fn sphere_light(center: [f64; 3], radius: f64, nits: f64) -> Light {
    Light::Sphere(SphereLight { center: center.into(), radius, radiance: [nits; 3] })
}

/// Mean radiance over the image.
fn mean(frame: &Products) -> [f64; 3] {
    let data = frame.get(RADIANCE).expect("made").data();
    [0, 1, 2].map(|c| data.iter().map(|p| f64::from(p[c])).sum::<f64>() / data.len() as f64)
}

fn check(test: &str, frame: &Products, want: f64, tolerance: f64) {
    let got = mean(frame);
    let ok = got.iter().all(|got| (got - want).abs() <= tolerance * want);
    let keep = || keep(test, &[("radiance", frame.get(RADIANCE).expect("made"))]);
    assert!(ok, "{test}: {got:?}, not {want}; {}", keep());
}

/// A diffuse table under one light, seen from near in a few pixels around the origin.
fn table(light: Light, albedo: f32) -> Products {
    let scene = scene([body(&object("table", sheet([3.0, 3.0]), matte(albedo)), at(0.0, 0.0, 0.0), Role::Object)]);
    let view = view(4, 4, 4000.0, [2.0, 1.0, 0.5], [0.0; 3], vec![light]);
    render(options(256, 8), &scene, &view, &[RADIANCE.id()])
}

#[test]
fn a_table_under_a_sphere_light() {
    // L = ρ E / π.
    for (height, radius) in [(2.0, 0.1), (0.8, 0.5)] {
        let light = sphere_light([0.0, 0.0, height], radius, sphere_luminance(1000.0, height, radius));
        check("table under a sphere", &table(light, 0.5), 0.5 * 1000.0 / PI, 0.004);
    }
}

#[test]
fn a_table_under_a_rectangle_light() {
    for (half, height) in [(0.2, 1.5), (1.0, 0.7)] {
        let center = Point3::new(0.3, 0.1, height);
        let light = RectLight {
            center,
            half_u: Vector3::new(0.0, half, 0.0),
            half_v: Vector3::new(half * 1.5, 0.0, 0.0),
            radiance: [900.0; 3],
        };
        let want = 0.4 / PI * 900.0 * polygon_illuminance(&light.corners(), Point3::origin(), Vector3::z());
        check("table under a rectangle", &table(Light::Rect(light), 0.4), want, 0.004);
    }
}

#[test]
fn a_half_hidden_light_gives_half() {
    // A wall stands on the plane through the middle of the light, and reaches up to it.
    let wall = object("wall", sheet([1.0, 3.0]), matte(0.0));
    let turned = Pose::from_parts(
        syntable_model::geometry::Translation3::new(0.0, 0.0, 1.0),
        syntable_model::geometry::UnitQuaternion::from_axis_angle(&Vector3::y_axis(), PI / 2.0),
    );
    let table = object("table", sheet([3.0, 3.0]), matte(0.5));
    let scene = scene([body(&table, at(0.0, 0.0, 0.0), Role::Object), body(&wall, turned, Role::Room)]);
    let light = sphere_light([0.0, 0.0, 2.0], 0.4, sphere_luminance(100.0, 2.0, 0.4));
    let view = view(4, 4, 1e6, [1.0, 0.0, 1.0], [1e-4, 0.0, 0.0], vec![light]);
    let frame = render(options(512, 1), &scene, &view, &[RADIANCE.id()]);
    check("half-hidden light", &frame, 0.5 * 0.5 * 100.0 / PI, 0.01);
}

/// A closed ball of a given albedo with a light in its center: every bounce reflects the fraction ρ of the incident
/// light evenly, so that the wall's radiance is ρ E / (π (1 − ρ)) with the light's own E.
#[test]
fn a_ball_lit_from_its_center() {
    let shell = object("shell", inside_out(ball(1.0, 128)), matte(0.5));
    let scene = scene([body(&shell, at(0.0, 0.0, 0.0), Role::Object)]);
    let radius = 0.01;
    let light = sphere_light([0.0; 3], radius, sphere_luminance(PI, 1.0, radius));
    let view = view(8, 8, 10.0, [0.3, 0.2, 0.1], [0.9, 0.0, 0.4], vec![light]);
    // E = π lx, ρ = 1/2: the series 1/2 + 1/4 + … is 1 nit. The light itself hides almost nothing.
    let frame = render(PathTracing { russian_roulette_from: 4, ..options(256, 40) }, &scene, &view, &[RADIANCE.id()]);
    check("ball lit from its center", &frame, 1.0, 0.012);
    let direct = render(options(64, 1), &scene, &view, &[RADIANCE.id()]);
    check("ball, direct light", &direct, 0.5, 0.006);
    let two = render(options(256, 2), &scene, &view, &[RADIANCE.id()]);
    check("ball, two bounces", &two, 0.75, 0.01);
}

/// Inside a ball that emits with radiance 1 and reflects ρ, the radiance is 1 / (1 − ρ) everywhere: a furnace, for
/// diffuse, glossy and metal walls.
#[test]
fn an_emissive_ball_is_a_furnace() {
    let metal = Material { metallic: Scalar::constant(1.0), ..Material::plain("metal", [0.6; 3], 0.4) };
    let gloss = Material::plain("gloss", [1.0; 3], 0.3);
    for (name, material, albedo) in [("matte", matte(0.6), 0.6), ("metal", metal, f64::NAN), ("gloss", gloss, 1.0)] {
        let emissive = Material { emission: Color::constant([1.0; 3]), ..material };
        let shell = object(name, inside_out(flat(ball(1.0, 64))), emissive);
        let scene = scene([body(&shell, at(0.0, 0.0, 0.0), Role::Object)]);
        let view = view(8, 8, 6.0, [0.2, 0.1, 0.0], [0.9, 0.0, 0.4], vec![]);
        let bounces = if name == "gloss" { 5 } else { 30 };
        let frame =
            render(PathTracing { russian_roulette_from: 5, ..options(256, bounces) }, &scene, &view, &[RADIANCE.id()]);
        match name {
            "matte" => check("furnace, matte", &frame, 1.0 / (1.0 - albedo), 0.01),
            // All light is reflected: one unit for the visible wall, one for every bounce.
            "gloss" => check("furnace, gloss", &frame, 6.0, 0.01),
            // A metal's albedo grows a little towards grazing angles: between F₀ and its hemispherical mean.
            _ => {
                let got = mean(&frame)[0];
                assert!((1.0 / (1.0 - 0.59)..1.0 / (1.0 - 0.62)).contains(&got), "{got}");
            }
        }
    }
}

#[test]
fn lights_are_seen_and_bodies_hide_them() {
    let block = object("block", cuboid([0.1, 0.1, 0.1]), matte(0.0));
    let scene = scene([body(&block, at(0.0, 0.0, 1.0), Role::Object)]);
    let look = |light| {
        let view = view(1, 1, 1000.0, [0.0, 0.0, 3.0], [0.0; 3], vec![light]);
        mean(&render(options(4, 2), &scene, &view, &[RADIANCE.id()]))[0]
    };
    assert_eq!(look(sphere_light([0.0, 0.0, 2.0], 0.1, 5.0)), 5.0);
    assert_eq!(look(sphere_light([0.0, 0.0, 0.0], 0.1, 5.0)), 0.0, "behind the block");
    assert_eq!(look(sphere_light([0.0, 0.0, 3.1], 0.5, 5.0)), 5.0, "the camera is inside");
    // Exactly on the block's surface, like a light on a ceiling.
    let up = |z| {
        Light::Rect(RectLight {
            center: Point3::new(0.0, 0.0, z),
            half_u: Vector3::new(0.05, 0.0, 0.0),
            half_v: Vector3::new(0.0, 0.05, 0.0),
            radiance: [7.0; 3],
        })
    };
    assert_eq!(look(up(1.1)), 7.0);
    assert_eq!(look(up(1.05)), 0.0, "within the block");
}

#[test]
fn nothing_to_see_is_black() {
    let block = object("block", cuboid([0.1, 0.1, 0.1]), matte(0.5));
    let scene = scene([body(&block, at(0.0, 0.0, 1.0), Role::Object)]);
    let away = view(3, 2, 100.0, [0.0, 0.0, 3.0], [0.0, 0.0, 9.0], vec![]);
    let frame = render(options(2, 2), &scene, &away, &[RADIANCE.id()]);
    assert!(frame.get(RADIANCE).expect("made").data().iter().all(|p| *p == [0.0; 3]));
}

#[test]
fn clamping_limits_scattered_light_alone() {
    let table = object("table", sheet([3.0, 3.0]), matte(0.5));
    let scene = scene([body(&table, at(0.0, 0.0, 0.0), Role::Object)]);
    let light = sphere_light([0.0, 0.0, 1.0], 0.2, 1000.0);
    let clamped = PathTracing { max_indirect_luminance_nits: Some(3.0), ..options(16, 4) };
    let below = view(2, 2, 4000.0, [0.6, 0.4, 1.0], [0.0; 3], vec![light.clone()]);
    // A path may find the limit by sampling the light, and a little more by hitting it.
    check("clamped", &render(clamped.clone(), &scene, &below, &[RADIANCE.id()]), 3.0, 0.03);
    let looking = view(2, 2, 4000.0, [0.6, 0.4, 1.0], [0.0, 0.0, 1.0], vec![light]);
    check("visible light", &render(clamped, &scene, &looking, &[RADIANCE.id()]), 1000.0, 1e-6);
}
