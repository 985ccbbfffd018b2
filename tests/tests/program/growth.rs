//! Datasets that grow by a writer: each writer of the stock program writes the same files as from the start.

use crate::support::{assert_same, fails, ok, small_run, syntable, text};
use std::path::Path;
use syntable_testing::folder::files;

/// Every stock writer, with products that need light and products that need none.
const WRITERS: [(&str, &[&str]); 10] = [
    ("contact_sheet", &["write.contact_sheet={}"]),
    ("exr", &["write.exr.include=[\"radiance\", \"normal\"]"]),
    ("gltf", &["write.gltf.per=\"view\""]),
    ("jsonl", &["write.jsonl.include=[\"camera\", \"settle_report\", \"lights\", \"occlusion_rate\"]"]),
    ("npy", &["write.npy.include=[\"depth\", \"albedo\"]"]),
    ("npz", &["write.npz={}"]),
    ("png", &["write.png.include=[\"amodal_mask\", \"instance\", \"rgb\"]"]),
    ("syntable", &["write.syntable.debug_masks=true"]),
    (
        "per_scene",
        &[
            "write.per_scene={ kind = \"template\", per = \"scene\", include = [\"visible_box\"], template = \"{{ scene.id }} {{ views | json_encode() }}\" }",
        ],
    ),
    (
        "per_dataset",
        &[
            "write.per_dataset={ kind = \"template\", per = \"dataset\", include = [\"amodal_box\"], template = \"{{ scenes | json_encode() }}\" }",
        ],
    ),
];

/// A recipe of the quickstart's scenes whose only writer writes labels. Sizes and colors of objects vary: they are drawn again when
/// the dataset grows, and must fit the stored poses.
fn base(folder: &std::path::Path) -> std::path::PathBuf {
    let recipe = std::fs::read_to_string(crate::support::root().join("recipes/quickstart.toml")).expect("there");
    let (head, _) = recipe.split_once("[write.syntable]").expect("the writers come last");
    let path = folder.join("base.toml");
    let vary = "width_factor = 0.45\nscale = { uniform = [0.6, 1.4] }\ncolor = { hue_deg = { uniform = [-180, 180] }, probability = 0.5 }";
    let head = head.replace("width_factor = 0.45", vary);
    std::fs::write(&path, format!("{head}[write.first]\nkind = \"jsonl\"\ninclude = [\"object_info\"]\n"))
        .expect("writable");
    path
}

fn run(recipe: &std::path::Path, out: &std::path::Path, sets: &[&str]) -> std::process::Command {
    let mut command = syntable();
    command
        .arg("run")
        .arg(recipe)
        .arg("--out")
        .arg(out)
        .args(crate::support::SMALL)
        .args(["--set", "dataset.scenes=2"]);
    for set in sets {
        command.args(["--set", set]);
    }
    command
}

#[test]
fn every_writer_that_comes_later_writes_what_it_would_have_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let recipe = base(folder.path());
    let grown = folder.path().join("grown");
    ok(&mut run(&recipe, &grown, &[]));
    let mut sets: Vec<&str> = Vec::new();
    for (id, options) in WRITERS {
        sets.extend(options);
        let said = text(&run(&recipe, &grown, &sets).output().expect("starts"));
        for says in [
            &*format!("the dataset grows by the files of `write.{id}`"),
            "made 0 images and more files of 2 scenes in ",
        ] {
            assert!(said.contains(says), "{says} is not in\n{said}");
        }
    }
    let whole = folder.path().join("whole");
    ok(&mut run(&recipe, &whole, &sets));
    assert_same(&whole, &grown);
    let names: Vec<String> = files(&grown).into_keys().collect();
    for part in [
        "contact_sheet/",
        "exr/radiance/",
        "gltf/",
        "npy/albedo/",
        "npz/",
        "png/rgb/",
        "data/mono/rgb/",
        "per_dataset.txt",
    ] {
        assert!(names.iter().any(|name| name.starts_with(part)), "{part}");
    }
    assert!(ok(syntable().arg("verify").arg(&grown)).contains("0 missing, 0 damaged, 0 foreign"));
}

#[test]
fn what_a_run_reports_of_growth_and_of_another_recipe() {
    let folder = tempfile::tempdir().expect("a folder");
    ok(&mut small_run(folder.path(), &[]));
    let said =
        text(&small_run(folder.path(), &["--set", "dataset.scenes=3", "--views", "3"]).output().expect("starts"));
    for word in ["from 2 to 3 scenes", "from 2 to 3 views of new scenes", "3 scenes, 7 images"] {
        assert!(said.contains(word), "{word} is not in\n{said}");
    }
    let error = fails(&mut small_run(folder.path(), &["--set", "dataset.scenes=3", "--seed", "8"]), 2);
    assert!(error.contains("dataset.seed: 15 -> 8") && error.contains("another recipe"), "{error}");
}

/// Ids and files of the images in an annotation file.
fn image_ids(file: &Path) -> Vec<(u64, String)> {
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(file).expect("there")).expect("JSON");
    let images = json["images"].as_array().expect("a list").iter();
    images.map(|it| (it["id"].as_u64().expect("an id"), it["file_name"].as_str().expect("a name").to_owned())).collect()
}

#[test]
fn image_ids_are_unique_however_the_dataset_grew() {
    let folder = tempfile::tempdir().expect("a folder");
    let old = "write.old={ kind = \"syntable\", compat = \"syntable_1\", folder = \"old\" }";
    let run = |out: &Path, more: &[&str]| ok(&mut small_run(out, &[&["--set", old], more].concat()));
    // Scene 1 has two views, and scene 0 gets three later: because it comes later, or because it is made again.
    let later = folder.path().join("later");
    run(&later, &["--scenes", "1..2"]);
    run(&later, &["--views", "3"]);
    let again = folder.path().join("again");
    run(&again, &[]);
    let journal = again.join(".syntable/journal.jsonl");
    let lines = std::fs::read_to_string(&journal).expect("there");
    let rest: Vec<&str> = lines.split_inclusive('\n').filter(|line| !line.starts_with("{\"scene\":0,")).collect();
    std::fs::write(&journal, rest.concat()).expect("writable");
    run(&again, &["--views", "3", "--repair"]);
    for out in [later, again] {
        let of = |view: &[u32], scene: u32| -> Vec<(u64, String)> {
            view.iter().map(|v| (u64::from(scene * 3 + v + 1), format!("data/mono/rgb/{scene}_{v}.png"))).collect()
        };
        assert_eq!(image_ids(&out.join("annotation_final.json")), [of(&[0, 1, 2], 0), of(&[0, 1], 1)].concat());
        crate::support::check_dataset(&out, &[]);
        crate::support::check_dataset(&out.join("old"), &["--compat", "syntable_1"]);
    }
}

#[test]
fn files_that_the_end_reads_are_compared_before_anything_changes() {
    let folder = tempfile::tempdir().expect("a folder");
    let [home, elsewhere, whole, merged] =
        ["home", "elsewhere", "whole", "merged"].map(|name| folder.path().join(name));
    let template = home.join("labels.tera");
    for folder in [&home, &elsewhere] {
        std::fs::create_dir(folder).expect("writable");
    }
    std::fs::write(&template, "{{ dataset.name }} {{ scenes | length }}\n").expect("writable");
    let recipe = home.join("recipe.toml");
    let text = "extends = \"builtin:quickstart\"\n[write.labels]\nkind = \"template\"\nper = \"dataset\"\n\
                include = [\"visible_box\"]\ntemplate = { file = \"labels.tera\" }\n";
    std::fs::write(&recipe, text).expect("writable");
    let made = |out: &Path, scenes: &str| {
        ok(run(&recipe, out, &[]).args(["--scenes", scenes]));
        out.to_owned()
    };
    let parts = [made(&folder.path().join("a"), "0..1"), made(&folder.path().join("b"), "1..2")];
    made(&whole, "0..2");
    let merge = |from: &Path| {
        let mut command = syntable();
        command.current_dir(from).arg("merge").arg(&merged).args(&parts);
        command
    };
    // The path of the template is relative to the current folder of the command.
    std::fs::write(elsewhere.join("labels.tera"), "another").expect("writable");
    for (from, says) in [(&elsewhere, "has changed since"), (&folder.path().to_owned(), "labels.tera")] {
        let error = fails(&mut merge(from), 2);
        for word in ["write.labels.template.file", says, "folder of the recipe"] {
            assert!(error.contains(word), "{word} is not in\n{error}");
        }
        assert!(!merged.exists(), "something was merged");
    }
    let mut one = syntable();
    one.current_dir(&home).arg("merge").arg(&merged).arg(&parts[1]);
    let error = fails(&mut one, 3);
    for words in ["no part has 1 of the recipe's 2 scenes: 0", "1 scene of the recipe missing"] {
        assert!(error.contains(words), "{words} is not in\n{error}");
    }
    ok(&mut merge(&home));
    assert_same(&whole, &merged);
    // A part that contradicts the dataset changes nothing, although it locks other assets.
    let journal = parts[1].join(".syntable/journal.jsonl");
    let line = std::fs::read_to_string(&journal).expect("there");
    std::fs::write(&journal, line.replacen("\"objects\":", "\"objects\":1", 1)).expect("writable");
    let one = |more: &[&str]| {
        let mut command = syntable();
        fails(command.current_dir(&home).arg("merge").arg(&merged).arg(&parts[1]).args(more), 2)
    };
    let error = one(&["--extend"]);
    assert!(error.contains("scene 1 differs"), "{error}");
    // A folder with other scenes may be a part of a command without an output folder.
    let error = one(&[]);
    assert!(error.contains("has 1 scene that no part has") && error.contains("--extend"), "{error}");
    assert_same(&whole, &merged);
    // The locks of a resolved recipe are compared before a dataset is deleted.
    let locked = home.join("locked.toml");
    std::fs::copy(whole.join("recipe.toml"), &locked).expect("there");
    let before = files(&whole);
    std::fs::write(&template, "another").expect("writable");
    let error = fails(run(&locked, &whole, &[]).arg("--overwrite"), 2);
    assert!(error.contains("the file or folder of `write.labels.template.file` has changed"), "{error}");
    assert!(files(&whole) == before, "something was deleted");
}
