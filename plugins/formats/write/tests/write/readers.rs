//! Reads the written files with other programs: pycocotools, NumPy, Pillow, and code that reads like UOAIS-Net's
//! loader.

use syntable_model::prelude::*;
use syntable_testing::takes::write_all;
use syntable_testing::tools::{own_script, python, shared_script};
use syntable_write as _;

#[test]
fn syntable_datasets_pass_the_checker() {
    for (options, compat) in [
        ("", "coco"),
        ("bbox = \"amodal\"\nskip_empty_images = true", "coco"),
        ("compat = \"syntable_1\"", "syntable_1"),
        ("debug_masks = true", "coco"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        write_all(folder.path(), "syntable", "syntable", options);
        let root = folder.path().to_str().expect("UTF-8");
        if python(&shared_script("check_dataset.py"), &[root, "--compat", compat]) && !options.starts_with("debug") {
            // SynTable's evaluation needs the syntable_1 form; UOAIS-Net's reader accepts both.
            python(&shared_script("uoais_reader.py"), &[root, compat]);
        }
    }
}

#[test]
fn the_checker_finds_what_is_wrong() {
    let folder = tempfile::tempdir().expect("a folder");
    write_all(folder.path(), "syntable", "syntable", "");
    let root = folder.path().to_str().expect("UTF-8");
    if !python(&shared_script("check_dataset.py"), &[root]) {
        return;
    }
    let file = folder.path().join("annotation_final.json");
    let text = std::fs::read_to_string(&file).expect("there");
    let mut json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let other = json.pointer("/annotations/1/visible_mask").expect("there").clone();
    // One fault each, in different places, and the resulting message.
    let faults = [
        ("/annotations/0/area", 1.into(), "annotation 1: areas [1,"),
        ("/annotations/1/visible_bbox/2", 99.into(), "annotation 2: visible_bbox"),
        ("/annotations/1/occluded_rate", 0.123.into(), "annotation 2: rate 0.123, not"),
        ("/annotations/3/id", 1.into(), "annotation ids are not 1, 2, 3"),
        ("/annotations/2/visible_mask", other, "annotation 3: visible"),
        ("/images/0/instance_ids/0", 44.into(), "image 1: instance_ids"),
        ("/images/0/camera/world_from_camera/0/0", 5.into(), "image 1: world_from_camera is not a rigid motion"),
        ("/images/1/file_name", "data/mono/rgb/0_0.png".into(), "image 2: file names do not belong together"),
        ("/images/4/width", 65.into(), "image 5: data/mono/rgb/1_1.png: PNG RGB (64, 48)"),
    ];
    for (pointer, value, _) in &faults {
        *json.pointer_mut(pointer).expect("there") = serde_json::Value::clone(value);
    }
    std::fs::write(&file, json.to_string()).expect("writable");
    let order = folder.path().join("data/mono/occlusion_order/1_0.npy");
    let mut bytes = std::fs::read(&order).expect("there");
    *bytes.last_mut().expect("not empty") = 0x3f;
    std::fs::write(order, bytes).expect("writable");
    std::fs::remove_file(folder.path().join("data/mono/depth/2_2.png")).expect("there");

    let output = std::process::Command::new("python3")
        .arg(shared_script("check_dataset.py"))
        .arg(root)
        .output()
        .expect("starts");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}");
    let others = [
        "rgb, depth and occlusion_order do not have the same files",
        "image 4: 1_0.npy: not the order of the masks",
        "image 9: FileNotFoundError",
    ];
    for want in faults.iter().map(|(_, _, want)| *want).chain(others) {
        assert!(said.contains(want), "`{want}` is not in\n{said}");
    }
}

#[test]
fn images_and_arrays_hold_the_values() {
    let folder = tempfile::tempdir().expect("a folder");
    let both = "\"rgb\", \"depth\", \"instance\", \"normal\", \"visible_mask\", \"amodal_mask\"";
    let arrays = format!("{both}, \"amodal_box\", \"occlusion_rate\", \"occlusion_order\"");
    write_all(folder.path(), "png", "png", &format!("include = [{both}, \"albedo\"]\ndepth_scale_mm = 0.25"));
    write_all(folder.path(), "npy", "npy", &format!("include = [{arrays}]"));
    write_all(folder.path(), "all", "jsonl", &format!("include = [{arrays}]"));
    python(&own_script("check_files.py"), &[folder.path().to_str().expect("UTF-8")]);
}

#[test]
fn archives_equal_the_run_lengths() {
    let folder = tempfile::tempdir().expect("a folder");
    let labels =
        "\"visible_mask\", \"amodal_mask\", \"visible_box\", \"amodal_box\", \"category_id\", \"occlusion_order\"";
    let records = "\"camera\", \"object_name\", \"object_info\"";
    write_all(folder.path(), "all", "jsonl", &format!("include = [{labels}, {records}, \"rgb\", \"depth\"]"));
    let all = format!(
        "include = [\"rgb\", \"depth\", \"visible_ids\", \"amodal_bits\", \"visible_box\", \"amodal_box\", \
         \"category_id\", \"occlusion_order\", {records}]"
    );
    for (id, options) in [("npz", ""), ("plain", "compress = false"), ("records", &all)] {
        write_all(folder.path(), id, "npz", options);
        python(&own_script("check_npz.py"), &[folder.path().to_str().expect("UTF-8"), id]);
    }
}

#[test]
fn run_lengths_equal_pycocotools() {
    let mut stream = Stream::root(3);
    let mut lines = String::new();
    for i in 0..400 {
        let (width, height) = (stream.integer(1, 40) as u32, stream.integer(1, 40) as u32);
        // From sparse noise to long runs, whose differences are negative and take several letters.
        let smooth = [1, 3, 11, 200][i % 4];
        let bits: Vec<bool> = {
            let mut value = stream.chance(0.5);
            let mut next = || {
                if stream.below(smooth) == 0 {
                    value = stream.chance(0.5);
                }
                value
            };
            (0..width * height).map(|_| next()).collect()
        };
        let mask = Mask::from_fn(width, height, |x, y| bits[(x * height + y) as usize]);
        let plane = mask.to_plane();
        let rows: Vec<String> = plane
            .data()
            .chunks(width as usize)
            .map(|row| row.iter().map(|&bit| if bit { '1' } else { '0' }).collect())
            .collect();
        let bbox = <[i32; 4]>::from(mask.bbox());
        let line = serde_json::json!({
            "size": [height, width], "counts": mask.to_coco(), "rows": rows, "area": mask.area(), "bbox": bbox,
        });
        lines += &format!("{line}\n");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("masks.jsonl");
    std::fs::write(&file, lines).expect("writable");
    python(&own_script("check_runs.py"), &[file.to_str().expect("UTF-8")]);
}
