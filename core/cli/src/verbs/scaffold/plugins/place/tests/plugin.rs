// Without physics, the objects form a tower in the middle of the table.

use object_tower as _;

const RECIPE: &str = include_str!("../recipe.toml");

#[test]
fn objects_stand_above_each_other() {
    let samples = samples(&["depth"], &[("settle.kind", "\"none\"")]);
    let scene = &samples[0].scene;
    let boxes: Vec<_> = scene.objects().iter().map(|body| body.world_bounds()).collect();
    assert_eq!(boxes.len(), 3);
    let mut height = scene.support(None).expect("a table").height();
    for (object, bounds) in scene.objects().iter().zip(&boxes) {
        assert!(bounds.min.z >= height - 1e-9 && bounds.min.z < height + 0.003, "{} above {height}", bounds.min.z);
        let offset = object.world_from_body.translation.vector - scene.support(None).expect("a table").center().coords;
        assert!(offset.x.abs() < 1e-9 && offset.y.abs() < 1e-9, "{offset}");
        height = bounds.max.z;
    }
}
