// All cameras are above the middle of the table and look down.

use top_view as _;

const RECIPE: &str = include_str!("../recipe.toml");

#[test]
fn cameras_look_down_on_the_table() {
    let samples = samples(&["depth"], &[]);
    let poses = samples.iter().map(|sample| (sample.scene.support(None).expect("a table").center(), sample.view.camera.world_from_camera));
    let mut heights = Vec::new();
    for (center, pose) in poses {
        let above = pose.translation.vector - center.coords;
        assert!(above.x.abs() < 1e-9 && above.y.abs() < 1e-9 && (0.9..=1.1).contains(&above.z), "{above}");
        // The camera looks along its z axis.
        let forward = pose.rotation * syntable::model::geometry::Vector3::z();
        assert!(forward.z < -0.999_999, "{forward}");
        heights.push(above.z);
    }
    assert!(heights.len() == 2 && heights[0] != heights[1], "views differ: {heights:?}");
}
