//! Reads HDF5 files back: each product equals the written product, and labels are computed from it.

use serde_json::Value as Json;
use std::path::Path;
use std::sync::OnceLock;
use syntable_hdf5 as _;
use syntable_model::prelude::*;
use syntable_model::product::standard::*;
use syntable_testing::read_back::{assert_products, classes, opened, written};
use syntable_testing::takes::open_dataset;
use syntable_testing::tools::python_with;

const INCLUDE: &str = "include = [\"visible_mask\", \"amodal_mask\", \"occlusion_order\", \"category_id\", \"camera\", \
                       \"occlusion_rate\", \"visible_box\", \"amodal_bits\", \"radiance\", \"object_info\"]";

/// The part of a product that the layout keeps.
fn part(name: &str, value: Json) -> Json {
    match name {
        // Stored as [0, 1] in 32-bit floats.
        "normal" => value.as_array().map_or(Json::Null, |rows| {
            let round = |number: &Json| (number.as_f64().unwrap_or(f64::NAN) * 1e6).round() as i64;
            let pixel = |pixel: &Json| pixel.as_array().into_iter().flatten().map(round).collect::<Vec<i64>>();
            rows.iter().map(|row| row.as_array().into_iter().flatten().map(pixel).collect::<Vec<_>>()).collect()
        }),
        // Available for visible objects only.
        "object_name" | "visible_ids" => Json::Null,
        _ => value,
    }
}

#[test]
fn products_come_back_and_labels_follow() {
    let folder = tempfile::tempdir().expect("a folder");
    let takes = written(folder.path(), "hdf5", INCLUDE);
    let read = opened(folder.path(), "hdf5");
    let offers = &read.offers;
    for key in keys![RGB, DEPTH, NORMAL, INSTANCE, CAMERA, OCCLUSION_ORDER, OCCLUSION_MASK, AMODAL_BOX] {
        assert!(offers.contains(&key), "{}", key);
    }
    let known = classes();
    let ids: Vec<u32> = known.categories().map(|(id, _)| id).collect();
    assert!(read.info.categories().all(|(id, _)| ids.contains(&id)));
    assert!(assert_products(&read, &takes, true, part) > 100);
}

/// BlenderProc's datasets alone yield visible masks, categories and names of the visible objects.
#[test]
fn blenderprocs_own_datasets_say_what_is_shown() {
    let folder = tempfile::tempdir().expect("a folder");
    let takes = written(folder.path(), "hdf5", "");
    let read = opened(folder.path(), "hdf5");
    assert!(read.offers.contains(&VISIBLE_MASK.id()) && !read.offers.contains(&AMODAL_MASK.id()));
    let mut seen = 0;
    for (image, (_, products)) in takes.iter().flat_map(|take| &take.views).enumerate() {
        let found =
            read.read(image, &[VISIBLE_MASK.id(), CATEGORY_ID.id(), OBJECT_NAME.id()]).expect("readable").products;
        let masks = found.get(VISIBLE_MASK).expect("there");
        let shown = products.get(INSTANCE).expect("made");
        for (id, mask) in masks.iter() {
            let want: Vec<usize> = (0..shown.data().len()).filter(|at| shown.data()[*at] == id).collect();
            let mut own: Vec<usize> = mask.pixels().collect();
            own.sort_unstable();
            assert!(!want.is_empty() && own == want);
            seen += 1;
        }
        let names = found.get(OBJECT_NAME).expect("there");
        let known = products.get(OBJECT_NAME).expect("made");
        assert!(masks.iter().all(|(id, _)| known.get(id).is_none_or(|name| names.get(id) == Some(name))));
        let categories = found.get(CATEGORY_ID).expect("there");
        assert!(categories.iter().map(|it| it.0).eq(masks.iter().map(|it| it.0)));
    }
    assert!(seen > 30, "{seen}");
}

/// Readers follow no link out of the dataset, and do not wait for named pipes.
#[cfg(unix)]
#[test]
fn nothing_outside_is_read() {
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "hdf5", "");
    let data = folder.path().join("data");
    syntable_testing::hostile::pipes_are_not_waited_for(&data, "hdf5");
    syntable_testing::hostile::links_lead_nowhere_else(&data, "hdf5");
}

#[test]
fn what_is_damaged_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "hdf5", "");
    let path = folder.path().join("data/000001_0001.hdf5");
    let bytes = std::fs::read(&path).expect("readable");
    let said = |root: &Path| {
        let (_, read) = open_dataset(root, None).expect("a dataset");
        let errors = (0..read.images.len()).filter_map(|image| Some(read.read(image, &read.offers).err()?.to_string()));
        errors.collect::<Vec<String>>()
    };
    assert!(said(folder.path()).is_empty());
    // A truncated or modified file yields an error or different values, but never a panic.
    let mut stream = Stream::root(3);
    for step in 0..60 {
        let mut changed = bytes.clone();
        if step % 2 == 0 {
            changed.truncate(stream.below(bytes.len() as u64) as usize);
        } else {
            (0..8).for_each(|_| changed[stream.below(4000) as usize] = stream.below(256) as u8);
        }
        std::fs::write(&path, &changed).expect("writable");
        let said = said(folder.path());
        assert!(said.len() <= 1 && said.iter().all(|error| error.contains("000001_0001.hdf5")), "{said:?}");
        assert!(step % 2 == 1 || said.len() == 1, "{} bytes", changed.len());
    }
}

/// Replaces the color image of a file with an image of another height that has no stored chunks, as h5py creates it.
const SPARSE: &str = "import h5py, sys\nwith h5py.File(sys.argv[1], 'a') as f:\n    del f['colors']\n    \
                      f.create_dataset('colors', (int(sys.argv[2]), 64, 3), 'u1', chunks=(48, 64, 3), compression='gzip')\n";

/// The library fills regions that no chunk stores, so a few bytes could request gigabytes.
#[test]
fn a_shape_beyond_what_is_stored_is_refused() {
    static HERE: OnceLock<bool> = OnceLock::new();
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "hdf5", "");
    let (path, script) = (folder.path().join("data/000001_0001.hdf5"), folder.path().join("sparse.py"));
    std::fs::write(&script, SPARSE).expect("writable");
    for (height, says) in [("96", "less is stored"), ("2500000", "pixels")] {
        if !python_with("h5py", &HERE, &script, &[path.to_str().expect("UTF-8"), height]) {
            return;
        }
        let (_, read) = open_dataset(folder.path(), None).expect("a dataset");
        let errors = (0..read.images.len()).filter_map(|image| read.read(image, &read.offers).err());
        let errors: Vec<String> = errors.map(|error| error.to_string()).collect();
        assert!(errors.len() == 1 && errors[0].contains(says) && errors[0].contains("000001_0001"), "{errors:?}");
    }
}

/// The attributes of bodies cover visible objects; annotated objects are the objects with labels.
#[test]
fn hidden_objects_are_annotated_where_labels_say_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let include = "include = [\"visible_mask\", \"amodal_mask\", \"occlusion_order\"]";
    let takes = written(folder.path(), "hdf5", include);
    let read = opened(folder.path(), "hdf5");
    let views = takes.iter().flat_map(|take| &take.views);
    let mut hidden = 0;
    for (image, (_, products)) in views.enumerate() {
        let wants = keys![VISIBLE_MASK, AMODAL_MASK, OCCLUSION_ORDER, OCCLUSION_RATE, CATEGORY_ID];
        let found = read.read(image, &wants).expect("readable").products;
        let masks = products.get(AMODAL_MASK).expect("made");
        assert!(found.get(OCCLUSION_ORDER).expect("there") == products.get(OCCLUSION_ORDER).expect("made"));
        assert!(found.get(CATEGORY_ID).expect("there").iter().map(|it| it.0).eq(masks.iter().map(|it| it.0)));
        hidden += products.get(VISIBLE_MASK).expect("made").iter().filter(|(_, mask)| mask.is_empty()).count();
    }
    assert!(hidden > 2, "{hidden}");
}
