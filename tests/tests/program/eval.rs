//! `eval` scores the results of detectors: known predictions get the scores that the definitions imply.

use crate::support::{fails, ok, root, small_dataset, syntable};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use syntable_formats::scores::MetricScores;
use syntable_model::product::Mask;

/// The folder of a small dataset that all tests share.
fn dataset() -> &'static Path {
    static DATASET: OnceLock<tempfile::TempDir> = OnceLock::new();
    let make = || {
        let folder = tempfile::tempdir().expect("a folder");
        small_dataset(&folder.path().join("data"), &["write={ syntable = {}, osd_amodal = {} }"]);
        folder
    };
    DATASET.get_or_init(make).path()
}

fn data() -> PathBuf {
    dataset().join("data")
}

/// The folder of the writer `syntable`.
fn inner(data: &Path) -> PathBuf {
    let folders = [data.to_owned(), data.join("syntable")];
    folders.into_iter().find(|it| it.join("annotation_final.json").is_file()).expect("an annotation file")
}

fn annotations(data: &Path) -> Value {
    let file = inner(data).join("annotation_final.json");
    serde_json::from_str(&fs::read_to_string(file).expect("readable")).expect("JSON")
}

/// A prediction for each annotation, with its masks.
fn results(annotations: &Value, amodal: bool) -> Vec<Value> {
    let of = |it: &Value| {
        let mut result = json!({
            "image_id": it["image_id"],
            "category_id": it["category_id"],
            "score": 0.9,
            "segmentation": it["visible_mask"],
        });
        if amodal {
            result["amodal_segmentation"] = it["segmentation"].clone();
        }
        result
    };
    annotations["annotations"].as_array().expect("a list").iter().map(of).collect()
}

fn write(folder: &Path, results: &[Value]) -> PathBuf {
    let file = folder.join("results.json");
    // An indented list, so that records span lines.
    fs::write(&file, serde_json::to_string_pretty(results).expect("plain data")).expect("writable");
    file
}

fn scores(pred: &Path, more: &[&str]) -> Value {
    let said = ok(syntable().arg("eval").arg("--gt").arg(data()).arg("--pred").arg(pred).arg("--json").args(more));
    serde_json::from_str(&said).expect("JSON")
}

fn assert_perfect(found: &Value) {
    let scores = found["scores"].as_object().expect("scores");
    assert_eq!(scores.len(), 138);
    // Labels of the release have wrong edges. Shares and the recall of a single prediction are below 100 by definition.
    let may_be_less = |name: &str| name == "acc_oo_release" || name.ends_with("_share") || name.ends_with("_ar1");
    let mut none = 0;
    for (name, value) in scores.iter().filter(|(name, _)| !may_be_less(name)) {
        match value.as_f64() {
            Some(value) => assert!((value - 100.0).abs() < 1e-9, "{name}: {value}"),
            None => none += 1,
        }
    }
    // Undefined scores of empty bins and sizes, and of datasets, which have no prediction scores.
    assert!(none < 90, "{none} of {}", scores.len());
}

/// A copy without COCO's scores, which datasets do not have.
fn without_coco(found: &Value) -> Value {
    let mut found = found.clone();
    let scores = found["scores"].as_object_mut().expect("scores");
    scores.retain(|name, _| !["mask_a", "box_a"].iter().any(|part| name.contains(part)));
    assert_eq!(scores.len(), 90);
    found
}

#[test]
fn perfect_predictions_score_100() {
    let folder = tempfile::tempdir().expect("a folder");
    let all = annotations(&data());
    let any = ["--occluded-from", "0"];
    let itself = scores(&data(), &[]);
    assert_perfect(&itself);
    assert_eq!(scores(&data(), &any), itself);
    assert_eq!(itself["objects"], json!(all["annotations"].as_array().expect("a list").len()));
    let mut predicted = results(&all, true);
    let file = write(folder.path(), &predicted);
    let of_file = scores(&file, &any);
    assert_perfect(&of_file);
    assert!((of_file["scores"]["amodal_mask_ap"].as_f64().expect("scores") - 100.0).abs() < 1e-9);
    assert_eq!(itself["scores"]["amodal_mask_ap"], Value::Null);
    assert_eq!(without_coco(&of_file), without_coco(&itself));
    let by_paper = scores(&file, &[&any[..], &["--convention", "paper"]].concat());
    assert_eq!(by_paper["scores"], of_file["scores"]);
    // By the rule of the release, hardly occluded objects count as occluded only in labels, unless predictions state
    // otherwise.
    let released = scores(&file, &[]);
    let rate = |it: &Value| it["occluded_rate"].as_f64().expect("a rate");
    let rates = all["annotations"].as_array().expect("a list").iter().map(rate);
    let hardly = rates.filter(|rate| *rate > 0.0 && *rate < 0.05).count();
    assert!(hardly > 0);
    let agree = 100.0 * (1.0 - hardly as f64 / predicted.len() as f64);
    assert!((released["scores"]["acc_o"].as_f64().expect("a number") - agree).abs() < 1e-9, "{released}");
    for (result, it) in predicted.iter_mut().zip(all["annotations"].as_array().expect("a list")) {
        result["occluded"] = json!(rate(it) > 0.0);
    }
    assert_eq!(scores(&write(folder.path(), &predicted), &[]), of_file);
    // Uses names instead of ids, occlusion masks instead of amodal masks, and a prediction with a low score, which is
    // ignored.
    let images = all["images"].as_array().expect("a list");
    for (result, it) in predicted.iter_mut().zip(all["annotations"].as_array().expect("a list")) {
        let image = images.iter().find(|image| image["id"] == it["image_id"]).expect("an image");
        // Every other name lacks its folder and has another extension.
        let name = Path::new(image["file_name"].as_str().expect("a name"));
        let stem = name.file_stem().expect("a stem").to_string_lossy();
        let is_odd = it["id"].as_u64().expect("an id") % 2 == 1;
        result["image_id"] = if is_odd { json!(format!("{stem}.jpg")) } else { image["file_name"].clone() };
        let keys = result.as_object_mut().expect("an object");
        assert!(keys.remove("amodal_segmentation").is_some() && keys.remove("occluded").is_some());
        result["occlusion_segmentation"] = it["occluded_mask"].clone();
    }
    let mut low = predicted[0].clone();
    low["score"] = json!(0.2);
    predicted.insert(0, low);
    let file = write(folder.path(), &predicted);
    // With occlusion masks, any hidden pixel makes an object occluded.
    assert_perfect(&scores(&file, &[]));
    assert_eq!(without_coco(&scores(&file, &[])), without_coco(&itself));
    let judged = scores(&file, &["--occluded-from", "0.05"]);
    assert!((judged["scores"]["acc_o"].as_f64().expect("a number") - agree).abs() < 1e-9, "{judged}");
    assert_eq!(scores(&file, &["--min-score", "0.1"])["predictions"], json!(predicted.len()));
}

/// The file for reports: all scores, and the worst images, lowest first, with their predictions.
#[test]
fn the_worst_images_are_saved_with_their_predictions() {
    let folder = tempfile::tempdir().expect("a folder");
    let all = annotations(&data());
    // One image has no predictions, another has one prediction too many.
    let images = all["images"].as_array().expect("a list");
    let [missed, surplus] = [&images[1], &images[2]];
    let mut predicted = results(&all, true);
    predicted.retain(|it| it["image_id"] != missed["id"]);
    let corner = [vec![true; 6], vec![false; 160 * 120 - 6]].concat();
    let corner = Mask::from_fn(160, 120, |x, y| corner[(x * 120 + y) as usize]).to_coco();
    let extra = json!({ "size": [120, 160], "counts": corner });
    predicted.push(json!({ "image_id": surplus["id"], "score": 0.8, "segmentation": extra }));
    let (pred, saved) = (write(folder.path(), &predicted), folder.path().join("scores.json"));
    let save = saved.display().to_string();
    let said = scores(&pred, &["--save", &save]);
    let found: MetricScores = MetricScores::read(&saved).expect("a file of scores");
    let whole: Value = serde_json::from_str(&fs::read_to_string(&saved).expect("readable")).expect("JSON");
    assert_eq!((&whole["scores"], &whole["objects"]), (&said["scores"], &said["objects"]));
    assert_eq!((found.ranked_by.as_str(), found.worst.len()), ("amodal_overlap_f", images.len()));
    let names: Vec<&str> = found.worst[..2].iter().map(|it| it.name.as_str()).collect();
    assert_eq!(names, [missed, surplus].map(|it| it["file_name"].as_str().expect("a name")));
    assert_eq!((found.worst[0].scores["amodal_overlap_f"], found.worst[0].predictions.len()), (0.0, 0));
    let worst = &found.worst[1];
    let of_image = |it: &&Value| it["image_id"] == surplus["id"];
    let labels: Vec<&Value> = all["annotations"].as_array().expect("a list").iter().filter(of_image).collect();
    assert_eq!(worst.predictions.len(), labels.len() + 1);
    let last = worst.predictions.last().expect("the lowest confidence");
    assert_eq!((last.object, last.score, last.amodal_f, last.visible.as_str()), (None, Some(0.8), 0.0, &*corner));
    for it in &worst.predictions[..labels.len()] {
        let label = labels.iter().find(|label| label["instance_id"].as_u64() == it.object.map(u64::from));
        let label = label.expect("it stands for a label");
        assert_eq!((it.amodal_f, it.visible_f), (100.0, 100.0));
        assert_eq!(label["visible_mask"]["counts"], json!(it.visible));
        assert_eq!(label["segmentation"]["counts"], json!(it.amodal));
    }
    // Fewer images, ranked by another score.
    scores(&pred, &["--save", &save, "--worst", "1", "--worst-by", "edge_p"]);
    let found: MetricScores = MetricScores::read(&saved).expect("a file of scores");
    assert_eq!((found.ranked_by.as_str(), found.worst.len()), ("edge_p", 1));
    let eval =
        |more: &[&str]| fails(syntable().arg("eval").arg("--gt").arg(data()).arg("--pred").arg(&pred).args(more), 2);
    let said = eval(&["--save", &save, "--worst-by", "f"]);
    assert!(said.contains("unknown score `f` to rank images by"), "{said}");
    let nowhere = folder.path().join("none/scores.json").display().to_string();
    assert!(eval(&["--save", &nowhere]).contains("scores.json"));
    // Files that the command reads or writes for another purpose are not overwritten.
    let said = eval(&["--save", &pred.display().to_string()]);
    assert!(said.contains("--save would overwrite an input of the command"), "{said}");
    let said = eval(&["--save", &save, "--csv", &save]);
    assert!(said.contains("--save would overwrite the file of --csv"), "{said}");
    // Categories that the ground truth lacks are reported.
    predicted[0]["category_id"] = json!(999);
    let pred = write(folder.path(), &predicted);
    let said = fails(syntable().arg("eval").arg("--gt").arg(data()).arg("--pred").arg(&pred).arg("--by-category"), 2);
    assert!(said.contains("a prediction has no category of the ground truth"), "{said}");
}

#[test]
fn edges_expose_who_never_predicts_occlusion() {
    let folder = tempfile::tempdir().expect("a folder");
    let all = annotations(&data());
    let found = scores(&write(folder.path(), &results(&all, false)), &[]);
    let score = |name: &str| found["scores"][name].as_f64();
    assert!(score("acc_oo") > Some(50.0) && score("acc_oo") < Some(100.0), "{found}");
    assert_eq!((score("edge_p"), score("edge_r"), score("edge_f1")), (None, Some(0.0), Some(0.0)), "{found}");
    assert_eq!(score("visible_overlap_f"), Some(100.0));
    assert!(score("amodal_overlap_r") < Some(100.0) && score("amodal_overlap_p") == Some(100.0), "{found}");
    assert!(score("invisible_overlap_r") < Some(50.0), "{found}");
}

/// Imperfect predictions: some are missing, others are shifted to another object's mask.
fn imperfect(folder: &Path) -> PathBuf {
    let mut predicted = results(&annotations(&data()), true);
    let other = predicted[0]["segmentation"].clone();
    predicted[1]["amodal_segmentation"] = other;
    predicted.remove(2);
    write(folder, &predicted)
}

#[test]
fn scores_do_not_depend_on_threads() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = imperfect(folder.path());
    let run = |threads: &str| {
        let csv = folder.path().join(threads);
        let csv_text = csv.display().to_string();
        let found = scores(&file, &["--threads", threads, "--csv", &csv_text, "--bootstrap", "50", "--seed", "7"]);
        (found, fs::read_to_string(csv).expect("written"))
    };
    let (one, two) = (run("1"), run("2"));
    assert_eq!(one, two);
    // The score is the mean of the per-image lines.
    let lines: Vec<Vec<&str>> = one.1.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(lines.len() as u64, 1 + one.0["images"].as_u64().expect("a number"));
    for name in ["amodal_overlap_f", "visible_boundary_p", "invisible_f75"] {
        let column = lines[0].iter().position(|it| *it == name).expect("a column");
        let values = lines[1..].iter().map(|line| line[column].parse::<f64>().expect("a number"));
        let mean = values.sum::<f64>() / (lines.len() - 1) as f64;
        assert!((mean - one.0["scores"][name].as_f64().expect("a number")).abs() < 1e-9, "{name}");
    }
    assert!(one.0["scores"]["amodal_overlap_f"].as_f64() < Some(100.0));
    let value = |name: &str| one.0["scores"][name].as_f64().expect("a number");
    let interval = one.0["intervals"]["amodal_overlap_f"].as_array().expect("an interval");
    let [low, high] = [0, 1].map(|end| interval[end].as_f64().expect("a number"));
    assert!(low < value("amodal_overlap_f") && value("amodal_overlap_f") < high, "{low} {high}");
    let paper = scores(&file, &["--convention", "paper"]);
    let of = |name: &str| paper["scores"][name].as_f64().expect("a number");
    let (p, r, f) = (of("amodal_overlap_p"), of("amodal_overlap_r"), of("amodal_overlap_f"));
    assert!((f - 2.0 * p * r / (p + r)).abs() < 1e-9 && one.0["scores"]["amodal_overlap_f"] != json!(f));
    let table = ok(syntable().arg("eval").arg("--gt").arg(data()).arg("--pred").arg(&file));
    assert!(table.contains("F@.75") && table.contains("ACC_OO (release)") && table.contains("results"), "{table}");
    let lists = |name: &str| table.lines().any(|line| line.starts_with(name));
    assert!(lists("visible_miou ") && !lists("amodal_overlap_f "), "{table}");
    // A metric that is requested alone is the only one; with intervals, all scores are in one list.
    let mut eval = syntable();
    eval.arg("eval").arg("--gt").arg(data()).arg("--pred").arg(&file).args(["--metrics", "panoptic,order"]);
    let table = ok(eval.args(["--bootstrap", "20"]));
    let line = |name: &str| table.lines().find(|line| line.starts_with(name)).unwrap_or_default().to_owned();
    assert!(line("pq ").ends_with(']') && line("edge_f1 ").ends_with(']') && !table.contains("F@.75"), "{table}");
    let listed = ok(syntable().args(["list", "metrics"]));
    for metric in ["amodal", "coco", "strata"] {
        assert!(listed.lines().any(|line| line.starts_with(&format!("{metric} "))), "{listed}");
    }
    let said = fails(syntable().args(["eval", "--gt", ".", "--pred", ".", "--metrics", "ap"]), 2);
    assert!(said.contains("unknown metric `ap`") && said.contains("amodal, coco"), "{said}");
}

/// Scores with ties, crowds, objects of all sizes, and images with too many predictions or none.
#[test]
fn coco_and_panoptic_scores_match_their_tools() {
    let folder = tempfile::tempdir().expect("a folder");
    let (script, at) = (root().join("tests/check_scores.py"), folder.path().display().to_string());
    if !syntable_testing::tools::python(&script, &["make", &at]) {
        return;
    }
    let eval = |more: &[&str]| {
        let (gt, pred) = (folder.path().join("data"), folder.path().join("results.json"));
        ok(syntable().arg("eval").arg("--gt").arg(gt).arg("--pred").arg(pred).arg("--json").args(more))
    };
    let all = ["--metrics", "coco,panoptic", "--by-category"];
    let found = eval(&[&all[..], &["--threads", "1"]].concat());
    let file = folder.path().join("scores.json");
    fs::write(&file, &found).expect("writable");
    assert!(syntable_testing::tools::python(&script, &["compare", &at, &file.display().to_string()]));
    assert_eq!(eval(&[&all[..], &["--threads", "4"]].concat()), found);
    // COCO's scores use all predictions, the other scores only likely ones.
    let (low, high) =
        (eval(&["--metrics", "coco", "--min-score", "0"]), eval(&["--metrics", "coco", "--min-score", "0.9"]));
    let of = |text: &str| serde_json::from_str::<Value>(text).expect("JSON")["scores"].clone();
    assert_eq!(of(&low), of(&high));
}

/// In BOP, the category of an object is its number, and results use these numbers.
#[test]
fn objects_of_bop_are_categories() {
    let folder = tempfile::tempdir().expect("a folder");
    let (script, at) = (root().join("tests/check_scores.py"), folder.path().display().to_string());
    if !syntable_testing::tools::python(&script, &["make", &at]) {
        return;
    }
    let [gt, results] = ["bop", "bop_results.json"].map(|name| folder.path().join(name));
    // A prediction for an object that the dataset lacks has no category.
    let mut predicted: Vec<Value> =
        serde_json::from_str(&fs::read_to_string(&results).expect("readable")).expect("a list");
    let eval = |pred: &Path| {
        let mut eval = syntable();
        eval.arg("eval").arg("--gt").arg(&gt).arg("--pred").arg(pred).args(["--metrics", "coco", "--by-category"]);
        eval.arg("--json");
        eval
    };
    let said = fails(&mut eval(&results), 2);
    assert!(said.contains("a prediction has no category of the ground truth"), "{said}");
    predicted.retain(|it| it["category_id"] != 17);
    let file = folder.path().join("known.json");
    fs::write(&file, Value::from(predicted).to_string()).expect("writable");
    let (scores, found) = (folder.path().join("scores.json"), ok(&mut eval(&file)));
    fs::write(&scores, found).expect("writable");
    assert!(syntable_testing::tools::python(&script, &["bop", &at, &scores.display().to_string()]));
}

/// A dataset of amodal and visible masks scores like a result file with the same masks.
#[test]
fn masks_that_follow_from_others_say_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut all = annotations(&data());
    let file = write(folder.path(), &results(&all, true));
    let itself = scores(&data(), &[]);
    let dataset = folder.path().join("predicted");
    fs::create_dir_all(dataset.join("data/mono")).expect("writable");
    let save = |all: &Value| fs::write(dataset.join("annotation_final.json"), all.to_string()).expect("writable");
    save(&all);
    assert_eq!(scores(&dataset, &[]), itself);
    for it in all["annotations"].as_array_mut().expect("a list") {
        it.as_object_mut().expect("an object").remove("occluded_mask").expect("a mask");
    }
    save(&all);
    let found = scores(&dataset, &[]);
    assert_eq!(without_coco(&found), without_coco(&scores(&file, &[])));
    assert_ne!(found["scores"]["acc_o"], itself["scores"]["acc_o"]);
    assert_eq!(scores(&dataset, &["--occluded-from", "0"]), itself);
}

#[test]
fn options_without_sense_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = imperfect(folder.path());
    let eval =
        |more: &[&str]| fails(syntable().arg("eval").arg("--gt").arg(data()).arg("--pred").arg(&file).args(more), 2);
    let save = folder.path().join("saved.json").display().to_string();
    for (options, says) in [
        (&["--min-score", "nan"][..], "a number, such as 0.5"),
        (&["--min-score", "inf"], "a number, such as 0.5"),
        (&["--occluded-from", "5"], "a rate from 0 to 1"),
        (&["--occluded-from", "-0.1"], "a rate from 0 to 1"),
        (&["--occluded-from", "nan"], "a rate from 0 to 1"),
        (&["--save", &save, "--worst", "0"], "a number from 1 on, or `all`"),
        (&["--by-category", "--metrics", "visible"], "adds to the metric `coco`"),
    ] {
        let said = eval(options);
        assert!(said.contains(says), "{options:?}: {said}");
    }
    // If the usual score is missing, the message names the score that ranks the images.
    let mut eval = syntable();
    eval.arg("eval").arg("--gt").arg(data()).arg("--pred").arg(&file).args(["--metrics", "visible", "--save", &save]);
    let output = eval.output().expect("runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.contains("the lowest `visible_overlap_p`"), "{said}");
    // The dataset is the folder, even if the path is its annotation file.
    let inside = inner(&data()).join("each.csv");
    for gt in [data(), inner(&data()), inner(&data()).join("annotation_final.json")] {
        let mut eval = syntable();
        eval.arg("eval").arg("--gt").arg(&gt).arg("--pred").arg(&file).arg("--csv").arg(&inside);
        let said = fails(&mut eval, 2);
        assert!(said.contains("--csv would write into") && !inside.exists(), "{}: {said}", gt.display());
    }
}

/// Writes a gray PNG file.
fn write_png(file: &Path, size: [u32; 2], depth: png::BitDepth, bytes: &[u8]) {
    fs::create_dir_all(file.parent().expect("a folder")).expect("writable");
    let mut encoder = png::Encoder::new(fs::File::create(file).expect("writable"), size[0], size[1]);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(depth);
    encoder.write_header().expect("a header").write_image_data(bytes).expect("pixels");
}

/// Pixels of COCO's run lengths, row by row.
fn pixels(rle: &Value) -> Vec<bool> {
    let [height, width] = [0, 1].map(|edge| rle["size"][edge].as_u64().expect("a size") as u32);
    let mask = Mask::from_coco(width, height, rle["counts"].as_str().expect("run lengths")).expect("a mask");
    mask.to_plane().data().to_vec()
}

/// Label maps with 8 or 16 bits, in our folders or OSD-Amodal's.
fn write_maps(folder: &Path, names: [&str; 3], depth: png::BitDepth) {
    let all = annotations(&data());
    let images = all["images"].as_array().expect("a list");
    for image in images {
        let own = all["annotations"].as_array().expect("a list").iter().filter(|it| it["image_id"] == image["id"]);
        let name =
            Path::new(image["file_name"].as_str().expect("a name")).file_stem().expect("a stem").to_string_lossy();
        let size = ["width", "height"].map(|edge| image[edge].as_u64().expect("a size") as u32);
        // 16-bit numbers have two different bytes.
        let first = if depth == png::BitDepth::Sixteen { 300_u16 } else { 1 };
        let mut map = vec![0_u16; (size[0] * size[1]) as usize];
        for (label, it) in (first..).zip(own) {
            pixels(&it["visible_mask"]).iter().zip(&mut map).filter(|it| *it.0).for_each(|(_, at)| *at = label);
            for (folder_name, key) in [(names[1], "segmentation"), (names[2], "occluded_mask")] {
                let mask: Vec<u8> = pixels(&it[key]).iter().map(|is| 255 * u8::from(*is)).collect();
                if mask.contains(&255) {
                    let file = folder.join(folder_name).join(format!("{name}_{label}.png"));
                    write_png(&file, size, png::BitDepth::Eight, &mask);
                }
            }
        }
        let bytes: Vec<u8> = match depth {
            png::BitDepth::Sixteen => map.iter().flat_map(|label| label.to_be_bytes()).collect(),
            _ => map.iter().map(|label| *label as u8).collect(),
        };
        write_png(&folder.join(names[0]).join(format!("{name}.png")), size, depth, &bytes);
    }
}

#[test]
fn label_maps_are_read_as_either_side() {
    let folder = tempfile::tempdir().expect("a folder");
    let [ours, osd, shown] = ["ours", "osd", "shown"].map(|name| folder.path().join(name));
    write_maps(&ours, ["visible", "amodal", "occlusion"], png::BitDepth::Sixteen);
    write_maps(&osd, ["annotation", "amodal_annotation", "occlusion_annotation"], png::BitDepth::Eight);
    let any = ["--occluded-from", "0"];
    let itself = scores(&data(), &any);
    for maps in [&ours, &osd] {
        assert_eq!(scores(maps, &any), itself);
        let run = |gt: &Path, pred: &Path| {
            let said = ok(syntable().arg("eval").arg("--gt").arg(gt).arg("--pred").arg(pred).arg("--json").args(any));
            serde_json::from_str::<Value>(&said).expect("JSON")
        };
        assert_eq!(run(maps, &data()), itself);
        assert_eq!(run(maps, &ours), itself);
    }
    // Visible masks alone equal predictions without occlusion.
    fs::rename(ours.join("visible"), &shown).expect("writable");
    let never = scores(&write(folder.path(), &results(&annotations(&data()), false)), &any);
    assert_eq!(scores(&shown, &any), without_ranks(&never));
    let eval = |gt: &Path, pred: &Path| fails(syntable().arg("eval").arg("--gt").arg(gt).arg("--pred").arg(pred), 2);
    let said = eval(&shown, &data());
    assert!(said.contains("the dataset has no `amodal_mask`"), "{said}");
    // A mask of another size, and a mask without an image.
    let mask =
        fs::read_dir(osd.join("amodal_annotation")).expect("a folder").next().expect("a mask").expect("a mask").path();
    let was = fs::read(&mask).expect("readable");
    write_png(&mask, [4, 2], png::BitDepth::Eight, &[255; 8]);
    let said = eval(&data(), &osd);
    assert!(said.contains("it has 4 × 2 pixels, its record says 160 × 120"), "{said}");
    fs::write(&mask, was).expect("writable");
    let image = fs::read_dir(osd.join("annotation")).expect("a folder").next().expect("a map").expect("a map").path();
    let named = image.file_stem().expect("a stem").to_string_lossy().into_owned();
    fs::copy(&image, osd.join("annotation/more.png")).expect("writable");
    let said = eval(&data(), &osd);
    assert!(said.contains("image \"more\" is not in") && said.contains("leave other images out"), "{said}");
    fs::remove_file(osd.join("annotation/more.png")).expect("writable");
    fs::rename(&image, osd.join("annotation/more.png")).expect("writable");
    let said = eval(&data(), &osd);
    assert!(said.contains(&format!("{named}_")) && said.contains("its image has no label map"), "{said}");
    fs::rename(osd.join("annotation/more.png"), &image).expect("writable");
    // Objects without an occlusion mask are not occluded, unless the folder of occlusion masks is missing.
    let hidden = osd.join("occlusion_annotation");
    fs::remove_dir_all(&hidden).expect("a folder");
    assert_eq!(scores(&osd, &any), itself);
    fs::create_dir(&hidden).expect("writable");
    assert_eq!(scores(&osd, &any)["scores"]["edge_r"], json!(0.0));
    write_png(&osd.join("occlusion_annotation/other_3.png"), [4, 2], png::BitDepth::Eight, &[255; 8]);
    let said = eval(&data(), &osd);
    assert!(said.contains("other_3.png") && said.contains("its image has no label map"), "{said}");
}

/// All folders of OSD-Amodal are read as labels. As predictions, only the folders that its evaluation compares are
/// needed.
#[test]
fn osd_amodal_is_read_as_either_side() {
    let folder = tempfile::tempdir().expect("a folder");
    let truth = inner(&data()).join("osd_amodal");
    for name in ["annotation", "amodal_annotation", "occlusion_annotation"] {
        fs::create_dir(folder.path().join(name)).expect("writable");
        for file in fs::read_dir(truth.join(name)).expect("a folder") {
            let file = file.expect("a file");
            fs::copy(file.path(), folder.path().join(name).join(file.file_name())).expect("writable");
        }
    }
    let any: [&str; 0] = [];
    let eval = |pred: &Path, more: &[&str]| {
        ok(syntable().arg("eval").arg("--gt").arg(&truth).arg("--pred").arg(pred).args(any).args(more))
    };
    let itself = scores(&data(), &any);
    for pred in [&*truth, folder.path()] {
        assert_eq!(serde_json::from_str::<Value>(&eval(pred, &["--json"])).expect("JSON"), itself);
    }
    assert!(eval(folder.path(), &[]).contains("read as: osd_amodal and label_maps"));
}

/// A copy with empty COCO scores, as for predictions without scores.
fn without_ranks(found: &Value) -> Value {
    let mut found = found.clone();
    for (name, value) in found["scores"].as_object_mut().expect("scores") {
        if ["mask_a", "box_a"].iter().any(|part| name.contains(part)) {
            *value = Value::Null;
        }
    }
    found
}

/// The form of SynTable's release repeats an image's record for each of its annotations.
#[test]
fn the_releases_form_is_read_as_labels() {
    let folder = tempfile::tempdir().expect("a folder");
    let all = annotations(&data());
    let images = all["images"].as_array().expect("a list");
    let of = |it: &Value| images.iter().find(|image| image["id"] == it["image_id"]).expect("an image").clone();
    let mut released = json!({ "info": {}, "licenses": [], "categories": all["categories"] });
    released["annotations"] = all["annotations"].clone();
    released["images"] = all["annotations"].as_array().expect("a list").iter().map(of).collect();
    assert!(released["images"].as_array().expect("a list").len() > images.len());
    fs::create_dir_all(folder.path().join("data/mono")).expect("writable");
    fs::write(folder.path().join("annotation_final.json"), released.to_string()).expect("writable");
    let file = imperfect(folder.path());
    let said = ok(syntable().arg("eval").arg("--gt").arg(folder.path()).arg("--pred").arg(&file).arg("--json"));
    assert_eq!(serde_json::from_str::<Value>(&said).expect("JSON"), scores(&file, &[]));
}

#[test]
fn mistakes_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let good = results(&annotations(&data()), true);
    let said = |change: &dyn Fn(&mut Vec<Value>)| {
        let mut predicted = good.clone();
        change(&mut predicted);
        let file = write(folder.path(), &predicted);
        let said = fails(syntable().arg("eval").arg("--gt").arg(data()).arg("--pred").arg(file), 2);
        assert!(said.contains("results.json:2"), "{said}");
        said
    };
    let found = said(&|all| all[0]["image_id"] = json!(999_999));
    assert!(
        found.contains("`image_id` 999999 is not an image of") && found.contains("or its name, such as"),
        "{found}"
    );
    let found = said(&|all| all[0]["image_id"] = json!("nowhere.png"));
    assert!(found.contains("`image_id` \"nowhere.png\" is not an image of"), "{found}");
    let found = said(&|all| all[0]["segmentation"]["size"] = json!([160, 120]));
    assert!(found.contains("`segmentation` of an image 160 × 120") && found.contains("[160, 120]"), "{found}");
    let found = said(&|all| drop(all[0].as_object_mut().expect("an object").remove("score")));
    assert!(found.contains("missing field `score`"), "{found}");
    let found = said(&|all| all[0]["score"] = json!("high"));
    assert!(found.contains("invalid type: string \"high\""), "{found}");
    let found = said(&|all| all[0]["segmentation"] = json!([[1.0, 1.0, 9.0, 1.0, 9.0, 9.0, 1.0]]));
    assert!(found.contains("`segmentation` of an image 160 × 120: a polygon of 7 numbers"), "{found}");
    let found = said(&|all| all[0]["amodal_segmentation"]["counts"] = json!("!"));
    assert!(found.contains("`amodal_segmentation`") && found.contains("not COCO's alphabet"), "{found}");
    let eval = |gt: &Path, pred: &Path| fails(syntable().arg("eval").arg("--gt").arg(gt).arg("--pred").arg(pred), 2);
    let file = folder.path().join("none.json");
    fs::write(&file, format!("[\n{}]", good[0].to_string().replace("\"score\":0.9", "\"score\":NaN")))
        .expect("writable");
    let found = eval(&data(), &file);
    assert!(found.contains("none.json:2") && found.contains("not a prediction: expected value"), "{found}");
    let file = folder.path().join("object.json");
    fs::write(&file, "{}").expect("writable");
    assert!(eval(&data(), &file).contains("a result file is a JSON list of predictions"));
    let file = folder.path().join("cut.json");
    fs::write(&file, "[{\"image_id\": 1,").expect("writable");
    assert!(eval(&data(), &file).contains("the list of predictions ends early"));
    assert!(eval(&data(), &folder.path().join("nothing")).contains("no such folder or file"));
    // Two images of predictions match one image of labels.
    let [labels, twice] = [&["1/a.png"][..], &["a.png", "2/a.jpg"]].map(|names| {
        let at = folder.path().join(format!("coco{}", names.len()));
        let image = |(id, name): (usize, &&str)| json!({ "id": id, "file_name": name, "width": 4, "height": 2 });
        let mask = json!({ "size": [2, 4], "counts": [2, 3, 3] });
        let annotation = json!({
            "id": 1, "image_id": 0, "category_id": 1, "area": 3, "bbox": [1, 0, 2, 2], "segmentation": mask,
            "visible_mask": mask,
        });
        let all = json!({
            "images": names.iter().enumerate().map(image).collect::<Vec<_>>(), "annotations": [annotation],
            "categories": [{ "id": 1, "name": "object" }],
        });
        fs::create_dir_all(at.join("annotations")).expect("writable");
        fs::write(at.join("annotations/instances_train.json"), all.to_string()).expect("writable");
        at
    });
    let found = eval(&labels, &twice);
    assert!(found.contains("images \"a.png\" and \"2/a.jpg\" both match image \"1/a.png\""), "{found}");
    // One dataset lacks an image, and another has an additional image.
    let all = annotations(&data());
    let mut fewer = all.clone();
    let gone = fewer["images"].as_array_mut().expect("a list").pop().expect("an image");
    fewer["annotations"].as_array_mut().expect("a list").retain(|it| it["image_id"] != gone["id"]);
    let other = folder.path().join("other");
    fs::create_dir(&other).expect("writable");
    fs::write(other.join("annotation_final.json"), fewer.to_string()).expect("writable");
    let name = gone["file_name"].as_str().expect("a name");
    let syntable_form = |gt: &Path, pred: &Path| {
        let mut eval = syntable();
        eval.arg("eval").arg("--gt").arg(gt).arg("--pred").arg(pred);
        fails(eval.args(["--gt-format", "syntable", "--pred-format", "syntable"]), 2)
    };
    let found = syntable_form(&inner(&data()), &other);
    assert!(found.contains(&format!("image \"{name}\" of")) && found.contains("has no prediction"), "{found}");
    let found = syntable_form(&other, &inner(&data()));
    assert!(found.contains(&format!("image \"{name}\" is not in")), "{found}");
}

/// The code block of the page creates a file of predictions, which is read back unchanged.
#[test]
fn the_pages_python_writes_what_is_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = fs::read_to_string(root().join("book/src/evaluation.md")).expect("readable");
    let block = page.split("```python\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a block");
    let script = folder.path().join("predict.py");
    let use_it = r#"
import sys

data = json.load(open(sys.argv[1]))
decode = lambda rle: mask.decode(rle).astype(bool)
names = {image["id"]: image["file_name"] for image in data["images"]}
detections = [
    (names[it["image_id"]] if index % 2 else it["image_id"], 0.9, decode(it["visible_mask"]), decode(it["segmentation"]))
    for index, it in enumerate(data["annotations"])
]
write_results(sys.argv[2], detections)
"#;
    fs::write(&script, format!("{block}{use_it}")).expect("writable");
    let file = inner(&data()).join("annotation_final.json").display().to_string();
    let out = folder.path().join("results.json");
    if syntable_testing::tools::python(&script, &[&file, &out.display().to_string()]) {
        assert_perfect(&scores(&out, &["--occluded-from", "0"]));
    }
}
