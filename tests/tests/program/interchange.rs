//! One dataset in all formats at once: each is read by its own reader, and says the same.

use crate::support::{assert_same, assets, ok, root, skip, syntable, text};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;
use syntable_model::product::standard::{AMODAL_MASK, DEPTH, DISTANCE, VISIBLE_MASK};
use syntable_model::product::{Key, Mask, PerInstance};
use syntable_model::reader;
use syntable_standard as _;

/// All writers of formats, and those of any product.
const WRITERS: &str = "write={ syntable = {}, coco = {}, coco_panoptic = {}, cocoa = {}, kins = {}, d2sa = {}, insta_order = {}, \
                       uoais = {}, osd_amodal = {}, yolo = {}, bop = { models = \"models\" }, web = { kind = \"bop\", layout = \"webdataset\" }, webdataset = {}, parquet = {}, hdf5 = {}, npz = {}, png = {}, jsonl = { include = [\
                       \"visible_mask\", \"amodal_mask\", \"occlusion_areas\", \"depth_order\", \"seen_in_views\"] }, \
                       exr = { include = [\"depth\", \"distance\"] }, npy = { include = [\"amodal_depth\", \
                       \"object_coordinates\", \"occlusion_boundary\", \"category_map\", \"tabletop_mask\"] } }";

/// Width and height of the images, px.
const SIZE: [u32; 2] = [160, 120];

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
        &format!("camera.resolution={SIZE:?}"),
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
    let offers_amodal = dataset.offers().contains(&AMODAL_MASK.id());
    let wants = dataset.offers();
    let of = |(number, image): (usize, &reader::ImageRef)| {
        let (_, products) = dataset.read(number, &wants).expect("readable");
        let all = |key: Key<PerInstance<Mask>>| {
            let masks = products.get(key).expect("offered");
            masks.iter().map(|(_, mask)| mask.counts().to_vec()).collect::<Vec<_>>()
        };
        let amodal = if offers_amodal { AMODAL_MASK } else { VISIBLE_MASK };
        let pairs = all(VISIBLE_MASK).into_iter().zip(all(amodal));
        let mut pairs: Vec<[Vec<u32>; 2]> = pairs.map(|(visible, amodal)| [visible, amodal]).collect();
        pairs.sort();
        ((image.scene.0, image.view.0), pairs)
    };
    dataset.images().iter().enumerate().map(of).collect()
}

/// Pixels of a mask and of its holes: of what cannot be reached from beyond the image without crossing it.
fn filled(counts: &[u32]) -> u32 {
    let mask = Mask::from_counts(SIZE[0], SIZE[1], counts).expect("a mask").to_plane();
    // One pixel of background all around.
    let [width, height] = SIZE.map(|edge| edge as i32 + 2);
    let is_free = |x: i32, y: i32| {
        let inside = (1..width - 1).contains(&x) && (1..height - 1).contains(&y);
        !inside || !*mask.at(x as u32 - 1, y as u32 - 1)
    };
    let mut reached = BTreeSet::from([(0, 0)]);
    let mut open = vec![(0, 0)];
    while let Some((x, y)) = open.pop() {
        for (x, y) in (-1..2).flat_map(|dx| (-1..2).map(move |dy| (x + dx, y + dy))) {
            let is_there = (0..width).contains(&x) && (0..height).contains(&y);
            if is_there && is_free(x, y) && reached.insert((x, y)) {
                open.push((x, y));
            }
        }
    }
    (width * height) as u32 - reached.len() as u32
}

/// Images have as many objects, and each a mask of about the same area, to an edge of half a pixel and with or without holes,
/// which polygons fill.
fn assert_close(expected: &Masks, found: &Masks, format: &str) {
    for (at, objects) in expected {
        let others = found.get(at).map_or(&[][..], Vec::as_slice);
        assert_eq!(others.len(), objects.len(), "{format}: objects of {at:?}");
        for which in 0..2 {
            let sorted = |objects: &[[Vec<u32>; 2]]| {
                let mut areas: Vec<u32> = objects.iter().map(|masks| filled(&masks[which])).collect();
                areas.sort_unstable();
                areas
            };
            for (a, b) in sorted(objects).into_iter().zip(sorted(others)) {
                let tolerance = 4.0 + 2.5 * f64::from(a).sqrt();
                assert!(f64::from(a.abs_diff(b)) <= tolerance, "{format}: {at:?}: {a} and {b} pixels");
            }
        }
    }
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
    assert!(ours == masks(&data.join("d2sa"), "d2sa"), "d2sa");
    for (path, format) in
        [("web", "bop"), ("webdataset", "webdataset"), ("npz", "npz"), ("jsonl.jsonl", "jsonl"), ("parquet", "parquet")]
    {
        assert!(ours == masks(&data.join(path), format), "{path}");
    }
    // Objects that images do not show are left out, and so are images of such objects alone.
    let mut shown = ours.clone();
    shown.values_mut().for_each(|objects| objects.retain(|[visible, _]| visible.len() > 1));
    shown.retain(|_, objects| !objects.is_empty());
    let osd: Vec<_> = masks(&data.join("osd_amodal"), "osd_amodal").into_values().collect();
    assert!(osd == shown.values().cloned().collect::<Vec<_>>(), "osd_amodal");
    // Polygons are around masks to half a pixel.
    assert_close(&shown, &masks(&data.join("kins"), "kins"), "kins");
    assert_close(&ours, &masks(&data.join("cocoa"), "cocoa"), "cocoa");
    let visible: Masks = shown
        .iter()
        .map(|(at, objects)| (*at, objects.iter().map(|[it, _]| [it.clone(), it.clone()]).collect()))
        .collect();
    assert_close(&visible, &masks(&data.join("yolo"), "yolo"), "yolo");
    assert!(visible == masks(&data.join("hdf5"), "hdf5"), "hdf5");
    // Written by the run, and converted from another format: the same files.
    for (from, format, to, is_exact) in [
        ("", "syntable", "coco", true),
        ("", "syntable", "yolo", true),
        ("coco", "coco", "yolo", true),
        ("web", "bop", "yolo", false),
        // These do not say what the dataset is called.
        ("webdataset", "webdataset", "coco", false),
        ("npz", "npz", "coco", false),
        ("parquet", "parquet", "yolo", true),
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
            let found = masks(&out.join(to), if to == "uoais" { "coco" } else { to });
            match to {
                "yolo" => assert_close(&visible, &found, to),
                _ => assert!(ours == found, "{format} to {to}"),
            }
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

/// Images have the same products.
fn assert_same_products(one: &Path, other: &Path) {
    let [one, other] = [one, other].map(|root| reader::open(root, None).expect("a dataset").1);
    assert_eq!((one.images(), one.offers()), (other.images(), other.offers()));
    for image in 0..one.images().len() {
        let [a, b] = [&one, &other].map(|it| it.read(image, &it.offers()).expect("readable").1);
        for key in one.offers() {
            let name = key.name.to_string();
            assert!(a.value(&name).expect("there") == b.value(&name).expect("there"), "{name} of image {image}");
        }
    }
}

#[test]
fn what_formats_have_in_common_comes_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    dataset(&path("ours"));
    let convert = |from: &str, to: &str, out: &str| {
        let mut convert = syntable();
        convert.arg("convert").arg(path(from)).args(["--to", to, "--out"]).arg(path(out));
        ok(&mut convert)
    };
    let ours = masks(&path("ours"), "syntable");
    // Products under their names: all of them come back, and are written the same again.
    for format in ["webdataset", "npz", "jsonl", "parquet"] {
        convert("ours", format, format);
        let again = format!("{format} again");
        let said = convert(format, format, &again);
        assert!(!said.contains("not carried over") && !said.contains("left out"), "{said}");
        match format {
            // It says which program wrote it.
            "parquet" => assert_same_products(&path(format), &path(&again)),
            _ => assert_same(&path(format), &path(&again)),
        }
    }
    // What is not there is left out of lists that nobody gave, and said; of a list that was given, it is an error.
    convert("ours", "coco", "coco");
    let said = convert("coco", "parquet,hdf5", "tables");
    assert!(said.contains("not in the dataset, and left out:"), "{said}");
    for missing in ["camera", "object_info", "depth", "normal"] {
        assert!(said.contains(missing), "{missing}: {said}");
    }
    assert!(masks(&path("tables/parquet"), "parquet") == ours);
    let mut given = syntable();
    given.arg("convert").arg(path("coco")).args(["--to", "parquet", "--out"]).arg(path("given"));
    let output = given.args(["--set", "parquet.include=[\"camera\", \"visible_box\"]"]).output().expect("starts");
    assert!(output.status.code() == Some(2) && text(&output).contains("reads `camera`"), "{}", text(&output));
    // Cameras of the dataset are those of the writers.
    convert("ours", "hdf5", "files");
    let (_, files) = reader::open(&path("files"), None).expect("a dataset");
    let (_, products) = files.read(0, &[DISTANCE.id(), DEPTH.id()]).expect("readable");
    let pairs = products.get(DISTANCE).expect("there").data().iter().zip(products.get(DEPTH).expect("there").data());
    let seen: Vec<(f32, f32)> =
        pairs.map(|(distance, depth)| (*distance, *depth)).filter(|it| it.1.is_finite()).collect();
    assert!(seen.len() > 1000 && seen.iter().all(|(distance, depth)| (1.0..2.0).contains(&(distance / depth))));
    std::fs::remove_dir_all(path("coco")).expect("there");
    for format in ["coco", "bop", "yolo", "kins", "cocoa", "d2sa"] {
        let there = convert("ours", format, format);
        assert!(there.contains("12 images of 3 scenes written, read as syntable"), "{there}");
        let said = ok(syntable().arg("validate").arg(path(format)));
        assert!(said.contains(&format!("12 images, read as {format}: no fault")) || format == "cocoa", "{said}");
        // Back to our layout, which is sound whatever it lacks, and there again.
        let back = format!("{format} to ours");
        convert(format, "syntable", &back);
        assert!(ok(syntable().arg("validate").arg(path(&back))).contains("read as syntable: no fault"));
        if ["coco", "bop", "d2sa"].contains(&format) {
            assert!(masks(&path(&back), "syntable") == ours, "{format}");
        }
        let again = format!("{format} again");
        convert(&back, format, &again);
        if ["coco", "d2sa"].contains(&format) {
            assert_same(&path(format), &path(&again));
        }
        if format == "bop" {
            // Counts beyond the image and names of assets are lost on the way, as is said.
            for scene in ["000000", "000001", "000002"] {
                for name in ["rgb", "depth", "mask", "mask_visib"] {
                    let of = |dataset: &str| path(dataset).join("bop/train_pbr").join(scene).join(name);
                    assert_same(&of("bop"), &of(&again));
                }
            }
        }
    }
}
