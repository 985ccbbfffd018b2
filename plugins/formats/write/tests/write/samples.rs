//! Reads the files of generic writers back: each product equals the written product, and labels are computed from it.

use std::path::Path;
use syntable_model::prelude::*;
use syntable_model::product::standard::*;
use syntable_model::reader;
#[cfg(unix)]
use syntable_testing::hostile::{links_lead_nowhere_else, pipes_are_not_waited_for};
use syntable_testing::read_back::{JPEG, assert_jpeg_images, assert_products, classes, opened, written};
use syntable_testing::takes::{open_dataset, registry};
use syntable_write as _;

/// Labels that are computed from planes of ids and bits, or from masks.
fn labels() -> Vec<KeyId> {
    keys![
        VISIBLE_MASK,
        AMODAL_MASK,
        VISIBLE_BOX,
        AMODAL_BOX,
        OCCLUSION_MASK,
        OCCLUSION_RATE,
        OCCLUSION_ORDER,
        CATEGORY_ID
    ]
}

#[test]
fn products_come_back_and_labels_follow() {
    let masks = "\"visible_mask\", \"amodal_mask\", \"category_id\", \"occlusion_order\"";
    let more = "\"normal\", \"radiance\", \"object_name\", \"object_info\", \"visibility\", \"exposure\"";
    let cases = [
        ("webdataset", String::new()),
        ("webdataset", format!("include = [\"rgb\", {masks}, {more}, \"depth\", \"camera\"]\nfloats = \"exr\"")),
        ("npz", String::new()),
        ("npz", format!("include = [\"rgb\", {masks}, \"normal\", \"radiance\"]\ncompress = false")),
        ("npz", format!("include = [{masks}, {more}, \"camera\", \"rgb\"]")),
        ("jsonl", format!("include = [{masks}, {more}, \"rgb\", \"depth\", \"camera\", \"bodies\"]")),
        ("jsonl", format!("include = [{masks}, \"depth\", \"bodies\", \"camera\"]\nper = \"scene\"")),
    ];
    for (kind, options) in &cases {
        let folder = tempfile::tempdir().expect("a folder");
        let takes = written(folder.path(), kind, options);
        let read = opened(folder.path(), kind);
        let offers = &read.offers;
        assert!(labels().iter().all(|key| offers.contains(key)), "{kind} {options}: {offers:?}");
        // Lines do not contain names of categories.
        if *kind != "jsonl" {
            assert_eq!(read.info.categories().collect::<Vec<_>>(), classes().categories().collect::<Vec<_>>());
        }
        assert!(assert_products(&read, &takes, true, |_, value| value) > 60, "{kind} {options}");
    }
}

#[test]
fn sensed_depth_of_syntable_is_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let takes = written(folder.path(), "syntable", "depth = \"sensed\"");
    let read = opened(folder.path(), "syntable");
    let found = read.read(0, &[DEPTH.id()]).expect("readable").products;
    let mm = |depth: &f32| if depth.is_finite() { (f64::from(*depth) * 1000.0 + 0.001).floor() } else { 0.0 };
    let want = takes[0].views[0].1.get(DEPTH_SENSED).expect("there").map(mm);
    assert!(found.get(DEPTH).expect("there").map(mm) == want && want.data().contains(&0.0));
}

#[test]
fn jpeg_images_are_read() {
    for kind in ["syntable", "webdataset"] {
        let folder = tempfile::tempdir().expect("a folder");
        let takes = written(folder.path(), kind, JPEG);
        let root = if kind == "syntable" { folder.path().to_owned() } else { folder.path().join("data") };
        assert_jpeg_images(&opened(&root, kind), &takes);
    }
}

/// Readers follow no link out of the dataset, and do not wait for named pipes.
#[cfg(unix)]
#[test]
fn nothing_outside_is_read() {
    let masks = "include = [\"visible_mask\", \"amodal_mask\", \"category_id\"]";
    for (kind, options) in [("webdataset", ""), ("npz", ""), ("jsonl", masks), ("syntable", "")] {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path().join("root");
        written(&root, kind, options);
        // Some writers have no shards.
        let _ = std::fs::remove_dir_all(root.join(".syntable"));
        let root = if ["webdataset", "npz"].contains(&kind) { root.join("data") } else { root };
        pipes_are_not_waited_for(&root, kind);
        links_lead_nowhere_else(&root, kind);
    }
}

#[test]
fn each_product_is_read_by_itself() {
    let folder = tempfile::tempdir().expect("a folder");
    let takes = written(folder.path(), "webdataset", "");
    let read = opened(folder.path(), "webdataset");
    for key in read.offers.iter().copied() {
        let found = read.read(1, &[key]).unwrap_or_else(|error| panic!("{}: {error}", key)).products;
        let name = key.to_string();
        let want = takes[0].views[1].1.value(&name).expect("written");
        assert!(found.value(&name).expect("there") == want || name == "camera" || name == "amodal_bits", "{name}");
        assert_eq!(found.keys().len(), 1, "{name}");
    }
}

/// Reports about a modified dataset: faults while opening it, then errors of images.
fn said(root: &Path, kind: &str) -> Vec<String> {
    let read = match open_dataset(root, Some(kind)) {
        Ok((_, read)) => read,
        Err(error) => return vec![error.to_string()],
    };
    let wants = &read.offers;
    let faults = read.all_faults().iter().map(ToString::to_string);
    let errors = (0..read.images.len()).filter_map(|image| Some(read.read(image, wants).err()?.to_string()));
    faults.chain(errors).collect()
}

#[test]
fn what_is_damaged_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let root = |kind: &str| folder.path().join(kind);
    for (kind, options) in [
        ("webdataset", ""),
        ("npz", ""),
        ("jsonl", "include = [\"visible_mask\", \"amodal_mask\", \"visible_box\", \"occlusion_order\"]"),
    ] {
        written(&root(kind), kind, options);
        let data = if kind == "jsonl" { "data.jsonl" } else { "data" };
        assert_eq!(said(&root(kind).join(data), kind), [""; 0], "{kind}");
    }
    let damage = |path: &Path, change: &dyn Fn(Vec<u8>) -> Vec<u8>| {
        let bytes = std::fs::read(path).expect("readable");
        std::fs::write(path, change(bytes)).expect("writable");
    };
    let holds = |said: Vec<String>, parts: &[&str]| {
        assert!(said.iter().any(|line| parts.iter().all(|part| line.contains(part))), "{parts:?}: {said:?}");
    };
    let half = |bytes: Vec<u8>| bytes[..bytes.len() / 2].to_vec();

    damage(&root("webdataset").join("data/data-000001.tar"), &half);
    holds(said(&root("webdataset").join("data"), "webdataset"), &["data-000001.tar", "the tar file ends within"]);
    damage(&root("webdataset").join("data/categories.json"), &|_| b"[{\"id\": \"x\"}]".to_vec());
    holds(said(&root("webdataset").join("data"), "webdataset"), &["categories.json"]);

    damage(&root("npz").join("data/000001_0000.npz"), &half);
    std::fs::remove_file(root("npz").join("data/000002_0001.npz")).expect("there");
    holds(said(&root("npz").join("data"), "npz"), &["000001_0000.npz", "not a readable NumPy archive"]);

    let lines = root("jsonl").join("data.jsonl");
    damage(&lines, &|bytes| {
        let text = String::from_utf8(bytes).expect("UTF-8");
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        lines[1].truncate(80);
        lines[2] = lines[2].replace("\"counts\":\"", "\"counts\":\"!");
        lines[3] = lines[3].replace("visible_box", "visible_bix");
        lines.push(lines[0].clone());
        lines.join("\n").into_bytes()
    });
    let said = said(&lines, "jsonl");
    for parts in [
        &["line 2", "the line is not read"][..],
        &["mask per instance"],
        &["it has no field `visible_box`, which others have"],
        &["that one counts"],
    ] {
        holds(said.clone(), parts);
    }
}

/// The first image of a modified dataset, or the reason why it cannot be read.
fn first(root: &Path, kind: &str, wants: &[KeyId]) -> Result<Products> {
    let (_, read) = open_dataset(root, Some(kind))?;
    assert!(wants.iter().all(|key| read.offers.contains(key)), "{:?}", read.offers);
    read.read(0, wants).map(|image| image.products)
}

#[test]
fn orders_and_bits_need_the_instances_that_they_are_of() {
    let folder = tempfile::tempdir().expect("a folder");
    let takes =
        written(folder.path(), "npz", "include = [\"rgb\", \"visible_ids\", \"occlusion_order\", \"amodal_bits\"]");
    let read = opened(folder.path(), "npz");
    for key in keys![OCCLUSION_ORDER, AMODAL_BITS, AMODAL_MASK] {
        assert!(!read.offers.contains(&key), "{}", key);
    }
    let visible = first(&folder.path().join("data"), "npz", &[VISIBLE_MASK.id()]).expect("readable");
    let shown = takes[0].views[0].1.get(VISIBLE_MASK).expect("made");
    let shown: Vec<_> = shown.iter().filter(|(_, mask)| !mask.is_empty()).collect();
    assert!(visible.get(VISIBLE_MASK).expect("there").iter().eq(shown));

    // In JSON, bits are lists, and the size of an image is known only from its masks.
    let folder = tempfile::tempdir().expect("a folder");
    let options = "include = [\"visible_mask\", \"amodal_bits\", \"category_id\", \"occlusion_order\"]";
    let takes = written(folder.path(), "jsonl", options);
    let found =
        first(folder.path(), "jsonl", &[AMODAL_MASK.id(), AMODAL_BITS.id(), OCCLUSION_ORDER.id()]).expect("readable");
    let made = &takes[0].views[0].1;
    assert!(found.get(AMODAL_MASK).expect("there") == made.get(AMODAL_MASK).expect("made"));
    assert!(found.get(OCCLUSION_ORDER).expect("there") == made.get(OCCLUSION_ORDER).expect("made"));
    let Value::Tensor(bits) = found.value("amodal_bits").expect("there") else { panic!("no array") };
    assert_eq!(bits.dtype, syntable_model::product::DType::U8);
}

#[test]
fn ids_ascend_and_masks_are_of_the_image() {
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "jsonl", "include = [\"visible_mask\", \"amodal_mask\"]");
    let path = folder.path().join("data.jsonl");
    let of = |visible: &str, amodal: &str| {
        let line = format!("{{\"scene\":0,\"view\":0,\"visible_mask\":{visible},\"amodal_mask\":{amodal}}}\n");
        std::fs::write(&path, line).expect("writable");
        first(&path, "jsonl", &[VISIBLE_MASK.id(), OCCLUSION_RATE.id()])
    };
    let mask = "{\"size\":[2,2],\"counts\":[4]}";
    assert!(of(&format!("{{\"1\":{mask}}}"), &format!("{{\"1\":{mask}}}")).is_ok());
    let other = "{\"1\":{\"size\":[4.0,1.0],\"counts\":[4]}}";
    let error = of(&format!("{{\"1\":{mask}}}"), other).err().expect("another size").to_string();
    assert!(error.contains("has 1 × 4 pixels, the image 2 × 2"), "{error}");
    let error = of(&format!("{{\"0\":{mask}}}"), &format!("{{\"0\":{mask}}}")).err().expect("no instance").to_string();
    assert!(error.contains("`visible_mask` is no mask per instance"), "{error}");
    for (ids, reason) in
        [(&[7_u16, 2][..], "ascending"), (&[2, 2], "ascending"), (&[0, 1], "ascending"), (&[3], "2 values")]
    {
        let ids = Plane::from_vec(ids.len() as u32, 1, ids.to_vec());
        let Value::Tensor(mut ids) = Value::from(ids) else { panic!("no array") };
        ids.shape.remove(0);
        let Value::Tensor(mut values) = Value::from(Plane::from_vec(2, 1, vec![0.5_f64, 1.0])) else {
            panic!("no array")
        };
        values.shape.remove(0);
        let error = syntable_formats::samples::instances(&values, &ids).expect_err("refused");
        assert!(error.contains(reason), "{error}");
    }
}

#[test]
fn categories_match_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "webdataset", "");
    let root = folder.path().join("data");
    let categories = |text: &str| {
        std::fs::write(root.join("categories.json"), text).expect("writable");
        let (_, read) = open_dataset(&root, None).expect("a dataset");
        let found = read.read(0, &[CATEGORY_ID.id()]).expect("readable").products;
        let ids: std::collections::BTreeSet<u32> =
            found.get(CATEGORY_ID).expect("there").iter().map(|it| *it.1).collect();
        let name = |id: u32| read.info.category(id).map_or_else(|error| error.to_string(), |it| it.1.to_owned());
        let faults =
            (0..read.images.len()).flat_map(|image| read.image_faults(image)).count() + read.all_faults().len();
        (ids.into_iter().map(name).collect::<Vec<String>>(), faults)
    };
    // Ids of the first image are 1 to 3.
    let named = r#"[{"id": 1, "name": "object"}, {"id": 2, "name": "mug"}, {"id": 3, "name": "bowl"}]"#;
    assert_eq!(categories(named), (["object", "mug", "bowl"].map(String::from).to_vec(), 0));
    let (names, faults) = categories(r#"[{"id": 1, "name": "mug"}, {"id": 2, "name": "bowl"}]"#);
    assert!(names == ["mug", "bowl", "object"] && faults > 5, "{names:?} {faults}");
    let (names, _) = categories(r#"[{"id": 0, "name": "pan"}, {"id": 1, "name": "mug"}, {"id": 2, "name": "bowl"}]"#);
    assert_eq!(names, ["object", "bowl", "mug"], "numbered anew, as 0 is the background in maps");
    // A category that no object uses is not added.
    categories(r#"[{"id": 1, "name": "a"}, {"id": 2, "name": "b"}, {"id": 3, "name": "c"}]"#);
    let (_, read) = open_dataset(&root, None).expect("a dataset");
    assert_eq!(read.info.categories().map(|it| it.1).collect::<Vec<_>>(), ["a", "b", "c"]);
    let (_, faults) = categories(
        r#"[{"id": 1, "name": "a"}, {"id": 1, "name": "b"}, {"id": 2, "name": "c"}, {"id": 3, "name": "d"}]"#,
    );
    assert!(faults > 0, "an id twice");
}

#[test]
fn a_file_of_a_view_is_not_replaced_by_another_one() {
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "npz", "");
    let root = folder.path().join("data");
    std::fs::copy(root.join("000000_0001.npz"), root.join("0_0.npz")).expect("copied");
    std::fs::create_dir(root.join("000009_0000.npz")).expect("writable");
    let said = said(&root, "npz");
    for parts in [&["0_0.npz", "it is view 0 of scene 0"][..], &["000009_0000.npz", "it is not a file"]] {
        assert!(said.iter().any(|line| parts.iter().all(|part| line.contains(part))), "{parts:?}: {said:?}");
    }
}

/// A dataset of a specific layout takes precedence over datasets of plain products.
#[test]
fn a_layout_outranks_other_datasets() {
    let folder = tempfile::tempdir().expect("a folder");
    let root = folder.path();
    let elsewhere = tempfile::tempdir().expect("a folder");
    written(elsewhere.path(), "npz", "");
    std::fs::rename(elsewhere.path().join("data"), root.join("arrays")).expect("moved");
    written(&root.join("lines"), "jsonl", "");
    assert!(
        registry()
            .find_dataset(&reader::Source::new(root), None)
            .err()
            .expect("two of products")
            .to_string()
            .contains("2 datasets")
    );
    written(&root.join("ours"), "syntable", "");
    let (format, _) = registry().find_dataset(&reader::Source::new(root), None).expect("one of a layout");
    assert_eq!(format.name(), "syntable");
    // The same holds within one folder.
    let ours = root.join("ours");
    std::fs::copy(root.join("arrays/000000_0000.npz"), ours.join("000000_0000.npz")).expect("copied");
    assert_eq!(
        registry().find_dataset(&reader::Source::new(&ours), None).expect("one of a layout").0.name(),
        "syntable"
    );
}
