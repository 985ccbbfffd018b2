//! What a writer writes of products, read back by the reader of its format.

use crate::takes::open_dataset;
use crate::takes::{Take, WIDTH, dataset, finish, takes, write_scenes, writer};
use std::path::Path;
use syntable_model::prelude::*;
use syntable_model::reader::OpenDataset;

/// The dataset of [`written`]: three scenes and two classes.
pub fn classes() -> DatasetInfo {
    DatasetInfo { classes: vec!["bowl".into(), "mug".into()], ..dataset(3, 3) }
}

/// A dataset of all takes, by a writer with the id `data`.
pub fn written(root: &Path, kind: &str, options: &str) -> Vec<Take> {
    let (writer, takes) = (writer(kind, options).expect("good options"), takes());
    write_scenes(root, "data", &*writer, &classes(), &takes).expect("written");
    finish(root, "data", &*writer, &classes(), &[0, 1, 2]).expect("finished");
    takes
}

/// Opens a dataset by the format that it looks like, which must be that of the writer.
pub fn opened(root: &Path, kind: &str) -> OpenDataset {
    let (format, reader) = open_dataset(root, None).unwrap_or_else(|error| panic!("{kind}: {error}"));
    assert_eq!(format.name(), kind);
    assert!(reader.all_faults().is_empty(), "{kind}: {:?}", reader.all_faults());
    reader
}

/// Asserts that each image of a dataset has the products that were written of its view, in the form that JSON gives them, and
/// counts the comparisons. Of some products, `part` is compared; views may be missing if `all` is false.
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
                // What a format computes is compared where it is tested.
                if !products.contains(&name) {
                    continue;
                }
                // Text keeps what numbers and arrays are, and not how they were held.
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
