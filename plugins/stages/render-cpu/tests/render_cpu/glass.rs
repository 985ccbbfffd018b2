//! Views through glass, and light through panes.

use super::support::*;
use std::f64::consts::PI;
use syntable_model::context::Serial;
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::prelude::*;
use syntable_model::product::standard::{DENOISE_ALBEDO, DENOISE_NORMAL, RADIANCE, RADIANCE_SPECULAR};
use syntable_model::scene::{Color, Light, Material, RectLight, Role};
use syntable_render_cpu::CpuPathRenderer;
use syntable_transport::PathTracing;
use syntable_transport::PixelFilter;

/// Side of the panel, meters, and its height above the floor.
const PANEL_M: f64 = 0.8;
const HEIGHT_M: f64 = 1.0;

/// A black wall that no ray hits: scenes need an object.
fn bystander() -> syntable_model::scene::BodyDraft {
    body(&object("bystander", cuboid([0.01; 3]), matte(0.0)), at(0.0, 0.0, -5.0), Role::Object)
}

/// A small part of a floor of albedo 0.5 under the center of a panel of one nit, seen from the side, below `sheets`,
/// one above the other. Returns mean and standard deviation of its pixels.
fn floor_under(sheets: &[Material], options: PathTracing) -> [f64; 2] {
    let sheets = sheets.iter().enumerate().map(|(number, material)| {
        let object = object(&format!("sheet {number}"), sheet([4.0; 2]), material.clone());
        body(&object, at(0.0, 0.0, 0.4 + 0.1 * number as f64), Role::Room)
    });
    let floor = body(&object("floor", sheet([4.0; 2]), matte(0.5)), at(0.0, 0.0, 0.0), Role::Support);
    let scene = scene([bystander(), floor].into_iter().chain(sheets));
    let panel = RectLight {
        center: Point3::new(0.0, 0.0, HEIGHT_M),
        half_u: Vector3::new(0.0, PANEL_M / 2.0, 0.0),
        half_v: Vector3::new(PANEL_M / 2.0, 0.0, 0.0),
        radiance: [1.0; 3],
    };
    let view = view(16, 16, 4000.0, [0.6, 0.0, 0.2], [0.0; 3], vec![Light::Rect(panel)]);
    let frame = render(options, &scene, &view, &[RADIANCE.id()]);
    let pixels: Vec<f64> = frame.get(RADIANCE).expect("made").data().iter().map(|p| f64::from(p[1])).collect();
    let mean = pixels.iter().sum::<f64>() / pixels.len() as f64;
    let variance = pixels.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / pixels.len() as f64;
    [mean, variance.sqrt()]
}

/// The same mean by quadrature over the panel; `transmittance` takes the angle of incidence in degrees.
fn floor_by_quadrature(transmittance: impl Fn(f64) -> f64) -> f64 {
    const STEPS: usize = 200;
    let mut irradiance = 0.0;
    for i in 0..STEPS {
        for j in 0..STEPS {
            let [x, y] = [i, j].map(|k| PANEL_M * ((k as f64 + 0.5) / STEPS as f64 - 0.5));
            let square = x * x + y * y + HEIGHT_M * HEIGHT_M;
            let cos = HEIGHT_M / square.sqrt();
            let area = (PANEL_M / STEPS as f64).powi(2);
            irradiance += transmittance(cos.acos().to_degrees()) * cos * cos / square * area;
        }
    }
    0.5 / PI * irradiance
}

/// Transmittance of a thin sheet of index 1.5.
fn of_pane(degrees: f64) -> f64 {
    let r = fresnel(degrees, 1.5);
    (1.0 - r) / (1.0 + r)
}

#[test]
fn light_comes_straight_through_panes() {
    let tinted = |roughness: f32| Material { base_color: Color::constant([0.9, 0.6, 0.3]), ..clear(roughness, None) };
    let [bare, noise] = floor_under(&[], options(64, 1));
    let want = floor_by_quadrature(|_| 1.0);
    assert!((bare / want - 1.0).abs() < 0.004, "{bare}, not {want}");
    for (name, sheets) in [
        ("one", vec![clear(0.0, None)]),
        ("two", vec![clear(0.0, None), tinted(0.04)]),
        ("three", vec![clear(0.03, None), tinted(0.0), clear(0.0, None)]),
    ] {
        let color = if sheets.len() > 1 { 0.6 } else { 1.0 };
        let want = floor_by_quadrature(|degrees| of_pane(degrees).powi(sheets.len() as i32) * color);
        // Paths may or may not be long enough to find the panel by chance. With longer paths, the panes also reflect
        // the floor's own light back.
        for max_bounces in [1, 2] {
            let [got, spread] = floor_under(&sheets, options(64, max_bounces));
            let reflected = max_bounces > 1;
            let near = if reflected { (0.99..1.03).contains(&(got / want)) } else { (got / want - 1.0).abs() < 0.004 };
            assert!(near, "{name}, {max_bounces} bounces: {got}, not {want}");
            // As little noise as without panes: every shadow ray counts.
            assert!(spread / got < 1.6 * noise / bare, "{name}: noise {} was {}", spread / got, noise / bare);
        }
    }
    // A rough pane scatters light, so no shadow ray passes it.
    let [got, spread] = floor_under(&[clear(0.3, None)], options(64, 4));
    assert!(spread / got > 2.0 * noise / bare, "{got} ± {spread}");
}

#[test]
fn a_pane_before_the_camera_changes_nothing_but_the_light() {
    // A textured floor behind a pane, and a light behind the pane.
    let ground = body(&object("floor", sheet([0.3; 2]), matte(0.5)), at(0.0, 0.0, 0.0), Role::Object);
    let panel = RectLight {
        center: Point3::new(0.0, 0.6, 0.5),
        half_u: Vector3::new(0.3, 0.0, 0.0),
        half_v: Vector3::new(0.0, 0.0, 0.3),
        radiance: [3.0; 3],
    };
    let view = view(24, 18, 14.0, [0.0, -1.0, 0.6], [0.0, 0.0, 0.2], vec![furnace(), Light::Rect(panel)]);
    let wants = [RADIANCE.id(), DENOISE_ALBEDO.id(), DENOISE_NORMAL.id()];
    let pane = object("pane", cuboid([4.0, 0.0005, 4.0]), clear(0.0, None));
    let bare = render(options(64, 8), &scene([ground.clone()]), &view, &wants);
    let covered = render(options(64, 8), &scene([ground, body(&pane, at(0.0, -0.9, 0.0), Role::Room)]), &view, &wants);
    for guide in [DENOISE_ALBEDO, DENOISE_NORMAL] {
        let [a, b] = [&bare, &covered].map(|frame| frame.get(guide).expect("made").data());
        let off = a.iter().flatten().zip(b.iter().flatten()).filter(|(a, b)| (*a - *b).abs() > 0.12).count();
        assert!(off * 100 < a.len() * 3, "{}: {off} of {} numbers differ", guide.name(), 3 * a.len());
    }
    // The furnace shines on both sides, so the pane also reflects the light that it does not transmit; the light's
    // front loses light at two faces of the pane.
    let [a, b] = [&bare, &covered].map(|frame| frame.get(RADIANCE).expect("made").data());
    let ratio = a.iter().map(|p| f64::from(p[1])).sum::<f64>() / b.iter().map(|p| f64::from(p[1])).sum::<f64>();
    assert!((1.0..1.25).contains(&ratio), "{ratio}");
}

#[test]
fn what_glass_reflects_is_specular() {
    // A glass ball in the furnace: light that is not reflected, on the way in or out, passes through it.
    let ball = object("ball", ball(1.0, 192), clear(0.0, Some(AIRY)));
    let scene = scene([body(&ball, at(0.0, 0.0, 0.0), Role::Object)]);
    let (eye, focal, size) = (1.35, 12.2, 16);
    let view = view(size, size, focal, [eye, 0.0, 0.0], [0.0; 3], vec![furnace()]);
    let long = PathTracing { russian_roulette_from: 257, ..options(256, 48) };
    let frame = render(long, &scene, &view, &[RADIANCE.id(), RADIANCE_SPECULAR.id()]);
    let mean = |key: Key<Plane<[f32; 3]>>| {
        let data = frame.get(key).expect("made").data();
        data.iter().map(|pixel| f64::from(pixel[1])).sum::<f64>() / data.len() as f64
    };
    let (mut want, fine) = (0.0, 8 * size);
    for i in 0..fine {
        for j in 0..fine {
            let [x, y] = [i, j].map(|k| ((f64::from(k) + 0.5) / 8.0 - f64::from(size) / 2.0) / focal);
            // sin of the angle at the ball, from the angle at the eye.
            let sin = eye * ((x * x + y * y) / (1.0 + x * x + y * y)).sqrt();
            want += 1.0 - (1.0 - fresnel(sin.asin().to_degrees(), 1.5)).powi(2);
        }
    }
    let (want, got) = (want / f64::from(fine * fine), mean(RADIANCE_SPECULAR));
    assert!((got / want - 1.0).abs() < 0.02, "{got}, not {want}");
    assert!((mean(RADIANCE) - 1.0).abs() < 0.01, "{}", mean(RADIANCE));
}

#[test]
fn highlights_of_glass_are_not_rare() {
    // A pane reflects a tenth of a panel: the spread between pixels is the noise of few samples.
    let pane = body(&object("pane", sheet([4.0; 2]), clear(0.0, None)), at(0.0, 0.0, 0.0), Role::Object);
    let panel = RectLight {
        center: Point3::new(0.0, 1.0, 1.0),
        half_u: Vector3::new(0.6, 0.0, 0.0),
        half_v: Vector3::new(0.0, -0.6, 0.6),
        radiance: [900.0; 3],
    };
    let view = view(16, 16, 400.0, [0.0, -1.0, 1.0], [0.0; 3], vec![Light::Rect(panel)]);
    let frame = render(options(16, 4), &scene([pane]), &view, &[RADIANCE.id()]);
    let pixels: Vec<f64> = frame.get(RADIANCE).expect("made").data().iter().map(|p| f64::from(p[1])).collect();
    let mean = pixels.iter().sum::<f64>() / pixels.len() as f64;
    let spread = (pixels.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / pixels.len() as f64).sqrt();
    let want = 900.0 * (1.0 - of_pane(45.0));
    assert!((mean / want - 1.0).abs() < 0.01, "{mean}, not {want}");
    // With random choices alone, it would be the root of (1 − R) / 16 R, 0.8.
    assert!(spread / mean < 0.05, "{}", spread / mean);
}

#[test]
fn the_tent_weighs_by_distance_from_the_center() {
    // A bright edge between columns, at a fraction of a pixel: the image across it is the integral of the filter.
    let emissive = Material { emission: Color::constant([1.0; 3]), ..matte(0.0) };
    let half = body(&object("half", sheet([2.0; 2]), emissive), at(2.0 + 0.3 / 16.0, 0.0, 0.0), Role::Object);
    let scene = scene([half]);
    let view = view(16, 4, 16.0, [0.0, -1e-6, 1.0], [0.0; 3], vec![]);
    for (filter, integral) in [
        (PixelFilter::Box, (|d: f64| (0.5 + d).clamp(0.0, 1.0)) as fn(f64) -> f64),
        (PixelFilter::Tent, |d: f64| {
            let d = d.clamp(-1.0, 1.0);
            if d < 0.0 { (1.0 + d).powi(2) / 2.0 } else { 1.0 - (1.0 - d).powi(2) / 2.0 }
        }),
    ] {
        let mut session = CpuPathRenderer::new(PathTracing { pixel_filter: filter, ..options(1024, 0) }).session();
        session.load(&scene, &Serial).expect("loads");
        let mut frame = Products::new();
        let request = RenderRequest::new(&view, &LIGHT, Stream::root(3), &Serial);
        session.render(&request, &mut frame).expect("renders");
        let row = &frame.get(RADIANCE).expect("made").data()[16..32];
        for (column, pixel) in row.iter().enumerate() {
            let want = integral(column as f64 + 0.5 - 8.3);
            assert!((f64::from(pixel[1]) - want).abs() < 0.01, "{filter:?}, {column}: {}, not {want}", pixel[1]);
        }
    }
}
