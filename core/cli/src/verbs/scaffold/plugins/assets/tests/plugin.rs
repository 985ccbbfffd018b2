// The scene consists of cubes with the edges of the recipe.

use plain_cubes as _;

const RECIPE: &str = include_str!("../recipe.toml");

#[test]
fn objects_are_cubes() {
    let samples = samples(&["depth"], &[]);
    let objects = samples[0].scene.objects();
    assert!(!objects.is_empty());
    for object in objects {
        let mesh = &object.object.mesh;
        let [x, y, z] = mesh.bounds().size().into();
        assert!((x - y).abs() < 1e-6 && (y - z).abs() < 1e-6, "{x} × {y} × {z}");
        assert!([0.05, 0.08].iter().any(|edge| (x - edge).abs() < 1e-6), "{x}");
        assert!((mesh.signed_volume() - x * y * z).abs() < 1e-9, "closed, and seen from outside");
    }
}
