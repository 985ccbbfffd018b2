//! The dataset is a function of the recipe: threads, splits and other annotators do not change it.

mod support;
use support::{assert_same, files, ok, small_run, syntable};

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
    let picture = |scene: u32, view: u32| format!("data/mono/rgb/{scene}_{view}.png");
    assert_ne!(a[&picture(0, 0)], b[&picture(0, 0)]);
    assert_ne!(a[&picture(0, 0)], a[&picture(1, 0)]);
    assert_ne!(a[&picture(0, 0)], a[&picture(0, 1)]);
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
