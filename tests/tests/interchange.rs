//! One dataset in all formats at once: each is read by its own reader, and says the same.

mod support;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;
use support::{assert_same, assets, ok, root, skip, syntable, text};
use syntable_model::product::standard::{AMODAL_MASK, VISIBLE_MASK};
use syntable_model::product::{Key, Mask, PerInstance};
use syntable_model::reader;
use syntable_standard as _;

/// All writers of formats, and those of any product.
const WRITERS: &str = "write={ syntable = {}, coco = {}, coco_panoptic = {}, cocoa = {}, kins = {}, d2sa = {}, insta_order = {}, \
                       uoais = {}, osd_amodal = {}, yolo = {}, bop = { models = \"models\" }, parquet = {}, hdf5 = {}, npz = {}, png = {}, jsonl = { include = [\
                       \"visible_mask\", \"amodal_mask\", \"occlusion_areas\", \"depth_order\", \"seen_in_views\"] }, \
                       exr = { include = [\"depth\", \"distance\"] }, npy = { include = [\"amodal_depth\", \
                       \"object_coordinates\", \"occlusion_boundary\", \"category_map\", \"tabletop_mask\"] } }";

/// A dataset of real objects where they are there, else of embedded ones.
fn dataset(out: &Path) {
    // The small folder of the checkout comes first, a larger one after it.
    let real = assets().into_iter().nth(1);
    let base = if real.is_some() { "real-objects" } else { "window-room" };
    // BOP's cameras have no distortion.
    let text = format!("extends = \"builtin:{base}\"\nremove = [\"camera.distortion\"]\n[dataset]\nname = \"all\"\n");
    let recipe = out.with_extension("toml");
    std::fs::write(&recipe, text).expect("writable");
    let mut run = syntable();
    run.arg("run").arg(recipe).arg("--out").arg(out);
    for set in [
        "camera.resolution=[160, 120]",
        "render.samples_per_pixel=1",
        "denoise.kind=\"none\"",
        "dataset.scenes=3",
        "dataset.views_per_scene=4",
        WRITERS,
    ] {
        run.args(["--set", set]);
    }
    if let Some(folder) = real {
        run.env("ASSETS", folder);
    }
    ok(&mut run);
}

/// Run lengths of the visible and amodal masks of each image, by scene and view, sorted.
type Masks = BTreeMap<(u32, u32), Vec<[Vec<u32>; 2]>>;

fn masks(root: &Path, format: &str) -> Masks {
    let (_, dataset) = reader::open(root, Some(format)).expect("a dataset");
    let found = syntable_runtime::validate::validate(&*dataset, 2).expect("checked");
    assert!(found.is_sound(), "{format}: {:?}", found.faults);
    let wants = [VISIBLE_MASK.id(), AMODAL_MASK.id()];
    let of = |(number, image): (usize, &reader::ImageRef)| {
        let (_, products) = dataset.read(number, &wants).expect("readable");
        let all = |key: Key<PerInstance<Mask>>| {
            let masks = products.get(key).expect("offered");
            masks.iter().map(|(_, mask)| mask.counts().to_vec()).collect::<Vec<_>>()
        };
        let pairs = all(VISIBLE_MASK).into_iter().zip(all(AMODAL_MASK));
        let mut pairs: Vec<[Vec<u32>; 2]> = pairs.map(|(visible, amodal)| [visible, amodal]).collect();
        pairs.sort();
        ((image.scene.0, image.view.0), pairs)
    };
    dataset.images().iter().enumerate().map(of).collect()
}

#[test]
fn all_formats_say_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data");
    dataset(&data);
    let ours = masks(&data, "syntable");
    assert_eq!(ours.len(), 12);
    assert!(ours.values().map(Vec::len).sum::<usize>() > 30);
    assert!(ours == masks(&data.join("coco"), "coco"), "coco");
    assert!(ours == masks(&data.join("bop"), "bop"), "bop");
    assert!(ours == masks(&data.join("d2sa"), "coco"), "d2sa");
    // Written by the run, and converted from another format: the same files.
    for (from, format, to, is_exact) in [
        ("", "syntable", "coco", true),
        ("", "syntable", "yolo", true),
        ("coco", "coco", "yolo", true),
        // Its depth is rounded, ours was truncated.
        ("", "syntable", "uoais", false),
        // BOP has no ids of instances, names and classes.
        ("bop", "bop", "coco", false),
    ] {
        let out = folder.path().join(format!("{format} to {to}"));
        let mut convert = syntable();
        convert.arg("convert").arg(data.join(from)).args(["--format", format, "--to", to, "--out"]).arg(&out);
        ok(&mut convert);
        if is_exact {
            assert_same(&data.join(to), &out.join(to));
        } else {
            assert!(ours == masks(&out.join(to), "coco"), "{format} to {to}");
        }
    }
    let here = Command::new("python3").args(["-c", "import numpy, pycocotools, PIL, h5py, pyarrow"]).output();
    if !here.is_ok_and(|output| output.status.success()) {
        return skip("python3 with numpy, pycocotools, Pillow, h5py and pyarrow");
    }
    let output =
        Command::new("python3").arg(root().join("tests/check_formats.py")).arg(&data).output().expect("starts");
    assert!(output.status.success(), "{}", text(&output));
    let compared: BTreeSet<String> = text(&output).split_whitespace().map(str::to_owned).collect();
    for format in
        ["coco", "cocoa", "kins", "d2sa", "panoptic", "uoais", "osd", "hdf5", "parquet", "models", "npz", "orders"]
    {
        assert!(compared.contains(format), "{format} was not compared: {compared:?}");
    }
}
