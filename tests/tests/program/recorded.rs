//! Rebuilt scenes: the objects of a dataset at their poses, seen by its cameras, in other surroundings.

use crate::support::{fails, files, made, small_dataset, syntable};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const BOP: &str = "write.bop={ kind = \"bop\", objects = \"all\" }";
const INFO: &str = "annotate.info={ kind = \"object_info\", objects = \"all\" }";
const VISIBILITY: &str = "annotate.counts={ kind = \"visibility\", objects = \"all\" }";
const LINES: &str = "write.lines={ kind = \"jsonl\", include = [\"camera\", \"object_info\"] }";

/// A dataset of two scenes with two views, in BOP's format and as lines.
fn recorded(folder: &Path) -> PathBuf {
    let out = folder.join("recorded");
    small_dataset(&out, &[BOP, LINES, INFO, VISIBILITY]);
    out
}

/// A recipe that rebuilds a dataset on other tables. Returns the folder of its dataset.
fn rebuild(folder: &Path, name: &str, [scenes, views]: [u32; 2], step: &str) -> PathBuf {
    let out = folder.join(name);
    made(&mut command(folder, name, [scenes, views], step));
    out
}

fn command(folder: &Path, name: &str, [scenes, views]: [u32; 2], step: &str) -> std::process::Command {
    let text = format!(
        "extends = \"builtin:quickstart\"\nremove = [\"settle\", \"camera\", \"views\"]\n\
         [dataset]\nname = \"{name}\"\nscenes = {scenes}\nviews_per_scene = {views}\n\
         [[place]]\nkind = \"room\"\nsize_m = 5\n[[place]]\nkind = \"table\"\nfrom = \"tables\"\n\
         [[place]]\nkind = \"recorded\"\nid = \"recorded\"\nfrom = \"objects\"\n{step}\n\
         [settle]\nkind = \"none\"\n[views]\nkind = \"recorded\"\n[camera]\nkind = \"recorded\"\n"
    );
    let recipe = folder.join(format!("{name}.toml"));
    std::fs::write(&recipe, text).expect("written");
    let mut run = syntable();
    run.arg("run").arg(recipe).arg("--out").arg(folder.join(name));
    for set in ["render.samples_per_pixel=1", "denoise.kind=\"none\"", BOP, LINES, INFO, VISIBILITY] {
        run.args(["--set", set]);
    }
    run
}

/// The masks of whole objects, by scene, image and object. Scenes are counted through as images if `by_image`.
fn masks(dataset: &Path, by_image: bool) -> BTreeMap<String, Vec<u8>> {
    let place = |name: &str| -> Option<String> {
        let (scene, rest) = name.strip_prefix("bop/train_pbr/")?.split_once("/mask/")?;
        let (view, object) = rest.split_once('_')?;
        let [scene, view]: [u32; 2] = [scene, view].map(|number| number.parse().expect("a number"));
        Some(if by_image { format!("{scene} {object}") } else { format!("{} {object}", 2 * scene + view) })
    };
    files(dataset).into_iter().filter_map(|(name, bytes)| Some((place(&name)?, bytes))).collect()
}

/// The lines of a dataset.
fn lines(dataset: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(dataset.join("lines.jsonl")).expect("written");
    text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

/// Poses of the objects of the first view in the world.
fn world(dataset: &Path) -> Vec<f64> {
    let first = &lines(dataset)[0];
    let numbers = |object: &Value| -> Vec<f64> {
        let rows = object["world_from_object"].as_array().expect("rows");
        rows.iter().flat_map(|row| row.as_array().expect("a row")).map(|x| x.as_f64().expect("a number")).collect()
    };
    let objects = first["object_info"].as_object().expect("objects");
    objects.values().flat_map(numbers).collect()
}

/// The same masks prove poses, sizes and lenses at once. The table differs, and so does its place.
#[test]
fn a_rebuilt_scene_has_the_recorded_masks() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = recorded(folder.path());
    let want = masks(&source, false);
    assert!(want.len() > 20 && want.values().collect::<std::collections::BTreeSet<_>>().len() > 20);
    let (bop, jsonl) = (source.join("bop/train_pbr"), source.join("lines.jsonl"));
    for (name, dataset, per, views) in
        [("scenes", &bop, "scene", 2), ("images", &bop, "image", 1), ("lines", &jsonl, "scene", 2)]
    {
        let step = format!("dataset = {dataset:?}\nper = \"{per}\"\nyaw_deg = 40");
        let rebuilt = rebuild(folder.path(), name, [4 / views, views], &step);
        assert!(masks(&rebuilt, per == "image") == want, "{name}");
        let (own, other) = (world(&source), world(&rebuilt));
        assert!(own.iter().zip(&other).any(|(a, b)| (a - b).abs() > 0.05), "{name}: another place");
    }
    // The frame of the world keeps the poses themselves.
    let step = format!("dataset = {jsonl:?}\nframe = \"world\"");
    let rebuilt = rebuild(folder.path(), "world", [2, 2], &step);
    assert!(masks(&rebuilt, false) == want);
    let apart = world(&source).iter().zip(&world(&rebuilt)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < 1e-9, "{apart}");
}

/// Where objects change nothing, an image has the codes of its own recorded image, and of no other.
#[test]
fn recorded_images_are_the_plates_of_their_views() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = recorded(folder.path());
    let mut run = command(folder.path(), "plates", [2, 2], &format!("dataset = {:?}", source.join("bop/train_pbr")));
    made(run.args(["--set", "sensor.rgb_camera={ tone = \"srgb\", plate = {} }"]));
    let image = |dataset: &Path, [scene, view]: [u32; 2]| {
        let path = dataset.join(format!("bop/train_pbr/{scene:06}/rgb/{view:06}.png"));
        image::open(path).expect("readable").to_rgb8()
    };
    let all = [[0, 0], [0, 1], [1, 0], [1, 1]];
    for at in all {
        let got = image(&folder.path().join("plates"), at);
        let same = |other| {
            let other = image(&source, other);
            let count = got.pixels().zip(other.pixels()).filter(|(a, b)| a == b).count();
            count as f64 / f64::from(got.width() * got.height())
        };
        let own = same(at);
        let others = all.into_iter().filter(|other| *other != at).map(same).fold(0.0, f64::max);
        assert!(own > 0.5 && others < 0.05, "{at:?}: {own} of the pixels, {others} of another image");
    }
    // Another lens sees the objects at other places.
    let recipe = folder.path().join("plates.toml");
    let text = std::fs::read_to_string(&recipe).expect("written").replace(
        "[camera]\nkind = \"recorded\"",
        "[camera]\nkind = \"pinhole\"\nresolution = [160, 120]\nintrinsics = { fov_deg = 40 }",
    );
    std::fs::write(&recipe, text).expect("written");
    run.args(["--overwrite"]);
    let message = fails(&mut run, 2);
    assert!(message.contains("is not the camera that took"), "{message}");
}

#[test]
fn swapped_objects_stand_where_the_recorded_ones_were() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = recorded(folder.path());
    let step = format!(
        "dataset = {:?}\nframe = \"z_up\"\nswap = {{ from = \"objects\", probability = 0.6 }}",
        source.join("lines.jsonl")
    );
    let swapped = rebuild(folder.path(), "swapped", [1, 1], &step);
    let [own, other] = [&source, &swapped].map(|dataset| lines(dataset)[0]["object_info"].clone());
    let assets = |of: &Value| -> Vec<String> {
        of.as_object().expect("objects").values().map(|it| it["asset"].to_string()).collect()
    };
    let (names, others) = (assets(&own), assets(&other));
    assert_eq!(names.len(), others.len());
    let changed = names.iter().zip(&others).filter(|(a, b)| a != b).count();
    assert!((1..names.len()).contains(&changed), "{changed} of {}", names.len());
    // The recorded tables have other heights: heights count from the lowest object.
    let boxes =
        |of: &Value| -> Vec<[[f64; 2]; 3]> { of.as_object().expect("objects").values().map(world_box).collect() };
    let (own, other) = (boxes(&own), boxes(&other));
    let lowest = |boxes: &[[[f64; 2]; 3]]| boxes.iter().map(|it| it[2][0]).fold(f64::INFINITY, f64::min);
    let (floor, other_floor) = (lowest(&own), lowest(&other));
    for ((a, b), (before, after)) in names.iter().zip(&others).zip(own.iter().zip(&other)) {
        // Boxes of objects that lean are larger than the objects.
        let height = |[low, high]: [f64; 2]| high - low;
        assert!(height(after[2]) <= height(before[2]) + 0.03, "{a} {b}: {before:?} {after:?}");
        let raised = (after[2][0] - other_floor) - (before[2][0] - floor);
        assert!((-0.02..0.05).contains(&raised), "{a} {b}: {raised}");
    }
}

/// The ranges of the box around an object along the axes of the world.
fn world_box(object: &Value) -> [[f64; 2]; 3] {
    let number = |value: &Value| value.as_f64().expect("a number");
    let (bounds, pose) = (&object["bounds_m"], &object["world_from_object"]);
    let mut ranges = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
    for corner in 0..8 {
        let p: [f64; 3] = std::array::from_fn(|axis| number(&bounds[corner >> axis & 1][axis]));
        for (axis, range) in ranges.iter_mut().enumerate() {
            let row = &pose[axis];
            let x = number(&row[3]) + (0..3).map(|k| number(&row[k]) * p[k]).sum::<f64>();
            *range = [range[0].min(x), range[1].max(x)];
        }
    }
    ranges
}

#[test]
fn what_cannot_be_rebuilt_is_refused_with_a_way_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = recorded(folder.path());
    let jsonl = source.join("lines.jsonl");
    let run = |name: &str, scenes_views, step: &str, more: &[&str]| {
        let mut run = command(folder.path(), name, scenes_views, step);
        for set in more {
            run.args(["--set", set]);
        }
        fails(&mut run, 2)
    };
    let of = |path: &Path| format!("dataset = {path:?}");
    let said = run("views", [1, 3], &of(&jsonl), &[]);
    assert!(said.contains("view 2 has no camera: the recorded scene has 2 images, from 0"), "{said}");
    assert!(said.contains("lower `views_per_scene`"), "{said}");
    let said = run(
        "missing",
        [1, 2],
        &of(&jsonl),
        &["assets.objects.seed=1", "assets.objects.families=[\"wrench\"]", "assets.objects.exclude=[]"],
    );
    assert!(said.contains("is in none of `objects`") && said.contains("missing = \"leave_out\""), "{said}");
    // A box that is elsewhere in the second image.
    let mut moved = lines(&source);
    let object = moved[1]["object_info"].as_object_mut().expect("objects").values_mut().next().expect("an object");
    object["camera_from_object"][0][3] = Value::from(0.5);
    let text: String = moved.iter().map(|line| format!("{line}\n")).collect();
    let other = folder.path().join("moved.jsonl");
    std::fs::write(&other, text).expect("written");
    let said = run("moved", [1, 2], &of(&other), &[]);
    assert!(said.contains("from its pose in `") && said.contains("per = \"image\""), "{said}");
    let said = run("scenes", [1, 2], &format!("{}\nscenes = [7]", of(&jsonl)), &[]);
    assert!(said.contains("`scenes` names scene 7") && said.contains("its first scenes are 0, 1"), "{said}");
    let empty = folder.path().join("nothing");
    std::fs::create_dir(&empty).expect("made");
    let said = run("empty", [1, 2], &of(&empty), &[]);
    assert!(said.contains("place.recorded: ") && said.contains("unrecognized dataset format"), "{said}");
    assert!(said.contains("name the format with `format`"), "{said}");
    let labels = folder.path().join("coco.json");
    std::fs::write(&labels, r#"{"images":[],"annotations":[],"categories":[]}"#).expect("written");
    let said = run("coco", [1, 2], &of(&labels), &[]);
    assert!(said.contains("the dataset has no `camera`"), "{said}");
    // A dataset without the poses of its cameras has no vertical, and one whose camera is mirrored has no pose.
    let with_camera = |name: &str, change: &dyn Fn(&mut Value)| {
        let mut all = lines(&source);
        all.iter_mut().for_each(|line| change(&mut line["camera"]));
        let text: String = all.iter().map(|line| format!("{line}\n")).collect();
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("written");
        of(&path)
    };
    let unposed = with_camera("unposed.jsonl", &|camera| {
        camera.as_object_mut().expect("a table").remove("world_from_camera");
    });
    let said = run("unposed", [1, 1], &format!("{unposed}\nper = \"image\"\nframe = \"z_up\""), &[]);
    assert!(said.contains("has no vertical") && said.contains("frame = \"resting_plane\""), "{said}");
    let mirrored = with_camera("mirrored.jsonl", &|camera| camera["world_from_camera"][0][0] = Value::from(-3.0));
    let said = run("mirrored", [1, 1], &mirrored, &[]);
    assert!(said.contains("`world_from_camera` is not a rigid transform"), "{said}");
    let skewed = with_camera("skewed.jsonl", &|camera| camera["K"][0][1] = Value::from(5.0));
    let said = run("skewed", [1, 1], &skewed, &[]);
    assert!(said.contains("the skew 5 px"), "{said}");
    // Images that no scene rebuilds are named before the run.
    let bop = source.join("bop/train_pbr");
    std::fs::remove_file(bop.join("000001/scene_gt.json")).expect("removed");
    let said = crate::support::text(&command(folder.path(), "lost", [1, 2], &of(&bop)).output().expect("it runs"));
    assert!(said.contains("of the recorded dataset are not rebuilt"), "{said}");
    // Views of no recorded scene, and cameras of two.
    let twice =
        format!("{}\n[[place]]\nkind = \"recorded\"\nid = \"again\"\nfrom = \"objects\"\n{}", of(&jsonl), of(&jsonl));
    let said = run("twice", [1, 1], &twice, &[]);
    assert!(said.contains("both set the cameras of a recorded scene"), "{said}");
    let mut check = syntable();
    check.args(["check", "builtin:quickstart", "--set", "views={ kind = \"recorded\" }"]);
    let said = fails(&mut check, 2);
    assert!(
        said.contains("`views` needs the cameras of a recorded scene") && said.contains("kind = \"recorded\""),
        "{said}"
    );
}
