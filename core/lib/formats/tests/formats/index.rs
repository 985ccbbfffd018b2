//! Records that are read one by one equal records that are read at once, and JPEG files decode as in Pillow.

use serde_json::{Value as Json, json};
use std::fs;
use std::path::Path;
use std::sync::OnceLock;
use syntable_formats::coco::{CocoAnnotation, CocoImage};
use syntable_formats::dataset::CocoDataset;
use syntable_formats::dataset::JsonLayout;
use syntable_formats::decode;
use syntable_formats::index::{Indexed, IndexedRecord, RecordSection};
use syntable_formats::listing::AnnotationListing;
use syntable_model::error::{Error, Place};
use syntable_model::random::Stream;
use syntable_testing::tools::python_with;

fn annotation(id: u64, image: u64, text: &str) -> Json {
    json!({ "id": id, "image_id": image, "category_id": 1, "area": 1.5, "bbox": [0, 0, 1, 1], "note": text,
            "segmentation": [[0.5, 0.5, 3.25, 0.5, 3.0, 2.0]], "deep": { "list": [{}, [], "]}"] } })
}

/// Files with the same records in different layouts.
fn files() -> Vec<String> {
    let images: Vec<Json> =
        (1..4).map(|id| json!({ "id": id, "file_name": format!("{id}.png"), "width": 4, "height": 3 })).collect();
    let texts = ["", "ä\"}]{[", "a\\u0041\\", "line\nbreak", ","];
    let annotations: Vec<Json> = (0..10).map(|i| annotation(i + 1, i * 7 % 3 + 1, texts[i as usize % 5])).collect();
    let json = json!({ "info": { "year": 3 }, "images": images, "categories": [{ "id": 1, "name": "x" }],
                       "annotations": annotations, "more": [1, { "annotations": [] }] });
    let dataset: CocoDataset = serde_json::from_value(json.clone()).expect("a dataset");
    let written = |layout| {
        let mut out = Vec::new();
        dataset.write(&mut out, "a.json", layout).expect("written");
        String::from_utf8(out).expect("UTF-8")
    };
    let spread = json.to_string().replace("},{", "}\t\n , \r\n{").replace(":[{", ": [ \n {").replace("}],", "} \n],");
    let turned = format!(
        "{{\"annotations\": {}, \"images\": {}, \"categories\": {}}}",
        json["annotations"], json["images"], json["categories"]
    );
    vec![written(JsonLayout::Lines), written(JsonLayout::Indented), json.to_string(), spread, turned]
}

#[test]
fn records_match_the_whole_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.json");
    let mut stream = Stream::root(2);
    for text in files() {
        fs::write(&path, &text).expect("writable");
        let whole = CocoDataset::read(&path).expect("reads");
        let (mut images, mut annotations) = (Vec::new(), Vec::new());
        let index = Indexed::open(&path, &mut |record: IndexedRecord<CocoImage, CocoAnnotation, Json>| match record {
            IndexedRecord::Image(image) => images.push(image),
            IndexedRecord::Annotation(annotation) => annotations.push(annotation),
            IndexedRecord::Scene(_) => panic!("there is none"),
        })
        .expect("opens");
        assert_eq!((&images, &annotations), (&whole.images, &whole.annotations));
        assert_eq!((index.len(RecordSection::Images), index.len(RecordSection::Annotations)), (3, 10));
        assert!(index.is_empty(RecordSection::Scenes));
        assert_eq!(index.categories.as_ref(), Some(&whole.categories));
        for _ in 0..30 {
            let mut numbers: Vec<u32> = (0..10).filter(|_| stream.below(2) == 0).collect();
            if stream.below(3) == 0 {
                numbers.reverse();
            }
            let want: Vec<CocoAnnotation> = numbers.iter().map(|&i| whole.annotations[i as usize].clone()).collect();
            assert_eq!(index.records::<CocoAnnotation>(RecordSection::Annotations, &numbers).expect("reads"), want);
        }
        assert_eq!(index.records::<CocoImage>(RecordSection::Images, &[2]).expect("reads"), whole.images[2..]);
        assert!(
            index
                .records::<CocoImage>(RecordSection::Images, &[3])
                .expect_err("none")
                .to_string()
                .contains("`images[3]`")
        );
        let listing = AnnotationListing::open(&path, &mut |_: &IndexedRecord<CocoImage, CocoAnnotation, Json>| {})
            .expect("opens");
        for (number, image) in listing.images.iter().enumerate() {
            let want = whole.annotations.iter().filter(|it| it.image_id == image.frame.id).cloned().collect::<Vec<_>>();
            assert_eq!(listing.annotations::<CocoAnnotation>(number).expect("reads"), want);
            assert_eq!(listing.image::<CocoImage>(number).expect("reads").id, image.frame.id);
        }
    }
}

#[test]
fn mistakes_are_where_the_whole_file_has_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.json");
    let good = files().remove(1);
    for (from, to) in [
        ("\"image_id\": 2", "\"image_id\": \"2\""),
        ("\"annotations\": [", "\"annotations\": 3, \"x\": ["),
        ("\"images\"", "\"photos\""),
        ("\"width\": 4", "\"size\": 4"),
        ("\"category_id\": 1,", "\"category_id\": 1"),
    ] {
        assert!(good.contains(from), "{from}");
        fs::write(&path, good.replacen(from, to, 1)).expect("writable");
        let whole = CocoDataset::read(&path).expect_err("refused");
        let indexed =
            Indexed::open(&path, &mut |_: IndexedRecord<CocoImage, CocoAnnotation, Json>| {}).expect_err("refused");
        let bare = |text: &str| text.replace("a sequence", "a list of records");
        assert_eq!(indexed.place(), whole.place(), "{from}");
        assert_eq!(bare(indexed.message()), bare(whole.message()), "{from}");
    }
    for word in ["NaN", "Infinity", "-Infinity"] {
        fs::write(&path, good.replacen("\"category_id\": 1,", &format!("\"category_id\": {word},"), 1))
            .expect("writable");
        let expected = format!("{word} is no number of JSON; write a number or `null`");
        let indexed =
            Indexed::open(&path, &mut |_: IndexedRecord<CocoImage, CocoAnnotation, Json>| {}).expect_err("refused");
        for error in [indexed, CocoDataset::read(&path).expect_err("refused")] {
            assert!(error.message().contains(&expected) && error.message().contains("category_id"), "{error}");
        }
    }
    let cut = &good[..good.len() / 2];
    fs::write(&path, cut).expect("writable");
    let error = Indexed::open(&path, &mut |_: IndexedRecord<CocoImage, CocoAnnotation, Json>| {}).expect_err("refused");
    assert!(error.to_string().contains("EOF while parsing") && !error.is_io(), "{error}");
    let missing = Indexed::open(folder.path().join("b"), &mut |_: IndexedRecord<CocoImage, CocoAnnotation, Json>| {});
    assert!(missing.expect_err("missing").is_io());
}

/// Records of all lengths, up to several times the part of a file that is read at once.
#[test]
fn long_records_match_the_whole_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.json");
    let mut stream = Stream::root(3);
    for round in 0..12_u64 {
        let lengths = [40, 4_000, 400_000, 1 << 18].map(|length| length + round as usize);
        let annotations: Vec<Json> = (0..40)
            .map(|i| annotation(i + 1, i % 3 + 1, &"é\\\"x".repeat(lengths[stream.below(4) as usize] / 5)))
            .collect();
        let images: Vec<Json> =
            (1..4).map(|id| json!({ "id": id, "file_name": format!("{id}.png"), "width": 4, "height": 3 })).collect();
        let json = json!({ "images": images, "categories": [], "annotations": annotations });
        fs::write(&path, json.to_string()).expect("writable");
        let whole = CocoDataset::read(&path).expect("reads");
        let mut read = Vec::new();
        let index = Indexed::open(&path, &mut |record: IndexedRecord<CocoImage, CocoAnnotation, Json>| {
            if let IndexedRecord::Annotation(annotation) = record {
                read.push(annotation);
            }
        })
        .expect("opens");
        assert!(read == whole.annotations, "round {round}");
        let numbers: Vec<u32> = (0..40).rev().collect();
        let records = index.records::<CocoAnnotation>(RecordSection::Annotations, &numbers).expect("reads");
        assert!(records.into_iter().rev().eq(whole.annotations), "round {round}");
    }
}

fn line(error: &Error) -> usize {
    match error.place() {
        Some(Place::Line(line)) => line,
        place => panic!("{place:?} of {error}"),
    }
}

/// A byte is changed, removed or added at random.
#[test]
fn damage_is_found_where_the_whole_file_has_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.json");
    let mut stream = Stream::root(4);
    let mut refused = 0;
    for (round, text) in files().iter().cycle().take(3_000).enumerate() {
        let mut bytes = text.clone().into_bytes();
        let at = stream.below(bytes.len() as u64) as usize;
        let others = b"{}[],:\"0a-. \n\\";
        let other = others[stream.below(others.len() as u64) as usize];
        match stream.below(3) {
            0 => bytes[at] = other,
            1 => drop(bytes.remove(at)),
            _ => bytes.insert(at, other),
        }
        if round % 20 == 0 {
            // The first read of an index ends within the text.
            let space = (1 << 18) - stream.below(text.len() as u64) as usize;
            bytes.splice(0..0, (0..space).map(|at| if at % 1000 == 0 { b'\n' } else { b' ' }));
        }
        fs::write(&path, &bytes).expect("writable");
        let whole = CocoDataset::read(&path);
        let indexed = Indexed::open(&path, &mut |_: IndexedRecord<CocoImage, CocoAnnotation, Json>| {});
        // An index needs no categories, and reads no licenses.
        let is_unread = |error: &Error| ["categories", "licenses"].iter().any(|it| error.message().contains(it));
        let text = String::from_utf8_lossy(&bytes);
        let text = text.trim_start();
        match (whole, indexed) {
            (Ok(_), Ok(_)) => {}
            (Err(whole), Ok(_)) if is_unread(&whole) => {}
            (Err(whole), Err(indexed)) => {
                refused += 1;
                let bare = |text: &str| {
                    let text = text.replace("a sequence", "a list of records");
                    let text = text.replace(
                        "struct AnnotationDataset",
                        "an annotation file: an object with `images` and `annotations`",
                    );
                    // An index does not know the fields of other sections.
                    let is_of_other = ["`info", "`licenses", "`more"].iter().any(|section| text.starts_with(section));
                    let of_other = text.split_once("`: ").filter(|_| is_of_other);
                    of_other.map_or_else(|| text.clone(), |(_, what)| what.to_owned())
                };
                assert_eq!(bare(indexed.message()), bare(whole.message()), "round {round}: {text}");
                // The parser of the whole file names the line after a wrong line break.
                let lines = [&indexed, &whole].map(line);
                assert!(lines[1] == lines[0] || lines[1] == lines[0] + 1, "round {round}: {lines:?} {whole}: {text}");
            }
            (whole, indexed) => panic!("round {round}: {:?} {:?}: {text}", whole.err(), indexed.err()),
        }
    }
    assert!(refused > 1_000, "{refused}");
}

#[test]
fn jpeg_files_match_pillow() {
    static HERE: OnceLock<bool> = OnceLock::new();
    let folder = tempfile::tempdir().expect("a folder");
    let script = folder.path().join("write.py");
    let code = "import sys, pathlib, numpy as np\nfrom PIL import Image\nroot = pathlib.Path(sys.argv[1])\n\
                y, x = np.mgrid[:40, :56]\nrgb = np.stack([4 * x, 6 * y, 255 - 4 * x], -1).astype(np.uint8)\n\
                Image.fromarray(rgb).save(root / 'color.jpg', quality=95)\n\
                Image.fromarray(rgb[..., 0]).save(root / 'gray.jpg', quality=95)\n\
                for name in 'color', 'gray':\n\
                \x20   pixels = np.asarray(Image.open(root / f'{name}.jpg').convert('RGB'))\n\
                \x20   (root / f'{name}.raw').write_bytes(pixels.tobytes())\n";
    fs::write(&script, code).expect("writable");
    if !python_with("numpy, PIL", &HERE, &script, &[folder.path().to_str().expect("UTF-8")]) {
        return;
    }
    let path = |name: &str| folder.path().join(name);
    for name in ["color", "gray"] {
        let read = decode::rgb(&path(&format!("{name}.jpg"))).expect("reads");
        let want = fs::read(path(&format!("{name}.raw"))).expect("there");
        assert_eq!((read.width(), read.height(), 3 * read.data().len()), (56, 40, want.len()));
        let differ = read.data().as_flattened().iter().zip(&want).map(|(a, b)| a.abs_diff(*b)).max();
        // Decoders round the inverse transform in different ways.
        assert!(differ <= Some(4), "{name}: {differ:?}");
    }
    broken(&path("color.jpg"));
}

fn broken(path: &Path) {
    let bytes = fs::read(path).expect("there");
    for length in [3, 20, bytes.len() / 2] {
        fs::write(path, &bytes[..length]).expect("writable");
        let error = decode::rgb(path).expect_err("refused");
        assert!(error.is_permanent() && error.to_string().contains("not a readable JPEG file"), "{length}: {error}");
    }
}
