// No two boxes overlap, and each body lies on the table or on the box of another body.

use straight_drop as _;

const RECIPE: &str = include_str!("../recipe.toml");

#[test]
fn bodies_lie_on_the_table_or_on_each_other() {
    let samples = samples(&["depth"], &[]);
    let scene = &samples[0].scene;
    let boxes: Vec<_> = scene.objects().iter().map(|body| body.world_bounds()).collect();
    assert_eq!(boxes.len(), 6);
    for (i, a) in boxes.iter().enumerate() {
        let gap = |top: f64| (a.min.z - top - 0.001).abs() < 1e-6;
        assert!(gap(scene.support(None).expect("a table").height()) || boxes.iter().any(|b| gap(b.max.z)), "object {i} floats");
        for b in &boxes[..i] {
            assert!((0..3).any(|axis| a.max[axis] <= b.min[axis] || b.max[axis] <= a.min[axis]), "object {i} overlaps");
        }
    }
}
