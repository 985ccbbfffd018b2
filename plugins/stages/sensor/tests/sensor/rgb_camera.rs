//! The color camera, compared with closed forms.

use crate::common::{json, refusal, sense, sensor, view};
use serde_json::json;
use syntable_model::context::{Serial, Workers};
use syntable_model::prelude::*;
use syntable_model::product::standard::{ALBEDO, EXPOSURE, RADIANCE, RGB};
use syntable_model::scene::Exposure;
use syntable_testing::{conformance, stats, workers::Threads};

const FIXED: Exposure = Exposure::Fixed { ev100: 1.0 };
/// White of that exposure, nits.
const WHITE: f32 = 2.4;
const FOCAL_PX: f64 = 90.0;

fn taken_by(workers: &dyn Workers, options: &str, radiance: Plane<[f32; 3]>, exposure: Exposure) -> Products {
    let view = view([radiance.width(), radiance.height()], FOCAL_PX, exposure);
    let mut products = Products::new();
    products.put(ALBEDO, Plane::from_fn(radiance.width(), radiance.height(), |_, _| [0.5; 3])).expect("first");
    products.put(RADIANCE, radiance).expect("first");
    sense(&*sensor("rgb_camera", options), &view, products, 5, workers)
}

fn image(options: &str, radiance: Plane<[f32; 3]>) -> Plane<[u8; 3]> {
    taken_by(&Serial, options, radiance, FIXED).get(RGB).expect("made").clone()
}

/// Image whose codes are 255 · luminance / white.
fn linear(options: &str, radiance: Plane<[f32; 3]>) -> Plane<[u8; 3]> {
    image(&format!("tone = \"linear\"\n{options}"), radiance)
}

/// Light over ten stops, with extreme and invalid values.
fn hard_light(size: [u32; 2]) -> Plane<[f32; 3]> {
    let mut stream = Stream::root(11);
    let mut light = Plane::from_fn(size[0], size[1], |_, _| {
        let nits = stream.uniform(-6.0, 4.0).exp2();
        std::array::from_fn(|_| (nits * stream.uniform(0.2, 1.0)) as f32)
    });
    light.data_mut()[..4].copy_from_slice(&[[0.0; 3], [f32::NAN; 3], [f32::INFINITY; 3], [-1.0, 1e20, 0.3]]);
    light
}

#[test]
fn it_conforms() {
    use syntable_model::registry::{Registry, Slot};
    let registry = Registry::linked().expect("kinds are unique");
    conformance::entry(registry.find(Slot::Sensor, "rgb_camera").expect("registered"));
    let all = "tone = \"agx\"\nvignetting = { mechanical = { uniform = [0.1, 0.3] } }\nchromatic_aberration = {}\n\
               blur = {}\nwhite_balance = \"auto\"\nnoise = { iso = { log_uniform = [100, 3200] } }\njpeg = {}";
    let take = |workers: &dyn Workers| taken_by(workers, all, hard_light([50, 40]), FIXED);
    let (one, three) = (take(&Serial), take(&Threads(3)));
    assert_eq!(one.get(RGB).expect("made"), three.get(RGB).expect("made"));
    assert_eq!(one.get(EXPOSURE).expect("made"), three.get(EXPOSURE).expect("made"));
    let record = json(&one, "exposure");
    let keys: Vec<&str> = record.as_object().expect("a record").keys().map(String::as_str).collect();
    assert_eq!(
        keys,
        [
            "mode",
            "ev100",
            "white_nits",
            "tone",
            "vignetting",
            "chromatic_aberration",
            "blur",
            "noise",
            "white_balance",
            "jpeg"
        ]
    );
    let iso = record["noise"]["iso"].as_f64().expect("a number");
    assert!((100.0..3200.0).contains(&iso) && record["noise"]["electrons_at_white"] == json!(1e6 / iso), "{record}");
}

#[test]
fn wrong_options_are_rejected_by_name() {
    for (options, want) in [
        ("blur = { sigma_px = -1 }", "blur.sigma_px: `blur.sigma_px` cannot be -1"),
        ("noise = { iso = { uniform = [0, 100] } }", "noise.iso: `noise.iso` can become 0"),
        ("white_balance = { kelvin = 1000 }", "white_balance.kelvin: `white_balance.kelvin` cannot be 1000"),
        ("white_balance = \"daylight\"", "white_balance: `white_balance` cannot be \"daylight\""),
        ("jpeg = { quality = 101 }", "jpeg.quality: `jpeg.quality` cannot be 101"),
        ("vignetting = { strength = 1 }", "vignetting.strength: `rgb_camera.vignetting` has no option `strength`"),
    ] {
        let got = refusal("rgb_camera", options);
        assert!(got.contains(want), "{options}: {got}");
    }
}

#[test]
fn images_have_the_requested_tone_and_exposure() {
    let ramp = || Plane::from_vec(4, 1, vec![[0.0; 3], [0.6, 1.2, 2.4], [1.2, 0.0, 0.6], [f32::INFINITY; 3]]);
    let products = taken_by(&Serial, "tone = \"srgb\"", ramp(), FIXED);
    // White is 2.4 nits; sRGB codes of 1/4 and 1/2 are 137 and 188.
    assert_eq!(products.get(RGB).expect("made").data(), [[0, 0, 0], [137, 188, 255], [188, 0, 137], [255, 255, 255]]);
    let exposure = json!({ "mode": "fixed", "ev100": 1.0, "white_nits": 2.4, "tone": "srgb" });
    assert_eq!(json(&products, "exposure"), exposure);

    // Automatic: an even gray wall is 18 % at any luminance, and one more stop doubles it.
    for tone in ["filmic", "agx"] {
        for nits in [0.01, 3.0, 4000.0] {
            let shoot = |compensation_ev: f64| {
                let wall = Plane::from_fn(8, 6, |_, _| [nits; 3]);
                taken_by(&Serial, &format!("tone = \"{tone}\""), wall, Exposure::Auto { compensation_ev })
            };
            let products = shoot(0.0);
            let image = products.get(RGB).expect("made");
            assert!(image.data().iter().all(|pixel| *pixel == [118; 3]), "{nits}: {:?}", image.at(0, 0));
            let exposure = json(&products, "exposure");
            assert_eq!((&exposure["mode"], &exposure["tone"]), (&json!("auto"), &json!(tone)));
            let brighter = shoot(1.0);
            let code = brighter.get(RGB).expect("made").at(0, 0)[0];
            assert!(if tone == "filmic" { code == 162 } else { (155..=165).contains(&code) }, "{nits}: {code}");
        }
    }
}

/// The light, as a fraction of white, that gives a brightness in [0, 1]: the inverse of the documented curves.
fn light_of(tone: &str, brightness: f64) -> f64 {
    // IEC 61966-2-1, from the code to the light.
    let decoded = if brightness <= 0.040_45 { brightness / 12.92 } else { ((brightness + 0.055) / 1.055).powf(2.4) };
    match tone {
        "linear" => brightness,
        "srgb" => decoded,
        "filmic" => {
            // A metered gray, 12.5 / 120 of white, becomes 18 %. From 40 % on, the curve is by Reinhard et al. with the
            // whitest white w: s = t (1 + t / w²) / (1 + t), solved for t.
            let (gain, knee) = (0.18 / (12.5 / 120.0), 0.4);
            let (s, w) = ((decoded - knee) / (1.0 - knee), (gain - knee) / (1.0 - knee));
            let t = 0.5 * w * w * (s - 1.0 + ((1.0 - s).powi(2) + 4.0 * s / (w * w)).sqrt());
            (if decoded <= knee { decoded } else { knee + (1.0 - knee) * t }) / gain
        }
        _ => unreachable!("{tone} is not tested here"),
    }
}

#[test]
fn without_effects_every_code_is_the_nearest_to_its_light() {
    for tone in ["filmic", "srgb", "linear"] {
        let light = hard_light([64, 48]);
        let image = image(&format!("tone = \"{tone}\""), light.clone());
        let mut met = [false; 256];
        for (nits, code) in light.data().as_flattened().iter().zip(image.data().as_flattened()) {
            // NaN is black, and nothing is brighter than white.
            let fraction = if nits.is_nan() { 0.0 } else { f64::from(nits / WHITE).clamp(0.0, 1.0) };
            // Half a code up and down, except for the rounding of single precision.
            let level = |by: f64| light_of(tone, ((f64::from(*code) + by) / 255.0).clamp(0.0, 1.0));
            let (low, high) = (level(-0.5) * (1.0 - 1e-6), level(0.5) * (1.0 + 1e-6));
            assert!((low..=high).contains(&fraction), "{tone}: {nits} nits, {fraction} of white, became {code}");
            met[usize::from(*code)] = true;
        }
        assert!(met.iter().filter(|met| **met).count() > 200, "{tone}: too few codes to tell");
    }
}

#[test]
fn vignetting_follows_its_law() {
    let size = [120, 80];
    let flat = || Plane::from_fn(size[0], size[1], |_, _| [WHITE; 3]);
    let corner2 = 60.0_f64.powi(2) + 40.0_f64.powi(2);
    let check = |options: &str, law: &dyn Fn(f64, f64) -> f64| {
        let image = linear(options, flat());
        for (x, y) in [(60, 40), (0, 0), (119, 3), (60, 0), (17, 71)] {
            let r2 = (f64::from(x) + 0.5 - 60.0).powi(2) + (f64::from(y) + 0.5 - 40.0).powi(2);
            let want = 255.0 * law(r2 / FOCAL_PX.powi(2), r2 / corner2);
            let got = f64::from(image.at(x, y)[1]);
            assert!((got - want).abs() < 0.51, "{options} at {x} {y}: {got}, not {want}");
        }
    };
    check("vignetting = {}", &|tan2, _| (1.0 + tan2).powi(-2));
    check("vignetting = { natural = 0.5, mechanical = 0.3 }", &|tan2, r2| (1.0 - 0.3 * r2) / (1.0 + tan2));
    check("vignetting = { natural = 0, radial = [-0.2, 0.1, -0.3] }", &|_, r2| {
        1.0 - 0.2 * r2 + 0.1 * r2 * r2 - 0.3 * r2.powi(3)
    });
}

#[test]
fn chromatic_aberration_shifts_edges_by_the_predicted_pixels() {
    // A vertical ramp edge: its place is where the linear profile crosses one half.
    let size = [400, 20];
    let half_diagonal = 0.5 * (400.0_f64.powi(2) + 20.0_f64.powi(2)).sqrt();
    let edge = 290.0;
    let ramp = Plane::from_fn(size[0], size[1], |x, _| {
        [(WHITE as f64 * ((f64::from(x) + 0.5 - edge) / 40.0 + 0.5).clamp(0.0, 1.0)) as f32; 3]
    });
    let image = linear("chromatic_aberration = { red_px = 3, blue_px = -2 }", ramp);
    // Least squares through the middle of the ramp.
    let crossing = |channel: usize| {
        let points: Vec<(f64, f64)> =
            (278..302).map(|x| (f64::from(x) + 0.5, f64::from(image.at(x, 10)[channel]) / 255.0 - 0.5)).collect();
        let n = points.len() as f64;
        let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
        let slope = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>()
            / points.iter().map(|p| (p.0 - mx).powi(2)).sum::<f64>();
        mx - my / slope
    };
    for (channel, shift) in [(0, 3.0), (1, 0.0), (2, -2.0)] {
        let want = edge + shift * (edge - 200.0) / half_diagonal;
        assert!((crossing(channel) - want).abs() < 0.03, "{channel}: {} not {want}", crossing(channel));
    }
}

#[test]
fn blur_keeps_the_mean_and_makes_a_gaussian_of_an_impulse() {
    let sigma = 1.7;
    let impulse = Plane::from_fn(41, 41, |x, y| [if (x, y) == (20, 20) { 18.0 * WHITE } else { 0.0 }; 3]);
    let image = linear(&format!("blur = {{ sigma_px = {sigma} }}"), impulse);
    for (dx, dy) in [(0, 0), (1, 0), (2, 1), (0, 3), (4, 4)] {
        let r2 = f64::from(dx * dx + dy * dy);
        let want = 255.0 * 18.0 / (std::f64::consts::TAU * sigma * sigma) * (-0.5 * r2 / (sigma * sigma)).exp();
        let got = f64::from(image.at(20 + dx, 20 + dy)[0]);
        assert!((got - want.min(255.0)).abs() < 0.6, "{dx} {dy}: {got}, not {want}");
    }
    // Light near the edges is reflected back: the mean stays, up to the rounding of codes.
    let mut stream = Stream::root(8);
    let light = Plane::from_fn(60, 45, |_, _| [0.0; 3].map(|_: f32| stream.uniform(0.2, 0.7) as f32 * WHITE));
    let mean = |image: &Plane<[u8; 3]>| {
        image.data().iter().flatten().map(|&code| f64::from(code)).sum::<f64>() / (3.0 * 60.0 * 45.0)
    };
    let (sharp, blurred) = (linear("", light.clone()), linear("blur = { sigma_px = 6 }", light));
    assert!((mean(&sharp) - mean(&blurred)).abs() < 0.05, "{} {}", mean(&sharp), mean(&blurred));
}

#[test]
fn noise_has_the_stated_mean_and_variance() {
    // 1000 electrons at white and 8 of read-out, measured on flat fields through a curve with many codes.
    let (electrons, read_noise) = (1000.0, 8.0);
    let options = format!("noise = {{ iso = 200, full_well_e = {}, read_noise_e = {read_noise} }}", 2.0 * electrons);
    for (i, signal) in [0.12, 0.3, 0.7].into_iter().enumerate() {
        let flat = Plane::from_fn(100, 100, |_, _| [WHITE * signal as f32; 3]);
        let image = linear(&options, flat);
        let codes: Vec<f64> = image.data().iter().flatten().map(|&code| f64::from(code) / 255.0).collect();
        assert!(stats::z_test_p(&codes, signal) > stats::sidak(0.001, 6), "mean at {i}");
        // Rounding to codes adds a twelfth of a step squared.
        let want = signal / electrons + (read_noise / electrons).powi(2) + 1.0 / (12.0 * 255.0 * 255.0);
        let squares: Vec<f64> = codes.iter().map(|code| (code - signal).powi(2)).collect();
        assert!(stats::z_test_p(&squares, want) > stats::sidak(0.001, 6), "variance at {i}: {want}");
    }
}

#[test]
fn white_balance_makes_a_lit_wall_gray() {
    let light = syntable_model::photometry::blackbody(3000.0);
    let wall = |x: u32, y: u32| light.map(|v| (v * WHITE as f64 * (0.1 + 0.003 * f64::from(x + y))) as f32);
    for balance in ["\"auto\"", "\"gray_world\"", "{ kelvin = 3000 }"] {
        let image = linear(&format!("white_balance = {balance}"), Plane::from_fn(40, 30, wall));
        for [r, g, b] in image.data() {
            assert!(r.abs_diff(*g) <= 1 && b.abs_diff(*g) <= 1, "{balance}: {r} {g} {b}");
        }
    }
    let products = taken_by(&Serial, "white_balance = \"auto\"", Plane::from_fn(40, 30, wall), FIXED);
    let kelvin = json(&products, "exposure")["white_balance"]["kelvin"].as_f64().expect("a number");
    assert!((kelvin - 3000.0).abs() < 15.0, "{kelvin}");
}

#[test]
fn jpeg_artifacts_decrease_with_quality() {
    let mut stream = Stream::root(2);
    let light = Plane::from_fn(61, 37, |x, y| {
        let soft = 0.5 + 0.4 * (f64::from(x) * 0.11).sin() * (f64::from(y) * 0.07).cos();
        [0.0; 3].map(|_: f32| ((soft + stream.uniform(-0.02, 0.02)) as f32) * WHITE)
    });
    let plain = image("", light.clone());
    let error = |quality: u32| {
        let sent = image(&format!("jpeg = {{ quality = {quality} }}"), light.clone());
        let squares = sent.data().iter().flatten().zip(plain.data().iter().flatten());
        let sum: f64 = squares.map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2)).sum();
        (sum / (3.0 * 61.0 * 37.0)).sqrt()
    };
    let errors = [100, 90, 50, 10].map(error);
    assert!(errors[0] < 1.2 && errors.is_sorted() && errors[3] > 3.0, "{errors:?}");
    // A flat gray survives any quality.
    let gray = image("jpeg = { quality = 20 }", Plane::from_fn(16, 16, |_, _| [WHITE * 0.25; 3]));
    assert!(gray.data().iter().flatten().all(|code| code.abs_diff(gray.at(0, 0)[0]) <= 1));
}

#[test]
fn values_outside_the_limits_of_the_schema_are_rejected() {
    for (options, want) in [
        ("noise = { full_well_e = 1 }", "full_well_e"),
        ("noise = { read_noise_e = -1 }", "read_noise_e"),
        ("vignetting = { radial = [1, 99, 0] }", "radial"),
    ] {
        let got = refusal("rgb_camera", options);
        assert!(got.contains(want), "{options}: {got}");
    }
}
