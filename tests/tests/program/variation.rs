//! Objects of other sizes and colors than their assets.

use crate::support::{convert, fails, files, ok, small_dataset, syntable};
use serde_json::Value;
use std::fs;

const SIZES: &str = "place.objects.scale={ uniform = [0.6, 1.4] }";
const COLORS: &str = "place.objects.color={ hue_deg = { uniform = [-180, 180] } }";

#[test]
fn formats_without_sizes_are_refused_and_lose_the_objects_of_other_sizes() {
    let check = |sets: &[&str]| {
        let mut check = syntable();
        check.args(["check", "builtin:quickstart", "--set", "write={ bop = {} }"]);
        for set in sets {
            check.args(["--set", set]);
        }
        check
    };
    let error = fails(&mut check(&[SIZES]), 2);
    for says in [
        "D0024",
        "`write.bop` describes each object by its asset and a pose, without a size, and step `objects` of [[place]] varies",
        "remove `scale` from the step",
    ] {
        assert!(error.contains(says), "{says} is not in\n{error}");
    }
    // Colors are no matter of poses, and no label describes distractors.
    let unlabeled = "place.objects={ kind = \"distractors\", from = [\"objects\"], scale = 2.0 }";
    ok(&mut check(&[COLORS, "place.objects.scale=1.0"]));
    let error = fails(&mut check(&[unlabeled]), 2);
    assert!(error.contains("places objects") && !error.contains("D0024"), "{error}");

    let folder = tempfile::tempdir().expect("a folder");
    let (data, bop) = (folder.path().join("data"), folder.path().join("bop"));
    // Every other object has the size of its asset.
    let sizes = "place.objects.scale={ choice = [1.0, 1.3] }";
    small_dataset(&data, &["write={ syntable = {} }", "dataset.scenes=1", sizes, COLORS]);
    let said = fails(&mut convert(&data, "bop", &bop), 3);
    assert!(said.contains("objects are left out: they differ in size from their models"), "{said}");
    let (_, annotations) =
        files(&data).into_iter().find(|(name, _)| name.ends_with("annotation_final.json")).expect("annotations");
    let infos = records_with(&serde_json::from_slice(&annotations).expect("JSON"), "camera_from_object");
    let resized = infos.iter().filter(|info| info["scale"] == 1.3).count();
    assert!(infos.iter().all(|info| info.get("scale").is_none_or(|scale| scale == 1.3)), "{infos:?}");
    let truth = fs::read(bop.join("bop/train_pbr/000000/scene_gt.json")).expect("written");
    let kept = records_with(&serde_json::from_slice(&truth).expect("JSON"), "cam_R_m2c").len();
    assert!(resized > 2 && kept > 2 && kept + resized == infos.len(), "{resized} {kept} {}", infos.len());
}

/// The objects anywhere in a JSON value that have a key.
fn records_with(json: &Value, key: &str) -> Vec<Value> {
    match json {
        Value::Object(fields) if fields.contains_key(key) => vec![json.clone()],
        Value::Object(fields) => fields.values().flat_map(|value| records_with(value, key)).collect(),
        Value::Array(values) => values.iter().flat_map(|value| records_with(value, key)).collect(),
        _ => Vec::new(),
    }
}
