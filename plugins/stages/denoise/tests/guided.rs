//! The guided filter, compared with closed forms and a converged image.

mod common;

use common::{Room, denoise, luminance};
use syntable_denoise as _;
use syntable_guided::Guided;
use syntable_model::context::{Serial, Workers};
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    DEMODULATION_EPSILON, DENOISE_ALBEDO, DENOISE_NORMAL, DENOISER, DEPTH, INSTANCE, RADIANCE, RADIANCE_DEMODULATED,
    RADIANCE_DEMODULATED_VARIANCE, RADIANCE_NOISY, RADIANCE_SPECULAR, RADIANCE_SPECULAR_VARIANCE,
};
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_testing::workers::Threads;

type Rgb = [f32; 3];

/// The image of the guided filter on two threads.
fn filtered(products: &Products) -> Vec<Rgb> {
    let denoiser = Guided::default().build().expect("sound defaults");
    let made = denoise(&*denoiser, products, &Threads(2)).expect("denoises");
    made.get(RADIANCE).expect("provided").data().to_vec()
}

/// A pixel of a synthetic image.
#[derive(Clone, Copy)]
struct Pixel {
    radiance: Rgb,
    variance: f32,
    albedo: Rgb,
    normal: Rgb,
    depth: f32,
    id: u16,
    /// `None` for the radiance over the mean color.
    demodulated: Option<Rgb>,
}

/// A white wall that faces the camera.
const WALL: Pixel = Pixel {
    radiance: [10.0; 3],
    variance: f32::INFINITY,
    albedo: [0.99; 3],
    normal: [0.0, 0.0, -1.0],
    depth: 2.0,
    id: 1,
    demodulated: None,
};

fn image(width: u32, height: u32, mut pixel: impl FnMut(u32, u32) -> Pixel) -> Products {
    let pixels = Plane::from_fn(width, height, &mut pixel);
    let mut products = Products::new();
    products.put(RADIANCE_NOISY, pixels.map(|p| p.radiance)).expect("new");
    let over_mean = |p: &Pixel| std::array::from_fn(|c| p.radiance[c] / (p.albedo[c] + DEMODULATION_EPSILON));
    let demodulated = |p: &Pixel| p.demodulated.unwrap_or_else(|| over_mean(p));
    let variance = |p: &Pixel| p.variance / luminance(p.albedo.map(|a| a + DEMODULATION_EPSILON)).powi(2);
    products.put(RADIANCE_DEMODULATED, pixels.map(demodulated)).expect("new");
    products.put(RADIANCE_DEMODULATED_VARIANCE, pixels.map(variance)).expect("new");
    products.put(RADIANCE_SPECULAR, pixels.map(|_| [0.0; 3])).expect("new");
    products.put(RADIANCE_SPECULAR_VARIANCE, pixels.map(|_| 0.0)).expect("new");
    products.put(DENOISE_ALBEDO, pixels.map(|p| p.albedo)).expect("new");
    products.put(DENOISE_NORMAL, pixels.map(|p| p.normal)).expect("new");
    products.put(DEPTH, pixels.map(|p| p.depth)).expect("new");
    products.put(INSTANCE, pixels.map(|p| InstanceId(p.id))).expect("new");
    products
}

/// Noise of mean 1 and a known relative deviation.
fn noise(stream: &mut Stream, deviation: f64) -> f32 {
    (1.0 + deviation * 12_f64.sqrt() * (stream.uniform(0.0, 1.0) - 0.5)) as f32
}

fn mean(values: impl Iterator<Item = f32>) -> f64 {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), x| (sum + f64::from(x), count + 1));
    sum / f64::from(count)
}

#[test]
fn every_kind_conforms() {
    let registry = Registry::linked().expect("no clash");
    for kind in ["guided", "none", "oidn"] {
        syntable_testing::conformance::entry(registry.find(Slot::Denoise, kind).expect("registered"));
    }
    let guided = registry.find(Slot::Denoise, "guided").expect("registered");
    for (options, sound) in [
        ("strength = 0.1\nlevels = 1", true),
        ("strength = 10\nlevels = 5", true),
        ("strength = 0.09", false),
        ("strength = 10.1", false),
        ("strength = nan", false),
        ("levels = 0", false),
        ("levels = 6", false),
    ] {
        assert_eq!(guided.construct_str(options).is_ok(), sound, "{options}");
    }
}

#[test]
fn without_a_denoiser_the_image_stays_and_says_so() {
    let registry = Registry::linked().expect("no clash");
    let stage = registry.find(Slot::Denoise, "none").expect("registered").construct_str("").expect("no options").stage;
    let Stage::Denoise(none) = stage else { panic!("the registry keeps slots apart") };
    assert!(none.reads().is_empty() && none.replaces().is_empty());
    let made = denoise(&*none, &image(4, 3, |_, _| WALL), &Serial).expect("does nothing");
    assert_eq!(made.get(DENOISER).expect("provided"), &Value::record([("name", "none".into())]));
    assert!(!made.contains("radiance"));
}

#[test]
fn a_speck_does_not_become_black() {
    // One sample was bright where the surface is darker than on average: the mean of quotients is far above the
    // quotient.
    for (radiance, quotient) in [(1_600.0_f32, 16_000.0_f32), (400.0, 900.0), (5e4, 4e6)] {
        let products = image(40, 30, |x, y| match (x, y) {
            (20, 15) => {
                let demodulated = Some([quotient; 3]);
                Pixel {
                    radiance: [radiance; 3],
                    variance: (quotient * 0.5).powi(2),
                    albedo: [0.5; 3],
                    demodulated,
                    ..WALL
                }
            }
            _ => Pixel { albedo: [0.5; 3], variance: 0.1, ..WALL },
        });
        let pixel = luminance(filtered(&products)[15 * 40 + 20]);
        assert!((9.0..30.0).contains(&pixel), "{radiance} nits became {pixel}, where all around is 10");
    }
}

#[test]
fn an_image_without_noise_stays() {
    let textured = |x: u32, y: u32| {
        let shade = 0.5 + 0.4 * ((x / 7 + y / 5) % 2) as f32;
        let light = 5.0 + 4.0 * (0.2 * x as f32).sin() * (0.13 * y as f32).cos();
        Pixel { radiance: [light * shade, light * 0.3, light * 2.0], albedo: [shade; 3], variance: 0.0, ..WALL }
    };
    let products = image(70, 50, textured);
    for (after, before) in filtered(&products).iter().zip(products.get(RADIANCE_NOISY).expect("put").data()) {
        for c in 0..3 {
            assert!((after[c] - before[c]).abs() <= 1e-3 * before[c], "{before:?} became {after:?}");
        }
    }
}

#[test]
fn a_horizon_is_as_bright_as_what_it_shows() {
    // Dark ground under a sky of equal radiance. Pixels of the horizon show varying parts of both.
    let (sky, ground, samples) = (10.0, 0.01, 16);
    let mut stream = Stream::root(11);
    let mut quotients = Stream::root(12);
    let products = image(64, 48, |_, y| match y {
        0..20 => Pixel {
            radiance: [sky; 3],
            variance: 0.0,
            albedo: [1.0; 3],
            normal: [0.0; 3],
            depth: f32::INFINITY,
            id: 0,
            demodulated: None,
        },
        20 => {
            let part = stream.uniform(0.1, 0.6) as f32;
            let albedo = [part + (1.0 - part) * ground; 3];
            let light =
                part * sky / (1.0 + DEMODULATION_EPSILON) + (1.0 - part) * sky / (ground + DEMODULATION_EPSILON);
            let spread = sky / (ground + DEMODULATION_EPSILON) * part;
            let variance = (spread * luminance(albedo)).powi(2) / samples as f32;
            let normal = [0.0, part - 1.0, 0.0];
            Pixel {
                radiance: [sky * noise(&mut quotients, 0.02); 3],
                variance,
                albedo,
                normal,
                demodulated: Some([light; 3]),
                ..WALL
            }
        }
        _ => Pixel {
            radiance: [sky * noise(&mut quotients, 0.1); 3],
            variance: 1.0,
            albedo: [ground; 3],
            normal: [0.0, -1.0, 0.0],
            ..WALL
        },
    });
    let image = filtered(&products);
    for (row, tolerance) in [(20, 0.05), (21, 0.1), (22, 0.1), (30, 0.06)] {
        for pixel in &image[row * 64..(row + 1) * 64] {
            assert!((luminance(*pixel) / sky - 1.0).abs() < tolerance, "row {row}: {pixel:?}");
        }
    }
}

#[test]
fn error_on_a_wall_falls_as_a_mean_of_its_neighbors() {
    for (variance_known, deviation) in [(false, 0.5), (true, 0.5), (true, 0.1)] {
        let mut stream = Stream::root(7);
        let products = image(96, 80, |_, _| {
            let radiance = [10.0 * noise(&mut stream, deviation); 3];
            let variance = if variance_known { (10.0 * deviation).powi(2) as f32 } else { f32::INFINITY };
            Pixel { radiance, variance, ..WALL }
        });
        let after = filtered(&products);
        let light = mean(after.iter().map(|p| p[0]));
        // 7680 samples: their own mean deviates by deviation / 88.
        let bound = 4.0 * deviation / 88.0 + 0.01;
        assert!((light / 10.0 - 1.0).abs() < bound, "{light} nits of 10");
        // Four levels of 25 taps, 1 to 8 px apart: equal weights would leave a deviation of less than a hundredth.
        let error = mean(after.iter().map(|p| (p[0] - 10.0).powi(2))).sqrt() / 10.0;
        assert!(error < 0.12 * deviation, "deviation {deviation} became {error}");
    }
}

#[test]
fn light_does_not_cross_from_one_body_or_face_to_the_next() {
    let mut stream = Stream::root(3);
    let turned = Pixel { normal: [1.0, 0.0, 0.0], radiance: [40.0; 3], ..WALL };
    let other = Pixel { id: 2, albedo: [0.46; 3], radiance: [1.0; 3], normal: [0.0, -1.0, 0.0], ..WALL };
    let behind = Pixel { depth: 3.0, radiance: [90.0; 3], ..WALL };
    let parts = [WALL, turned, other, behind];
    let products = image(96, 40, |x, _| {
        let part = parts[x as usize / 24];
        Pixel { radiance: part.radiance.map(|r| r * noise(&mut stream, 0.2)), ..part }
    });
    let after = filtered(&products);
    for (number, part) in parts.iter().enumerate() {
        for x in [0, 1, 22, 23] {
            let column = (0..40).map(|y| after[y * 96 + number * 24 + x][0]);
            let light = mean(column) / f64::from(part.radiance[0]);
            assert!((light - 1.0).abs() < 0.08, "part {number}, column {x}: {light} of its light");
        }
    }
}

#[test]
fn the_edge_of_a_bright_body_before_a_dark_sky_is_their_mean() {
    // Gray of 0.49 lit to 50 nits; the sky counts as white, of 1 nit. Pixels at the edge show half of each.
    let mut stream = Stream::root(4);
    let products = image(64, 40, |x, _| {
        let light = 50.0 * noise(&mut stream, 0.3);
        let wall = Pixel { radiance: [light; 3], variance: 225.0, albedo: [0.49; 3], ..WALL };
        match x {
            0..=31 => wall,
            32 => Pixel {
                radiance: [(light + 1.0) / 2.0; 3],
                demodulated: Some([(light / 0.5 + 1.0 / 1.01) / 2.0; 3]),
                albedo: [(0.49 + 1.0) / 2.0; 3],
                normal: [0.0, 0.0, -0.5],
                ..wall
            },
            _ => Pixel { radiance: [1.0; 3], variance: 0.0, albedo: [1.0; 3], normal: [0.0; 3], id: 0, ..wall },
        }
    });
    let after = filtered(&products);
    let edge = mean((0..40).map(|y| after[y * 64 + 32][0]));
    assert!((edge / 25.5 - 1.0).abs() < 0.1, "{edge} nits");
}

#[test]
fn a_speck_is_cut_but_a_sure_highlight_is_kept() {
    for (variance, kept) in [(f32::INFINITY, false), (4.0, true)] {
        let mut stream = Stream::root(5);
        let products = image(48, 48, |x, y| {
            let light = if (x, y) == (24, 24) { 1000.0 } else { 10.0 * noise(&mut stream, 0.2) };
            Pixel { radiance: [light; 3], variance, ..WALL }
        });
        let after = filtered(&products);
        assert_eq!(after[24 * 48 + 24][0] > 900.0, kept, "{}", after[24 * 48 + 24][0]);
        let beside = after[24 * 48 + 26][0];
        assert!((8.0..12.0).contains(&beside), "{beside} nits beside it");
    }
}

#[test]
fn what_is_no_number_stays_where_it_is() {
    let mut stream = Stream::root(1);
    let products = image(40, 40, |x, y| {
        let pixel = Pixel { radiance: [10.0 * noise(&mut stream, 0.3); 3], ..WALL };
        match (x, y) {
            (5, 5) => Pixel { radiance: [f32::NAN; 3], ..pixel },
            (20, 5) => Pixel { radiance: [f32::INFINITY, 1.0, 1.0], ..pixel },
            (30, 30) => Pixel { normal: [f32::NAN; 3], ..pixel },
            (10, 30) => Pixel { albedo: [f32::NAN; 3], variance: f32::NAN, ..pixel },
            (20, 20) => Pixel { depth: f32::INFINITY, id: 0, radiance: [5e4; 3], ..pixel },
            (35, 10) => Pixel { depth: 0.0, ..pixel },
            (37, 37) => Pixel { radiance: [3e38; 3], ..pixel },
            _ => pixel,
        }
    });
    let after = filtered(&products);
    assert_eq!(after[20 * 40 + 20], [5e4; 3], "a light passes");
    for (number, pixel) in after.iter().enumerate() {
        let odd = [(5, 5), (20, 5), (20, 20), (35, 10), (37, 37)].contains(&(number % 40, number / 40));
        assert!(odd || pixel.iter().all(|x| (4.0..16.0).contains(x)), "pixel {number}: {pixel:?}");
    }
}

#[test]
fn any_size_and_any_number_of_threads() {
    for (width, height) in [(1, 1), (1, 9), (31, 2), (33, 17), (130, 70)] {
        let mut stream = Stream::root(2);
        let products = image(width, height, |_, y| {
            let id = 1 + (y / 9) as u16;
            Pixel { radiance: [10.0 * noise(&mut stream, 0.3), 3.0, 20.0], id, ..WALL }
        });
        let denoiser = Guided::default().build().expect("sound defaults");
        let run = |workers: &dyn Workers| {
            denoise(&*denoiser, &products, workers).expect("denoises").get(RADIANCE).expect("provided").clone()
        };
        let one = run(&Serial);
        assert!(one.data().iter().flatten().all(|x| x.is_finite() && *x > 0.0));
        for threads in [2, 5] {
            assert_eq!(one, run(&Threads(threads)), "{width} × {height}, {threads} threads");
        }
    }
}

#[test]
fn a_room_gets_better_up_to_64_samples() {
    let room = Room::new(64, 48);
    let reference = room.render(1024, 99);
    let reference = reference.get(RADIANCE_NOISY).expect("put").data();
    let scale = mean(reference.iter().map(|&c| luminance(c)));
    let error = |image: &[Rgb]| {
        let pairs = image.iter().flatten().zip(reference.iter().flatten());
        mean(pairs.map(|(a, r)| (a - r).powi(2) / (r * r + 0.01 * (scale * scale) as f32)))
    };
    // At 64 samples, eight seeds give factors of 0.80 ± 0.05; the bound is three deviations above. At 128 samples, the
    // filter's bias is as large as the noise; with more samples, it is larger: dark lines at bright edges take light
    // from their neighbors.
    for (samples, factor) in [(1, 0.3), (4, 0.45), (64, 0.96)] {
        let products = room.render(samples, 5);
        let (before, after) = (error(products.get(RADIANCE_NOISY).expect("put").data()), error(&filtered(&products)));
        assert!(after < factor * before, "{samples} samples: relMSE {before} became {after}");
    }
}
