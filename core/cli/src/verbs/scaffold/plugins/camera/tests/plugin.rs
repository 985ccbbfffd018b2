// The image has the size and the angle of the recipe.

use square_camera as _;
use syntable::model::product::standard::DEPTH;

const RECIPE: &str = include_str!("../recipe.toml");

#[test]
fn images_are_square_and_have_the_angle() {
    for sample in samples(&["depth"], &[]) {
        let depth = sample.products.get(DEPTH).expect("rendered");
        assert_eq!((depth.width(), depth.height()), (96, 96));
        // The focal length is half of the width: the slope at the right edge is 1.
        let edge = sample.view.camera.intrinsics.unproject(96.0, 48.0);
        assert!((edge.x - 1.0).abs() < 1e-9 && edge.y.abs() < 1e-9, "{edge}");
    }
}
