//! `stats` counts the content of a dataset: the same in every format that keeps masks, and equal to the reference
//! counts.

use crate::support::{fails, ok, small_dataset, syntable};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// A small dataset that all tests share: in SynTable's layout and as BOP, and converted to other formats.
fn data() -> PathBuf {
    static DATASET: OnceLock<tempfile::TempDir> = OnceLock::new();
    let make = || {
        let folder = tempfile::tempdir().expect("a folder");
        small_dataset(&folder.path().join("data"), &["dataset.views_per_scene=3", "write={ syntable = {}, bop = {} }"]);
        folder
    };
    DATASET.get_or_init(make).path().join("data")
}

fn syntable_folder() -> PathBuf {
    let folders = [data(), data().join("syntable")];
    folders.into_iter().find(|it| it.join("annotation_final.json").is_file()).expect("an annotation file")
}

fn stats(datasets: &[&Path], more: &[&str]) -> Value {
    let said = ok(syntable().arg("stats").args(datasets).arg("--json").args(more));
    serde_json::from_str(&said).expect("JSON")
}

/// A dataset in another format.
fn converted(out: &Path, to: &str, set: &[&str]) -> PathBuf {
    let mut convert = crate::support::convert(&syntable_folder(), to, out);
    for set in set {
        convert.args(["--set", set]);
    }
    crate::support::made(&mut convert);
    Some(out.join(to)).filter(|inner| inner.is_dir()).unwrap_or_else(|| out.to_owned())
}

fn distribution<'a>(dataset: &'a Value, name: &str) -> &'a Value {
    let all = dataset["distributions"].as_array().expect("a list");
    all.iter().find(|it| it["name"] == name).unwrap_or_else(|| panic!("no {name} in {dataset}"))
}

#[test]
fn numbers_match_the_annotation_file() {
    let found = stats(&[&syntable_folder()], &[]);
    let of = &found["datasets"][0];
    let text = fs::read_to_string(syntable_folder().join("annotation_final.json")).expect("readable");
    let file: Value = serde_json::from_str(&text).expect("JSON");
    let annotations = file["annotations"].as_array().expect("a list");
    let number = |it: &Value, key: &str| it[key].as_u64().expect("a number");
    let sum = |key: &str| annotations.iter().map(|it| number(it, key)).sum::<u64>();
    let totals = &of["totals"];
    assert_eq!(totals["images"], json!(file["images"].as_array().expect("a list").len()));
    assert_eq!(totals["visible_instances"], json!(annotations.len()));
    let occluded = annotations.iter().filter(|it| number(it, "occluded_area") > 0).count();
    assert_eq!(totals["occluded_instances"], json!(occluded));
    assert_eq!([&totals["amodal_px"], &totals["occluded_px"]], [&json!(sum("area")), &json!(sum("occluded_area"))]);
    let rate = sum("occluded_area") as f64 / sum("area") as f64;
    assert!((totals["average_occlusion_rate"].as_f64().expect("a rate") - rate).abs() < 1e-12);
    let mut names: Vec<&str> = annotations.iter().map(|it| it["object"]["asset"].as_str().expect("a name")).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(totals["objects"], json!(names.len()));
    // A dataset of a run has all quantities, and no duplicate views.
    assert_eq!(of["distributions"].as_array().expect("a list").len(), 15);
    assert_eq!((of["unknown"].clone(), of["near_duplicates"]["views"].clone()), (json!([]), json!(0)));
    let images = file["images"].as_array().expect("a list").len() as u64;
    assert_eq!(number(distribution(of, "depth"), "n"), images * 160 * 120);
    assert_eq!(number(distribution(of, "brightness"), "n"), images);
}

#[test]
fn numbers_match_numpy() {
    let folder = tempfile::tempdir().expect("a folder");
    // Compared with a dataset of fewer objects.
    let other = folder.path().join("other");
    ok(&mut crate::support::small_run(&other, &["--set", "dataset.scenes=2"]));
    let printed = folder.path().join("statistics.json");
    fs::write(&printed, stats(&[&syntable_folder(), &other], &[]).to_string()).expect("writable");
    let arguments = [syntable_folder().display().to_string(), printed.display().to_string()];
    let script = crate::support::root().join("tests/check_statistics.py");
    syntable_testing::tools::python(&script, &arguments.each_ref().map(String::as_str));
}

#[test]
fn formats_have_the_same_numbers() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let ours = syntable_folder();
    let coco = converted(&at("coco"), "coco", &[]);
    let release = converted(&at("release"), "syntable", &["syntable.compat=\"syntable_1\""]);
    let cocoa = converted(&at("cocoa"), "cocoa", &[]);
    let bop = data().join("bop");
    let all = stats(&[&ours, &coco, &release, &cocoa, &bop], &["--labels-only"]);
    let datasets = all["datasets"].as_array().expect("a list");
    let labels = ["occlusion_rate", "objects_per_view", "component_size", "components_per_view", "depth_layers"];
    for of in &datasets[1..] {
        let name = &of["dataset"];
        for key in ["images", "visible_instances", "occluded_instances", "amodal_px", "occluded_px", "edges", "scenes"]
        {
            assert_eq!(of["totals"][key], datasets[0]["totals"][key], "{key} of {name}");
        }
        assert_eq!(of["layers"], datasets[0]["layers"], "{name}");
        for quantity in labels.iter().chain(&["object_area"]) {
            assert_eq!(distribution(of, quantity), distribution(&datasets[0], quantity), "{name}");
        }
    }
    for apart in all["distances"].as_array().expect("a list") {
        for it in apart["quantities"].as_array().expect("a list") {
            let is_far = |value: &Value| value.as_f64().is_some_and(|value| value.abs() > 1e-3);
            assert!(!is_far(&it["wasserstein_1"]) && !is_far(&it["jensen_shannon"]), "{}: {it}", apart["to"]);
        }
    }
    // BOP has poses, in millimeters; COCO has neither poses nor assets. The boxes of our objects are centered.
    let mean = |of: &Value, name: &str| distribution(of, name)["mean"].as_f64().expect("a mean");
    let apart = mean(&datasets[0], "object_distance") - mean(&datasets[4], "object_distance");
    assert!(apart.abs() < 1e-3, "{apart}");
    assert_eq!((&datasets[1]["totals"]["objects"], &datasets[1]["assets"]), (&Value::Null, &Value::Null));
    let unknown = datasets[1]["unknown"].to_string();
    assert!(["no names", "no poses"].iter().all(|part| unknown.contains(part)), "{unknown}");
}

#[test]
fn copies_of_views_are_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let coco = converted(&folder.path().join("coco"), "coco", &[]);
    let mut images: Vec<PathBuf> = crate::support::files(&coco)
        .into_keys()
        .filter(|name| name.ends_with(".png"))
        .map(|name| coco.join(name))
        .collect();
    images.sort();
    fs::copy(&images[0], &images[1]).expect("copied");
    fs::copy(&images[0], images.last().expect("images")).expect("copied");
    let found = stats(&[&coco], &[]);
    let duplicates = &found["datasets"][0]["near_duplicates"];
    assert_eq!((&duplicates["views"], &duplicates["redundant"]), (&json!(3), &json!(2)), "{duplicates}");
    assert_eq!(duplicates["groups"].as_array().expect("a list").len(), 1);
    let said = ok(syntable().arg("stats").arg(&coco));
    assert!(said.contains("3 in 1 group, 0 within a scene"), "{said}");
}

#[test]
fn tables_and_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let (ours, csv) = (syntable_folder(), folder.path().join("each.csv"));
    let said = ok(syntable().arg("stats").arg(&ours).arg("--csv").arg(&csv).args(["--threads", "1"]));
    for part in ["#VI", "avg. OR", "occlusion rate", "object distance, m", "layers, %", "seen", "read as syntable"] {
        assert!(said.contains(part), "{part}:\n{said}");
    }
    assert_eq!(ok(syntable().arg("stats").arg(&ours).args(["--threads", "3"])), said);
    let lines = fs::read_to_string(&csv).expect("readable");
    let images = stats(&[&ours], &["--labels-only"])["datasets"][0]["totals"]["images"].as_u64().expect("a number");
    assert_eq!(lines.lines().count() as u64, 1 + images);
    let equal = stats(&[&ours], &["--labels-only", "--bins", "equal"]);
    let rates = distribution(&equal["datasets"][0], "occlusion_rate");
    assert_eq!(
        (rates["edges"][0].as_f64(), rates["edges"][10].as_f64()),
        (rates["min"].as_f64(), rates["max"].as_f64())
    );
}

#[test]
fn mistakes_are_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let nowhere = folder.path().join("nowhere");
    assert!(fails(syntable().arg("stats").arg(&nowhere), 2).contains("no such folder or file"));
    let coco = converted(&folder.path().join("coco"), "coco", &[]);
    let said = fails(syntable().arg("stats").arg(&coco).args(["--format", "nothing"]), 2);
    assert!(said.contains("unknown dataset format `nothing`"), "{said}");
    // Labels can be counted without the images.
    let name = crate::support::files(&coco).into_keys().find(|name| name.ends_with(".png")).expect("an image");
    fs::remove_file(coco.join(&name)).expect("removed");
    let said = fails(syntable().arg("stats").arg(&coco), 2);
    let file = Path::new(&name).file_name().expect("a name").to_string_lossy().into_owned();
    assert!(said.contains(&file) && said.contains("--labels-only"), "{said}");
    ok(syntable().arg("stats").arg(&coco).arg("--labels-only"));
    // An unreadable image, and a file that cannot be written.
    let annotations = coco.join("annotations/instances_train.json");
    let broken = fs::read_to_string(&annotations).expect("readable").replacen("\"counts\":\"", "\"counts\":\"!", 1);
    fs::write(&annotations, broken).expect("writable");
    let said = fails(syntable().arg("stats").arg(&coco).arg("--labels-only"), 2);
    assert!(said.contains("image \"") && said.contains("annotation "), "{said}");
    let csv = nowhere.join("each.csv");
    let said = fails(syntable().arg("stats").arg(syntable_folder()).arg("--labels-only").arg("--csv").arg(&csv), 2);
    assert!(said.contains("each.csv"), "{said}");
}

/// Photographs have a look and no labels.
#[test]
fn datasets_are_compared_with_photographs() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, code) in [("a", 51), ("b", 102)] {
        let plain = image::RgbImage::from_pixel(40, 30, image::Rgb([code; 3]));
        plain.save(folder.path().join(format!("{name}.png"))).expect("written");
    }
    let found = stats(&[folder.path(), &syntable_folder()], &[]);
    let photographs = &found["datasets"][0];
    assert_eq!(photographs["format"], "photographs", "{photographs}");
    let names: Vec<&str> = photographs["distributions"]
        .as_array()
        .expect("a list")
        .iter()
        .map(|it| it["name"].as_str().expect("a name"))
        .collect();
    assert_eq!(names, ["brightness", "contrast", "saturation", "warmth", "edges", "detail"]);
    // 51 and 102 of 255.
    let mean = distribution(photographs, "brightness")["mean"].as_f64().expect("a number");
    assert!((mean - 0.3).abs() < 1e-12, "{mean}");
    assert!(found.to_string().contains("wasserstein"), "{found}");
}
