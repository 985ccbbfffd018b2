//! The dataset is a function of the recipe: threads, splits and other annotators do not change it.

use crate::support::{assert_same, ok, small_run, syntable};
use syntable_testing::folder::files;

#[test]
fn threads_and_splits_do_not_matter() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let scenes = ["--set", "dataset.scenes=3"];
    ok(small_run(&at("one"), &scenes).args(["--threads", "1"]));
    ok(small_run(&at("two"), &scenes).args(["--threads", "2"]));
    ok(small_run(&at("seven"), &scenes).args(["--threads", "7"]));
    for part in ["2..3", "0..1", "1..2"] {
        ok(small_run(&at("parts"), &scenes).args(["--scenes", part]));
    }
    for other in ["two", "seven", "parts"] {
        assert_same(&at("one"), &at(other));
    }
}

#[test]
fn the_resolved_recipe_gives_the_same_dataset() {
    let folder = tempfile::tempdir().expect("a folder");
    let (first, second) = (folder.path().join("first"), folder.path().join("second"));
    ok(&mut small_run(&first, &[]));
    ok(syntable().arg("run").arg(first.join("recipe.toml")).arg("--out").arg(&second));
    assert_same(&first, &second);
}

#[test]
fn the_seed_matters_and_the_scene_number_too() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    ok(&mut small_run(&at("a"), &["--seed", "1"]));
    ok(&mut small_run(&at("b"), &["--seed", "2"]));
    let (a, b) = (files(&at("a")), files(&at("b")));
    let image = |scene: u32, view: u32| format!("data/mono/rgb/{scene}_{view}.png");
    assert_ne!(a[&image(0, 0)], b[&image(0, 0)]);
    assert_ne!(a[&image(0, 0)], a[&image(1, 0)]);
    assert_ne!(a[&image(0, 0)], a[&image(0, 1)]);
}

#[test]
fn another_writer_or_view_disturbs_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    ok(&mut small_run(&at("plain"), &[]));
    ok(&mut small_run(&at("more"), &["--views", "3", "--set", "write.npy.include=[\"depth\", \"normal\"]"]));
    let (plain, more) = (files(&at("plain")), files(&at("more")));
    for name in plain.keys().filter(|name| name.starts_with("data/mono/")) {
        assert!(plain[name] == more[name], "{name} differs");
    }
    assert!(more.keys().any(|name| name.starts_with("npy/")));
}

#[test]
fn lights_of_a_scene_stay_while_the_camera_moves() {
    let folder = tempfile::tempdir().expect("a folder");
    let lights = |per: &str| {
        let out = folder.path().join(per);
        let drawn = format!("lights[1].per=\"{per}\"");
        let sets = ["lights[0].count=0", "lights[2].walls=0", "write.jsonl.include=[\"lights\"]", &drawn];
        let sets: Vec<&str> = sets.into_iter().flat_map(|set| ["--set", set]).collect();
        ok(small_run(&out, &["--views", "3"]).args(&sets));
        let files = files(&out);
        let (_, lines) = files.iter().find(|(name, _)| name.starts_with("jsonl")).expect("lines");
        // One line per view; equal lights give equal text after the key.
        let text = String::from_utf8_lossy(lines).into_owned();
        text.lines().map(|line| line.split("\"lights\":").nth(1).expect("lights").to_owned()).collect::<Vec<_>>()
    };
    let (scene, view) = (lights("scene"), lights("view"));
    assert!(scene.len() >= 6 && scene[0] == scene[1] && scene[1] == scene[2] && scene[0] != scene[3], "{scene:?}");
    assert!(view[0] != view[1] && view[1] != view[2], "{view:?}");
}
