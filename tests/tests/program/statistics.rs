//! The script that recomputes the statistics of the SynTable paper.

use crate::support::{ok, root, skip};
use serde_json::json;
use std::process::Command;

fn python() -> Option<&'static str> {
    let has = |python: &str| {
        Command::new(python).args(["-c", "import pycocotools"]).output().is_ok_and(|output| output.status.success())
    };
    let found = ["python", "python3"].into_iter().find(|python| has(python));
    if found.is_none() {
        skip("pycocotools");
    }
    found
}

/// A mask in COCO's run lengths, uncompressed: 8 × 8 pixels, with the first `count` set, column by column.
fn mask(count: u32) -> String {
    // COCO's string of the runs 0, count, 64 - count: five bits per character, lowest first. Only the fourth and later
    // runs are stored as differences.
    let mut text = String::new();
    for mut x in [0, i64::from(count), 64 - i64::from(count)] {
        loop {
            let mut c = x & 0x1f;
            x >>= 5;
            let more = if c & 0x10 != 0 { x != -1 } else { x != 0 };
            if more {
                c |= 0x20;
            }
            text.push(char::from(u8::try_from(c + 48).expect("ASCII")));
            if !more {
                break;
            }
        }
    }
    text
}

#[test]
fn columns_match_the_paper() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    // Scene 0 with two views, scene 1 with one. Amodal and hidden pixels of each record.
    let records: [(u32, u32, u32); 5] = [(1, 40, 10), (1, 20, 0), (2, 30, 20), (3, 8, 0), (3, 2, 0)];
    let rle = |count: u32| json!({ "size": [8, 8], "counts": mask(count) });
    let annotations: Vec<_> = records
        .iter()
        .map(|&(image, amodal, hidden)| {
            json!({ "image_id": image, "segmentation": rle(amodal), "visible_mask": rle(amodal - hidden),
                    "occluded_mask": rle(hidden) })
        })
        .collect();
    let images = [(1, "0_0"), (2, "0_1"), (3, "1_0")]
        .map(|(id, stem)| json!({ "id": id, "file_name": format!("data/mono/rgb/{stem}.png") }));
    let data = json!({ "images": images, "annotations": annotations });
    std::fs::write(folder.path().join("annotation_final.json"), data.to_string()).expect("writable");
    let table = ok(Command::new(python).arg(root().join("tests/statistics.py")).arg("dataset").arg(folder.path()));
    let row: Vec<&str> = table.lines().last().expect("a row").split_whitespace().collect();
    let numbers: Vec<f64> = row.iter().filter_map(|word| word.trim_start_matches("+-").parse().ok()).collect();
    // 5 records in 3 images; 2 of 5 occluded; 30 of 100 pixels hidden; 100 pixels in 5 records.
    let [per_image, _, occluded, _, rate, _, area, _] = numbers[..] else { panic!("{table}") };
    assert_eq!((per_image, occluded, rate, area), (1.7, 0.4, 0.3, 20.0), "{table}");
    // The published numbers in the table match Table 1.
    assert!(table.contains("14.6") && table.contains("0.668") && table.contains("0.179"), "{table}");
}
