//! Splits: datasets of different names share no random numbers.

use crate::support::{ok, syntable};
use std::collections::BTreeSet;
use std::path::Path;

/// What is sampled for each view of a small dataset: camera, lights, table and objects, without its name.
fn sampled(folder: &Path, name: &str) -> Vec<serde_json::Value> {
    let recipe = folder.join(format!("{name}.toml"));
    let text = format!(
        "extends = {:?}\nremove = [\"write.syntable\", \"write.contact_sheet\"]\n\
         [dataset]\nname = \"{name}\"\nscenes = 2\nviews_per_scene = 2\n[settle]\nkind = \"none\"\n\
         [camera]\nresolution = [32, 24]\n\
         [write.jsonl]\ninclude = [\"camera\", \"lights\", \"object_info\"]\n",
        crate::support::root().join("recipes/quickstart.toml").display().to_string()
    );
    std::fs::write(&recipe, text).expect("writable");
    let out = folder.join(format!("dataset-{name}"));
    ok(syntable().arg("run").arg(recipe).arg("--out").arg(&out));
    let lines = std::fs::read_to_string(out.join("jsonl.jsonl")).expect("written");
    lines.lines().map(|line| serde_json::from_str(line).expect("a record")).collect()
}

#[test]
fn splits_are_independent() {
    let folder = tempfile::tempdir().expect("a folder");
    let [train, val] = ["train", "val"].map(|name| sampled(folder.path(), name));
    assert_eq!((train.len(), val.len()), (4, 4));
    for (mine, other) in train.iter().zip(&val) {
        for product in ["camera", "lights", "object_info"] {
            assert_ne!(mine[product], other[product], "{product}");
        }
    }
    // No camera of one split is a camera of the other, whatever the scene.
    let poses = |records: &[serde_json::Value]| -> BTreeSet<String> {
        records.iter().map(|record| record["camera"]["world_from_camera"].to_string()).collect()
    };
    assert!(poses(&train).is_disjoint(&poses(&val)) && poses(&train).len() == 4);
    // The same name gives the same dataset.
    let again = tempfile::tempdir().expect("a folder");
    assert_eq!(sampled(again.path(), "train"), train);
}
