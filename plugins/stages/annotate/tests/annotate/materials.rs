//! The material of every pixel, in a scene with a known answer: a board of two triangles, a pane in front of it, a
//! wall.

use crate::common::annotator;
use serde_json::json;
use std::sync::Arc;
use syntable_model::context::{Collected, DatasetContext, Serial};
use syntable_model::prelude::*;
use syntable_model::product::standard::{INSTANCE, MATERIAL_MAP, MATERIALS};
use syntable_model::registry::Stage;
use syntable_model::scene::{
    Alpha, Material, Mesh, MeshData, Object, Region, Role, Scalar, SettleReport, Support, Transmission,
};
use syntable_testing::scenes;

const SIZE: [u32; 2] = [48, 36];
/// Position of the board along x, so that no pixel's center is on its diagonal.
const OFF_CENTER: f64 = 0.013;
const BOARD: u16 = 1;
const PANE: u16 = 2;
const WALL: u16 = 3;
const RED: u16 = 1;
const BLUE: u16 = 2;
const GLASS: u16 = 3;

/// An upright rectangle around the origin, of two triangles: below the diagonal from its lower left corner, and above.
fn rectangle(name: &str, [width, height]: [f32; 2], slots: Vec<u16>, materials: Vec<Material>) -> Arc<Object> {
    let corner = |x: f32, z: f32| [x * width / 2.0, 0.0, z * height / 2.0];
    let data = MeshData {
        positions: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        slots,
        ..MeshData::default()
    };
    let plain = scenes::object(name, Mesh::new(data).expect("sound"), [0.5; 3]);
    Arc::new(Object { materials: materials.into_iter().map(Arc::new).collect(), ..(*plain).clone() })
}

fn red() -> Material {
    Material::plain("red", [0.8, 0.1, 0.1], 0.5)
}

/// The scene with a pane of that material over the right half of the board and beyond, and the product of a renderer.
fn scene(pane: Material) -> (Scene, View, Plane<InstanceId>) {
    let mut builder = SceneBuilder::default();
    builder.supports = Support::new("table", Region::rectangle([0.0; 3], [4.0; 2])).into();
    let blue = Material::plain("blue", [0.1, 0.1, 0.8], 0.5);
    let bodies = [
        (rectangle("board", [1.0, 1.0], vec![0, 1], vec![red(), blue]), [OFF_CENTER, 0.0, 0.0], Role::Object),
        (rectangle("pane", [1.0, 0.5], Vec::new(), vec![pane]), [0.5, -0.5, 0.0], Role::Object),
        (rectangle("wall", [2.0, 1.2], Vec::new(), vec![red()]), [0.0, 1.0, 0.0], Role::Support),
    ];
    for (object, at, role) in bodies {
        builder.add(scenes::body(object, at, role));
    }
    let scene = builder.freeze(SettleReport::default()).expect("sound");
    let view = scenes::view([0.0, -2.0, 0.0], [0.0; 3], SIZE, 60.0);
    let instance = Plane::from_fn(SIZE[0], SIZE[1], |x, y| {
        InstanceId([PANE, BOARD, WALL].into_iter().find(|&body| meets(&view, body, [x, y]).is_some()).unwrap_or(0))
    });
    (scene, view, instance)
}

/// Intersection of the ray of a pixel with a body: x and z from its center.
fn meets(view: &View, body: u16, [x, y]: [u32; 2]) -> Option<[f64; 2]> {
    let (center, distance, half) = match body {
        PANE => (0.5, 1.5, [0.5, 0.25]),
        BOARD => (OFF_CENTER, 2.0, [0.5, 0.5]),
        _ => (0.0, 3.0, [1.0, 0.6]),
    };
    let focal = view.camera.intrinsics.fx;
    let right = (f64::from(x) + 0.5 - f64::from(SIZE[0]) / 2.0) / focal * distance - center;
    let up = -(f64::from(y) + 0.5 - f64::from(SIZE[1]) / 2.0) / focal * distance;
    (right.abs() <= half[0] && up.abs() <= half[1]).then_some([right, up])
}

/// The material of a body at a pixel.
fn of_body(view: &View, body: u16, pixel: [u32; 2]) -> Option<u16> {
    let [right, up] = meets(view, body, pixel)?;
    Some(match body {
        PANE => GLASS,
        BOARD if up > right => BLUE,
        _ => RED,
    })
}

fn map(scene: &Scene, view: &View, instance: &Plane<InstanceId>, options: &str) -> Plane<u16> {
    let (dataset, log) = (scenes::dataset(), Collected::default());
    let mut products = Products::new();
    products.put(INSTANCE, instance.clone()).expect("first");
    let cx = DatasetContext::new(&dataset, &Serial, &log);
    annotator("material_map", options).annotate(&cx.scene(scene).view(view), &mut products).expect("made");
    products.get(MATERIAL_MAP).expect("made").clone()
}

fn check(pane: Material, options: &str, passes: bool) {
    let (scene, view, instance) = scene(pane);
    let bodies: &[u16] = if passes { &[BOARD, WALL] } else { &[PANE, BOARD, WALL] };
    let want = Plane::from_fn(SIZE[0], SIZE[1], |x, y| {
        bodies.iter().find_map(|&body| of_body(&view, body, [x, y])).unwrap_or(0)
    });
    for id in 0..=if passes { BLUE } else { GLASS } {
        assert!(want.data().iter().filter(|&&shown| shown == id).count() > 20, "material {id} is there");
    }
    let map = map(&scene, &view, &instance, options);
    let wrong = map.data().iter().zip(want.data()).filter(|(got, want)| got != want).count();
    assert_eq!(wrong, 0, "wrong pixels, {options}");
}

fn glass(fraction: f32) -> Material {
    let transmission = Some(Transmission { fraction: Scalar::constant(fraction), volume: None });
    Material { transmission, ..Material::plain("pane", [1.0; 3], 0.0) }.with_digest()
}

#[test]
fn glass_is_looked_through() {
    check(glass(1.0), "", true);
    check(glass(0.6), "", true);
    check(glass(0.4), "", false);
    check(glass(1.0), "glass = \"seen\"", false);
}

#[test]
fn a_surface_that_covers_less_than_half_is_looked_through() {
    let covers = |factor| Material { alpha: Alpha::Blend { factor }, ..Material::plain("pane", [1.0; 3], 0.5) };
    check(covers(0.4), "", true);
    check(covers(0.6), "", false);
    check(covers(0.4), "glass = \"seen\"", false);
}

#[test]
fn a_body_that_the_ray_misses_by_a_hair_keeps_its_material() {
    let (scene, view, _) = scene(glass(1.0));
    let everywhere = Plane::from_fn(SIZE[0], SIZE[1], |_, _| InstanceId(BOARD));
    let map = map(&scene, &view, &everywhere, "");
    assert_eq!((*map.at(0, 0), *map.at(24, 17)), (RED, BLUE));
}

#[test]
fn equal_materials_are_one() {
    let (scene, ..) = scene(glass(1.0));
    let (dataset, log) = (scenes::dataset(), Collected::default());
    let Stage::AnnotateScene(stage) = crate::common::stage("materials", "") else { panic!("it annotates scenes") };
    let mut products = Products::new();
    let cx = DatasetContext::new(&dataset, &Serial, &log);
    stage.annotate(&cx.scene(&scene), &[], &mut products).expect("made");
    let records = serde_json::to_value(products.get(MATERIALS).expect("made")).expect("plain data");
    let want = [(RED, "red", vec![BOARD, WALL]), (BLUE, "blue", vec![BOARD]), (GLASS, "pane", vec![PANE])];
    for (record, (id, name, bodies)) in records.as_array().expect("a list").iter().zip(want) {
        assert_eq!((&record["id"], &record["name"], &record["bodies"]), (&json!(id), &json!(name), &json!(bodies)));
        assert_eq!(record["digest"].as_str().map(str::len), Some(32));
    }
    assert_eq!(records.as_array().map(Vec::len), Some(3));
    assert_eq!(records[0]["digest"], json!(red().digest.to_string()));
}
