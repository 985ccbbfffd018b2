//! The functions of the fuzz targets. A test of the workspace replays all stored inputs
//! (`tests/tests/program/fuzz.rs`), and `fuzz_targets` passes these functions to libFuzzer.

use std::path::PathBuf;
use syntable_formats::dataset::JsonLayout;
use syntable_formats::decode::FileContent;
use syntable_formats::known::{self, KnownProducts};
use syntable_formats::syntable;
use syntable_model::context::Collected;
use syntable_model::inspect;
use syntable_model::product::{Mask, Products, Stored, Value, linked};
use syntable_model::registry::Registry;
use syntable_model::scene::InstanceId;
use syntable_recipe::Overrides;

/// Feeds one input to a reader, and panics if the reader violates an invariant.
pub type Target = fn(&[u8]);

/// All targets, by the names of their binaries and of their folders in `corpus`.
pub const TARGETS: [(&str, Target); 15] = [
    ("obj", obj),
    ("gltf", gltf),
    ("glb", glb),
    ("ply", ply),
    ("stl", stl),
    ("dae", dae),
    ("urdf", urdf),
    ("image", image),
    ("hdr", hdr),
    ("exr", exr),
    ("mask", mask),
    ("recipe", recipe),
    ("dataset", dataset),
    ("product", product),
    ("products_file", products_file),
];

/// The folder with the input of a file reader: one per process, in memory where the system supports it.
pub fn folder() -> PathBuf {
    let memory = PathBuf::from("/dev/shm");
    let base = if memory.is_dir() { memory } else { std::env::temp_dir() };
    base.join(format!("syntable-fuzz-{}", std::process::id()))
}

/// Writes files, and inspects the first one as `syntable check --asset` does. The inspection may have any result, but
/// it must return.
fn inspect(files: &[(&str, &[u8])]) {
    let folder = folder();
    std::fs::create_dir_all(&folder).expect("a folder");
    for (name, bytes) in files {
        std::fs::write(folder.join(name), bytes).expect("a file");
    }
    let _ = inspect::inspect(&folder.join(files[0].0), &Collected::default());
}

/// The text at the start of an input.
fn text(input: &[u8]) -> &str {
    input.utf8_chunks().next().map_or("", |chunk| chunk.valid())
}

/// OBJ with its MTL: the material library follows a line `--`.
pub fn obj(input: &[u8]) {
    let split = input.windows(4).position(|bytes| bytes == b"\n--\n");
    let (obj, mtl) = split.map_or((input, &[][..]), |at| (&input[..=at], &input[at + 4..]));
    inspect(&[("model.obj", obj), ("model.mtl", mtl)]);
}

/// glTF with embedded buffers.
pub fn gltf(input: &[u8]) {
    inspect(&[("input.gltf", input)]);
}

/// Binary glTF.
pub fn glb(input: &[u8]) {
    inspect(&[("input.glb", input)]);
}

/// PLY, text and binary.
pub fn ply(input: &[u8]) {
    inspect(&[("input.ply", input)]);
}

/// STL, text and binary.
pub fn stl(input: &[u8]) {
    inspect(&[("input.stl", input)]);
}

/// COLLADA.
pub fn dae(input: &[u8]) {
    inspect(&[("input.dae", input)]);
}

/// URDF.
pub fn urdf(input: &[u8]) {
    inspect(&[("input.urdf", input)]);
}

/// Images of all formats, recognized by their content: as textures, and as images of datasets.
pub fn image(input: &[u8]) {
    inspect(&[("input.png", input)]);
    let content = FileContent::new(input.to_vec(), "fuzz".into());
    let _ = content.rgb();
    // Labels of a gray image are its samples.
    if let Ok(gray) = content.gray() {
        assert_eq!(content.labels().expect("gray"), gray);
    } else if let Ok(labels) = content.labels() {
        assert!(labels.data().iter().all(|label| *label < 256), "a palette has 256 colors");
    }
}

/// Radiance HDR environment maps.
pub fn hdr(input: &[u8]) {
    inspect(&[("input.hdr", input)]);
}

/// OpenEXR environment maps.
pub fn exr(input: &[u8]) {
    inspect(&[("input.exr", input)]);
}

/// The run-length codec of masks: width and height in two bytes each, lowest first, then COCO's compressed counts.
pub fn mask(input: &[u8]) {
    let Some((size, counts)) = input.split_first_chunk::<4>() else { return };
    let [width, height] = [[size[0], size[1]], [size[2], size[3]]].map(|bytes| u32::from(u16::from_le_bytes(bytes)));
    let Ok(mask) = Mask::from_coco(width, height, text(counts)) else { return };
    let again = Mask::from_coco(width, height, &mask.to_coco()).expect("what was written is read");
    assert_eq!(mask, again);
    // The runs must agree with the counts and the box.
    let area: u32 = mask.runs().map(|run| run.end - run.start).sum();
    assert_eq!(area, mask.area());
    assert_eq!(mask.and(&again).area(), area);
    assert!(mask.minus(&again).is_empty());
    if u64::from(width) * u64::from(height) <= 1 << 16 {
        let plane = mask.to_plane();
        assert_eq!(Mask::from_fn(width, height, |x, y| *plane.at(x, y)), mask);
    }
}

/// The recipe parser, from text to stages or diagnostics. A table of an unlinked kind ends in a diagnostic.
pub fn recipe(input: &[u8]) {
    let registry = Registry::linked().expect("no clash");
    let overrides = Overrides {
        set: Vec::new(),
        variable: &|_| Some("value".to_owned()),
        read: &|_| Err(std::io::ErrorKind::NotFound.into()),
        exists: &|_| true,
        opens_urls: false,
        current_folder: "/".into(),
        choose: false,
        wanted: Vec::new(),
    };
    let _ = syntable_recipe::load(&registry, syntable_recipe::Source::embedded("fuzz", text(input)), &overrides);
}

/// Annotation files of other programs: COCO's and SynTable's, from text to masks.
pub fn dataset(input: &[u8]) {
    if let Ok(dataset) = syntable_formats::dataset::CocoDataset::from_reader(input) {
        for annotation in &dataset.annotations {
            // Images of any size are legal, but decoding large images takes time without finding faults.
            let image = dataset.images.iter().find(|image| image.id == annotation.image_id);
            let Some(image) = image.filter(|image| image.width <= 512 && image.height <= 512) else { continue };
            let Some(segmentation) = &annotation.segmentation else { continue };
            let Ok(mask) = segmentation.decode(image.width, image.height) else { continue };
            assert_eq!((mask.width(), mask.height()), (image.width, image.height));
        }
        let mut written = Vec::new();
        dataset.write(&mut written, "fuzz.json", JsonLayout::Lines).expect("memory takes all");
        assert_eq!(
            syntable_formats::dataset::CocoDataset::from_reader(&written[..]).expect("what was written is read"),
            dataset
        );
    }
    if let Ok(dataset) = syntable::SynTableDataset::from_reader(input) {
        for image in &dataset.images {
            let _ = image.camera();
        }
        for annotation in &dataset.annotations {
            let _ = annotation.object();
        }
    }
}

/// Values of products in files, arrays or JSON: each value is either a valid value of a key or refused.
pub fn product(input: &[u8]) {
    let content = FileContent::new(input.to_vec(), "fuzz".into());
    let values = [content.npy().map(Value::Tensor), content.json()];
    let ids = [InstanceId(1), InstanceId(2)];
    for value in values.into_iter().flatten() {
        for key in linked() {
            let mut products = Products::new();
            let stored = Stored { value: &value, ids: &ids, missing: f64::INFINITY };
            if products.put_stored(*key, stored).is_ok() {
                // A value that was accepted must be a value of the product.
                let _ = products.value(&key.to_string()).expect("there");
            }
        }
    }
}

/// Declarations of products: written and read again, they are the same.
pub fn products_file(input: &[u8]) {
    let Ok(read) = KnownProducts::declared_in(input) else { return };
    let keys: Vec<_> = read.iter().copied().collect();
    let Some(declared) = known::declared(&keys) else { return };
    let text = serde_json::to_vec(&declared).expect("numbers are finite");
    let again = KnownProducts::declared_in(&text).expect("what was written is read");
    assert!(read.iter().eq(again.iter()), "{}", String::from_utf8_lossy(&text));
}
