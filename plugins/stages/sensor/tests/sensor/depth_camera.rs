//! Depth cameras, compared with their documented formulas.

use crate::common::{json, refusal, sense, sensor, view};
use syntable_model::context::{Serial, Workers};
use syntable_model::prelude::*;
use syntable_model::product::standard::{ALBEDO, DEPTH, DEPTH_SENSED, NORMAL};
use syntable_model::scene::Exposure;
use syntable_testing::{conformance, stats, workers::Threads};

const SIZE: [u32; 2] = [160, 120];
const FOCAL_PX: f64 = 600.0;
/// Axial noise only.
const AXIAL: &str = "lateral_px = 0\nedge_loss = 0\n";

/// Clean products: depth, reflectance and normal of every pixel.
fn clean(at: impl FnMut(u32, u32) -> (f64, f64, [f32; 3])) -> Products {
    let pixels = Plane::from_fn(SIZE[0], SIZE[1], at);
    let mut products = Products::new();
    products.put(DEPTH, pixels.map(|pixel| pixel.0 as f32)).expect("first");
    products.put(ALBEDO, pixels.map(|pixel| [pixel.1 as f32; 3])).expect("first");
    products.put(NORMAL, pixels.map(|pixel| pixel.2)).expect("first");
    products
}

/// A wall at normal incidence.
fn wall(depth: f64, reflectance: f64) -> Products {
    clean(|_, _| (depth, reflectance, [0.0, 0.0, -1.0]))
}

/// A near wall left of column 100, a far one right of it.
fn step(near: f64, far: f64) -> Products {
    clean(|x, _| (if x < 100 { near } else { far }, 0.95, [0.0, 0.0, -1.0]))
}

fn seen_by(workers: &dyn Workers, options: &str, products: Products, seed: u64) -> Products {
    let view = view(SIZE, FOCAL_PX, Exposure::Fixed { ev100: 9.0 });
    sense(&*sensor("depth_camera", options), &view, products, seed, workers)
}

fn depth(options: &str, products: Products) -> Plane<f32> {
    seen_by(&Serial, options, products, 3).get(DEPTH_SENSED).expect("made").clone()
}

fn fraction(plane: &Plane<f32>, columns: std::ops::Range<u32>, is: impl Fn(f32) -> bool) -> f64 {
    let all = (0..SIZE[1]).flat_map(|y| columns.clone().map(move |x| (x, y)));
    let (hits, count) = all.fold((0, 0), |(hits, n), (x, y)| (hits + u32::from(is(*plane.at(x, y))), n + 1));
    f64::from(hits) / f64::from(count)
}

#[test]
fn it_conforms() {
    use syntable_model::registry::{Registry, Slot};
    let registry = Registry::linked().expect("kinds are unique");
    let kinds: Vec<_> = registry.of_slot(Slot::Sensor).map(|entry| entry.kind).collect();
    assert_eq!(kinds, ["depth_camera", "rgb_camera"]);
    conformance::entry(registry.find(Slot::Sensor, "depth_camera").expect("registered"));
}

#[test]
fn the_stream_decides_threads_do_not_and_clean_depth_is_kept() {
    for model in ["l515", "d435", "azure_kinect"] {
        let options = format!("model = \"{model}\"\nnoise = {{ uniform = [0.5, 1.5] }}\ndropout = 0.05");
        let see = |workers: &dyn Workers, seed| seen_by(workers, &options, step(0.9, 1.4), seed);
        let (one, three, other) = (see(&Serial, 1), see(&Threads(3), 1), see(&Serial, 2));
        let of = |products: &Products| products.get(DEPTH_SENSED).expect("made").clone();
        assert_eq!(of(&one), of(&three), "{model}");
        assert_ne!(of(&one), of(&other), "{model}");
        assert_eq!(one.get(DEPTH).expect("there"), step(0.9, 1.4).get(DEPTH).expect("there"));
        let report = json(&one, "depth_sensor");
        assert_eq!((report["model"].as_str(), report["dropout"].as_f64()), (Some(model), Some(0.05)));
        let principle = if model == "d435" { "stereo" } else { "time_of_flight" };
        assert!(report[principle].is_object(), "{report}");
        let noise = report["noise"].as_f64().expect("a number");
        let measured = report["measured_fraction"].as_f64().expect("a number");
        assert!((0.5..1.5).contains(&noise) && (0.6..0.96).contains(&measured), "{report}");
    }
}

#[test]
fn time_of_flight_has_the_stated_noise() {
    // The formula of the documentation, with the parameters of the models, in the center of the image.
    let law = |[floor, shot, background]: [f64; 3], z: f64, reflectance: f64| {
        let light = reflectance / (0.95 * z * z);
        (floor * floor + shot * shot / light + (background / light).powi(2)).sqrt() / 1000.0
    };
    let l515 = [1.82, 1.71, 0.0];
    let azure = [0.5, 0.852, 0.157];
    let cases = [
        ("l515", l515, 1.0, 0.95),
        ("l515", l515, 3.5, 0.2),
        ("l515", l515, 7.0, 0.95),
        ("azure_kinect", azure, 1.0, 0.95),
        ("azure_kinect", azure, 2.0, 0.3),
        ("azure_kinect", azure, 3.5, 0.95),
    ];
    let level = stats::sidak(0.001, 2 * cases.len());
    for (model, parameters, z, reflectance) in cases {
        // A field of view so narrow that all rays are alike.
        let mut view = view(SIZE, 1e6, Exposure::Fixed { ev100: 9.0 });
        view.camera.intrinsics.fx = 1e6;
        let options = format!("model = \"{model}\"\n{AXIAL}");
        let products = sense(&*sensor("depth_camera", &options), &view, wall(z, reflectance), 4, &Serial);
        let depth = products.get(DEPTH_SENSED).expect("made");
        let errors: Vec<f64> = depth.data().iter().map(|&got| f64::from(got) - z).collect();
        let unit: f64 = if model == "l515" { 0.00025 } else { 0.001 };
        let want = law(parameters, z, reflectance).powi(2) + unit * unit / 12.0;
        let squares: Vec<f64> = errors.iter().map(|error| error * error).collect();
        assert!(stats::z_test_p(&errors, 0.0) > level, "{model} at {z} m: mean");
        assert!(stats::z_test_p(&squares, want) > level, "{model} at {z} m: σ is not {}", want.sqrt());
        assert!(depth.data().iter().all(|z| (f64::from(*z) / unit - (f64::from(*z) / unit).round()).abs() < 1e-2));
    }
    // Manufacturers' figures: 2.5 mm at 1 m, 15.5 mm at 9 m; at most 17 mm at 3.86 m on 15 %. 3 mm at
    // 3 m are BlenderProc's.
    assert!((law(l515, 1.0, 0.95) - 0.0025).abs() < 5e-5 && (law(l515, 9.0, 0.95) - 0.0155).abs() < 1e-4);
    assert!((law(azure, 1.0, 0.95) - 0.001).abs() < 1e-5 && (law(azure, 3.86, 0.15) - 0.017).abs() < 1e-4);
    assert!((law(azure, 3.0, 0.95) - 0.003).abs() < 1e-4);
}

#[test]
fn stereo_has_the_stated_noise() {
    let scale = 447.0 * 0.05;
    for z in [0.6, 1.0, 2.0, 3.0] {
        // Pixels far apart are independent; the band that the right camera does not see is left out.
        let band = (FOCAL_PX * 0.05 / z).round() as u32;
        let mut errors = Vec::new();
        for seed in 0..12 {
            let options = format!("model = \"d435\"\n{AXIAL}unit_mm = 0.01");
            let products = seen_by(&Serial, &options, wall(z, 0.5), seed);
            let depth = products.get(DEPTH_SENSED).expect("made");
            assert_eq!(fraction(depth, 0..band, |z| z == 0.0), 1.0, "the band at {z} m");
            assert_eq!(fraction(depth, band + 1..SIZE[0], |z| z > 0.0), 1.0, "beside the band at {z} m");
            let at = (band + 1..SIZE[0]).step_by(11).flat_map(|x| (0..SIZE[1]).step_by(11).map(move |y| (x, y)));
            // In disparity the noise is Gaussian at every depth.
            errors.extend(at.map(|(x, y)| scale / f64::from(*depth.at(x, y)) - scale / z));
        }
        let want = 0.08_f64.powi(2) + (1.0 / 32.0_f64).powi(2) / 12.0;
        let squares: Vec<f64> = errors.iter().map(|error| error * error).collect();
        assert!(stats::z_test_p(&squares, want) > stats::sidak(0.001, 4), "at {z} m");
    }
}

#[test]
fn neighbors_in_stereo_are_correlated_as_a_gaussian_is() {
    let mut covariances = Vec::new();
    for seed in 0..30 {
        let options = format!("model = \"d435\"\n{AXIAL}unit_mm = 0.001\nstereo = {{ disparity_step_px = 0 }}");
        let products = seen_by(&Serial, &options, wall(1.0, 0.5), seed);
        let depth = products.get(DEPTH_SENSED).expect("made");
        let noise = |x: u32, y: u32| (22.35 / f64::from(*depth.at(x, y)) - 22.35) / 0.08;
        let at = (40..150).step_by(14).flat_map(|x| (0..120).step_by(14).map(move |y| (x, y)));
        covariances.extend(at.map(|(x, y)| noise(x, y) * noise(x + 2, y)));
    }
    // White noise after a Gaussian of σ has the correlation exp(−d² / 4σ²).
    let want = (-4.0 / (4.0 * 1.5_f64.powi(2))).exp();
    assert!(stats::z_test_p(&covariances, want) > 0.001, "not {want}");
}

#[test]
fn outside_its_range_nothing_is_measured() {
    for (model, near, far, more) in [
        ("l515", 0.25, 9.0, ""),
        // The band that the right camera does not see would fill the whole narrow image.
        ("d435", 0.18, 10.0, "stereo = { baseline_m = 0.02 }"),
        ("azure_kinect", 0.5, 3.86, ""),
    ] {
        let options = format!("model = \"{model}\"\n{AXIAL}noise = 0\n{more}");
        let all = |z: f64| fraction(&depth(&options, wall(z, 0.95)), 60..159, |z| z > 0.0);
        assert_eq!([near * 0.95, far * 1.05].map(all), [0.0; 2], "{model}");
        // Right of the band, which is 61 px wide then.
        let inside = fraction(&depth(&options, wall(near * 1.1, 0.95)), 120..150, |z| z > 0.0);
        assert_eq!(inside, 1.0, "{model}");
    }
    let nothing = depth("", clean(|_, _| (f64::INFINITY, 0.0, [0.0; 3])));
    assert!(nothing.data().iter().all(|z| *z == 0.0));
}

#[test]
fn dark_and_steep_surfaces_give_no_light_back() {
    let measured = |options: &str, products: Products| fraction(&depth(options, products), 50..150, |z| z > 0.0);
    // At 2 m, a surface of 0.15 · (2 / 3.9)² = 3.9 % reflects as much as a 15 % surface at 3.9 m.
    assert!(measured("", wall(2.0, 0.06)) > 0.99 && measured("", wall(2.0, 0.025)) < 0.01);
    assert!(measured("model = \"d435\"", wall(2.0, 0.001)) > 0.99);
    // The same light from a slanted surface: 8 % at cos 75° is 2 %. Stereo sees it up to its own limit.
    let slanted = |degrees: f64| {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        move || {
            clean(|x, _| {
                let u = (f64::from(x) + 0.5 - 80.0) / FOCAL_PX;
                // The plane through (0, 0, 2) with this normal.
                (2.0 * cosine / (cosine - sine * u), 0.08, [sine as f32, 0.0, -cosine as f32])
            })
        }
    };
    assert!(measured("", slanted(30.0)()) > 0.99 && measured("", slanted(78.0)()) < 0.2);
    let d435 = "model = \"d435\"";
    assert!(measured(d435, slanted(60.0)()) > 0.99);
    assert!(measured("model = \"d435\"\nmax_angle_deg = 40", slanted(60.0)()) < 0.05);
}

#[test]
fn lateral_noise_becomes_depth_on_a_slope() {
    // A plane that recedes by dz/dx = 1 at 1 m: a shift by s pixels is s / f meters of depth.
    let sloped = clean(|x, _| {
        let u = (f64::from(x) + 0.5 - 80.0) / 1e4;
        (1.0 / (1.0 - u), 0.95, [std::f32::consts::FRAC_1_SQRT_2, 0.0, -std::f32::consts::FRAC_1_SQRT_2])
    });
    let mut view = view(SIZE, 1e4, Exposure::Fixed { ev100: 9.0 });
    view.camera.intrinsics.fx = 1e4;
    let clean = sloped.get(DEPTH).expect("there").clone();
    let options = "noise = 0\nlateral_px = 2\nunit_mm = 0.001";
    let seen = sense(&*sensor("depth_camera", options), &view, sloped, 6, &Serial);
    let pairs = seen.get(DEPTH_SENSED).expect("made").data().iter().zip(clean.data()).enumerate();
    // Away from the border, where the shifted pixel would be outside the image.
    let inside = pairs.filter(|(i, _)| (12..148).contains(&(i % 160)) && (12 * 160..108 * 160).contains(i));
    let squares: Vec<f64> = inside.map(|(_, (&got, &z))| ((got - z) as f64 * 1e4).powi(2)).collect();
    // θ / (π/2 − θ) is 1 at 45°.
    let want = (2.0_f64 * 1.044).powi(2);
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    assert!((mean / want - 1.0).abs() < 0.05, "{mean}, not {want}");
}

#[test]
fn edges_lose_measurements_and_fly() {
    let quiet = "noise = 0\nlateral_px = 0\n";
    for (model, loss) in [("l515", 0.2), ("azure_kinect", 0.4), ("d435", 0.4)] {
        let seen = depth(&format!("model = \"{model}\"\n{quiet}"), step(1.0, 1.5));
        let lost = fraction(&seen, 99..101, |z| z == 0.0);
        assert!((lost - loss).abs() < 0.1, "{model}: {lost}");
        assert_eq!(fraction(&seen, 60..99, |z| (z - 1.0).abs() < 1e-3), 1.0, "{model}");
        assert_eq!(fraction(&seen, 101..160, |z| (z - 1.5).abs() < 2e-3), 1.0, "{model}");
        // Only light that is timed mixes.
        let between = fraction(&seen, 99..101, |z| (1.01..1.49).contains(&z)) / (1.0 - lost);
        let want = match model {
            "l515" => 0.4,
            "azure_kinect" => 0.5,
            _ => 0.0,
        };
        assert!((between - want).abs() < 0.12, "{model}: {between}");
    }
    let seen = depth(&format!("{quiet}edge_loss = 0\ntime_of_flight = {{ flying_pixels = 0 }}"), step(1.0, 1.5));
    assert_eq!(fraction(&seen, 99..101, |z| z == 1.0 || z == 1.5), 1.0);
}

#[test]
fn near_objects_cast_a_shadow_to_their_left() {
    // A board before a wall, seen from the left camera: f b (1/z − 1/z') pixels of the wall are hidden from the right.
    let board = || clean(|x, _| (if (80..110).contains(&x) { 0.8 } else { 1.6 }, 0.9, [0.0, 0.0, -1.0]));
    let quiet = "model = \"d435\"\nnoise = 0\nlateral_px = 0\nedge_loss = 0\nstereo = { disparity_step_px = 0 }";
    let seen = depth(quiet, board());
    let width = FOCAL_PX * 0.05 * (1.0 / 0.8 - 1.0 / 1.6);
    for y in [0, 60, 119] {
        let lost: Vec<u32> = (40..160).filter(|&x| *seen.at(x, y) == 0.0).collect();
        assert!((lost.len() as f64 - width).abs() <= 1.0, "{} px, not {width}", lost.len());
        assert!(lost.iter().all(|x| (60..80).contains(x)), "{lost:?}");
    }
    let wide = depth(&quiet.replace("{ ", "{ baseline_m = 0.075, "), board());
    let lost = (40..160).filter(|&x| *wide.at(x, 60) == 0.0).count() as f64;
    assert!((lost - 1.5 * width).abs() <= 1.0, "{lost}");
}

#[test]
fn wrong_options_are_rejected_by_name() {
    for (options, want) in [
        ("model = \"d415\"", "model: `model` cannot be \"d415\""),
        ("model = \"d435\"\ntime_of_flight = {}", "time_of_flight: `d435` is not a time-of-flight camera"),
        ("stereo = { baseline_m = 0.1 }", "stereo: `l515` is not a stereo camera"),
        ("range_m = [2, 1]", "range_m: `range_m = [2, 1]` is empty"),
        ("noise = { uniform = [-1, 1] }", "noise: `noise` can become -1"),
    ] {
        let got = refusal("depth_camera", options);
        assert!(got.contains(want), "{options}: {got}");
    }
}

#[test]
fn values_outside_the_limits_of_the_schema_are_rejected() {
    for (options, want) in [
        ("edge_loss = 1.5", "edge_loss"),
        ("dropout = 2", "dropout"),
        ("range_m = [-1, 1]", "range_m"),
        ("unit_mm = 0", "unit_mm"),
        ("max_angle_deg = 91", "max_angle_deg"),
        ("time_of_flight = { reach_m = 0 }", "reach_m"),
        ("model = \"d435\"\nstereo = { baseline_m = 0 }", "baseline_m"),
    ] {
        let got = refusal("depth_camera", options);
        assert!(got.contains(want), "{options}: {got}");
    }
}
