//! Annotators that need a second camera, in whole runs: optical flow and soft masks. Also support relations of existing
//! scenes.

use crate::support::{files, ok, root, skip, syntable, text};
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
