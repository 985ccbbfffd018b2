// The program recognizes the dataset, and its masks are the rectangles of the table.

use box_table as _;
use std::fs;
use syntable::DatasetSource;
use syntable::Registry;
use syntable::model::product::standard::VISIBLE_MASK;

#[test]
fn rectangles_become_masks() {
    let registry = Registry::linked().expect("no clash");
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("boxes.csv"), include_str!("../sample/boxes.csv")).expect("writable");
    let (format, dataset) = registry.open_dataset(&DatasetSource::new(folder.path()), None).expect("recognized");
    assert_eq!(format.name(), "box_table");
    let names: Vec<&str> = dataset.images.iter().map(|image| image.name.as_str()).collect();
    assert_eq!(names, ["first", "second"]);
    let image = dataset.read(0, &[VISIBLE_MASK.id()]).expect("read");
    let masks = image.products.get(VISIBLE_MASK).expect("offered");
    let areas: Vec<u32> = masks.iter().map(|(_, mask)| mask.area()).collect();
    assert_eq!((image.size, areas), ([40, 30], vec![150, 150]));
    // A damaged table is an error that names the file and the line.
    fs::write(folder.path().join("boxes.csv"), "image\nfirst,40,thirty\n").expect("writable");
    let error = registry.open_dataset(&DatasetSource::new(folder.path()), None).err().expect("refused").to_string();
    assert!(error.contains("boxes.csv") && error.contains("line 2"), "{error}");
}
