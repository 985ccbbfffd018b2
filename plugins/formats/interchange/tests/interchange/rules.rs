//! Rules for all writers of this crate.

use std::collections::BTreeSet;
use syntable_interchange as _;
use syntable_model::context::{Collected, Serial};
use syntable_model::prelude::*;
use syntable_model::registry::{Registry, Slot};
use syntable_model::scene::{SceneId, ViewId};
use syntable_model::stage::DatasetInfo;
use syntable_testing::conformance;
use syntable_testing::takes::{dataset, files, finish, takes, write_scenes, writer};

/// All kinds of this crate.
fn kinds() -> Vec<&'static str> {
    let registry = Registry::linked().expect("kinds are unique");
    let kinds: Vec<&str> = registry.of_slot(Slot::Write).map(|entry| entry.kind).collect();
    assert!(kinds.len() > 7, "{kinds:?}");
    kinds
}

#[test]
fn kinds_pass_the_checks_of_all_writers() {
    let registry = Registry::linked().expect("kinds are unique");
    let (takes, log) = (takes(), Collected::default());
    // Objects have categories of two classes.
    let dataset = DatasetInfo { classes: ["a", "b"].map(str::to_owned).to_vec(), ..dataset(3, 3) };
    for kind in kinds() {
        conformance::entry(registry.find(Slot::Write, kind).expect("a kind"));
        let folder = tempfile::tempdir().expect("a folder");
        let (view, products) = &takes[0].views[1];
        let cx = DatasetContext::new(&dataset, &Serial, &log).scene(&takes[0].scene);
        let written =
            conformance::writer(&*writer(kind, "").expect("defaults"), &cx.view(view), products, folder.path());
        assert!(!written.is_empty(), "{kind}");
    }
}

#[test]
fn paths_are_told_before_a_run() {
    let (takes, dataset) = (takes(), dataset(3, 3));
    for (kind, options) in kinds().into_iter().flat_map(|kind| [(kind, ""), (kind, "rgb = { format = \"jpeg\" }")]) {
        let folder = tempfile::tempdir().expect("a folder");
        let Ok(writer) = writer(kind, options) else {
            // The evaluation that reads OSD-Amodal looks for PNG files, and TOD always has JPEG files.
            assert!(["osd_amodal", "tod"].contains(&kind), "{kind}");
            continue;
        };
        write_scenes(folder.path(), "x", &*writer, &dataset, &takes).expect("written");
        finish(folder.path(), "x", &*writer, &dataset, &[0, 1, 2]).expect("finished");
        let of = |scene: Option<u32>, view: Option<u32>| FileOf {
            dataset: &dataset,
            id: "x",
            scene: scene.map(SceneId),
            view: view.map(ViewId),
            products: &[],
        };
        let views = (0..3).flat_map(|scene| (0..3).map(move |view| of(Some(scene), Some(view))));
        let all = views.chain((0..3).map(|scene| of(Some(scene), None))).chain([of(None, None)]);
        let told: Vec<String> = all.flat_map(|of| writer.paths(&of).expect("paths")).collect();
        let unique: BTreeSet<&String> = told.iter().collect();
        assert_eq!(unique.len(), told.len(), "{kind}: a path is told twice");
        let written = files(folder.path());
        if ["osd_amodal", "bop"].contains(&kind) {
            // The number of masks is not known before writing; a view without objects has no masks.
            let is_mask = |path: &str| ["_annotation/", "/mask/", "/mask_visib/"].iter().any(|of| path.contains(of));
            let is_first = |path: &&String| !is_mask(path) || path.ends_with("_1.png") || path.ends_with("_000000.png");
            assert!(written.keys().filter(is_first).all(|path| unique.contains(path)), "{kind} {options}");
        } else {
            assert_eq!(written.keys().collect::<BTreeSet<_>>(), unique, "{kind} {options}");
        }
        let count = |end: &str| written.keys().filter(|path| path.ends_with(end)).count();
        assert_eq!(count(".jpg"), if options.is_empty() { 0 } else { 9 }, "{kind} {options}");
    }
}

#[test]
fn files_of_the_dataset_follow_from_the_scenes_that_are_done() {
    let (takes, dataset) = (takes(), dataset(3, 3));
    for kind in kinds() {
        let writer = writer(kind, "").expect("defaults");
        let write = |order: &[usize], done: &[&[u32]]| {
            let folder = tempfile::tempdir().expect("a folder");
            write_scenes(folder.path(), "x", &*writer, &dataset, order.iter().map(|&i| &takes[i])).expect("written");
            done.iter().for_each(|done| finish(folder.path(), "x", &*writer, &dataset, done).expect("finished"));
            files(folder.path())
        };
        let whole = write(&[0, 1, 2], &[&[0, 1, 2]]);
        assert!(write(&[2, 0, 1], &[&[0], &[0, 1, 2], &[0, 1, 2]]) == whole, "{kind}: the order of scenes matters");
    }
}

#[test]
fn options_of_the_end_leave_the_scenes_alone() {
    let (takes, dataset) = (takes(), dataset(3, 3));
    for kind in kinds() {
        let scenes = |options: &str| {
            let writer = writer(kind, options).expect("good options");
            let folder = tempfile::tempdir().expect("a folder");
            write_scenes(folder.path(), "x", &*writer, &dataset, &takes).expect("written");
            syntable_testing::folder::files(folder.path())
        };
        for option in writer(kind, "").expect("defaults").finish_options() {
            let value = match *option {
                "split" => "\"other\"",
                "skip_empty_images" => "false",
                "supercategories" => "{ object = \"thing\" }",
                other => panic!("{kind}: a value for `{other}`"),
            };
            assert!(scenes(&format!("{option} = {value}")) == scenes(""), "{kind}: `{option}` changes scenes");
        }
    }
}

#[test]
fn splits_are_parts_of_names() {
    for kind in kinds().into_iter().filter(|kind| *kind != "osd_amodal") {
        for split in ["", "a/b", "..", "a\\b"] {
            let refused = writer(kind, &format!("split = {split:?}")).err();
            assert!(
                refused.as_ref().is_some_and(|error| error.starts_with("split: ")),
                "{kind} {split:?}: {refused:?}"
            );
        }
    }
    assert!(writer("uoais", "split = \"annotations\"").is_err());
}
