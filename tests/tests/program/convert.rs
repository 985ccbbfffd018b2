//! Conversions of other programs' datasets keep the numbers of categories and models, the meaning of masks, and all
//! readable parts of a damaged dataset.

use crate::support::{assert_same, convert, fails, made, ok, small_dataset, small_dataset_run, syntable, text};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use syntable::ConvertOptions;
use syntable::store::MemStore;
use syntable_model::product::standard::{AMODAL_BOX, AMODAL_MASK, CATEGORY_ID, OBJECT_INFO, VISIBLE_BOX, VISIBLE_MASK};
use syntable_model::product::{KeyId, Mask};
use syntable_model::reader;
use syntable_model::scene::InstanceId;
use syntable_program as _;
use syntable_testing::folder::{files, files_of_store};
use syntable_testing::takes::open_dataset;

fn json_of(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))).expect("JSON")
}

fn save(path: &Path, json: &Value) {
    fs::write(path, json.to_string()).expect("writable");
}

/// The faults that `validate` finds.
fn faults(root: &Path) -> Vec<(String, String)> {
    let output = syntable().args(["validate", "--json"]).arg(root).output().expect("starts");
    let found: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{}", text(&output)));
    let faults = found["faults"].as_array().expect("a list");
    let of = |fault: &Value, key: &str| fault[key].as_str().expect("text").to_owned();
    faults.iter().map(|fault| (of(fault, "check"), of(fault, "message"))).collect()
}

/// A COCO dataset as other programs write it, with one image per entry. An entry lists the categories of the image's
/// objects, which are squares.
fn foreign_coco(root: &Path, images: &[&[u32]], categories: &[(u32, &str)]) {
    fs::create_dir_all(root.join("annotations")).expect("writable");
    fs::create_dir_all(root.join("val2017")).expect("writable");
    let mut annotations = Vec::new();
    for (number, objects) in (1_u32..).zip(images) {
        image::RgbImage::new(60, 40).save(root.join(format!("val2017/{number}.png"))).expect("writable");
        for (place, category) in (0_u32..).zip(*objects) {
            let x = 2 + 12 * place;
            annotations.push(json!({
                "id": annotations.len() + 1, "image_id": number, "category_id": category, "area": 100.0, "iscrowd": 0,
                "segmentation": [[x, 5, x + 10, 5, x + 10, 15, x, 15]], "bbox": [x, 5, 10, 10],
            }));
        }
    }
    let image = |number| json!({ "id": number, "file_name": format!("{number}.png"), "width": 60, "height": 40 });
    let category = |(id, name): &(u32, &str)| {
        let supercategory = if *id < 40 { "" } else { "kitchen" };
        json!({ "id": id, "name": name, "supercategory": supercategory })
    };
    let json = json!({
        "images": (1..=images.len()).map(image).collect::<Vec<_>>(),
        "annotations": annotations,
        "categories": categories.iter().map(category).collect::<Vec<_>>(),
    });
    save(&root.join("annotations/instances_val2017.json"), &json);
}

/// Changes the annotation file of [`foreign_coco`].
fn spoil(root: &Path, change: impl FnOnce(&mut Value)) {
    let file = root.join("annotations/instances_val2017.json");
    let mut json = json_of(&file);
    change(&mut json);
    save(&file, &json);
}

/// Ids and names of the categories of a COCO file, and the category of each annotation.
fn categories(file: &Path) -> (Vec<(u64, String)>, Vec<u64>) {
    let json = json_of(file);
    let number = |value: &Value| value.as_u64().expect("a number");
    let named = json["categories"].as_array().expect("a list").iter();
    let of = json["annotations"].as_array().expect("a list").iter();
    (
        named.map(|it| (number(&it["id"]), it["name"].as_str().expect("text").to_owned())).collect(),
        of.map(|it| number(&it["category_id"])).collect(),
    )
}

#[test]
fn a_store_in_memory_gets_the_files_of_a_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    foreign_coco(&path("foreign"), &[&[47, 1], &[44]], &[(1, "person"), (44, "bottle"), (47, "cup")]);
    let registry = syntable::Registry::linked().expect("stock plugins");
    let to = ["coco", "yolo", "npz", "parquet"];
    let memory = Arc::new(MemStore::default());
    let in_memory = || ConvertOptions::new(path("foreign"), &to, Arc::clone(&memory));

    let cancelled = in_memory();
    cancelled.stop.cancel();
    assert!(syntable::convert(&registry, &cancelled, &syntable::Quiet).is_err());
    assert_eq!(memory.files().len(), 0, "a cancelled conversion leaves no file");

    syntable::convert(&registry, &in_memory(), &syntable::Quiet).expect("convertible");
    syntable::convert(&registry, &ConvertOptions::new(path("foreign"), &to, path("out")), &syntable::Quiet)
        .expect("convertible");
    assert!(files_of_store(&memory) == files(&path("out")), "same names and bytes");

    let Err(error) = syntable::convert(&registry, &in_memory(), &syntable::Quiet) else { panic!("it has files") };
    assert!(error.to_string().contains("the output folder is not empty"), "{error}");
}

#[test]
fn two_writers_do_not_write_one_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let (foreign, out) = (folder.path().join("foreign"), folder.path().join("out"));
    foreign_coco(&foreign, &[&[1]], &[(1, "person")]);
    let mut command = convert(&foreign, "syntable,jsonl", &out);
    let error = fails(command.args(["--set", "jsonl.file=\"annotation_final.json\""]), 2);
    assert!(error.contains("annotation_final.json") && !out.exists(), "{error}");
}

#[test]
fn categories_keep_their_ids() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    // Sorted by name, cup would precede person.
    let own = [(1, "person"), (44, "bottle"), (47, "cup")];
    foreign_coco(&path("foreign"), &[&[47, 1], &[44]], &own);
    let named: Vec<(u64, String)> = own.iter().map(|(id, name)| (u64::from(*id), (*name).to_owned())).collect();
    ok(&mut convert(&path("foreign"), "coco", &path("coco")));
    let file = |name: &str| path(name).join("coco/annotations/instances_train.json");
    assert_eq!(categories(&file("coco")), (named.clone(), vec![47, 1, 44]));
    // Converts through our own layout.
    ok(&mut convert(&path("foreign"), "syntable", &path("ours")));
    ok(&mut convert(&path("ours"), "coco", &path("again")));
    assert_eq!(categories(&file("again")), (named, vec![47, 1, 44]));
    for of in [path("ours").join("annotation_final.json"), file("coco"), file("again")] {
        let all = &json_of(&of)["categories"];
        let of_person = if of.starts_with(path("ours")) { "shape" } else { "" };
        assert_eq!([0, 1, 2].map(|at| all[at]["supercategory"].as_str()), [of_person, "kitchen", "kitchen"].map(Some));
    }
    // YOLO's classes have no gaps: they are in the order of the ids.
    ok(&mut convert(&path("foreign"), "yolo", &path("yolo")));
    let data = fs::read_to_string(path("yolo/yolo/data.yaml")).expect("there");
    assert!(data.ends_with("names:\n  0: \"person\"\n  1: \"bottle\"\n  2: \"cup\"\n"), "{data}");
    let labels = fs::read_to_string(path("yolo/yolo/labels/train/000000_0000.txt")).expect("there");
    let classes: Vec<&str> = labels.lines().filter_map(|line| line.split(' ').next()).collect();
    assert_eq!(classes, ["2", "0"]);
    ok(&mut convert(&path("yolo"), "yolo", &path("yolo again")));
    assert_same(&path("yolo"), &path("yolo again"));
    // Of two images with the same labels, one is omitted.
    let image = path("yolo again/yolo/images/train/000000_0000.png");
    fs::copy(&image, image.with_extension("jpg")).expect("writable");
    let said = fails(&mut convert(&path("yolo again"), "yolo", &path("yolo a third time")), 3);
    assert!(said.contains("has the same labels"), "{said}");
    // An unknown category is replaced by a new category, not by another category of the file.
    foreign_coco(&path("unknown"), &[&[47, 5]], &own);
    ok(&mut convert(&path("unknown"), "coco", &path("of unknown")));
    let (named, of) = categories(&file("of unknown"));
    assert_eq!((named.last(), of), (Some(&(48, "object".to_owned())), vec![47, 48]));
    // 0 is the background in maps, so the categories of such a file are renumbered.
    foreign_coco(&path("zero"), &[&[0, 1]], &[(0, "cup"), (1, "bottle")]);
    ok(&mut convert(&path("zero"), "coco", &path("of zero")));
    let (named, of) = categories(&file("of zero"));
    let name = |id: &u64| named.iter().find(|(other, _)| other == id).expect("known").1.as_str();
    assert_eq!(of.iter().map(name).collect::<Vec<_>>(), ["cup", "bottle"]);
}

/// Numbers of classes in YOLO labels, and the names of the numbers in `data.yaml`.
fn classes(yolo: &Path) -> (BTreeSet<usize>, Vec<String>) {
    let data = fs::read_to_string(yolo.join("data.yaml")).expect("there");
    let names =
        data.lines().filter_map(|line| Some(line.strip_prefix("  ")?.split_once(": ")?.1.trim_matches('"').to_owned()));
    let files = fs::read_dir(yolo.join("labels/train")).expect("there").map(|entry| entry.expect("readable").path());
    let lines = files.map(|file| fs::read_to_string(file).expect("text")).collect::<String>();
    let used = lines.lines().filter_map(|line| line.split(' ').next()?.parse().ok()).collect();
    (used, names.collect())
}

/// Two parts of a dataset that show disjoint sets of objects.
#[test]
fn parts_of_a_dataset_are_numbered_alike() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let json = "jsonl = { include = [\"rgb\", \"visible_mask\", \"category_id\", \"object_name\"] }";
    let writers = format!("write={{ bop = {{}}, yolo = {{}}, web = {{ kind = \"webdataset\" }}, {json} }}");
    let [mugs, books] = ["mug", "book"].map(|name| format!("assets.objects.include=[\"{name}*\"]"));
    let names = "assets.objects.classes={ book = [\"book*\"], mug = [\"mug*\"], zebra = [\"zebra*\"] }";
    for (part, include) in [("train", &mugs), ("val", &books)] {
        let more =
            [&writers, include.as_str(), names, "dataset.scenes=1", "dataset.views_per_scene=1", "place[2].count=4"];
        small_dataset(&path(part), &more);
    }
    let of_yolo = |part: &str, from: &str, more: &dyn Fn(&Path)| {
        more(&path(part).join(from));
        let out = path(&format!("{part} {from}").replace('.', " "));
        let said = made(&mut convert(&path(part).join(from), "yolo", &out));
        (classes(&out.join("yolo")), said)
    };
    let nothing: &dyn Fn(&Path) = &|_| {};
    let no_list: &dyn Fn(&Path) = &|root| fs::remove_file(root.join("categories.json")).expect("there");
    let no_names: &dyn Fn(&Path) = &|root| fs::remove_file(root.join("data.yaml")).expect("there");
    for (from, more, is_listed) in
        [("bop", nothing, false), ("web", nothing, true), ("web", no_list, false), ("yolo", no_names, false)]
    {
        let [(train, said), (val, _)] = ["train", "val"].map(|part| {
            let _ = fs::remove_dir_all(path(&format!("{part} {from}")));
            of_yolo(part, from, more)
        });
        assert!(train.0.is_disjoint(&val.0) && !train.0.is_empty() && !val.0.is_empty(), "{from}: {train:?} {val:?}");
        assert_eq!(said.contains("note: nothing lists all categories of the dataset"), !is_listed, "{from}: {said}");
        // A number has one name, or no name in one of the parts.
        for (number, (one, other)) in train.1.iter().zip(&val.1).enumerate() {
            let unnamed = [reader::unnamed_object(number as u64 + 1), reader::unnamed_category(number as u64 + 1)];
            let has_name = |name: &String| !unnamed.contains(name);
            assert!(one == other || !has_name(one) || !has_name(other), "{from}: {number} is {one} and {other}");
        }
        let of = |(used, names): &(BTreeSet<usize>, Vec<String>)| used.iter().all(|class| *class < names.len());
        assert!(of(&train) && of(&val), "{from}: {train:?} {val:?}");
    }
}

/// In BOP, the folder of models lists the objects, whatever objects a split shows.
#[test]
fn objects_of_bop_match_its_models() {
    let folder = tempfile::tempdir().expect("a folder");
    let root = folder.path().join("bop");
    let write = |path: &str, text: &str| {
        let path = root.join(path);
        fs::create_dir_all(path.parent().expect("inside")).expect("writable");
        fs::write(path, text).expect("writable");
    };
    let object = |id: u32| {
        let pose = json!({ "obj_id": id, "cam_R_m2c": [1, 0, 0, 0, 1, 0, 0, 0, 1], "cam_t_m2c": [0, 0, 500] });
        json!({ "0": [pose] }).to_string()
    };
    let info = json!({ "0": [{ "bbox_obj": [2, 2, 3, 3], "bbox_visib": [2, 2, 3, 3], "px_count_all": 16, "px_count_valid": 16,
                               "px_count_visib": 16, "visib_fract": 1.0 }] });
    for (split, id) in [("train", 7), ("val", 3)] {
        let scene = format!("{split}/000001");
        write(&format!("{scene}/scene_gt.json"), &object(id));
        write(&format!("{scene}/scene_gt_info.json"), &info.to_string());
        let camera = json!({ "0": { "cam_K": [100, 0, 8, 0, 100, 8, 0, 0, 1], "depth_scale": 1.0 } });
        write(&format!("{scene}/scene_camera.json"), &camera.to_string());
        for name in ["rgb", "depth", "mask", "mask_visib"] {
            fs::create_dir_all(root.join(&scene).join(name)).expect("writable");
        }
        image::RgbImage::new(16, 16).save(root.join(&scene).join("rgb/000000.png")).expect("writable");
        image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::new(16, 16)
            .save(root.join(&scene).join("depth/000000.png"))
            .expect("writable");
        let mask = image::GrayImage::from_fn(16, 16, |x, y| {
            image::Luma([if (2..6).contains(&x) && (2..6).contains(&y) { 255 } else { 0 }])
        });
        for name in ["mask", "mask_visib"] {
            mask.save(root.join(&scene).join(name).join("000000_000000.png")).expect("writable");
        }
    }
    let found = |split: &str| {
        let out = folder.path().join("out");
        let said = ok(&mut convert(&root.join(split), "yolo,coco", &out));
        let found = (classes(&out.join("yolo")), categories(&out.join("coco/annotations/instances_train.json")));
        fs::remove_dir_all(out).expect("there");
        (found, said.contains("note: nothing lists all categories of the dataset (`models/models_info.json`"))
    };
    let names = |numbers: &[u64]| numbers.iter().map(|id| reader::unnamed_object(*id)).collect::<Vec<_>>();
    let listed = |numbers: &[u64]| numbers.iter().copied().zip(names(numbers)).collect::<Vec<_>>();
    // Without models, all numbers up to the largest number.
    let [train, val] = [[1, 2, 3, 4, 5, 6, 7].as_slice(), &[1, 2, 3]];
    assert_eq!(found("train"), (((BTreeSet::from([6]), names(train)), (listed(train), vec![7])), true));
    assert_eq!(found("val"), (((BTreeSet::from([2]), names(val)), (listed(val), vec![3])), true));
    // With models, exactly these numbers, whichever file lists them.
    let size = json!({ "diameter": 1, "min_x": 0, "min_y": 0, "min_z": 0, "size_x": 1, "size_y": 1, "size_z": 1 });
    let numbers: &[u64] = &[3, 7, 9];
    let of_meshes = |folder: &str| numbers.iter().for_each(|id| write(&format!("{folder}/obj_{id:06}.ply"), "ply\n"));
    let of_list = |folder: &str| {
        let all = json!({ "3": &size, "7": &size, "9": &size });
        write(&format!("{folder}/models_info.json"), &all.to_string());
    };
    for (folder, list) in
        [("models_eval", &of_meshes as &dyn Fn(&str)), ("models_eval", &of_list), ("models", &of_list)]
    {
        list(folder);
        assert_eq!(found("train"), (((BTreeSet::from([1]), names(numbers)), (listed(numbers), vec![7])), false));
        assert_eq!(found("val"), (((BTreeSet::from([0]), names(numbers)), (listed(numbers), vec![3])), false));
        fs::remove_dir_all(root.join(folder)).expect("there");
    }
}

#[test]
fn labels_that_nothing_holds_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    foreign_coco(&path("foreign"), &[&[1, 1], &[1]], &[(1, "cup")]);
    spoil(&path("foreign"), |json| {
        json["licenses"] = json!([{ "id": 1, "name": "free" }]);
        json["images"][0]["license"] = json!(1);
        json["images"][1]["coco_url"] = json!("http://there");
    });
    // Additional information is not a label.
    let said = ok(&mut convert(&path("foreign"), "coco", &path("out")));
    let note = "note: information beside labels is not kept: the section `licenses`, `coco_url` of 1 images, `license` of 1 images";
    assert!(said.contains(note), "{said}");
    spoil(&path("foreign"), |json| {
        json["annotations"][0]["keypoints"] = json!([1, 2, 2]);
        json["annotations"][0]["num_keypoints"] = json!(1);
        json["annotations"][1]["keypoints"] = json!([0, 0, 0]);
        json["annotations"][2]["attributes"] = json!({ "occluded": true });
        json["images"][0]["caption"] = json!("two cups");
    });
    let said = fails(&mut convert(&path("foreign"), "coco", &path("again")), 3);
    for part in [
        "1 of 3 annotations have `keypoints`, which is not kept",
        "1 of 3 annotations have `attributes`, which is not kept",
        "1 of 2 images have `caption`, which is not kept",
        "3 fields with labels not kept",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert_same(&path("out"), &path("again"));
    // Statistics ignore these fields, so nothing is lost.
    ok(syntable().arg("stats").arg(path("foreign")));
}

#[test]
fn images_of_one_id_or_of_one_file_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    foreign_coco(&path("ids"), &[&[1], &[1], &[1]], &[(1, "cup")]);
    spoil(&path("ids"), |json| json["images"][1]["id"] = json!(1));
    foreign_coco(&path("names"), &[&[1], &[1], &[1]], &[(1, "cup")]);
    spoil(&path("names"), |json| json["images"][1]["file_name"] = json!("1.png"));
    foreign_coco(&path("spellings"), &[&[1], &[1], &[1]], &[(1, "cup")]);
    spoil(&path("spellings"), |json| json["images"][1]["file_name"] = json!("./a/../1.png"));
    // If two images have one id, the image of an annotation is ambiguous. If two images have one file, the second image
    // is omitted.
    for (name, images, says, place) in [
        (
            "spellings",
            2,
            "image 1 is of this file, too: ./a/../1.png; image 2 is left out, with its annotations (1)",
            "image 2: ",
        ),
        ("ids", 1, "two images have this id, 1.png and 2.png: they are left out, with their annotations", "image 1: "),
        ("names", 2, "image 1 is of this file, too: 1.png; image 2 is left out, with its annotations (1)", "image 2: "),
    ] {
        let output = convert(&path(name), "coco", &path(&format!("{name} out"))).output().expect("starts");
        let said = text(&output);
        assert_eq!(output.status.code(), Some(3), "{said}");
        assert!(said.contains(says) && said.contains(place), "{said}");
        let written = json_of(&path(&format!("{name} out/coco/annotations/instances_train.json")));
        assert_eq!(written["images"].as_array().map(Vec::len), Some(images), "{name}");
        assert_eq!(written["annotations"].as_array().map(Vec::len), Some(images), "{name}");
        let stats = fails(syntable().arg("stats").arg(path(name)), 3);
        assert!(stats.contains(says), "{stats}");
        assert!(faults(&path(name)).iter().any(|(_, message)| message.contains(says)), "{name}");
    }
}

#[test]
fn folders_inside_of_other_datasets_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().canonicalize().expect("there").join(name);
    foreign_coco(&path("foreign"), &[&[1]], &[(1, "cup")]);
    let file = path("foreign/annotations/instances_val2017.json");
    fs::create_dir_all(path("run/.syntable")).expect("writable");
    fs::create_dir_all(path("run/coco")).expect("writable");
    fs::write(path("run/.syntable/journal.jsonl"), "").expect("writable");
    for (from, out, root, what) in [
        (path("foreign"), "foreign/out", "foreign", "the source dataset"),
        (path("foreign"), "foreign/not/there/out", "foreign", "the source dataset"),
        (file.clone(), "foreign/out", "foreign", "the source dataset"),
        (file, "foreign/annotations/out", "foreign", "the source dataset"),
        (path("foreign"), "run/out", "run", "the folder of a run"),
        (path("foreign"), "run/coco", "run", "the folder of a run"),
        (path("foreign"), "run/not/there", "run", "the folder of a run"),
    ] {
        let said = fails(&mut convert(&from, "coco", &path(out)), 2);
        let parts =
            [path(out).display().to_string(), format!("the output folder is inside {what}, {}", path(root).display())];
        assert!(parts.iter().all(|part| said.contains(part.as_str())), "{said}");
        assert!(said.contains("choose a folder outside, such as ") && !path(out).join("coco").exists());
    }
    ok(&mut convert(&path("foreign"), "coco", &path("foreign out")));
    // The folder of the annotation file represents the dataset that contains it, and reports follow the same rule as
    // datasets.
    let inner = path("foreign/annotations");
    assert_eq!(open_dataset(&inner, None).map(|(format, _)| format.name()).ok(), Some("coco"));
    ok(&mut convert(&inner, "coco", &path("inner out")));
    assert_same(&path("foreign out"), &path("inner out"));
    ok(&mut convert(&path("inner out/coco/annotations"), "coco", &path("again out")));
    let out = path("foreign/out");
    for from in [&path("foreign"), &inner] {
        let mut stats = syntable();
        stats.arg("stats").arg(from).arg("--csv").arg(&out);
        assert!(fails(&mut stats, 2).contains("--csv would write into"));
        for verb in [&mut convert(from, "coco", &out), syntable().arg("report").arg(from).arg("--out").arg(&out)] {
            let said = fails(verb, 2);
            assert!(said.contains("the output folder is inside the source dataset, ") && !out.exists(), "{said}");
        }
    }
}

#[test]
fn objects_without_pixels_are_named_where_they_are_dropped() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    // Between the centers of four pixels, and outside the image.
    let outlines = [json!([[20.6, 20.6, 21.4, 20.6, 21.4, 21.4, 20.6, 21.4]]), json!([[70, 5, 80, 5, 80, 15, 70, 15]])];
    foreign_coco(&path("coco"), &[&[1], &[1, 1], &[1]], &[(1, "cup")]);
    spoil(&path("coco"), |json| {
        let [tiny, outside] = outlines;
        json["annotations"][2]["segmentation"] = tiny;
        json["annotations"][3]["segmentation"] = outside;
    });
    let named = ["2.png: annotation 3: the object has no pixels", "3.png: annotation 4: the object has no pixels"];
    for to in ["coco", "yolo", "coco_panoptic"] {
        let said = fails(&mut convert(&path("coco"), to, &path(&format!("to {to}"))), 3);
        let count = format!("write.{to}: 2 of 3 objects are left out: their masks cover no pixel of the image");
        let says = |part: &str| said.contains(part);
        assert!(named.iter().all(|part| says(part)) && says("2 objects without pixels"), "{said}");
        assert!(said.contains(&count), "{said}");
    }
    let found = faults(&path("coco"));
    assert_eq!(
        found.iter().filter(|(check, _)| check == syntable_model::rule::OBJECTS_HAVE_PIXELS).count(),
        2,
        "{found:?}"
    );
    // SynTable's layout keeps them.
    ok(&mut convert(&path("coco"), "syntable", &path("syntable")));
    // A format without numbers of objects: the second line of an image of 60 × 40 pixels.
    let labels = path("to yolo/yolo/labels/train/000001_0000.txt");
    let tiny = "0 0.5101 0.5101 0.5102 0.5101 0.5102 0.5102\n";
    fs::write(&labels, fs::read_to_string(&labels).expect("there") + tiny).expect("writable");
    let said = fails(&mut convert(&path("to yolo"), "coco", &path("of yolo")), 3);
    assert!(said.contains("000001_0000: instance 2 has no pixels"), "{said}");
}

/// A frame of 20 × 20 pixels around a hole of 8 × 8, in one image of 60 × 40.
fn frame(root: &Path, keys: &[&str]) {
    foreign_coco(root, &[&[1]], &[(1, "ring")]);
    let is_set = |x: u32, y: u32| {
        let within = |low: u32, high: u32| (low..high).contains(&x) && (low..high).contains(&y);
        within(5, 25) && !within(10, 18)
    };
    let counts = Mask::from_fn(60, 40, is_set).counts().to_vec();
    spoil(root, |json| {
        for key in keys {
            json["annotations"][0][key] = json!({ "size": [40, 60], "counts": &counts });
        }
        json["annotations"][0]["bbox"] = json!([5, 5, 20, 20]);
        json["annotations"][0]["area"] = json!(336);
    });
}

#[test]
fn holes_that_polygons_fill_are_counted() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    frame(&path("ring"), &["segmentation", "amodal_mask", "visible_mask"]);
    let says = |said: &str, masks: &str| {
        said.contains(&format!(
            "1 of 1 objects have holes in their {masks} masks, which the polygons of the format fill"
        ))
    };
    for (to, set, visible, amodal) in [
        ("yolo", "yolo.split=\"train\"", true, false),
        ("yolo", "yolo.masks=\"amodal\"", false, true),
        ("cocoa", "cocoa.split=\"train2014\"", false, true),
        ("kins", "kins.version=\"2019\"", false, true),
        ("kins", "kins.version=\"2020\"", true, true),
    ] {
        let said = fails(convert(&path("ring"), to, &path("lossy")).args(["--set", set]), 3);
        assert_eq!((says(&said, "visible"), says(&said, "amodal")), (visible, amodal), "{set}: {said}");
        assert!(said.contains(&format!("data are written incompletely by write.{to}")), "{said}");
        fs::remove_dir_all(path("lossy")).expect("there");
    }
    // Rotated boxes enclose the mask, and the other formats store masks.
    for (to, set) in [("yolo", "yolo.task=\"obb\""), ("d2sa", "d2sa.split=\"all\""), ("coco", "coco.split=\"all\"")] {
        ok(convert(&path("ring"), to, &path("whole")).args(["--set", set]));
        fs::remove_dir_all(path("whole")).expect("there");
    }
}

#[test]
fn options_that_the_dataset_cannot_meet_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    frame(&path("visible"), &["segmentation"]);
    frame(&path("amodal"), &["segmentation", "amodal_mask"]);
    spoil(&path("amodal"), |json| json["info"] = json!({ "masks": "amodal" }));
    for (have, lack) in [("visible", "amodal"), ("amodal", "visible")] {
        let masks = |masks: &str| ["--set".to_owned(), format!("coco.masks=\"{masks}\"")];
        let said = fails(convert(&path(have), "coco", &path("out")).args(masks(lack)), 2);
        let want = format!("--set coco.masks=\"{lack}\" needs `{lack}_mask`, which the dataset lacks");
        assert!(said.contains(&want) && !path("out").exists(), "{said}");
        for options in [&masks(have)[..], &[]] {
            ok(convert(&path(have), "coco", &path("out")).args(options));
            fs::remove_dir_all(path("out")).expect("there");
        }
    }
}

#[test]
fn numbers_without_names_agree_with_any_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    foreign_coco(&path("coco"), &[&[1, 2]], &[(1, "bottle"), (2, "cup")]);
    ok(&mut convert(&path("coco"), "yolo", &path("named")));
    ok(&mut convert(&path("coco"), "yolo", &path("unnamed")));
    fs::remove_file(path("unnamed/yolo/data.yaml")).expect("there");
    let both = |one: &str| syntable().arg("validate").args([path(one), path("coco")]).output().expect("starts");
    for name in ["named", "unnamed"] {
        let output = both(name);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output));
    }
    // The generic name of another number counts as a name.
    let data = path("named/yolo/data.yaml");
    let spoiled = fs::read_to_string(&data).expect("there").replace("cup", "class 0");
    fs::write(&data, spoiled).expect("writable");
    assert_eq!(both("named").status.code(), Some(3));
}

#[test]
fn datasets_without_images_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    foreign_coco(&path("coco"), &[], &[(1, "cup")]);
    for verb in [&mut convert(&path("coco"), "coco", &path("out")), syntable().arg("stats").arg(path("coco"))] {
        assert!(fails(verb, 2).contains("coco: the dataset has no image"));
    }
    assert!(!path("out").exists());
}

#[test]
fn images_that_cannot_be_read_are_left_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    foreign_coco(&path("foreign"), &[&[1], &[1, 1], &[1]], &[(1, "cup")]);
    fs::write(path("foreign/val2017/2.png"), "no image").expect("writable");
    fs::remove_file(path("foreign/val2017/3.png")).expect("there");
    let output = convert(&path("foreign"), "coco,syntable", &path("out")).output().expect("starts");
    let said = text(&output);
    assert_eq!(output.status.code(), Some(3), "{said}");
    for part in ["1 image of 1 scene written", "2.png", "3.png: no such file", "2 images left out"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let json = json_of(&path("out/coco/annotations/instances_train.json"));
    assert_eq!(
        (json["images"].as_array().map(Vec::len), json["annotations"].as_array().map(Vec::len)),
        (Some(1), Some(1))
    );
    assert_eq!(faults(&path("out/coco")), []);
    // Without a readable image, no dataset is created.
    fs::remove_file(path("foreign/val2017/1.png")).expect("there");
    let said = fails(&mut convert(&path("foreign"), "coco", &path("none")), 2);
    assert!(said.contains("no image can be read") && !path("none").exists(), "{said}");
}

/// Image files are copied if the format stores their encoding and every program shows the same pixels.
#[test]
fn files_of_images_are_copied() {
    let folder = tempfile::tempdir().expect("a folder");
    let [root, out] = ["source", "out"].map(|name| folder.path().join(name));
    foreign_coco(&root, &[&[1], &[1], &[1], &[1]], &[(1, "mug")]);
    let image = |name: &str| root.join("val2017").join(name);
    let color = image::RgbImage::from_fn(60, 40, |x, y| image::Rgb([4 * x as u8, 6 * y as u8, 7]));
    color.save(image("1.png")).expect("writable");
    color.save(image("2.jpg")).expect("writable");
    image::GrayImage::from_pixel(60, 40, image::Luma([9])).save(image("3.png")).expect("writable");
    let [plain, jpeg, gray] = ["1.png", "2.jpg", "3.png"].map(|name| fs::read(image(name)).expect("there"));
    fs::write(image("4.png"), &plain[..plain.len() - 20]).expect("writable");
    spoil(&root, |json| json["images"][1]["file_name"] = json!("2.jpg"));
    let mut command = syntable();
    command.arg("convert").arg(&root).args(["--to", "coco,yolo,syntable", "--out"]).arg(&out);
    let said = fails(&mut command, 3);
    assert!(said.contains("4.png") && said.contains("1 image left out as unreadable"), "{said}");
    let written = files(&out);
    let of = |end: &str| {
        let found: Vec<_> = written.iter().filter(|(path, _)| path.ends_with(end)).collect();
        assert_eq!(found.len(), 1, "{end}: {:?}", written.keys());
        found[0].1.clone()
    };
    for folder in ["coco/images", "yolo/images/train"] {
        assert!(of(&format!("{folder}/000000_0000.png")) == plain, "{folder}");
        assert!(of(&format!("{folder}/000001_0000.jpg")) == jpeg, "{folder}");
        let encoded = of(&format!("{folder}/000002_0000.png"));
        assert!(encoded != gray, "{folder}");
        let encoded = image::load_from_memory(&encoded).expect("an image");
        assert_eq!(
            (encoded.color(), encoded.to_rgb8().get_pixel(5, 5).0),
            (image::ColorType::Rgb8, [9; 3]),
            "{folder}"
        );
    }
    // SynTable's layout stores PNG only.
    assert!(of("rgb/0_0.png") == plain);
    assert_eq!(image::guess_format(&of("rgb/1_0.png")).expect("an image"), image::ImageFormat::Png);
    let file = written.keys().find(|path| path.ends_with("coco/annotations/instances_train.json")).expect("a file");
    assert_eq!(json_of(&out.join(file))["images"][1]["file_name"], "000001_0000.jpg");
    assert_eq!(faults(&out.join("coco")), []);
}

/// The ids of the pixels of a panoptic image, and the records of its segments.
fn panoptic(root: &Path) -> (Vec<u64>, Vec<Value>) {
    let json = json_of(&root.join("annotations/panoptic_train.json"));
    let annotation = &json["annotations"][0];
    let name = annotation["file_name"].as_str().expect("text");
    let image = image::open(root.join("annotations/panoptic_train").join(name)).expect("an image").to_rgb8();
    let ids = image.pixels().map(|it| u64::from(it[0]) + 256 * u64::from(it[1]) + 65536 * u64::from(it[2])).collect();
    (ids, annotation["segments_info"].as_array().expect("a list").clone())
}

#[test]
fn what_overlapping_masks_lose_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    foreign_coco(&path("foreign"), &[&[1, 1, 1, 1]], &[(1, "cup")]);
    // A large square, the same small square twice within it, and a square outside.
    let file = path("foreign/annotations/instances_val2017.json");
    let mut json = json_of(&file);
    for (place, [x, y, edge]) in [[0, 0, 30], [10, 10, 5], [10, 10, 5], [40, 20, 10]].into_iter().enumerate() {
        let (u, v) = (x + edge, y + edge);
        json["annotations"][place]["segmentation"] = json!([[x, y, u, y, u, v, x, v]]);
        json["annotations"][place]["bbox"] = json!([x, y, edge, edge]);
        json["annotations"][place]["area"] = json!(edge * edge);
    }
    save(&file, &json);
    let said = fails(&mut convert(&path("foreign"), "coco,npz,coco_panoptic", &path("out")), 3);
    for stage in ["write.coco_panoptic", "annotate.label_arrays"] {
        for lost in ["2 of 4 objects lost pixels where masks overlap", "1 of 4 objects lost all of their pixels"] {
            assert!(said.lines().any(|line| line.contains(stage) && line.contains(lost)), "{stage}, {lost}: {said}");
        }
    }
    assert!(
        said.contains("written incompletely by annotate.label_arrays (visible_ids), write.coco_panoptic"),
        "{said}"
    );
    // The requirements of panopticapi: each segment has the stated pixels, and each pixel belongs to a segment.
    let (ids, segments) = panoptic(&path("out/coco_panoptic"));
    assert_eq!(ids.iter().collect::<BTreeSet<_>>().len(), segments.len());
    let row = |id: u64, area: u64, bbox: [u64; 4]| (json!(id), json!(area), json!(bbox));
    let of = |it: &Value| (it["id"].clone(), it["area"].clone(), it["bbox"].clone());
    let want = [
        row(1, 875, [0, 0, 30, 30]),
        row(2, 25, [10, 10, 5, 5]),
        row(4, 100, [40, 20, 10, 10]),
        row(1 << 16, 1400, [0, 0, 60, 40]),
    ];
    assert_eq!(segments.iter().map(of).collect::<Vec<_>>(), want);
    for segment in &segments {
        let pixels = ids.iter().filter(|id| Some(**id) == segment["id"].as_u64()).count() as u64;
        assert_eq!(Some(pixels), segment["area"].as_u64());
    }
    assert_eq!(faults(&path("out/coco_panoptic")), []);
    let (_, arrays) = open_dataset(&path("out/npz"), None).expect("a dataset");
    let products = arrays.read(0, &[VISIBLE_MASK.id()]).expect("readable").products;
    let areas: Vec<(u16, u32)> =
        products.get(VISIBLE_MASK).expect("there").iter().map(|(id, mask)| (id.0, mask.area())).collect();
    assert_eq!(areas, [(1, 875), (2, 25), (3, 0), (4, 100)]);
    // A format that stores masks loses nothing.
    ok(&mut convert(&path("foreign"), "coco", &path("alone")));
    assert_same(&path("alone/coco"), &path("out/coco"));
}

#[test]
fn annotations_that_are_no_objects_are_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    foreign_coco(&path("foreign"), &[&[1, 1, 1]], &[(1, "cup")]);
    let file = path("foreign/annotations/instances_val2017.json");
    let mut json = json_of(&file);
    json["annotations"][1]["iscrowd"] = json!(1);
    json["annotations"][2]["segmentation"] = json!([]);
    save(&file, &json);
    let said = fails(&mut convert(&path("foreign"), "npz", &path("out")), 3);
    for part in [
        "1 of 3 annotations are crowds",
        "1 of 2 objects have a box and no mask",
        "2 annotations left out or incomplete",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    // COCO keeps boxes, and the archive beside it lacks them.
    let said = fails(&mut convert(&path("foreign"), "coco,npz", &path("both")), 3);
    assert!(said.contains("1 of 2 objects have a box and no mask"), "{said}");
    let said = fails(&mut convert(&path("foreign"), "coco", &path("boxes")), 3);
    assert!(said.contains("1 annotation left out") && !said.contains("box and no mask"), "{said}");
}

#[test]
fn images_that_a_dataset_hides_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    foreign_coco(&path("foreign"), &[&[1], &[1]], &[(1, "cup")]);
    // Two images of the same view.
    fs::rename(path("foreign/val2017/1.png"), path("foreign/val2017/0_0.png")).expect("there");
    fs::create_dir(path("foreign/val2017/more")).expect("writable");
    fs::rename(path("foreign/val2017/2.png"), path("foreign/val2017/more/0_0.png")).expect("there");
    let file = path("foreign/annotations/instances_val2017.json");
    let mut json = json_of(&file);
    (json["images"][0]["file_name"], json["images"][1]["file_name"]) = (json!("0_0.png"), json!("more/0_0.png"));
    save(&file, &json);
    let mut stats = syntable();
    stats.arg("stats").arg(path("foreign"));
    for mut verb in [convert(&path("foreign"), "coco", &path("out")), stats] {
        let said = fails(&mut verb, 3);
        assert!(said.contains("more/0_0.png: it is view 0 of scene 0"), "{said}");
        assert!(said.contains("1 part left out as unreadable"), "{said}");
    }
}

#[test]
fn a_dataset_that_was_read_has_no_scene() {
    let folder = tempfile::tempdir().expect("a folder");
    let (data, out) = (folder.path().join("data"), folder.path().join("out"));
    small_dataset(&data, &["write={ syntable = { debug_masks = true } }"]);
    let said = fails(&mut convert(&data, "gltf", &out), 2);
    assert!(said.contains("--to gltf: this writer stores") && !out.exists(), "{said}");
    // The products contain all the data for these files.
    ok(convert(&data, "syntable", &out).args(["--set", "syntable.debug_masks=true"]));
    let [one, other] = [&data, &out].map(|it| crate::support::files(&it.join("data/mono/instance")));
    let whole: Vec<&String> = one.keys().filter(|name| name.matches('_').count() == 1).collect();
    assert!(whole.len() > 1 && one.len() == other.len());
    for name in whole {
        assert!(one[name] == other[name], "{name}");
    }
}

#[test]
fn amodal_masks_alone_are_no_visible_ones() {
    let folder = tempfile::tempdir().expect("a folder");
    let (data, coco) = (folder.path().join("data"), folder.path().join("coco"));
    small_dataset(&data, &["write={ syntable = {}, yolo = { masks = \"amodal\" } }"]);
    let yolo = data.join("yolo");
    assert_eq!(faults(&yolo), []);
    ok(&mut convert(&yolo, "coco", &coco));
    assert_eq!(faults(&coco), []);
    let masks = |root: &Path| -> Vec<Vec<u32>> {
        let (_, dataset) = open_dataset(root, None).expect("a dataset");
        assert!(!dataset.offers.contains(&VISIBLE_MASK.id()), "{}", root.display());
        let read = |image| dataset.read(image, &[AMODAL_MASK.id()]).expect("readable").products;
        let of = |image| read(image).get(AMODAL_MASK).expect("there").iter().map(|it| it.1.counts().to_vec()).collect();
        (0..dataset.images.len()).flat_map(|image| -> Vec<Vec<u32>> { of(image) }).collect()
    };
    let whole = masks(&yolo);
    assert!(whole.len() > 10 && whole == masks(&coco));
    ok(&mut convert(&coco, "coco", &folder.path().join("again")));
    assert_same(&coco, &folder.path().join("again"));
    // Writers that need visible masks refuse the dataset.
    let said = fails(&mut convert(&coco, "coco_panoptic", &folder.path().join("panoptic")), 2);
    assert!(said.contains("reads `visible_mask`, `visible_box`, which the dataset lacks"), "{said}");
    let said = ok(&mut convert(&coco, "npz", &folder.path().join("arrays")));
    assert!(said.contains("omitted: depth, occlusion_order, visible_box, visible_ids"), "{said}");
    assert!(whole == masks(&folder.path().join("arrays")));
    let mut given = convert(&coco, "npz", &folder.path().join("given"));
    let said = fails(given.args(["--set", "npz.include=[\"depth\", \"visible_box\", \"amodal_box\"]"]), 2);
    assert!(said.contains("reads `depth`, `visible_box`, which the dataset lacks"), "{said}");
    assert!(said.contains("with --set 'npz.include=[\"category_id\"]'"), "{said}");
    // The objects overlap, so they would be faulty if they were read as visible masks.
    let file = yolo.join("data.yaml");
    let text = fs::read_to_string(&file).expect("there");
    fs::write(&file, text.replace("masks: amodal\n", "")).expect("writable");
    assert!(faults(&yolo).iter().any(|(check, _)| check == "visible_masks_disjoint"));
    fs::write(&file, text.replace("masks: amodal", "masks: whole")).expect("writable");
    assert!(faults(&yolo).iter().any(|(_, message)| message.contains("`masks` is `whole`")));
}

#[test]
fn datasets_of_images_without_objects_are_sound() {
    let folder = tempfile::tempdir().expect("a folder");
    let formats = ["uoais", "cocoa", "coco", "kins", "d2sa", "yolo"];
    let writers: Vec<String> = formats.iter().map(|format| format!("{format} = {{}}")).collect();
    let writers = format!("write={{ {} }}", writers.join(", "));
    let mut run = small_dataset_run(folder.path(), &["annotate.masks.min_visible_px=100000", &writers]);
    assert!(fails(&mut run, 3).contains("no object is labeled in any view"));
    for format in formats {
        assert_eq!(faults(&folder.path().join(format)), [], "{format}");
    }
    // The annotation file of a format that lists all images must not be empty.
    let file = folder.path().join("coco/annotations/instances_train.json");
    let mut json = json_of(&file);
    json["images"] = json!([]);
    save(&file, &json);
    assert_eq!(faults(&folder.path().join("coco"))[0].1, "the dataset has no image");
}

/// A BOP dataset with models, and the folder of its only split.
fn bop(root: &Path, more: &[&str]) -> [PathBuf; 2] {
    small_dataset(root, &[&["write={ syntable = {}, bop = { models = \"models\" } }"], more].concat());
    [root.join("bop"), root.join("bop/train_pbr")]
}

#[test]
fn masks_of_bop_have_what_the_table_hides() {
    let folder = tempfile::tempdir().expect("a folder");
    // From below the tabletop, whose edge hides the lower parts of the objects on it.
    let pose = |eye: &str| format!("{{ look_at = {{ eye_m = {eye}, target_m = [0.0, 0.0, 0.02] }} }}");
    let poses = [pose("[1.2, 0.0, -0.1]"), pose("[0.0, 1.2, -0.1]")].join(", ");
    let below = format!("views={{ kind=\"fixed_poses\", poses=[{poses}] }}");
    let [root, split] = bop(&folder.path().join("data"), &["annotate.masks.table_and_room=\"clip\"", &below]);
    assert_eq!(faults(&root), []);
    let mut whole = 0;
    let ours = json_of(&folder.path().join("data/annotation_final.json"));
    let clipped: u64 =
        ours["annotations"].as_array().expect("a list").iter().filter_map(|it| it["area"].as_u64()).sum();
    for scene in fs::read_dir(split).expect("there").map(|entry| entry.expect("readable").path()) {
        let infos = json_of(&scene.join("scene_gt_info.json"));
        for (view, objects) in infos.as_object().expect("an object") {
            for (number, info) in objects.as_array().expect("a list").iter().enumerate() {
                let name = format!("mask/{:06}_{number:06}.png", view.parse::<u32>().expect("a number"));
                let mask = image::open(scene.join(name)).expect("there").into_luma8();
                let area = mask.pixels().filter(|pixel| pixel.0[0] > 0).count() as u64;
                assert!(area >= info["px_count_visib"].as_u64().expect("a number"));
                whole += area;
            }
        }
    }
    assert!(whole > 2 * clipped, "the table hides pixels: {whole} in all, {clipped} without");
}

#[test]
fn models_and_their_numbers_are_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let [root, split] = bop(&path("data"), &[]);
    // Numbered as in other datasets: with gaps, and not in the order of names.
    let renumbered = |id: u64| 9_000 - 7 * id;
    let renumber = |value: &mut Value| {
        let id = value["obj_id"].as_u64().expect("a number");
        value["obj_id"] = json!(renumbered(id));
    };
    for scene in fs::read_dir(&split).expect("there").map(|entry| entry.expect("readable").path()) {
        let file = scene.join("scene_gt.json");
        let mut truth = json_of(&file);
        let images = truth.as_object_mut().expect("an object").values_mut();
        images.flat_map(|objects| objects.as_array_mut().expect("a list")).for_each(renumber);
        save(&file, &truth);
    }
    let keyed = |file: &Path| {
        let json = json_of(file);
        let entries = json.as_object().expect("an object").iter();
        let entries = entries.map(|(id, of)| (renumbered(id.parse().expect("a number")).to_string(), of.clone()));
        save(file, &Value::Object(entries.collect()));
    };
    keyed(&root.join("objects.json"));
    keyed(&root.join("models/models_info.json"));
    let files: Vec<PathBuf> =
        fs::read_dir(root.join("models")).expect("there").map(|it| it.expect("there").path()).collect();
    let plys: Vec<&PathBuf> = files.iter().filter(|file| file.extension().is_some_and(|it| it == "ply")).collect();
    for file in &plys {
        let id: u64 = file.file_stem().expect("a name").to_string_lossy()[4..].parse().expect("a number");
        fs::rename(file, root.join(format!("models/new_{:06}.ply", renumbered(id)))).expect("renamed");
    }
    for file in fs::read_dir(root.join("models")).expect("there").map(|it| it.expect("there").path()) {
        let name = file.file_name().expect("a name").to_string_lossy().replace("new_", "obj_");
        fs::rename(&file, file.with_file_name(name)).expect("renamed");
    }
    assert_eq!(faults(&root), []);
    ok(convert(&root, "bop", &path("again")).args(["--set", "bop.models=\"models\""]));
    let again = path("again/bop");
    assert_eq!(faults(&again), []);
    assert_eq!(json_of(&again.join("objects.json")), json_of(&root.join("objects.json")));
    let truth = |split: &Path| {
        let scenes = fs::read_dir(split).expect("there").map(|entry| entry.expect("readable").path());
        let mut all: Vec<(PathBuf, Value)> = scenes
            .map(|scene| (scene.strip_prefix(split).expect("inside").to_owned(), json_of(&scene.join("scene_gt.json"))))
            .collect();
        all.sort_by(|a, b| a.0.cmp(&b.0));
        all
    };
    let ids = |split: &Path| -> Vec<u64> {
        let scenes = truth(split);
        let images = scenes.iter().flat_map(|(_, scene)| scene.as_object().expect("an object").values());
        images.flat_map(|it| it.as_array().expect("a list")).filter_map(|it| it["obj_id"].as_u64()).collect()
    };
    assert_eq!(ids(&again.join("train_pbr")), ids(&split));
    // Every model exists and has the right size.
    let [before, after] = [&root, &again].map(|root| json_of(&root.join("models/models_info.json")));
    for (id, model) in before.as_object().expect("an object") {
        for (key, number) in model.as_object().expect("an object") {
            let [a, b] = [number, &after[id][key]].map(|it| it.as_f64().expect("a number"));
            assert!((a - b).abs() <= 1e-4 * a.abs().max(1.0), "{id} {key}: {a} {b}");
        }
    }
    assert_eq!(before.as_object().map(|it| it.len()), after.as_object().map(|it| it.len()));
    // Our layout keeps the numbers as well.
    ok(&mut convert(&root, "syntable", &path("ours")));
    ok(&mut convert(&path("ours"), "bop", &path("of ours")));
    assert_eq!(ids(&path("of ours/bop/train_pbr")), ids(&split));
    // A model that is larger than stated.
    let file = root.join("models/models_info.json");
    let mut infos = before.clone();
    let first = infos.as_object_mut().expect("an object").values_mut().next().expect("one");
    for key in ["min_x", "min_y", "min_z", "size_x", "size_y", "size_z", "diameter"] {
        first[key] = json!(first[key].as_f64().expect("a number") / 1.1);
    }
    save(&file, &infos);
    let found = faults(&root);
    assert!(
        found.iter().any(|(check, message)| check == "sizes_of_models" && message.contains(" mm in obj_")),
        "{found:?}"
    );
}

#[test]
fn scenes_that_lack_a_file_are_faults_and_the_others_are_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let [root, split] = bop(&folder.path().join("data"), &[]);
    let scene = |name: &str| split.join("000000").join(name);
    for (name, damage, says) in [
        ("scene_camera.json", None, "no scene_camera.json"),
        ("scene_gt_info.json", None, "no scene_gt_info.json"),
        ("scene_gt.json", None, "no scene_gt.json"),
        ("scene_camera.json", Some("{\"0\": {\"cam_K\": [1,"), "scene_camera.json:1"),
        ("scene_camera.json", Some("{\"0\": {\"cam_K\": [1, NaN"), "`0.cam_K[1]`: NaN is no number of JSON"),
        (
            "scene_gt.json",
            Some("{\"0\": [{\"obj_id\": 1, \"cam_R_m2c\": null}]}"),
            "`0[0].cam_R_m2c`: invalid type: null",
        ),
    ] {
        let content = fs::read(scene(name)).expect("there");
        match damage {
            None => fs::remove_file(scene(name)).expect("there"),
            Some(damage) => fs::write(scene(name), damage).expect("writable"),
        }
        let (_, dataset) = open_dataset(&root, None).expect("a dataset");
        let scenes: BTreeSet<u32> = dataset.images.iter().map(|image| image.scene.0).collect();
        assert_eq!(scenes, BTreeSet::from([1]), "{name}");
        let found = faults(&root);
        assert!(found.len() == 1 && found[0].1.contains(says), "{name}: {found:?}");
        fs::write(scene(name), content).expect("writable");
    }
    assert_eq!(faults(&root), []);
}

/// An unreadable mesh is omitted, but no image is.
#[test]
fn damaged_meshes_are_left_out_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let [root, split] = bop(&path("data"), &[]);
    let mut meshes: Vec<PathBuf> =
        fs::read_dir(root.join("models")).expect("there").map(|it| it.expect("there").path()).collect();
    meshes.retain(|path| path.extension().is_some_and(|it| it == "ply"));
    meshes.sort();
    fs::write(&meshes[0], "ply\nformat ascii 1.0\nelement vertex 9").expect("written");
    let name = meshes[0].file_name().expect("a name").to_string_lossy().into_owned();
    let images = |split: &Path| -> usize {
        let scenes = fs::read_dir(split).expect("there").map(|entry| entry.expect("readable").path());
        scenes.map(|scene| json_of(&scene.join("scene_gt.json")).as_object().expect("an object").len()).sum()
    };
    let output = convert(&root, "bop", &path("again")).args(["--set", "bop.models=\"models\""]).output().expect("runs");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.contains(&name) && said.contains("1 file left out"), "{said}");
    assert!(!said.contains("fault"), "what is left out is not carried over: {said}");
    let again = path("again/bop");
    assert_eq!(images(&again.join("train_pbr")), images(&split));
    let models = |root: &Path| json_of(&root.join("models/models_info.json")).as_object().expect("an object").len();
    assert_eq!(models(&again), models(&root) - 1);
    // Without `models`, the conversion does not read meshes.
    let output = convert(&root, "bop", &path("without")).output().expect("runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(faults(&root).iter().any(|(_, message)| message.contains(&name)), "{:?}", faults(&root));
}

/// Pixels of the visible and the amodal mask, the category, and the pose in the camera's frame of an object.
type Kept = (Vec<usize>, Option<Vec<usize>>, Option<u32>, Option<Vec<f64>>);

/// The visible objects of all images, by their masks, with the requested products that exist.
fn kept(root: &Path, wants: &[KeyId]) -> Vec<Vec<Kept>> {
    let (_, dataset) = open_dataset(root, None).unwrap_or_else(|error| panic!("{}: {error}", root.display()));
    let of = |image: usize| {
        let products =
            dataset.read(image, wants).unwrap_or_else(|error| panic!("{}: {error}", root.display())).products;
        let amodal = products.optional(AMODAL_MASK).expect("of its type");
        let categories = products.optional(CATEGORY_ID).expect("of its type");
        let infos = products.optional(OBJECT_INFO).expect("of its type");
        let pose = |id| {
            let info = serde_json::to_value(infos?.get(id)?).expect("JSON");
            let rows = info["camera_from_object"].as_array().expect("rows").iter();
            Some(rows.flat_map(|row| row.as_array().expect("a row")).filter_map(Value::as_f64).collect())
        };
        let seen = products.get(VISIBLE_MASK).expect("there").iter().filter(|(_, mask)| !mask.is_empty());
        let object = |(id, visible): (InstanceId, &Mask)| {
            let whole = amodal.map(|masks| masks.get(id).expect("there").pixels().collect());
            (visible.pixels().collect(), whole, categories.map(|all| *all.get(id).expect("there")), pose(id))
        };
        let mut objects: Vec<Kept> = seen.map(object).collect();
        objects.sort_by(|a, b| a.0.cmp(&b.0));
        objects
    };
    (0..dataset.images.len()).map(of).collect()
}

/// Formats keep masks to the pixel, categories, and poses in both directions.
#[test]
fn masks_categories_and_poses_come_back_as_they_were() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    small_dataset(&path("ours"), &[]);
    let all = syntable_model::keys![VISIBLE_MASK, AMODAL_MASK, CATEGORY_ID];
    for (kind, wants) in [
        ("coco", all.clone()),
        ("d2sa", all),
        ("coco_panoptic", syntable_model::keys![VISIBLE_MASK, CATEGORY_ID]),
        ("bop", syntable_model::keys![VISIBLE_MASK, AMODAL_MASK, OBJECT_INFO]),
    ] {
        let (there, back) = (path(kind), path(&format!("{kind} and back")));
        ok(&mut convert(&path("ours"), kind, &there));
        ok(&mut convert(&there, kind, &back));
        let before = kept(&path("ours"), &wants);
        assert!(before.iter().flatten().count() > 3, "{kind}: objects are seen");
        for after in [kept(&there, &wants), kept(&back, &wants)] {
            assert_eq!(after.len(), before.len(), "{kind}");
            for (before, after) in before.iter().flatten().zip(after.iter().flatten()) {
                assert!((&before.0, &before.1, before.2) == (&after.0, &after.1, after.2), "{kind}");
                let [a, b] = [before, after].map(|it| it.3.as_deref().unwrap_or_default());
                assert!(
                    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9),
                    "{kind}: {a:?} {b:?}"
                );
            }
            assert_eq!(before.iter().map(Vec::len).collect::<Vec<_>>(), after.iter().map(Vec::len).collect::<Vec<_>>());
        }
    }
}

/// Lines of all label files of a YOLO dataset, as numbers.
fn lines(yolo: &Path) -> Vec<Vec<f64>> {
    let labels = files(&yolo.join("labels"));
    let text: String = labels.values().map(|bytes| String::from_utf8_lossy(bytes).into_owned()).collect();
    text.lines().map(|line| line.split(' ').map(|word| word.parse().expect("a number")).collect()).collect()
}

#[test]
fn boxes_without_masks_keep_their_fractions() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    foreign_coco(&path("boxes"), &[&[7, 9]], &[(7, "mug"), (9, "cup")]);
    let boxes = [[1.5, 2.25, 30.75, 20.5], [50.0, 30.5, 4.0, 9.5]];
    spoil(&path("boxes"), |json| {
        for (place, bbox) in boxes.iter().enumerate() {
            json["annotations"][place]["bbox"] = json!(bbox);
            json["annotations"][place]["segmentation"] = json!([]);
        }
    });
    let annotations =
        |of: &str| json_of(&path(of).join("coco/annotations/instances_train.json"))["annotations"].clone();
    let stated = |of: &str| -> Vec<[f64; 4]> {
        let all = annotations(of);
        all.as_array()
            .expect("a list")
            .iter()
            .map(|it| serde_json::from_value(it["bbox"].clone()).expect("a box"))
            .collect()
    };
    ok(&mut convert(&path("boxes"), "coco", &path("coco")));
    assert_eq!(stated("coco"), boxes);
    assert_eq!(annotations("coco")[0]["segmentation"], json!([]));
    // Detection is YOLO's task for boxes, and its numbers are fractions of the image.
    ok(&mut convert(&path("boxes"), "yolo", &path("yolo")));
    for ([class, x, y, width, height], (number, bbox)) in lines(&path("yolo/yolo"))
        .iter()
        .map(|line| <[f64; 5]>::try_from(&line[..]).expect("a box"))
        .zip((0..).zip(&boxes))
    {
        let found = [class, x * 60.0, y * 40.0, width * 60.0, height * 40.0];
        let want = [f64::from(number), bbox[0] + bbox[2] / 2.0, bbox[1] + bbox[3] / 2.0, bbox[2], bbox[3]];
        assert!(found.iter().zip(&want).all(|(found, want)| (found - want).abs() < 1e-4), "{found:?} {want:?}");
    }
    ok(&mut convert(&path("yolo"), "coco", &path("back")));
    assert!(stated("back").as_flattened().iter().zip(boxes.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-4));
    // A box beside masks stays an object; formats of masks alone leave it out.
    foreign_coco(&path("mixed"), &[&[7, 9]], &[(7, "mug"), (9, "cup")]);
    spoil(&path("mixed"), |json| json["annotations"][1]["segmentation"] = json!([]));
    made(&mut convert(&path("mixed"), "coco", &path("mixed coco")));
    assert_eq!(stated("mixed coco"), [[2.0, 5.0, 10.0, 10.0], [14.0, 5.0, 10.0, 10.0]]);
    let said = fails(&mut convert(&path("mixed"), "yolo", &path("mixed yolo")), 3);
    assert!(said.contains("1 of 2 objects are left out") && lines(&path("mixed yolo/yolo")).len() == 1, "{said}");
}

/// A run's own labels for detection are the boxes of its masks.
#[test]
fn labels_for_detection_are_boxes_of_masks() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data");
    small_dataset(&data, &["dataset.scenes=1", "write={ syntable = {}, yolo = { task = \"detect\" } }"]);
    let dataset = open_dataset(&data, None).expect("a dataset").1;
    let mut want = Vec::new();
    for image in 0..dataset.images.len() {
        let products = dataset.read(image, &[VISIBLE_MASK.id()]).expect("readable").products;
        for (_, mask) in products.get(VISIBLE_MASK).expect("there").iter().filter(|(_, mask)| !mask.is_empty()) {
            let at = |axis: usize| mask.pixels().map(move |pixel| [pixel % 160, pixel / 160][axis]);
            let ends =
                |axis: usize| [at(axis).min().expect("pixels") as f64, at(axis).max().expect("pixels") as f64 + 1.0];
            let ([left, right], [top, bottom]) = (ends(0), ends(1));
            want.push([(left + right) / 320.0, (top + bottom) / 240.0, (right - left) / 160.0, (bottom - top) / 120.0]);
        }
    }
    // Boxes of amodal masks come back as such.
    let amodal = folder.path().join("amodal");
    ok(convert(&data, "yolo", &amodal).args(["--set", "yolo.task=\"detect\"", "--set", "yolo.masks=\"amodal\""]));
    let offers = &open_dataset(&amodal.join("yolo"), None).expect("a dataset").1.offers;
    assert!(offers.contains(&AMODAL_BOX.id()) && !offers.contains(&VISIBLE_BOX.id()), "{offers:?}");
    let found = lines(&data.join("yolo"));
    assert!(!found.is_empty() && found.len() == want.len(), "{} {}", found.len(), want.len());
    for (line, want) in found.iter().zip(&want) {
        assert!(line[1..].iter().zip(want).all(|(found, want)| (found - want).abs() < 1e-6), "{line:?} {want:?}");
    }
}

#[test]
fn a_run_of_several_formats_is_one_dataset() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data");
    small_dataset(&data, &["dataset.scenes=1", "write={ coco = {}, yolo = {}, npz = { include = [\"rgb\"] } }"]);
    // COCO's files have amodal masks, which YOLO's lack.
    assert!(ok(syntable().arg("stats").arg(&data)).contains("read as coco"));
    // A damaged layout stays selected, so that its fault is not hidden.
    let file = data.join("coco/annotations/instances_train.json");
    let whole = fs::read(&file).expect("there");
    fs::write(&file, &whole[..whole.len() / 2]).expect("writable");
    let output = syntable().arg("validate").arg(&data).output().expect("starts");
    let said = text(&output);
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.contains("read as coco") && said.contains("instances_train.json"), "{said}");
    fs::write(&file, &whole).expect("writable");
    // A layout behind a link is not the dataset's own.
    #[cfg(unix)]
    {
        fs::rename(data.join("coco"), folder.path().join("elsewhere")).expect("movable");
        std::os::unix::fs::symlink("../elsewhere", data.join("coco")).expect("a link");
        let said = fails(syntable().arg("stats").arg(&data), 2);
        assert!(said.contains("--trust-paths"), "{said}");
        fs::remove_file(data.join("coco")).expect("removable");
        fs::rename(folder.path().join("elsewhere"), data.join("coco")).expect("movable");
    }
    // Another program's folder of two datasets has no such order.
    fs::remove_dir_all(data.join(".syntable")).expect("removable");
    assert!(fails(syntable().arg("stats").arg(&data), 2).contains("it contains 2 datasets"));
}

#[test]
fn an_unfinished_dataset_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data");
    small_dataset(&data, &["dataset.scenes=1", "write={ coco = {} }"]);
    fs::remove_dir_all(data.join("coco/annotations")).expect("removable");
    let said = fails(syntable().arg("validate").arg(&data), 2);
    assert!(said.contains("no annotation files") && said.contains("finish the run"), "{said}");
}

/// Faults of labels name the annotation where a file states no instance id.
#[test]
fn faults_of_foreign_labels_name_annotations() {
    let folder = tempfile::tempdir().expect("a folder");
    foreign_coco(folder.path(), &[&[1, 1]], &[(1, "cup")]);
    spoil(folder.path(), |json| {
        json["annotations"][0]["id"] = json!(108);
        json["annotations"][0]["visible_mask"] = json!([[0, 5, 12, 5, 12, 15, 0, 15]]);
    });
    let found = faults(folder.path());
    let outside = found.iter().find(|(check, _)| check == "visible_within_amodal").expect("a fault");
    assert_eq!(outside.1, "annotation 108: 20 of its visible pixels are not in its amodal mask");
}
