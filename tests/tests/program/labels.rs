//! Labels of a whole scene, compared with the results of pycocotools and NumPy for the masks.

use crate::support::{ok, root, skip, syntable, text};
use std::process::Command;

#[test]
fn outlines_boxes_and_graphs_match_the_masks() {
    let here = Command::new("python3").args(["-c", "import numpy, pycocotools"]).output();
    if !here.is_ok_and(|output| output.status.success()) {
        return skip("python3 with numpy and pycocotools");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let labels = "write.labels={ kind = \"jsonl\", include = [\"visible_mask\", \"amodal_mask\", \"occlusion_order\", \
                  \"visible_outline\", \"amodal_outline\", \"visible_rotated_box\", \"amodal_rotated_box\", \"cuboid\", \
                  \"occlusion_graph\", \"occlusion_layer\"] }";
    let mut run = syntable();
    run.args(["run", "builtin:quickstart", "--out"]).arg(folder.path());
    for set in [
        "camera.resolution=[320, 240]",
        "render.samples_per_pixel=1",
        "dataset.scenes=1",
        "annotate.outlines.tolerance_px=0",
        labels,
    ] {
        run.args(["--set", set]);
    }
    ok(&mut run);
    let mut check = Command::new("python3");
    check.arg(root().join("tests/check_labels.py")).arg(folder.path().join("labels.jsonl"));
    let output = check.output().expect("starts");
    let said = text(&output);
    assert!(output.status.success(), "{said}");
    let masks: usize = said.split_whitespace().next().and_then(|word| word.parse().ok()).unwrap_or(0);
    assert!(masks > 40, "{said}");
}
