//! Appearance of objects, developed like the image.

use crate::common::{sense, sensor, view};
use std::collections::BTreeMap;
use syntable_model::context::{Collected, DatasetContext, Serial};
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    ALBEDO, AMODAL_MASK, APPEARANCE, APPEARANCE_BOX, COVERAGE, EXPOSURE, OPACITY, RADIANCE, RGB,
};
use syntable_model::product::{BBox, BitPlane, Lighting};
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_model::scene::Exposure;
use syntable_testing::{conformance, scenes};

const SIZE: [u32; 2] = [24, 20];

/// An image of a gradient, taken by a camera; two objects cover some of its pixels, and only the second is annotated.
fn taken(camera: &str, lighting: Lighting) -> Products {
    let light = |x: u32, y: u32| [0.2 + 0.1 * x as f32, 0.3 + 0.05 * y as f32, 0.4];
    let mut products = Products::new();
    products.put(ALBEDO, Plane::from_fn(SIZE[0], SIZE[1], |_, _| [0.5; 3])).expect("first");
    products.put(RADIANCE, Plane::from_fn(SIZE[0], SIZE[1], light)).expect("first");
    let mut products = sense(&*sensor("rgb_camera", camera), &of_view(), products, 5, &Serial);
    let mut coverage = BitPlane::new(SIZE[0], SIZE[1], 2);
    let mut covered = Plane::from_fn(SIZE[0], SIZE[1], |_, _| false);
    for (x, y) in (8..14).flat_map(|x| (5..12).map(move |y| (x, y))) {
        coverage.insert(x, y, InstanceId(2));
        covered.data_mut()[(y * SIZE[0] + x) as usize] = true;
    }
    coverage.insert(1, 1, InstanceId(1));
    let mask = Mask::from_fn(SIZE[0], SIZE[1], |x, y| *covered.at(x, y));
    let atlas = Atlas::of(&coverage);
    let mut radiance = Plane::from_fn(atlas.size[0], atlas.size[1], |_, _| [7.0; 3]);
    let mut opacity = Plane::from_fn(atlas.size[0], atlas.size[1], |_, _| 1.0_f32);
    let tile = atlas.tile(InstanceId(2)).expect("covers something");
    let at = |x: u32, y: u32| (x + tile.window.x as u32, y + tile.window.y as u32);
    // Half a pixel more than the mask to the left, and nothing else around it.
    let share = |x: u32, y: u32| match at(x, y) {
        (7, 5..12) => 0.5,
        (x, y) if x < SIZE[0] && *covered.at(x, y) => 1.0,
        _ => 0.0,
    };
    let own = |x: u32, y: u32| {
        let (column, row) = at(x, y);
        light(column, row).map(|nits| nits * share(x, y))
    };
    let (width, height) = (tile.window.width, tile.window.height);
    radiance.paste(tile.at, &Plane::from_fn(width, height, own));
    opacity.paste(tile.at, &Plane::from_fn(width, height, share));
    products.put(RADIANCE.of_objects(lighting), radiance).expect("first");
    products.put(OPACITY.of_objects(lighting), opacity).expect("first");
    products.put(COVERAGE, coverage).expect("first");
    products.put(AMODAL_MASK, PerInstance(BTreeMap::from([(InstanceId(2), mask)]))).expect("first");
    products
}

fn of_view() -> View {
    view(SIZE, 30.0, Exposure::Auto { compensation_ev: 0.3 })
}

fn annotated(options: &str, products: &Products) -> Products {
    let registry = Registry::linked().expect("kinds are unique");
    let entry = registry.find(Slot::Annotate, "appearance").expect("registered");
    conformance::entry(entry);
    let Ok(annotator) = entry.construct_str(options).map(|made| made.stage) else { panic!("no annotator: {options}") };
    let (scene, dataset, log) =
        (scenes::boxes(&[([0.0, 0.0, 0.5], [1.0; 3])]), scenes::dataset(), Collected::default());
    let view = of_view();
    let cx = DatasetContext::new(&dataset, &Serial, &log).scene(&scene).view(&view);
    conformance::annotator(&annotator, &cx, products)
}

#[test]
fn objects_are_developed_as_the_image() {
    for (camera, lighting, options) in [
        ("tone = \"filmic\"\nwhite_balance = \"auto\"", Lighting::InScene, ""),
        ("tone = \"agx\"\nwhite_balance = { kelvin = 3000 }", Lighting::Alone, "lighting = \"alone\""),
        // Effects of the lens are neither undone nor applied to objects; the exposure still equals the image's.
        ("tone = \"linear\"\njpeg = { quality = 50 }", Lighting::InScene, "lighting = \"in_scene\""),
    ] {
        let products = taken(camera, lighting);
        let made = annotated(options, &products);
        let images = made.get(APPEARANCE).expect("made");
        assert_eq!(images.iter().count(), 1);
        let image = images.whole(InstanceId(2)).expect("annotated");
        let rgb = products.get(RGB).expect("taken");
        for (x, y) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))) {
            let [r, g, b, alpha] = *image.at(x, y);
            match (x, y) {
                (7, 5..12) => assert_eq!(alpha, 128),
                (8..14, 5..12) => assert_eq!(alpha, 255),
                _ => assert_eq!([r, g, b, alpha], [0; 4]),
            }
            if alpha > 0 && !camera.contains("jpeg") {
                assert_eq!([r, g, b], *rgb.at(x, y), "{camera} at ({x}, {y})");
            }
        }
        let boxes = made.get(APPEARANCE_BOX).expect("made");
        assert_eq!(boxes.get(InstanceId(2)), Some(&BBox { x: 7, y: 5, width: 7, height: 7 }));
    }
}

#[test]
fn an_image_of_another_sensor_is_refused() {
    let mut products = taken("", Lighting::InScene).only(&[COVERAGE.name(), AMODAL_MASK.name()]);
    let one = |value: [f32; 3]| Plane::from_fn(24, 20, |_, _| value);
    products.put(RADIANCE.of_objects(Lighting::InScene), one([1.0; 3])).expect("first");
    products.put(OPACITY.of_objects(Lighting::InScene), Plane::from_fn(24, 20, |_, _| 1.0)).expect("first");
    products.put(EXPOSURE, Value::record([("tone", "filmic".into())])).expect("first");
    let registry = Registry::linked().expect("kinds are unique");
    let made =
        registry.find(Slot::Annotate, "appearance").expect("registered").construct_str("").map(|made| made.stage);
    let Ok(Stage::AnnotateView(annotator)) = made else { panic!("no annotator") };
    let (scene, dataset, log) =
        (scenes::boxes(&[([0.0, 0.0, 0.5], [1.0; 3])]), scenes::dataset(), Collected::default());
    let view = of_view();
    let cx = DatasetContext::new(&dataset, &Serial, &log).scene(&scene).view(&view);
    let error = annotator.annotate(&cx, &mut products).expect_err("white is unknown");
    assert!(error.to_string().contains("does not tell `white_nits`"), "{error}");
}
