//! Annotations of points, of fractions of pixels and of materials, compared with numbers worked out by hand.

use crate::common::{World, annotator, stage};
use serde_json::{Value as Json, json};
use std::sync::Arc;
use syntable_model::digest::Digest;
use syntable_model::geometry::{Point3, UnitQuaternion, Vector3};
use syntable_model::prelude::*;
use syntable_model::product::standard::*;
use syntable_model::product::{BitPlane, ObjectImages};
use syntable_model::registry::Stage;
use syntable_model::scene::{
    Camera, Distortion, Encoding, Intrinsics, Keypoint, Material, Mesh, MeshData, Object, Scalar, Texture,
    Transmission, ViewId, Wrap,
};

fn json(products: &Products, name: &str) -> Json {
    serde_json::to_value(products.value(name).expect("made")).expect("JSON")
}

// ---- Soft masks --------------------------------------------------------------------------------

const SIZE: [u32; 2] = [16, 12];

/// Products of an image in which object 1 is in front of object 2, each where a function of (u, v) is true.
fn in_subpixels(subpixels: u32, front: impl Fn(f64, f64) -> bool, back: impl Fn(f64, f64) -> bool) -> Products {
    let [width, height] = SIZE.map(|edge| edge * subpixels);
    let at = |x: u32| (f64::from(x) + 0.5) / f64::from(subpixels);
    let instance = Plane::from_fn(width, height, |x, y| {
        InstanceId(if front(at(x), at(y)) { 1 } else { 2 * u16::from(back(at(x), at(y))) })
    });
    let mut coverage = BitPlane::new(width, height, 2);
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        if front(at(x), at(y)) {
            coverage.insert(x, y, InstanceId(1));
        }
        if back(at(x), at(y)) {
            coverage.insert(x, y, InstanceId(2));
        }
    }
    let mut products = Products::new();
    let annotated = [1, 2].map(|id| (InstanceId(id), Mask::empty(SIZE[0], SIZE[1])));
    products.put(AMODAL_MASK, annotated.into_iter().collect()).expect("first");
    products.put(INSTANCE.in_subpixels(subpixels), instance).expect("first");
    products.put(COVERAGE.in_subpixels(subpixels), coverage).expect("first");
    annotator("soft_masks", &format!("subpixels = {subpixels}"))
        .annotate(&World::new(2).of_view(), &mut products)
        .expect("annotated");
    products
}

/// Area of a disk within the pixel at column x of row y: chords, clipped and integrated.
fn disk_area([cx, cy, r]: [f64; 3], x: u32, y: u32) -> f64 {
    const STEPS: u32 = 2000;
    let [left, top] = [f64::from(x), f64::from(y)];
    let chord = |i: u32| {
        let u = left + (f64::from(i) + 0.5) / f64::from(STEPS);
        let half = (r * r - (u - cx) * (u - cx)).max(0.0).sqrt();
        ((cy + half).min(top + 1.0) - (cy - half).max(top)).max(0.0)
    };
    (0..STEPS).map(chord).sum::<f64>() / f64::from(STEPS)
}

#[test]
fn soft_masks_are_the_areas_of_disks() {
    let disk = [7.3, 5.8, 4.1];
    let within = move |u: f64, v: f64| (u - disk[0]).powi(2) + (v - disk[1]).powi(2) < disk[2] * disk[2];
    for (subpixels, worst) in [(2, 0.26), (4, 0.13), (8, 0.07)] {
        let products = in_subpixels(subpixels, |_, _| false, within);
        let mask = products.get(VISIBLE_SOFT_MASK).expect("made").whole(InstanceId(2)).expect("annotated");
        assert_eq!([mask.width(), mask.height()], SIZE);
        for (x, y) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))) {
            let (found, area) = (f64::from(*mask.at(x, y)), disk_area(disk, x, y));
            assert!((found - area).abs() < worst, "{subpixels}: {found} of pixel {x}, {y}, not {area}");
        }
        let area: f32 = mask.data().iter().sum();
        // The number of centers of squares in a disk of R squares differs from its area by a small multiple of the root
        // of R.
        let (fine, squares) = (disk[2] * f64::from(subpixels), f64::from(subpixels).powi(2));
        let error = f64::from(area) * squares - std::f64::consts::PI * fine * fine;
        assert!(error.abs() < 3.0 * fine.sqrt(), "{subpixels}: {error} sub-pixels");
    }
}

#[test]
fn soft_masks_of_rectangles_on_the_grid_are_exact() {
    // Object 1 is 2.25 to 5.5 px wide, 3 to 4.75 px high; object 2 is behind all of it and extends farther to the
    // right.
    let front = |u: f64, v: f64| (2.25..5.5).contains(&u) && (3.0..4.75).contains(&v);
    let back = |u: f64, v: f64| (4.0..9.75).contains(&u) && (2.5..4.75).contains(&v);
    let products = in_subpixels(4, front, back);
    let share = |key: Key<ObjectImages<f32>>, id: u16, x: u32, y: u32| {
        *products.get(key).expect("made").whole(InstanceId(id)).expect("annotated").at(x, y)
    };
    let both = |id: u16, x: u32, y: u32| [share(VISIBLE_SOFT_MASK, id, x, y), share(AMODAL_SOFT_MASK, id, x, y)];
    assert_eq!(both(1, 2, 3), [0.75; 2]);
    assert_eq!(both(1, 5, 4), [0.375; 2]);
    assert_eq!(both(1, 6, 3), [0.0; 2]);
    // Half of the pixel's columns show object 1 in front of object 2; both end at 4.75.
    assert_eq!(both(2, 5, 4), [0.375, 0.75]);
    assert_eq!(both(2, 4, 2), [0.5; 2]);
    assert_eq!(both(2, 9, 3), [0.75; 2]);
}

// ---- Flow --------------------------------------------------------------------------------------

const CAMERA: Intrinsics = Intrinsics { width: 40, height: 30, fx: 50.0, fy: 60.0, cx: 20.5, cy: 14.0 };

/// Flow and its visibility from a camera at the origin to another camera.
fn flow(depth: &Plane<f32>, next: Option<(Camera, Plane<f32>)>) -> (Plane<[f32; 2]>, Plane<u8>) {
    let mut world = World::new(1);
    world.view.camera = Camera::pinhole(CAMERA, Pose::identity());
    let mut products = Products::new();
    products.put(DEPTH, depth.clone()).expect("first");
    let (view, next_depth) = match next {
        Some((camera, depth)) => (Some(View { id: ViewId(3), camera, ..world.view.clone() }), depth),
        None => (None, depth.clone()),
    };
    products.put(DEPTH.of_next_view(), next_depth).expect("first");
    products.put(INSTANCE, depth.map(|_| InstanceId(1))).expect("first");
    let cx = world.of_view().before(view.as_ref());
    annotator("optical_flow", "").annotate(&cx, &mut products).expect("annotated");
    (products.get(FLOW).expect("made").clone(), products.get(FLOW_VISIBILITY).expect("made").clone())
}

fn plane(depth: f32) -> Plane<f32> {
    Plane::from_fn(CAMERA.width, CAMERA.height, |_, _| depth)
}

#[test]
fn flow_of_a_camera_that_moves_sideways_is_the_disparity() {
    // f t / z = 50 · 0.1 / 2 = 2.5 px to the left; the two columns and a half at the left leave the image.
    let camera = Camera::pinhole(CAMERA, Pose::translation(0.1, 0.0, 0.0));
    let (found, seen) = flow(&plane(2.0), Some((camera, plane(2.0))));
    for (x, y) in (0..CAMERA.height).flat_map(|y| (0..CAMERA.width).map(move |x| (x, y))) {
        let [u, v] = *found.at(x, y);
        assert!((u + 2.5).abs() < 1e-5 && v.abs() < 1e-5, "{u} {v}");
        assert_eq!(*seen.at(x, y), if x < 2 { 0 } else { 2 }, "{x}");
    }
    // In the next view, a surface is in front of columns 10 to 19. Pixel x is at x + 0.5 − 2.5 = x − 2, between the
    // centers of columns x − 3 and x − 2: both show the surface for x − 3 ≥ 10 and x − 2 ≤ 19.
    let blocked = Plane::from_fn(40, 30, |x, _| if (10..20).contains(&x) { 1.0 } else { 2.0 });
    let (_, seen) = flow(&plane(2.0), Some((camera, blocked)));
    for x in 2..40 {
        assert_eq!(*seen.at(x, 7), if (13..=21).contains(&x) { 1 } else { 2 }, "{x}");
    }
}

#[test]
fn flow_of_other_motions() {
    // Half the distance to a wall: the image grows to twice its size about the principal point.
    let nearer = Camera::pinhole(CAMERA, Pose::translation(0.0, 0.0, 1.0));
    let (found, _) = flow(&plane(2.0), Some((nearer, plane(1.0))));
    assert!((found.at(30, 20)[0] - (30.5 - 20.5)).abs() < 1e-5 && (found.at(30, 20)[1] - (20.5 - 14.0)).abs() < 1e-5);
    // Rotated about the optical axis, clockwise as seen by the camera (x to y): the image rotates the other way.
    let quarter = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
    let turned = Camera::pinhole(CAMERA, Pose::from_parts(Vector3::zeros().into(), quarter));
    let (found, seen) = flow(&plane(2.0), Some((turned, plane(2.0))));
    // (x, y) / z of the pixel is (0.1, 0.05); in the turned frame (0.05, −0.1).
    let (x, y) = (25, 16);
    let [a, b] = [(25.5 - 20.5) / 50.0, (16.5 - 14.0) / 60.0];
    let expected = [50.0 * b + 20.5 - 25.5, 60.0 * -a + 14.0 - 16.5];
    assert!((0..2).all(|axis| (f64::from(found.at(x, y)[axis]) - expected[axis]).abs() < 1e-5));
    assert_eq!(*seen.at(x, y), 2);
    // Beyond the wall, looking back, or with an empty image: no displacement.
    let behind = Camera::pinhole(CAMERA, Pose::translation(0.0, 0.0, 3.0));
    for (depth, next) in [(2.0, Some((behind, plane(2.0)))), (f32::INFINITY, Some((nearer, plane(1.0)))), (2.0, None)] {
        let (found, seen) = flow(&plane(depth), next);
        assert!(found.data().iter().all(|flow| *flow == [0.0; 2]) && seen.data().iter().all(|seen| *seen == 0));
    }
}

// ---- Keypoints ---------------------------------------------------------------------------------

#[test]
fn keypoints_are_projected_and_hidden_by_depth() {
    let point = |name: &str, point: [f64; 3]| Keypoint { name: name.into(), point: point.into() };
    let object = World::tetrahedron().with_keypoints(vec![
        point("up", [0.0, 0.0, 0.1]),
        point("near", [0.1, 0.0, 0.0]),
        point("outside", [0.0, 5.0, 0.0]),
        point("behind", [9.0, 0.0, 0.0]),
    ]);
    assert_ne!(object.digest, World::tetrahedron().digest);
    let mut world = World::of(object, 1);
    // A camera 1 m from the origin of object 1 along x, looking back, upright.
    let body = world.scene.objects()[0].world_from_body;
    let look = syntable_model::geometry::look_at(
        Point3::from(body.translation.vector + Vector3::new(1.0, 0.0, 0.0)),
        Point3::from(body.translation.vector),
        Vector3::z(),
    );
    world.view.camera = Camera::pinhole(CAMERA, look);
    let mut products = Products::new();
    products.put(AMODAL_MASK, [(InstanceId(1), Mask::empty(40, 30))].into_iter().collect()).expect("first");
    // A wall at 0.88 m: 0.12 m in front of the first point and 0.02 m in front of the second.
    products.put(DEPTH, plane(0.88)).expect("first");
    annotator("keypoints", "tolerance_m = 0.015").annotate(&world.of_view(), &mut products).expect("annotated");
    let found = json(&products, "keypoints");
    let points = found["1"].as_array().expect("points");
    let names: Vec<&str> = points.iter().map(|point| point["name"].as_str().expect("a name")).collect();
    assert_eq!(names, ["up", "near", "outside", "behind"]);
    let number = |json: &Json| json.as_f64().expect("a number");
    // 0.1 m up at 1 m: 60 · 0.1 = 6 px above the principal point.
    assert!(
        (number(&points[0]["uv_px"][0]) - 20.5).abs() < 1e-9 && (number(&points[0]["uv_px"][1]) - 8.0).abs() < 1e-9
    );
    assert!((number(&points[0]["depth_m"]) - 1.0).abs() < 1e-12);
    assert!((number(&points[1]["depth_m"]) - 0.9).abs() < 1e-12);
    let seen: Vec<&Json> = points.iter().map(|point| &point["visibility"]).collect();
    assert_eq!(seen, [&json!(1), &json!(1), &json!(0), &json!(0)]);
    assert_eq!(points[3]["uv_px"], Json::Null);
    assert!(number(&points[2]["uv_px"][0]).abs() > 40.0);
    // Within the tolerance.
    let mut products = products.only(&["amodal_mask", "depth"]);
    annotator("keypoints", "tolerance_m = 0.03").annotate(&world.of_view(), &mut products).expect("annotated");
    assert_eq!(json(&products, "keypoints")["1"][1]["visibility"], json!(2));
    // A lens that folds: a point beyond the fold is projected into the image, but is not visible there.
    world.view.camera.distortion = Some(Distortion::brown_conrady([-0.05, 0.0, 0.0], [0.0; 2]));
    let mut products = products.only(&["amodal_mask", "depth"]);
    annotator("keypoints", "").annotate(&world.of_view(), &mut products).expect("annotated");
    assert_eq!(json(&products, "keypoints")["1"][2]["uv_px"], Json::Null);
}

#[test]
fn keypoints_move_with_their_object() {
    let keypoints = vec![Keypoint { name: "tip".into(), point: Point3::new(0.0, 0.0, 0.1) }];
    let object = World::tetrahedron().with_keypoints(keypoints);
    let moved = object.transformed(Vector3::new(0.1, 0.0, -0.05), 2.0).expect("sound");
    assert!((moved.keypoints[0].point - Point3::new(0.2, 0.0, 0.1)).norm() < 1e-12);
}

// ---- Materials ---------------------------------------------------------------------------------

/// A square of 1 m² with uv over the unit square, its left half slot 0 and its right half, twice as wide, slot 1.
fn quads() -> MeshData {
    let corner = |x: f32, y: f32| [x, y, 0.0];
    MeshData {
        positions: [0.0, 1.0, 1.0, 3.0].iter().flat_map(|&x| [corner(x, 0.0), corner(x, 1.0)]).collect(),
        uvs: [0.0, 1.0, 0.0, 1.0].iter().flat_map(|&u| [[u, 0.0], [u, 1.0]]).collect(),
        triangles: vec![[0, 2, 3], [0, 3, 1], [4, 6, 7], [4, 7, 5]],
        slots: vec![0, 0, 1, 1],
        ..Default::default()
    }
}

fn statistics(object: Object) -> Json {
    let world = World::of(object, 1);
    let Stage::AnnotateScene(annotator) = stage("material_statistics", "") else { panic!("not of scenes") };
    let mut products = Products::new();
    annotator.annotate(&world.of_scene(), &[], &mut products).expect("annotated");
    json(&products, "material_statistics")[0].clone()
}

#[test]
fn material_statistics_are_means_by_area() {
    let mut glass = Material::plain("glass", [0.9, 0.6, 0.3], 0.1);
    glass.transmission = Some(Transmission { fraction: Scalar::constant(0.8), volume: None });
    let mut tin = Material::plain("tin", [0.3, 0.3, 0.9], 0.4);
    tin.metallic = Scalar::constant(1.0);
    let object = Object {
        mesh: Arc::new(Mesh::new(quads()).expect("sound")),
        materials: vec![Arc::new(glass.with_digest()), Arc::new(tin.with_digest())],
        digest: Digest::of(b"quads"),
        ..World::tetrahedron()
    };
    let found = statistics(object);
    let close = |found: &Json, wanted: f64| {
        let found = found.as_f64().expect("a number");
        assert!((found - wanted).abs() < 1e-6, "{found}, not {wanted}");
    };
    assert_eq!(found["id"], json!(1));
    close(&found["area_m2"], 3.0);
    // One part glass, two parts tin.
    for (axis, wanted) in [1.5 / 3.0, 1.2 / 3.0, 2.1 / 3.0].into_iter().enumerate() {
        close(&found["base_color"][axis], wanted);
    }
    close(&found["roughness"], 0.3);
    close(&found["metallic"], 2.0 / 3.0);
    close(&found["transmission"], 0.8 / 3.0);
    assert_eq!(found["materials"].as_array().map(Vec::len), Some(2));
    assert_eq!(found["materials"][1]["name"], json!("tin"));
    close(&found["materials"][1]["area_m2"], 2.0);
    close(&found["materials"][1]["roughness"], 0.4);
}

#[test]
fn textures_and_vertex_colors_count() {
    // Three quarters of the texels are black, one is white: linear, so that the mean is 1/4 of the factor.
    let texels: Vec<u8> = (0..64 * 64).flat_map(|i| [if i % 64 < 16 { 255 } else { 0 }; 4]).collect();
    let texture = Arc::new(Texture {
        width: 64,
        height: 64,
        texels,
        encoding: Encoding::Linear,
        wrap: [Wrap::Clamp; 2],
        digest: Digest::of(b"bars"),
    });
    let mut bars = Material::plain("bars", [1.0; 3], 0.5);
    bars.base_color = syntable_model::scene::Color { factor: [0.8, 0.4, 1.0], texture: Some(texture.clone().into()) };
    bars.roughness = Scalar::texture(texture, 1);
    let mut data = quads();
    data.colors = vec![[0.5, 1.0, 1.0]; data.positions.len()];
    let object = Object {
        mesh: Arc::new(Mesh::new(data).expect("sound")),
        materials: vec![Arc::new(bars.with_digest())],
        digest: Digest::of(b"bars"),
        ..World::tetrahedron()
    };
    let found = statistics(object);
    let near = |found: &Json, wanted: f64| {
        let found = found.as_f64().expect("a number");
        assert!((found / wanted - 1.0).abs() < 0.02, "{found}, not {wanted}");
    };
    near(&found["base_color"][0], 0.8 * 0.5 / 4.0);
    near(&found["base_color"][1], 0.4 / 4.0);
    near(&found["base_color"][2], 1.0 / 4.0);
    near(&found["roughness"], 1.0 / 4.0);
}
