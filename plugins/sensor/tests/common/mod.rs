//! A minimal view, and a harness that runs a sensor on given planes.

#![allow(dead_code)]

use syntable_model::context::{Context, NoCache, Workers};
use syntable_model::prelude::*;
use syntable_model::registry::{Constructed, Registry, Slot, Stage};
use syntable_model::scene::{Exposure, View};
use syntable_sensor as _;
use syntable_testing::{assets::NoAssets, scenes};

/// The stage that these options give.
pub fn sensor(kind: &str, options: &str) -> Box<dyn Sensor> {
    match constructed(kind, options).map(|constructed| constructed.stage) {
        Ok(Stage::Sensor(sensor)) => sensor,
        Ok(_) => unreachable!("the registry keeps slots apart"),
        Err(error) => panic!("{kind}: {error}\n{options}"),
    }
}

/// Why the options are refused.
pub fn refusal(kind: &str, options: &str) -> String {
    constructed(kind, options).map(|_| "accepted".to_owned()).unwrap_or_else(|error| error)
}

fn constructed(kind: &str, options: &str) -> Result<Constructed, String> {
    use syntable_model::registry::ConstructError;
    let registry = Registry::linked().expect("kinds are unique");
    let entry = registry.find(Slot::Sensor, kind).expect("a registered kind");
    entry.construct_str(options).map_err(|error| match error {
        ConstructError::Form(error) => error.to_string(),
        ConstructError::Invalid(invalid) => format!("{}: {}", invalid.key, invalid.message),
    })
}

/// A view with the principal point at the center of the image.
pub fn view(size: [u32; 2], focal_px: f64, exposure: Exposure) -> View {
    let mut view = scenes::view([0.0, -1.0, 1.0], [0.0; 3], size, 60.0);
    (view.camera.intrinsics.fx, view.camera.intrinsics.fy) = (focal_px, focal_px);
    view.exposure = exposure;
    view
}

/// Runs a sensor on a frame, which it can read only as it declares.
pub fn sense(sensor: &dyn Sensor, view: &View, mut frame: Products, seed: u64, workers: &dyn Workers) -> Frame {
    let scene = scenes::boxes(&[([0.0, 0.0, 0.5], [1.0; 3])]);
    let dataset = scenes::dataset();
    let site = Site { dataset: &dataset, scene: &scene, view: Some(view) };
    let context = Context {
        stream: Stream::root(seed),
        assets: &NoAssets,
        cache: &NoCache,
        workers,
        log: &syntable_model::context::Collected::default(),
    };
    frame.guard(&sensor.reads());
    sensor.sense(&site, &context, &mut frame).expect("senses");
    frame.unguard();
    for key in sensor.provides() {
        assert!(frame.contains(key.name), "{} is missing", key.name);
    }
    frame
}

/// A product as JSON.
pub fn json(frame: &Products, name: &str) -> serde_json::Value {
    serde_json::to_value(frame.value(name).expect("made")).expect("serializes")
}
