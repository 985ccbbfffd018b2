//! Windows of an image, and renderings of some of the bodies.

use super::images::{ALL, bits, busy_scene};
use super::support::*;
use std::sync::Arc;
use syntable_model::context::Serial;
use syntable_model::prelude::*;
use syntable_model::product::standard::*;
use syntable_model::scene::{BodyDraft, Distortion, Intrinsics, Role, ThinLens};
use syntable_model::stage::{Bodies, Window};
use syntable_testing::conformance;

/// Products whose pixels depend on nothing around them.
const PIXELS: [KeyId; 7] = [
    RADIANCE.id(),
    RADIANCE_VARIANCE.id(),
    DEPTH.id(),
    INSTANCE.id(),
    COVERAGE.id(),
    COVERAGE.before_support().id(),
    NORMAL.id(),
];

fn image(view: &View) -> Window {
    Window::of(&view.camera.intrinsics)
}

#[test]
fn the_renderer_conforms() {
    let (scene, view) = busy_scene();
    let renderer = crate::CpuPathRenderer::new(options(2, 2));
    let request = RenderRequest::new(&view, &ALL, Stream::root(3), &Serial);
    conformance::renderer(&renderer, &scene, &request, &[&Serial, &Threads(2)]);
}

#[test]
fn windows_of_a_canvas_join_to_the_canvas() {
    let (scene, straight) = busy_scene();
    let mut curved = straight.clone();
    curved.camera.distortion = Some(Distortion { radial: [-0.1, 0.02, 0.0], tangential: [1e-3, -2e-3] });
    curved.camera.lens = Some(ThinLens { aperture_radius_m: 0.01, focus_distance_m: 1.2 });
    for view in [straight, curved] {
        let canvas = Window::canvas(&view.camera.intrinsics, 3);
        assert_eq!((canvas.x, canvas.y, canvas.width, canvas.height), (-45, -37, 135, 111));
        let whole = render_part(options(3, 2), &scene, &view, &PIXELS, canvas, Bodies::All);
        // Neither aligned with tiles nor with one another.
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
                    for key in [COVERAGE, COVERAGE.before_support()] {
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
    // Rays differ in their last bits, so pixels may differ where one grazes an edge.
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
        // Bodies keep the ids that they have in the whole scene.
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
                // Pixels that no ray of the camera leaves the body in; the floor, which has no bit, is in front nowhere else.
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

#[test]
fn a_body_that_is_not_there_is_an_error() {
    let (scene, view) = busy_scene();
    let mut session = crate::CpuPathRenderer::new(options(1, 1)).session();
    session.load(&scene, &Serial).expect("loads");
    for id in [0, 5] {
        let request = RenderRequest::new(&view, &PIXELS, Stream::root(1), &Serial);
        let request = RenderRequest { bodies: Bodies::Only(&[InstanceId(id)]), ..request };
        let error = session.render(&request, &mut Products::new()).expect_err("no body");
        assert_eq!(error.to_string(), format!("there is no body {id} to render"));
    }
}
