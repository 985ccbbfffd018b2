// The product agrees with the pixels of the masks.

use syntable::model::product::standard::VISIBLE_MASK;
use visible_area::VISIBLE_AREA;

const RECIPE: &str = include_str!("../recipe.toml");

#[test]
fn areas_are_numbers_of_pixels() {
    let samples = samples(&["visible_mask", "visible_area"], &[]);
    assert_eq!(samples.len(), 2);
    for sample in samples {
        let areas = sample.products.get(VISIBLE_AREA).expect("annotated");
        let masks = sample.products.get(VISIBLE_MASK).expect("annotated");
        assert!(masks.iter().count() > 0);
        for (id, mask) in masks.iter() {
            let pixels = mask.to_plane().data().iter().filter(|is_visible| **is_visible).count();
            assert_eq!(areas.get(id).copied(), Some(pixels as u32), "object {id}");
        }
    }
}
