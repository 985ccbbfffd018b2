//! Annotators of boxes, objects, cameras, lights and settling.

use crate::common::{Rays, World, stage};
use serde_json::json;
use syntable_model::geometry::Vector3;
use syntable_model::prelude::*;
use syntable_model::product::standard::*;
use syntable_model::product::{Lighting, ObjectDepths, Scope};
use syntable_model::registry::Stage;
use syntable_model::scene::{Light, RectLight, Removal, SphereLight};

fn run(world: &World, kind: &str, options: &str, products: &mut Products) {
    match stage(kind, options) {
        Stage::AnnotateImage(annotator) => annotator.annotate(&world.of_view(), products),
        Stage::AnnotateView(annotator) => annotator.annotate(&world.of_view(), products),
        Stage::AnnotateScene(annotator) => annotator.annotate(&world.of_scene(), &[], products),
        _ => panic!("`{kind}` does not annotate"),
    }
    .expect("made");
}

fn json(products: &Products, name: &str) -> serde_json::Value {
    serde_json::to_value(products.value(name).expect("made")).expect("serializes")
}

#[test]
fn every_kind_conforms() {
    use syntable_annotate as _;
    use syntable_testing::conformance;
    let registry = syntable_model::registry::Registry::linked().expect("kinds are unique");
    let kinds: Vec<_> = registry.entries().iter().map(|entry| entry.kind).collect();
    let all = [
        "amodal_depth",
        "amodal_normal",
        "bodies",
        "boxes",
        "camera",
        "cuboids",
        "depth_relations",
        "distance",
        "identity",
        "keypoints",
        "label_arrays",
        "lights",
        "masks",
        "material_map",
        "material_statistics",
        "materials",
        "object_coordinates",
        "object_info",
        "object_models",
        "occlusion_boundary",
        "occlusion_graph",
        "optical_flow",
        "outlines",
        "rotated_boxes",
        "scene_masks",
        "seen_in_views",
        "settle_report",
        "soft_masks",
        "visibility",
    ];
    assert_eq!(kinds, all);
    let world = World::new(2);
    let rays = Rays::new([8, 6], [8, 6], 2, |x, _| if x < 4 { vec![1, 2] } else { vec![3, 2] });
    let mut rendered = Products::new();
    rendered.put(INSTANCE, rays.instance()).expect("first");
    rendered.put(DEPTH, rays.instance().map(|id| f32::from(id.0))).expect("first");
    rendered.put(COVERAGE, rays.coverage(COVERAGE)).expect("first");
    let canvas = COVERAGE.on_canvas(3);
    rendered.put(canvas, rays.coverage(canvas)).expect("first");
    rendered.put(OBJECT_DEPTHS, ObjectDepths::from_hits(8, 6, Vec::new())).expect("first");
    let [width, height] = Atlas::of(rendered.get(COVERAGE).expect("put")).size;
    let normals = NORMAL.of_objects(Lighting::Alone);
    rendered.put(normals, Plane::from_fn(width, height, |_, _| [0.0, 0.0, -1.0])).expect("first");
    rendered.put(DEPTH.of_next_view(), rays.instance().map(|_| 2.0)).expect("first");
    let fine = Rays::new([32, 24], [0, 0], 2, |x, _| if x < 16 { vec![1, 2] } else { vec![3, 2] });
    rendered.put(INSTANCE.in_subpixels(4), fine.instance()).expect("first");
    rendered.put(COVERAGE.in_subpixels(4), fine.coverage(COVERAGE)).expect("first");
    let mut labeled = rendered.clone();
    run(&world, "masks", "", &mut labeled);
    let annotated = labeled.get(AMODAL_MASK).expect("made").map(|_, _| 1_u32);
    labeled.put(CATEGORY_ID, annotated).expect("first");
    for entry in registry.entries() {
        conformance::entry(entry);
        let products = if entry.kind == "masks" { &rendered } else { &labeled };
        match stage(entry.kind, "") {
            Stage::AnnotateScene(annotator) => {
                let mut made = Products::new();
                annotator.annotate(&world.of_scene(), &[], &mut made).expect("reads nothing");
                assert_eq!(made.keys(), annotator.provides(), "{}", entry.kind);
                assert!(made.keys().iter().all(|key| key.scope == Scope::Scene), "{}", entry.kind);
            }
            of_views => drop(conformance::annotator(&of_views, &world.of_view(), products)),
        }
    }
    conformance::annotator(&stage("masks", "image_frame = \"extend\""), &world.of_view(), &rendered);
}

#[test]
fn values_outside_the_limits_of_the_schema_are_rejected() {
    let registry = syntable_model::registry::Registry::linked().expect("kinds are unique");
    let masks = registry.entries().iter().find(|entry| entry.kind == "masks").expect("registered");
    assert!(masks.construct_str("max_occlusion_rate = 1.0").is_ok());
    assert!(masks.construct_str("max_occlusion_rate = 1.5").is_err());
}

#[test]
fn the_occlusion_graph_names_objects_by_their_ids() {
    let world = World::new(4);
    // 1 and 3 occlude each other, 3 occludes 4, and 2 is next to them.
    let rays = Rays::new([8, 6], [0, 0], 4, |x, y| match (x, y) {
        (0, 0) => vec![1, 3],
        (1, 0) => vec![3, 1],
        (2, 0) => vec![3, 4],
        (3, 0) => vec![4],
        (7, 5) => vec![2],
        _ => vec![],
    });
    let mut products = Products::new();
    products.put(INSTANCE, rays.instance()).expect("first");
    products.put(COVERAGE, rays.coverage(COVERAGE)).expect("first");
    run(&world, "masks", "", &mut products);
    run(&world, "occlusion_graph", "", &mut products);
    let layers = json!({ "1": "intermediate", "2": "top", "3": "intermediate", "4": "bottom" });
    assert_eq!(json(&products, "occlusion_layer"), layers);
    let graph = json!({
        "edges": [[1, 3], [3, 1], [3, 4]],
        "components": [[1, 3, 4], [2]],
        "cycles": [[1, 3]],
        "depth_layers": [[1, 2, 3], [4]],
    });
    assert_eq!(json(&products, "occlusion_graph"), graph);
}

#[test]
fn cuboids_are_projected_as_a_pinhole_does() {
    let mut world = World::new(2);
    let rays = Rays::new([8, 6], [0, 0], 2, |_, _| vec![2]);
    let mut products = Products::new();
    products.put(INSTANCE, rays.instance()).expect("first");
    products.put(COVERAGE, rays.coverage(COVERAGE)).expect("first");
    run(&world, "masks", "", &mut products);
    let mut labeled = products.clone();
    run(&world, "cuboids", "", &mut labeled);
    let cuboids = json(&labeled, "cuboid");
    assert!(cuboids.get("1").is_none(), "an object that is not annotated");
    let cuboid = &cuboids["2"];
    let close = |found: &serde_json::Value, wanted: &[f64]| {
        let found: Vec<f64> = found.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect();
        assert_eq!(found.len(), wanted.len());
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}, not {wanted:?}");
    };
    close(&cuboid["size_m"], &[0.1; 3]);
    // The object is the second remaining one, at x = 0.02; the camera is at (1, 0, 1.5) and looks at (0, 0, 0.7).
    let eye = Vector3::new(1.0, 0.0, 1.5);
    let forward = (Vector3::new(0.0, 0.0, 0.7) - eye).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let down = forward.cross(&right);
    for number in 0..8 {
        let bit = |k: usize| f64::from(number as u32 >> k & 1);
        let corner = Vector3::new(0.02, 0.0, 0.7) + 0.1 * Vector3::new(bit(0), bit(1), bit(2));
        let seen = corner - eye;
        let [x, y, z] = [right, down, forward].map(|axis| axis.dot(&seen));
        close(&cuboid["corners_world_m"][number], corner.as_slice());
        close(&cuboid["corners_camera_m"][number], &[x, y, z]);
        close(&cuboid["corners_px"][number], &[7.0 * x / z + 4.0, 7.5 * y / z + 3.0]);
    }
    let center = Vector3::new(0.07, 0.05, 0.75) - eye;
    for (row, axis) in [right, down, forward].iter().enumerate() {
        close(&cuboid["camera_from_cuboid"][row], &[axis.x, axis.y, axis.z, axis.dot(&center)]);
    }
    // From inside, half of the corners are behind the camera.
    world.view.camera.world_from_camera = Pose::translation(0.07, 0.05, 0.75);
    run(&world, "cuboids", "", &mut products);
    let inside = &json(&products, "cuboid")["2"]["corners_px"];
    let seen: Vec<bool> = inside.as_array().expect("a list").iter().map(|corner| !corner.is_null()).collect();
    assert_eq!(seen, [false, false, false, false, true, true, true, true]);
}

#[test]
fn boxes_are_tight() {
    let world = World::new(2);
    let rays = Rays::new([8, 6], [0, 0], 2, |x, y| match (x, y) {
        (2..=4, 1..=2) => vec![1, 2],
        (6, 5) => vec![2],
        _ => vec![],
    });
    let mut products = Products::new();
    products.put(INSTANCE, rays.instance()).expect("first");
    products.put(COVERAGE, rays.coverage(COVERAGE)).expect("first");
    run(&world, "masks", "", &mut products);
    run(&world, "boxes", "", &mut products);
    assert_eq!(json(&products, "visible_box"), json!({ "1": [2, 1, 3, 2], "2": [6, 5, 1, 1] }));
    assert_eq!(json(&products, "amodal_box"), json!({ "1": [2, 1, 3, 2], "2": [2, 1, 5, 5] }));
}

#[test]
fn objects_are_described_with_their_poses() {
    let world = World::new(2);
    let mut products = Products::new();
    let masks = PerInstance::from_iter([(InstanceId(2), Mask::empty(8, 6))]);
    products.put(AMODAL_MASK, masks).expect("first");
    run(&world, "object_info", "", &mut products);
    let info = json(&products, "object_info");
    assert_eq!(info.as_object().map(|map| map.keys().cloned().collect::<Vec<_>>()), Some(vec!["2".to_owned()]));
    let object = &info["2"];
    assert_eq!(object["asset"], json!("pool/tetra"));
    assert_eq!((&object["name"], &object["category"]), (&json!("tetra"), &json!("solid")));
    assert_eq!((&object["spawn"], &object["mass_kg"]), (&json!(2), &json!(0.25)));
    assert_eq!((&object["mass_origin"], &object["mass_distribution"]), (&json!("known"), &json!("volume")));
    // A tetrahedron of three legs a along the axes: its center is a/4 from each face, and by symmetry of the legs I = m
    // a²/80 · 6 on the diagonal and m a²/80 off it.
    let number = |value: &serde_json::Value| value.as_f64().expect("a number");
    for row in 0..3 {
        assert!((number(&object["center_of_mass_m"][row]) - 0.025).abs() < 1e-8);
        for column in 0..3 {
            let wanted = 0.25 * 0.01 / 80.0 * if row == column { 6.0 } else { 1.0 };
            assert!((number(&object["inertia_kg_m2"][row][column]) - wanted).abs() < 1e-9);
        }
    }
    assert_eq!(
        object["world_from_object"],
        json!([[1.0, 0.0, 0.0, 0.02], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.7], [0.0, 0.0, 0.0, 1.0]])
    );
    // camera_from_object maps the body's origin to its position in the camera frame.
    let column: Vec<f64> = (0..3).map(|row| object["camera_from_object"][row][3].as_f64().expect("a number")).collect();
    let origin = world.view.camera.world_from_camera.inverse() * syntable_model::geometry::Point3::new(0.02, 0.0, 0.7);
    assert!((0..3).all(|i| (column[i] - origin[i]).abs() < 1e-12), "{column:?} {origin}");

    let mut products = Products::new();
    run(&world, "object_info", "objects = \"all\"", &mut products);
    run(&world, "bodies", "", &mut products);
    let bodies = json(&products, "bodies");
    let bodies = bodies.as_array().expect("a list");
    let expected: Vec<_> = world.scene.bodies().iter().map(|body| (json!(body.id.0), json!(body.role))).collect();
    assert_eq!(bodies.iter().map(|body| (body["id"].clone(), body["role"].clone())).collect::<Vec<_>>(), expected);
    assert!(bodies.iter().all(|body| body["materials"].as_array().is_some_and(|names| !names.is_empty())));
    assert_eq!(products.get(OBJECT_INFO).expect("made").0.len(), 2);

    // Both objects share one asset, whose mesh is in the frame of `object_info`.
    run(&world, "object_models", "", &mut products);
    let models = json(&products, "object_models");
    assert_eq!(models.as_array().expect("a list").len(), 1);
    let info = &json(&products, "object_info")["1"];
    assert_eq!(models[0]["asset"], info["asset"]);
    let vertices = models[0]["vertices_m"].as_array().expect("vertices");
    let corner = |of: fn(f64, f64) -> f64| {
        let axis = |i: usize| vertices.iter().map(|v| v[i].as_f64().expect("a number")).reduce(of).expect("some");
        json!([axis(0), axis(1), axis(2)])
    };
    assert_eq!(json!([corner(f64::min), corner(f64::max)]), info["bounds_m"]);
    assert_eq!(models[0]["triangles"].as_array().expect("triangles").len(), 4);
}

#[test]
fn visibility_counts_the_pixels_of_all_rays() {
    let (mut hidden, mut truncated) = (0, 0);
    for seed in 0..40 {
        let objects = 5;
        let world = World::new(objects);
        let rays = Rays::random([8, 6], objects, seed);
        let mut products = Products::new();
        products.put(INSTANCE, rays.instance()).expect("first");
        let depth = |id: &InstanceId| if id.0 % 2 == 1 { 1.0 } else { f32::INFINITY };
        products.put(DEPTH, rays.instance().map(depth)).expect("first");
        products.put(COVERAGE, rays.coverage(COVERAGE)).expect("first");
        let canvas = COVERAGE.on_canvas(3);
        products.put(canvas, rays.coverage(canvas)).expect("first");
        let mut labeled = products.clone();
        run(&world, "masks", "", &mut labeled);
        run(&world, "visibility", "", &mut labeled);
        run(&world, "visibility", "objects = \"all\"", &mut products);
        let (annotated, all) = (json(&labeled, "visibility"), json(&products, "visibility"));
        let masks = labeled.get(AMODAL_MASK).expect("made");
        assert_eq!(annotated.as_object().expect("by id").len(), masks.iter().count());
        assert_eq!(all.as_object().expect("by id").len(), objects);
        for id in 1..=objects as u16 {
            let inside = |x: i32, y: i32| (0..8).contains(&x) && (0..6).contains(&y);
            let pixels = (-6..12).flat_map(|y| (-8..16).map(move |x| (x, y)));
            let whole: Vec<(i32, i32)> = pixels.filter(|&(x, y)| rays.cover(x, y, false).contains(&id)).collect();
            let in_frame = || whole.iter().filter(|&&(x, y)| inside(x, y));
            let visible = in_frame().filter(|&&(x, y)| rays.at(x, y).first() == Some(&id)).count();
            let valid = in_frame().filter(|&&(x, y)| rays.at(x, y).first().copied().unwrap_or(0) % 2 == 1).count();
            let got = &all[id.to_string()];
            let want = [whole.len(), in_frame().count(), valid, visible];
            let names = ["px_count_all", "px_count_in_frame", "px_count_valid", "px_count_visib"];
            assert_eq!(names.map(|name| got[name].as_u64().expect("a count") as usize), want, "{seed} {id}");
            if let (Some(x), Some(y)) = (whole.iter().map(|p| p.0).min(), whole.iter().map(|p| p.1).min()) {
                let right = whole.iter().map(|p| p.0).max().expect("some");
                let bottom = whole.iter().map(|p| p.1).max().expect("some");
                assert_eq!(got["silhouette_box"], json!([x, y, right - x + 1, bottom - y + 1]), "{seed} {id}");
                assert_eq!(got["visib_fract"], json!(visible as f64 / whole.len() as f64), "{seed} {id}");
            }
            match masks.get(InstanceId(id)) {
                Some(_) => assert_eq!(annotated[id.to_string()], *got, "{seed} {id}"),
                None => assert!(annotated.get(id.to_string()).is_none(), "{seed} {id}"),
            }
            hidden += usize::from(visible == 0);
            truncated += usize::from(want[0] > want[1]);
        }
    }
    assert!(hidden > 20 && truncated > 20, "{hidden} {truncated}");
}

#[test]
fn the_camera_projects_its_world() {
    let world = World::new(1);
    let mut products = Products::new();
    run(&world, "camera", "", &mut products);
    let camera = json(&products, "camera");
    assert_eq!(camera["K"], json!([[7.0, 0.0, 4.0], [0.0, 7.5, 3.0], [0.0, 0.0, 1.0]]));
    assert_eq!((&camera["width"], &camera["height"]), (&json!(8), &json!(6)));
    // The camera looks from (1, 0, 1.5) at (0, 0, 0.7): that point lies on the axis, √1.64 m away.
    let row = |name: &str, row: usize| -> Vec<f64> {
        (0..4).map(|column| camera[name][row][column].as_f64().expect("a number")).collect()
    };
    let target = [0.0, 0.0, 0.7, 1.0];
    let p: Vec<f64> =
        (0..4).map(|i| row("camera_from_world", i).iter().zip(target).map(|(a, b)| a * b).sum()).collect();
    assert!(p[0].abs() < 1e-12 && p[1].abs() < 1e-12 && (p[2] - 1.64_f64.sqrt()).abs() < 1e-12, "{p:?}");
    let eye: Vec<f64> = (0..3).map(|i| row("world_from_camera", i)[3]).collect();
    assert_eq!(eye, [1.0, 0.0, 1.5]);
}

#[test]
fn lights_and_the_settle_report_are_recorded() {
    use syntable_model::geometry::{Point3, Vector3};
    let mut world = World::new(1);
    world.view.lights = vec![
        Light::Sphere(SphereLight { center: Point3::new(1.0, 2.0, 3.0), radius: 0.25, radiance: [1.0, 2.0, 3.0] }),
        Light::Rect(RectLight {
            center: Point3::new(0.0, 0.0, 2.0),
            half_u: Vector3::new(0.0, 1.0, 0.0),
            half_v: Vector3::new(1.0, 0.0, 0.0),
            radiance: [4.0; 3],
        }),
    ];
    world.scene.settle.removed.push(Removal {
        spawn: 0,
        asset: world.scene.objects()[0].asset.clone(),
        reason: "fell off the table".into(),
    });
    let mut products = Products::new();
    run(&world, "lights", "", &mut products);
    run(&world, "settle_report", "", &mut products);
    let lights = json(&products, "lights");
    assert_eq!(lights[0]["center_world_m"], json!([1.0, 2.0, 3.0]));
    assert_eq!(lights[0]["radiance_nits"], json!([1.0, 2.0, 3.0]));
    assert_eq!((&lights[1]["shape"], &lights[1]["normal_world"]), (&json!("rect"), &json!([0.0, 0.0, -1.0])));
    let report = json(&products, "settle_report");
    assert_eq!((&report["objects"], &report["attempt"]), (&json!(1), &json!(1)));
    assert_eq!(report["removed"], json!([{ "spawn": 0, "asset": "pool/tetra", "reason": "fell off the table" }]));
}

#[test]
fn records_keep_their_fields_and_their_order() {
    use syntable_model::geometry::{Point3, Vector3};
    use syntable_model::scene::{DirectionalLight, DiskLight, Distortion, EnvironmentLight, EnvironmentMap, ThinLens};
    let names = |value: &Value| match value {
        Value::Record(fields) => fields.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>().join(" "),
        other => panic!("{other:?}"),
    };
    let mut world = World::new(1);
    world.view.camera.distortion = Some(Distortion::brown_conrady([1.0, 2.0, 3.0], [4.0, 5.0]));
    world.view.camera.lens = Some(ThinLens { aperture_radius_m: 0.01, focus_distance_m: 1.5 });
    let (up, white) = (Vector3::z(), [1.0; 3]);
    world.view.lights = vec![
        Light::Disk(DiskLight { center: Point3::origin(), normal: up, radius: 0.5, radiance: white }),
        Light::Directional(DirectionalLight { towards: up, half_angle: std::f64::consts::PI / 4.0, irradiance: white }),
        Light::Environment(EnvironmentLight {
            map: std::sync::Arc::new(EnvironmentMap::constant([1.0; 3])),
            scale: white,
            rotation: std::f64::consts::PI,
        }),
    ];
    let mut products = Products::new();
    run(&world, "camera", "", &mut products);
    run(&world, "lights", "", &mut products);
    run(&world, "settle_report", "", &mut products);
    run(&world, "object_info", "objects = \"all\"", &mut products);
    assert_eq!(
        names(&products.value("camera").expect("made")),
        concat!(
            "width height K world_from_camera camera_from_world camera_axes world_axes length_unit ",
            "pixel_centres ", // typos: ignore
            "distortion_k1_k2_p1_p2_k3 aperture_radius_m focus_distance_m"
        )
    );
    assert_eq!(json(&products, "camera")["distortion_k1_k2_p1_p2_k3"], json!([1.0, 2.0, 4.0, 5.0, 3.0]));
    let Ok(Value::List(lights)) = products.value("lights") else { panic!("a list") };
    assert_eq!(
        lights.iter().map(names).collect::<Vec<_>>(),
        [
            "shape center_world_m normal_world radius_m radiance_nits",
            "shape towards_world half_angle_deg irradiance_lx",
            "shape map scale_nits rotation_deg"
        ]
    );
    let lights = json(&products, "lights");
    assert_eq!((&lights[1]["half_angle_deg"], &lights[2]["rotation_deg"]), (&json!(45.0), &json!(180.0)));
    assert_eq!(
        names(&products.value("settle_report").expect("made")),
        "objects attempt simulated_s residual_speed_m_s residual_angular_speed_rad_s deepest_penetration_m collision_deviation_m respawned removed \
         removed_distractors spare"
    );
    run(&world, "bodies", "", &mut products);
    let Ok(Value::List(bodies)) = products.value("bodies") else { panic!("a list") };
    assert_eq!(names(&bodies[0]), "id role pool name category materials world_from_body");
    let Ok(Value::PerInstance(objects)) = products.value("object_info") else { panic!("one record per object") };
    assert_eq!(
        objects.values().map(names).collect::<Vec<_>>(),
        [
            "asset pool name category spawn bounds_m model_origin_m mass_kg mass_origin mass_distribution center_of_mass_m inertia_kg_m2 license digest world_from_object camera_from_object"
        ]
    );
}

#[test]
fn visibility_counts_the_rays_of_the_canvas() {
    let world = World::new(2);
    // Object 1 reaches beyond the left edge, object 2 is partly hidden by it; the table covers nothing.
    let cover = |x: i32, y: i32| match (x, y) {
        (-3..=1, 1..=2) => vec![1],
        (2..=3, 1..=2) => vec![1, 2],
        (4..=5, 1..=2) => vec![2],
        _ => vec![],
    };
    let rays = Rays::new([8, 6], [8, 6], 2, cover);
    let mut products = Products::new();
    products.put(INSTANCE, rays.instance()).expect("first");
    products.put(COVERAGE, rays.coverage(COVERAGE)).expect("first");
    let canvas = COVERAGE.on_canvas(3);
    products.put(canvas, rays.coverage(canvas)).expect("first");
    // One pixel of object 1 has no depth.
    let mut depth = rays.instance().map(|id| if id.0 == 0 { f32::INFINITY } else { 1.0 });
    depth.data_mut()[8] = 0.0;
    products.put(DEPTH, depth).expect("first");
    run(&world, "masks", "", &mut products);
    let mut world = world;
    (world.view.camera.intrinsics.width, world.view.camera.intrinsics.height) = (8, 6);
    run(&world, "visibility", "", &mut products);
    let expected = json!({
        "1": { "px_count_all": 14, "px_count_in_frame": 8, "px_count_valid": 7, "px_count_visib": 8, "visib_fract": 8.0 / 14.0,
               "outside_fract": 6.0 / 14.0, "truncated": true, "silhouette_box": [-3, 1, 7, 2] },
        "2": { "px_count_all": 8, "px_count_in_frame": 8, "px_count_valid": 8, "px_count_visib": 4, "visib_fract": 0.5,
               "outside_fract": 0.0, "truncated": false, "silhouette_box": [2, 1, 4, 2] },
    });
    assert_eq!(json(&products, "visibility"), expected);
}

/// A view of an image of this size, with all products that annotators read, from its rays; body `i` is `i` meters away.
fn rendered(rays: &Rays, size: [u32; 2], objects: u16) -> (World, Products) {
    let mut world = World::new(usize::from(objects));
    (world.view.camera.intrinsics.width, world.view.camera.intrinsics.height) = (size[0], size[1]);
    let mut products = Products::new();
    products.put(INSTANCE, rays.instance()).expect("first");
    products.put(COVERAGE, rays.coverage(COVERAGE)).expect("first");
    let depth = |x: u32, y: u32| rays.at(x as i32, y as i32).first().map_or(f32::INFINITY, |&id| f32::from(id));
    products.put(DEPTH, Plane::from_fn(size[0], size[1], depth)).expect("first");
    let mut hits = Vec::new();
    for (x, y) in (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y))) {
        let on_ray = rays.at(x as i32, y as i32);
        let objects = on_ray.iter().enumerate().filter(|(_, id)| **id <= objects);
        hits.extend(objects.map(|(place, &id)| (y * size[0] + x, InstanceId(id), 1.0 + place as f32)));
    }
    products.put(OBJECT_DEPTHS, ObjectDepths::from_hits(size[0], size[1], hits)).expect("first");
    run(&world, "masks", "min_visible_px = 0", &mut products);
    (world, products)
}

/// Compared with a count pixel by pixel.
#[test]
fn areas_of_occlusion_match_the_rays() {
    for (objects, seed) in [(2, 1), (9, 2), (70, 3)] {
        let rays = Rays::random([24, 17], objects, seed);
        let (world, mut products) = rendered(&rays, [24, 17], objects as u16);
        run(&world, "depth_relations", "", &mut products);
        let areas = json(&products, "occlusion_areas");
        let ids: Vec<u16> = serde_json::from_value(areas["ids"].clone()).expect("ids");
        let mut expected = [(); 3].map(|()| vec![vec![0_u32; ids.len()]; ids.len()]);
        for (x, y) in (0..17).flat_map(|y| (0..24).map(move |x| (x, y))) {
            let on_ray: Vec<u16> = rays.at(x, y).iter().copied().filter(|&id| usize::from(id) <= objects).collect();
            let first = rays.at(x, y).first();
            for (i, front) in on_ray.iter().enumerate() {
                for (j, hidden) in on_ray.iter().enumerate().skip(i + 1) {
                    let [Ok(row), Ok(column)] = [front, hidden].map(|id| ids.binary_search(id)) else { continue };
                    expected[0][row][column] += u32::from(first == Some(front));
                    expected[1][row][column] += u32::from(j == i + 1);
                    expected[2][row][column] += 1;
                }
            }
        }
        for (name, expected) in ["seen", "direct", "all"].into_iter().zip(&expected) {
            assert_eq!(areas[name], json!(expected), "{name} of {objects}");
        }
        // The occlusion order agrees with the visible areas.
        let order = products.get(OCCLUSION_ORDER).expect("made");
        for (row, column) in (0..ids.len()).flat_map(|row| (0..ids.len()).map(move |column| (row, column))) {
            assert_eq!(order.occludes(row, column), expected[0][row][column] > 0, "{row} {column}");
        }
        let depths = json(&products, "depth_order");
        let medians: Vec<f64> = serde_json::from_value(depths["median_depth_m"].clone()).expect("numbers");
        assert!(medians.is_sorted() && medians.len() == ids.len());
    }
}

#[test]
fn edges_say_who_is_in_front() {
    // Body 1 in front of body 2, and the table, 3, in front of nothing: rows of three columns each.
    let rays = Rays::new([6, 2], [0, 0], 2, |x, _| {
        if x < 2 {
            vec![1, 2]
        } else if x < 4 {
            vec![2]
        } else {
            vec![]
        }
    });
    let (world, mut products) = rendered(&rays, [6, 2], 2);
    run(&world, "occlusion_boundary", "", &mut products);
    assert_eq!(products.get(OCCLUSION_BOUNDARY).expect("made").data()[..6], [0, 1, 2, 1, 2, 0]);
}

#[test]
fn depth_of_hidden_parts_matches_the_object_alone() {
    let rays = Rays::new([4, 1], [0, 0], 2, |x, _| [vec![1], vec![1, 2], vec![2], vec![]][x as usize].clone());
    let (mut world, mut products) = rendered(&rays, [4, 1], 2);
    let k = &mut world.view.camera.intrinsics;
    (k.fx, k.fy, k.cx, k.cy) = (1.0, 1.0, 0.5, 0.5);
    for kind in ["amodal_depth", "object_coordinates", "distance", "identity", "scene_masks"] {
        run(&world, kind, "", &mut products);
    }
    let depths = products.get(AMODAL_DEPTH).expect("made");
    let of = |id: u16| depths.whole(InstanceId(id)).expect("annotated").data().to_vec();
    assert_eq!(of(1), [1.0, 1.0, f32::INFINITY, f32::INFINITY]);
    assert_eq!(of(2), [f32::INFINITY, 2.0, 1.0, f32::INFINITY]);
    // The ray through the third pixel has the slope 2.
    let distance = products.get(DISTANCE).expect("made").data().to_vec();
    assert!((f64::from(distance[0]) - 1.0).abs() < 1e-6 && (f64::from(distance[2]) - 2.0 * 5_f64.sqrt()).abs() < 1e-6);
    assert_eq!(distance[3], f32::INFINITY);
    // A point of an object is at the position that its pose gives.
    let coordinates = products.get(AMODAL_OBJECT_COORDINATES).expect("made").whole(InstanceId(2)).expect("annotated");
    let body = world.scene.body(InstanceId(2)).expect("there");
    let point = world.view.camera.world_from_camera * syntable_model::geometry::Point3::new(2.0, 0.0, 2.0);
    let bounds = body.object.mesh.bounds();
    let place = (body.world_from_body.inverse() * point - bounds.center()) / bounds.size().norm();
    for axis in 0..3 {
        let expected = (place[axis] + 0.5).clamp(0.0, 1.0);
        assert!((f64::from(coordinates.at(1, 0)[axis]) - expected).abs() < 1e-5);
    }
    assert_eq!(*coordinates.at(0, 0), [0.0; 3]);
    assert_eq!(*products.get(OBJECT_COORDINATES).expect("made").at(3, 0), [0.0; 3]);
    let count = |key: Key<Mask>| products.get(key).expect("made").area();
    assert_eq!((count(BACKGROUND_MASK), count(TABLETOP_MASK)), (1, 0));
    assert_eq!(products.get(CATEGORY_MAP).expect("made").data(), [1, 1, 1, 0]);
}

#[test]
fn hidden_normals_match_the_objects_window() {
    // Object 1 hides the left half of object 2; the third covers nothing.
    let rays = Rays::new([12, 9], [0, 0], 3, |x, y| match (x, y) {
        (4..=5, 3..=6) => vec![1, 2],
        (2..=3, 3..=6) => vec![1],
        (6..=8, 4..=6) => vec![2],
        _ => vec![],
    });
    let (world, mut products) = rendered(&rays, [12, 9], 3);
    let atlas = Atlas::of(products.get(COVERAGE).expect("put"));
    // Position in the image and index of the object, as a normal.
    let mut normal = Plane::from_fn(atlas.size[0], atlas.size[1], |_, _| [9.0; 3]);
    for tile in &atlas.tiles {
        let (window, id) = (tile.window, f32::from(tile.id.0));
        let place = |x: u32, y: u32| [(window.x + x as i32) as f32, (window.y + y as i32) as f32, id];
        normal.paste(tile.at, &Plane::from_fn(window.width, window.height, place));
    }
    products.put(NORMAL.of_objects(Lighting::Alone), normal).expect("first");
    run(&world, "amodal_normal", "", &mut products);
    let images = products.get(AMODAL_NORMAL).expect("made");
    assert_eq!(images.iter().map(|(id, _)| id.0).collect::<Vec<_>>(), [1, 2]);
    for id in [1, 2] {
        let image = images.whole(InstanceId(id)).expect("annotated");
        for (x, y) in (0..9).flat_map(|y| (0..12).map(move |x| (x, y))) {
            let want = match rays.at(x, y).contains(&id) {
                true => [x as f32, y as f32, f32::from(id)],
                false => [0.0; 3],
            };
            assert_eq!(*image.at(x as u32, y as u32), want, "object {id} at ({x}, {y})");
        }
    }
}
