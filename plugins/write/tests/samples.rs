//! What writers of products write is read back: each product equal to what was written, and the labels that follow from it.

mod common;

use std::path::Path;
use syntable_model::prelude::*;
use syntable_model::product::standard::*;
use syntable_model::reader;
use syntable_testing::read_back::{assert_products, classes, opened, written};

/// Labels that follow from planes of ids and bits, or from masks.
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
        ("jsonl", format!("include = [{masks}, {more}, \"rgb\", \"depth\", \"camera\", \"bodies\"]")),
        ("jsonl", format!("include = [{masks}, \"depth\", \"bodies\", \"camera\"]\nper = \"scene\"")),
    ];
    for (kind, options) in &cases {
        let folder = tempfile::tempdir().expect("a folder");
        let takes = written(folder.path(), kind, options);
        let read = opened(folder.path(), kind);
        let offers = read.offers();
        assert!(labels().iter().all(|key| offers.contains(key)), "{kind} {options}: {offers:?}");
        // Lines have no names of categories.
        if *kind != "jsonl" {
            assert_eq!(read.info().categories().collect::<Vec<_>>(), classes().categories().collect::<Vec<_>>());
        }
        assert!(assert_products(&*read, &takes, true, |_, value| value) > 60, "{kind} {options}");
    }
}

/// Cut off and changed anywhere, a dataset has faults or other values, and nothing panics.
#[test]
fn nothing_that_is_read_panics() {
    let masks = "include = [\"visible_mask\", \"amodal_mask\", \"visible_box\", \"occlusion_order\", \"camera\"]";
    for (kind, options, file) in [
        ("webdataset", "", "data/data-000000.tar"),
        ("npz", "compress = false", "data/000000_0001.npz"),
        ("jsonl", masks, "data.jsonl"),
        ("npz", "", "data/categories.json"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), kind, options);
        let path = folder.path().join(file);
        let bytes = std::fs::read(&path).expect("readable");
        let mut stream = Stream::root(5);
        let end = bytes.len() as u64;
        for step in 0..80 {
            let mut changed = bytes.clone();
            match step % 4 {
                0 => changed.truncate(stream.below(end) as usize),
                // Digits give other numbers and shapes where JSON and headers stay what they are.
                1 => {
                    let digits: Vec<usize> = (0..changed.len()).filter(|at| changed[*at].is_ascii_digit()).collect();
                    for _ in 0..6 {
                        changed[digits[stream.below(digits.len() as u64) as usize]] = b'0' + stream.below(10) as u8;
                    }
                }
                _ => (0..8).for_each(|_| changed[stream.below(end) as usize] = stream.below(256) as u8),
            }
            std::fs::write(&path, &changed).expect("writable");
            let Ok((_, read)) = reader::open(folder.path(), Some(kind)).or_else(|_| {
                let within = if kind == "jsonl" { "data.jsonl" } else { "data" };
                reader::open(&folder.path().join(within), Some(kind))
            }) else {
                continue;
            };
            for image in 0..read.images().len() {
                // Masks that do not fit each other would stop it where occlusion is made of them.
                let _ = read.read(image, &read.offers());
            }
        }
    }
}

#[test]
fn each_product_is_read_by_itself() {
    let folder = tempfile::tempdir().expect("a folder");
    let takes = written(folder.path(), "webdataset", "");
    let read = opened(folder.path(), "webdataset");
    for key in read.offers() {
        let (_, found) = read.read(1, &[key]).unwrap_or_else(|error| panic!("{}: {error}", key.name));
        let name = key.name.to_string();
        let want = takes[0].views[1].1.value(&name).expect("written");
        assert!(found.value(&name).expect("there") == want || name == "camera" || name == "amodal_bits", "{name}");
        assert_eq!(found.keys().len(), 1, "{name}");
    }
}

/// What is said of a dataset that was changed: faults of opening, then errors of images.
fn said(root: &Path, kind: &str) -> Vec<String> {
    let read = match reader::open(root, Some(kind)) {
        Ok((_, read)) => read,
        Err(error) => return vec![error.to_string()],
    };
    let wants = read.offers();
    let faults = read.faults().iter().map(|fault| format!("{}: {}", fault.place, fault.message));
    let errors = (0..read.images().len()).filter_map(|image| Some(read.read(image, &wants).err()?.to_string()));
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
