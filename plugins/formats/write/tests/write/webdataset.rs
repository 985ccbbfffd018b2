//! WebDataset shards, read by the package webdataset, and compared with the files of the other writers.

use std::sync::OnceLock;
use syntable_model::product::standard::SETTLE_REPORT;
use syntable_testing::takes::{files, write_all, writer};
use syntable_testing::tools::{own_script, python_with};
use syntable_write as _;

const INCLUDE: &str = "include = [\"rgb\", \"depth\", \"visible_ids\", \"amodal_bits\", \"visible_box\", \
                       \"occlusion_rate\", \"visible_mask\", \"occlusion_order\", \"normal\", \"camera\", \"object_info\", \
                       \"denoiser\"]";

#[test]
fn webdataset_reads_the_values_of_the_other_writers() {
    static HERE: OnceLock<bool> = OnceLock::new();
    let folder = tempfile::tempdir().expect("a folder");
    write_all(folder.path(), "wds", "webdataset", INCLUDE);
    write_all(folder.path(), "float", "webdataset", "include = [\"depth\", \"rgb\"]\nfloats = \"exr\"");
    write_all(folder.path(), "png", "png", "include = [\"rgb\", \"visible_ids\"]");
    write_all(folder.path(), "exr", "exr", "include = [\"depth\"]");
    let arrays = "\"depth\", \"normal\", \"amodal_bits\", \"visible_box\", \"occlusion_rate\", \"visible_mask\"";
    write_all(folder.path(), "npy", "npy", &format!("include = [{arrays}, \"occlusion_order\"]"));
    write_all(folder.path(), "all", "jsonl", "include = [\"camera\", \"object_info\", \"denoiser\"]");
    let root = folder.path().to_str().expect("UTF-8");
    python_with("numpy, webdataset", &HERE, &own_script("check_webdataset.py"), &[root]);
}

#[test]
fn a_shard_is_a_scene() {
    let folder = tempfile::tempdir().expect("a folder");
    write_all(folder.path(), "wds", "webdataset", "");
    let names: Vec<String> = files(folder.path()).into_keys().collect();
    assert_eq!(names, ["wds/categories.json", "wds/wds-000000.tar", "wds/wds-000001.tar", "wds/wds-000002.tar"]);
    let input = writer("webdataset", "include = [\"settle_report\"]").expect("good options").reads().remove(0);
    assert!(input.accepts.check(&SETTLE_REPORT.id()).expect_err("refused").contains("a sample is a view"));
}
