// Each view has one light, of 300 lux from the direction of the camera.

use head_light as _;
use syntable::model::photometry::luminance;
use syntable::model::scene::Light;

const RECIPE: &str = include_str!("../recipe.toml");

#[test]
fn the_light_comes_from_the_camera() {
    for sample in samples(&["depth"], &[]) {
        let [Light::Directional(light)] = &sample.view.lights[..] else {
            panic!("one light: {:?}", sample.view.lights)
        };
        assert!((luminance(light.irradiance) - 300.0).abs() < 1e-3, "{:?}", light.irradiance);
        let camera = sample.view.camera.world_from_camera.translation.vector - sample.scene.support(None).expect("a table").center().coords;
        assert!(camera.cross(&light.towards).norm() < 1e-9 && camera.dot(&light.towards) > 0.0);
    }
}
