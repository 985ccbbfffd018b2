//! Labels of hand-made scenes, compared with closed forms and with casts of every object alone. The casts test
//! triangles in f64 and share no code with the tree.

use super::support::*;
use std::sync::Arc;
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::prelude::*;
use syntable_model::product::BitPlane;
use syntable_model::product::standard::*;
use syntable_model::scene::Role;
use syntable_model::stage::{Bodies, Window};
use syntable_transport::PathTracing;

const LABELS: [KeyId; 4] = [DEPTH.id(), INSTANCE.id(), COVERAGE.id(), COVERAGE_BEFORE_SUPPORT.id()];

/// Depth of the first triangle of each body on the ray through (u, v), in f64 (Möller and Trumbore). In all scenes
/// here, edges are at least 1e-6 away from the center ray of every pixel.
fn depths(scene: &Scene, view: &View, u: f64, v: f64) -> Vec<Option<f64>> {
    let pose = view.camera.world_from_camera;
    let (origin, direction) = (pose * Point3::origin(), pose * view.camera.intrinsics.unproject(u, v));
    let depth = |body: &syntable_model::scene::Body| {
        let mesh = &body.object.mesh;
        (0..mesh.data().triangles.len())
            .filter_map(|t| {
                let [a, b, c] = mesh.corners(t).map(|p| body.world_from_body * p);
                let (e1, e2) = (b - a, c - a);
                let p = direction.cross(&e2);
                let det = e1.dot(&p);
                let s = origin - a;
                let q = s.cross(&e1);
                let (u, v, t) = (s.dot(&p) / det, direction.dot(&q) / det, e2.dot(&q) / det);
                (det != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
            })
            .min_by(f64::total_cmp)
    };
    scene.bodies().iter().map(depth).collect()
}

/// Renders all labels and compares every pixel, also on a larger canvas, with the casts of single bodies.
fn check(scene: &Arc<Scene>, view: &View) -> Products {
    let frame = render(options(1, 1), scene, view, &LABELS);
    let (width, height) = (view.camera.intrinsics.width as i32, view.camera.intrinsics.height as i32);
    let objects = scene.objects().len();
    let canvas = canvas(scene, view);
    let (wide, wide_before) = (canvas.get(COVERAGE).expect("made"), canvas.get(COVERAGE_BEFORE_SUPPORT).expect("made"));
    for y in -height..2 * height {
        for x in -width..2 * width {
            let (column, row) = ((x + width) as u32, (y + height) as u32);
            let depths = depths(scene, view, f64::from(x) + 0.5, f64::from(y) + 0.5);
            let support = depths[scene.foreground().len()..].iter().flatten().fold(f64::INFINITY, |a, &b| a.min(b));
            let first =
                depths.iter().enumerate().filter_map(|(i, d)| Some((i, (*d)?))).min_by(|a, b| a.1.total_cmp(&b.1));
            for (i, depth) in depths[..objects].iter().enumerate() {
                let id = InstanceId(i as u16 + 1);
                assert_eq!(wide.contains(column, row, id), depth.is_some(), "object {id} at ({x}, {y})");
                let before = depth.is_some_and(|depth| depth < support);
                assert_eq!(wide_before.contains(column, row, id), before, "object {id} before supports at ({x}, {y})");
            }
            if (0..width).contains(&x) && (0..height).contains(&y) {
                let id = *frame.get(INSTANCE).expect("made").at(x as u32, y as u32);
                assert_eq!(id, InstanceId(first.map_or(0, |(i, _)| i as u16 + 1)), "({x}, {y})");
                let depth = f64::from(*frame.get(DEPTH).expect("made").at(x as u32, y as u32));
                let want = first.map_or(f64::INFINITY, |(_, depth)| depth);
                assert!(
                    depth == want || (depth - want).abs() < 2e-6 * want,
                    "depth at ({x}, {y}): {depth}, not {want}"
                );
                // A visible object always covers its pixel.
                if (1..=objects).contains(&usize::from(id.0)) {
                    let contains = |key: Key<BitPlane>| frame.get(key).expect("made").contains(x as u32, y as u32, id);
                    assert!(contains(COVERAGE) && contains(COVERAGE_BEFORE_SUPPORT));
                }
            }
        }
    }
    frame
}

/// Labels on a canvas three times as wide and high as the image.
fn canvas(scene: &Arc<Scene>, view: &View) -> Products {
    let window = Window::canvas(&view.camera.intrinsics, 3);
    render_part(options(1, 1), scene, view, &LABELS, window, Bodies::All)
}

fn floor() -> syntable_model::scene::BodyDraft {
    body(&object("floor", sheet([4.0, 4.0]), matte(0.5)), at(0.0, 0.0, 0.0), Role::Support)
}

#[test]
fn stacked_boxes_on_a_table() {
    let (large, small) =
        (object("large", cuboid([0.2, 0.2, 0.1]), matte(0.5)), object("small", cuboid([0.1, 0.1, 0.1]), matte(0.5)));
    let scene = scene([
        body(&large, at(0.0, 0.0, 0.1), Role::Object),
        body(&small, at(0.03, 0.02, 0.3), Role::Object),
        // Under the floor: the support hides it, but it still covers its pixels.
        body(&small, at(0.3, 0.3, -0.5), Role::Object),
        floor(),
    ]);
    let frame = check(&scene, &view(61, 47, 60.0, [0.5, -0.9, 0.8], [0.0, 0.0, 0.2], vec![]));
    let coverage = frame.get(COVERAGE).expect("made");
    let count =
        |id| (0..47).flat_map(|y| (0..61).map(move |x| (x, y))).filter(|&(x, y)| coverage.contains(x, y, id)).count();
    assert!(count(InstanceId(1)) > 200 && count(InstanceId(2)) > 80 && count(InstanceId(3)) > 5);
    let before = frame.get(COVERAGE_BEFORE_SUPPORT).expect("made");
    assert!((0..47).all(|y| (0..61).all(|x| !before.contains(x, y, InstanceId(3)))));
}

#[test]
fn a_distractor_hides_and_does_not_cut() {
    let (block, screen) =
        (object("block", cuboid([0.2, 0.2, 0.2]), matte(0.5)), object("screen", cuboid([0.3, 0.3, 0.02]), matte(0.5)));
    let bodies = |role| scene([body(&block, at(0.0, 0.0, 0.2), Role::Object), body(&screen, at(0.33, 0.0, 0.8), role)]);
    let seen = |role| {
        let view = view(41, 31, 30.0, [0.0, 0.0, 2.0], [0.0; 3], vec![]);
        let frame = check(&bodies(role), &view);
        let id = InstanceId(1);
        let pixels = (0..31).flat_map(|y| (0..41).map(move |x| (x, y))).collect::<Vec<_>>();
        let covered = |key: Key<BitPlane>| {
            let plane = frame.get(key).expect("made");
            pixels.iter().filter(|&&(x, y)| plane.contains(x, y, id)).count()
        };
        let visible = frame.get(INSTANCE).expect("made").data().iter().filter(|&&seen| seen == id).count();
        [visible, covered(COVERAGE), covered(COVERAGE_BEFORE_SUPPORT)]
    };
    let [visible, covered, before] = seen(Role::Distractor);
    assert!(0 < visible && visible < covered && before == covered, "{visible} {covered} {before}");
    assert_eq!(seen(Role::Support), [visible, covered, visible], "a support cuts");
}

#[test]
fn a_ring_of_occlusion() {
    // Three long bars, each on top of the next: no depth order explains it.
    let bar = object("bar", cuboid([0.5, 0.06, 0.02]), matte(0.5));
    let bars = (0..3).map(|i| {
        let turn = f64::from(i) * std::f64::consts::TAU / 3.0;
        let axis = Vector3::new(turn.cos(), turn.sin(), 0.0);
        let spin = syntable_model::geometry::UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
        // Tilted, so that one end is high and the other low.
        let tilt = spin * syntable_model::geometry::UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -0.25);
        let side = Vector3::new(-axis.y, axis.x, 0.0) * 0.2;
        let place = syntable_model::geometry::Translation3::from(side + Vector3::z() * 0.3);
        body(&bar, Pose::from_parts(place, tilt), Role::Object)
    });
    let scene = scene(bars.chain([floor()]));
    let frame = check(&scene, &view(64, 64, 60.0, [0.02, 0.03, 1.6], [0.0, 0.0, 0.3], vec![]));
    // Each hides a part of the next bar, and nothing of the previous one.
    let (seen, coverage) = (frame.get(INSTANCE).expect("made"), frame.get(COVERAGE).expect("made"));
    let hides = |a: u16, b: u16| {
        (0..64)
            .flat_map(|y| (0..64).map(move |x| (x, y)))
            .any(|(x, y)| *seen.at(x, y) == InstanceId(a) && coverage.contains(x, y, InstanceId(b)))
    };
    let order = [(1, 2), (2, 3), (3, 1)];
    let forwards = order.iter().all(|&(a, b)| hides(a, b) && !hides(b, a));
    let backwards = order.iter().all(|&(a, b)| hides(b, a) && !hides(a, b));
    assert!(forwards || backwards, "no ring");
}

#[test]
fn an_object_cut_by_the_frame() {
    let block = object("block", cuboid([0.2, 0.2, 0.2]), matte(0.5));
    let scene = scene([
        body(&block, at(0.9, 0.0, 0.2), Role::Object),
        // Completely outside the image, but within the wide canvas.
        body(&block, at(-2.0, 0.0, 0.2), Role::Object),
        floor(),
    ]);
    let view = view(33, 25, 30.0, [0.0, -0.2, 2.0], [0.0; 3], vec![]);
    check(&scene, &view);
    let canvas = canvas(&scene, &view);
    let wide = canvas.get(COVERAGE).expect("made");
    let count = |columns: std::ops::Range<u32>, id| {
        columns.flat_map(|x| (0..75).map(move |y| (x, y))).filter(|&(x, y)| wide.contains(x, y, id)).count()
    };
    assert!(count(33..66, InstanceId(1)) > 0 && count(66..99, InstanceId(1)) > 0);
    assert!(count(33..66, InstanceId(2)) == 0 && count(0..33, InstanceId(2)) > 0);
}

#[test]
fn more_objects_than_bits_of_a_word() {
    let block = object("block", cuboid([0.03, 0.03, 0.03]), matte(0.5));
    let blocks = (0..65)
        .map(|i| body(&block, at(f64::from(i % 9) * 0.1 - 0.4, f64::from(i / 9) * 0.1 - 0.35, 0.05), Role::Object));
    check(&scene(blocks.chain([floor()])), &view(40, 30, 32.0, [0.3, -0.8, 0.7], [0.0; 3], vec![]));
}

#[test]
fn depth_of_a_plane_is_its_closed_form() {
    let scene = scene([body(&object("wall", sheet([9.0, 9.0]), matte(0.5)), at(0.0, 0.0, 0.0), Role::Object)]);
    let (eye, target) = ([0.4, -1.3, 1.1], [0.1, 0.2, 0.0]);
    let view = view(50, 40, 45.0, eye, target, vec![]);
    let frame = render(options(1, 1), &scene, &view, &[DEPTH.id()]);
    for y in 0..40 {
        for x in 0..50 {
            let d = view.camera.world_from_camera
                * view.camera.intrinsics.unproject(f64::from(x) + 0.5, f64::from(y) + 0.5);
            let want = -eye[2] / d.z;
            let got = f64::from(*frame.get(DEPTH).expect("made").at(x, y));
            assert!((got - want).abs() < 1e-6 * want, "({x}, {y}): {got}, not {want}");
        }
    }
}

#[test]
fn a_point_is_seen_in_the_pixel_that_it_projects_to() {
    let mut view = view(64, 48, 50.0, [0.5, -1.0, 1.0], [0.0; 3], vec![]);
    view.camera.intrinsics =
        syntable_model::scene::Intrinsics { fx: 47.3, fy: 52.9, cx: 30.2, cy: 25.7, ..view.camera.intrinsics };
    for p in [[0.0, 0.0, 0.1], [0.21, -0.13, 0.3], [-0.3, 0.2, 0.05]] {
        let dot = object("dot", cuboid([0.004; 3]), matte(0.5));
        let scene = scene([body(&dot, at(p[0], p[1], p[2]), Role::Object)]);
        let camera = &view.camera;
        let [u, v] = camera.intrinsics.project(&(camera.world_from_camera.inverse() * Point3::from(p)));
        // Shifted so that the pixel's center meets it.
        let (x, y) = (u.floor(), v.floor());
        let mut shifted = view.clone();
        shifted.camera.intrinsics.cx += x + 0.5 - u;
        shifted.camera.intrinsics.cy += y + 0.5 - v;
        let frame = render(options(1, 1), &scene, &shifted, &[INSTANCE.id()]);
        let plane = frame.get(INSTANCE).expect("made");
        let seen: Vec<(u32, u32)> =
            (0..48).flat_map(|y| (0..64).map(move |x| (x, y))).filter(|&(x, y)| plane.at(x, y).0 == 1).collect();
        assert_eq!(seen, [(x as u32, y as u32)], "{p:?}");
    }
}

#[test]
fn of_surfaces_at_the_same_depth_the_object_is_in_front() {
    // A sheet lies exactly on the table: it is visible, covers its pixels, and is before the support.
    let paper = object("paper", sheet([0.2, 0.2]), matte(0.5));
    let scene = scene([body(&paper, at(0.0, 0.0, 0.0), Role::Object), floor()]);
    let view = view(16, 16, 30.0, [0.0, 0.0, 1.0], [0.0; 3], vec![]);
    let frame = render(options(1, 1), &scene, &view, &LABELS);
    let seen = frame.get(INSTANCE).expect("made");
    let mut count = 0;
    for y in 0..16 {
        for x in 0..16 {
            let covered = frame.get(COVERAGE).expect("made").contains(x, y, InstanceId(1));
            let before = frame.get(COVERAGE_BEFORE_SUPPORT).expect("made").contains(x, y, InstanceId(1));
            let visible = seen.at(x, y).0 == 1;
            assert!(!visible || (covered && before), "({x}, {y})");
            count += usize::from(covered);
        }
    }
    assert!(count > 100);
}

#[test]
fn thin_glass_is_a_body_unless_labels_go_by_coverage() {
    use syntable_model::scene::{Alpha, Material};
    use syntable_prepare::labels::BlendedLabels;
    let pane = Material { alpha: Alpha::Blend { factor: 0.3 }, ..matte(1.0) };
    let pane = object("pane", sheet([0.4, 0.4]), pane);
    let block = object("block", cuboid([0.3, 0.3, 0.1]), matte(0.5));
    let scene =
        scene([body(&pane, at(0.0, 0.0, 0.5), Role::Object), body(&block, at(0.0, 0.0, 0.1), Role::Object), floor()]);
    let view = view(20, 20, 20.0, [0.0, 0.0, 1.5], [0.0; 3], vec![]);
    for (blended_labels, seen, covered) in [(BlendedLabels::Shape, 1, true), (BlendedLabels::Coverage, 2, false)] {
        let frame = render(PathTracing { blended_labels, ..options(1, 1) }, &scene, &view, &LABELS);
        assert_eq!(frame.get(INSTANCE).expect("made").at(10, 10).0, seen, "{blended_labels:?}");
        let coverage = frame.get(COVERAGE).expect("made");
        assert_eq!(coverage.contains(10, 10, InstanceId(1)), covered, "{blended_labels:?}");
        assert!(coverage.contains(10, 10, InstanceId(2)));
    }
}

/// An image of 8 × 8 texels in columns of one color.
fn columns(texel: impl Fn(u32) -> [u8; 4]) -> Arc<syntable_model::scene::Texture> {
    use syntable_model::scene::{Encoding, Texture, Wrap};
    let texels: Vec<u8> = (0..64).flat_map(|i| texel(i % 8)).collect();
    let digest = syntable_model::digest::Digest::of(&texels);
    Arc::new(Texture { width: 8, height: 8, texels, encoding: Encoding::Linear, wrap: [Wrap::Clamp; 2], digest })
}

/// Glass in front of an object, seen from straight above: a pane at 0.5 m, whose right quarter is opaque, over a block
/// that ends at 0.2 m, over the floor. The camera is at 1.5 m, so depths are 1, 1.3 and 1.5 m.
#[test]
fn of_glass_before_an_object_the_surface_counts_that_the_option_says() {
    use syntable_model::scene::{Scalar, Transmission};
    use syntable_prepare::labels::BlendedLabels;
    let texture = columns(|column| [if column < 6 { 255 } else { 0 }, 0, 0, 255]);
    let passing = |factor: f32, is_textured: bool| {
        let fraction = match is_textured {
            true => Scalar { factor, texture: Some((Arc::clone(&texture).into(), 0)) },
            false => Scalar::constant(factor),
        };
        Some(Transmission { fraction, volume: None })
    };
    let view = view(20, 20, 20.0, [0.0, 0.0, 1.5], [0.0; 3], vec![]);
    let (block_alone, both) = ([2_u16].as_slice(), [1_u16, 2].as_slice());
    // Transmission, metallic, texture, the policy; the visible bodies at columns 6 and 16 of row 10, their depths, and
    // the bodies that cover column 6.
    let (first, opaque) = (BlendedLabels::Shape, BlendedLabels::Opaque);
    for (fraction, metallic, is_textured, policy, seen, depths, covering) in [
        (1.0, 0.0, true, first, [1, 1], [1.0, 1.0], both),
        (1.0, 0.0, true, BlendedLabels::Coverage, [1, 1], [1.0, 1.0], both),
        (1.0, 0.0, true, opaque, [2, 1], [1.3, 1.0], block_alone),
        // A transmission of one half counts as glass; less does not, and neither does metal.
        (0.5, 0.0, false, opaque, [2, 3], [1.3, 1.5], block_alone),
        (0.49, 0.0, false, opaque, [1, 1], [1.0, 1.0], both),
        (1.0, 1.0, false, opaque, [1, 1], [1.0, 1.0], both),
    ] {
        let material = syntable_model::scene::Material {
            transmission: passing(fraction, is_textured),
            metallic: Scalar::constant(metallic),
            ..matte(1.0)
        };
        let pane = object("pane", sheet([0.4, 0.4]), material);
        let block = object("block", cuboid([0.2, 0.3, 0.1]), matte(0.5));
        let at_heights =
            [body(&pane, at(0.0, 0.0, 0.5), Role::Object), body(&block, at(-0.1, 0.0, 0.1), Role::Object), floor()];
        let options = PathTracing { blended_labels: policy, ..options(1, 1) };
        let frame = render(options, &scene(at_heights), &view, &LABELS);
        let what = format!("{fraction} {metallic} {policy:?}");
        let instance = frame.get(INSTANCE).expect("made");
        assert_eq!([6, 16].map(|x| instance.at(x, 10).0), seen, "{what}");
        let depth = frame.get(DEPTH).expect("made");
        let got = [6, 16].map(|x| f64::from(*depth.at(x, 10)));
        assert!(got.iter().zip(depths).all(|(got, want): (&f64, f64)| (got - want).abs() < 1e-5), "{what}: {got:?}");
        let coverage = frame.get(COVERAGE).expect("made");
        let covers: Vec<u16> = (1..=2).filter(|id| coverage.contains(6, 10, InstanceId(*id))).collect();
        assert_eq!(covers, covering, "{what}");
        // A visible object always covers its pixel.
        for (x, y) in (0..20).flat_map(|y| (0..20).map(move |x| (x, y))) {
            let id = *instance.at(x, y);
            assert!(id.0 == 3 || id.0 == 0 || coverage.contains(x, y, id), "{what}: ({x}, {y})");
        }
    }
}

#[test]
fn holes_are_no_surface_for_labels() {
    use syntable_model::scene::{Alpha, Color, Material};
    // The left half of the sheet is cut out.
    let texture = columns(|column| [255, 255, 255, if column < 4 { 0 } else { 255 }]);
    let material = Material { alpha: Alpha::Mask { cutoff: 0.5 }, base_color: Color::texture(texture), ..matte(1.0) };
    let paper = object("paper", sheet([0.4, 0.4]), material);
    let block = object("block", cuboid([0.3, 0.3, 0.1]), matte(0.5));
    let scene =
        scene([body(&paper, at(0.0, 0.0, 0.5), Role::Object), body(&block, at(0.0, 0.0, 0.1), Role::Object), floor()]);
    let view = view(20, 20, 20.0, [0.0, 0.0, 1.5], [0.0; 3], vec![]);
    let frame = render(options(1, 1), &scene, &view, &LABELS);
    let (seen, coverage) = (frame.get(INSTANCE).expect("made"), frame.get(COVERAGE).expect("made"));
    // Row 10: the sheet spans x = 2..18, its left half is a hole that shows the block behind.
    assert_eq!((seen.at(6, 10).0, seen.at(13, 10).0), (2, 1));
    assert!(!coverage.contains(6, 10, InstanceId(1)) && coverage.contains(13, 10, InstanceId(1)));
    assert!(coverage.contains(13, 10, InstanceId(2)));
    assert!((f64::from(*frame.get(DEPTH).expect("made").at(13, 10)) - 1.0).abs() < 1e-6);
}
