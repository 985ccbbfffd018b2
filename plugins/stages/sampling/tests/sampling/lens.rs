//! Distortion and depth of field.

use super::*;
use syntable_model::geometry::look_at;
use syntable_model::scene::Distortion;

fn optics_of(kind: &str, options: &str, pose: &Pose, seed: u64) -> Result<Optics> {
    let Stage::Camera(camera) = stage(Slot::Camera, kind, options) else { panic!("no camera") };
    with_context(seed, |context| camera.optics(&scene(None), pose, context))
}

fn optics_at(options: &str, pose: &Pose, seed: u64) -> Result<Optics> {
    optics_of("pinhole", options, pose, seed)
}

#[test]
fn a_lens_has_the_aperture_of_its_f_number_and_focuses_on_depth() {
    // From 1 m beside and 1 m above the center of the tabletop at 0.75 m, looking 0.2 m past it.
    let pose = look_at(Point3::new(1.0, 0.0, 1.75), Point3::new(-0.2, 0.0, 0.75), Vector3::z());
    let forward = Vector3::new(-1.2, 0.0, -1.0).normalize();
    let depth = forward.dot(&Vector3::new(-1.0, 0.0, -1.0));
    let options =
        "intrinsics = { physical = { focal_length_mm = 50, sensor_size_mm = [36, 27] } }\nlens = { f_number = 2 }";
    let lens = optics_at(options, &pose, 1).expect("optics").lens.expect("a lens");
    assert!((lens.aperture_radius_m - 0.0125).abs() < 1e-12, "{lens:?}");
    assert!((lens.focus_distance_m - depth).abs() < 1e-9, "{lens:?} {depth}");
    // The scene's object is a triangle whose box is centered at (0.05, 0.05, 0.8).
    let options =
        "intrinsics = { fov_deg = 60 }\nlens = { f_number = 4, focus = \"nearest_object\", focal_length_mm = 8 }";
    let lens = optics_at(options, &pose, 1).expect("optics").lens.expect("a lens");
    let depth = forward.dot(&Vector3::new(-0.95, 0.05, -0.95));
    assert!((lens.focus_distance_m - depth).abs() < 1e-6 && (lens.aperture_radius_m - 0.001).abs() < 1e-12, "{lens:?}");
    // Without an object in the image, the tabletop is in focus.
    let options =
        "intrinsics = { fov_deg = 1 }\nlens = { f_number = 4, focus = \"nearest_object\", focal_length_mm = 8 }";
    let lens = optics_at(options, &pose, 1).expect("optics").lens.expect("a lens");
    assert!((lens.focus_distance_m - forward.dot(&Vector3::new(-1.0, 0.0, -1.0))).abs() < 1e-9, "{lens:?}");

    let options = "lens = { f_number = { uniform = [1.4, 8] }, focus = { distance_m = { uniform = [0.5, 2] } } }";
    let drawn: Vec<_> =
        (0..200).map(|seed| optics_at(options, &pose, seed).expect("optics").lens.expect("a lens")).collect();
    assert!(drawn.iter().all(|lens| (0.5..2.0).contains(&lens.focus_distance_m)));
    let f_numbers: Vec<f64> = drawn.iter().map(|lens| (0.00188 / 2.0 / lens.aperture_radius_m - 1.4) / 6.6).collect();
    assert!(kolmogorov_smirnov(f_numbers) < bound(200), "the default camera is 1.88 mm long");

    let away = look_at(Point3::new(1.0, 0.0, 1.75), Point3::new(3.0, 0.0, 1.75), Vector3::z());
    let error = optics_at("lens = { f_number = 2 }", &away, 1).expect_err("behind").to_string();
    assert!(error.contains("cannot focus") && error.contains("lens.focus"), "{error}");
}

#[test]
fn distortion_is_passed_on_and_folds_are_rejected() {
    let got = optics("distortion = { k1 = -0.12, k2 = 0.02, p1 = 0.001, p2 = -0.002, k3 = 0.003 }");
    assert_eq!(got.distortion, Some(Distortion::brown_conrady([-0.12, 0.02, 0.003], [0.001, -0.002])));
    assert_eq!(optics("").distortion, None);
    // A barrel of k1 alone turns back where 1 + 3 k1 r² = 0: at r' = 2/3 · √(-1/(3 k1)). The corner of a square image
    // of 90° lies at r' = √2.
    let square =
        |k1: f64| format!("resolution = [64, 64]\nintrinsics = {{ fov_deg = 90 }}\ndistortion = {{ k1 = {k1} }}");
    let limit = -(4.0 / 27.0) / 2.0;
    let _ = optics(&square(0.95 * limit));
    let refusal = refused(Slot::Camera, "pinhole", &square(1.05 * limit));
    assert!(refusal.contains("folds the image over"), "{refusal}");
}

#[test]
fn longer_models_of_opencv_are_passed_on() {
    let got = optics(
        "distortion = { k1 = -0.05, k4 = 0.05, k5 = 0.01, k6 = -0.001, s1 = 0.001, s2 = 0.002, s3 = -0.003, s4 = 0.004 }",
    );
    let Some(Distortion::Polynomial(lens)) = got.distortion else { panic!("{got:?}") };
    assert_eq!((lens.radial, lens.denominator), ([-0.05, 0.0, 0.0], [0.05, 0.01, -0.001]));
    assert_eq!(lens.thin_prism, [0.001, 0.002, -0.003, 0.004]);
}

/// The edges of the image are at half the field of view, and all pixels of a circle of 89.5 degrees see something.
#[test]
fn a_fisheye_sees_its_field_of_view() {
    let of = |options: &str| optics_of("fisheye", options, &Pose::identity(), 1).expect("optics");
    for lens in ["", "k1 = 0.05\nk2 = -0.01"] {
        let got = of(&format!("resolution = [200, 100]\nintrinsics = {{ fov_deg = 170 }}\n{lens}"));
        let camera = Camera { distortion: got.distortion, ..Camera::pinhole(got.intrinsics, Pose::identity()) };
        let edge = camera.unproject(200.0, 50.0).expect("seen");
        assert!((edge.x.atan().to_degrees() - 85.0).abs() < 1e-6 && edge.y == 0.0, "{edge}");
        assert_eq!(camera.project(&Point3::from(edge * 3.0)).map(|x| x.round()), [200.0, 50.0]);
    }
    // An equidistant lens of 1 rad per 100 px: 89.5 degrees are 156.2 px from the center.
    let circle = of("resolution = [400, 400]\nintrinsics = { pixels = { fx = 100, fy = 100, cx = 200, cy = 200 } }");
    let camera = Camera { distortion: circle.distortion, ..Camera::pinhole(circle.intrinsics, Pose::identity()) };
    assert!(camera.unproject(200.0 + 156.1, 200.0).is_some() && camera.unproject(200.0 + 156.3, 200.0).is_none());
    for (options, want) in [
        ("k1 = -0.5", "folds the image over"),
        ("intrinsics = { fov_deg = 40 }\nk1 = -0.5", ""),
        ("intrinsics = { fov_deg = 180 }", "179"),
        ("lens = { f_number = 2 }", "lens"),
    ] {
        if want.is_empty() {
            let _ = of(options);
            continue;
        }
        let error = refused(Slot::Camera, "fisheye", options);
        assert!(error.contains(want), "{options}: {error}");
    }
}

#[test]
fn lens_options_are_checked() {
    for (options, want) in [
        ("intrinsics = { fov_deg = 60 }\nlens = { f_number = 2 }", "needs a focal length"),
        ("lens = { f_number = 2, focal_length_mm = 5 }", "already"),
        ("lens = { f_number = 0 }", "lens.f_number"),
        ("lens = { f_number = 2, focus = \"table\" }", "nearest_object"),
        ("lens = { f_number = 2, focus = { distance_m = 0 } }", "lens.focus.distance_m"),
        ("lens = { focus = \"tabletop\" }", "f_number"),
        ("distortion = { k7 = 1 }", "k7"),
    ] {
        let error = refused(Slot::Camera, "pinhole", options);
        assert!(error.contains(want), "{options}: {error}");
    }
}
