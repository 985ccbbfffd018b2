//! Furniture along the walls of a room.

use super::*;

/// The pieces that furnishings add to a room with a table.
fn furnished(options: &str, seed: u64) -> (SceneBuilder, Vec<usize>) {
    let room = placer("room", "size_m = 4\nlength_m = 5\nheight_m = 2.5");
    let furnishings = placer("furnishings", options);
    let (scene, warnings) = place(&[&*room, &*table(), &*furnishings], seed).expect("placed");
    assert!(warnings.is_empty(), "{warnings:?}");
    let is_piece = |body: &BodyDraft| body.asset.pool != "tables" && body.role != Role::Room;
    let pieces = scene.bodies().enumerate().filter(|(_, (_, body))| is_piece(body)).map(|(number, _)| number);
    let pieces = pieces.collect();
    (scene, pieces)
}

#[test]
fn pieces_stand_with_their_backs_to_the_walls_and_apart() {
    let mut walls = [0; 4];
    for seed in 0..30 {
        let options = "from = [\"big\", \"slim\"]\ncount = 9\nwall_gap_m = 0.03\nclear_m = 0.7";
        let (scene, pieces) = furnished(options, seed);
        let bodies: Vec<&BodyDraft> = scene.bodies().map(|(_, body)| body).collect();
        assert!(pieces.len() >= 8, "{}", pieces.len());
        for &piece in &pieces {
            let body = bodies[piece];
            assert_eq!((body.role, body.motion), (Role::Fixture, Motion::Fixed));
            let bounds = body.world_bounds();
            assert!(bounds.min.z.abs() < 1e-6, "it stands on the floor: {bounds:?}");
            // The back of the asset, +y, is 3 cm from a wall of the 4 m × 5 m room.
            let back = body.world_from_body.rotation * Vector3::y();
            let axis = if back.x.abs() > 0.5 { 0 } else { 1 };
            let inner = [2.0, 2.5];
            let reach = if back[axis] > 0.0 { bounds.max[axis] } else { -bounds.min[axis] };
            assert!((reach - (inner[axis] - 0.03)).abs() < 1e-6, "{bounds:?} {back}");
            walls[2 * axis + usize::from(back[axis] > 0.0)] += 1;
            // The table of 1.2 m × 0.8 m has 0.7 m around it, and nothing overlaps.
            let beside = |low: f64, high: f64, half: f64| (low - half).max(-half - high).max(0.0);
            let [x, y] = [beside(bounds.min.x, bounds.max.x, 0.6), beside(bounds.min.y, bounds.max.y, 0.4)];
            assert!(x.max(y) >= 0.7, "{bounds:?}");
            for &other in pieces.iter().filter(|other| **other != piece) {
                let other = bodies[other].world_bounds();
                let shared = bounds.max.inf(&other.max) - bounds.min.sup(&other.min);
                assert!(shared.iter().any(|x| *x <= 0.0), "{bounds:?} {other:?}");
            }
        }
    }
    assert!(walls.iter().all(|count| *count > 40), "{walls:?}");
    assert!(walls[0] + walls[1] > walls[2] + walls[3], "the long walls have more: {walls:?}");
}

#[test]
fn pieces_hang_turn_and_carry() {
    let (scene, pieces) = furnished("from = \"slim\"\ncount = 5\nheight_m = 1.5", 1);
    let heights = scene.bodies().map(|(_, body)| body.world_bounds().min.z).collect::<Vec<_>>();
    assert!(pieces.len() == 5 && pieces.iter().all(|piece| (heights[*piece] - 1.5).abs() < 1e-6), "{heights:?}");
    // Turned by 30°, a corner is nearest to the wall.
    let (scene, pieces) = furnished("from = \"big\"\ncount = 4\nyaw_deg = 30", 2);
    let bodies: Vec<&BodyDraft> = scene.bodies().map(|(_, body)| body).collect();
    assert_eq!(pieces.len(), 4);
    for piece in pieces {
        let back = bodies[piece].world_from_body.rotation * Vector3::y();
        let angle = back.y.atan2(back.x).to_degrees().rem_euclid(90.0);
        assert!((angle - 30.0).abs() < 1e-6, "{angle}");
        let bounds = bodies[piece].world_bounds();
        let nearest = [2.0 - bounds.max.x, 2.0 + bounds.min.x, 2.5 - bounds.max.y, 2.5 + bounds.min.y];
        assert!((nearest.into_iter().fold(f64::INFINITY, f64::min) - 0.02).abs() < 1e-6, "{bounds:?}");
    }
    // Boards are supports.
    let (scene, pieces) = furnished("from = \"boards\"\ncount = 2\nname = \"shelf\"", 3);
    let names: Vec<&str> = scene.supports.iter().skip(1).map(|support| &*support.name).collect();
    assert_eq!(names, ["shelf/1/1", "shelf/1/2", "shelf/1/3", "shelf/2/1", "shelf/2/2", "shelf/2/3"]);
    let roles: Vec<Role> = scene.bodies().map(|(_, body)| body.role).collect();
    assert!(pieces.iter().all(|piece| roles[*piece] == Role::Support));
}

#[test]
fn walls_are_found_from_a_support_on_the_floor() {
    // Single precision puts the feet of some walls above the floor, and of some below.
    for height in [2.4, 2.5, 2.6, 2.7, 2.8, 2.9, 3.0, 3.1, 3.2] {
        let room = placer("room", &format!("size_m = 4\nheight_m = {height}\nsupport = {{}}"));
        let pieces = placer("furnishings", "from = \"slim\"\ncount = 3");
        let clutter = placer("distractors", "from = \"small\"\ncount = 20\ndistance_m = [0.1, 9]\nsize_m = [0.01, 1]");
        let (scene, _) = place(&[&*room, &*pieces, &*clutter], 1).unwrap_or_else(|error| panic!("{height}: {error}"));
        let bodies = || scene.bodies().map(|(_, body)| body).filter(|body| body.role != Role::Room);
        assert!(bodies().count() > 13, "{height}");
        let inside = |body: &BodyDraft| {
            let bounds = body.world_bounds();
            (0..2).all(|axis| bounds.min[axis] > -2.0 && bounds.max[axis] < 2.0)
        };
        assert!(bodies().all(inside), "{height}");
    }
}

#[test]
fn things_on_furniture_that_carries_nothing_are_left_out() {
    let room = placer("room", "size_m = 4\nheight_m = 2.5");
    let none = placer("furnishings", "from = \"boards\"\ncount = 0\nname = \"shelf\"");
    let things = |more: &str| placer("arrange", &format!("from = \"slim\"\nsupport = \"shelf\"\ncount = 3\n{more}"));
    let (scene, _) = place(&[&*room, &*table(), &*none, &*things("annotated = false")], 1).expect("placed");
    assert!(scene.bodies().all(|(_, body)| body.asset.pool != "slim"));
    let error = place(&[&*room, &*table(), &*none, &*things("")], 1).expect_err("labeled").to_string();
    assert!(error.contains("no support `shelf`"), "{error}");
    // Where furniture finds no place, another attempt may have more luck.
    let lost = placer("furnishings", "from = \"boards\"\ncount = 2\nwall_gap_m = 3.9\nname = \"shelf\"");
    let error = place(&[&*room, &*table(), &*lost, &*things("")], 1).expect_err("labeled");
    assert!(error.is_unlucky() && error.to_string().contains("no support `shelf`"), "{error}");
    let far = placer("furnishings", "from = \"big\"\ncount = 9\nwall_gap_m = 3.9");
    let (scene, _) = place(&[&*room, &*table(), &*far], 1).expect("placed");
    assert!(scene.bodies().all(|(_, body)| body.asset.pool != "big"), "no piece fits into the room");
    let outside = placer("ground", "");
    let pieces = placer("furnishings", "from = \"big\"\ncount = 2");
    let error = place(&[&*outside, &*table(), &*pieces], 1).expect_err("no wall").to_string();
    assert!(error.contains("no wall for furnishings") && error.contains("`room`"), "{error}");
}
