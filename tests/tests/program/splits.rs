//! Splits: datasets with different names share no random numbers.

use crate::support::{ok, syntable};
use std::collections::BTreeSet;
use std::path::Path;

/// The samples for each view of a small dataset: camera, lights, table and objects, without the dataset's name.
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
    // No camera of one split occurs in the other split, in any scene.
    let poses = |records: &[serde_json::Value]| -> BTreeSet<String> {
        records.iter().map(|record| record["camera"]["world_from_camera"].to_string()).collect()
    };
    assert!(poses(&train).is_disjoint(&poses(&val)) && poses(&train).len() == 4);
    // The same name gives the same dataset.
    let again = tempfile::tempdir().expect("a folder");
    assert_eq!(sampled(again.path(), "train"), train);
}

#[test]
fn the_parts_of_a_split_are_listed_with_licenses_and_chances() {
    let folder = tempfile::tempdir().expect("a folder");
    let recipe = folder.path().join("val.toml");
    let text = format!(
        "extends = {:?}\n[assets.objects]\nkind = \"household\"\ninclude = [\"mug_000*\", \"bowl_000*\"]\n\
         split = {{ part = \"val\", val_count = 3, test_count = 5 }}\n\
         [assets.mine]\nkind = \"household\"\ninclude = [\"can_0001\", \"can_0002\"]\nlicense = \"MIT\"\n\
         [set]\n\"place.objects.from\" = {{ objects = 3, mine = 1 }}\n",
        crate::support::root().join("recipes/quickstart.toml").display().to_string()
    );
    std::fs::write(&recipe, text).expect("writable");
    let said = syntable().arg("check").arg(&recipe).output().expect("it starts");
    let [out, err] = [&said.stdout, &said.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
    let sizes = "3 of 20 assets, part `val` (train 12, val 3, test 5)";
    assert!(out.contains(&format!("assets.objects: {sizes}\n")), "{out}{err}");
    assert!(err.contains(&format!("assets.objects: {sizes}: fewer than 5")), "{err}");
    let json = ok(syntable().args(["list", "assets", "--json"]).arg(&recipe));
    let rows: Vec<serde_json::Value> = json.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let of = |pool: &str, part: &str| -> Vec<&serde_json::Value> {
        rows.iter().filter(|row| row["pool"] == pool && row["part"] == *part).collect()
    };
    assert_eq!([of("objects", "val").len(), of("objects", "test").len()], [3, 5]);
    let option = "place.objects.from";
    for row in of("objects", "val") {
        assert_eq!((row["draws"][option].as_f64(), row["license"].as_str()), (Some(0.25), Some("CC0-1.0")));
    }
    assert!(of("objects", "train").iter().all(|row| row["draws"] == serde_json::json!({})));
    let mine: Vec<&serde_json::Value> = rows.iter().filter(|row| row["pool"] == "mine").collect();
    assert!(mine.len() == 2 && mine.iter().all(|row| row["draws"][option] == 0.125 && row["license"] == "MIT"));
}
