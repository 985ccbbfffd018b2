//! Lenses: depth of field and distortion.

use super::support::*;
use syntable_model::context::Serial;
use syntable_model::geometry::Point3;
use syntable_model::prelude::*;
use syntable_model::product::standard::{DEPTH, INSTANCE, RADIANCE};
use syntable_model::scene::{Camera, Color, Distortion, InstanceId, Light, Material, Role, SphereLight, ThinLens};
use syntable_render_cpu::CpuPathRenderer;

const BARREL: Distortion = Distortion::brown_conrady([-0.25, 0.06, 0.0], [0.002, -0.001]);

/// A view from (0, 0, 4) straight down, so that depth is 4 − z.
fn from_above(size: u32, focal: f64, lights: Vec<Light>) -> View {
    view(size, size, focal, [0.0, 1e-9, 4.0], [0.0; 3], lights)
}

fn through(view: View, lens: Option<ThinLens>, distortion: Option<Distortion>) -> View {
    View { camera: Camera { lens, distortion, ..view.camera }, ..view }
}

#[test]
fn a_point_out_of_focus_becomes_its_circle_of_confusion() {
    let floor = object("floor", sheet([3.0, 3.0]), matte(0.0));
    let scene = scene([body(&floor, at(0.0, 0.0, 0.0), Role::Object)]);
    for (depth, focus) in [(2.0, 2.0), (2.0, 3.5), (3.0, 1.5)] {
        // So small that it is a point, a tenth of a pixel wide.
        let light = SphereLight { center: Point3::new(0.0, 0.0, 4.0 - depth), radius: 1e-3, radiance: [1e6; 3] };
        let lens = ThinLens { aperture_radius_m: 0.05, focus_distance_m: focus };
        let view = through(from_above(49, 200.0, vec![Light::Sphere(light)]), Some(lens), None);
        let frame = render(options(4096, 0), &scene, &view, &[RADIANCE.id()]);
        let plane = frame.get(RADIANCE).expect("made");
        // A disc of radius r has the mean square distance r² / 2; the pixels themselves add 1/6.
        let (mut sum, mut square) = (0.0, 0.0);
        for (i, pixel) in plane.data().iter().enumerate() {
            let (x, y) = ((i % 49) as f64 - 24.0, (i / 49) as f64 - 24.0);
            sum += f64::from(pixel[1]);
            square += f64::from(pixel[1]) * (x * x + y * y);
        }
        let want = 200.0 * lens.aperture_radius_m * (1.0_f64 / depth - 1.0 / focus).abs();
        let got = (2.0 * (square / sum - 1.0 / 6.0).max(0.0)).sqrt();
        assert!(
            (got - want).abs() < 0.25,
            "{depth} {focus}: {got} px, not {want}; {}",
            keep("lens", &[("lens", plane)])
        );
    }
}

#[test]
fn labels_and_light_of_a_distorting_camera_are_where_it_projects_them() {
    // Small emissive plates at several places and heights: the centroid of each in labels and in light.
    let emissive = Material { emission: Color::constant([1.0; 3]), ..matte(0.0) };
    let plate = object("plate", sheet([0.04, 0.04]), emissive);
    let places = [[-1.0, -0.8, 0.0], [0.9, 0.7, 0.5], [0.2, -0.9, 1.0], [-0.7, 0.8, 0.3], [0.05, 0.02, 0.6]];
    let floor = object("floor", sheet([5.0, 5.0]), matte(0.0));
    let mut bodies: Vec<_> = places.iter().map(|p| body(&plate, at(p[0], p[1], p[2]), Role::Object)).collect();
    bodies.push(body(&floor, at(0.0, 0.0, -0.1), Role::Support));
    let scene = scene(bodies);
    let view = through(from_above(200, 280.0, Vec::new()), None, Some(BARREL));
    let frame = render(options(16, 0), &scene, &view, &[RADIANCE.id(), INSTANCE.id(), DEPTH.id()]);
    let (instance, light) = (frame.get(INSTANCE).expect("made"), frame.get(RADIANCE).expect("made"));
    for (number, place) in (1..).zip(places) {
        let p_camera = view.camera.world_from_camera.inverse_transform_point(&Point3::from(place));
        let want = view.camera.project(&p_camera);
        let straight = view.camera.intrinsics.project(&p_camera);
        let shift = (want[0] - straight[0]).hypot(want[1] - straight[1]);
        assert!(shift > 1.0 || number == 5, "{place:?} is shifted by {shift} px");
        let (mut sums, mut weights) = ([[0.0; 2]; 2], [0.0; 2]);
        for y in 0..200 {
            for x in 0..200 {
                let center = [f64::from(x) + 0.5, f64::from(y) + 0.5];
                let near = center.iter().zip(want).all(|(a, b)| (a - b).abs() < 12.0);
                let seen =
                    [f64::from(u8::from(*instance.at(x, y) == InstanceId(number))), f64::from(light.at(x, y)[1])];
                for (i, seen) in seen.into_iter().enumerate().filter(|_| near) {
                    weights[i] += seen;
                    sums[i] = [sums[i][0] + seen * center[0], sums[i][1] + seen * center[1]];
                }
            }
        }
        for (sum, weight) in sums.iter().zip(weights) {
            let off = [0, 1].map(|i| (sum[i] / weight - want[i]).abs());
            assert!(weight > 9.0 && off.iter().all(|off| *off < 0.35), "{place:?}: off by {off:?} px");
        }
        let [x, y] = want.map(|x| x as u32);
        assert!((f64::from(*frame.get(DEPTH).expect("made").at(x, y)) - (4.0 - place[2])).abs() < 1e-4, "{place:?}");
    }
}

#[test]
fn lenses_give_the_same_bits_in_any_number_of_lanes() {
    let round = object("round", ball(0.3, 32), Material::plain("gray", [0.5; 3], 0.4));
    let floor = object("floor", sheet([2.0, 2.0]), matte(0.6));
    let scene = scene([body(&round, at(0.1, 0.0, 0.3), Role::Object), body(&floor, at(0.0, 0.0, 0.0), Role::Support)]);
    let light = SphereLight { center: Point3::new(0.5, 0.4, 2.0), radius: 0.2, radiance: [90.0; 3] };
    let lens = ThinLens { aperture_radius_m: 0.03, focus_distance_m: 3.5 };
    let view = through(from_above(37, 40.0, vec![Light::Sphere(light)]), Some(lens), Some(BARREL));
    let image = |portable: bool, threads: usize| {
        let renderer = CpuPathRenderer::new(options(5, 3));
        let mut session = if portable { renderer.session().portable() } else { renderer.session() };
        session.load(&scene, &Serial).expect("loads");
        let (mut frame, stream) = (Products::new(), Stream::root(3));
        let workers = Threads(threads);
        let request = RenderRequest::new(&view, &LIGHT, stream, &workers);
        session.render(&request, &mut frame).expect("renders");
        frame.get(RADIANCE).expect("made").data().iter().flatten().map(|x| x.to_bits()).collect::<Vec<_>>()
    };
    let eight = image(false, 1);
    assert!(eight == image(true, 1) && eight == image(false, 3));
}
