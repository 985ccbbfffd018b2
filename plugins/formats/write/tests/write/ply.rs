//! Point clouds, read by a parser of the PLY format.

use syntable_testing::takes::{write_all, writer};
use syntable_testing::tools::{own_script, python};
use syntable_write as _;

#[test]
fn points_project_to_their_pixels() {
    let folder = tempfile::tempdir().expect("a folder");
    write_all(folder.path(), "world", "ply", "");
    write_all(folder.path(), "camera", "ply", "frame = \"camera\"\ncolors = false");
    write_all(folder.path(), "bare", "ply", "frame = \"camera\"\ncolors = false\ninstances = false");
    write_all(folder.path(), "npy", "npy", "include = [\"depth\", \"rgb\", \"instance\"]");
    write_all(folder.path(), "all", "jsonl", "include = [\"camera\"]");
    python(&own_script("check_ply.py"), &[folder.path().to_str().expect("UTF-8")]);
}

#[test]
fn what_is_asked_for_is_read_and_nothing_else() {
    let reads = |options: &str| -> Vec<String> {
        let writer = writer("ply", options).expect("good options");
        writer.reads().into_iter().map(|input| input.product).collect()
    };
    assert_eq!(reads(""), ["depth", "camera", "rgb", "instance"]);
    assert_eq!(reads("depth = \"depth_sensed\"\ncolors = false\ninstances = false"), ["depth_sensed", "camera"]);
}
