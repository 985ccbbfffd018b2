//! Layers and transmission, compared over whole images.

use super::support::*;
use std::f64::consts::PI;
use std::sync::Arc;
use syntable_model::context::Serial;
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::photometry::sphere_luminance;
use syntable_model::prelude::*;
use syntable_model::product::standard::{RADIANCE, RADIANCE_SPECULAR};
use syntable_model::scene::{
    Alpha, Clearcoat, Color, DirectionalLight, DiskLight, EnvironmentLight, EnvironmentMap, Light, Material, RectLight,
    Role, Scalar, Sheen, SphereLight, Volume,
};
use syntable_render_cpu::CpuPathRenderer;
use syntable_render_cpu::Strategy;
use syntable_transport::PathTracing;

fn mean(frame: &Products) -> f64 {
    let data = frame.get(RADIANCE).expect("made").data();
    data.iter().flatten().map(|&x| f64::from(x)).sum::<f64>() / (3 * data.len()) as f64
}

fn coated(base: Material, strength: f32, roughness: f32) -> Material {
    let (strength, roughness) = (Scalar::constant(strength), Scalar::constant(roughness));
    Material { clearcoat: Some(Clearcoat { strength, roughness, normal: None }), ..base }
}

fn fibrous(base: Material, color: f32, roughness: f32) -> Material {
    let sheen = Sheen { color: Color::constant([color; 3]), roughness: Scalar::constant(roughness) };
    Material { sheen: Some(sheen), ..base }
}

/// Mean over an image of a ball that fills it, in the furnace, from normal to grazing angles.
fn in_furnace(material: Material) -> f64 {
    let ball = object("ball", ball(1.0, 96), material);
    let scene = scene([body(&ball, at(0.0, 0.0, 0.0), Role::Object)]);
    // Seen from a near point, so that the ball fills the image, up to angles of about 75 degrees.
    let view = view(16, 16, 12.2, [1.35, 0.0, 0.0], [0.0; 3], vec![furnace()]);
    let options = PathTracing { russian_roulette_from: 257, ..options(64, 48) };
    mean(&render(options, &scene, &view, &[RADIANCE.id()]))
}

#[test]
fn a_white_furnace_for_every_layer() {
    let white = |roughness: f32| Material::plain("white", [1.0; 3], roughness);
    let metal = |roughness: f32| Material { metallic: Scalar::constant(1.0), ..white(roughness) };
    let check = |name: &str, material: Material, least: f64| {
        let got = in_furnace(material);
        assert!((least..1.004).contains(&got), "{name}: {got}, not {least} to 1");
    };
    for roughness in [0.0, 0.3, 0.6, 1.0] {
        check(&format!("white {roughness}"), white(roughness), 0.99);
        check(&format!("metal {roughness}"), metal(roughness), 0.99);
        // Clearcoat of any roughness loses almost nothing over diffuse; over gloss, it loses light that bounces between
        // the two.
        check(&format!("clearcoat {roughness} on matte"), coated(white(1.0), 1.0, roughness), 0.95);
        check(&format!("clearcoat 0 on metal {roughness}"), coated(metal(roughness), 0.8, 0.0), 0.93);
        check(&format!("sheen {roughness} on matte"), fibrous(white(1.0), 1.0, roughness), 0.75);
        check(&format!("pane {roughness}"), clear(roughness, None), 0.96);
        check(&format!("glass {roughness}"), clear(roughness, Some(AIRY)), 0.96);
    }
    check("all at once", coated(fibrous(white(0.4), 0.5, 0.5), 0.5, 0.1), 0.9);
    let half = Material { metallic: Scalar::constant(0.5), ..clear(0.1, Some(AIRY)) };
    check("half metal, half glass", half, 0.97);
}

/// Radiance of a wall of one nit, seen at an angle through a slab of 2 cm, or through its front face only.
fn through_slab(material: Material, degrees: f64, faces: usize) -> f64 {
    let mut slab = cuboid([0.01, 3.0, 3.0]);
    if faces == 1 {
        // The two triangles of the face towards +x.
        slab.triangles = slab.triangles[2..4].to_vec();
    }
    let slab = object("slab", slab, material);
    let scene = scene([body(&slab, at(0.0, 0.0, 0.0), Role::Object)]);
    let wall = RectLight {
        center: Point3::new(-1.0, 0.0, 0.0),
        half_u: Vector3::new(0.0, 9.0, 0.0),
        half_v: Vector3::new(0.0, 0.0, 9.0),
        radiance: [1.0; 3],
    };
    let (s, c) = degrees.to_radians().sin_cos();
    let view = view(2, 2, 2000.0, [c, s, 0.0], [0.0; 3], vec![Light::Rect(wall)]);
    let options = PathTracing { russian_roulette_from: 257, ..options(4096, 64) };
    mean(&render(options, &scene, &view, &[RADIANCE.id()]))
}

#[test]
fn a_slab_transmits_what_fresnel_says() {
    for degrees in [0.0, 40.0, 65.0] {
        let r = fresnel(degrees, 1.5);
        // Light bounces between two faces.
        let want = (1.0 - r) / (1.0 + r);
        for (volume, faces) in [(None, 1), (Some(AIRY), 2)] {
            let got = through_slab(clear(0.0, volume), degrees, faces);
            assert!((got - want).abs() < 0.02, "{degrees}°, {volume:?}: {got}, not {want}");
        }
        // One centimeter absorbs half of the light.
        let dark = Volume { attenuation_color: [0.5; 3], attenuation_distance_m: 0.01 };
        let bent = (1.0 - (degrees.to_radians().sin() / 1.5).powi(2)).sqrt();
        let left = 0.5_f64.powf(2.0 / bent);
        let want = (1.0 - r).powi(2) * left / (1.0 - (r * left).powi(2));
        let got = through_slab(clear(0.0, Some(dark)), degrees, 2);
        assert!((got - want).abs() < 0.015, "{degrees}°: {got}, not {want}");
    }
}

#[test]
fn a_ball_lens_turns_the_image_over() {
    // A glass ball swaps left and right: one half of the wall shines.
    let ball = object("ball", ball(0.2, 96), clear(0.0, Some(AIRY)));
    let scene = scene([body(&ball, at(0.0, 0.0, 0.0), Role::Object)]);
    let wall = RectLight {
        center: Point3::new(-2.0, 3.0, 0.0),
        half_u: Vector3::new(0.0, 3.0, 0.0),
        half_v: Vector3::new(0.0, 0.0, 3.0),
        radiance: [1.0; 3],
    };
    let view = view(32, 32, 100.0, [2.0, 0.0, 0.0], [0.0; 3], vec![Light::Rect(wall)]);
    let frame = render(options(64, 8), &scene, &view, &[RADIANCE.id()]);
    let plane = frame.get(RADIANCE).expect("made");
    let at = |x: usize| plane.data()[16 * 32 + x][0];
    // Seen from +x along -x with z up, +y is to the right.
    assert!(at(30) > 0.95 && at(1) < 0.05, "beside the ball: {} {}", at(1), at(30));
    assert!(at(12) > 0.8 && at(19) < 0.1, "through it: {} {}; {}", at(12), at(19), keep("lens", &[("lens", plane)]));
}

#[test]
fn blended_surfaces_cover_and_shade_in_part() {
    let film = Material { alpha: Alpha::Blend { factor: 0.3 }, ..Material::plain("film", [0.0; 3], 1.0) };
    let film = Material { ior: 1.0, ..film };
    assert!((through_slab(film.clone(), 20.0, 2) - 0.7 * 0.7).abs() < 0.02, "two faces of a slab");
    let (floor, film) = (object("floor", sheet([2.0, 2.0]), matte(0.5)), object("film", sheet([1.0, 1.0]), film));
    let scene = scene([body(&floor, at(0.0, 0.0, 0.0), Role::Support), body(&film, at(0.0, 0.0, 0.5), Role::Object)]);
    let light = SphereLight {
        center: Point3::new(0.0, 0.0, 2.0),
        radius: 0.1,
        radiance: [sphere_luminance(1000.0, 2.0, 0.1); 3],
    };
    let view = view(2, 2, 4000.0, [1.5, 0.0, 0.2], [0.0; 3], vec![Light::Sphere(light)]);
    let got = mean(&render(options(4096, 2), &scene, &view, &[RADIANCE.id()]));
    let want = 0.7 * 0.5 * 1000.0 / PI;
    assert!((got / want - 1.0).abs() < 0.02, "{got}, not {want}");
}

#[test]
fn an_emissive_body_lights_as_a_light_of_its_shape() {
    let emissive = Material {
        emission: Color::constant([900.0, 800.0, 700.0]),
        ..Material { ior: 1.0, ..Material::plain("emissive", [0.0; 3], 1.0) }
    };
    let floor = object("floor", sheet([3.0, 3.0]), matte(0.5));
    let panel = object("panel", sheet([0.3, 0.4]), emissive);
    let eye = [2.0, 1.0, 0.5];
    let with_body = scene([body(&floor, at(0.0, 0.0, 0.0), Role::Object), body(&panel, at(0.1, 0.0, 1.0), Role::Room)]);
    let body_view = view(4, 4, 4000.0, eye, [0.0; 3], Vec::new());
    let panel = RectLight {
        center: Point3::new(0.1, 0.0, 1.0),
        half_u: Vector3::new(0.0, 0.4, 0.0),
        half_v: Vector3::new(0.3, 0.0, 0.0),
        radiance: [900.0, 800.0, 700.0],
    };
    let with_panel = scene([body(&floor, at(0.0, 0.0, 0.0), Role::Object)]);
    let panel_view = view(4, 4, 4000.0, eye, [0.0; 3], vec![Light::Rect(panel)]);
    let got = mean(&render(options(512, 1), &with_body, &body_view, &[RADIANCE.id()]));
    let want = mean(&render(options(512, 1), &with_panel, &panel_view, &[RADIANCE.id()]));
    assert!((got / want - 1.0).abs() < 0.005, "{got}, not {want}");
}

/// Every kind of light and of layer in one scene.
fn everything() -> (Arc<Scene>, View) {
    let floor = object("floor", sheet([2.0, 2.0]), fibrous(Material::plain("cloth", [0.4, 0.3, 0.3], 0.9), 0.6, 0.5));
    let lacquer = coated(Material::plain("lacquer", [0.5, 0.1, 0.1], 0.6), 1.0, 0.25);
    let amber = Volume { attenuation_color: [0.9, 0.6, 0.2], attenuation_distance_m: 0.1 };
    let emissive = Material { emission: Color::constant([6.0, 9.0, 5.0]), ..matte(0.2) };
    let scene = scene([
        body(&object("lacquered", ball(0.3, 40), lacquer), at(-0.4, 0.0, 0.3), Role::Object),
        body(&object("amber", ball(0.25, 40), clear(0.3, Some(amber))), at(0.35, -0.2, 0.26), Role::Object),
        body(&object("lantern", cuboid([0.1, 0.1, 0.15]), emissive), at(0.3, 0.5, 0.15), Role::Object),
        body(&floor, at(0.0, 0.0, 0.0), Role::Support),
    ]);
    let sun =
        DirectionalLight { towards: Vector3::new(0.48, -0.6, 0.64), half_angle: 0.1, irradiance: [9.0, 8.0, 7.0] };
    let spot = DiskLight {
        center: Point3::new(-0.5, -0.4, 1.2),
        normal: Vector3::new(0.0, 0.0, -1.0),
        radius: 0.3,
        radiance: [14.0, 12.0, 10.0],
    };
    let texels =
        (0..8).flat_map(|y| (0..16).map(move |x| [0.2, 0.3, if x > 9 && y < 3 { 9.0 } else { 0.5 }])).collect();
    let map = Arc::new(EnvironmentMap::new("sky", 16, 8, texels).expect("sound"));
    let sky = EnvironmentLight { map, scale: [1.0; 3], rotation: 0.4 };
    let lights = vec![Light::Directional(sun), Light::Disk(spot), Light::Environment(sky)];
    (scene, view(24, 18, 18.0, [1.2, -1.6, 1.3], [0.0, 0.1, 0.3], lights))
}

#[test]
fn all_strategies_agree_on_every_light_and_layer() {
    let (scene, view) = everything();
    let estimate = |strategy: Strategy, samples: u32| {
        let renderer = CpuPathRenderer::new(options(samples, 4));
        let mut session = renderer.session().with_strategy(strategy);
        session.load(&scene, &Serial).expect("loads");
        let image = |number: u64| {
            let mut frame = Products::new();
            let stream = Stream::root(40).at(number);
            let request = RenderRequest::new(&view, &LIGHT, stream, &Threads(2));
            session.render(&request, &mut frame).expect("renders");
            frame.get(RADIANCE).expect("made").clone()
        };
        (0..16).map(image).collect::<Vec<_>>()
    };
    let statistics = |images: &[Plane<[f32; 3]>]| -> Vec<[f64; 2]> {
        let n = images.len() as f64;
        (0..24 * 18)
            .map(|i| {
                let values = images.iter().map(|p| p.data()[i].iter().map(|&x| f64::from(x)).sum::<f64>() / 3.0);
                let (sum, square) = values.fold((0.0, 0.0), |(s, q), y| (s + y, q + y * y));
                let mean = sum / n;
                [mean, ((square / n - mean * mean).max(0.0) / (n - 1.0)).sqrt()]
            })
            .collect()
    };
    let combined_images = estimate(Strategy::Combined, 32);
    let combined = statistics(&combined_images);
    for (name, strategy, samples) in [("lights", Strategy::Emitters, 64), ("scattering", Strategy::Bsdf, 128)] {
        let images = estimate(strategy, samples);
        let other = statistics(&images);
        let kept = || keep("everything", &[("combined", &combined_images[0]), (name, &images[0])]);
        let z = |(a, b): (&[f64; 2], &[f64; 2])| {
            (a[0] - b[0]) / (a[1] * a[1] + b[1] * b[1]).sqrt().max(1e-3 * a[0].max(1e-3))
        };
        // The sun's caustics are rare events, so their pixels are not normally distributed: the far tail is left out.
        let mut zs: Vec<f64> = combined.iter().zip(&other).map(|pair| z(pair).abs()).collect();
        zs.sort_by(f64::total_cmp);
        let high = zs[zs.len() * 99 / 100];
        assert!(high < 5.0, "{name}: a hundredth of the pixels is off by {high} deviations; {}", kept());
        let [total, total_other] = [&combined, &other].map(|s| s.iter().map(|p| p[0]).sum::<f64>());
        let variance: f64 = combined.iter().chain(&other).map(|p| p[1] * p[1]).sum();
        let z = (total - total_other) / variance.sqrt();
        assert!(z.abs() < 4.5, "{name}: {total} and {total_other}, off by {z} deviations; {}", kept());
    }
}

#[test]
fn gloss_is_what_is_mirrored_without_color() {
    let parts = |material: Material| {
        let ball = object("ball", ball(1.0, 96), material);
        let scene = scene([body(&ball, at(0.0, 0.0, 0.0), Role::Object)]);
        let light = SphereLight { center: Point3::new(3.0, 1.0, 1.0), radius: 0.5, radiance: [20.0; 3] };
        let view = view(16, 16, 12.2, [1.35, 0.0, 0.0], [0.0; 3], vec![furnace(), Light::Sphere(light)]);
        let frame = render(options(256, 4), &scene, &view, &[RADIANCE.id(), RADIANCE_SPECULAR.id()]);
        let mean = |key: Key<Plane<[f32; 3]>>| {
            let data = frame.get(key).expect("made").data();
            data.iter().map(|pixel| f64::from(pixel[1])).sum::<f64>() / data.len() as f64
        };
        (mean(RADIANCE), mean(RADIANCE_SPECULAR))
    };
    let plain = |color: f32, roughness: f32| Material::plain("plain", [color; 3], roughness);
    for roughness in [0.1, 0.5] {
        let (all, of_black) = parts(plain(0.0, roughness));
        assert!((of_black / all - 1.0).abs() < 1e-3, "black mirrors, or takes: {of_black} of {all}");
        // The same interface over other colors, with other sampling.
        let (all, of_red) = parts(plain(0.7, roughness));
        assert!((of_red / of_black - 1.0).abs() < 0.03 && of_red < 0.6 * all, "{of_red} of {all}, black {of_black}");
    }
    let metal = Material { metallic: Scalar::constant(1.0), ..plain(0.7, 0.3) };
    for (name, material) in [("matte", matte(0.7)), ("metal", metal)] {
        assert_eq!(parts(material).1, 0.0, "{name}");
    }
}
