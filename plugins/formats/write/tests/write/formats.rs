//! Tests each writer's files against the writer's description.

use exr::prelude::f16;
use serde_json::{Value as Json, json};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use syntable_model::context::{Collected, Serial};
use syntable_model::prelude::*;
use syntable_model::product::Form;
use syntable_model::product::standard::*;
use syntable_model::registry::{Slot, Stage};
use syntable_model::store::{MemStore, StoreFolder};
use syntable_testing::folder::files_of_store;
use syntable_testing::takes::{
    Crowd, Take, dataset, files, finish, finish_with, take, takes, write_all, write_scenes, writer,
};

fn read_json(path: &Path) -> Json {
    serde_json::from_slice(&std::fs::read(path).expect("there")).expect("JSON")
}

fn keys(record: &Json) -> Vec<&str> {
    record.as_object().expect("a record").keys().map(String::as_str).collect()
}

fn len(value: &Json) -> usize {
    value.as_array().expect("a list").len()
}

#[test]
fn every_kind_conforms() {
    use syntable_testing::conformance;
    use syntable_write as _;
    let registry = syntable_model::registry::Registry::linked().expect("kinds are unique");
    let kinds: Vec<_> = registry.entries().iter().map(|entry| entry.kind).collect();
    let all =
        ["contact_sheet", "exr", "gltf", "jsonl", "npy", "npz", "ply", "png", "syntable", "template", "webdataset"];
    assert_eq!(kinds, all);
    // Objects have categories of two classes.
    let dataset = DatasetInfo { classes: ["a", "b"].map(str::to_owned).to_vec(), ..dataset(1, 1) };
    let (take, log) = (take(0, 3, &[Crowd::Random]), Collected::default());
    let (view, products) = &take.views[0];
    let cx = DatasetContext::new(&dataset, &Serial, &log).scene(&take.scene).view(view);
    for entry in registry.entries() {
        let folder = tempfile::tempdir().expect("a folder");
        let Stage::WriteScenes(writer) = conformance::entry(entry).stage.of_scenes() else { panic!("a writer") };
        assert!(!conformance::writer(&*writer, &cx, products, folder.path()).is_empty(), "{}", entry.kind);
    }
}

#[test]
fn wrong_options_are_refused() {
    for (kind, options, want) in [
        ("png", "include = [\"rgb\", \"rgb\"]", "include[1]: `include` names `rgb` twice"),
        ("exr", "include = [\"depth\", \"depth\"]", "include[1]: `include` names `depth` twice"),
        ("npz", "include = [\"ids\"]", "include[0]: a product named `ids` has the name of a field of this writer"),
        ("jsonl", "include = [\"view\"]", "include[0]: a product named `view` has the name of a field of this writer"),
        ("syntable", "annotation_file = \"a/b.json\"", "annotation_file: `a/b.json` is not a file name"),
        ("syntable", "folder = \"../up\"", "folder: `../up` is not a path inside the dataset"),
        ("syntable", "folder = \".syntable\"", "folder: `.syntable` is a path that the program keeps for itself"),
        ("jsonl", "file = \"../up.jsonl\"", "file: `../up.jsonl` is not a path inside the dataset"),
        ("jsonl", "file = \"recipe.toml\"", "file: `recipe.toml` is a path that the program keeps for itself"),
        ("template", "template = \"a\\n{{ b\"", "template: line 2 of the template: expected"),
        ("template", "template = \"\"\npath = \"{% if %}\"", "path: line 1 of the template: expected"),
    ] {
        let error = writer(kind, options).err().unwrap_or_else(|| panic!("{kind} {options} is accepted"));
        assert!(error.starts_with(want), "{kind} {options}: {error}");
    }
}

#[test]
fn options_of_another_form_are_refused() {
    for (kind, options, want) in [
        ("syntable", "compat = \"release\"", "cannot be \"release\""),
        ("syntable", "bbox = \"both\"", "cannot be \"both\""),
        ("template", "", "needs `template`"),
        ("template", "template = { text = \"a\" }", "`text`"),
        ("template", "template = \"a\"\ntemplate_file = \"b\"", "has no option `template_file`"),
    ] {
        let error = writer(kind, options).err().unwrap_or_else(|| panic!("{kind} {options} is accepted"));
        assert!(error.contains(want), "{kind} {options}: {error}");
    }
}

#[test]
fn the_order_of_scenes_and_a_second_finish_change_nothing() {
    for (kind, options) in [
        ("syntable", "debug_masks = true"),
        ("syntable", "compat = \"syntable_1\""),
        ("jsonl", ""),
        ("jsonl", "per = \"scene\""),
        ("npy", "include = [\"amodal_mask\", \"instance\"]"),
        ("npz", ""),
        ("webdataset", ""),
        ("ply", ""),
        ("template", "per = \"dataset\"\ninclude = [\"visible_box\"]\ntemplate = \"{{ scenes | json_encode() }}\""),
    ] {
        let (one, store) = (tempfile::tempdir().expect("a folder"), Arc::new(MemStore::default()));
        let takes = write_all(one.path(), "w", kind, options);
        let (writer, dataset) = (writer(kind, options).expect("good options"), dataset(3, 3));
        let other = || StoreFolder::from(Arc::clone(&store));
        // In two parts, like an interrupted and resumed run, and in memory.
        write_scenes(other(), "w", &*writer, &dataset, [&takes[2]]).expect("written");
        finish(other(), "w", &*writer, &dataset, &[2]).expect("finished");
        write_scenes(other(), "w", &*writer, &dataset, [&takes[1], &takes[0]]).expect("written");
        finish(other(), "w", &*writer, &dataset, &[0, 1, 2]).expect("finished");
        finish(other(), "w", &*writer, &dataset, &[0, 1, 2]).expect("finished");
        let (one, mut other) = (files(one.path()), files_of_store(&store));
        other.retain(|path, _| !path.starts_with(".syntable/"));
        assert_eq!(one.keys().collect::<Vec<_>>(), other.keys().collect::<Vec<_>>());
        assert!(one == other, "{kind} {options}: files differ");
    }
}

#[test]
fn syntable_writes_one_record_per_image() {
    let folder = tempfile::tempdir().expect("a folder");
    let takes = write_all(folder.path(), "syntable", "syntable", "");
    let json = read_json(&folder.path().join("annotation_final.json"));
    assert_eq!(keys(&json), ["info", "licenses", "categories", "images", "annotations", "scenes"]);
    assert_eq!(json["info"]["description"], json!("a \"test\""));
    // Nine views; ids follow from scene and view; the two views without objects are listed.
    let images = json["images"].as_array().expect("a list");
    assert_eq!(
        images.iter().map(|image| image["id"].as_u64()).collect::<Vec<_>>(),
        (1..=9).map(Some).collect::<Vec<_>>()
    );
    assert_eq!(images[5]["file_name"], json!("data/mono/rgb/1_2.png"));
    assert_eq!(images[5]["occlusion_order_file_name"], json!("data/mono/occlusion_order/1_2.npy"));
    assert_eq!((&images[4]["instance_ids"], &images[8]["instance_ids"]), (&json!([]), &json!([])));
    assert_eq!(images[0]["camera"]["K"][0], json!([45.7, 0.0, 32.0]));
    assert_eq!(images[0]["label_policy"]["image_frame"], json!("clip"));
    // Fully hidden objects are kept.
    let of = |image: u64| {
        json["annotations"].as_array().expect("a list").iter().filter(move |a| a["image_id"] == json!(image))
    };
    let hidden: Vec<&Json> = of(6).collect();
    assert_eq!(hidden.len(), 1);
    assert_eq!((&hidden[0]["occluded_rate"], &hidden[0]["visible_bbox"]), (&json!(1.0), &json!([0, 0, 0, 0])));
    // The exact rate in full precision, and the rounded rate.
    let (_, products) = &takes[0].views[0];
    for annotation in of(1) {
        let id = InstanceId(annotation["instance_id"].as_u64().expect("an id") as u16);
        let rate = *products.get(OCCLUSION_RATE).expect("made").get(id).expect("annotated");
        assert_eq!(annotation["occluded_rate"], json!(rate));
        // A fully hidden object has only the amodal box.
        let visible = products.get(VISIBLE_MASK).expect("made").get(id).is_some_and(|mask| !mask.is_empty());
        assert_eq!(annotation["bbox"], annotation[if visible { "visible_bbox" } else { "amodal_bbox" }]);
        assert_eq!(annotation["area"], json!(products.get(AMODAL_MASK).expect("made").get(id).expect("there").area()));
        assert_eq!(annotation["object_name"], json!(format!("lm/tetra_{}", id.0 + 1)));
        assert_eq!(annotation["object"]["name"], annotation["object_name"]);
    }
    assert_eq!(
        std::fs::read_to_string(folder.path().join("parameters/recipe.toml")).expect("there"),
        dataset(3, 3).recipe
    );
}

/// A growing dataset may contain scenes with fewer views, from an earlier version of the recipe.
#[test]
fn image_ids_are_unique_in_a_dataset_that_has_grown() {
    for compat in ["coco", "syntable_1"] {
        let folder = tempfile::tempdir().expect("a folder");
        let writer = writer("syntable", &format!("compat = \"{compat}\"")).expect("good options");
        let take = |scene: u32, views: usize| take(scene, 9, &vec![Crowd::Random; views]);
        write_scenes(folder.path(), "w", &*writer, &dataset(3, 2), &[take(1, 2)]).expect("written");
        let grown = dataset(3, 3);
        write_scenes(folder.path(), "w", &*writer, &grown, &[take(0, 3), take(2, 3)]).expect("written");
        finish(folder.path(), "w", &*writer, &grown, &[0, 1, 2]).expect("finished");
        let json = read_json(&folder.path().join("annotation_final.json"));
        let of = |list: &str, key: &str| -> Vec<u64> {
            let records = json[list].as_array().expect("a list").iter();
            records.map(|record| record[key].as_u64().expect("an id")).collect()
        };
        let names: BTreeMap<u64, &str> = json["images"]
            .as_array()
            .expect("a list")
            .iter()
            .map(|image| (image["id"].as_u64().expect("an id"), image["file_name"].as_str().expect("a name")))
            .collect();
        let want = [(1, "0_0"), (2, "0_1"), (3, "0_2"), (4, "1_0"), (5, "1_1"), (7, "2_0"), (8, "2_1"), (9, "2_2")];
        let want: Vec<_> = want.map(|(id, name)| (id, format!("data/mono/rgb/{name}.png"))).into();
        assert_eq!(names.into_iter().map(|(id, name)| (id, name.to_owned())).collect::<Vec<_>>(), want, "{compat}");
        let (images, annotations) = (of("images", "id"), of("annotations", "image_id"));
        if compat == "coco" {
            assert_eq!(images.len(), 8, "every id is of one image");
            // Instances of each image, as its record lists them.
            let listed: Vec<u64> = json["images"]
                .as_array()
                .expect("a list")
                .iter()
                .flat_map(|image| vec![image["id"].as_u64().expect("an id"); len(&image["instance_ids"])])
                .collect();
            assert_eq!(annotations, listed);
        } else {
            assert_eq!(annotations, images);
        }
        // A scene with more views than the recipe must not receive the ids of the next scene.
        let error = finish(folder.path(), "w", &*writer, &dataset(3, 2), &[0, 1, 2]).expect_err("too many").to_string();
        assert!(error.contains("scene 0") && error.contains("2 views per scene"), "{error}");
    }
}

#[test]
fn the_shared_types_read_the_file_and_write_the_same_bytes() {
    use syntable_formats::dataset::{AnnotationDataset, JsonLayout};
    use syntable_formats::syntable;
    let folder = tempfile::tempdir().expect("a folder");
    let takes = write_all(folder.path(), "syntable", "syntable", "");
    let path = folder.path().join("annotation_final.json");
    let file = syntable::SynTableDataset::read(&path).expect("reads");
    let mut bytes = Vec::new();
    file.write(&mut bytes, "a.json", JsonLayout::Lines).expect("memory");
    assert!(bytes == std::fs::read(&path).expect("there"));
    let known = file.images.iter().all(|image| image.extra.is_empty());
    assert!(known && file.annotations.iter().all(|annotation| annotation.extra.is_empty()), "types have every field");
    let (_, products) = &takes[0].views[0];
    let annotation = &file.annotations[0];
    let id = InstanceId(annotation.instance_id.expect("written"));
    let amodal = products.get(AMODAL_MASK).expect("made").get(id).expect("annotated");
    assert_eq!(&annotation.segmentation.decode().expect("sound"), amodal);
    let object = annotation.object().expect("an object").expect("written");
    assert_eq!((Some(&object.name), object.world_from_object[2][3]), (annotation.object_name.as_ref(), 0.7));
    assert_eq!(file.images[0].camera().expect("a camera").expect("written").k[0], [45.7, 0.0, 32.0]);

    let folder = tempfile::tempdir().expect("a folder");
    write_all(folder.path(), "syntable", "syntable", "compat = \"syntable_1\"");
    let path = folder.path().join("annotation_final.json");
    let file = AnnotationDataset::<syntable::SynTableImage, syntable::syntable_1::SynTable1Annotation>::read(&path)
        .expect("reads");
    let mut bytes = Vec::new();
    file.write(&mut bytes, "a.json", JsonLayout::Indented).expect("memory");
    assert!(bytes == std::fs::read(&path).expect("there"));
}

#[test]
fn syntable_can_leave_empty_images_out() {
    let folder = tempfile::tempdir().expect("a folder");
    write_all(
        folder.path(),
        "syntable",
        "syntable",
        "skip_empty_images = true\nfolder = \"a/b\"\nannotation_file = \"x.json\"",
    );
    let json = read_json(&folder.path().join("a/b/x.json"));
    let ids: Vec<_> =
        json["images"].as_array().expect("a list").iter().filter_map(|image| image["id"].as_u64()).collect();
    assert_eq!(ids, [1, 2, 3, 4, 6, 7, 8]);
    assert!(folder.path().join("a/b/data/mono/rgb/1_1.png").is_file(), "the image file is there all the same");
    assert!(folder.path().join("a/b/parameters/recipe.toml").is_file());
}

/// A missing category is an error; no object silently gets another category.
#[test]
fn categories_that_the_dataset_has_not_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let (dataset, take) = (dataset(1, 1), take(0, 3, &[Crowd::Random]));
    let (view, products) = &take.views[0];
    let ids: Vec<InstanceId> = products.get(VISIBLE_MASK).expect("masks").iter().map(|(id, _)| id).collect();
    let names = products.keys().into_iter().filter(|key| *key != CATEGORY_ID.id());
    let names: Vec<_> = names.chain([RGB_FILE.id()]).collect();
    let log = Collected::default();
    let cx = DatasetContext::new(&dataset, &Serial, &log).scene(&take.scene);
    let written = |kind: &str, options: &str, category: u32| {
        let mut products = products.only(&names);
        products.put(CATEGORY_ID, ids.iter().map(|&id| (id, category)).collect()).expect("new");
        let writer = writer(kind, options).expect("good options");
        let root = folder.path().join(format!("{kind}_{category}"));
        let mut scene = writer.scene(&cx, Output::new(&root, "w", take.scene.id)).expect("a scene");
        scene.view(&cx.view(view), &products)
    };
    written("syntable", "", 1).expect("`object`");
    let error = written("syntable", "", 99).expect_err("no such category").to_string();
    assert!(error.contains("category 99 of an object is none of the dataset's"), "{error}");
    assert!(error.contains(&format!("instance {}", ids[0])), "{error}");
}

/// The annotation file explains the ids of table and room, and the class of each object.
#[test]
fn scenes_and_classes_are_in_the_annotation_file() {
    use syntable_formats::syntable;
    let folder = tempfile::tempdir().expect("a folder");
    let dataset = DatasetInfo { classes: vec!["bowl".into(), "solid".into()], ..dataset(3, 3) };
    for (compat, categories) in
        [("coco", vec![(1, "object"), (2, "bowl"), (3, "solid")]), ("syntable_1", vec![(1, "object")])]
    {
        let (root, takes) = (folder.path().join(compat), takes());
        let writer = writer("syntable", &format!("compat = \"{compat}\"")).expect("good options");
        write_scenes(&root, "w", &*writer, &dataset, &takes).expect("written");
        finish(&root, "w", &*writer, &dataset, &[0, 1, 2]).expect("finished");
        let file = root.join("annotation_final.json");
        let file = syntable::SynTableDataset::read(&file).expect("reads");
        let named: Vec<(u64, &str)> = file.categories.iter().map(|it| (it.id, it.name.as_str())).collect();
        assert_eq!(named, categories);
        let solid = categories.last().expect("one").0;
        assert!(file.annotations.iter().all(|annotation| annotation.category_id == solid));
        let scenes = file.scenes().expect("sound");
        if compat == "syntable_1" {
            assert!(scenes.is_empty() && file.extra.is_empty());
            continue;
        }
        assert_eq!(scenes.iter().map(|scene| scene.id).collect::<Vec<_>>(), [0, 1, 2]);
        for (scene, take) in scenes.iter().zip(&takes) {
            let ids: Vec<u16> = scene.bodies.iter().map(|body| body.id).collect();
            assert_eq!(ids, take.scene.bodies().iter().map(|body| body.id.0).collect::<Vec<_>>());
            let table = scene.bodies.last().expect("a table");
            assert_eq!(
                (table.role.as_str(), table.name.as_str(), &table.materials[..]),
                ("support", "lm/tetra_0", &["gray".to_owned()][..])
            );
            assert_eq!(table.world_from_body[2][3], 0.7);
            assert!(scene.bodies.iter().all(|body| body.extra.is_empty()));
        }
    }
}

/// Depth and names match the release.
#[test]
fn the_syntable_1_form_truncates_in_single_precision_and_has_no_slash_in_names() {
    let mut take = take(0, 1, &[Crowd::Random]);
    let (view, products) = take.views.remove(0);
    // float32(0.7) is 0.699999988, and 1000 times this value is 700 in float32 but 699.999988 in float64. The other
    // values are equal in both: 2.0015, 1.2340001 and a missing depth.
    let depths = [0.7_f32, 2.0015, 1.234_000_1, f32::INFINITY];
    let mut other = Products::new();
    other.put(DEPTH, Plane::from_fn(64, 48, |x, _| depths[x as usize % 4])).expect("first");
    other.put(RGB, products.get(RGB).expect("made").clone()).expect("first");
    macro_rules! copy {
        ($($key:expr),*) => {$( other.put($key, products.get($key).expect("made").clone()).expect("first"); )*};
    }
    copy!(VISIBLE_MASK, AMODAL_MASK, OCCLUSION_MASK, OCCLUSION_RATE, OCCLUSION_ORDER, VISIBLE_BOX, AMODAL_BOX);
    copy!(OBJECT_INFO, OBJECT_NAME, CATEGORY_ID, CAMERA, DENOISER, EXPOSURE, LABEL_POLICY, BODIES);
    take.views.push((view, other));
    let dataset = dataset(1, 1);
    for (compat, want) in [("coco", [699, 2001, 1234, 0]), ("syntable_1", [700, 2001, 1234, 0])] {
        let folder = tempfile::tempdir().expect("a folder");
        let writer = writer("syntable", &format!("compat = \"{compat}\"")).expect("good options");
        write_scenes(folder.path(), "w", &*writer, &dataset, [&take]).expect("written");
        finish(folder.path(), "w", &*writer, &dataset, &[0]).expect("finished");
        let file = std::fs::read(folder.path().join("data/mono/depth/0_0.png")).expect("there");
        let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().expect("a PNG file");
        let mut bytes = vec![0; reader.output_buffer_size().expect("small")];
        reader.next_frame(&mut bytes).expect("decodes");
        let millimeters = [0, 1, 2, 3].map(|x| u16::from_be_bytes([bytes[2 * x], bytes[2 * x + 1]]));
        assert_eq!(millimeters, want, "{compat}");
        let json = read_json(&folder.path().join("annotation_final.json"));
        for annotation in json["annotations"].as_array().expect("a list") {
            let name = if compat == "coco" { "lm/tetra_2" } else { "lm_tetra_2" };
            assert_eq!(annotation["object_name"], json!(name));
            if compat == "syntable_1" {
                // As in the published sample, where all instances have ten times their area.
                let amodal = products.get(AMODAL_MASK).expect("made").get(InstanceId(1)).expect("annotated");
                assert_eq!(annotation["segmentation"]["area"], json!(10 * amodal.area()));
            }
        }
        assert!(len(&json["annotations"]) == 1);
    }
}

#[test]
fn the_syntable_1_form_has_its_quirks() {
    let folder = tempfile::tempdir().expect("a folder");
    write_all(folder.path(), "syntable", "syntable", "compat = \"syntable_1\"");
    let json = read_json(&folder.path().join("annotation_final.json"));
    assert_eq!(len(&json["images"]), len(&json["annotations"]));
    let annotations = json["annotations"].as_array().expect("a list");
    assert_eq!(
        keys(&annotations[0]),
        [
            "id",
            "image_id",
            "category_id",
            "bbox",
            "width",
            "height",
            "object_name",
            "iscrowd",
            "segmentation",
            "area",
            "visible_mask",
            "visible_bbox",
            "occluded_mask",
            "occluded_rate"
        ]
    );
    for annotation in annotations {
        let rate = annotation["occluded_rate"].as_f64().expect("a rate");
        assert!(rate < 1.0 && (rate * 100.0 - (rate * 100.0).round()).abs() < 1e-9, "{rate}");
        assert_eq!(annotation["area"], json!(0));
    }
    // Views without annotations are not listed, and neither is the view whose objects are all hidden.
    assert!(annotations.iter().all(|annotation| ![5, 6, 9].contains(&annotation["image_id"].as_u64().expect("an id"))));
    let header = std::fs::read(folder.path().join("data/mono/occlusion_order/1_2.npy")).expect("there");
    assert_eq!(header.len(), 128, "no object is annotated, so the matrix is 0 × 0");
    let text = std::fs::read_to_string(folder.path().join("annotation_final.json")).expect("there");
    assert!(text.starts_with("{\n    \"info\": {\n        \"description\""), "{}", &text[..60]);
}

#[test]
fn an_empty_dataset_is_valid() {
    for options in ["", "compat = \"syntable_1\""] {
        let folder = tempfile::tempdir().expect("a folder");
        let (writer, dataset) = (writer("syntable", options).expect("good options"), dataset(1, 1));
        write_scenes(folder.path(), "w", &*writer, &dataset, &[take(0, 1, &[Crowd::Nothing])]).expect("written");
        finish(folder.path(), "w", &*writer, &dataset, &[0]).expect("finished");
        let json = read_json(&folder.path().join("annotation_final.json"));
        assert_eq!((len(&json["images"]), len(&json["annotations"])), (usize::from(options.is_empty()), 0));
        finish(folder.path(), "w", &*writer, &dataset, &[]).expect("finished");
        assert_eq!(len(&read_json(&folder.path().join("annotation_final.json"))["images"]), 0);
    }
}

/// The pixels of an 8-bit PNG file.
fn gray(file: &[u8]) -> Vec<u8> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().expect("a PNG file");
    let mut bytes = vec![0; reader.output_buffer_size().expect("small")];
    reader.next_frame(&mut bytes).expect("decodes");
    bytes
}

#[test]
fn debug_masks_are_named_by_spawn_number() {
    let folder = tempfile::tempdir().expect("a folder");
    let takes = write_all(folder.path(), "syntable", "syntable", "debug_masks = true");
    let files = files(folder.path());
    let pixels = |name: &str| gray(&files[name]);
    let (_, products) = &takes[0].views[0];
    for (id, amodal) in products.get(AMODAL_MASK).expect("made").iter() {
        // Spawn numbers count from 0, and the first object was removed: id 1 was spawned as number 1.
        let k = id.0;
        let want = |mask: &Mask, set: u8| {
            mask.to_plane().data().iter().map(|&bit| if bit { set } else { 0 }).collect::<Vec<u8>>()
        };
        assert_eq!(pixels(&format!("data/mono/amodal/0_0_{k}.png")), want(amodal, k as u8));
        let visible = products.get(VISIBLE_MASK).expect("made").get(id).expect("there");
        assert_eq!(pixels(&format!("data/mono/instance/0_0_{k}.png")), want(visible, 1));
        assert!(files.contains_key(&format!("data/mono/occlusion/0_0_{k}.png")));
    }
    let pfm = &files["data/mono/depth/0_0.pfm"];
    let header = b"Pf\n64 48\n-1.000000\n";
    assert!(pfm.starts_with(header) && pfm.len() == header.len() + 64 * 48 * 4);
    // The bottom row comes first.
    let first = f32::from_le_bytes(pfm[header.len()..][..4].try_into().expect("four bytes"));
    assert_eq!(first, *products.get(DEPTH).expect("made").at(0, 47));
    assert_eq!(pixels("data/mono/depth/visuals/0_0.png").iter().max(), Some(&255));
}

#[test]
fn debug_masks_of_a_dataset_that_was_read_are_made_from_its_labels() {
    let folder = tempfile::tempdir().expect("a folder");
    // Objects have categories of two classes.
    let dataset = DatasetInfo { classes: ["a", "b"].map(str::to_owned).to_vec(), ..dataset(1, 1) };
    let (take, log) = (take(0, 9, &[Crowd::Random]), Collected::default());
    let (view, products) = &take.views[0];
    let entry = syntable_testing::takes::registry().find(Slot::Write, "syntable").expect("registered").clone();
    let Ok(Stage::Write(writer)) = entry.construct_str("debug_masks = true").map(|made| made.stage) else {
        panic!("a writer of images")
    };
    let reads: Vec<String> = writer.reads().into_iter().map(|input| input.product).collect();
    let is_kept = |key: &KeyId| ![INSTANCE.id(), OBJECT_INFO.id()].contains(key);
    let kept: Vec<KeyId> = products.keys().into_iter().filter(is_kept).collect();
    let lent = products.only(&kept).only(&reads);
    let cx = DatasetContext::new(&dataset, &Serial, &log).images(take.scene.id);
    let mut scene = writer.scene(&cx, Output::new(folder.path(), "w", take.scene.id)).expect("starts");
    scene.view(&cx.image(view.id, [64, 48]), &lent).expect("written");
    scene.close(&cx, &lent).expect("closed");
    let files = files(folder.path());
    let pixels = |name: &str| gray(&files[name]);
    let ids = pixels("data/mono/instance/0_0.png");
    let masks = products.get(VISIBLE_MASK).expect("made");
    let mut shown = 0;
    for (id, mask) in masks.iter() {
        let set = mask.to_plane().data().to_vec();
        let own = pixels(&format!("data/mono/instance/0_0_{}.png", id.0 - 1));
        assert_eq!(own, set.iter().map(|&bit| u8::from(bit)).collect::<Vec<_>>(), "{id}");
        assert_eq!(ids.iter().map(|&pixel| u16::from(pixel) == id.0).collect::<Vec<_>>(), set, "{id}");
        shown += mask.area() as usize;
    }
    assert_eq!((ids.iter().filter(|pixel| **pixel != 0).count(), shown > 100), (shown, true));
    assert_eq!(log.warnings(), []);
}

/// One file per view, without pickles; repeated runs give the same bytes; products of different instances are refused.
#[test]
fn archives_hold_the_arrays_of_a_view() {
    let folder = tempfile::tempdir().expect("a folder");
    write_all(folder.path(), "train", "npz", "");
    write_all(folder.path(), "plain", "npz", "compress = false");
    write_all(folder.path(), "one", "npz", "include = [\"visible_ids\"]");
    let files = files(folder.path());
    let names: Vec<&str> = files.keys().filter_map(|name| name.strip_prefix("train/")).collect();
    assert_eq!(names.len(), 10);
    assert_eq!((names[0], names[8], names[9]), ("000000_0000.npz", "000002_0002.npz", "categories.json"));
    let open = |name: &str| zip::ZipArchive::new(std::io::Cursor::new(files[name].clone())).expect("a ZIP file");
    let entries =
        |name: &str| open(name).file_names().map(|name| name.expect("UTF-8").into_owned()).collect::<Vec<_>>();
    let all = [
        "rgb",
        "depth",
        "visible_ids",
        "amodal_bits",
        "visible_box",
        "amodal_box",
        "category_id",
        "occlusion_order",
        "ids",
    ];
    assert_eq!(entries("train/000000_0000.npz"), all.map(|name| format!("{name}.npy")));
    assert_eq!(entries("one/000000_0000.npz"), ["visible_ids.npy"]);
    let mut archive = open("plain/000000_0000.npz");
    for i in 0..archive.len() {
        let entry = archive.by_index(i).expect("an entry");
        assert_eq!(entry.compression(), zip::CompressionMethod::Stored);
        assert_eq!(entry.last_modified(), Some(zip::DateTime::default()), "no clock");
    }
    assert!(files["train/000000_0000.npz"].len() < files["plain/000000_0000.npz"].len() / 2);

    let (writer, dataset) = (writer("npz", "include = [\"visible_box\", \"other\"]").expect("good"), dataset(1, 1));
    let mut take = take(0, 3, &[Crowd::Random]);
    products! {
        /// Has other instances than the other products.
        pub const OTHER: Key<PerInstance<u32>> = view("other");
    }
    take.views[0].1.put(OTHER, PerInstance::from_iter([(InstanceId(77), 1)])).expect("first");
    let error = write_scenes(folder.path(), "w", &*writer, &dataset, [&take]).expect_err("refused").to_string();
    assert!(error.starts_with("`visible_box` and `other` are of different instances"), "{error}");
}

#[test]
fn labels_that_disagree_are_an_error() {
    let (writer, dataset) = (writer("syntable", "").expect("good options"), dataset(1, 1));
    let mut take = take(0, 3, &[Crowd::Hidden]);
    let mut products = Products::new();
    copy_all_but_amodal(&mut products, &take.views[0].1);
    take.views[0].1 = products;
    let folder = tempfile::tempdir().expect("a folder");
    let error = write_scenes(folder.path(), "w", &*writer, &dataset, &[take]).expect_err("refused").to_string();
    assert!(error.contains("is in the masks but not in `amodal_mask`"), "{error}");

    /// Copies all products except the amodal masks.
    fn copy_all_but_amodal(products: &mut Products, source: &Products) {
        macro_rules! copy {
            ($($key:expr),*) => {$( products.put($key, source.get($key).expect("made").clone()).expect("first"); )*};
        }
        copy!(RGB, DEPTH, VISIBLE_MASK, OCCLUSION_MASK, OCCLUSION_RATE, OCCLUSION_ORDER, VISIBLE_BOX, AMODAL_BOX);
        copy!(OBJECT_INFO, BODIES, CAMERA, DENOISER, EXPOSURE, LABEL_POLICY);
        products.put(AMODAL_MASK, PerInstance::default()).expect("first");
    }
}

#[test]
fn damaged_shards_are_named() {
    for (kind, options) in [("jsonl", ""), ("syntable", "")] {
        let folder = tempfile::tempdir().expect("a folder");
        write_all(folder.path(), "w", kind, options);
        let shard = folder.path().join(".syntable/shards/w/000/000001.jsonl");
        let whole = std::fs::read(&shard).expect("there");
        std::fs::write(&shard, &whole[..whole.len() - 5]).expect("writable");
        let writer = writer(kind, options).expect("good options");
        let error = finish(folder.path(), "w", &*writer, &dataset(3, 3), &[0, 1, 2]).expect_err("damaged").to_string();
        assert!(error.contains("shard of scene 1 ends in the middle of a line"), "{error}");
        assert!(error.contains("options.repair"), "{error}");
        let leftovers = files(folder.path());
        assert!(!leftovers.keys().any(|name| name.ends_with(".part")), "{:?}", leftovers.keys());
        assert!(
            leftovers.contains_key(if kind == "jsonl" { "w.jsonl" } else { "annotation_final.json" }),
            "the old file stays"
        );
    }
}

#[test]
fn two_writers_do_not_overwrite_each_other() {
    let folder = tempfile::tempdir().expect("a folder");
    let (writer, dataset, take) =
        (writer("syntable", "").expect("good options"), dataset(1, 1), take(0, 2, &[Crowd::Random]));
    write_scenes(folder.path(), "one", &*writer, &dataset, [&take]).expect("written");
    let error = write_scenes(folder.path(), "two", &*writer, &dataset, [&take]).expect_err("refused").to_string();
    assert!(error.contains("`data/mono/rgb/0_0.png` is written twice"), "{error}");
}

#[test]
fn lines_are_about_views_or_scenes() {
    let folder = tempfile::tempdir().expect("a folder");
    let include = "include = [\"settle_report\", \"visible_box\"]";
    write_all(folder.path(), "views", "jsonl", include);
    write_all(folder.path(), "scenes", "jsonl", &format!("{include}\nper = \"scene\"\nfile = \"deep/scenes.jsonl\""));
    let lines = |name: &str| -> Vec<Json> {
        let text = std::fs::read_to_string(folder.path().join(name)).expect("there");
        text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    };
    let (views, scenes) = (lines("views.jsonl"), lines("deep/scenes.jsonl"));
    assert_eq!((views.len(), scenes.len()), (9, 3));
    assert_eq!(keys(&views[4]), ["scene", "view", "settle_report", "visible_box"]);
    assert_eq!((&views[4]["scene"], &views[4]["view"]), (&json!(1), &json!(1)));
    assert_eq!(keys(&scenes[1]), ["scene", "settle_report", "views"]);
    assert_eq!(scenes[1]["settle_report"], views[3]["settle_report"]);
    for (i, view) in scenes[1]["views"].as_array().expect("a list").iter().enumerate() {
        assert_eq!(view["visible_box"], views[3 + i]["visible_box"]);
        assert_eq!(keys(view), ["view", "visible_box"]);
    }
}

#[test]
fn products_that_do_not_fit_are_named() {
    for (kind, product, want) in [
        (
            "png",
            "object_info",
            "product `object_info`: a PNG file holds images and masks, not a record; write it with jsonl",
        ),
        (
            "png",
            "occlusion_order",
            "product `occlusion_order`: a PNG file holds images and masks, not a bool array; write it with npy or jsonl",
        ),
        (
            "npy",
            "camera",
            "product `camera`: a NumPy file holds numbers of one shape, not a record; write it with jsonl",
        ),
        (
            "npy",
            "object_info",
            "product `object_info`: a NumPy file holds numbers of one shape, not a record; write it with jsonl",
        ),
        (
            "exr",
            "instance",
            "product `instance`: an EXR file holds 16- and 32-bit float images, not a u16 image; write it with npy or png",
        ),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let writer = writer(kind, &format!("include = [\"{product}\"]")).expect("good options");
        let error =
            write_scenes(folder.path(), "w", &*writer, &dataset(3, 3), &takes()[..1]).expect_err("refused").to_string();
        assert!(error.starts_with(want), "{error}");
    }
}

products! {
    /// Height of the tabletop above the floor.
    const RELIEF: Key<Plane<u16>> = scene("relief").unit("mm");
    /// Wear of the scene's table, half precision, made from all views.
    const WEAR: Key<Plane<f16>> = scene("wear");
    /// Motion of the surface point.
    const MOTION: Key<Plane<[f16; 2]>> = view("motion").unit("px");
    /// Difference from the previous view.
    const CHANGE: Key<Plane<i16>> = view("change");
    /// Fraction of the views in which the object is visible, made from all views.
    const SEEN: Key<PerInstance<f64>> = scene("seen");
    /// Number of objects in all scenes.
    const TOTAL: Key<Value> = dataset("total").form(|| Form::Record);
}

/// A scene of two views with products of every scope: `relief` exists before the views, `wear` and `seen` do not.
fn take_with_scopes() -> Take {
    let mut take = take(0, 2, &[Crowd::Random, Crowd::Nothing]);
    let relief = Plane::from_fn(5, 4, |x, y| (700 + 300 * x + y) as u16);
    for (view, products) in &mut take.views {
        let number = view.id.0 as f32;
        products.put(RELIEF, relief.clone()).expect("first");
        products
            .put(MOTION, Plane::from_fn(6, 3, |x, y| [x as f32 / 3.0, number - y as f32].map(f16::from_f32)))
            .expect("first");
        products.put(CHANGE, Plane::from_fn(6, 3, |x, y| (y as i16 - 1) * 300 * x as i16)).expect("first");
    }
    take.products.put(RELIEF, relief).expect("first");
    take.products.put(WEAR, Plane::from_fn(5, 4, |x, y| f16::from_f32(x as f32 - y as f32 / 7.0))).expect("first");
    take.products.put(SEEN, PerInstance::from_iter([(InstanceId(2), 0.5)])).expect("first");
    take
}

#[test]
fn products_of_a_scene_are_written_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let take = take_with_scopes();
    for (kind, include) in [("png", "relief"), ("npy", "relief\", \"wear\", \"seen"), ("exr", "wear")] {
        let writer = writer(kind, &format!("include = [\"{include}\"]")).expect("good options");
        write_scenes(folder.path(), kind, &*writer, &dataset(1, 2), [&take]).expect("written");
    }
    let files = files(folder.path());
    assert_eq!(
        files.keys().collect::<Vec<_>>(),
        [
            "exr/wear/000000.exr",
            "npy/relief/000000.npy",
            "npy/seen/000000.npy",
            "npy/seen/000000_ids.npy",
            "npy/wear/000000.npy",
            "png/relief/000000.png"
        ]
    );
    let mut reader = png::Decoder::new(std::io::Cursor::new(&files["png/relief/000000.png"])).read_info().expect("PNG");
    let mut bytes = vec![0; reader.output_buffer_size().expect("small")];
    reader.next_frame(&mut bytes).expect("decodes");
    let relief = take.products.get(RELIEF).expect("made");
    assert!(bytes.as_chunks().0.iter().map(|&b| u16::from_be_bytes(b)).eq(relief.data().iter().copied()));
    assert!(files["npy/seen/000000.npy"].ends_with(&0.5_f64.to_le_bytes()));
    assert!(files["npy/seen/000000_ids.npy"].ends_with(&[2, 0]));
}

#[test]
fn half_floats_and_signed_integers_are_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let take = take_with_scopes();
    for (kind, include) in [("npy", "\"motion\", \"change\""), ("exr", "\"motion\"")] {
        let writer = writer(kind, &format!("include = [{include}]")).expect("good options");
        write_scenes(folder.path(), kind, &*writer, &dataset(1, 2), [&take]).expect("written");
    }
    let products = &take.views[1].1;
    let (motion, change) = (products.get(MOTION).expect("made"), products.get(CHANGE).expect("made"));
    let files = files(folder.path());
    for (name, header, bytes) in [
        (
            "npy/motion/000000_0001.npy",
            "{'descr': '<f2', 'fortran_order': False, 'shape': (3, 6, 2), }",
            motion.data().iter().flatten().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>(),
        ),
        (
            "npy/change/000000_0001.npy",
            "{'descr': '<i2', 'fortran_order': False, 'shape': (3, 6), }",
            change.data().iter().flat_map(|x| x.to_le_bytes()).collect(),
        ),
    ] {
        let file = &files[name];
        assert!(file[10..].starts_with(header.as_bytes()), "{name}: {}", String::from_utf8_lossy(&file[..100]));
        assert!(file.len() == 128 + bytes.len() && file.ends_with(&bytes), "{name}");
    }
    // EXR stores 16-bit floats unchanged, with or without `half`.
    let image = exr::prelude::read_all_flat_layers_from_file(folder.path().join("exr/motion/000000_0001.exr"));
    let image = image.expect("an EXR file");
    let channels = &image.layer_data[0].channel_data.list;
    assert_eq!(channels.len(), 2);
    for (i, channel) in channels.iter().enumerate() {
        assert_eq!(channel.name.to_string(), ["X", "Y"][i]);
        let exr::prelude::FlatSamples::F16(samples) = &channel.sample_data else { panic!("not 16 bits") };
        assert!(samples.iter().map(|x| x.to_bits()).eq(motion.data().iter().map(|pixel| pixel[i].to_bits())));
    }
}

#[test]
fn lines_have_the_products_of_their_scope() {
    let folder = tempfile::tempdir().expect("a folder");
    let take = take_with_scopes();
    let mut totals = Products::new();
    totals.put(TOTAL, Value::record([("objects", 2_i64.into())])).expect("first");
    let include = "include = [\"total\", \"seen\", \"settle_report\", \"relief\", \"visible_box\"]";
    let lines = |id: &str, options: &str| -> Vec<Json> {
        let writer = writer("jsonl", &format!("{include}\n{options}")).expect("good options");
        write_scenes(folder.path(), id, &*writer, &dataset(1, 2), [&take]).expect("written");
        finish_with(folder.path(), id, &*writer, &dataset(1, 2), &[0], &totals).expect("finished");
        let text = std::fs::read_to_string(folder.path().join(format!("{id}.jsonl"))).expect("there");
        text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    };
    let (total, seen) = (json!({"total": {"objects": 2}}), json!({"2": 0.5}));

    let views = lines("views", "per = \"view\"");
    assert_eq!(views.len(), 4);
    for (i, line) in views[..2].iter().enumerate() {
        assert_eq!(keys(line), ["scene", "view", "settle_report", "relief", "visible_box"]);
        assert_eq!((&line["view"], &line["settle_report"]["objects"]), (&json!(i), &json!(2)));
    }
    assert_eq!(views[2], json!({"scene": 0, "seen": seen}), "what is made from all views has a line of its own");
    assert_eq!(views[3], total, "the last line");

    let scenes = lines("scenes", "per = \"scene\"");
    assert_eq!(scenes.len(), 2);
    assert_eq!(keys(&scenes[0]), ["scene", "seen", "settle_report", "relief", "views"]);
    assert_eq!(scenes[0]["seen"], seen);
    assert_eq!(len(&scenes[0]["views"]), 2);
    assert_eq!(keys(&scenes[0]["views"][1]), ["view", "visible_box"]);
    assert_eq!(scenes[1], total, "the last line");
}

#[test]
fn what_a_file_cannot_hold_is_refused_by_the_key() {
    let check = |kind: &str, key: KeyId| {
        let writer = writer(kind, &format!("include = [\"rgb\", \"{}\"]", key)).expect("good options");
        let input = writer.reads().pop().expect("two inputs");
        assert_eq!((input.product.as_str(), input.option.as_deref()), (key.product, Some("include[1]")));
        input.accepts.check(&key)
    };
    for (kind, key, want) in [
        ("png", RADIANCE_VARIANCE.id(), "a PNG file holds integers, not an f32 image; write it with exr or npy"),
        (
            "png",
            RADIANCE.id(),
            "a PNG file holds colors between 0 and 1, not nit; write it with exr, or write `rgb`, the exposed image",
        ),
        ("png", CHANGE.id(), "a PNG file holds unsigned integers of 8 or 16 bits, not an i16 image; write it with npy"),
        (
            "png",
            OCCLUSION_ORDER.id(),
            "a PNG file holds images and masks, not a bool array; write it with npy or jsonl",
        ),
        ("npy", OBJECT_INFO.id(), "a NumPy file holds numbers of one shape, not a record; write it with jsonl"),
        ("npy", CAMERA.id(), "a NumPy file holds numbers of one shape, not a record; write it with jsonl"),
        (
            "exr",
            VISIBLE_MASK.id(),
            "an EXR file holds 16- and 32-bit float images, not a mask; write it with npy or png",
        ),
        (
            "exr",
            INSTANCE.id(),
            "an EXR file holds 16- and 32-bit float images, not a u16 image; write it with npy or png",
        ),
        ("npy", TOTAL.id(), "it is made once per dataset, not per view or scene; write it with jsonl or template"),
    ] {
        assert_eq!(check(kind, key), Err(want.to_owned()), "{kind} {}", key);
    }
    for (kind, key) in [
        ("png", VISIBLE_MASK.id()),
        ("png", DEPTH.id()),
        ("png", RELIEF.id()),
        ("npy", RADIANCE_VARIANCE.id()),
        ("npy", OCCLUSION_RATE.id()),
        ("exr", RADIANCE_VARIANCE.id()),
        ("exr", MOTION.id()),
        ("jsonl", TOTAL.id()),
        ("jsonl", OBJECT_INFO.id()),
    ] {
        assert_eq!(check(kind, key), Ok(()), "{kind} {}", key);
    }
}

#[test]
fn templates_write_any_text() {
    let folder = tempfile::tempdir().expect("a folder");
    // YOLO's label files: class, then center and size of the box as fractions of the image.
    let yolo = r#"
include = ["visible_box", "camera"]
path = "labels/{{ scene.id | pad(width=6) }}_{{ view.id | pad }}.txt"
template = """
{%- for id, b in visible_box -%}
0 {{ (b[0] + b[2] / 2) / camera.width }} {{ (b[1] + b[3] / 2) / camera.height }} {{ b[2] / camera.width }} {{ b[3] / camera.height }}
{% endfor -%}"""
"#;
    let takes = write_all(folder.path(), "yolo", "template", yolo);
    let text = std::fs::read_to_string(folder.path().join("labels/000000_0002.txt")).expect("there");
    let boxes = takes[0].views[2].1.get(VISIBLE_BOX).expect("made");
    assert_eq!(text.lines().count(), boxes.0.len());
    for (line, (_, b)) in text.lines().zip(boxes.iter()) {
        let got: Vec<f64> = line.split(' ').map(|number| number.parse().expect("a number")).collect();
        let (w, h) = (f64::from(b.width), f64::from(b.height));
        let want = [0.0, (f64::from(b.x) + w / 2.0) / 64.0, (f64::from(b.y) + h / 2.0) / 48.0, w / 64.0, h / 48.0];
        assert!(got.len() == 5 && got.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-9), "{line} {want:?}");
    }
    assert_eq!(std::fs::read_to_string(folder.path().join("labels/000001_0001.txt")).expect("there").trim(), "");

    let per_scene = r#"
per = "scene"
include = ["settle_report"]
template = "{{ dataset.name }} {{ scene.id }}: {{ settle_report.objects }} objects, {{ views | length }} views"
"#;
    write_all(folder.path(), "notes", "template", per_scene);
    let text = std::fs::read_to_string(folder.path().join("notes/000002.txt")).expect("there");
    assert_eq!(text, "a \"test\" 2: 70 objects, 3 views");

    let per_dataset = r#"
per = "dataset"
include = ["visible_box"]
path = "{{ writer }}.csv"
template = "{% for s in scenes %}{% for v in s.views %}{{ s.scene.id }},{{ v.view.id }},{{ v.visible_box | length }}\n{% endfor %}{% endfor %}"
"#;
    write_all(folder.path(), "table", "template", per_dataset);
    let text = std::fs::read_to_string(folder.path().join("table.csv")).expect("there");
    assert_eq!(text.lines().count(), 9);
    let count = takes[1].views[0].1.get(VISIBLE_BOX).expect("made").0.len();
    assert_eq!(text.lines().nth(3), Some(format!("1,0,{count}").as_str()));
}

#[test]
fn faults_of_templates_name_file_and_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let take = [take(0, 2, &[Crowd::Random])];
    let write = |options: &str| {
        let writer = writer("template", options).expect("good options");
        write_scenes(folder.path(), "w", &*writer, &dataset(1, 1), &take).expect_err("refused").to_string()
    };
    let file = folder.path().join("labels.tera");
    let options = format!("template = {{ file = {:?} }}", file.display().to_string());
    assert!(write(&options).contains("labels.tera: no such file"), "{}", write(&options));
    std::fs::write(&file, "one\n{% for x in %}\n").expect("writable");
    assert!(write(&options).contains("labels.tera:2: expected"), "{}", write(&options));
    std::fs::write(&file, "one\n\n{{ camera.width }}\n").expect("writable");
    let error = write(&options);
    assert!(error.contains("labels.tera:3: ") && error.contains("unknown variable `camera`"), "{error}");
    assert!(error.contains("must be listed in `include`"), "{error}");
    let error = write("template = \"x\"\npath = \"../{{ scene.id }}\"");
    assert!(error.contains("`../0` is not a path inside the dataset"), "{error}");
}

/// The writer's error for a template with this `per` and the visible boxes; none if it is accepted.
fn refused(per: &str, template: &str) -> Option<String> {
    let options = format!("per = {per:?}\ninclude = [\"visible_box\"]\ntemplate = {template:?}");
    writer("template", &options).err()
}

#[test]
fn variables_that_no_context_of_a_template_has_are_refused() {
    for (per, template, line, says) in [
        ("view", "a\n{{ sceen.id }}", 2, "unknown variable `sceen`: a file per view has `dataset`, `scene`, `view`, "),
        ("view", "{{ views | length }}", 1, "unknown variable `views`"),
        ("view", "{{ view.cameraa }}", 1, "unknown field `view.cameraa`: the fields of `view` are `id`"),
        ("view", "{{ writer.id }}", 1, "unknown field `writer.id`: the fields of `writer` are none"),
        ("view", "scene.id\n\n{{ scene.id.x }}", 3, "unknown field `scene.id.x`"),
        ("view", "{{ amodal_box | length }}", 1, "products must be listed in `include`"),
        ("view", "{% for m in masks %}{% endfor %}", 1, "`masks`"),
        ("scene", "{{ view.id }}", 1, "unknown variable `view`"),
        (
            "scene",
            "{% for v in views %}\n{{ v.pose.id }}{% endfor %}",
            2,
            "the fields of `v` are `view`, `visible_box`",
        ),
        ("scene", "{% for v in views %}{% endfor %}{{ v.view.id }}", 1, "unknown variable `v`"),
        ("scene", "{{ views[0].view.nr }}", 1, "unknown field `views[0].view.nr`"),
        ("scene", "{{ views.first }}", 1, "unknown field `views.first`"),
        ("dataset", "{{ scene.id }}", 1, "unknown variable `scene`: the file of the dataset has `dataset`, `scenes`, "),
        ("dataset", "{% for s in scenes %}{% for v in s.views %}{{ s.view }}{% endfor %}{% endfor %}", 1, "`s.view`"),
        ("view", "{{ dataset['size'] }}", 1, "unknown field `dataset['size']`"),
        ("view", "{% if scene.id == n %}{% endif %}", 1, "`n`"),
        ("view", "{% if visible_box %}{{ 1 + m }}{% endif %}", 1, "`m`"),
        ("view", "{{ 'a' ~ b }}", 1, "`b`"),
        ("view", "{{ range(end=n) }}", 1, "`n`"),
        ("view", "{{ scene.id | pad(width=w) }}", 1, "`w`"),
        ("view", "{% set x = y %}{{ x }}", 1, "`y`"),
        ("view", "{{ loop.index }}", 1, "`loop`"),
        ("scene", "{% for v in views %}{{ loop.count }}{% endfor %}", 1, "`loop.count`"),
        ("view", "{% macro m(a) %}{{ a }}{{ b }}{% endmacro %}{{ self::m(a=1) }}", 1, "`b`"),
        ("view", "{% block one %}{{ b }}{% endblock %}", 1, "`b`"),
        ("view", "{% filter upper %}{{ b }}{% endfilter %}", 1, "`b`"),
    ] {
        let error = refused(per, template).unwrap_or_else(|| panic!("{template} is accepted"));
        let place = format!("template: line {line} of the template: ");
        assert!(error.starts_with(&place) && error.contains(says), "{template}: {error}");
    }
    let path = "template = \"x\"\npath = \"{{ scene.nr }}\"";
    let error = writer("template", path).err().expect("refused");
    assert!(error.starts_with("path: line 1 of the template: unknown field `scene.nr`"), "{error}");
}

#[test]
fn what_data_or_a_template_itself_may_give_is_not_judged() {
    for (per, template) in [
        ("view", "{{ visible_box.a.b[0] }} {{ visible_box[scene.id].x }} {{ dataset.name }} {{ dataset['seed'] }}"),
        ("view", "{% for i, b in visible_box %}{{ i }} {{ b.x }} {{ loop.index }}{% else %}{{ scene.id }}{% endfor %}"),
        ("scene", "{{ views[7].visible_box.y }} {{ views.0.view.id }} {{ visible_box.3 }}"),
        ("scene", "{% for v in views | reverse %}{{ v.any }}{% endfor %}"),
        (
            "dataset",
            "{% for s in scenes %}{% for v in s.views %}{{ s.scene.id }} {{ v.view.id }}{% endfor %}{% endfor %}",
        ),
        ("view", "{% for n in range(end=3) %}{{ n }}{% endfor %}"),
        ("view", "{% if masks is defined %}{{ masks.a }}{% endif %}"),
        ("view", "{% if masks %}{{ masks.a }}{% endif %}{% if not depth %}no{% endif %}"),
        ("view", "{% if scene.name and scene.id > 1 %}{{ scene.name }}{% endif %}"),
        ("view", "{{ masks | default(value=1) }} {{ scene.name | default(value='-') }}"),
        ("view", "{% if 'name' in scene %}{{ scene.name }}{% endif %}"),
        ("view", "{% if scene.id > 1 %}{% set a = 1 %}{% endif %}{{ a }}{% set view = 3 %}{{ view.x }}"),
        ("view", "{% macro m(a, b=1) %}{{ a.x }}{{ b }}{{ scene.id }}{% endmacro %}{{ self::m(a=visible_box) }}"),
        ("view", "{# {{ nothing }} #}{% raw %}{{ nothing }}{% endraw %}{{ __tera_context }}"),
    ] {
        assert_eq!(refused(per, template), None, "{template}");
    }
}

#[test]
fn contact_sheets_show_views_in_rows() {
    let folder = tempfile::tempdir().expect("a folder");
    let options = "panels = [\"rgb\", \"visible\", \"occlusion\", \"depth\"]\npanel_width_px = 32\nviews_per_sheet = 2";
    write_all(folder.path(), "sheet", "contact_sheet", options);
    let files = files(folder.path());
    assert_eq!(files.len(), 6);
    let size = |name: &str| {
        let reader = png::Decoder::new(std::io::Cursor::new(&files[name])).read_info().expect("a PNG file");
        (reader.info().width, reader.info().height)
    };
    assert_eq!(size("sheet/000000_00.png"), (4 * 32 + 3 * 4, 2 * 24 + 4));
    assert_eq!(size("sheet/000000_01.png"), (4 * 32 + 3 * 4, 24));
}
