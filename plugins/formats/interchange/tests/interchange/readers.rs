//! Reads the written files with other programs: pycocotools, Pillow, and reimplementations of the reader of each
//! format.

use serde_json::{Map, Value as Json};
use std::path::Path;
use syntable_interchange as _;
use syntable_model::prelude::*;
use syntable_model::product::Product;
use syntable_model::product::standard::{
    AMODAL_MASK, AMODAL_OUTLINE, CUBOID, DEPTH, KEYPOINTS, TABLETOP_MASK, VISIBLE_IDS,
};
use syntable_testing::takes::{Take, dataset, finish, write_scenes, writer};
use syntable_testing::tools::{own_script, python, shared_script};

/// The products of every view as JSON, a line per view.
fn write_truth(folder: &Path, takes: &[Take]) {
    const NAMES: [&str; 8] = [
        "rgb",
        "depth",
        "visible_mask",
        "amodal_mask",
        "occlusion_mask",
        "category_id",
        "occlusion_rate",
        "occlusion_order",
    ];
    let mut text = String::new();
    for take in takes {
        for (view, products) in &take.views {
            let ids = [("scene", take.scene.id.0), ("view", view.id.0)];
            let mut line = Map::from_iter(ids.map(|(name, id)| (name.to_owned(), Json::from(id))));
            for name in NAMES {
                let value = products.value(name).expect("a product");
                line.insert(name.to_owned(), serde_json::to_value(value).expect("JSON"));
            }
            text += &format!("{}\n", Json::from(line));
        }
    }
    std::fs::write(folder.join("truth.jsonl"), text).expect("writable");
}

/// Scenes whose objects have ranges of depth that differ from their order and often overlap.
fn takes() -> Vec<Take> {
    let mut takes = syntable_testing::takes::takes();
    for (_, products) in takes.iter_mut().flat_map(|take| &mut take.views) {
        let flat = products.get(DEPTH).expect("a product").clone();
        let bumps = |x: u32, y: u32| ((7 * x + 13 * y + x * y) % 32) as f32 / 32.0;
        let depth = Plane::from_fn(flat.width(), flat.height(), |x, y| flat.at(x, y) + bumps(x, y));
        replace(products, DEPTH, depth);
        let objects = products.get(VISIBLE_IDS).expect("a product");
        let table =
            |x, y| *objects.at(x, y) == InstanceId(0) && products.get(DEPTH).expect("there").at(x, y).is_finite();
        let table = Mask::from_fn(objects.width(), objects.height(), table);
        products.put(TABLETOP_MASK, table).expect("first");
        products.put(CUBOID, cuboid_of_the_first()).expect("first");
    }
    takes
}

/// A cuboid around the point (1, 2, 3) for object 1, and none for the others.
fn cuboid_of_the_first() -> PerInstance<Value> {
    let end = |corner: u32, axis: u32| f64::from((corner >> axis) & 1) - 0.5;
    let corner = |corner: u32| Value::from([1.0 + end(corner, 0), 2.0 + end(corner, 1), 3.0 + end(corner, 2)]);
    let corners = Value::List((0..8).map(corner).collect());
    [(InstanceId(1), Value::record([("corners_world_m", corners)]))].into_iter().collect()
}

/// Replaces the value of a product.
fn replace<T: Product>(products: &mut Products, key: Key<T>, value: T) {
    let names: Vec<String> = products.keys().iter().map(|key| key.to_string()).collect();
    let others: Vec<String> = names.into_iter().filter(|name| name != key.name()).collect();
    *products = products.only(&others);
    products.put(key, value).expect("free");
}

/// A dataset with the classes that occur in the views.
fn classes() -> DatasetInfo {
    DatasetInfo { classes: vec!["bowl".into(), "mug".into()], ..dataset(3, 3) }
}

/// Writes a dataset, and reads it with the reader of its format.
fn check(kind: &str, options: &str, option: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let (writer, takes) = (writer(kind, options).expect("good options"), takes());
    write_scenes(folder.path(), "data", &*writer, &classes(), &takes).expect("written");
    finish(folder.path(), "data", &*writer, &classes(), &[0, 1, 2]).expect("finished");
    write_truth(folder.path(), &takes);
    let path = folder.path().to_str().expect("UTF-8");
    python(&own_script("check.py"), &[kind, path, option]);
    folder
}

#[test]
fn coco_instances_are_the_masks() {
    check("coco", "", "amodal");
    check("coco", "masks = \"visible\"", "visible");
}

/// pycocotools reads the file, and finds the values of the products where COCO's loader puts fields.
#[test]
fn coco_has_own_fields_and_supercategories() {
    let fields =
        "include = [\"object_name\", \"occlusion_rate\", \"amodal_box\", \"object_info\", \"camera\", \"exposure\"]";
    let folder = check("coco", &format!("{fields}\nsupercategories = {{ mug = \"kitchen\" }}"), "amodal");
    let text = std::fs::read_to_string(folder.path().join("data/annotations/instances_train.json")).expect("there");
    let file: Json = serde_json::from_str(&text).expect("JSON");
    let list = |name: &str| file[name].as_array().expect("a list").iter();
    let supercategories: Vec<&str> = list("categories").filter_map(|it| it["supercategory"].as_str()).collect();
    assert_eq!(supercategories, ["", "", "kitchen"]);
    let takes = takes();
    let views: Vec<&Products> = takes.iter().flat_map(|take| &take.views).map(|(_, products)| products).collect();
    let json =
        |products: &Products, name: &str| serde_json::to_value(products.value(name).expect("made")).expect("JSON");
    for (image, products) in list("images").zip(&views) {
        assert!(["camera", "exposure"].iter().all(|name| image[name] == json(products, name)));
    }
    let image_of = |annotation: &Json| views[annotation["image_id"].as_u64().expect("a number") as usize - 1];
    for annotation in list("annotations") {
        let id = annotation["instance_id"].to_string();
        for name in ["object_name", "occlusion_rate", "amodal_box", "object_info"] {
            assert_eq!(annotation[name], json(image_of(annotation), name)[&id], "{name}");
        }
    }
    assert!(list("annotations").count() > 20);

    let refused = |options: &str| writer("coco", options).err().unwrap_or_else(|| panic!("{options}"));
    for name in ["visible_mask", "label_policy", "keypoints"] {
        let error = refused(&format!("include = [\"object_name\", \"{name}\"]"));
        assert!(
            error.contains("include[1]") && error.contains(&format!("`{name}` has the name of a field")),
            "{error}"
        );
    }
    let inputs = writer("coco", "include = [\"depth\"]").expect("options").reads();
    let depth = inputs.iter().find(|input| input.product == "depth").expect("an input");
    let refusal = depth.accepts.check(&DEPTH.id()).expect_err("refused");
    assert!(refusal.starts_with("a field holds no pixels, and this is an f32 image"), "{refusal}");
    let unknown = writer("coco", "supercategories = { cup = \"kitchen\" }").expect("options");
    let error = finish(folder.path(), "data", &*unknown, &classes(), &[0, 1, 2]).expect_err("refused").to_string();
    assert!(error.contains("`supercategories` names `cup`"), "{error}");
}

/// Points of objects 1 and 3: visible, hidden and outside. Object 2 has no point with these names.
fn keypoints() -> PerInstance<Value> {
    let point = |name: &str, uv_px: Option<[f64; 2]>, visibility: u8| {
        let uv = uv_px.map_or(Value::Null, Value::from);
        let fields = [
            ("name", name.into()),
            ("uv_px", uv),
            ("depth_m", 1.0.into()),
            ("visibility", u32::from(visibility).into()),
        ];
        Value::record(fields)
    };
    let of = [
        (1, vec![point("rim", Some([3.25, 4.0]), 2), point("base", Some([1.5, 2.5]), 1)]),
        (2, vec![point("spout", Some([7.5, 7.5]), 2)]),
        (3, vec![point("base", Some([-9.0, 2.0]), 0), point("rim", None, 0)]),
    ];
    of.into_iter().map(|(id, points)| (InstanceId(id), Value::List(points))).collect()
}

#[test]
fn coco_keypoints_are_evaluated() {
    let folder = tempfile::tempdir().expect("a folder");
    let writer =
        writer("coco", "keypoints = [\"base\", \"rim\"]\nskeleton = [[\"rim\", \"base\"]]").expect("good options");
    let mut takes = takes();
    for (_, products) in takes.iter_mut().flat_map(|take| &mut take.views) {
        let all = products.get(AMODAL_MASK).expect("a product").map(|_, _| Value::List(Vec::new()));
        let named = keypoints();
        let of = all.map(|id, none| named.get(id).unwrap_or(none).clone());
        products.put(KEYPOINTS, of).expect("first");
    }
    write_scenes(folder.path(), "data", &*writer, &classes(), &takes).expect("written");
    finish(folder.path(), "data", &*writer, &classes(), &[0, 1, 2]).expect("finished");
    write_truth(folder.path(), &takes);
    python(&own_script("check.py"), &["coco_keypoints", folder.path().to_str().expect("UTF-8"), ""]);
}

#[test]
fn names_of_keypoints_are_unique() {
    for (options, says) in [
        ("keypoints = [\"a\", \"a\"]", "keypoints"),
        ("keypoints = [\"\"]", "keypoints"),
        ("keypoints = [\"a\", \"b\"]\nskeleton = [[\"a\", \"c\"]]", "`c` is not among the keypoints"),
        ("keypoints = [\"a\", \"b\"]\nskeleton = [[\"a\", \"b\"], [\"b\", \"b\"]]", "`skeleton[1]`"),
    ] {
        assert!(writer("coco", options).err().is_some_and(|error| error.to_string().contains(says)), "{options}");
    }
}

#[test]
fn panoptic_segments_pass_the_checks_of_panopticapi() {
    check("coco_panoptic", "", "");
}

#[test]
fn coco_amodal_has_regions_from_front_to_back() {
    check("cocoa", "", "");
}

#[test]
fn d2sa_has_the_masks_and_their_order() {
    check("d2sa", "", "");
}

#[test]
fn kins_has_polygons_and_groups() {
    check("kins", "version = \"2019\"", "2019");
    check("kins", "version = \"2020\"", "2020");
}

#[test]
fn insta_order_refers_to_the_instances_beside_it() {
    check("insta_order", "", "");
}

#[test]
fn uoais_net_reads_what_it_is_trained_from() {
    check("uoais", "skip_empty_images = false", "false");
    let folder = check("uoais", "", "true");
    let root = folder.path().join("data");
    let [images, file] = ["train", "annotations/coco_anns_uoais_sim_train.json"].map(|path| root.join(path));
    let arguments = [images.to_str().expect("UTF-8"), "uoais", file.to_str().expect("UTF-8")];
    python(&shared_script("uoais_reader.py"), &arguments);
}

#[test]
fn osd_amodal_is_found_by_its_names() {
    check("osd_amodal", "", "");
}

#[test]
fn tod_has_what_its_loaders_read() {
    check("tod", "", "");
}

#[test]
fn yolo_labels_cover_the_masks() {
    for task in ["segment", "obb"] {
        for masks in ["visible", "amodal"] {
            check("yolo", &format!("task = {task:?}\nmasks = {masks:?}"), &format!("{task},{masks}"));
        }
    }
}

#[test]
fn annotators_that_disagree_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut takes = takes();
    for (_, products) in takes.iter_mut().flat_map(|take| &mut take.views) {
        replace(products, AMODAL_OUTLINE, PerInstance::default());
    }
    let writer = writer("kins", "").expect("good options");
    let error = write_scenes(folder.path(), "data", &*writer, &classes(), &takes).expect_err("no outlines");
    assert!(error.is_permanent() && error.to_string().contains("but not in `amodal_outline`"), "{error}");
}
