//! Whole datasets, read back by an independent reader (`check_dataset.py`: pycocotools, NumPy, Pillow).

use crate::support::{assets, check_dataset as check, ok, small_run, syntable};

#[test]
fn the_quickstart_dataset_is_right() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("data");
    ok(&mut small_run(&out, &["--set", "camera.resolution=[160, 120]", "--set", "place[2].count=12"]));
    check(&out, &[]);
}

#[test]
fn crowded_scenes_of_every_policy_are_right() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, policy) in [
        ("occlude", "{ table_and_room = \"occlude\" }"),
        ("clip", "{ table_and_room = \"clip\" }"),
        ("hidden", "{ min_visible_px = 0 }"),
        ("extend", "{ image_frame = \"extend\" }"),
    ] {
        let out = folder.path().join(name);
        let set = format!("annotate.masks={policy}");
        ok(&mut small_run(
            &out,
            &["--set", "camera.resolution=[160, 120]", "--set", "place[2].count=30", "--set", &set],
        ));
        check(&out, &[]);
    }
}

/// Weights of pools, classes, and archives for training, all in one dataset.
#[test]
fn weighted_pools_classes_and_archives_agree() {
    let folder = tempfile::tempdir().expect("a folder");
    let recipe = folder.path().join("classes.toml");
    std::fs::write(
        &recipe,
        r#"
        extends = "builtin:quickstart"
        [assets.mugs]
        kind = "household"
        include = ["mug_*"]
        classes = { mug = ["*"] }
        [assets.objects]
        classes = { bottle = ["*bottle*"], mug = ["mug_*"] }
        [camera]
        resolution = [160, 120]
        [render]
        samples_per_pixel = 1
        [write.npz]
        [set]
        place.objects.from = { objects = 0.5, mugs = 0.5 }
        place.objects.count = 20
        place.table.material = { tabletops = 1, floors = 3 }
        "#,
    )
    .expect("writable");
    let out = folder.path().join("data");
    ok(syntable().arg("run").arg(&recipe).arg("--out").arg(&out));
    check(&out, &["--npz", "npz"]);
    let file = std::fs::read_to_string(out.join("annotation_final.json")).expect("there");
    let json: serde_json::Value = serde_json::from_str(&file).expect("JSON");
    let names: Vec<&str> =
        json["categories"].as_array().expect("a list").iter().filter_map(|it| it["name"].as_str()).collect();
    assert_eq!(names, ["object", "bottle", "mug"]);
    // Half of the objects come from the pool of mugs, though it has far fewer assets.
    let bodies: Vec<&serde_json::Value> = json["scenes"]
        .as_array()
        .expect("a list")
        .iter()
        .flat_map(|it| it["bodies"].as_array().expect("a list"))
        .collect();
    let of = |key: &str, value: &str| bodies.iter().filter(|body| body[key] == value).count();
    let (objects, mugs) = (of("role", "object"), of("pool", "mugs"));
    assert!(objects > 20 && (objects / 4..objects * 3 / 4).contains(&mugs), "{mugs} of {objects}");
    assert!(of("category", "mug") >= mugs && of("role", "support") == 2 && of("role", "room") == 12);
}

#[test]
fn real_objects_give_right_datasets() {
    for assets in assets() {
        let folder = tempfile::tempdir().expect("a folder");
        for recipe in ["train", "val", "release"] {
            let out = folder.path().join(recipe);
            let file = format!("recipes/syntable-sim/{recipe}.toml");
            let set = [
                "dataset.scenes=1",
                "dataset.views_per_scene=2",
                "render.samples_per_pixel=1",
                "camera.resolution=[160, 120]",
            ];
            let mut run = syntable();
            run.args(["run", &file, "--out"]).arg(&out).env("ASSETS", &assets);
            run.args(set.iter().flat_map(|set| ["--set", set]));
            ok(&mut run);
            check(&out, if recipe == "release" { &["--compat", "syntable_1"] } else { &[] });
        }
    }
}
