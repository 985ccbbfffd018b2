//! Results of the readers: files of this program's writers return the written values, files of other programs match
//! NumPy, Pillow and pycocotools, and each fault of a broken file is reported with its place.

use serde_json::{Value as Json, json};
use std::fs;
use std::path::{Path, PathBuf};
use syntable_interchange as _;
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    AMODAL_MASK, BOX, CAMERA, CATEGORY_ID, DEPTH, DEPTH_SENSED, OCCLUSION_MASK, RGB, VISIBLE_MASK,
};
use syntable_model::reader::{self, OpenDataset, Source};
use syntable_testing::read_back::{JPEG, assert_jpeg_images};
use syntable_testing::takes::{Take, dataset, finish, open_dataset, registry, takes, write_scenes, writer};
use syntable_testing::tools::{own_script, python};

fn classes() -> DatasetInfo {
    DatasetInfo { classes: vec!["bowl".into(), "mug".into()], program: "syntable 0.1.0".into(), ..dataset(3, 3) }
}

/// Writes a dataset with a writer, into its folder.
fn written(root: &Path, kind: &str, options: &str) -> Vec<Take> {
    let (writer, takes) = (writer(kind, options).expect("good options"), takes());
    write_scenes(root, "data", &*writer, &classes(), &takes).expect("written");
    finish(root, "data", &*writer, &classes(), &[0, 1, 2]).expect("finished");
    takes
}

fn open(root: &Path) -> OpenDataset {
    open_dataset(root, None).unwrap_or_else(|error| panic!("{error}")).1
}

/// Pixels of the visible and the amodal mask of an object, and its category.
type ExpectedObject = (Vec<usize>, Vec<usize>, u32);

fn pixels(mask: &Mask) -> Vec<usize> {
    mask.pixels().collect()
}

/// The objects of an image by their masks, sorted.
fn objects(products: &Products, with_amodal: bool, with_category: bool) -> Vec<ExpectedObject> {
    let visible = products.get(VISIBLE_MASK).expect("there");
    let of = |(id, visible): (InstanceId, &Mask)| {
        let amodal = with_amodal.then(|| pixels(&products.get(AMODAL_MASK).expect("there").0[&id]));
        let category = with_category.then(|| products.get(CATEGORY_ID).expect("there").0[&id]);
        (pixels(visible), amodal.unwrap_or_default(), category.unwrap_or_default())
    };
    let mut objects: Vec<ExpectedObject> = visible.iter().map(of).collect();
    objects.sort();
    objects
}

/// Mean difference of the samples of two images.
fn mean_difference(one: &Plane<[u8; 3]>, other: &Plane<[u8; 3]>) -> f64 {
    assert_eq!([one.width(), one.height()], [other.width(), other.height()]);
    let pairs = one.data().as_flattened().iter().zip(other.data().as_flattened());
    pairs.map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / one.data().as_flattened().len() as f64
}

#[test]
fn what_is_written_is_read() {
    for (kind, options) in [
        ("coco", ""),
        ("coco", "masks = \"visible\""),
        ("d2sa", ""),
        ("kins", "version = \"2019\""),
        ("kins", "version = \"2020\""),
        ("cocoa", ""),
        ("osd_amodal", ""),
        ("yolo", ""),
        ("uoais", ""),
        ("coco_panoptic", ""),
        ("insta_order", ""),
        ("tod", ""),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let takes = written(folder.path(), kind, options);
        let read = open(&folder.path().join("data"));
        assert!(read.all_faults().is_empty(), "{kind} {options}: {:?}", read.all_faults());
        // Omissions of the formats.
        let has_amodal = !["coco_panoptic", "tod", "yolo"].contains(&kind);
        let has_category = !["osd_amodal", "tod", "uoais"].contains(&kind);
        let needs_seen = ["coco_panoptic", "insta_order", "kins", "osd_amodal", "tod", "yolo"].contains(&kind)
            || options.contains("visible");
        let mut images = 0;
        for take in &takes {
            for (view, products) in &take.views {
                let mut want = objects(products, has_amodal, has_category);
                want.retain(|(visible, ..)| !needs_seen || !visible.is_empty());
                let is_it = |image: &&reader::ImageRef| (image.scene, image.view) == (take.scene.id, view.id);
                let Some(image) = read.images.iter().find(is_it) else {
                    assert!(
                        want.is_empty() && ["cocoa", "osd_amodal", "uoais"].contains(&kind),
                        "{kind}: an image is missing"
                    );
                    continue;
                };
                images += 1;
                let number = read.images.iter().position(|other| other == image).expect("there");
                let read_image = read.read(number, &read.offers);
                let found = read_image.unwrap_or_else(|error| panic!("{kind}: {error}")).products;
                assert_eq!(read.images[number].view, view.id);
                assert!(objects(&found, has_amodal, has_category) == want, "{kind} {options}: {}", image.name);
                let [rgb, own] = [&found, products].map(|it| it.get(RGB).expect("there"));
                // JPEG changes pixels a little.
                assert!(mean_difference(rgb, own) <= if kind == "tod" { 8.0 } else { 0.0 }, "{kind}: {}", image.name);
                if ["osd_amodal", "tod", "uoais"].contains(&kind) {
                    let millimeters =
                        |plane: &Plane<f32>| plane.map(|depth| (f64::from(*depth) * 1000.0).round() as u32);
                    let [found, want] = [&found, products].map(|it| millimeters(it.get(DEPTH).expect("there")));
                    assert!(found == want, "depth of {}", image.name);
                }
                assert_eq!(read.image_faults(number), [], "{kind} {options}: {}", image.name);
            }
        }
        assert!(images > 5 && images == read.images.len(), "{kind}: {images}");
    }
}

/// The option `depth` selects the measurements of a depth camera, in which 0 means no measurement.
#[test]
fn sensed_depth_is_written() {
    for (kind, options, step_mm) in [
        ("bop", "depth_scale = 0.5", 0.5),
        ("bop", "layout = \"webdataset\"", 0.1),
        ("osd_amodal", "", 1.0),
        ("uoais", "", 1.0),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let takes = written(folder.path(), kind, &format!("{options}\ndepth = \"sensed\""));
        let read = open(&folder.path().join("data"));
        for (number, image) in read.images.iter().enumerate() {
            let take = takes.iter().find(|take| take.scene.id == image.scene).expect("a scene");
            let (_, products) = take.views.iter().find(|(view, _)| view.id == image.view).expect("a view");
            let found = read.read(number, &[DEPTH.id()]).unwrap_or_else(|error| panic!("{kind}: {error}")).products;
            let steps = |depth: &f32| {
                if depth.is_finite() { (f64::from(*depth) * 1000.0 / step_mm).round().min(65535.0) } else { 0.0 }
            };
            let found = found.get(DEPTH).expect("there").map(steps);
            assert!(found == products.get(DEPTH_SENSED).expect("there").map(steps), "{kind} {options}: {}", image.name);
        }
        assert!(read.images.len() > 5, "{kind} {options}");
    }
}

/// Readers find color images in either format. All other images are PNG files.
#[test]
fn jpeg_images_are_read() {
    for (kind, options) in [
        ("coco", ""),
        ("d2sa", ""),
        ("kins", ""),
        ("cocoa", ""),
        ("yolo", ""),
        ("uoais", ""),
        ("coco_panoptic", ""),
        ("insta_order", ""),
        ("bop", "layout = \"scenewise\""),
        ("bop", "layout = \"webdataset\""),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let takes = written(folder.path(), kind, &format!("{options}\n{JPEG}"));
        let read = open(&folder.path().join("data"));
        assert!(read.all_faults().is_empty(), "{kind} {options}: {:?}", read.all_faults());
        assert_jpeg_images(&read, &takes);
        assert!(read.images.len() > 5, "{kind} {options}");
    }
}

/// Readers follow no link out of the dataset, and do not wait for named pipes.
#[cfg(unix)]
#[test]
fn links_lead_nowhere_else() {
    for (kind, options) in [
        ("coco", ""),
        ("d2sa", ""),
        ("kins", "version = \"2020\""),
        ("cocoa", ""),
        ("osd_amodal", ""),
        ("tod", ""),
        ("yolo", ""),
        ("coco_panoptic", ""),
        ("bop", "layout = \"scenewise\""),
        ("bop", "layout = \"webdataset\""),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), kind, options);
        let data = folder.path().join("data");
        syntable_testing::hostile::pipes_are_not_waited_for(&data, kind);
        syntable_testing::hostile::links_lead_nowhere_else(&data, kind);
    }
}

/// File names in annotation files do not lead out of the dataset.
#[test]
fn names_lead_nowhere_else() {
    for (kind, options, list, name) in [
        ("coco", "", "images", "file_name"),
        ("d2sa", "", "images", "file_name"),
        ("kins", "version = \"2019\"", "images", "file_name"),
        ("cocoa", "", "images", "file_name"),
        ("coco_panoptic", "", "images", "file_name"),
        ("coco_panoptic", "", "annotations", "file_name"),
        ("uoais", "", "images", "depth_file_name"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), kind, options);
        let data = folder.path().join("data");
        let file = annotation_file(&data);
        let of = if kind == "uoais" { "coco" } else { kind };
        let mut json: Json = serde_json::from_slice(&fs::read(&file).expect("there")).expect("JSON");
        let own = json[list][0][name].as_str().expect("a name").to_owned();
        let mut files = syntable_testing::folder::files(&data).into_iter();
        let is_it = |inside: &str| inside.ends_with(&format!("/{own}")) || inside == own;
        // The image of a file's first annotation and the image of its segments have the same name.
        let is_of = |inside: &str| is_it(inside) && inside.starts_with("annotations") == (list == "annotations");
        let (inside, bytes) = files.find(|(inside, _)| is_of(inside)).expect("the file");
        // The file outside is a readable image.
        fs::write(folder.path().join("canary.png"), bytes).expect("writable");
        let depth = inside.trim_end_matches(own.as_str()).matches('/').count() + 1;
        let climbs = format!("{}canary.png", "../".repeat(depth));
        let absolute = folder.path().join("canary.png").to_str().expect("UTF-8").to_owned();
        for bad in
            [climbs.clone(), format!("a/../{climbs}"), format!("./{climbs}"), absolute.clone(), "a\0b".to_owned()]
        {
            for it in json[list].as_array_mut().expect("a list") {
                it[name] = bad.clone().into();
            }
            fs::write(&file, json.to_string()).expect("writable");
            let source = reader::Source::new(&data);
            let all = |source: &reader::Source| {
                let (_, read) =
                    registry().open_dataset(source, Some(of)).unwrap_or_else(|error| panic!("{kind}: {error}"));
                (0..read.images.len()).map(|image| read.read(image, &read.offers).err()).collect::<Vec<_>>()
            };
            for error in all(&source) {
                let error = error.unwrap_or_else(|| panic!("{kind}: {bad:?} was read")).to_string();
                assert!(error.contains("options.trust_paths"), "{kind}: {bad:?}: {error}");
            }
            let trusted = all(&source.trusting(true));
            let is_there = [&climbs, &format!("./{climbs}"), &absolute].contains(&&bad);
            assert_eq!(trusted.iter().all(Option::is_none), is_there, "{kind}: {bad:?}: {trusted:?}");
        }
    }
}

/// The only annotation file of a dataset.
fn annotation_file(data: &Path) -> PathBuf {
    let folder = if data.join("annotations").is_dir() { data.join("annotations") } else { data.to_owned() };
    let files = fs::read_dir(folder).expect("there").map(|entry| entry.expect("readable").path());
    let mut files: Vec<PathBuf> = files.filter(|path| path.extension().is_some_and(|it| it == "json")).collect();
    assert_eq!(files.len(), 1, "{files:?}");
    files.remove(0)
}

/// Visible and amodal mask of an object as rows of pixels, and the name of its category.
type True = (Vec<Vec<u8>>, Vec<Vec<u8>>, String);

#[test]
fn files_of_others_are_read() {
    for (kind, at) in [
        ("kins", "data"),
        ("d2sa", "data"),
        ("cocoa", "data"),
        ("ocid", "data"),
        ("osd_amodal", "data"),
        ("tod", "data"),
        ("yolo", "data/images/train"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        if !python(&own_script("foreign.py"), &[kind, folder.path().to_str().expect("UTF-8")]) {
            return;
        }
        let (format, read) =
            open_dataset(&folder.path().join(at), None).unwrap_or_else(|error| panic!("{kind}: {error}"));
        assert_eq!((format.name(), read.all_faults()), (kind, &[][..]));
        let truth: Vec<Vec<True>> =
            serde_json::from_slice(&fs::read(folder.path().join("truth.json")).expect("there")).expect("JSON");
        assert_eq!(read.images.len(), truth.len(), "{kind}");
        let name_of = |id: u32| {
            let (_, name) = read.info.categories().find(|(other, _)| *other == id).expect("a category");
            name.to_owned()
        };
        for (number, truth) in truth.iter().enumerate() {
            let products = read.read(number, &read.offers).unwrap_or_else(|error| panic!("{kind}: {error}")).products;
            let set = |rows: &Vec<Vec<u8>>| -> Vec<usize> {
                let (width, height) = (rows[0].len(), rows.len());
                pixels(&Mask::from_fn(width as u32, height as u32, |x, y| rows[y as usize][x as usize] > 0))
            };
            let has_amodal = !["ocid", "tod", "yolo"].contains(&kind);
            let amodal = |rows| if has_amodal { set(rows) } else { Vec::new() };
            let mut want: Vec<_> = truth.iter().map(|(v, a, name)| (set(v), amodal(a), name.clone())).collect();
            want.sort();
            let mut found: Vec<_> = objects(&products, has_amodal, true)
                .into_iter()
                .map(|(visible, amodal, category)| (visible, amodal, name_of(category)))
                .collect();
            if ["ocid", "osd_amodal", "tod"].contains(&kind) {
                // The format has no categories.
                want.iter_mut().for_each(|object| object.2 = "object".to_owned());
            }
            found.sort();
            assert!(
                found == want,
                "{kind}: image {number}: {:?}",
                found.iter().map(|it| it.0.len()).collect::<Vec<_>>()
            );
            // BEYOND is a polygon that extends beyond the image.
            let mut faults = read.image_faults(number);
            faults.retain(|it| it.rule != "coordinates_are_within_the_image");
            assert_eq!(faults, [], "{kind}");
        }
    }
}

/// All reports about a dataset: the error that keeps it from opening, its faults, and errors of unreadable images.
fn said(root: &Path, kind: &str) -> Vec<String> {
    let read = match open_dataset(root, Some(kind)) {
        Ok((_, read)) => read,
        Err(error) => {
            assert!(error.is_permanent(), "{kind}: not the fault of the request: {error}");
            return vec![error.to_string()];
        }
    };
    let mut said: Vec<String> = read.all_faults().iter().map(|it| format!("{}: {it}", it.rule)).collect();
    for number in 0..read.images.len() {
        said.extend(read.image_faults(number).iter().map(|it| format!("{}: {it}", it.rule)));
        if let Err(error) = read.read(number, &read.offers) {
            // A retry would not help.
            assert!(error.is_permanent(), "{kind}: {error}");
            said.push(error.to_string());
        }
    }
    said
}

/// The first file below a folder whose path ends with `end`.
fn file(root: &Path, end: &str) -> PathBuf {
    let files = syntable_testing::folder::files(root);
    root.join(files.keys().find(|path| path.ends_with(end)).unwrap_or_else(|| panic!("a file {end}")))
}

/// Changes the content of a JSON file.
fn spoil(path: &Path, change: &dyn Fn(&mut Json)) {
    let mut json: Json = serde_json::from_slice(&fs::read(path).expect("there")).expect("JSON");
    change(&mut json);
    fs::write(path, json.to_string()).expect("writable");
}

/// The annotation with the largest number; annotations without a number rank last.
fn with_most(file: &mut Json, number: impl Fn(&Json) -> Option<u64>) -> &mut Json {
    let annotations = file["annotations"].as_array_mut().expect("a list");
    annotations.iter_mut().max_by_key(|it| number(it)).expect("one")
}

type Plant = (&'static str, &'static str, &'static str, &'static dyn Fn(&mut Json));

const PLANTED: &[Plant] = &[
    ("d2sa", "", "two annotations have this id", &|it| it["annotations"][1]["id"] = json!(1)),
    ("d2sa", "", "two images have this id", &|it| it["images"][1]["id"] = it["images"][0]["id"].clone()),
    ("d2sa", "", "unknown image 999", &|it| it["annotations"][0]["image_id"] = json!(999)),
    ("d2sa", "", "unknown category 77", &|it| it["annotations"][0]["category_id"] = json!(77)),
    ("d2sa", "", "`area` is 1", &|it| it["annotations"][0]["area"] = json!(1)),
    ("d2sa", "", "`bbox` is", &|it| it["annotations"][0]["bbox"] = json!([0, 0, 1, 1])),
    ("d2sa", "", "annotation 1: `occlude_rate`: ", &|it| it["annotations"][0]["occlude_rate"] = json!("x")),
    ("d2sa", "", "annotation 1: `visible_mask`: ", &|it| it["annotations"][0]["visible_mask"]["counts"] = json!("~~")),
    ("d2sa", "", "`annotations[0].segmentation", &|it| it["annotations"][0]["segmentation"] = json!(3)),
    ("d2sa", "", "missing field `images`", &|it| drop(it.as_object_mut().expect("an object").remove("images"))),
    ("d2sa", "", "missing field `categories`", &|it| drop(it.as_object_mut().expect("an object").remove("categories"))),
    ("kins", "", "annotation 1: `a_segm`: ", &|it| it["annotations"][0]["a_segm"] = json!([[1.0, 2.0, 3.0]])),
    ("kins", "", "annotation 1: `a_segm`: it is missing", &|it| it["annotations"][0]["a_segm"] = json!(null)),
    ("kins", "", "`a_area` is 9000", &|it| it["annotations"][0]["a_area"] = json!(9000)),
    ("kins", "", "`i_bbox` is", &|it| it["annotations"][0]["i_bbox"] = json!([0, 0, 1, 1])),
    ("kins", "", "`\"1\"` is no flag: write 0 or 1", &|it| it["annotations"][0]["iscrowd"] = json!("1")),
    ("kins", "version = \"2019\"", "`inmodal_seg`: it is missing", &|it| {
        it["annotations"][0]["inmodal_seg"] = json!(null)
    }),
    ("kins", "version = \"2019\"", "`inmodal_bbox` is", &|it| {
        it["annotations"][0]["inmodal_bbox"] = json!([0, 0, 1, 1])
    }),
    ("coco", "", "`bbox` is", &|it| {
        let width = it["annotations"][0]["bbox"][2].as_f64().expect("a number");
        it["annotations"][0]["bbox"][2] = json!(width - 1.0);
    }),
    ("coco", "", "`segmentation` differs from `amodal_mask`", &|it| {
        it["annotations"][0]["segmentation"] = json!([[0, 0, 64, 0, 64, 48, 0, 48]]);
    }),
    ("coco", "", "outside of the image", &|it| {
        it["annotations"][0]["segmentation"] = json!([[100, 100, 120, 100, 120, 120]]);
    }),
    ("coco", "", "encloses no area", &|it| {
        it["annotations"][0]["segmentation"] = json!([[10, 10, 10, 10, 10, 10]]);
    }),
    ("coco", "", "its polygons reach from [10.0, 10.0] to [30.0, 20.0]", &|it| {
        it["annotations"][0]["segmentation"] = json!([[10, 10, 30, 10, 30, 20, 10, 20]]);
        it["annotations"][0]["bbox"] = json!([10, 10, 22, 10]);
    }),
    ("coco", "", "its polygons enclose 200.0 px²", &|it| {
        it["annotations"][0]["segmentation"] = json!([[10, 10, 30, 10, 30, 20, 10, 20]]);
        it["annotations"][0]["area"] = json!(300);
    }),
    ("coco", "", "has this name, too", &|it| {
        it["categories"][1]["name"] = it["categories"][0]["name"].clone();
    }),
    ("coco", "", "is of this file, too", &|it| {
        it["images"][1]["file_name"] = it["images"][0]["file_name"].clone();
    }),
    ("d2sa", "", "`amodal_region.area` is 1", &|it| it["annotations"][0]["amodal_region"]["area"] = json!(1)),
    ("d2sa", "", "`amodal_region.bbox` is", &|it| {
        it["annotations"][0]["amodal_region"]["bbox"] = json!([0, 0, 1, 1]);
    }),
    ("d2sa", "", "`amodal_region.name` is \"bowls\", its category ", &|it| {
        it["annotations"][0]["amodal_region"]["name"] = json!("bowls");
    }),
    ("d2sa", "", "`invisible_mask` is missing, and ", &|it| {
        with_most(it, |it| it["occl_depth"].as_u64())["invisible_mask"] = json!(null);
    }),
    ("cocoa", "", "`depth_constraint` has no pair 1-", &|it| it["annotations"][0]["depth_constraint"] = json!("")),
    ("d2sa", "", "`occl_depth` is 99", &|it| it["annotations"][0]["occl_depth"] = json!(99)),
    ("d2sa", "", "like annotation 1", &|it| {
        it["annotations"][1]["amodal_region"]["order"] = it["annotations"][0]["amodal_region"]["order"].clone();
    }),
    ("d2sa", "", "of its pixels, ", &|it| {
        // The order from back to front.
        let image = with_most(it, |it| it["occl_depth"].as_u64())["image_id"].clone();
        let annotations = it["annotations"].as_array_mut().expect("a list").iter_mut();
        let of_image: Vec<_> = annotations.filter(|it| it["image_id"] == image).collect();
        let count = of_image.len();
        of_image.into_iter().enumerate().for_each(|(at, it)| it["amodal_region"]["order"] = json!(count - at));
    }),
    ("d2sa", "", "the longest chain of occluders has 0", &|it| {
        with_most(it, |it| (it["occlude_rate"] == 0.0).then_some(1))["occl_depth"] = json!(1);
    }),
    ("d2sa", "", "`occl_depth` is 0, the longest chain", &|it| {
        // All objects, since some are behind a cycle, which makes the depth ambiguous.
        it["annotations"].as_array_mut().expect("a list").iter_mut().for_each(|it| it["occl_depth"] = json!(0));
    }),
    ("kins", "", "`ico_id` is 99, and ", &|it| with_most(it, |it| it["ico_id"].as_u64())["ico_id"] = json!(99)),
    ("kins", "", "which is in front of it: the front has the lower number", &|it| {
        with_most(it, |it| it["ico_id"].as_u64())["ico_id"] = json!(1)
    }),
    ("kins", "", "objects that overlap have one group", &|it| {
        with_most(it, |it| it["ico_id"].as_u64())["oco_id"] = json!(77)
    }),
    ("kins", "", "`i_area` is 1, ", &|it| {
        // A fully visible object, so that the difference of its areas carries no information.
        let whole = |it: &Json| it["a_area"].as_u64().filter(|_| it["a_area"] == it["i_area"]);
        let whole = with_most(it, whole);
        [whole["a_area"], whole["i_area"]] = [json!(1), json!(1)];
    }),
    ("kins", "", "`a_area` less `i_area`", &|it| it["annotations"][0]["a_area"] = json!(1)),
    ("kins", "", "`a_area` less `i_area`", &|it| it["annotations"][0]["i_area"] = json!(1)),
    ("kins", "version = \"2019\"", "hidden part of `area`", &|it| it["annotations"][0]["area"] = json!(1)),
    ("cocoa", "", "`size` is 99", &|it| it["annotations"][0]["size"] = json!(99)),
    ("cocoa", "", "`depth_constraint` has `99`", &|it| it["annotations"][0]["depth_constraint"] = json!("1-99")),
    ("cocoa", "", "`depth_constraint` has ``", &|it| it["annotations"][0]["depth_constraint"] = json!("1")),
    ("cocoa", "", "order_matches_masks", &|it| {
        let pair = it["annotations"][0]["depth_constraint"]
            .as_str()
            .expect("text")
            .split(',')
            .next()
            .expect("a pair")
            .to_owned();
        let (front, back) = pair.split_once('-').expect("a pair");
        it["annotations"][0]["depth_constraint"] = json!(format!("{back}-{front}"));
    }),
    ("cocoa", "", "`regions[0].order` is 5", &|it| it["annotations"][0]["regions"][0]["order"] = json!(5)),
    ("cocoa", "", "`regions[0].area` is 1", &|it| it["annotations"][0]["regions"][0]["area"] = json!(1)),
    ("cocoa", "", "occlude_rate` is 0.99", &|it| it["annotations"][0]["regions"][0]["occlude_rate"] = json!(0.99)),
    ("cocoa", "", "occlude_rate` is 0.01", &|it| {
        let regions = it["annotations"].as_array_mut().expect("a list").iter_mut();
        let regions = regions.flat_map(|it| it["regions"].as_array_mut().expect("a list"));
        let rate = |it: &Json| it["occlude_rate"].as_f64().expect("a rate");
        let region = regions.max_by(|a, b| rate(a).total_cmp(&rate(b))).expect("one");
        region["occlude_rate"] = json!(0.01);
    }),
    ("cocoa", "", "`regions[0].segmentation`: ", &|it| {
        it["annotations"][0]["regions"][0]["segmentation"] = json!([1.0])
    }),
    ("cocoa", "", "`annotations[0].regions[1].segmentation", &|it| {
        it["annotations"][0]["regions"][1]["segmentation"] = json!("x");
    }),
    ("cocoa", "", "pixels are visible, too", &|it| {
        let regions = it["annotations"][0]["regions"].as_array_mut().expect("a list");
        let region = regions.iter_mut().find(|region| region["visible_mask"].is_object()).expect("an occluded one");
        region["invisible_mask"] = region["visible_mask"].clone();
    }),
];

/// Changes a file.
type Change = dyn Fn(&mut Json);

/// The end of the path of a file of a BOP dataset, the report, and the planted fault.
const PLANTED_BOP: &[(&str, &str, &Change)] = &[
    ("000000/scene_gt_info.json", "`px_count_all` is 1,", &|it| seen(it)["px_count_all"] = json!(1)),
    ("000000/scene_gt_info.json", "`px_count_all` is 90000,", &|it| seen(it)["px_count_all"] = json!(90_000)),
    ("000000/scene_gt_info.json", "`px_count_valid` is 0,", &|it| seen(it)["px_count_valid"] = json!(0)),
    ("000000/scene_gt_info.json", "`visib_fract` is 0.123,", &|it| seen(it)["visib_fract"] = json!(0.123)),
    ("000000/scene_gt_info.json", "`bbox_obj` is [0, 0, 1, 1]", &|it| seen(it)["bbox_obj"] = json!([0, 0, 1, 1])),
    ("000000/scene_gt_info.json", "`bbox_visib` is", &|it| {
        let width = seen(it)["bbox_visib"][2].as_i64().expect("a number");
        seen(it)["bbox_visib"][2] = json!(width + 1);
    }),
    ("000000/scene_gt.json", "`obj_id` is 0, and numbers of objects are from 1", &|it| {
        it["0"][0]["obj_id"] = json!(0);
    }),
    ("000000/scene_gt_coco.json", "has the `bbox` [0.0, 0.0, 1.0, 1.0]", &|it| {
        it["annotations"][0]["bbox"] = json!([0, 0, 1, 1]);
    }),
    ("000000/scene_gt_coco.json", "has the `area` 1.5", &|it| {
        it["annotations"][0]["area"] = json!(1.5);
    }),
    ("000000/scene_gt_coco.json", "the image has [1, 48] pixels", &|it| it["images"][0]["width"] = json!(1)),
    ("000000/scene_gt_coco.json", "readable: ", &|it| *it = json!(3)),
    ("000000/scene_camera.json", "rotated by 0.0° and moved by 0.250 m", &|it| {
        let shift = it["0"]["cam_t_w2c"][2].as_f64().expect("a number");
        it["0"]["cam_t_w2c"][2] = json!(shift + 250.0);
    }),
    ("000000/scene_camera.json", "rotated by 180.0°", &|it| {
        // A rotation about the camera's y axis.
        for at in [0, 1, 2, 6, 7, 8] {
            let entry = it["0"]["cam_R_w2c"][at].as_f64().expect("a number");
            it["0"]["cam_R_w2c"][at] = json!(-entry);
        }
    }),
    ("camera.json", "its images have [1, 48] pixels", &|it| it["width"] = json!(1)),
    ("camera.json", "`fx` is 0", &|it| it["fx"] = json!(0.0)),
];

/// The entry of the first visible object in any view.
fn seen(infos: &mut Json) -> &mut Json {
    let views = infos.as_object_mut().expect("views").values_mut();
    let entries = views.flat_map(|view| view.as_array_mut().expect("objects"));
    entries.into_iter().find(|it| it["px_count_visib"].as_u64() > Some(20)).expect("one is seen")
}

#[test]
fn planted_faults_of_bop_are_found() {
    for (end, says, plant) in PLANTED_BOP {
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), "bop", "");
        let root = folder.path().join("data");
        assert_eq!(said(&root, "bop"), Vec::<String>::new());
        spoil(&file(&root, end), *plant);
        let said = said(&root, "bop");
        assert!(said.iter().any(|it| it.contains(says)), "{end}: {says}: {said:?}");
    }
}

#[test]
fn segments_of_no_number_are_no_objects() {
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "coco_panoptic", "");
    let root = folder.path().join("data");
    let count = |read: &OpenDataset| {
        read.read(0, &[VISIBLE_MASK.id()]).expect("readable").products.get(VISIBLE_MASK).expect("there").iter().count()
    };
    let before = count(&open(&root));
    spoil(&file(&root, "annotations/panoptic_train.json"), &|it| {
        it["annotations"][0]["segments_info"][0]["id"] = json!(0);
    });
    assert_eq!(count(&open(&root)), before - 1);
    let said = said(&root, "coco_panoptic");
    assert!(said.iter().any(|it| it.contains("a segment has the id 0")), "{said:?}");
}

#[test]
fn occlusion_masks_of_cocoa_are_its_own_or_follow() {
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "cocoa", "");
    let root = folder.path().join("data");
    assert_eq!(open(&root).derived, []);
    spoil(&file(&root, ".json"), &|it| {
        for annotation in it["annotations"].as_array_mut().expect("a list") {
            for region in annotation["regions"].as_array_mut().expect("a list") {
                region.as_object_mut().expect("a region").remove("invisible_mask");
            }
        }
    });
    assert_eq!(open(&root).derived, keys![OCCLUSION_MASK]);
}

#[test]
fn a_scene_of_bop_without_poses_is_at_fault() {
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "bop", "");
    let root = folder.path().join("data");
    fs::remove_file(file(&root, "000001/scene_gt.json")).expect("there");
    let found = said(&root, "bop");
    assert!(found.iter().any(|it| it.contains("files_exist: 000001: the scene has no scene_gt.json")), "{found:?}");
    // Cameras alone are a dataset, too.
    for scene in ["000000/scene_gt.json", "000002/scene_gt.json"] {
        fs::remove_file(file(&root, scene)).expect("there");
    }
    let read = open(&root);
    assert_eq!((read.images.len(), read.all_faults().len()), (0, 3));
}

#[test]
fn bop_models_exist_and_fit_their_sizes() {
    let model = |diameter: f64| {
        json!({ "diameter": diameter, "min_x": -30.0, "min_y": -20.0, "min_z": 0.0,
                "size_x": 60.0, "size_y": 40.0, "size_z": 120.0 })
    };
    // The diagonal of the box is 140 mm.
    for (diameter, ids, has_mesh, says) in [
        (130.0, 1..=99, true, None),
        (119.0, 1..=99, true, Some("`diameter` is 119 mm")),
        (141.0, 1..=99, true, Some("`diameter` is 141 mm")),
        (130.0, 1..=99, false, Some("obj_000001.ply is missing")),
        (130.0, 200..=201, true, Some("models_info.json has no such model")),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), "bop", "");
        let (root, models) = (folder.path().join("data"), folder.path().join("data/models"));
        fs::create_dir(&models).expect("made");
        let all: serde_json::Map<String, Json> = ids.map(|id| (id.to_string(), model(diameter))).collect();
        for id in all.keys().filter(|_| has_mesh) {
            fs::write(models.join(format!("obj_{id:0>6}.ply")), "ply").expect("writable");
        }
        fs::write(models.join("models_info.json"), Json::Object(all).to_string()).expect("writable");
        let said = said(&root, "bop");
        match says {
            None => assert_eq!(said, Vec::<String>::new()),
            Some(says) => assert!(said.iter().any(|it| it.contains(says)), "{says}: {said:?}"),
        }
    }
}

#[test]
fn planted_faults_are_found() {
    for (kind, options, says, plant) in PLANTED {
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), kind, options);
        let root = folder.path().join("data");
        assert_eq!(said(&root, kind), Vec::<String>::new(), "{kind} {options}");
        spoil(&file(&root, ".json"), *plant);
        let said = said(&root, kind);
        assert!(said.iter().any(|it| it.contains(says)), "{kind}: {says}: {said:?}");
    }
}

/// The end of a file's path, its replacement, and the report.
type Replaced = (&'static str, &'static str, &'static [u8], &'static str);

const REPLACED: &[Replaced] = &[
    ("yolo", ".txt", b"mug 0.1 0.1 0.2 0.2 0.3 0.1\n", ".txt:1: `mug` is no number of a class"),
    ("yolo", ".txt", b"0 0.1 0.1 0.2 0.2 0.3 0.1\n\n0 0.1 x 0.2 0.2 0.3 0.1\n", ".txt:3: `x` is no coordinate"),
    ("yolo", ".txt", b"0 0.1 0.1 0.2 nan 0.3 0.1\n", "`nan` is no coordinate"),
    ("yolo", ".txt", b"0 0.1 0.1 0.2 0.2 0.3\n", "a class and 5 numbers are no points"),
    ("yolo", ".txt", b"0 1e9 0.1 0.2 0.2 0.3 0.4\n", "a polygon has the coordinate"),
    ("yolo", ".txt", b"9 0.1 0.1 0.2 0.2 0.3 0.1\n", "line 1: data.yaml has no class 9"),
    ("yolo", ".txt", b"0 1.5 0.1 0.2 0.2 0.3 0.1\n", "line 1: 1.5 is not in [0, 1]"),
    ("yolo", ".txt", b"\xff\xfe", "it is not UTF-8 text"),
    ("yolo", "data.yaml", b"names: 3\n", "data.yaml:1: `names` cannot be read"),
    ("yolo", "0000.png", b"\x89PNG", "not a readable PNG file"),
    ("yolo", "0000.png", b"\xff\xd8\xff\xe0", "not a readable JPEG file"),
    ("osd_amodal", "annotation/s000000v0000.png", b"x", "it is no PNG file"),
    ("tod", "scene_00000/segmentation_00000.png", b"x", "it is no PNG file"),
    ("tod", "scene_00000/rgb_00000.jpeg", b"\xff\xd8\xff\xe0", "not a readable JPEG file"),
    ("tod", "scene_00000/scene_description.txt", b"{", "EOF while parsing"),
    ("tod", "scene_00000/scene_description.txt", b"{}", "label 2 has no entry in `object_descriptions`, which has 0"),
    ("kins", ".json", b"{\"images\": [], \"annotations\": [", "`annotations`: EOF while parsing"),
    (
        "kins",
        ".json",
        b"{\"images\": [], \"annotations\": [{\"a_area\": NaN}]}",
        "`annotations[0].a_area`: NaN is no number of JSON; write a number or `null`",
    ),
    ("kins", ".json", b"[]", "expected an annotation file"),
    ("kins", ".json", b"", "EOF while parsing"),
    ("cocoa", ".json", b"{\"images\": 3}", "`images`: invalid type: integer `3`, expected a list of records"),
    ("d2sa", ".json", b"{\"images\": [], \"images\": []}", "duplicate field `images`"),
];

#[test]
fn broken_files_are_named() {
    for (kind, end, bytes, says) in REPLACED {
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), kind, "");
        let root = folder.path().join("data");
        fs::write(file(&root, end), bytes).expect("writable");
        let said = said(&root, kind);
        assert!(said.iter().any(|it| it.contains(says)), "{kind} {end}: {says}: {said:?}");
    }
}

#[test]
fn missing_files_and_other_sizes_are_found() {
    let small = {
        let plane = Plane::from_fn(8, 8, |_, _| 0_u8);
        syntable_formats::encode::png::PngImage::gray8(&plane).encode().expect("encoded")
    };
    for (kind, end, bytes, says) in [
        ("osd_amodal", "annotation/s000000v0000.png", Some(&small), "it has 8 × 8 pixels, its record says 64 × 48"),
        ("osd_amodal", "annotation/s000000v0000.png", None, "annotation/s000000v0000.png: it is not there"),
        ("osd_amodal", "amodal_annotation/s000000v0000_1.png", None, "label 1 has no mask in amodal_annotation"),
        ("osd_amodal", "image_color/s000000v0000.png", None, "image_color/s000000v0000.png is missing"),
        ("tod", "segmentation_00000.png", Some(&small), "it has 64 × 48 pixels, its record says 8 × 8"),
        ("tod", "segmentation_00000.png", None, "segmentation_00000.png: it is not there"),
        ("tod", "depth_00000.png", None, "depth_00000.png: it is not there"),
        ("tod", "rgb_00000.jpeg", None, "the color image of this view is missing"),
        ("yolo", "000000_0000.png", None, "has no image of this name"),
        ("d2sa", "000000_0000.png", None, "000000_0000.png: no such file"),
        ("kins", "000000_0000.png", None, "000000_0000.png: no such file"),
        ("cocoa", "000000_0000.png", None, "000000_0000.png: no such file"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), kind, "");
        let root = folder.path().join("data");
        let path = file(&root, end);
        match bytes {
            Some(bytes) => fs::write(path, bytes).expect("writable"),
            None => fs::remove_file(path).expect("there"),
        }
        let said = said(&root, kind);
        assert!(said.iter().any(|it| it.contains(says)), "{kind} {end}: {says}: {said:?}");
    }
}

#[test]
fn rotated_boxes_are_told_from_polygons() {
    for (options, line, has_masks) in [
        ("", None, true),
        ("task = \"obb\"", None, false),
        // An axis-aligned rectangle may be a polygon; a rotated rectangle may not.
        ("", Some("0 0.1 0.2 0.3 0.2 0.3 0.4 0.1 0.4\n"), true),
        ("", Some("0 0.2 0.1 0.4 0.3 0.3 0.4 0.1 0.2\n"), false),
        ("", Some("0 0.2 0.1 0.4 0.3 0.3 0.5 0.1 0.2\n"), true),
        ("", Some("0 0.5 0.5 0.25 0.25\n"), false),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), "yolo", options);
        let root = folder.path().join("data");
        if let Some(line) = line {
            for name in syntable_testing::folder::files(&root).keys().filter(|name| name.ends_with(".txt")) {
                fs::write(root.join(name), line).expect("writable");
            }
        }
        let read = open(&root);
        assert_eq!(read.offers.contains(&VISIBLE_MASK.id()), has_masks, "{options} {line:?}");
        let products = read.read(0, &read.offers).expect("readable").products;
        assert!(!products.get(CATEGORY_ID).expect("there").0.is_empty());
        assert_eq!(said(&root, "yolo"), Vec::<String>::new(), "{options} {line:?}");
    }
}

/// A dataset of YOLO with the same lines in all label files, and with `more` appended to its description.
fn yolo_of(folder: &Path, lines: &str, more: &str) -> PathBuf {
    written(folder, "yolo", "");
    let root = folder.join("data");
    let data = file(&root, "data.yaml");
    fs::write(&data, fs::read_to_string(&data).expect("there") + more).expect("writable");
    for name in syntable_testing::folder::files(&root).keys().filter(|name| name.ends_with(".txt")) {
        fs::write(root.join(name), lines).expect("writable");
    }
    root
}

#[test]
fn what_the_description_says_of_lines_counts_first() {
    let (triangle, turned) = ("0 0.1 0.1 0.4 0.1 0.4 0.4\n", "0 0.2 0.1 0.4 0.3 0.3 0.4 0.1 0.2\n");
    let (flags, points) = ("0 0.5 0.5 0.2 0.2 0.4 0.4 2 0.6 0.6 0\n", "0 0.5 0.5 0.2 0.2 0.4 0.4 0.6 0.6\n");
    for (lines, more, has_masks, caveat) in [
        (flags, "kpt_shape: [2, 3]  # points\n", false, "poses"),
        (points, "kpt_shape:\n  - 2\n  - 2\n", false, "poses"),
        (points, "task: pose\n", false, "poses"),
        (turned, "task: segment\n", true, "visible masks"),
        (turned, "", false, "rotated boxes"),
        (triangle, "names_of: kpt_shape\n", true, "visible masks"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let root = yolo_of(folder.path(), lines, more);
        let read = open(&root);
        assert_eq!(read.offers.contains(&VISIBLE_MASK.id()), has_masks, "{lines} {more}");
        let products = read.read(0, &read.offers).unwrap_or_else(|error| panic!("{lines} {more}: {error}")).products;
        assert_eq!(products.get(CATEGORY_ID).expect("there").0.len(), 1, "{lines} {more}");
        assert!(read.caveats(&read.offers).iter().any(|it| it.contains(caveat)), "{lines} {more}");
        assert_eq!(said(&root, "yolo"), Vec::<String>::new(), "{lines} {more}");
    }
    for (lines, more, says) in [
        (triangle, "task: classify\n", "`task` is `classify`"),
        (triangle, "task: obb\n", "a class and 6 numbers are no points"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let said = said(&yolo_of(folder.path(), lines, more), "yolo");
        assert!(said.iter().any(|it| it.contains(says)), "{more}: {said:?}");
    }
}

#[test]
fn a_box_among_polygons_leaves_the_others_their_masks() {
    let folder = tempfile::tempdir().expect("a folder");
    let root = yolo_of(folder.path(), "0 0.1 0.1 0.4 0.1 0.4 0.4\n0 0.5 0.5 0.2 0.2\n1 0.6 0.6 0.9 0.6 0.9 0.9\n", "");
    let read = open(&root);
    let products = read.read(0, &read.offers).unwrap_or_else(|error| panic!("{error}")).products;
    let masked: Vec<InstanceId> = products.get(VISIBLE_MASK).expect("there").iter().map(|(id, _)| id).collect();
    let classed: Vec<InstanceId> = products.get(CATEGORY_ID).expect("there").iter().map(|(id, _)| id).collect();
    assert_eq!([masked, classed], [[1, 2, 3].map(InstanceId); 2]);
    let boxed: Vec<InstanceId> = products.get(BOX).expect("there").iter().map(|(id, _)| id).collect();
    assert_eq!(boxed, [InstanceId(2)]);
    let said = said(&root, "yolo");
    assert!(!said.is_empty() && said.iter().all(|it| it.contains("line 2: a box among polygons")), "{said:?}");
    let alone = format!("have boxes alone: {}", read.images.len());
    assert!(read.caveats(&read.offers).iter().any(|it| it.ends_with(&alone)), "{:?}", read.caveats(&read.offers));
}

/// A label path that is not a regular file is a fault. It is not treated as a missing file, which would mean an image
/// without objects.
#[cfg(unix)]
#[test]
fn what_is_no_file_is_at_fault_in_yolo() {
    let folder = |path: &Path| fs::create_dir(path).expect("made");
    let pipe =
        |path: &Path| assert!(std::process::Command::new("mkfifo").arg(path).status().expect("mkfifo").success());
    let dangling = |path: &Path| std::os::unix::fs::symlink("nowhere", path).expect("linked");
    let (no_file, nowhere) = ("it is not a file", "no such file");
    for (make, says) in [(&folder as &dyn Fn(&Path), no_file), (&pipe, no_file), (&dangling, nowhere)] {
        for end in ["000000_0000.txt", "data.yaml", "000000_0000.png"] {
            let folder = tempfile::tempdir().expect("a folder");
            written(folder.path(), "yolo", "");
            let root = folder.path().join("data");
            let path = file(&root, end);
            fs::remove_file(&path).expect("there");
            make(&path);
            let said = said(&root, "yolo");
            assert!(said.iter().any(|it| it.contains(end) && it.contains(says)), "{end}: {says}: {said:?}");
        }
    }
}

/// Labels without their image count as lost.
#[test]
fn labels_without_their_image_are_lost() {
    for (kind, end, label) in [
        ("yolo", "000000_0000.png", "000000_0000.txt"),
        ("osd_amodal", "image_color/s000000v0000.png", "annotation/s000000v0000.png"),
        ("osd_amodal", "image_color/s000000v0000.png", "amodal_annotation/s000000v0000_1.png"),
        ("tod", "training_set/scene_00000/rgb_00000.jpeg", "scene_00000/segmentation_00000.png"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), kind, "");
        let root = folder.path().join("data");
        fs::remove_file(file(&root, end)).expect("there");
        let read = open(&root);
        let lost = read.all_faults().iter().any(|it| it.is_lost && it.place_and_text(&[])[0].ends_with(label));
        assert!(lost, "{kind} {label}: {:?}", read.all_faults());
    }
}

/// Annotations that do not describe an object of a listed image are counted.
#[test]
fn annotations_that_are_no_objects_are_counted() {
    let unknown: &Change = &|it| {
        it["annotations"].as_array_mut().expect("a list").iter_mut().for_each(|it| it["image_id"] = json!(999));
    };
    let stuff: &Change = &|it| {
        it["annotations"][0]["regions"][0]["isStuff"] = json!(1);
    };
    for (kind, says, change) in [
        ("coco", "annotations name no image of the file", unknown),
        ("d2sa", "annotations name no image of the file", unknown),
        ("kins", "annotations name no image of the file", unknown),
        ("cocoa", "annotations name no image of the file", unknown),
        ("coco_panoptic", "annotations name no image of the file", unknown),
        ("kins", "annotations are crowds (`iscrowd`)", &|it| it["annotations"][0]["iscrowd"] = json!(1)),
        ("cocoa", "regions are stuff (`isStuff`)", stuff),
        ("cocoa", "regions are of another annotation", &|it| {
            it["annotations"][1]["image_id"] = it["annotations"][0]["image_id"].clone();
        }),
        ("coco_panoptic", "segments are of stuff", &|it| {
            it["categories"].as_array_mut().expect("a list").last_mut().expect("the background")["name"] = json!("sky");
        }),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), kind, "");
        let root = folder.path().join("data");
        let passed_over = || -> Vec<String> {
            let read = open(&root);
            let all = read.not_objects(&read.offers).into_iter().filter(|it| it.count > 0);
            all.map(|it| it.to_string()).collect()
        };
        assert_eq!(passed_over(), Vec::<String>::new(), "{kind}");
        spoil(&annotation_file(&root), change);
        let found = passed_over();
        assert!(found.len() == 1 && found[0].contains(says), "{kind}: {says}: {found:?}");
        let caveats = open(&root).caveats(&[]);
        assert!(!caveats.iter().any(|it| it.contains("no annotations of objects")), "{kind}: {caveats:?}");
    }
}

/// Fields that no product holds are counted by name, if they carry information.
#[test]
fn fields_with_labels_are_counted() {
    let of_annotation: &Change = &|it| it["annotations"][0]["keypoints"] = json!([1, 2, 2]);
    let of_region: &Change = &|it| it["annotations"][0]["regions"][0]["material"] = json!("steel");
    let of_segment: &Change = &|it| it["annotations"][0]["segments_info"][0]["attributes"] = json!({ "is_wet": true });
    for (kind, says, change) in [
        ("coco", "annotations have `keypoints`, which is not kept", of_annotation),
        ("d2sa", "annotations have `keypoints`, which is not kept", of_annotation),
        ("kins", "annotations have `keypoints`, which is not kept", of_annotation),
        ("uoais", "annotations have `keypoints`, which is not kept", of_annotation),
        ("cocoa", "annotations have `keypoints`, which is not kept", of_annotation),
        ("cocoa", "regions have `material`, which is not kept", of_region),
        ("coco_panoptic", "segments have `attributes`, which is not kept", of_segment),
        ("kins", "images have `weather`, which is not kept", &|it| it["images"][0]["weather"] = json!("rain")),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), kind, "");
        let root = folder.path().join("data");
        let not_kept = || -> Vec<String> {
            let read = open(&root);
            assert!(read.not_kept(&[RGB.id()]).is_empty(), "{kind}: no labels are read");
            read.not_kept(&read.offers).iter().map(ToString::to_string).collect()
        };
        assert_eq!(not_kept(), Vec::<String>::new(), "{kind}");
        spoil(&annotation_file(&root), change);
        let found = not_kept();
        assert!(found.len() == 1 && found[0].starts_with("1 of ") && found[0].ends_with(says), "{kind}: {found:?}");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let root = yolo_of(folder.path(), "0 0.5 0.2 0.8 0.5 0.5 0.8 0.2 0.5\n", "");
    let (_, read) = open_dataset(&root, Some("yolo")).expect("a dataset");
    let lost = &read.not_kept(&read.offers)[0];
    assert!(lost.count > 0 && lost.count == lost.of, "{lost}");
    assert_eq!(lost.what, "labels are rotated boxes: only boxes and classes are kept");
}

/// LabelImg writes the names of the classes into the folder of labels.
#[test]
fn classes_beside_labels_have_names() {
    let folder = tempfile::tempdir().expect("a folder");
    let root = yolo_of(folder.path(), "1 0.1 0.1 0.5 0.1 0.5 0.5\n", "");
    fs::remove_file(root.join("data.yaml")).expect("there");
    let names = || -> Vec<String> {
        let (_, read) = open_dataset(&root, Some("yolo")).expect("a dataset");
        read.info.categories().map(|(_, name)| name.to_owned()).collect()
    };
    assert_eq!(names(), ["class 0", "class 1"]);
    let labels = file(&root, ".txt");
    fs::write(root.join(labels).with_file_name("classes.txt"), "mug\nbook\npan\n").expect("writable");
    assert_eq!(names(), ["mug", "book", "pan"]);
}

/// Categories that a file of COCO-Amodal lists keep their numbers, whatever the names of its regions.
#[test]
fn names_that_cocoa_does_not_list_come_behind() {
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "cocoa", "");
    let root = folder.path().join("data");
    let names =
        || -> Vec<(u32, String)> { open(&root).info.categories().map(|(id, name)| (id, name.to_owned())).collect() };
    let listed = names();
    spoil(&annotation_file(&root), &|it| it["annotations"][0]["regions"][0]["name"] = json!("aardvark"));
    let last = listed.last().expect("one").0;
    assert_eq!(names(), [&listed[..], &[(last + 1, "aardvark".to_owned())]].concat());
}

#[test]
fn more_annotations_than_ids_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "coco", "");
    let root = folder.path().join("data");
    spoil(&annotation_file(&root), &|it| {
        let image = it["annotations"][0]["image_id"].clone();
        let of = |id| json!({ "id": id, "image_id": image, "category_id": 1, "area": 1, "bbox": [0, 0, 1, 1] });
        it["annotations"] = (1..=70_000).map(of).collect();
    });
    let read = open(&root);
    let mut all = (0..read.images.len()).map(|image| read.read(image, &[CATEGORY_ID.id()]).map(drop));
    let error = all.find_map(Result::err).expect("refused").to_string();
    assert!(error.contains("70000 annotated objects of one image are more than the limit of 65535"), "{error}");
}

#[test]
fn crowds_of_kins_are_no_objects() {
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "kins", "");
    let root = folder.path().join("data");
    let count = |read: &OpenDataset| read.read(0, &[VISIBLE_MASK.id()]).expect("readable").products;
    let count = |read: &OpenDataset| count(read).get(VISIBLE_MASK).expect("there").0.len();
    let (before, image) = (count(&open(&root)), open(&root).images[0].id);
    spoil(&file(&root, ".json"), &|it| {
        let mut all = it["annotations"].as_array_mut().expect("a list").iter_mut();
        all.find(|it| it["image_id"].as_u64() == image).expect("one")["iscrowd"] = json!(true);
    });
    let read = open(&root);
    assert_eq!((count(&read), read.crowds(0).expect("readable").len()), (before - 1, 1));
}

#[test]
fn of_two_images_of_a_name_the_first_counts() {
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "yolo", "");
    let root = folder.path().join("data");
    let png = file(&root, "000000_0000.png");
    fs::copy(&png, png.with_extension("jpg")).expect("copied");
    let said = said(&root, "yolo");
    assert_eq!(said.len(), 1, "{said:?}");
    let parts = ["unique_views: ", "000000_0000.png: ", "000000_0000.jpg has the same labels, and is read"];
    assert!(parts.iter().all(|part| said[0].contains(part)), "{said:?}");
}

#[test]
fn masks_of_osd_amodal_are_named_after_labels() {
    for (name, says) in [
        ("0", "does not end with `_` and a label"),
        ("+1", "does not end with `_` and a label"),
        ("70000", "does not end with `_` and a label"),
        ("01", "is of the same label"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), "osd_amodal", "");
        let root = folder.path().join("data");
        let good = file(&root, "amodal_annotation/s000000v0000_1.png");
        fs::copy(&good, good.with_file_name(format!("s000000v0000_{name}.png"))).expect("copied");
        let said = said(&root, "osd_amodal");
        assert!(said.len() == 1 && said[0].contains(says), "{name}: {said:?}");
    }
    // Leading zeros do not change a label. A label without an amodal mask is not an object; other labels are.
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "osd_amodal", "");
    let root = folder.path().join("data");
    let count = || {
        let read = open(&root);
        let image = read.read(0, &read.offers).unwrap_or_else(|error| panic!("{error}"));
        let left_out: u64 = image.left_out.iter().map(|it| it.count).sum();
        (image.products.get(AMODAL_MASK).expect("there").0.len(), left_out)
    };
    let (all, _) = count();
    let mask = file(&root, "amodal_annotation/s000000v0000_1.png");
    fs::rename(&mask, mask.with_file_name("s000000v0000_01.png")).expect("renamed");
    assert_eq!((said(&root, "osd_amodal"), count()), (Vec::new(), (all, 0)));
    fs::remove_file(mask.with_file_name("s000000v0000_01.png")).expect("there");
    assert_eq!(count(), (all - 1, 1));
}

#[test]
fn one_of_several_is_named() {
    // Annotation files.
    for (kind, end) in [("coco", ".json"), ("kins", ".json"), ("cocoa", ".json"), ("d2sa", ".json")] {
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), kind, "");
        let root = folder.path().join("data");
        let first = file(&root, end);
        let name = first.file_name().expect("a name").to_string_lossy().replace("train", "val");
        let second = first.with_file_name(name);
        assert_ne!(first, second, "{kind}");
        fs::copy(&first, &second).expect("copied");
        let error = open_dataset(&root, None).err().expect("two files").to_string();
        assert!(error.contains("found 2"), "{kind}: {error}");
        for path in [&first, &second] {
            let (format, read) = open_dataset(path, None).unwrap_or_else(|error| panic!("{kind}: {error}"));
            assert_eq!((format.name(), read.all_faults()), (kind, &[][..]));
            read.read(0, &read.offers).unwrap_or_else(|error| panic!("{kind}: {error}"));
        }
    }
    // Folders of splits.
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "yolo", "");
    let root = folder.path().join("data");
    for of in ["images", "labels"] {
        fs::create_dir(root.join(of).join("zzz")).expect("made");
    }
    let error = open_dataset(&root, None).err().expect("two splits");
    assert!(error.to_string().contains("the dataset has 2 splits"), "{error}");
    // Folders of datasets.
    let folder = tempfile::tempdir().expect("a folder");
    for kind in ["yolo", "kins"] {
        let other = tempfile::tempdir().expect("a folder");
        written(other.path(), kind, "");
        fs::rename(other.path().join("data"), folder.path().join(kind)).expect("renamed");
    }
    let error = open_dataset(folder.path(), None).err().expect("two datasets").to_string();
    assert!(error.contains("it contains 2 datasets"), "{error}");
}

#[test]
fn images_may_be_elsewhere() {
    for kind in ["coco", "coco_panoptic", "cocoa", "d2sa", "kins"] {
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), kind, "");
        let root = folder.path().join("data");
        let rgb =
            |read: &OpenDataset| read.read(0, &[RGB.id()]).map(|image| image.products.get(RGB).expect("there").clone());
        let want = rgb(&open(&root)).expect("readable");
        let [here, there] = [root.join("images"), folder.path().join("elsewhere")];
        fs::rename(here, &there).expect("moved");
        let error = rgb(&open(&root)).err().unwrap_or_else(|| panic!("{kind}: read without images"));
        assert!(error.help_text().is_some_and(|help| help.contains("`options.image_folder`")), "{kind}: {error}");
        let source = Source::new(&root).with_images_in(Some(there));
        let found = || {
            let (_, read) = registry().open_dataset(&source, None).unwrap_or_else(|error| panic!("{kind}: {error}"));
            rgb(&read).expect("readable")
        };
        assert!(found() == want, "{kind}");
        // LVIS' names have the folder of the split.
        spoil(&annotation_file(&root), &|file| {
            for image in file["images"].as_array_mut().expect("a list") {
                image["file_name"] = format!("val2017/{}", image["file_name"].as_str().expect("a name")).into();
            }
        });
        assert!(found() == want, "{kind}");
        // Without the folders `a` and `b`, two images would be one file.
        let there = source.image_folder.as_ref().expect("set");
        let entry = fs::read_dir(there).expect("there").next().expect("an image").expect("there");
        fs::copy(entry.path(), there.join("same.png")).expect("copied");
        spoil(&annotation_file(&root), &|file| {
            for (image, of) in file["images"].as_array_mut().expect("a list").iter_mut().zip(["a", "b"]) {
                image["file_name"] = format!("{of}/same.png").into();
            }
        });
        let error = registry().open_dataset(&source, None).err().unwrap_or_else(|| panic!("{kind}: it is read"));
        let said = "`a/same.png` and `b/same.png` would be one file in ";
        assert!(error.to_string().contains(said) && error.help_text().is_some(), "{kind}: {error}");
    }
    // A format whose images have places of their own.
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "osd_amodal", "");
    let source = Source::new(folder.path().join("data")).with_images_in(Some(folder.path().to_owned()));
    let error = registry().open_dataset(&source, None).err().expect("refused").to_string();
    assert!(error.contains("osd_amodal") && error.contains("`options.image_folder`"), "{error}");
}

#[test]
fn bop_has_a_camera_of_the_dataset_if_all_images_share_it() {
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "bop", "");
    assert!(folder.path().join("data/camera.json").is_file());
    // Images of the same size, one of them with another field of view.
    let (writer, mut takes) = (writer("bop", "").expect("good options"), takes());
    let products = &mut takes[1].views[0].1;
    let mut camera = serde_json::to_value(products.get(CAMERA).expect("there")).expect("JSON");
    camera["K"][0][0] = json!(1.5 * camera["K"][0][0].as_f64().expect("a number"));
    let others: Vec<KeyId> = products.keys().into_iter().filter(|key| *key != CAMERA.id()).collect();
    *products = products.only(&others);
    products.put(CAMERA, Value::of(&camera).expect("a value")).expect("put");
    let folder = tempfile::tempdir().expect("a folder");
    write_scenes(folder.path(), "data", &*writer, &classes(), &takes).expect("written");
    finish(folder.path(), "data", &*writer, &classes(), &[0, 1, 2]).expect("finished");
    let root = folder.path().join("data");
    assert!(root.join("dataset_info.json").is_file() && !root.join("camera.json").exists());
    assert_eq!(open(&root).images.len(), takes.iter().map(|take| take.views.len()).sum::<usize>());
}

#[test]
fn files_of_several_formats_are_listed() {
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "coco", "");
    let root = folder.path().join("data");
    let other = tempfile::tempdir().expect("a folder");
    written(other.path(), "coco_panoptic", "");
    let panoptic = annotation_file(&other.path().join("data"));
    fs::copy(&panoptic, root.join("annotations").join(panoptic.file_name().expect("a name"))).expect("copied");
    let error = open_dataset(&root, None).err().expect("two formats").to_string();
    for file in ["annotations/instances_train.json (coco)", "annotations/panoptic_train.json (coco_panoptic)"] {
        assert!(error.contains(file), "{error}");
    }
}

/// A folder of photographs is no dataset of another format, and no dataset is a folder of photographs.
#[test]
fn photographs_are_read_where_nothing_else_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let photograph = |name: &str, code: u8| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("created");
        image::RgbImage::from_pixel(4, 3, image::Rgb([code; 3])).save(path).expect("written");
    };
    photograph("photos/b.JPG", 60);
    photograph("photos/a.png", 20);
    photograph("photos/.hidden.png", 0);
    photograph("photos/more/c.png", 0);
    let (format, dataset) = open_dataset(&folder.path().join("photos"), None).expect("opens");
    assert!(format.name() == "photographs" && dataset.offers.len() == 1 && dataset.offers.contains(&RGB.id()));
    let names: Vec<&str> = dataset.images.iter().map(|image| image.name.as_str()).collect();
    assert_eq!(names, ["a.png", "b.JPG"]);
    let codes = [0, 1].map(|image| {
        let read = dataset.read(image, &[RGB.id()]).expect("reads");
        assert_eq!(read.size, [4, 3]);
        read.products.get(RGB).expect("made").at(2, 1)[0]
    });
    assert!(codes[0] == 20 && codes[1].abs_diff(60) <= 1, "{codes:?}");
    // Folders of images in an unknown dataset are not the named folder.
    let refusal = |name: &str| open_dataset(&folder.path().join(name), None).err().expect("refused").to_string();
    assert!(refusal("").contains("unrecognized dataset format"), "{}", refusal(""));
    photograph("voc/JPEGImages/a.jpg", 9);
    std::fs::create_dir_all(folder.path().join("voc/Annotations")).expect("created");
    std::fs::write(folder.path().join("voc/Annotations/a.xml"), "<annotation><object/></annotation>").expect("written");
    assert!(refusal("voc").contains("unrecognized dataset format"), "{}", refusal("voc"));
}
