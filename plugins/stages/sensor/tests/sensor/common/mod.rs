//! A minimal view, and a harness that runs a sensor on given planes.

#![allow(dead_code)]

use syntable_model::context::{Collected, DatasetContext, Workers};
use syntable_model::prelude::*;
use syntable_model::registry::{Constructed, Registry, Slot, Stage};
use syntable_model::scene::{Exposure, View};
use syntable_sensor as _;
use syntable_testing::scenes;

/// The sensor of a kind with these options.
pub fn sensor(kind: &str, options: &str) -> Box<dyn Sensor> {
    match constructed(kind, options).map(|constructed| constructed.stage) {
        Ok(Stage::Sensor(sensor)) => sensor,
        Ok(_) => unreachable!("the registry keeps slots apart"),
        Err(error) => panic!("{kind}: {error}\n{options}"),
    }
}

/// The message with which the options are refused.
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

/// Runs a sensor with the products that it declares to read; returns the given products and the sensor's own.
pub fn sense(sensor: &dyn Sensor, view: &View, mut products: Products, seed: u64, workers: &dyn Workers) -> Products {
    let scene = scenes::boxes(&[([0.0, 0.0, 0.5], [1.0; 3])]);
    let dataset = scenes::dataset();
    let log = Collected::default();
    let cx = DatasetContext::new(&dataset, workers, &log).scene(&scene).view(view);
    let names: Vec<_> = sensor.reads().iter().map(|key| key.product_id()).collect();
    let lent = products.only(&names);
    let mut filled = lent.clone();
    sensor.sense(&cx, &Stream::root(seed), &mut filled).expect("senses");
    let made = filled.without(&lent);
    let sorted = |mut keys: Vec<KeyId>| {
        keys.sort_by_key(|key| key.product_id());
        keys
    };
    assert_eq!(made.keys(), sorted(sensor.provides()), "it makes other products than it declares");
    products.extend(made).expect("all are new");
    products
}

/// A product as JSON.
pub fn json(products: &Products, name: &str) -> serde_json::Value {
    serde_json::to_value(products.value(name).expect("made")).expect("serializes")
}
