//! Windows of an image, and images of some of the bodies.

use super::images::{ALL, bits, busy_scene};
use super::support::*;
use std::sync::Arc;
use syntable_model::context::Serial;
use syntable_model::prelude::*;
use syntable_model::product::standard::*;
use syntable_model::product::{Lighting, Product as _};
use syntable_model::scene::{BodyDraft, Distortion, Intrinsics, Role, ThinLens};
use syntable_model::stage::{Atlas, Bodies, Window};
use syntable_testing::conformance;
use syntable_transport::{PathTracing, PixelFilter};

/// Products whose pixels do not depend on their neighbors.
const PIXELS: [KeyId; 7] = [
    RADIANCE.id(),
    RADIANCE_VARIANCE.id(),
    DEPTH.id(),
    INSTANCE.id(),
    COVERAGE.id(),
    COVERAGE_BEFORE_SUPPORT.id(),
    NORMAL.id(),
];

fn image(view: &View) -> Window {
    Window::of(&view.camera.intrinsics)
}

#[test]
fn the_renderer_conforms() {
    let (scene, view) = busy_scene();
    let renderer = syntable_render_cpu::CpuPathRenderer::new(options(2, 2));
    let request = RenderRequest::new(&view, &ALL, Stream::root(3), &Serial);
    conformance::renderer(&renderer, &scene, &request, &[&Serial, &Threads(2)]);
}

#[test]
fn windows_of_a_canvas_join_to_the_canvas() {
    let (scene, straight) = busy_scene();
    let mut curved = straight.clone();
    curved.camera.distortion = Some(Distortion::brown_conrady([-0.1, 0.02, 0.0], [1e-3, -2e-3]));
    curved.camera.lens = Some(ThinLens { aperture_radius_m: 0.01, focus_distance_m: 1.2 });
    for view in [straight, curved] {
        let canvas = Window::canvas(&view.camera.intrinsics, 3);
        assert_eq!((canvas.x, canvas.y, canvas.width, canvas.height), (-45, -37, 135, 111));
        let whole = render_part(options(3, 2), &scene, &view, &PIXELS, canvas, Bodies::All);
        // Aligned neither with tiles nor with each other.
        for (x, y, width, height) in
            [(0, 0, 45, 37), (-45, -37, 7, 9), (-20, 5, 31, 40), (44, 36, 46, 38), (3, -1, 1, 1)]
        {
            let window = Window { x, y, width, height };
            let part = render_part(options(3, 2), &scene, &view, &PIXELS, window, Bodies::All);
            for row in 0..height {
                for column in 0..width {
                    let (x, y) = ((x + 45) as u32 + column, (y + 37) as u32 + row);
                    macro_rules! same {
                        ($($key:ident),*) => {$({
                            let (part, whole) = (part.get($key).expect("made"), whole.get($key).expect("made"));
                            assert_eq!(part.at(column, row), whole.at(x, y), "{} at ({x}, {y}) of {window:?}", $key.name());
                        })*};
                    }
                    same!(RADIANCE, RADIANCE_VARIANCE, DEPTH, INSTANCE, NORMAL);
                    for key in [COVERAGE, COVERAGE_BEFORE_SUPPORT] {
                        let (part, whole) = (part.get(key).expect("made"), whole.get(key).expect("made"));
                        assert_eq!(part.set(column, row), whole.set(x, y), "({x}, {y})");
                    }
                }
            }
        }
    }
}

#[test]
fn a_canvas_is_the_image_of_a_larger_sensor() {
    let (scene, view) = busy_scene();
    let mut large = view.clone();
    let Intrinsics { width, height, cx, cy, .. } = view.camera.intrinsics;
    large.camera.intrinsics = Intrinsics {
        width: 3 * width,
        height: 3 * height,
        cx: cx + f64::from(width),
        cy: cy + f64::from(height),
        ..view.camera.intrinsics
    };
    let canvas = Window::canvas(&view.camera.intrinsics, 3);
    let canvas = render_part(options(1, 1), &scene, &view, &PIXELS, canvas, Bodies::All);
    let sensor = render(options(1, 1), &scene, &large, &PIXELS);
    // Rays differ in their last bits, so a few pixels may differ where a ray grazes an edge.
    let (a, b) = (canvas.get(INSTANCE).expect("made"), sensor.get(INSTANCE).expect("made"));
    let differ = a.data().iter().zip(b.data()).filter(|(a, b)| a != b).count();
    assert!(differ <= 3, "{differ} of {} ids differ", a.data().len());
    assert!(b.data().iter().any(|id| id.0 == 4) && b.data().iter().any(|id| id.0 == 0));
}

#[test]
fn bodies_alone_are_a_scene_of_their_own() {
    let shining = syntable_model::scene::Material {
        emission: syntable_model::scene::Color::constant([60.0; 3]),
        ..syntable_model::scene::Material::plain("globe", [0.8; 3], 0.6)
    };
    let (block, globe) =
        (object("block", cuboid([0.2, 0.15, 0.25]), matte(0.4)), object("globe", ball(0.1, 24), shining));
    let floor = object("floor", sheet([1.5, 1.5]), matte(0.7));
    let drafts = || -> [BodyDraft; 4] {
        [
            body(&block, at(-0.3, 0.1, 0.25), Role::Object),
            body(&globe, at(0.3, 0.0, 0.4), Role::Object),
            body(&block, at(0.4, 0.5, 0.25), Role::Object),
            body(&floor, at(0.0, 0.0, 0.0), Role::Support),
        ]
    };
    let (_, view) = busy_scene();
    let all = scene(drafts());
    for chosen in [vec![0, 3], vec![1, 2], vec![2], vec![0, 1, 2, 3]] {
        let ids: Vec<InstanceId> = chosen.iter().map(|&i: &usize| InstanceId(i as u16 + 1)).collect();
        let own: Arc<Scene> =
            scene(drafts().into_iter().enumerate().filter(|(i, _)| chosen.contains(i)).map(|(_, draft)| draft));
        let part = render_part(options(4, 3), &all, &view, &PIXELS, image(&view), Bodies::Only(&ids));
        let want = render(options(4, 3), &own, &view, &PIXELS);
        for key in [RADIANCE, NORMAL] {
            assert!(
                bits(part.get(key).expect("made")) == bits(want.get(key).expect("made")),
                "{} of {ids:?}",
                key.name()
            );
        }
        assert!(part.get(DEPTH).expect("made") == want.get(DEPTH).expect("made"));
        // Bodies keep their ids of the whole scene.
        let renumbered = want.get(INSTANCE).expect("made").map(|id| match id.0 {
            0 => InstanceId::BACKGROUND,
            id => ids[usize::from(id) - 1],
        });
        assert!(*part.get(INSTANCE).expect("made") == renumbered, "ids of {ids:?}");
    }
}

#[test]
fn an_object_seen_in_its_place_looks_as_in_the_whole_scene() {
    let (scene, view) = busy_scene();
    let whole = render(options(4, 3), &scene, &view, &PIXELS);
    let (seen, coverage) = (whole.get(INSTANCE).expect("made"), whole.get(COVERAGE).expect("made"));
    let (mut compared, mut uncovered) = (0, 0);
    for id in [2, 3, 4].map(InstanceId) {
        let alone = render_part(options(4, 3), &scene, &view, &PIXELS, image(&view), Bodies::Seen(&[id]));
        let (there, radiance) = (alone.get(INSTANCE).expect("made"), alone.get(RADIANCE).expect("made"));
        for y in 1..36 {
            for x in 1..44 {
                let around = || (y - 1..y + 2).flat_map(|y| (x - 1..x + 2).map(move |x| (x, y)));
                // Pixels around which every camera ray meets the body; the floor, which has no bit, is in front nowhere
                // else.
                if around().all(|(x, y)| *seen.at(x, y) == id) {
                    assert_eq!(
                        radiance.at(x, y),
                        whole.get(RADIANCE).expect("made").at(x, y),
                        "body {id} at ({x}, {y})"
                    );
                    compared += 1;
                }
                if id.0 < 4 {
                    assert_eq!(*there.at(x, y) == id, coverage.contains(x, y, id), "body {id} at ({x}, {y})");
                    uncovered += u32::from(*there.at(x, y) == id && *seen.at(x, y) != id);
                }
            }
        }
    }
    assert!(compared > 300 && uncovered > 5, "{compared} {uncovered}");
}

/// Products of one value per pixel.
const PLANES: [KeyId; 13] = [
    RADIANCE.id(),
    RADIANCE_VARIANCE.id(),
    OPACITY.id(),
    DEPTH.id(),
    INSTANCE.id(),
    NORMAL.id(),
    ALBEDO.id(),
    DENOISE_ALBEDO.id(),
    DENOISE_NORMAL.id(),
    RADIANCE_SPECULAR.id(),
    RADIANCE_SPECULAR_VARIANCE.id(),
    RADIANCE_DEMODULATED.id(),
    RADIANCE_DEMODULATED_VARIANCE.id(),
];

/// Each object of a view alone, in an atlas.
fn of_objects(scene: &Arc<Scene>, view: &View, wants: &[KeyId], lighting: Lighting) -> (Atlas, Products) {
    let coverage = render(options(1, 1), scene, view, &[COVERAGE.id()]);
    let atlas = Atlas::of(coverage.get(COVERAGE).expect("made"));
    let mut session = syntable_render_cpu::CpuPathRenderer::new(options(4, 3)).session();
    session.load(scene, &Serial).expect("loads");
    let mut frame = Products::new();
    let request = RenderRequest::new(view, wants, Stream::root(7), &Threads(2)).of_objects(&atlas, lighting);
    session.render(&request, &mut frame).expect("renders");
    (atlas, frame)
}

/// Rays of a pixel draw the same random numbers whatever they show, so parts agree with the image to the bit.
#[test]
fn foreground_and_furniture_are_parts_of_the_image() {
    let (scene, straight) = busy_scene();
    let mut curved = straight.clone();
    curved.camera.lens = Some(ThinLens { aperture_radius_m: 0.01, focus_distance_m: 1.2 });
    let first = scene.foreground().len();
    let furniture: Vec<InstanceId> = scene.bodies()[first..].iter().map(|body| body.id).collect();
    assert!(!furniture.is_empty());
    for view in [straight, curved] {
        let of = |bodies: Bodies, background: bool| {
            let mut session = syntable_render_cpu::CpuPathRenderer::new(options(4, 3)).session();
            session.load(&scene, &Serial).expect("loads");
            let request = RenderRequest::new(&view, &PLANES, Stream::root(7), &Threads(2)).of(image(&view), bodies);
            let mut products = Products::new();
            session.render(&RenderRequest { background, ..request }, &mut products).expect("renders");
            products
        };
        let (whole, front) = (of(Bodies::All, true), of(Bodies::Foreground, false));
        let behind = of(Bodies::Seen(&furniture), true);
        let light = [&whole, &front, &behind].map(|products| products.get(RADIANCE).expect("made"));
        let ids = [&whole, &front].map(|products| products.get(INSTANCE).expect("made"));
        let opacity = front.get(OPACITY).expect("made");
        let (mut covered, mut open, mut edges) = (0, 0, 0);
        for y in 0..opacity.height() {
            for x in 0..opacity.width() {
                let [whole, front, behind] = light.map(|plane| *plane.at(x, y));
                match *opacity.at(x, y) {
                    1.0 => {
                        assert_eq!(front, whole);
                        covered += 1;
                    }
                    0.0 => {
                        assert_eq!((front, behind), ([0.0; 3], whole));
                        open += 1;
                    }
                    _ => {
                        assert!((0..3).all(|c| front[c] <= whole[c]), "{front:?} {whole:?}");
                        edges += 1;
                    }
                }
                let [whole, front] = ids.map(|plane| *plane.at(x, y));
                let want = if usize::from(whole.0) <= first { whole } else { InstanceId::BACKGROUND };
                assert_eq!(front, want, "({x}, {y})");
            }
        }
        assert!(covered.min(open).min(edges) > 20, "{covered} {open} {edges}");
    }
}

#[test]
fn a_tile_is_the_window_of_its_object() {
    let (scene, straight) = busy_scene();
    let mut curved = straight.clone();
    curved.camera.distortion = Some(Distortion::brown_conrady([-0.1, 0.02, 0.0], [1e-3, -2e-3]));
    curved.camera.lens = Some(ThinLens { aperture_radius_m: 0.01, focus_distance_m: 1.2 });
    for (view, lighting) in [(&straight, Lighting::Alone), (&straight, Lighting::InScene), (&curved, Lighting::InScene)]
    {
        let (atlas, all) = of_objects(&scene, view, &PLANES, lighting);
        assert!(atlas.tiles.len() >= 3, "{atlas:?}");
        let mut outside = Plane::from_fn(atlas.size[0], atlas.size[1], |_, _| true);
        for tile in &atlas.tiles {
            let ids = [tile.id];
            let bodies = match lighting {
                Lighting::Alone => Bodies::Only(&ids),
                Lighting::InScene => Bodies::Seen(&ids),
            };
            let mut session = syntable_render_cpu::CpuPathRenderer::new(options(4, 3)).session();
            session.load(&scene, &Serial).expect("loads");
            let request = RenderRequest::new(view, &PLANES, Stream::root(7), &Serial).of(tile.window, bodies);
            let (mut shown, mut alone) = (Products::new(), Products::new());
            session.render(&request, &mut shown).expect("renders");
            session.render(&RenderRequest { background: false, ..request }, &mut alone).expect("renders");
            macro_rules! same {
                ($($key:ident),*) => {$({
                    let part = Atlas::cut(all.get($key).expect("made"), tile);
                    assert!(part.encode() == (*alone.get($key).expect("made")).encode(), "{} of {ids:?}", $key.name());
                })*};
            }
            same!(
                RADIANCE,
                RADIANCE_VARIANCE,
                OPACITY,
                DEPTH,
                INSTANCE,
                NORMAL,
                ALBEDO,
                DENOISE_ALBEDO,
                DENOISE_NORMAL
            );
            same!(RADIANCE_SPECULAR, RADIANCE_SPECULAR_VARIANCE, RADIANCE_DEMODULATED, RADIANCE_DEMODULATED_VARIANCE);
            // The background adds only lights and sky, and only around the object.
            let [with, without] = [&shown, &alone].map(|products| products.get(RADIANCE).expect("made"));
            let opacity = alone.get(OPACITY).expect("made");
            for ((with, without), opacity) in with.data().iter().zip(without.data()).zip(opacity.data()) {
                match *opacity {
                    1.0 => assert_eq!(with, without),
                    0.0 => assert_eq!(*without, [0.0; 3]),
                    _ => assert!((0..3).all(|c| with[c] >= without[c]), "{with:?} {without:?}"),
                }
            }
            let pixels = (0..tile.window.height).flat_map(|y| (0..tile.window.width).map(move |x| (x, y)));
            pixels.for_each(|(x, y)| {
                outside.data_mut()[((tile.at[1] + y) * atlas.size[0] + tile.at[0] + x) as usize] = false;
            });
        }
        let depth = all.get(DEPTH).expect("made");
        let radiance = all.get(RADIANCE).expect("made");
        for (pixel, _) in outside.data().iter().enumerate().filter(|(_, outside)| **outside) {
            assert_eq!((radiance.data()[pixel], depth.data()[pixel]), ([0.0; 3], f32::INFINITY));
        }
    }
}

#[test]
fn opacity_is_the_share_of_the_pixel_that_a_body_covers() {
    // The front of a block 1 m wide and high at a depth of 3.99 m; it is 10.25 px wide.
    let (half_px, width) = (5.125, 31);
    let block = object("block", cuboid([0.5, 0.01, 0.5]), matte(0.5));
    let scene = scene([body(&block, at(0.0, 0.0, 0.0), Role::Object)]);
    let view = view(width, width, half_px * 3.99 / 0.5, [0.0, -4.0, 0.0], [0.0; 3], vec![furnace()]);
    let boxed = PathTracing { pixel_filter: PixelFilter::Box, ..options(256, 1) };
    let frame = render(boxed, &scene, &view, &[OPACITY.id()]);
    let opacity = frame.get(OPACITY).expect("made");
    for y in 0..width {
        for x in 0..width {
            let covered = |i: u32| {
                let (left, right) = (f64::from(i) - 15.5, f64::from(i) - 14.5);
                (right.min(half_px) - left.max(-half_px)).clamp(0.0, 1.0)
            };
            let want = covered(x) * covered(y);
            let got = f64::from(*opacity.at(x, y));
            assert!((got - want).abs() < 0.05, "{got}, not {want}, at ({x}, {y})");
        }
    }
}

#[test]
fn a_body_that_is_not_there_is_an_error() {
    let (scene, view) = busy_scene();
    let mut session = syntable_render_cpu::CpuPathRenderer::new(options(1, 1)).session();
    session.load(&scene, &Serial).expect("loads");
    for id in [0, 5] {
        let request = RenderRequest::new(&view, &PIXELS, Stream::root(1), &Serial);
        let id = [InstanceId(id)];
        let request = request.of(image(&view), Bodies::Only(&id));
        let error = session.render(&request, &mut Products::new()).expect_err("no body");
        assert_eq!(error.to_string(), format!("unknown body {} to render", id[0]));
    }
}
