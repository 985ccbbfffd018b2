//! Products that a writer wrote, read back by the reader of its format.

use crate::takes::open_dataset;
use crate::takes::{Take, WIDTH, dataset, finish, takes, write_scenes, writer};
use std::path::Path;
use syntable_model::prelude::*;
use syntable_model::product::standard::RGB;
use syntable_model::reader::OpenDataset;

/// The dataset of [`written`]: three scenes and two classes.
pub fn classes() -> DatasetInfo {
    DatasetInfo { classes: vec!["bowl".into(), "mug".into()], ..dataset(3, 3) }
}

/// Writes a dataset of all takes, with a writer whose id is `data`.
pub fn written(root: &Path, kind: &str, options: &str) -> Vec<Take> {
    let (writer, takes) = (writer(kind, options).expect("good options"), takes());
    write_scenes(root, "data", &*writer, &classes(), &takes).expect("written");
    finish(root, "data", &*writer, &classes(), &[0, 1, 2]).expect("finished");
    takes
}

/// Opens a dataset with the detected format, which must have the name `kind`.
pub fn opened(root: &Path, kind: &str) -> OpenDataset {
    let (format, reader) = open_dataset(root, None).unwrap_or_else(|error| panic!("{kind}: {error}"));
    assert_eq!(format.name(), kind);
    assert!(reader.all_faults().is_empty(), "{kind}: {:?}", reader.all_faults());
    reader
}

/// Asserts that each image of a dataset has the written products of its view, compared as JSON after `part`, which
/// selects the comparable part of a product. Returns the number of comparisons. Views may be missing if `all` is false.
pub fn assert_products(
    read: &OpenDataset,
    takes: &[Take],
    all: bool,
    part: impl Fn(&str, serde_json::Value) -> serde_json::Value,
) -> usize {
    let offers = &read.offers;
    let (mut images, mut compared) = (read.images.iter().enumerate().peekable(), 0);
    for take in takes {
        for (view, products) in &take.views {
            let place = (take.scene.id, view.id);
            let Some((index, image)) = images.next_if(|(_, image)| (image.scene, image.view) == place) else {
                assert!(!all, "{place:?} is missing");
                continue;
            };
            let seen = read.read(index, offers).unwrap_or_else(|error| panic!("{}: {error}", image.name));
            assert_eq!(seen.size[0], WIDTH, "{}", image.name);
            let found = seen.products;
            assert_eq!(read.image_faults(index), []);
            for key in offers {
                let name = key.to_string();
                // The tests of a format compare the products that it computes.
                if !products.contains(&name) {
                    continue;
                }
                // JSON keeps the values of numbers and arrays, but not their types.
                let [own, want] = [&found, products]
                    .map(|of| part(&name, serde_json::to_value(of.value(&name).expect("made")).expect("JSON")));
                assert!(own == want, "`{name}` of {}", image.name);
                compared += 1;
            }
        }
    }
    assert!(images.next().is_none(), "an image of no view");
    compared
}

/// Options of writers that store color images as JPEG files of the best quality.
pub const JPEG: &str = "rgb = { format = \"jpeg\", quality = 100 }";

/// Asserts that the color images of a dataset equal the written ones, up to the rounding of [`JPEG`].
pub fn assert_jpeg_images(read: &OpenDataset, takes: &[Take]) {
    for (number, image) in read.images.iter().enumerate() {
        let views = takes.iter().flat_map(|take| take.views.iter().map(|view| (take.scene.id, view)));
        let (_, (_, products)) =
            views.clone().find(|(scene, (view, _))| (*scene, view.id) == (image.scene, image.view)).expect("a view");
        let found = read.read(number, &[RGB.id()]).unwrap_or_else(|error| panic!("{}: {error}", image.name)).products;
        let [found, want] = [&found, products].map(|of| of.get(RGB).expect("there").data().as_flattened());
        let differ = found.iter().zip(want).map(|(a, b)| a.abs_diff(*b)).max();
        // Rounding changes each sample by a few codes, subsampled colors would change by a hundred. PNG files do not change.
        assert!(found.len() == want.len() && (Some(1)..=Some(6)).contains(&differ), "{}: {differ:?}", image.name);
    }
}
