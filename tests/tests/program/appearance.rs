//! Appearance of objects without their occluders, compared with the image and the masks, read by NumPy and Pillow.

use crate::support::{ok, root, skip, syntable, text};
use std::path::Path;
use std::process::Command;

fn run(out: &Path, sets: &[&str]) {
    let mut run = syntable();
    run.args(["run", "builtin:quickstart", "--out"]).arg(out);
    let arrays = "write.arrays={ kind = \"npz\", include = [\"rgb\", \"normal\", \"visible_ids\", \"amodal_bits\", \
                  \"appearance\", \"appearance_box\", \"amodal_normal\"] }";
    let cut = "write.cut={ kind = \"png\", include = [\"appearance\"], crop = true }";
    let common = [
        "dataset.seed=7",
        "dataset.scenes=1",
        "dataset.views_per_scene=2",
        "camera.resolution=[200, 150]",
        arrays,
        cut,
    ];
    for set in common.iter().chain(sets) {
        run.args(["--set", set]);
    }
    ok(&mut run);
}

#[test]
fn objects_look_as_in_the_image_and_are_whole() {
    let here = Command::new("python3").args(["-c", "import numpy, PIL"]).output();
    if !here.is_ok_and(|output| output.status.success()) {
        return skip("python3 with numpy and pillow");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let check = |mode: &str, sets: &[&str]| {
        let out = folder.path().join(mode);
        let few = ["render.kind=\"cpu_path\"", "render.samples_per_pixel=8", "render.max_bounces=4"];
        run(&out, &[&few[..], sets].concat());
        let mut check = Command::new("python3");
        check.arg(root().join("tests/check_appearance.py")).arg(&out).arg(mode);
        let output = check.output().expect("starts");
        let said = text(&output);
        assert!(output.status.success(), "{mode}: {said}");
        println!("{mode}: {}", said.trim());
    };
    let camera = ["sensor.rgb_camera.white_balance=\"auto\"", "sensor.rgb_camera.tone=\"agx\""];
    check("exact", &["denoise={ kind = \"none\" }", camera[0], camera[1]]);
    // No denoiser knows what a drinking glass shows: it takes samples.
    check("denoised", &["denoise={ kind = \"guided\" }", "render.samples_per_pixel=64"]);
    check("alone", &["denoise={ kind = \"guided\" }", "annotate.appearance={ lighting = \"alone\" }"]);
}
