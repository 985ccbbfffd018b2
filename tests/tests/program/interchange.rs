//! One dataset in all formats at once: each format's reader returns the same labels.

use crate::support::{self, assert_same, assets, checked, convert, ok, root, skip, syntable, text};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;
use syntable_model::product::standard::{
    AMODAL_MASK, CATEGORY_ID, DEPTH, DISTANCE, OBJECT_INFO, OBJECT_NAME, VISIBLE_MASK,
};
use syntable_model::product::{Key, Mask, PerInstance};
use syntable_model::reader;
use syntable_program as _;
use syntable_testing::takes::open_dataset;

/// All writers of formats, and the generic writers.
const WRITERS: &str = "write={ syntable = {}, coco = {}, coco_panoptic = {}, cocoa = {}, kins = {}, d2sa = {}, insta_order = {}, \
                       uoais = {}, osd_amodal = {}, yolo = {}, bop = { models = \"models\" }, web = { kind = \"bop\", layout = \"webdataset\" }, webdataset = {}, parquet = {}, hdf5 = {}, npz = {}, png = {}, jsonl = { include = [\
                       \"visible_mask\", \"amodal_mask\", \"occlusion_areas\", \"depth_order\", \"seen_in_views\"] }, \
                       exr = { include = [\"depth\", \"distance\"] }, npy = { include = [\"amodal_depth\", \
                       \"object_coordinates\", \"occlusion_boundary\", \"category_map\", \"tabletop_mask\"] } }";

/// Width and height of the images, px.
const SIZE: [u32; 2] = [160, 120];

/// A dataset of real objects if they are available, otherwise of embedded ones.
fn dataset(out: &Path) {
    // The small folder of the checkout comes first, then a larger folder.
    let real = assets().into_iter().nth(1);
    let base = if real.is_some() { "real-objects" } else { "window-room" };
    // BOP's cameras have no distortion.
    let text = format!("extends = \"builtin:{base}\"\nremove = [\"camera.distortion\"]\n[dataset]\nname = \"all\"\n");
    let recipe = out.with_extension("toml");
    std::fs::write(&recipe, text).expect("writable");
    let mut run = syntable();
    run.arg("run").arg(recipe).arg("--out").arg(out);
    for set in [
        "dataset.seed=7",
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
    support::made(&mut run);
}

/// Run lengths of the visible and amodal masks of each image, by scene and view, sorted.
pub type Masks = BTreeMap<(u32, u32), Vec<[Vec<u32>; 2]>>;

pub fn masks(root: &Path, format: &str) -> Masks {
    let (_, dataset) = open_dataset(root, Some(format)).expect("a dataset");
    let found = checked(&dataset).expect("checked");
    assert!(found.is_sound(), "{format}: {:?}", found.faults);
    let offers_amodal = dataset.offers.contains(&AMODAL_MASK.id());
    let wants = &dataset.offers;
    let of = |(number, image): (usize, &reader::ImageRef)| {
        let products = dataset.read(number, wants).expect("readable").products;
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
    dataset.images.iter().enumerate().map(of).collect()
}

/// Number of pixels in a mask and its holes, which cannot be reached from outside the image without crossing the mask.
fn filled(counts: &[u32]) -> u32 {
    let mask = Mask::from_counts(SIZE[0], SIZE[1], counts).expect("a mask").to_plane();
    // With one pixel of background on each side.
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

/// Checks that images have the same number of objects, and that the area of each mask is about the same: within half a
/// pixel along its edge, and with or without holes, which polygons fill.
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
    // Objects without visible pixels are omitted, and so are images with only such objects.
    let mut shown = ours.clone();
    shown.values_mut().for_each(|objects| objects.retain(|[visible, _]| visible.len() > 1));
    shown.retain(|_, objects| !objects.is_empty());
    let osd: Vec<_> = masks(&data.join("osd_amodal"), "osd_amodal").into_values().collect();
    assert!(osd == shown.values().cloned().collect::<Vec<_>>(), "osd_amodal");
    // Polygons follow masks to half a pixel.
    assert_close(&shown, &masks(&data.join("kins"), "kins"), "kins");
    assert_close(&ours, &masks(&data.join("cocoa"), "cocoa"), "cocoa");
    let visible: Masks = shown
        .iter()
        .map(|(at, objects)| (*at, objects.iter().map(|[it, _]| [it.clone(), it.clone()]).collect()))
        .collect();
    assert_close(&visible, &masks(&data.join("yolo"), "yolo"), "yolo");
    assert!(visible == masks(&data.join("hdf5"), "hdf5"), "hdf5");
    // The run and a conversion from another format must write the same files.
    for (from, format, to, is_exact) in [
        ("", "syntable", "coco", true),
        ("", "syntable", "yolo", true),
        ("coco", "coco", "yolo", true),
        ("web", "bop", "yolo", false),
        // These formats do not store the name of the dataset.
        ("webdataset", "webdataset", "coco", false),
        ("npz", "npz", "coco", false),
        ("parquet", "parquet", "yolo", true),
        // Its depth is rounded, but ours was truncated.
        ("", "syntable", "uoais", false),
        // BOP has no instance ids, names and classes.
        ("bop", "bop", "coco", false),
    ] {
        let out = folder.path().join(format!("{format} to {to}"));
        let mut convert = syntable();
        convert.arg("convert").arg(data.join(from)).args(["--format", format, "--to", to, "--out"]).arg(&out);
        support::made(&mut convert);
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

/// Checks that images have the same products.
fn assert_same_products(one: &Path, other: &Path) {
    let [one, other] = [one, other].map(|root| open_dataset(root, None).expect("a dataset").1);
    assert_eq!((&one.images, &one.offers), (&other.images, &other.offers));
    for image in 0..one.images.len() {
        let [a, b] = [&one, &other].map(|it| it.read(image, &it.offers).expect("readable").products);
        for key in &one.offers {
            let name = key.to_string();
            assert!(a.value(&name).expect("there") == b.value(&name).expect("there"), "{name} of image {image}");
        }
    }
}

#[test]
fn what_formats_have_in_common_comes_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    dataset(&path("ours"));
    let convert = |from: &str, to: &str, out: &str| support::made(&mut convert(&path(from), to, &path(out)));
    let ours = masks(&path("ours"), "syntable");
    // Products under their own names: all of them are read back, and written again unchanged.
    for format in ["webdataset", "npz", "jsonl", "parquet"] {
        convert("ours", format, format);
        let again = format!("{format} again");
        let said = convert(format, format, &again);
        assert!(!said.contains("not carried over") && !said.contains("omitted"), "{said}");
        match format {
            // The file contains the name of the program that wrote it.
            "parquet" => assert_same_products(&path(format), &path(&again)),
            _ => assert_same(&path(format), &path(&again)),
        }
    }
    // Missing products are omitted from default lists, with a message. In a list that the user gave, they are an error.
    convert("ours", "coco", "coco");
    let said = convert("coco", "parquet,hdf5", "tables");
    assert!(said.contains("missing in the dataset, and therefore omitted:"), "{said}");
    for missing in ["camera", "object_info", "depth", "normal"] {
        assert!(said.contains(missing), "{missing}: {said}");
    }
    assert!(masks(&path("tables/parquet"), "parquet") == ours);
    let mut given = support::convert(&path("coco"), "parquet", &path("given"));
    let output = given.args(["--set", "parquet.include=[\"camera\", \"visible_box\"]"]).output().expect("starts");
    assert!(output.status.code() == Some(2) && text(&output).contains("reads `camera`"), "{}", text(&output));
    // Distances are computed with the camera of the dataset.
    convert("ours", "hdf5", "files");
    let (_, files) = open_dataset(&path("files"), None).expect("a dataset");
    let products = files.read(0, &[DISTANCE.id(), DEPTH.id()]).expect("readable").products;
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
        // Converts back to our layout, which is valid with any missing data, and forth again.
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
            // Pixel counts beyond the image and names of assets are lost on the way, which the conversion reports.
            for scene in ["000000", "000001", "000002"] {
                for name in ["rgb", "depth", "mask", "mask_visib"] {
                    let of = |dataset: &str| path(dataset).join("bop/train_pbr").join(scene).join(name);
                    assert_same(&of("bop"), &of(&again));
                }
            }
        }
    }
}

/// The vertices of a PLY file with their named properties, and the number of faces. In a binary file, all properties
/// are floats.
fn ply(path: &Path) -> (Vec<BTreeMap<String, f64>>, usize) {
    const END: &[u8] = b"end_header\n";
    let bytes = std::fs::read(path).expect("a PLY file");
    let end = bytes.windows(END.len()).position(|window| window == END).expect("a header") + END.len();
    let (header, body) = bytes.split_at(end);
    let header = std::str::from_utf8(header).expect("text");
    let (mut properties, mut counts) = (Vec::new(), BTreeMap::new());
    for words in header.lines().map(|line| line.split(' ').collect::<Vec<_>>()) {
        match words.as_slice() {
            ["element", what, count] => drop(counts.insert(*what, count.parse::<usize>().expect("a number"))),
            ["property", kind, name] if *kind != "list" => properties.push(*name),
            _ => {}
        }
    }
    let count = counts["vertex"];
    let rows: Vec<Vec<f64>> = if header.contains("format binary_little_endian") {
        let floats: Vec<f64> = body.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes).into()).collect();
        floats.chunks(properties.len()).take(count).map(<[f64]>::to_vec).collect()
    } else {
        let text = std::str::from_utf8(body).expect("text");
        let words = |line: &str| line.split_whitespace().map(|word| word.parse().expect("a number")).collect();
        text.lines().take(count).map(words).collect()
    };
    let named = |row: Vec<f64>| properties.iter().map(|name| (*name).to_owned()).zip(row).collect();
    (rows.into_iter().map(named).collect(), counts["face"])
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).expect("a file")).expect("JSON")
}

/// `m · p`, from a 4 × 4 or 3 × 3 matrix, row by row, and a translation.
fn moved(rotation: &[f64], translation: [f64; 3], p: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|row| (0..3).map(|i| rotation[3 * row + i] * p[i]).sum::<f64>() + translation[row])
}

fn numbers(value: &serde_json::Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|it| it.as_f64().expect("a number")).collect()
}

/// The files that scenes share below a dataset: for each digest, the file numbers on disk, the file names, and the
/// bytes of one file.
#[cfg(unix)]
fn shared_files(data: &Path) -> BTreeMap<String, (BTreeSet<u64>, Vec<String>, u64)> {
    use std::os::unix::fs::MetadataExt;
    let list = |folder: &Path| std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("there").path());
    let name = |path: &Path| path.file_name().expect("a name").to_string_lossy().into_owned();
    let of_digest = |folder: std::path::PathBuf| {
        let mut found = (BTreeSet::new(), Vec::new(), 0);
        for file in list(&folder) {
            let metadata = file.metadata().expect("there");
            found.0.insert(metadata.ino());
            found.1.push(name(&file));
            found.2 = metadata.len();
        }
        (name(&folder), found)
    };
    list(&data.join(".syntable/shards/bop/shared")).map(of_digest).collect()
}

#[cfg(unix)]
#[test]
fn models_of_several_scenes_take_disk_space_once() {
    let folder = tempfile::tempdir().expect("a folder");
    // Two objects with the same file names and the same mesh, but different textures.
    let fixture = root().join("tests/fixtures/assets/bop/ycbv/models");
    let pixel = |value: u8| image::RgbImage::from_fn(256, 256, |x, y| image::Rgb([x as u8, y as u8, value]));
    for (set, value) in [("a", 3), ("b", 250)] {
        let models = folder.path().join(set).join("models");
        std::fs::create_dir_all(&models).expect("writable");
        std::fs::copy(fixture.join("obj_000001.ply"), models.join("obj_000001.ply")).expect("writable");
        pixel(value).save(models.join("obj_000001.png")).expect("writable");
    }
    let pool =
        format!("assets.objects={{ kind=\"bop_models\", root={:?}, first_id=1 }}", folder.path().display().to_string());
    let writers = "write={ bop = { models = \"models\" } }";
    let more = ["--set", &pool, "--set", writers, "--set", "dataset.scenes=3", "--set", "place[2].count=6"];
    let run = |name: &str, scenes: &[&str]| {
        let out = folder.path().join("out").join(name);
        ok(crate::support::small_run(&out, &more).args(["--set", "dataset.views_per_scene=1"]).args(scenes));
        out
    };
    let whole = run("whole", &[]);
    run("resumed", &["--scenes", "0..1"]);
    let resumed = run("resumed", &[]);
    let parts = [run("first", &["--scenes", "0..1"]), run("second", &["--scenes", "1..3"])];
    let merged = folder.path().join("out/merged");
    ok(syntable().arg("merge").arg(&merged).args(&parts));
    for data in [&whole, &resumed, &merged] {
        crate::support::assert_same(&whole, data);
        let shared = shared_files(data);
        // One mesh and two textures.
        assert_eq!(shared.len(), 3, "{shared:?}");
        for (digest, (files, scenes, _)) in &shared {
            assert_eq!((files.len(), scenes.len()), (1, 3), "{}: {digest}: {scenes:?}", data.display());
        }
        // Disk usage: three files with nine names.
        let names: u64 = shared.values().map(|(_, scenes, bytes)| bytes * scenes.len() as u64).sum();
        let on_disk: u64 = shared.values().map(|(files, _, bytes)| bytes * files.len() as u64).sum();
        assert_eq!(names, 3 * on_disk);
        for (number, value) in [(1, 3), (2, 250)] {
            let texture = image::open(data.join(format!("bop/models/obj_{number:06}.png"))).expect("a texture");
            assert!(texture.into_rgb8() == pixel(value), "{number}");
        }
    }
}

#[test]
fn bop_models_keep_numbers_shapes_colors_and_symmetries() {
    let folder = tempfile::tempdir().expect("a folder");
    let (data, models) = (folder.path().join("data"), root().join("tests/fixtures/assets/bop"));
    let pool = format!("assets.objects={{ kind=\"bop_models\", root={:?} }}", models.display().to_string());
    let writers = "write={ bop = { models = \"models\" }, jsonl = { include = [\"object_info\"] } }";
    crate::support::small_dataset(&data, &[pool.as_str(), writers, "dataset.scenes=1", "dataset.views_per_scene=2"]);
    let bop = data.join("bop");
    let objects = json(&bop.join("objects.json"));
    let (infos, mut compared) = (json(&bop.join("models/models_info.json")), 0);
    let mut centers = BTreeMap::new();
    for (id, asset) in objects.as_object().expect("a table") {
        let (set, name) = asset.as_str().expect("a name").trim_start_matches("objects/").split_once('/').expect("two");
        let file = format!("obj_{:06}.ply", id.parse::<u64>().expect("a number"));
        assert_eq!(format!("{name}.ply"), file, "the number of the file");
        let [(own, own_faces), (found, faces)] =
            [&models.join(set).join("models"), &bop.join("models")].map(|folder| ply(&folder.join(&file)));
        assert_eq!(faces, own_faces, "{file}");
        // Every vertex is a vertex of the original, with its color or its texture coordinates.
        for vertex in &found {
            let is_near =
                |other: &BTreeMap<String, f64>| vertex.iter().all(|(key, value)| (other[key] - value).abs() < 1e-4);
            assert!(own.iter().any(is_near), "{file}: {vertex:?}");
            assert!(vertex.contains_key("red") != vertex.contains_key("texture_u"), "{file}: {vertex:?}");
            compared += 1;
        }
        let bound = |vertices: &[BTreeMap<String, f64>], axis: &str, of: fn(f64, f64) -> f64| {
            vertices.iter().map(|vertex| vertex[axis]).reduce(of).expect("vertices")
        };
        let center = ["x", "y", "z"].map(|axis| {
            let [low, high] = [f64::min as fn(f64, f64) -> f64, f64::max].map(|of| {
                assert!((bound(&own, axis, of) - bound(&found, axis, of)).abs() < 1e-4, "{file} {axis}");
                bound(&own, axis, of)
            });
            f64::midpoint(low, high)
        });
        centers.insert(id.parse::<u64>().expect("a number"), center);
        let own_info = &json(&models.join(set).join("models/models_info.json"))[id];
        for key in ["symmetries_discrete", "symmetries_continuous"] {
            let entries = |info: &serde_json::Value| {
                let text = info[key].to_string();
                text.replace(".0", "")
            };
            assert_eq!(entries(&infos[id]), entries(own_info), "{file}: {key}");
        }
        if found[0].contains_key("texture_u") {
            let texture = file.replace(".ply", ".png");
            let [a, b] = [&models.join(set).join("models"), &bop.join("models")]
                .map(|folder| image::open(folder.join(&texture)).expect("a texture").into_rgb8());
            assert!(a == b, "{texture}");
        }
    }
    assert!(compared > 500 && centers.len() > 1, "{compared} vertices of {} models", centers.len());
    assert!(infos.to_string().contains("symmetries_"), "no symmetries to compare");
    // Poses refer to the original file: they map its center to the object's origin, because the pool centers the
    // object.
    let truth = json(&bop.join("train_pbr/000000/scene_gt.json"));
    let lines = std::fs::read_to_string(data.join("jsonl.jsonl")).expect("lines");
    let mut poses = 0;
    for line in lines.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).expect("JSON")) {
        let objects = line["object_info"].as_object().expect("objects").values();
        let entries = truth[line["view"].to_string()].as_array().expect("entries");
        let mut objects: Vec<_> = objects.collect();
        assert_eq!(entries.len(), objects.len());
        for entry in entries {
            let id = entry["obj_id"].as_u64().expect("a number");
            let t: [f64; 3] = numbers(&entry["cam_t_m2c"]).try_into().expect("three");
            let center = moved(&numbers(&entry["cam_R_m2c"]), t, centers[&id]);
            let is_here = |object: &&serde_json::Value| {
                let pose = object["camera_from_object"].as_array().expect("rows");
                let at: [f64; 3] = std::array::from_fn(|row| 1000.0 * pose[row][3].as_f64().expect("a number"));
                object["obj_id"] == id && (0..3).all(|i| (at[i] - center[i]).abs() < 1e-3)
            };
            let at = objects.iter().position(is_here).expect("an object there");
            objects.swap_remove(at);
            poses += 1;
        }
    }
    assert!(poses > 4, "{poses}");
    // A second conversion reads back the written data, including colors and symmetries.
    let again = folder.path().join("again");
    let convert = ["--to", "bop", "--set", "bop.models=\"models\"", "--out"];
    ok(syntable().arg("convert").arg(&bop).args(convert).arg(&again));
    assert_eq!(json(&again.join("bop/objects.json")), objects);
    let symmetries = |infos: &serde_json::Value| {
        infos
            .as_object()
            .expect("a table")
            .values()
            .map(|info| ["symmetries_discrete", "symmetries_continuous"].map(|key| info[key].clone()))
            .collect::<Vec<_>>()
    };
    assert_eq!(symmetries(&json(&again.join("bop/models/models_info.json"))), symmetries(&infos));
    for (name, bytes) in crate::support::files(&bop.join("models")) {
        let [a, b] = [bytes, std::fs::read(again.join("bop/models").join(&name)).expect("the same files")];
        if name.ends_with(".png") {
            assert!(a == b, "{name}");
        } else if name.ends_with(".ply") {
            let looks = |path: &Path| {
                ply(path)
                    .0
                    .iter()
                    .map(|it| {
                        let looks = it.iter().filter(|(key, _)| !["x", "y", "z"].contains(&key.as_str()));
                        looks.map(|(_, value)| value.to_bits()).collect::<Vec<_>>()
                    })
                    .collect::<Vec<_>>()
            };
            assert!(looks(&bop.join("models").join(&name)) == looks(&again.join("bop/models").join(&name)), "{name}");
        }
    }
}

/// How a format identifies an object.
#[derive(Clone, Copy, PartialEq)]
enum Tells {
    /// By ids of all classes of the recipe.
    Classes,
    /// By one class.
    OneClass,
    /// By `obj_id`.
    Objects,
}

#[test]
fn every_writer_gives_a_thing_the_same_number() {
    use Tells::{Classes, Objects, OneClass};
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let labels = "\"visible_mask\", \"amodal_mask\", \"category_id\"";
    let generic = format!("include = [{labels}, \"object_name\", \"object_info\"]");
    let writers = format!(
        "write={{ syntable = {{}}, coco = {{}}, coco_panoptic = {{}}, cocoa = {{}}, kins = {{}}, d2sa = {{}}, insta_order = {{}}, \
         uoais = {{}}, osd_amodal = {{}}, yolo = {{}}, bop = {{}}, hdf5 = {{}}, web = {{ kind = \"bop\", layout = \"webdataset\" }}, \
         webdataset = {{ {generic} }}, npz = {{ include = [{labels}] }}, parquet = {{ {generic} }}, jsonl = {{ {generic} }} }}"
    );
    // The last class has no object.
    let classes = "assets.objects.classes={ mug = [\"mug*\"], book = [\"book*\"], zebra = [\"zebra*\"] }";
    let half = "assets.objects.exclude=[\"b*\", \"c*\", \"*_00?[02468]\"]";
    let make = |name: &str, more: &[&str]| {
        let settings =
            [writers.as_str(), classes, "camera.resolution=[96, 72]", "dataset.scenes=2", "dataset.views_per_scene=1"];
        crate::support::small_dataset(&path(name), &[&settings[..], more].concat());
    };
    make("train", &["assets.objects.exclude=[]"]);
    make("val", &["dataset.seed=8", "dataset.name=\"val\"", half]);
    // The whole pool is sorted by name: positions are the numbers, whatever objects are excluded.
    let catalog = json(&path("train/.syntable/catalogs/objects.json"));
    let names: Vec<&String> = catalog.as_object().expect("a table").keys().collect();
    assert!(names.is_sorted() && names.len() > 50);
    let number_of = |name: &str| names.iter().position(|other| *other == name).expect("an asset") as i64 + 1;
    let class_of = |name: &str| match name.split_once('_').map(|(family, _)| family) {
        Some("book") => 2,
        Some("mug") => 3,
        _ => 1,
    };
    let all_classes = [(1, "object"), (2, "book"), (3, "mug"), (4, "zebra")];
    let drawn = |part: &str| -> BTreeSet<String> {
        let objects = json(&path(part).join("bop/objects.json"));
        objects.as_object().expect("a table").keys().cloned().collect()
    };
    let [train, val] = ["train", "val"].map(drawn);
    assert!(train != val && !val.is_empty(), "{train:?} {val:?}");
    let (mut categories, mut objects) = (0, 0);
    for (inside, format, tells) in [
        ("", "syntable", Classes),
        ("coco", "coco", Classes),
        ("coco_panoptic", "coco_panoptic", Classes),
        ("cocoa", "cocoa", Classes),
        ("kins", "kins", Classes),
        ("d2sa", "d2sa", Classes),
        ("insta_order", "coco", Classes),
        ("uoais", "coco", OneClass),
        ("osd_amodal", "osd_amodal", OneClass),
        ("yolo", "yolo", Classes),
        ("bop", "bop", Objects),
        ("web", "bop", Objects),
        ("webdataset", "webdataset", Classes),
        ("npz", "npz", Classes),
        ("parquet", "parquet", Classes),
        ("hdf5", "hdf5", Classes),
        ("jsonl.jsonl", "jsonl", Objects),
    ] {
        let open = |part: &str| open_dataset(&path(part).join(inside), Some(format)).expect(inside).1;
        let [train, val] = ["train", "val"].map(open);
        for (part, dataset) in [("train", &train), ("val", &val)] {
            let what = format!("{part}/{inside}");
            let found: Vec<(u32, &str)> = dataset.info.categories().collect();
            match tells {
                Classes => assert_eq!(found, all_classes, "{what}"),
                OneClass => assert_eq!(found, all_classes[..1], "{what}"),
                Objects => {}
            }
            let offers = &dataset.offers;
            for image in 0..dataset.images.len() {
                let products = dataset.read(image, offers).expect("readable").products;
                let infos = products.optional(OBJECT_INFO).expect("declared");
                for (_, info) in infos.into_iter().flat_map(|infos| infos.iter()) {
                    let info = serde_json::to_value(info).expect("plain data");
                    let name = info["name"].as_str().or(info["asset"].as_str()).expect("a name");
                    let name = name.rsplit('/').next().expect("a part");
                    assert_eq!(info["obj_id"], number_of(name), "{what}: {name}");
                    objects += 1;
                }
                let (ids, names) = (products.optional(CATEGORY_ID), products.optional(OBJECT_NAME));
                if let (Some(ids), Some(names), true) = (ids.expect("read"), names.expect("read"), tells == Classes) {
                    for (id, category) in ids.iter() {
                        let name = names.get(id).expect("a name").rsplit('/').next().expect("a part");
                        // Formats that only have category names contain no other names.
                        if catalog.get(name).is_some() {
                            assert_eq!(*category, class_of(name), "{what}: {name}");
                            categories += 1;
                        }
                    }
                }
            }
        }
        // Formats that number by position do so alike in both parts. An object that a part does not show may have no
        // name there.
        let [here, there] = [&train, &val].map(|it| it.info.categories().collect::<Vec<_>>());
        for (one, other) in here.iter().zip(&there) {
            let unnamed = [reader::unnamed_object(one.0.into()), reader::unnamed_category(one.0.into())];
            let has_name = |name: &str| !unnamed.iter().any(|other| other == name);
            assert_eq!(one.0, other.0, "{inside}");
            assert!(one.1 == other.1 || !has_name(one.1) || !has_name(other.1), "{inside}: {one:?} {other:?}");
        }
        let said = ok(syntable()
            .arg("validate")
            .args(["train", "val"].map(|part| path(part).join(inside)))
            .args(["--format", format]));
        assert!(said.contains("2 datasets: categories and objects have the same ids"), "{inside}: {said}");
    }
    assert!(categories > 30 && objects > 30, "{categories} {objects}");
    // A different numbering is found.
    let bop = ["write={ bop = {} }", "assets.objects.exclude=[]", "assets.objects.first_id=100", "dataset.scenes=1"];
    crate::support::small_dataset(&path("other"), &[&bop[..], &["dataset.views_per_scene=1"]].concat());
    let pair = ["train", "other"].map(|part| path(part).join("bop"));
    let output = syntable().arg("validate").args(&pair).output().expect("runs");
    let said = text(&output);
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.contains("numbers_agree: object `") && said.contains("has the `obj_id`"), "{said}");
}
