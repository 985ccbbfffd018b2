//! Time of sensors at 640 × 480 on one thread: `cargo bench -p syntable-sensor`.

use std::hint::black_box;
use syntable_model::context::{Collected, DatasetContext, Serial};
use syntable_model::prelude::*;
use syntable_model::product::standard::{ALBEDO, DEPTH, NORMAL, RADIANCE};
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_sensor::rgb_camera::{Developer, Tone, ev100_of, white_nits};
use syntable_testing::figures::Figures;
use syntable_testing::scenes;

const SIZE: [u32; 2] = [640, 480];

/// Sensors with their options.
const SENSORS: [(&str, &str); 10] = [
    ("rgb_camera", ""),
    ("rgb_camera", "vignetting = {}"),
    ("rgb_camera", "chromatic_aberration = {}"),
    ("rgb_camera", "blur = {}"),
    ("rgb_camera", "white_balance = \"auto\""),
    ("rgb_camera", "noise = {}"),
    ("rgb_camera", "jpeg = {}"),
    ("depth_camera", "model = \"l515\""),
    ("depth_camera", "model = \"d435\""),
    ("depth_camera", "model = \"azure_kinect\""),
];

fn main() {
    let mut figures = Figures::filtered(env!("CARGO_PKG_NAME"), env!("CARGO_CRATE_NAME"));
    for tone in [Tone::Filmic, Tone::Agx] {
        develop(&mut figures, tone);
    }
    for (kind, options) in SENSORS {
        sense(&mut figures, kind, options);
    }
}

fn noisy_light() -> Plane<[f32; 3]> {
    let mut stream = Stream::root(1);
    Plane::from_fn(SIZE[0], SIZE[1], |_, _| [0.0; 3].map(|_: f64| stream.unit() as f32 * 100.0))
}

/// Metering and developing a noisy image.
fn develop(figures: &mut Figures, tone: Tone) {
    let radiance = noisy_light();
    figures.time(&format!("develop {tone:?}"), || {
        let developer = Developer::new(tone, white_nits(ev100_of(radiance.data())), [1.0; 3]);
        let mut codes = vec![[0; 3]; radiance.data().len()];
        developer.develop(black_box(radiance.data()), &mut codes);
        codes
    });
}

/// A whole sensor.
fn sense(figures: &mut Figures, kind: &str, options: &str) {
    let registry = Registry::linked().expect("kinds are unique");
    let stage = registry.find(Slot::Sensor, kind).and_then(|entry| entry.construct_str(options).ok());
    let Some(Stage::Sensor(sensor)) = stage.map(|constructed| constructed.stage) else {
        panic!("{kind} does not take {options}");
    };
    let (scene, dataset) = (scenes::boxes(&[([0.0, 0.0, 0.5], [1.0; 3])]), scenes::dataset());
    let view = scenes::view([0.0, -1.0, 1.0], [0.0; 3], SIZE, 70.0);
    // A floor with a board every 40 pixels.
    let depth = Plane::from_fn(SIZE[0], SIZE[1], |x, y| 2.0 - 0.002 * y as f32 - if x % 40 < 12 { 0.3 } else { 0.0 });
    let make_products = || {
        let mut products = Products::new();
        products.put(RADIANCE, noisy_light()).expect("first");
        products.put(DEPTH, depth.clone()).expect("first");
        products.put(ALBEDO, depth.map(|_| [0.5; 3])).expect("first");
        products.put(NORMAL, depth.map(|_| [0.0, -0.6, -0.8])).expect("first");
        products
    };
    let log = Collected::default();
    let cx = DatasetContext::new(&dataset, &Serial, &log).scene(&scene).view(&view);
    figures.time_on(&format!("{kind} {options}"), make_products, |mut products| {
        sensor.sense(&cx, &Stream::root(3), &mut products).expect("senses");
        products
    });
}
