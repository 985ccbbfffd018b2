//! Reads tables back: each product equals the written product, and labels are computed from it.

use serde_json::Value as Json;
use std::path::Path;
use syntable_model::prelude::*;
use syntable_model::product::standard::*;
use syntable_model::reader;
use syntable_parquet as _;
use syntable_testing::read_back::{JPEG, assert_jpeg_images, assert_products, classes, opened, written};
use syntable_testing::takes::open_dataset;

/// The part of a record that tables keep: the fields with columns.
fn part(name: &str, mut value: Json) -> Json {
    let fields: &[&str] = match name {
        "object_info" => &["asset", "obj_id", "mass_kg", "world_from_object", "camera_from_object", "model_origin_m"],
        "camera" => &["width", "height", "K", "world_from_camera", "distortion_k1_k2_p1_p2_k3"],
        "visibility" => &["px_count_all", "px_count_in_frame", "px_count_valid", "px_count_visib", "visib_fract"],
        _ => return value,
    };
    let keep = |record: &mut Json| {
        if let Some(record) = record.as_object_mut() {
            record.retain(|field, value| fields.contains(&field.as_str()) && !value.is_null());
        }
    };
    if name == "camera" {
        keep(&mut value);
    } else if let Some(each) = value.as_object_mut() {
        each.values_mut().for_each(keep);
    }
    value
}

#[test]
fn products_come_back_and_labels_follow() {
    let more = "\"object_info\", \"category_id\", \"object_name\", \"visible_mask\", \"amodal_mask\", \"amodal_outline\", \
                \"visibility\", \"camera\", \"label_policy\", \"bodies\", \"occlusion_rate\"";
    for options in [
        String::new(),
        format!("include = [{more}]\nimages = \"none\""),
        "rows = \"views\"".to_owned(),
        format!("rows = \"views\"\nimages = \"embedded\"\ninclude = [{more}]"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let takes = written(folder.path(), "parquet", &options);
        let read = opened(folder.path(), "parquet");
        let offers = &read.offers;
        for key in keys![VISIBLE_MASK, AMODAL_BOX, OCCLUSION_MASK, OCCLUSION_ORDER, OBJECT_INFO, CATEGORY_ID] {
            assert!(offers.contains(&key), "{options}: {}", key);
        }
        assert_eq!(offers.contains(&RGB.id()), !options.contains("none"), "{options}");
        let known = classes();
        let names: Vec<(u32, &str)> = known.categories().collect();
        assert!(read.info.categories().all(|category| names.contains(&category)), "{options}");
        // Tables of instances have no rows for images without instances.
        let compared = assert_products(&read, &takes, options.contains("views"), part);
        assert!(compared > 60, "{options}: {compared}");
    }
}

#[test]
fn jpeg_images_are_read() {
    for options in ["", "rows = \"views\"\nimages = \"embedded\""] {
        let folder = tempfile::tempdir().expect("a folder");
        let takes = written(folder.path(), "parquet", &format!("{options}\n{JPEG}"));
        assert_jpeg_images(&opened(folder.path(), "parquet"), &takes);
    }
}

/// The dictionary of the texts of all masks is full, and every row has many of them.
#[test]
fn large_tables_of_views_come_back() {
    use syntable_model::product::Mask;
    use syntable_model::scene::ViewId;
    use syntable_testing::takes::{Crowd, dataset, take, write_scenes, writer};
    let (views, objects, [width, height]) = (100_u32, 15_u16, [64, 48]);
    // Random pixels make masks of more than a thousand runs.
    let mask = |view: u32, object: u16| {
        let mut state = u64::from(view * 100 + u32::from(object)).wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        Mask::from_fn(width, height, |_, _| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state % 2 == 0
        })
    };
    let mut scene = take(0, 1, &[Crowd::Nothing]);
    let (first, _) = scene.views.pop().expect("a view");
    for view in 0..views {
        let mut products = Products::new();
        let masks = (1..=objects).map(|object| (InstanceId(object), mask(view, object))).collect();
        products.put(VISIBLE_MASK, masks).expect("first");
        scene.views.push((View { id: ViewId(view), ..first.clone() }, products));
    }
    let folder = tempfile::tempdir().expect("a folder");
    let options = "rows = \"views\"\nimages = \"none\"\ninclude = [\"visible_mask\"]";
    let writer = writer("parquet", options).expect("good options");
    write_scenes(folder.path(), "data", &*writer, &dataset(1, views), &[scene]).expect("written");
    let read = opened(folder.path(), "parquet");
    assert_eq!(read.images.len(), 100);
    for (view, image) in [(0, 0), (57, 57), (99, 99)] {
        let products = read.read(image, &[VISIBLE_MASK.id()]).expect("readable").products;
        let masks = &products.get(VISIBLE_MASK).expect("read").0;
        assert_eq!(masks.len(), usize::from(objects));
        assert!(masks.iter().all(|(id, read)| *read == mask(view, id.0)), "view {view}");
    }
}

/// Readers follow no link or image name out of the dataset, and do not wait for named pipes.
#[cfg(unix)]
#[test]
fn nothing_outside_is_read() {
    use syntable_testing::hostile::{links_lead_nowhere_else, pipes_are_not_waited_for, read_all};
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "parquet", "");
    let data = folder.path().join("data");
    // Tables may refer to images in the folder next to theirs.
    let tables = reader::Source::new(data.join("instances"));
    assert!(read_all(&tables, "parquet").1.is_empty());
    pipes_are_not_waited_for(&data, "parquet");
    // Without the parent folder, the same names lead out of the dataset.
    let alone = folder.path().join("alone");
    std::fs::create_dir(&alone).expect("writable");
    std::fs::copy(data.join("instances/000000.parquet"), alone.join("000000.parquet")).expect("copied");
    std::fs::create_dir(folder.path().join("images")).expect("writable");
    for image in std::fs::read_dir(data.join("images")).expect("there") {
        let image = image.expect("readable");
        std::fs::copy(image.path(), folder.path().join("images").join(image.file_name())).expect("copied");
    }
    let (read, errors) = read_all(&reader::Source::new(&alone), "parquet");
    assert!(read == 0 && errors[0].to_string().contains("leads out of the dataset's folder"), "{read} {errors:?}");
    assert!(read_all(&reader::Source::new(&alone).trusting(true), "parquet").1.is_empty());
    links_lead_nowhere_else(&data, "parquet");
}

#[test]
fn what_is_damaged_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    written(folder.path(), "parquet", "");
    let path = folder.path().join("data/instances/000002.parquet");
    let bytes = std::fs::read(&path).expect("readable");
    let said = |root: &Path| {
        let (_, read) = open_dataset(root, None).expect("a dataset");
        let faults = read.all_faults().iter().map(|fault| fault.place_and_text(&[]).join(" ")).collect::<Vec<_>>();
        let errors = (0..read.images.len()).filter_map(|image| Some(read.read(image, &read.offers).err()?.to_string()));
        faults.into_iter().chain(errors).collect::<Vec<String>>()
    };
    assert!(said(folder.path()).is_empty());
    // A truncated or modified file yields an error or different values, but never a panic.
    let mut stream = Stream::root(3);
    for step in 0..60 {
        let mut changed = bytes.clone();
        if step % 2 == 0 {
            changed.truncate(stream.below(bytes.len() as u64) as usize);
        } else {
            let end = bytes.len() as u64;
            (0..8).for_each(|_| changed[stream.below(end) as usize] = stream.below(256) as u8);
        }
        std::fs::write(&path, &changed).expect("writable");
        let said = said(folder.path());
        assert!(
            said.iter().all(|error| error.contains("000002.parquet")
                || error.starts_with("it")
                || error.contains("mask of instance")),
            "{said:?}"
        );
        assert!(step % 2 == 1 || !said.is_empty(), "{} bytes", changed.len());
    }
    std::fs::write(&path, &bytes).expect("writable");
    std::fs::remove_file(folder.path().join("data/images/000002_0000.png")).expect("there");
    let said = said(folder.path());
    assert!(said.len() == 1 && said[0].contains("000002_0000.png"), "{said:?}");
}
