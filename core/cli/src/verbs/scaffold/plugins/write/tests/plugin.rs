// A run writes the table, which has the areas of the masks.

use area_table as _;
use syntable::model::product::standard::VISIBLE_MASK;
use syntable::{DiskCache, Quiet, RunOptions, run, workers};

const RECIPE: &str = include_str!("../recipe.toml");

#[test]
fn the_table_has_the_areas_of_the_masks() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data");
    run(&recipe(&[], &[]), &RunOptions::new(&data, workers::available(), DiskCache::of_user()), &Quiet).expect("a run");
    let table = std::fs::read_to_string(data.join("area_table/000000.csv")).expect("written");
    let mut wanted = vec!["view,instance,pixels".to_owned()];
    for sample in samples(&["visible_mask"], &[]) {
        for (id, mask) in sample.products.get(VISIBLE_MASK).expect("annotated").iter().filter(|(_, it)| it.area() >= 16)
        {
            wanted.push(format!("{},{id},{}", sample.view.id.0, mask.area()));
        }
    }
    assert!(wanted.len() > 2);
    assert_eq!(table.lines().collect::<Vec<_>>(), wanted);
}
