//! Whole datasets, read back by an independent reader (`check_dataset.py`: pycocotools, NumPy, Pillow).

mod support;
use std::path::Path;
use std::process::Command;
use support::{assets, ok, root, skip, small_run, syntable, text};

fn python() -> Option<Command> {
    let works = |command: &mut Command| command.output().is_ok_and(|output| output.status.success());
    works(Command::new("python3").args(["-c", "import numpy, pycocotools, PIL"])).then(|| Command::new("python3"))
}

fn check(dataset: &Path, more: &[&str]) {
    let Some(mut python) = python() else { return skip("python3 with numpy, pycocotools and pillow") };
    let output = python.arg(root().join("tests/check_dataset.py")).arg(dataset).args(more).output().expect("starts");
    assert!(output.status.success(), "{}", text(&output));
}

#[test]
fn the_quickstart_dataset_is_right() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("data");
    ok(&mut small_run(&out, &["--set", "camera.resolution=[160, 120]", "--set", "place[2].count=12"]));
    check(&out, &[]);
}

#[test]
fn crowded_scenes_of_every_policy_are_right() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, policy) in [
        ("occlude", "{ table_and_room = \"occlude\" }"),
        ("clip", "{ table_and_room = \"clip\" }"),
        ("hidden", "{ min_visible_px = 0 }"),
        ("extend", "{ image_frame = \"extend\" }"),
    ] {
        let out = folder.path().join(name);
        let set = format!("annotate.masks={policy}");
        ok(&mut small_run(
            &out,
            &["--set", "camera.resolution=[160, 120]", "--set", "place[2].count=30", "--set", &set],
        ));
        check(&out, &[]);
    }
}

#[test]
fn real_objects_give_right_datasets() {
    for assets in assets() {
        let folder = tempfile::tempdir().expect("a folder");
        for recipe in ["train", "val", "release"] {
            let out = folder.path().join(recipe);
            let file = format!("recipes/syntable-sim/{recipe}.toml");
            let set = [
                "dataset.scenes=1",
                "dataset.views_per_scene=2",
                "render.samples_per_pixel=1",
                "camera.resolution=[160, 120]",
            ];
            let mut run = syntable();
            run.args(["run", &file, "--out"]).arg(&out).env("ASSETS", &assets);
            run.args(set.iter().flat_map(|set| ["--set", set]));
            ok(&mut run);
            check(&out, if recipe == "release" { &["--compat", "syntable_1"] } else { &[] });
        }
    }
}
