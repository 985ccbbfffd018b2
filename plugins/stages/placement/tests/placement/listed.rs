//! Objects at the poses of a list.

use super::*;
use std::f64::consts::FRAC_PI_2;
use syntable_model::geometry::Rotation3;

#[test]
fn objects_are_at_their_poses() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("poses.json");
    let more = r#"[{ "asset": "small/60x20x90", "position_m": [0, 0, 1], "quaternion_wxyz": [0.6, 0, 0.8, 0] }]"#;
    std::fs::write(&file, more).expect("written");
    let options = format!(
        "from = [\"small\", \"big\"]\nrelative_to = \"table\"\nfile = {file:?}\nposes = [\n\
         {{ asset = \"80x80x80\", position_m = [0.1, -0.2, 0.05] }},\n\
         {{ asset = \"big/300x300x300\", position_m = [0.3, 0, 0.2], rotation_deg = [90, 0, 90] }},\n]"
    );
    let (scene, _) = place(&[&*table(), &*placer("listed", &options)], 1).expect("placed");
    let found = objects(&scene);
    let names: Vec<&str> = found.iter().map(|body| body.asset.name.as_str()).collect();
    assert_eq!(names, ["80x80x80", "300x300x300", "60x20x90"]);
    // The tabletop is 0.75 m high.
    let at = [[0.1, -0.2, 0.8], [0.3, 0.0, 0.95], [0.0, 0.0, 1.75]];
    // Roll turns y to z, and then yaw turns x to y.
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), FRAC_PI_2)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2);
    // A turn about y whose half angle has the cosine 0.6.
    let angle = 2.0 * 0.6_f64.acos();
    let rotations = [Rotation3::identity(), turn, Rotation3::from_axis_angle(&Vector3::y_axis(), angle)];
    for (body, (at, rotation)) in found.iter().zip(at.into_iter().zip(rotations)) {
        assert_eq!(body.motion, Motion::Fixed);
        let pose = &body.world_from_body;
        assert!((pose.translation.vector - Vector3::from(at)).norm() < 1e-6, "{pose:?}");
        assert!((pose.rotation.to_rotation_matrix().matrix() - rotation.matrix()).abs().max() < 1e-6, "{pose:?}");
    }
    // Without a name, every scene draws another object, at the same place of the world.
    let drawn = placer("listed", "from = \"materials_of_boxes\"\nposes = [{ position_m = [0, 0, 2] }]");
    assert!(place(&[&*drawn], 1).is_err(), "no such pool");
    let drawn = placer("listed", "from = [\"slim\", \"big\"]\nannotated = false\nposes = [{ position_m = [0, 0, 2] }]");
    let assets = (0..20).map(|seed| {
        let (scene, _) = place(&[&*drawn], seed).expect("placed");
        let (_, body) = scene.bodies().next().expect("one");
        assert_eq!((body.role, body.world_from_body.translation.z), (Role::Distractor, 2.0));
        body.asset.name.clone()
    });
    assert_eq!(assets.collect::<std::collections::BTreeSet<_>>().len(), 2);
}

#[test]
fn lists_with_mistakes_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let with_file = |text: &str| {
        let file = folder.path().join("poses.json");
        std::fs::write(&file, text).expect("written");
        let listed = placer("listed", &format!("from = \"slim\"\nfile = {file:?}"));
        place(&[&*listed], 1).expect_err(text).to_string()
    };
    for (text, want) in [
        ("[]", "0 poses"),
        ("[\n  { \"position_m\": [0, 0] }\n]", ":2: not a list of poses"),
        ("[{ \"position_m\": [0, 0, 1e9] }]", "[0].position_m[2]"),
        ("[{ \"position_m\": [0, 0, 1], \"quaternion_wxyz\": [2, 0, 0, 0] }]", "has length 2"),
        ("[{ \"asset\": \"mug\", \"position_m\": [0, 0, 1] }]", "`mug` is in none of `slim`"),
    ] {
        let error = with_file(text);
        assert!(error.contains(want), "{text}: {error}");
    }
    for (options, want) in [
        ("from = \"slim\"", "lists no poses"),
        ("from = \"slim\"\nposes = [{ position_m = [0, 0, 0], rotation_deg = [0, 0, 9999] }]", "rotation_deg"),
        (
            "from = \"slim\"\nposes = [{ position_m = [0, 0, 0], rotation_deg = [0, 0, 9], quaternion_wxyz = [1, 0, 0, 0] }]",
            "already",
        ),
    ] {
        let error = refused("listed", options);
        assert!(error.contains(want), "{options}: {error}");
    }
    let file = folder.path().join("marked.json");
    std::fs::write(&file, "\u{feff}[{ \"asset\": \"slim/60x20x90\", \"position_m\": [0, 0, 1] }]").expect("written");
    let marked = placer("listed", &format!("from = [\"slim\", \"slim\"]\nfile = {file:?}"));
    place(&[&*marked], 1).expect("one pool, and a file with a byte order mark");
    let twice =
        placer("listed", "from = [\"small\", \"slim\"]\nposes = [{ asset = \"60x20x90\", position_m = [0, 0, 1] }]");
    let error = place(&[&*twice], 1).expect_err("ambiguous").to_string();
    assert!(error.contains("may be `small/60x20x90` or `slim/60x20x90`"), "{error}");
}
