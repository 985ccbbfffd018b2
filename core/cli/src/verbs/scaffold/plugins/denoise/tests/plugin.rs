// The denoised image has the same brightness and less noise than the rendered one.

use box_filter as _;
use syntable::model::product::Plane;
use syntable::model::product::standard::{RADIANCE, RADIANCE_NOISY};

const RECIPE: &str = include_str!("../recipe.toml");

/// Sum of the differences between neighbors in a row.
fn roughness(image: &Plane<[f32; 3]>) -> f64 {
    let rows = image.data().chunks_exact(image.width() as usize);
    rows.flat_map(|row| row.windows(2).map(|pair| f64::from((pair[0][1] - pair[1][1]).abs()))).sum()
}

#[test]
fn images_are_smoother_and_as_bright() {
    for sample in samples(&["radiance", "radiance_noisy"], &[]) {
        let [smooth, noisy] = [RADIANCE, RADIANCE_NOISY].map(|key| sample.products.get(key).expect("made"));
        assert!(roughness(smooth) < 0.8 * roughness(noisy), "{} of {}", roughness(smooth), roughness(noisy));
        // Checks one pixel directly: the mean lies within the range of the noisy values around it.
        let around = (20..=22).flat_map(|y| (30..=32).map(move |x| noisy.at(x, y)[0]));
        let (low, high) = around.fold((f32::MAX, f32::MIN), |(low, high), value| (low.min(value), high.max(value)));
        assert!((low..=high * 1.0001).contains(&smooth.at(31, 21)[0]));
    }
}
