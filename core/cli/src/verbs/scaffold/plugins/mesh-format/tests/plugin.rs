// The program reads a file of the format, and a damaged file is an error that names it.

use off_mesh as _;
use std::fs;
use syntable::Quiet;
use syntable_mesh::inspect::mesh_file;

#[test]
fn triangles_match_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("sample.off");
    fs::write(&path, include_str!("../sample.off")).expect("writable");
    let facts = mesh_file(&path, &Quiet).expect("sound").facts;
    assert!(facts.contains(&("triangles".into(), "4".into())), "{facts:?}");
    fs::write(&path, "OFF 3 1 0\n0 0 0 1 0").expect("writable");
    let error = mesh_file(&path, &Quiet).expect_err("it ends early").to_string();
    assert!(error.contains("sample.off") && error.contains("ends early"), "{error}");
}
