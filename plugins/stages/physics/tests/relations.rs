//! The annotator `relations`: piles whose forces can be worked out on paper, and properties of any pile at rest.

mod kit;

use kit::*;
use serde_json::{Value as Json, json};
use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::context::{Collected, DatasetContext, Serial};
use syntable_model::geometry::{Pose, Translation3, UnitQuaternion, Vector3};
use syntable_model::prelude::{Config, Products, SceneAnnotator};
use syntable_model::registry::{Entry, Stage};
use syntable_model::scene::*;
use syntable_model::stage::DatasetInfo;

const G: f64 = 9.81;

/// The relations of a scene, by name.
fn relations_of(scene: &Scene, options: &str) -> BTreeMap<String, Json> {
    products_of::<syntable_physics::Relations>(
        scene,
        options,
        &["contacts", "support_graph", "inside", "removal_order"],
    )
}

/// Products of a scene that an annotator makes, by name.
fn products_of<C: Config>(scene: &Scene, options: &str, names: &[&str]) -> BTreeMap<String, Json> {
    let built = Entry::of::<C>("syntable-physics", "0").construct_str(options);
    let Ok(Stage::AnnotateScene(annotator)) = built.map(|built| built.stage) else { panic!("options: {options}") };
    let annotator: Box<dyn SceneAnnotator> = annotator;
    let info = DatasetInfo {
        name: "test".into(),
        seed: 1,
        scenes: 1,
        views_per_scene: 1,
        recipe: String::new(),
        program: "test".into(),
        classes: Vec::new(),
        own_categories: Vec::new(),
        label_surface: syntable_model::stage::LabelSurface::First,
    };
    let log = Collected::default();
    let mut products = Products::new();
    let cx = DatasetContext::new(&info, &Serial, &log).scene(scene);
    annotator.annotate(&cx, &[], &mut products).expect("annotated");
    assert!(log.warnings().is_empty(), "{:?}", log.warnings());
    let json = |name: &str| serde_json::to_value(products.value(name).expect("made")).expect("JSON");
    names.iter().map(|name| ((*name).to_owned(), json(name))).collect()
}

fn frozen(scene: SceneBuilder) -> Scene {
    scene.freeze(SettleReport::default()).expect("a scene")
}

/// Edges as (supporter, supported) with the upward force, N.
fn edges(found: &BTreeMap<String, Json>) -> BTreeMap<(u64, u64), f64> {
    let edges = found["support_graph"]["edges"].as_array().expect("a list").clone();
    let number = |edge: &Json, key: &str| edge[key].as_u64().expect("an id");
    let edge = |edge: &Json| {
        ((number(edge, "supporter"), number(edge, "supported")), edge["force_n"].as_f64().expect("a force"))
    };
    edges.iter().map(edge).collect()
}

fn vector(json: &Json) -> Vector3<f64> {
    let numbers: [f64; 3] = serde_json::from_value(json.clone()).expect("three numbers");
    numbers.into()
}

fn close(found: f64, wanted: f64, tolerance: f64) {
    assert!((found - wanted).abs() <= tolerance, "{found}, not {wanted}");
}

fn block(name: &str, size: [f32; 3], kg: f64) -> Arc<Object> {
    object(name, cuboid([0.0; 3], size), kg)
}

/// Ids: objects from 1 in the order in which they were added, then the floor, then the table.
#[test]
fn two_boxes_stacked_on_a_table() {
    let mut scene = table_scene();
    scene.add(dynamic(&block("lower", [0.2, 0.2, 0.1], 2.0), at(0.1, 0.0, TABLE_HEIGHT + 0.05)));
    scene.add(dynamic(&block("upper", [0.1, 0.1, 0.1], 0.5), at(0.1, 0.02, TABLE_HEIGHT + 0.15)));
    scene.add(dynamic(&block("beside", [0.1, 0.1, 0.1], 1.0), at(-0.3, 0.0, TABLE_HEIGHT + 0.05)));
    let found = relations_of(&frozen(scene), "");
    let edges = edges(&found);
    assert_eq!(edges.keys().copied().collect::<Vec<_>>(), [(1, 2), (5, 1), (5, 3)]);
    close(edges[&(1, 2)], 0.5 * G, 1e-3);
    close(edges[&(5, 1)], 2.5 * G, 1e-3);
    close(edges[&(5, 3)], 1.0 * G, 1e-3);
    let graph = &found["support_graph"];
    close(graph["edges"][1]["share"].as_f64().expect("a share"), 1.25, 1e-4);
    assert_eq!(
        [&graph["roots"], &graph["cycles"], &graph["floating"], &graph["moving"]],
        [&json!([5]), &json!([]), &json!([]), &json!([])]
    );
    assert_eq!(found["inside"], json!([]));
    assert_eq!(found["removal_order"], json!({ "order": [2, 1, 3], "forced": [] }));
    // The upper box presses down on the lower one, at the corners of its own bottom.
    let contact = &found["contacts"][0];
    assert_eq!(contact["ids"], json!([1, 2]));
    assert!((vector(&contact["normal_world"]) - Vector3::z()).norm() < 1e-6);
    assert!((vector(&contact["force_world_n"]) - Vector3::new(0.0, 0.0, 0.5 * G)).norm() < 1e-3);
    let points: Vec<Vector3<f64>> =
        contact["points"].as_array().expect("points").iter().map(|point| vector(&point["point_world_m"])).collect();
    assert_eq!(points.len(), 4);
    for p in points {
        close((p.x - 0.1).abs(), 0.05, 1e-5);
        close((p.y - 0.02).abs(), 0.05, 1e-5);
        close(p.z, TABLE_HEIGHT + 0.1, 1e-5);
    }
}

#[test]
fn the_margin_decides_who_touches() {
    let scene = || {
        let mut scene = table_scene();
        scene.add(dynamic(&block("cube", [0.1; 3], 1.0), at(0.0, 0.0, TABLE_HEIGHT + 0.05 + 0.002)));
        frozen(scene)
    };
    let far = relations_of(&scene(), "");
    assert_eq!(far["contacts"], json!([]));
    assert_eq!(far["support_graph"]["floating"], json!([1]));
    close(far["support_graph"]["moving"][0]["acceleration_m_s2"].as_f64().expect("a number"), G, 1e-9);
    let near = relations_of(&scene(), "margin_m = 0.003");
    close(near["contacts"][0]["gap_m"].as_f64().expect("a gap"), 0.002, 1e-5);
    // The first body is the cube, and the table is below.
    assert!((vector(&near["contacts"][0]["normal_world"]) + Vector3::z()).norm() < 1e-6);
    assert_eq!(near["support_graph"]["floating"], json!([]));
}

/// Two halves side by side have four corners each, and share two of them.
#[test]
fn points_at_which_two_parts_meet_count_once() {
    let halves = [-0.05, 0.05].map(|x| cuboid([x, 0.0, 0.0], [0.1, 0.1, 0.1]).positions);
    let whole = block("halves", [0.2, 0.1, 0.1], 1.0);
    let whole = Arc::new(Object { collision: Some(Arc::new(halves.to_vec())), ..(*whole).clone() });
    let mut scene = table_scene();
    scene.add(dynamic(&whole, at(0.0, 0.0, TABLE_HEIGHT + 0.05)));
    let found = relations_of(&frozen(scene), "");
    assert_eq!(found["contacts"][0]["points"].as_array().map(Vec::len), Some(6));
    close(edges(&found)[&(3, 1)], G, 1e-3);
}

/// The lever: a beam of 0.6 m and 3 kg on two posts, 0.2 m left and 0.1 m right of its middle.
#[test]
fn a_beam_weighs_on_its_posts_by_the_lever() {
    let mut scene = table_scene();
    let post = block("post", [0.02, 0.1, 0.1], 1.0);
    scene.add(dynamic(&post, at(-0.2, 0.0, TABLE_HEIGHT + 0.05)));
    scene.add(dynamic(&post, at(0.1, 0.0, TABLE_HEIGHT + 0.05)));
    scene.add(dynamic(&block("beam", [0.6, 0.1, 0.02], 3.0), at(0.0, 0.0, TABLE_HEIGHT + 0.11)));
    let found = relations_of(&frozen(scene), "");
    let edges = edges(&found);
    // A post is 2 cm wide, and the force may act anywhere on it: 0.09/0.3 to 0.11/0.3 of the weight on the left one.
    let left = edges[&(1, 3)];
    assert!((3.0 * G * 0.09 / 0.3 - 0.1..=3.0 * G * 0.11 / 0.3 + 0.1).contains(&left), "{left} N");
    close(left + edges[&(2, 3)], 3.0 * G, 1e-2);
    close(edges[&(5, 1)] + edges[&(5, 2)], 5.0 * G, 1e-2);
    assert_eq!(found["removal_order"]["order"], json!([3, 1, 2]));
}

/// A plank leans on a heavy block at 45°: its foot bears nearly all of it, and the block pushes it back.
#[test]
fn a_leaning_plank_weighs_on_its_foot() {
    let mut scene = table_scene();
    let (length, thick) = (0.4_f64, 0.02_f64);
    let plank = block("plank", [length as f32, 0.1, thick as f32], 0.5);
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -std::f64::consts::FRAC_PI_4);
    let s = std::f64::consts::FRAC_1_SQRT_2;
    // The lower corner of the plank's lower end is on the table.
    let center = Vector3::new(0.0, 0.0, TABLE_HEIGHT + (length + thick) / 2.0 * s);
    let pose = Pose::from_parts(Translation3::from(center), turn);
    scene.add(BodyDraft { friction: 1.0, ..dynamic(&plank, pose) });
    // The upper edge of the block is 0.12 m along the plank from its middle, on its underside.
    let edge = pose * syntable_model::geometry::Point3::new(0.12, 0.0, -thick / 2.0);
    let size = [0.2, 0.2, (edge.z - TABLE_HEIGHT) as f32];
    let stand = block("stand", size, 20.0);
    scene.add(dynamic(&stand, at(edge.x + 0.1, 0.0, TABLE_HEIGHT + f64::from(size[2]) / 2.0)));
    let found = relations_of(&frozen(scene), "");
    let edges = edges(&found);
    let [foot, hand] = [edges[&(4, 1)], edges[&(2, 1)]];
    close(foot + hand, 0.5 * G, 1e-2);
    // Moments about the foot, the lower corner of the lower end: the block pushes at a point of the underside, so that
    // friction along it has no arm.
    let arm = length / 2.0 + 0.12;
    let weight = 0.5 * G * (length / 2.0 - thick / 2.0) * s;
    let contact = found["contacts"].as_array().expect("contacts").iter().find(|it| it["ids"] == json!([1, 2]));
    let push = -vector(&contact.expect("they touch")["force_world_n"]);
    let normal = turn * Vector3::z();
    let along = push.dot(&(turn * Vector3::x()));
    close(push.dot(&normal) * arm, weight, 0.005);
    assert!(along.abs() <= 0.75 * push.dot(&normal) + 1e-6, "friction of 1 and 0.5 is 0.75: {push}");
    assert_eq!(found["support_graph"]["moving"], json!([]));
    assert_eq!(found["removal_order"]["order"], json!([1, 2]));
}

#[test]
fn a_ball_in_a_box_is_inside_and_one_on_a_box_is_not() {
    let mut scene = table_scene();
    let tray = object("tray", tray([0.2, 0.2, 0.1], 0.01), 1.0);
    let (small, ball) = (block("small", [0.04; 3], 0.1), object("ball", sphere(0.03), 0.1));
    scene.add(dynamic(&tray, at(0.0, 0.0, TABLE_HEIGHT)));
    scene.add(dynamic(&small, at(0.04, 0.0, TABLE_HEIGHT + 0.03)));
    scene.add(dynamic(&ball, at(0.04, 0.0, TABLE_HEIGHT + 0.05 + 0.03)));
    let solid = block("solid", [0.2, 0.2, 0.1], 1.0);
    scene.add(dynamic(&solid, at(0.4, 0.0, TABLE_HEIGHT + 0.05)));
    scene.add(dynamic(&small, at(0.4, 0.0, TABLE_HEIGHT + 0.12)));
    let found = relations_of(&frozen(scene), "");
    // The ball lies on the small cube and stands out by 1 cm of its 6: a cap of h = r/3, 2/27 of its volume.
    let inside = found["inside"].as_array().expect("a list");
    let pairs: Vec<(u64, u64)> =
        inside.iter().map(|it| (it["id"].as_u64().expect("id"), it["container"].as_u64().expect("id"))).collect();
    assert_eq!(pairs, [(2, 1), (3, 1)]);
    assert_eq!(inside[0]["fraction"], json!(1.0));
    close(inside[1]["fraction"].as_f64().expect("a fraction"), 1.0 - 2.0 / 27.0, 0.02);
    let edges: Vec<(u64, u64)> = edges(&found).into_keys().collect();
    assert_eq!(edges, [(1, 2), (2, 3), (4, 5), (7, 1), (7, 4)]);
    // The tray is higher than the cube in it, and comes last.
    assert_eq!(found["removal_order"], json!({ "order": [5, 3, 4, 2, 1], "forced": [] }));
}

/// Three beams, each with one end on the table and the other one on the next: none can go first.
#[test]
fn a_ring_of_beams_carries_itself() {
    let (length, thick) = (0.3_f64, 0.02_f64);
    let beam = block("beam", [length as f32, 0.03, thick as f32], 0.3);
    let mut scene = table_scene();
    // Seen from above a triangle: every beam starts outside on the table and ends on top of the next one near its
    // start.
    let rise = 1.5 * thick;
    let tilt = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -(rise / length));
    for i in 0..3 {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::TAU * f64::from(i) / 3.0);
        let offset = turn * Vector3::new(0.0, -0.06, 0.0);
        let center = Vector3::new(offset.x, offset.y, TABLE_HEIGHT + thick / 2.0 + rise / 2.0);
        scene.add(dynamic(&beam, Pose::from_parts(Translation3::from(center), turn * tilt)));
    }
    let found = relations_of(&frozen(scene), "margin_m = 0.02");
    let graph = &found["support_graph"];
    assert_eq!(graph["cycles"], json!([[1, 2, 3]]), "{graph}");
    let forced = found["removal_order"]["forced"].as_array().expect("a list");
    assert_eq!((forced.len(), &forced[0]["id"]), (1, &json!(1)), "{forced:?}");
    let order: Vec<u64> = serde_json::from_value(found["removal_order"]["order"].clone()).expect("ids");
    assert_eq!(order.len(), 3);
}

/// Scenes at rest: every object is carried, forces are in equilibrium, and the order never removes a supporter first.
#[test]
fn piles_at_rest_are_carried_by_the_table() {
    for seed in [1, 2, 3] {
        let mut scene = table_scene();
        drop_objects(&mut scene, &kit_objects(), 20, seed);
        settle("", &mut scene);
        let scene = frozen(scene);
        let found = relations_of(&scene, "");
        let graph = &found["support_graph"];
        assert_eq!(graph["floating"], json!([]), "seed {seed}");
        assert_eq!(graph["moving"], json!([]), "seed {seed}");
        let edges = edges(&found);
        // A path from a root to every object.
        let mut reached: Vec<u64> = serde_json::from_value(graph["roots"].clone()).expect("ids");
        while let Some((_, next)) = edges.keys().find(|(i, j)| reached.contains(i) && !reached.contains(j)) {
            reached.push(*next);
        }
        for body in scene.objects() {
            assert!(reached.contains(&u64::from(body.id.0)), "seed {seed}: {} is not carried", body.asset);
        }
        // Forces and moments of gravity and of all contacts cancel.
        for body in scene.objects() {
            let center = body.world_from_body * body.mass.center;
            let (mut force, mut moment) = (Vector3::new(0.0, 0.0, -body.mass.kg * G), Vector3::zeros());
            for contact in found["contacts"].as_array().expect("contacts") {
                let side = contact["ids"].as_array().expect("ids").iter().position(|id| *id == json!(body.id.0));
                let Some(side) = side else { continue };
                for point in contact["points"].as_array().expect("points") {
                    let of = vector(&point["force_world_n"]) * if side == 1 { 1.0 } else { -1.0 };
                    force += of;
                    moment += (vector(&point["point_world_m"]) - center.coords).cross(&of);
                }
            }
            let weight = body.mass.kg * G;
            let (force, moment) = (force.norm() / weight, moment.norm() / (weight * 0.05));
            assert!(force < 0.06 && moment < 0.06, "seed {seed}: {} is off by {force} and {moment}", body.asset);
        }
        let order: Vec<u64> = serde_json::from_value(found["removal_order"]["order"].clone()).expect("ids");
        assert_eq!(order.len(), scene.objects().len());
        let forced = found["removal_order"]["forced"].as_array().expect("a list");
        let place = |id: u64| order.iter().position(|it| *it == id);
        for (supporter, supported) in edges.into_keys() {
            let is_forced = forced.iter().any(|it| it["id"] == json!(supporter));
            let (Some(under), Some(over)) = (place(supporter), place(supported)) else { continue };
            assert!(over < under || is_forced, "seed {seed}: {supporter} goes before {supported}");
        }
    }
}

#[test]
fn the_ground_counts_where_there_is_no_floor() {
    let mut scene = SceneBuilder::default();
    scene.supports = Support::new("table", Region::rectangle([0.0; 3], [1.0; 2])).into();
    scene.add(dynamic(&block("cube", [0.1; 3], 1.0), at(0.0, 0.0, 0.05)));
    let found = relations_of(&frozen(scene), "");
    assert_eq!(edges(&found).into_keys().collect::<Vec<_>>(), [(0, 1)]);
    let mut scene = SceneBuilder::default();
    scene.supports = Support::new("table", Region::rectangle([0.0; 3], [1.0; 2])).into();
    let floor = object("floor", cuboid([0.0; 3], [4.0, 4.0, 0.0]), 1.0);
    scene.add(draft(&floor, at(0.0, 0.0, 0.0), Role::Room, Motion::Fixed));
    scene.add(dynamic(&block("cube", [0.1; 3], 1.0), at(0.0, 0.0, 0.05)));
    let found = relations_of(&frozen(scene), "");
    assert_eq!(edges(&found).into_keys().collect::<Vec<_>>(), [(2, 1)]);
}

#[test]
fn collision_shapes_are_the_shapes_of_the_simulation() {
    let mut scene = table_scene();
    let cube = object("cube", cuboid([0.0; 3], [0.05, 0.06, 0.07]), 0.2);
    scene.add(dynamic(&cube, at(0.1, 0.05, TABLE_HEIGHT + 0.2)));
    settle("", &mut scene);
    let size = cube.mesh.bounds().size();
    let scene = frozen(scene);
    let found = products_of::<syntable_physics::CollisionShapes>(&scene, "", &["collision_shapes"]);
    let entries = found["collision_shapes"].as_array().expect("a list");
    assert_eq!(entries.len(), scene.bodies().len() + 1, "the last one is the ground");
    let body = &scene.objects()[0];
    assert_eq!((&entries[0]["id"], &entries[0]["is_dynamic"]), (&json!(1), &json!(true)));
    assert_eq!(entries[0]["mass_kg"].as_f64(), Some(body.mass.kg));
    let parts: Vec<Vec<[f64; 3]>> = serde_json::from_value(entries[0]["parts_body_m"].clone()).expect("points");
    let [part] = &parts[..] else { panic!("{parts:?}") };
    assert_eq!(part.len(), 8);
    assert!(part.iter().all(|p| (0..3).all(|k| (p[k].abs() - size[k] / 2.0).abs() < 1e-4)), "{part:?}");
    // The tabletop carries the cube: its parts reach up to the height of the support, and no part is above it.
    let table = scene.bodies().iter().position(|body| body.role == Role::Support).expect("a table");
    let pose = scene.bodies()[table].world_from_body;
    let parts: Vec<Vec<[f64; 3]>> = serde_json::from_value(entries[table]["parts_body_m"].clone()).expect("points");
    let heights = parts.iter().flatten().map(|p| (pose * syntable_model::geometry::Point3::from(*p)).z);
    let top = heights.fold(f64::NEG_INFINITY, f64::max);
    assert!((top - TABLE_HEIGHT).abs() < 1e-3, "{top}");
    // The floor is everything below it.
    let floor = scene.bodies().iter().position(|body| body.role == Role::Room).expect("a floor");
    let half_space = &entries[floor]["half_spaces_world"][0];
    assert_eq!(vector(&half_space["normal"]), Vector3::z());
    assert!(vector(&half_space["point_m"]).z.abs() < 1e-6, "{half_space}");
}
