//! `validate` finds planted faults in a dataset and none in a clean one; `convert` reports every loss.

use crate::support::{assert_same, checked, convert, fails, made, ok, small_dataset, syntable};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use syntable_model::product::standard::{CATEGORY_ID, VISIBLE_MASK};
use syntable_program as _;
use syntable_testing::takes::open_dataset;

/// A small dataset with all labels of the `syntable` writer.
fn dataset(out: &Path) {
    small_dataset(out, &["write={ syntable = {} }"]);
}

fn copy(from: &Path, to: &Path) {
    for entry in fs::read_dir(from).expect("readable").map(|entry| entry.expect("readable")) {
        let to = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &to);
        } else {
            fs::create_dir_all(to.parent().expect("inside")).expect("writable");
            fs::copy(entry.path(), &to).expect("writable");
        }
    }
}

/// A dataset in which tests plant faults.
struct Spoiled {
    root: PathBuf,
    json: Value,
}

impl Spoiled {
    fn annotation(&mut self, index: usize) -> &mut Value {
        &mut self.json["annotations"][index]
    }

    /// The first annotation that satisfies a condition.
    fn find(&self, holds: impl Fn(&Value) -> bool) -> usize {
        let annotations = self.json["annotations"].as_array().expect("a list");
        annotations.iter().position(holds).expect("there is one")
    }

    fn occluded(&self) -> usize {
        self.find(|it| it["occluded_area"].as_u64() > Some(20) && it["visible_area"].as_u64() > Some(20))
    }

    fn file(&self, key: &str) -> PathBuf {
        self.root.join(self.json["images"][0][key].as_str().expect("a path"))
    }

    fn gray16(&self, change: impl Fn(u16) -> u16) {
        let path = self.file("depth_file_name");
        let image = image::open(&path).expect("an image").into_luma16();
        let changed = image::ImageBuffer::<image::Luma<u16>, _>::from_fn(image.width(), image.height(), |x, y| {
            image::Luma([change(image.get_pixel(x, y).0[0])])
        });
        changed.save(&path).expect("writable");
    }
}

type Plant = fn(&mut Spoiled);

/// A check, and a fault that it must find.
const PLANTED: &[(&str, &str, Plant)] = &[
    ("readable", "an image is gone", |it| fs::remove_file(it.file("file_name")).expect("there")),
    ("readable", "an image is cut off", |it| {
        let path = it.file("file_name");
        let bytes = fs::read(&path).expect("there");
        fs::write(path, &bytes[..bytes.len() / 2]).expect("writable");
    }),
    ("readable", "depth is gone", |it| fs::remove_file(it.file("depth_file_name")).expect("there")),
    ("readable", "an order is cut off", |it| {
        let path = it.file("occlusion_order_file_name");
        let bytes = fs::read(&path).expect("there");
        fs::write(path, &bytes[..bytes.len() - 8]).expect("writable");
    }),
    ("readable", "run lengths are damaged", |it| {
        it.annotation(0)["visible_mask"]["counts"] = json!("~~");
    }),
    ("readable", "height and width of a mask are swapped", |it| {
        it.annotation(0)["visible_mask"]["size"] = json!([160, 120]);
    }),
    ("unique_ids", "two annotations have one id", |it| it.annotation(1)["id"] = json!(1)),
    ("unique_ids", "two images have one id", |it| it.json["images"][1]["id"] = it.json["images"][0]["id"].clone()),
    ("known_images", "an annotation is of no image", |it| it.annotation(0)["image_id"] = json!(999)),
    ("known_categories", "a category is unknown", |it| it.annotation(0)["category_id"] = json!(77)),
    ("unique_views", "two images are of one view", |it| it.json["images"][1]["view_id"] = json!(0)),
    ("visible_masks_disjoint", "two objects are seen at one pixel", |it| {
        let mask = it.annotation(0)["visible_mask"].clone();
        it.annotation(1)["visible_mask"] = mask;
    }),
    ("visible_within_amodal", "the masks of an object are swapped", |it| {
        let index = it.occluded();
        let at = it.annotation(index);
        let (visible, amodal) = (at["visible_mask"].clone(), at["segmentation"].clone());
        (at["visible_mask"], at["segmentation"]) = (amodal, visible);
    }),
    ("occlusion_is_amodal_minus_visible", "what hides is not in the occlusion mask", |it| {
        let index = it.occluded();
        let visible = it.annotation(index)["visible_mask"].clone();
        it.annotation(index)["occluded_mask"] = visible;
    }),
    ("rate_is_ratio_of_areas", "a rate is two hundredths too large", |it| {
        let index = it.occluded();
        let rate = it.annotation(index)["occluded_rate"].as_f64().expect("a number");
        it.annotation(index)["occluded_rate"] = json!(rate + 0.0212345);
    }),
    ("rate_is_ratio_of_areas", "a rate is that of the visible part", |it| {
        let index = it.occluded();
        let rate = it.annotation(index)["occluded_rate"].as_f64().expect("a number");
        it.annotation(index)["occluded_rate"] = json!(1.0 - rate);
    }),
    ("order_matches_masks", "an order is transposed", |it| {
        let path = it.file("occlusion_order_file_name");
        let mut bytes = fs::read(&path).expect("there");
        let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        let before = bytes[header..].to_vec();
        let edge = ((before.len() / 8) as f64).sqrt() as usize;
        for (row, column) in (0..edge).flat_map(|row| (0..edge).map(move |column| (row, column))) {
            let (from, to) = (8 * (column * edge + row), header + 8 * (row * edge + column));
            bytes[to..to + 8].copy_from_slice(&before[from..from + 8]);
        }
        fs::write(path, bytes).expect("writable");
    }),
    ("order_matches_masks", "an object occludes itself", |it| {
        let path = it.file("occlusion_order_file_name");
        let mut bytes = fs::read(&path).expect("there");
        let last = bytes.len() - 8;
        bytes[last..].copy_from_slice(&1.0_f64.to_le_bytes());
        fs::write(path, bytes).expect("writable");
    }),
    ("unique_names", "two images are of one file", |it| {
        it.json["images"][1]["file_name"] = it.json["images"][0]["file_name"].clone();
    }),
    ("unique_names", "two categories have one name", |it| {
        let name = it.json["categories"][0]["name"].clone();
        it.json["categories"].as_array_mut().expect("a list").push(json!({ "id": 90, "name": name }));
    }),
    ("readable", "an entry of an order is no number", |it| {
        let path = it.file("occlusion_order_file_name");
        let mut bytes = fs::read(&path).expect("there");
        let last = bytes.len() - 8;
        bytes[last..].copy_from_slice(&f64::NAN.to_le_bytes());
        fs::write(path, bytes).expect("writable");
    }),
    ("rate_is_ratio_of_areas", "a rate is missing", |it| it.annotation(0)["occluded_rate"] = json!(null)),
    ("rate_is_ratio_of_areas", "a rate is rounded to another one", |it| {
        it.annotation(0)["occluded_rate_rounded"] = json!(0.77);
    }),
    ("poses_are_rigid", "the poses of an object are mirrored", |it| {
        for (pose, row) in
            ["world_from_object", "camera_from_object"].iter().flat_map(|it| (0..3).map(move |row| (it, row)))
        {
            let entry = it.annotation(0)["object"][*pose][row][0].as_f64().expect("a number");
            it.annotation(0)["object"][*pose][row][0] = json!(-entry);
        }
    }),
    ("visible_box_matches_mask", "a box has corners in place of its size", |it| {
        let [x, y, w, h] = serde_json::from_value::<[i64; 4]>(it.annotation(0)["visible_bbox"].clone()).expect("a box");
        it.annotation(0)["visible_bbox"] = json!([x, y, x + w, y + h]);
    }),
    ("amodal_box_matches_mask", "a box lacks a column", |it| {
        let width = it.annotation(0)["amodal_bbox"][2].as_i64().expect("a number");
        it.annotation(0)["amodal_bbox"][2] = json!(width - 1);
    }),
    ("camera_has_image_size", "the camera is of another size", |it| {
        it.json["images"][0]["camera"]["width"] = json!(640);
    }),
    ("poses_reproject_into_masks", "a focal length is that of another size", |it| {
        it.json["images"][0]["camera"]["K"][0][0] = json!(20.0);
    }),
    ("poses_reproject_into_masks", "y points up", |it| {
        for annotation in it.json["annotations"].as_array_mut().expect("a list") {
            for column in 0..4 {
                let entry = annotation["object"]["camera_from_object"][1][column].as_f64().expect("a number");
                annotation["object"]["camera_from_object"][1][column] = json!(-entry);
            }
        }
    }),
    ("poses_agree", "a pose is in millimeters", |it| {
        for row in 0..3 {
            let entry = it.annotation(0)["object"]["camera_from_object"][row][3].as_f64().expect("a number");
            it.annotation(0)["object"]["camera_from_object"][row][3] = json!(1000.0 * entry);
        }
    }),
    ("poses_agree", "the camera is where the next view's is", |it| {
        it.json["images"][0]["camera"]["world_from_camera"] =
            it.json["images"][1]["camera"]["world_from_camera"].clone();
    }),
    ("poses_agree", "the two poses of a camera are not inverse", |it| {
        let x = it.json["images"][0]["camera"]["camera_from_world"][0][3].as_f64().expect("a number");
        it.json["images"][0]["camera"]["camera_from_world"][0][3] = json!(x + 0.01);
    }),
    ("depth_agrees_with_poses", "depth is in tenths of a millimeter", |it| it.gray16(|depth| depth.saturating_mul(10))),
    ("depth_agrees_with_poses", "depth is 2 cm too large", |it| it.gray16(|depth| depth + 20)),
    ("visible_pixels_have_depth", "depth is missing", |it| it.gray16(|_| 0)),
    ("readable", "an image is of another size", |it| {
        image::RgbImage::new(80, 60).save(it.file("file_name")).expect("writable");
    }),
    ("records_agree", "the list of objects of an image is shorter than they are", |it| {
        drop(it.json["images"][0]["instance_ids"].as_array_mut().expect("a list").pop());
    }),
    ("readable", "depth is of another size", |it| {
        image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::new(80, 60)
            .save(it.file("depth_file_name"))
            .expect("writable");
    }),
];

fn checks_that_fail(root: &Path) -> BTreeSet<String> {
    let (_, dataset) = open_dataset(root, None).expect("a dataset");
    let found = checked(&dataset).expect("checked");
    found.faults.into_iter().map(|fault| fault.check).collect()
}

#[test]
fn planted_faults_are_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let clean = folder.path().join("clean");
    dataset(&clean);
    assert_eq!(checks_that_fail(&clean), BTreeSet::new());
    let path = clean.join("annotation_final.json");
    let text = fs::read_to_string(&path).expect("there");
    assert!(PLANTED.len() >= 20);
    for (number, (check, what, plant)) in PLANTED.iter().enumerate() {
        let root = folder.path().join(format!("spoiled {number}"));
        copy(&clean.join("data"), &root.join("data"));
        let mut spoiled = Spoiled { root: root.clone(), json: serde_json::from_str(&text).expect("JSON") };
        plant(&mut spoiled);
        fs::write(root.join("annotation_final.json"), spoiled.json.to_string()).expect("writable");
        let found = checks_that_fail(&root);
        assert!(found.contains(*check), "{what}: {found:?}");
        fs::remove_dir_all(&root).expect("removable");
    }
    // Output for users and for programs.
    assert!(ok(syntable().arg("validate").arg(&clean)).contains("4 images, read as syntable: no fault"));
    fs::remove_file(clean.join("data/mono/rgb/0_0.png")).expect("there");
    let output = syntable().arg("validate").arg(&clean).output().expect("starts");
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(3));
    assert!(said.contains("readable: data/mono/rgb/0_0.png") && said.contains("read as syntable: 1 fault"), "{said}");
    let output = syntable().args(["validate", "--json"]).arg(&clean).output().expect("starts");
    let json: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!((json["faults"][0]["check"].as_str(), &json["images"]), (Some("readable"), &json!(4)));
}

#[test]
fn what_is_converted_and_back_is_what_it_was() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    dataset(&path("ours"));
    let convert = |from: &str, to: &str, out: &str| convert(&path(from), to, &path(out));
    // Our own form keeps everything.
    let said = ok(&mut convert("ours", "syntable", "again"));
    assert!(said.contains("4 images of 2 scenes written") && !said.contains("not carried over"), "{said}");
    for name in ["data", "parameters"] {
        assert_same(&path("ours").join(name), &path("again").join(name));
    }
    let read = |name: &str| fs::read(path(name).join("annotation_final.json")).expect("there");
    assert!(read("ours") == read("again"), "annotations differ");
    // COCO keeps masks, boxes, rates and categories.
    let said = ok(&mut convert("ours", "coco", "coco"));
    assert!(said.contains("not carried over") && said.contains("depth"), "{said}");
    assert_eq!(checks_that_fail(&path("coco").join("coco")), BTreeSet::new());
    ok(&mut convert("coco/coco", "coco", "coco again"));
    assert_same(&path("coco"), &path("coco again"));
    // Missing products that our form does not require are reported and omitted, and existing products are read back.
    let said = ok(&mut convert("coco/coco", "syntable", "lacking"));
    let left_out = "omitted: bodies, camera, denoiser, depth, exposure, label_policy, object_info, object_name\n";
    assert!(said.contains(left_out), "{said}");
    assert_eq!(checks_that_fail(&path("lacking")), BTreeSet::new());
    let json: Value = serde_json::from_slice(&read("lacking")).expect("JSON");
    let first = (&json["images"][0], &json["annotations"][0]);
    assert!(["camera", "depth_file_name", "depth_unit_mm", "exposure"].iter().all(|key| first.0.get(key).is_none()));
    assert!(first.1.get("object").is_none() && first.1.get("occluded_mask").is_some());
    ok(&mut convert("lacking", "coco", "coco of lacking"));
    assert_same(&path("coco"), &path("coco of lacking"));
    // Missing products that another form requires are reported, and nothing is written.
    let said = fails(&mut convert("coco/coco", "bop", "refused"), 2);
    assert!(said.contains("write.bop reads `depth`, `camera`, ") && !path("refused").exists(), "{said}");
    let said = fails(&mut convert("ours", "gltf", "scene"), 2);
    assert!(said.contains("--to gltf: this writer stores bodies"), "{said}");
    let said = fails(&mut convert("ours", "coco", "again"), 2);
    assert!(said.contains("not empty"), "{said}");
    assert!(fails(&mut convert("ours", "nothing", "none"), 2).contains("unknown kind of writer"));
}

/// A COCO dataset as other programs write it: only polygons of visible parts.
fn plain_coco(root: &Path) {
    fs::create_dir_all(root.join("annotations")).expect("writable");
    fs::create_dir_all(root.join("val2017")).expect("writable");
    image::RgbImage::from_fn(60, 40, |x, y| image::Rgb([x as u8, y as u8, 7]))
        .save(root.join("val2017/a.png"))
        .expect("writable");
    let annotation = |id: u32, category: u32, polygon: Value| {
        let bbox = json!([polygon[0], polygon[1], 20, 10]);
        json!({ "id": id, "image_id": 3, "category_id": category, "segmentation": [polygon], "area": 200.0,
                "bbox": bbox, "iscrowd": 0 })
    };
    let json = json!({
        "images": [{ "id": 3, "file_name": "a.png", "width": 60, "height": 40 }],
        "annotations": [
            annotation(8, 44, json!([10, 10, 30, 10, 30, 20, 10, 20])),
            annotation(9, 47, json!([35, 5, 55, 5, 55, 15, 35, 15])),
        ],
        "categories": [{ "id": 44, "name": "bottle", "supercategory": "kitchen" }, { "id": 47, "name": "cup" }],
    });
    fs::write(root.join("annotations/instances_val2017.json"), json.to_string()).expect("writable");
}

#[test]
fn yolo_labels_beside_coco_labels_are_ignored() {
    let folder = tempfile::tempdir().expect("a folder");
    let root = folder.path().join("coco");
    plain_coco(&root);
    for name in ["images/val2017", "labels/val2017"] {
        fs::create_dir_all(root.join(name)).expect("writable");
    }
    fs::copy(root.join("val2017/a.png"), root.join("images/val2017/a.png")).expect("writable");
    fs::write(root.join("labels/val2017/a.txt"), "0 0.2 0.2 0.4 0.2 0.4 0.5\n").expect("writable");
    let format = |format| open_dataset(&root, format).map(|(found, _)| found.name()).map_err(|error| error.to_string());
    assert_eq!(format(None), Ok("coco"));
    assert_eq!(format(Some("yolo")), Ok("yolo"));
    // With a description, the folder is a dataset of both formats, so the format is ambiguous.
    fs::write(root.join("data.yaml"), "train: images/val2017\nnames: [bottle]\n").expect("writable");
    assert!(format(None).is_err_and(|error| error.contains("like coco and like yolo")));
}

#[test]
fn faults_of_records_are_counted_as_validate_does() {
    let folder = tempfile::tempdir().expect("a folder");
    let (root, out) = (folder.path().join("coco"), folder.path().join("out"));
    plain_coco(&root);
    let file = root.join("annotations/instances_val2017.json");
    let json = fs::read_to_string(&file).expect("there").replace("\"iscrowd\"", "\"instance_id\":5,\"iscrowd\"");
    fs::write(&file, json).expect("writable");
    assert_eq!(checks_that_fail(&root).len(), 1, "an id is there twice");
    let said = crate::support::text(&convert(&root, "coco", &out).output().expect("the program starts"));
    assert!(said.contains("1 fault in the labels that were converted; the result may repeat it"), "{said}");
}

#[test]
fn datasets_without_amodal_masks_are_converted() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    plain_coco(&path("plain"));
    let convert = |from: &str, to: &str, out: &str| convert(&path(from), to, &path(out));
    let masks = |name: &str| -> Vec<(String, Vec<u32>)> {
        let (_, read) = open_dataset(&path(name), None).expect("a dataset");
        let products = read.read(0, &read.offers).expect("readable").products;
        let category = |id: u32| read.info.categories().find(|(other, _)| *other == id).expect("known").1.to_owned();
        let visible = products.get(VISIBLE_MASK).expect("there").iter();
        visible
            .map(|(id, mask)| (category(products.get(CATEGORY_ID).expect("there").0[&id]), mask.counts().to_vec()))
            .collect()
    };
    let want = masks("plain");
    assert_eq!(want.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["bottle", "cup"]);
    for (from, to) in [("plain", "syntable"), ("plain", "yolo"), ("plain", "coco"), ("plain", "coco_panoptic")] {
        let said = ok(&mut convert(from, to, to));
        assert!(
            said.contains("omitted: amodal_box, amodal_mask") || to == "syntable" && said.contains("amodal_mask"),
            "{said}"
        );
    }
    for name in ["syntable", "yolo", "coco"] {
        assert_eq!(masks(name), want, "{name}");
        assert_eq!(checks_that_fail(&path(name)), BTreeSet::new(), "{name}");
    }
    let json: Value =
        serde_json::from_slice(&fs::read(path("syntable/annotation_final.json")).expect("there")).expect("JSON");
    let annotation = &json["annotations"][0];
    assert!(
        ["occluded_mask", "occluded_rate", "amodal_bbox", "occluded_area"]
            .iter()
            .all(|key| annotation.get(key).is_none())
    );
    assert_eq!(annotation["area"], json!(200));
    // Converts the result again.
    ok(&mut convert("syntable", "coco", "coco again"));
    assert_same(&path("coco"), &path("coco again"));
    ok(&mut convert("yolo", "coco", "coco of yolo"));
    assert_eq!(masks("coco of yolo"), want);
    // Polygons around amodal masks need such masks.
    let said = fails(convert("plain", "yolo", "refused").args(["--set", "yolo.masks=\"amodal\""]), 2);
    assert!(said.contains("`amodal_mask`, ") && said.contains("which the dataset lacks"), "{said}");
}

#[test]
fn a_request_that_cannot_succeed_is_at_fault() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    plain_coco(&path("plain"));
    let image = path("plain/val2017/a.png");
    let bytes = fs::read(&image).expect("there");
    fs::write(&image, &bytes[..bytes.len() / 2]).expect("writable");
    let convert = |out: &Path| crate::support::convert(&path("plain"), "coco", out);
    let said = fails(&mut convert(&path("out")), 2);
    assert!(said.contains("a.png: not a readable PNG file") && !path("out").exists(), "{said}");
    fs::write(&image, bytes).expect("writable");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(path("nowhere"), path("link")).expect("a link");
        let said = fails(&mut convert(&path("link")), 2);
        assert!(said.contains("link: it is a link to a missing file"), "{said}");
        let said = fails(syntable().args(["run", "builtin:quickstart", "--out"]).arg(path("link")), 2);
        assert!(said.contains("it is a link to a missing file"), "{said}");
    }
    // A missing image stays missing; the path of the file opens the same dataset as its folder.
    let away = path("a.png");
    fs::rename(&image, &away).expect("there");
    let said = fails(&mut convert(&path("out")), 2);
    assert!(said.contains("a.png: no such file") && !path("out").exists(), "{said}");
    fs::rename(away, &image).expect("there");
    ok(&mut convert(&path("out")));
    let file = path("plain/annotations/instances_val2017.json");
    ok(&mut crate::support::convert(&file, "coco", &path("of file")));
    assert_same(&path("out"), &path("of file"));
    assert!(ok(syntable().arg("validate").arg(&file)).contains("1 image, read as coco: no fault"));
}

#[test]
fn checks_that_find_nothing_to_compare_are_not_made() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    dataset(&path("ours"));
    let checked = |name: &str, check: &str| {
        let (_, dataset) = open_dataset(&path(name), None).expect("a dataset");
        let found = checked(&dataset).expect("checked");
        found.checks.iter().find(|it| it.check == check).expect("a check").images
    };
    ok(&mut convert(&path("ours"), "bop", &path("bop")));
    for check in ["poses_reproject_into_masks", "depth_agrees_with_poses"] {
        // BOP stores the boxes of objects in `models`, which is not written here.
        assert_eq!((checked("ours", check), checked("bop", check)), (Some(4), Some(0)), "{check}");
    }
    assert_eq!(checked("bop", "poses_agree"), Some(4));
}

#[test]
fn a_dataset_that_cannot_be_opened_is_one_with_a_fault() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("annotations/instances_train.json");
    fs::create_dir(folder.path().join("annotations")).expect("writable");
    fs::write(&file, "{\"images\": [{\"id\": 1, ").expect("writable");
    let output = syntable().args(["validate", "--json"]).arg(folder.path()).output().expect("starts");
    assert_eq!(output.status.code(), Some(3));
    let found: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(found["faults"][0]["check"], "readable", "{found}");
    assert!(found["faults"][0]["message"].as_str().is_some_and(|it| it.contains("instances_train.json:1")), "{found}");
}

#[test]
fn rates_of_what_is_beyond_the_image_are_no_faults_of_other_formats() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data");
    let mut run = syntable();
    run.args(["run", "builtin:quickstart", "--scenes", "0", "--views", "1", "--out"]).arg(&data);
    for set in [
        "camera={ resolution=[160, 120], intrinsics={ fov_deg=22.0 } }",
        "render.samples_per_pixel=1",
        "denoise.kind=\"none\"",
        "annotate.masks.image_frame=\"extend\"",
        "write={ coco = {}, d2sa = {}, uoais = {}, cocoa = {} }",
    ] {
        run.args(["--set", set]);
    }
    made(&mut run);
    for format in ["coco", "d2sa", "uoais", "cocoa"] {
        ok(syntable().arg("validate").arg(data.join(format)));
    }
    // Only the policy makes the rates valid.
    let file = data.join("coco/annotations/instances_train.json");
    let mut json: Value = serde_json::from_str(&fs::read_to_string(&file).expect("there")).expect("JSON");
    json["images"][0].as_object_mut().expect("an object").remove("label_policy").expect("stated");
    fs::write(&file, json.to_string()).expect("writable");
    let said = fails(syntable().arg("validate").arg(data.join("coco")), 3);
    assert!(said.contains("fault"), "{said}");
}

#[test]
fn a_second_conversion_into_a_folder_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let (data, out) = (folder.path().join("data"), folder.path().join("out"));
    dataset(&data);
    let mark = folder.path().join("out.part/.syntable-part");
    fs::create_dir(folder.path().join("out.part")).expect("writable");
    let lock = fs::File::create(&mark).expect("writable");
    lock.lock().expect("locked");
    let mut convert = convert(&data, "coco", &out);
    assert!(fails(&mut convert, 2).contains("another command is writing it"));
    assert!(mark.is_file());
    drop(lock);
    ok(&mut convert);
    assert!(out.join("coco").is_dir() && !mark.exists());
}
