// One pixel in ten is black, and the others are unchanged.

use dead_pixels::RGB_DEAD_PIXELS;
use syntable::model::product::standard::RGB;

const RECIPE: &str = include_str!("../recipe.toml");

#[test]
fn one_pixel_in_ten_is_black() {
    for sample in samples(&["rgb", "rgb_dead_pixels"], &[]) {
        let [clean, sensed] = [RGB, RGB_DEAD_PIXELS].map(|key| sample.products.get(key).expect("made").data());
        let changed: Vec<_> = clean.iter().zip(sensed).filter(|(clean, sensed)| clean != sensed).collect();
        assert!(changed.iter().all(|(_, sensed)| **sensed == [0; 3]));
        let part = changed.len() as f64 / clean.len() as f64;
        assert!((0.08..0.12).contains(&part), "{part}");
    }
}
