//! Annotators that need a second camera, in whole runs: optical flow and soft masks. Also support relations of existing
//! scenes.

use crate::support::{files, ok, root, skip, syntable, text};
use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;

const ARRAYS: &str = "write.arrays={ kind = \"npz\", include = [\"depth\", \"instance\", \"flow\", \"flow_visibility\", \
                      \"visible_soft_mask\", \"amodal_soft_mask\"] }";
const VIEWS: &str = "write.views={ kind = \"jsonl\", include = [\"camera\", \"support_graph\", \"removal_order\"] }";

fn run(out: &Path, resolution: &str, writers: &[&str], more: &[&str]) {
    let mut run = syntable();
    run.args(["run", "builtin:quickstart", "--out"]).arg(out);
    for set in ["render.samples_per_pixel=1", "denoise.kind=\"none\"", "dataset.views_per_scene=3"] {
        run.args(["--set", set]);
    }
    run.args(["--set", &format!("camera.resolution={resolution}")]);
    for writer in writers {
        run.args(["--set", writer]);
    }
    ok(run.args(more));
}

#[test]
fn flow_and_soft_masks_match_the_other_camera() {
    let here = Command::new("python3").args(["-c", "import numpy"]).output();
    if !here.is_ok_and(|output| output.status.success()) {
        return skip("python3 with numpy");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let [coarse, fine] = ["coarse", "fine"].map(|name| folder.path().join(name));
    run(&coarse, "[160, 120]", &[ARRAYS, VIEWS], &[]);
    run(&fine, "[640, 480]", &["write.arrays={ kind = \"npz\", include = [\"instance\"] }"], &[]);
    let mut check = Command::new("python3");
    let output = check.arg(root().join("tests/check_views.py")).args([&coarse, &fine]).output().expect("starts");
    assert!(output.status.success(), "{}", text(&output));
}

/// Relations need no settler: adding them to an existing dataset gives the same labels as from the start.
#[test]
fn relations_of_an_old_scene_match_a_new_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let [new, grown] = ["new", "grown"].map(|name| folder.path().join(name));
    run(&new, "[64, 48]", &[VIEWS], &[]);
    run(&grown, "[64, 48]", &["write.views={ kind = \"jsonl\", include = [\"camera\"] }"], &[]);
    run(
        &grown,
        "[64, 48]",
        &["write.views={ kind = \"jsonl\", include = [\"camera\"] }", &VIEWS.replace("views=", "more=")],
        &[],
    );
    let of = |out: &Path, name: &str| std::fs::read_to_string(out.join(name)).expect("written");
    assert!(!files(&new).is_empty());
    assert_eq!(of(&grown, "more.jsonl"), of(&new, "views.jsonl"));
}

/// A stereo pair sees one scene in one light from two places, at the poses of a recipe without a rig.
#[test]
fn the_cameras_of_a_rig_take_one_moment_from_their_places() {
    const RECORDS: &str = "write.views={ kind = \"jsonl\", include = [\"camera\", \"lights\", \"object_info\"] }";
    const RIG: &str = "views.rig=[{ name = \"left\" }, { name = \"right\", position_m = [0.06, 0, 0] }]";
    let folder = tempfile::tempdir().expect("a folder");
    let records = |name: &str, more: &[&str]| -> Vec<Value> {
        let out = folder.path().join(name);
        let sets = [&["--set", "dataset.scenes=1"], more].concat();
        run(&out, "[64, 48]", &[RECORDS], &sets);
        let text = std::fs::read_to_string(out.join("views.jsonl")).expect("written");
        text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    };
    let single = records("single", &["--set", "dataset.views_per_scene=2"]);
    let pairs = records("pairs", &["--set", "dataset.views_per_scene=4", "--set", RIG]);
    let translation = |record: &Value| -> Vec<f64> {
        let matrix = &record["camera_from_object"];
        (0..3).map(|row| matrix[row][3].as_f64().expect("a number")).collect()
    };
    let mut compared = 0;
    for (pose, single) in single.iter().enumerate() {
        let [left, right] = [2 * pose, 2 * pose + 1].map(|view| &pairs[view]);
        for (record, name) in [(left, "left"), (right, "right")] {
            assert_eq!((&record["camera"]["rig_camera"], &record["camera"]["rig_pose"]), (&json!(name), &json!(pose)));
            assert_eq!(record["lights"], single["lights"]);
        }
        assert_eq!(left["camera"]["world_from_camera"], single["camera"]["world_from_camera"]);
        assert_eq!(right["camera"]["rig_from_camera"][0][3], 0.06);
        let of = |record: &Value| record["object_info"].as_object().expect("objects").clone();
        for (id, object) in of(right) {
            let [left, right] = [&left["object_info"][&id], &object].map(translation);
            let moved: Vec<f64> = left.iter().zip(&right).map(|(left, right)| left - right).collect();
            assert!((moved[0] - 0.06).abs() < 1e-9 && moved[1].abs() + moved[2].abs() < 1e-9, "{id}: {moved:?}");
            compared += 1;
        }
    }
    assert!(pairs.len() == 4 && compared >= 10, "{} views, {compared} objects", pairs.len());
    let mut odd = syntable();
    odd.args(["check", "builtin:quickstart", "--set", RIG, "--set", "dataset.views_per_scene=3"]);
    let said = crate::support::fails(&mut odd, 2);
    assert!(said.contains("not a multiple of 2") && said.contains("write 2 or 4"), "{said}");
}
