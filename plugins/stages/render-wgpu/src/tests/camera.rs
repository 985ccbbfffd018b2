//! Rays of cameras, and the numbers of samples.

use super::{call, compare, session, show, show_request};
use crate::device::Variant;
use syntable_model::prelude::*;
use syntable_model::product::standard::DEPTH;
use syntable_model::scene::Distortion;
use syntable_model::stage::{Bodies, Window};
use syntable_prepare::SampleOrder;
use syntable_simd::Vec3;
use syntable_testing::scenes;
use syntable_testing::workers::Threads;
use syntable_transport::{PathTracing, RayCamera};

const SIZE: [u32; 2] = [31, 23];

#[test]
fn rays_and_samples_of_pixels_are_the_cpus() {
    let Some(mut session) = session() else { return };
    let scene = scenes::boxes(&[([0.0, 0.0, 0.1], [0.2; 3])]);
    session.load(&scene, &Threads(2)).expect("loads");
    let straight = scenes::view([0.3, -1.0, 0.8], [0.0; 3], SIZE, 60.0);
    let mut curved = straight.clone();
    curved.camera.distortion = Some(Distortion::brown_conrady([-0.2, 0.05, 0.0], [1e-3, -2e-3]));
    // Inside the image, and beyond all of its edges.
    let whole_image = Window { x: 0, y: 0, width: SIZE[0], height: SIZE[1] };
    let around = Window { x: -300, y: -9, width: 340, height: 60 };
    let mut random = Stream::root(5);
    for (view, window) in [(&straight, whole_image), (&straight, around), (&curved, whole_image), (&curved, around)] {
        let wants = [DEPTH.id()];
        let request = RenderRequest::new(view, &wants, Stream::root(3), &Threads(2)).of(window, Bodies::All);
        show_request(&mut session, &request);
        let rows: Vec<[f32; 5]> = (0..4000)
            .map(|_| {
                let [column, row] = [window.width, window.height].map(|size| random.below(size.into()) as f32);
                [column, row, random.below(64) as f32, random.unit() as f32, random.unit() as f32]
            })
            .collect();
        let pixel = |number: usize| {
            let [column, row, ..] = rows[number];
            [column as i32 + window.x, row as i32 + window.y]
        };
        let camera = RayCamera::new(&view.camera, window);

        let statements = "let c = u(); let r = u(); let d = center_direction(c, r); put3(d); put3(to_camera(d));";
        let centers = call(&mut session, statements, Variant::default(), &rows);
        let center = |number: usize| {
            let [x, y] = pixel(number).map(|place| f64::from(place) + 0.5);
            let d = camera.ray(x, y).map_or(Vec3::ZERO, |ray| Vec3::from(ray.direction));
            let [a, b, c] = d.array();
            let [e, f, g] = camera.rotate_to_camera(d).array();
            [a, b, c, e, f, g]
        };
        compare("directions of centers", &centers, center, [2e-6, 2e-6], 100_000);

        let samples = call(
            &mut session,
            "let c = u(); let r = u(); let s = sampler_of(c, r, u()); put_u(s.seed); put_u(s.index);",
            Variant::default(),
            &rows,
        );
        let order = SampleOrder::new(request.stream.seed(), PathTracing::default().samples_per_pixel);
        for (number, sample) in samples.iter().enumerate() {
            let [x, y] = pixel(number).map(|place| place as u32);
            let (seed, first) = order.pixel(x, y);
            assert_eq!(*sample, [seed, first + rows[number][2] as u32], "pixel {:?}", pixel(number));
        }

        if !camera.is_warped() {
            continue;
        }
        let statements = "let c = u(); let r = u(); f(); put3(warped_direction(c, r, v2()));";
        let warped = call(&mut session, statements, Variant::default(), &rows);
        let wanted = |number: usize| {
            let ([x, y], [.., u, v]) = (pixel(number), rows[number]);
            camera.warped(x, y, [u, v]).unwrap_or(Vec3::ZERO).array()
        };
        compare("distorted directions", &warped, wanted, [2e-6, 2e-6], 100_000);
    }
}

#[test]
fn the_position_in_a_pixel_matches_the_tent() {
    let Some(mut session) = session() else { return };
    show(&mut session, &scenes::boxes(&[([0.0; 3], [0.2; 3])]), &scenes::view([0.0, -2.0, 1.0], [0.0; 3], SIZE, 60.0));
    let rows: Vec<[f32; 1]> = (0..=1000).map(|i| [(i as f32 / 1000.0).min(0.999_999_94)]).collect();
    let places: Vec<[u32; 1]> = call(&mut session, "put(tent(f()));", Variant::default(), &rows);
    // Integral of a density that falls linearly to 0 one pixel from the center.
    let below = |x: f32| match x - 0.5 {
        x if x < 0.0 => 0.5 * (1.0 + x) * (1.0 + x),
        x => 1.0 - 0.5 * (1.0 - x) * (1.0 - x),
    };
    let integrals: Vec<[u32; 1]> = places.iter().map(|[x]| [below(f32::from_bits(*x)).to_bits()]).collect();
    compare("tent", &integrals, |number| rows[number], [1e-6, 1e-6], 100_000);
}
