//! Sampling lights, sampling the BSDF, and both combined must agree.

use super::support::*;
use std::sync::Arc;
use syntable_model::context::Serial;
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::prelude::*;
use syntable_model::product::standard::RADIANCE;
use syntable_model::scene::{
    EnvironmentLight, EnvironmentMap, Light, Material, RectLight, Role, Scalar, SphereLight, WindowLight,
};
use syntable_render_cpu::Strategy;

/// A corner of a room with a glossy floor, a metal ball, a box, and three large lights, one of them partly inside a
/// wall. Another light may be a window.
fn room(has_window: bool) -> (std::sync::Arc<Scene>, View) {
    let floor = object("floor", sheet([2.0, 2.0]), Material::plain("floor", [0.6, 0.5, 0.4], 0.35));
    let metal = Material { metallic: Scalar::constant(1.0), ..Material::plain("metal", [0.9, 0.7, 0.5], 0.25) };
    let ball = object("ball", ball(0.3, 48), metal);
    let block = object("block", cuboid([0.25, 0.2, 0.3]), Material::plain("block", [0.3, 0.4, 0.7], 0.6));
    let wall = object("wall", cuboid([0.05, 2.0, 1.0]), matte(0.7));
    let scene = scene([
        body(&ball, at(-0.3, 0.0, 0.3), Role::Object),
        body(&block, at(0.45, 0.3, 0.3), Role::Object),
        body(&floor, at(0.0, 0.0, 0.0), Role::Support),
        body(&wall, at(-1.2, 0.0, 1.0), Role::Room),
    ]);
    let panel = RectLight {
        center: Point3::new(0.2, 0.1, 1.6),
        half_u: Vector3::new(0.0, 0.5, 0.0),
        half_v: Vector3::new(0.7, 0.0, 0.2),
        radiance: [30.0, 28.0, 24.0],
    };
    let globe = SphereLight { center: Point3::new(1.0, -0.8, 0.5), radius: 0.3, radiance: [12.0, 18.0, 30.0] };
    let sunk = SphereLight { center: Point3::new(-1.2, 0.5, 0.7), radius: 0.25, radiance: [20.0, 6.0, 6.0] };
    let texels = (0..32 * 16).map(|i| [if i / 32 < 6 { 40.0 } else { 4.0 }, i as f32 / 40.0, 9.0]).collect();
    let map = Arc::new(EnvironmentMap::new("view", 32, 16, texels).expect("sound"));
    let window = WindowLight {
        center: panel.center,
        half_u: panel.half_u,
        half_v: panel.half_v,
        view: EnvironmentLight { map, scale: [1.5; 3], rotation: 0.5 },
        panes: [2, 2],
        frame_m: 0.1,
        bar_m: 0.06,
        frame_radiance: [1.0, 2.0, 3.0],
    };
    let panel = if has_window { Light::Window(window) } else { Light::Rect(panel) };
    let lights = vec![panel, Light::Sphere(globe), Light::Sphere(sunk)];
    (scene, view(24, 18, 18.0, [1.2, -1.6, 1.3], [0.0, 0.1, 0.3], lights))
}

/// Mean and standard error of every pixel, over images of different seeds.
fn estimate(has_window: bool, strategy: Strategy, samples: u32, images: u64) -> (Plane<[f32; 3]>, Vec<[f64; 2]>) {
    let (scene, view) = room(has_window);
    let mut session = syntable_render_cpu::CpuPathRenderer::new(options(samples, 3)).session().with_strategy(strategy);
    session.load(&scene, &Serial).expect("loads");
    let mut sums = vec![[0.0_f64; 2]; 24 * 18];
    let mut last = None;
    for number in 0..images {
        let mut frame = Products::new();
        let stream = Stream::root(100).at(number);
        let request = RenderRequest::new(&view, &LIGHT, stream, &Threads(2));
        session.render(&request, &mut frame).expect("renders");
        let plane = frame.get(RADIANCE).expect("made").clone();
        for (sum, pixel) in sums.iter_mut().zip(plane.data()) {
            let y = f64::from(0.2126 * pixel[0] + 0.7152 * pixel[1] + 0.0722 * pixel[2]);
            *sum = [sum[0] + y, sum[1] + y * y];
        }
        last = Some(plane);
    }
    let n = images as f64;
    let statistics = sums.iter().map(|[sum, square]| {
        let mean = sum / n;
        [mean, ((square / n - mean * mean).max(0.0) / (n - 1.0)).sqrt()]
    });
    (last.expect("one"), statistics.collect())
}

#[test]
fn all_strategies_agree() {
    check(false);
}

#[test]
fn all_strategies_agree_on_a_window() {
    check(true);
}

fn check(has_window: bool) {
    let (image, combined) = estimate(has_window, Strategy::Combined, 16, 16);
    for (name, strategy, samples) in [("lights", Strategy::Emitters, 32), ("scattering", Strategy::Bsdf, 128)] {
        let (other_image, other) = estimate(has_window, strategy, samples, 16);
        let z = |(a, b): (&[f64; 2], &[f64; 2])| {
            (a[0] - b[0]) / (a[1] * a[1] + b[1] * b[1]).sqrt().max(1e-3 * a[0].max(1e-3))
        };
        let zs: Vec<f64> = combined.iter().zip(&other).map(z).collect();
        let kept = || keep("estimators", &[("combined", &image), (name, &other_image)]);
        // 432 pixels, 15 degrees of freedom each: the probability of any |t| above 6 is about 1 in 100.
        let worst = zs.iter().fold(0.0_f64, |a, z| a.max(z.abs()));
        assert!(worst < 6.5, "{name}: a pixel is off by {worst} deviations; {}", kept());
        // The mean over pixels catches a small bias everywhere.
        let [total, total_other] = [&combined, &other].map(|s| s.iter().map(|p| p[0]).sum::<f64>());
        let variance: f64 = combined.iter().chain(&other).map(|p| p[1] * p[1]).sum();
        let z = (total - total_other) / variance.sqrt();
        assert!(z.abs() < 4.0, "{name}: {total} and {total_other}, off by {z} deviations; {}", kept());
        // Combining must pay off: less noise per sample than either strategy.
        let noise = |s: &[[f64; 2]], samples: u32| s.iter().map(|p| p[1] * p[1] * f64::from(samples)).sum::<f64>();
        assert!(noise(&combined, 16) < noise(&other, samples), "{name} has less noise");
    }
}
