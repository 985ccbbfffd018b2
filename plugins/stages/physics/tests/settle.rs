//! The settler through its public interface.

mod kit;

use kit::*;
use parry3d::math::Vector;
use parry3d::query::PointQuery;
use parry3d::shape::TriMesh;
use std::sync::Arc;
use syntable_model::context::NoCache;
use syntable_model::geometry::{Point3, Pose, Translation3, UnitQuaternion, Vector3};
use syntable_model::scene::*;

const CUBE: f32 = 0.06;

fn cube() -> Arc<Object> {
    object("cube", cuboid([0.0; 3], [CUBE; 3]), 0.2)
}

fn heights(scene: &SceneBuilder) -> Vec<f64> {
    objects(scene).map(|body| body.world_from_body.translation.z - TABLE_HEIGHT).collect()
}

#[test]
fn a_cube_and_a_ball_rest_on_the_table() {
    let mut scene = table_scene();
    scene.add(dynamic(&cube(), at(0.2, 0.1, TABLE_HEIGHT + 0.08)));
    scene.add(dynamic(&object("ball", sphere(0.04), 0.1), at(-0.2, 0.0, TABLE_HEIGHT + 0.06)));
    let report = settle("", &mut scene);
    let [cube, ball] = heights(&scene)[..] else { panic!("{report:?}") };
    assert!((cube - f64::from(CUBE) / 2.0).abs() < 0.001, "cube at {cube}");
    assert!((ball - 0.04).abs() < 0.001, "ball at {ball}");
    assert!(report.removed.is_empty() && report.respawned == 0, "{report:?}");
    assert!(report.simulated_s < 2.5, "asleep long before the end: {report:?}");
    assert!(report.deepest_penetration_m < 0.001, "{report:?}");
    assert_eq!((report.residual_speed_m_s, report.residual_angular_speed_rad_s), (0.0, 0.0));
}

#[test]
fn bodies_rest_on_a_round_table_and_not_beside_it() {
    // A round top of 1 m: the corners of its bounding square are air.
    let rim = |z: f32| {
        (0..64)
            .map(move |i| (i as f32 / 64.0 * std::f32::consts::TAU).sin_cos())
            .map(move |(y, x)| [x / 2.0, y / 2.0, z])
    };
    let positions: Vec<[f32; 3]> = rim(0.71).chain(rim(0.75)).chain([[0.0, 0.0, 0.71], [0.0, 0.0, 0.75]]).collect();
    let triangles = (0..64_u32)
        .map(|i| (i, (i + 1) % 64))
        .flat_map(|(i, j)| [[128, j, i], [129, 64 + i, 64 + j], [i, j, 64 + j], [i, 64 + j, 64 + i]])
        .collect();
    let disc = MeshData { positions, triangles, ..Default::default() };
    let leg = cuboid([0.0, 0.0, 0.355], [0.1, 0.1, 0.71]);
    let mut scene = SceneBuilder::default();
    scene.add(draft(&object("round", join([disc, leg]), 9.0), at(0.0, 0.0, 0.0), Role::Support, Motion::Fixed));
    scene.supports = Support::new("table", Region::rectangle([0.0, 0.0, 0.75], [1.0, 1.0])).into();
    scene.add(dynamic(&cube(), at(0.3, 0.3, 0.85)));
    scene.add(dynamic(&cube(), at(0.44, 0.44, 0.85)));
    let report = settle("", &mut scene);
    assert_eq!(report.removed.iter().map(|removal| removal.spawn).collect::<Vec<_>>(), [1], "{report:?}");
    assert!((heights(&scene)[0] - 0.03).abs() < 0.001);
}

/// Distance, meters, that a cube of some friction moves in some time on a slope of friction 0.5.
fn slid(angle_deg: f64, time_s: f64, friction: f64) -> f64 {
    let tilt = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle_deg.to_radians());
    let on_slope = |along: f64, up: f64| {
        let offset = Vector3::new(0.0, 0.0, 1.5) + tilt * Vector3::new(along, 0.0, up);
        Pose::from_parts(Translation3::from(offset), tilt)
    };
    let slope = object("slope", cuboid([0.0; 3], [2.0, 1.0, 0.1]), 1.0);
    let mut scene = SceneBuilder::default();
    scene.add(draft(&slope, on_slope(0.0, 0.0), Role::Support, Motion::Fixed));
    let start = on_slope(-0.5, 0.05 + f64::from(CUBE) / 2.0);
    scene.add(BodyDraft { friction, ..dynamic(&cube(), start) });
    settle(&format!("remove = \"keep\"\non_violation = \"keep\"\nduration_s = {time_s}"), &mut scene);
    let body = objects(&scene).next().expect("a cube");
    (body.world_from_body.translation.vector - start.translation.vector).norm()
}

#[test]
fn friction_decides_whether_a_cube_slides() {
    // tan 26.57° = 0.5. Above it the distance is ½ g (sin θ − μ cos θ) t².
    let check = |angle_deg: f64, time_s: f64, expected_m: f64| {
        let moved = slid(angle_deg, time_s, 0.5);
        assert!((moved - expected_m).abs() < 0.003 + 0.1 * expected_m, "{angle_deg}°: {moved} m, not {expected_m}");
    };
    let slide = |angle: f64| 0.5 * 9.81 * (angle.to_radians().sin() - 0.5 * angle.to_radians().cos());
    check(15.0, 1.0, 0.0);
    check(24.0, 1.0, 0.0);
    check(30.0, 1.0, slide(30.0));
    check(40.0, 0.8, slide(40.0) * 0.64);
}

#[test]
fn no_body_falls_through_the_floor() {
    let shapes = kit_objects();
    for floor in [true, false] {
        let mut scene = SceneBuilder::default();
        if floor {
            let wall = object("wall", cuboid([0.0; 3], [3.0, 0.0, 3.0]), 1.0);
            let floor = object("floor", cuboid([0.0; 3], [3.0, 3.0, 0.0]), 1.0);
            scene.add(draft(&floor, at(0.0, 0.0, 0.0), Role::Room, Motion::Fixed));
            scene.add(draft(&wall, at(0.0, 0.5, 1.5), Role::Room, Motion::Fixed));
        }
        drop_objects(&mut scene, &shapes, 12, 3);
        let report = settle("remove = \"keep\"\non_violation = \"keep\"", &mut scene);
        assert_eq!(objects(&scene).count(), 12, "{report:?}");
        for body in objects(&scene) {
            let (low, _) = z_range(body);
            assert!(low > -0.003, "{} at {low}", body.object.name);
            assert!(!floor || body.world_from_body.translation.y < 0.5, "{} behind the wall", body.object.name);
        }
    }
}

#[test]
fn bodies_off_the_tabletop_are_removed() {
    // The table is 1.2 × 0.8 m, but only the central 0.4 × 0.4 m count. A step is below it.
    let scene = || {
        let mut scene = table_scene();
        let step = object("step", cuboid([0.0; 3], [0.3, 0.3, 0.1]), 1.0);
        scene.add(draft(&step, at(0.9, 0.0, 0.5), Role::Support, Motion::Fixed));
        scene.supports = Support::new("table", Region::rectangle([0.0, 0.0, TABLE_HEIGHT], [0.4, 0.4])).into();
        let far = object("far", cuboid([1.0, 0.0, 0.0], [CUBE; 3]), 0.2);
        let rest = TABLE_HEIGHT + f64::from(CUBE) / 2.0;
        scene.add(dynamic(&cube(), at(0.195, 0.0, rest))); // inside
        scene.add(dynamic(&cube(), at(-0.205, 0.0, rest))); // beyond the width
        scene.add(dynamic(&cube(), at(0.0, 0.205, rest))); // beyond the length
        scene.add(dynamic(&cube(), at(0.9, 0.0, 0.6))); // on the step
        scene.add(dynamic(&far, at(-1.0, -0.19, rest))); // origin outside, center inside
        scene
    };
    let mut kept = scene();
    let report = settle("", &mut kept);
    let removed: Vec<(u32, &str)> = report.removed.iter().map(|r| (r.spawn, &r.reason[..])).collect();
    assert_eq!(
        removed,
        [(1, "beyond the edge of the table"), (2, "beyond the edge of the table"), (3, "fell off the table")]
    );
    assert_eq!(objects(&kept).map(|body| body.spawn).collect::<Vec<_>>(), [0, 4]);
    let mut all = scene();
    assert!(settle("remove = \"keep\"", &mut all).removed.is_empty());
    assert_eq!(objects(&all).count(), 5);
}

/// A cube inside a hollow box that is too small for it.
fn caged_cube() -> SceneBuilder {
    let mut scene = table_scene();
    let (inner, wall) = (0.045, 0.03);
    let side = inner + 2.0 * wall;
    let plates = (0..3).flat_map(|axis| [-1.0, 1.0].map(|sign| (axis, sign))).map(|(axis, sign)| {
        let (mut center, mut size) = ([0.0; 3], [side; 3]);
        center[axis] = sign * (inner + wall) / 2.0;
        size[axis] = wall;
        cuboid(center, size)
    });
    let parts = plates.clone().map(|plate| plate.positions).collect();
    let cage = Object { collision: Some(Arc::new(parts)), ..(*object("cage", join(plates), 1.0)).clone() };
    scene.add(draft(&Arc::new(cage), at(0.3, 0.0, 1.2), Role::Support, Motion::Fixed));
    scene.add(dynamic(&cube(), at(0.3, 0.0, 1.2)));
    scene
}

#[test]
fn a_body_deep_in_another_is_respawned_or_removed() {
    let mut scene = caged_cube();
    let report = settle("on_violation = \"keep\"\nduration_s = 1.0", &mut scene);
    assert!(report.deepest_penetration_m > 0.006 && report.removed.is_empty(), "{report:?}");

    let mut scene = caged_cube();
    let report = settle("on_violation = \"remove\"\nduration_s = 1.0", &mut scene);
    assert_eq!((report.removed.len(), report.respawned), (1, 0), "{report:?}");
    assert!(report.removed[0].reason.contains("mm deep in the table or the room"), "{report:?}");
    assert_eq!(report.deepest_penetration_m, 0.0);

    let mut scene = caged_cube();
    let report = settle("", &mut scene);
    assert!(report.removed.is_empty() && report.respawned >= 1, "{report:?}");
    assert!(report.deepest_penetration_m < 0.005, "{report:?}");
    let (low, high) = z_range(objects(&scene).next().expect("a cube"));
    assert!(low > TABLE_HEIGHT - 0.001, "outside the cage: {low} to {high}");

    let mut scene = caged_cube();
    let report = settle("max_respawns = 0", &mut scene);
    assert_eq!((report.removed.len(), report.respawned), (1, 0), "{report:?}");
}

#[test]
fn moving_bodies_are_detected() {
    let falling = || {
        let mut scene = table_scene();
        scene.add(dynamic(&cube(), at(0.0, 0.0, TABLE_HEIGHT + 0.5)));
        scene
    };
    let mut scene = falling();
    let report = settle("on_violation = \"keep\"\nduration_s = 0.1", &mut scene);
    assert!((report.residual_speed_m_s - 0.981).abs() < 0.01, "g t = 0.981 m/s: {report:?}");
    assert!((report.simulated_s - 0.1).abs() < 0.005, "{report:?}");
    let fallen = TABLE_HEIGHT + 0.5 - objects(&scene).next().expect("a cube").world_from_body.translation.z;
    assert!((fallen - 0.5 * 9.81 * 0.01).abs() < 0.003, "½ g t² = 49 mm: {fallen}");

    let mut scene = falling();
    let report = settle("on_violation = \"remove\"\nduration_s = 0.1", &mut scene);
    assert!(report.removed[0].reason.starts_with("still moving at 0.98"), "{report:?}");
    assert_eq!(report.residual_speed_m_s, 0.0);

    // A body that only needs more time gets it once: it falls to the table for 0.32 s, and then stays at rest.
    let mut scene = falling();
    let report = settle("duration_s = 0.3", &mut scene);
    assert_eq!((report.respawned, report.removed.len()), (0, 0), "{report:?}");
    assert!((heights(&scene)[0] - f64::from(CUBE) / 2.0).abs() < 0.001);

    // Too short to fall 3 cm even twice: all respawns are used up, then the body is removed.
    let mut scene = falling();
    let report = settle("duration_s = 0.03\nmax_respawns = 2", &mut scene);
    assert_eq!((report.respawned, report.removed.len()), (2, 1), "{report:?}");

    // Moving distractors are removed, too.
    let mut scene = table_scene();
    scene.add(draft(&cube(), at(0.0, 0.0, TABLE_HEIGHT + 0.5), Role::Distractor, Motion::Dynamic));
    let report = settle("on_violation = \"remove\"\nduration_s = 0.1", &mut scene);
    assert_eq!((report.removed.len(), report.removed_distractors, report.residual_speed_m_s), (0, 1, 0.0));
}

#[test]
fn what_fell_off_is_dropped_again() {
    let scene = || {
        let mut scene = table_scene();
        scene.add(dynamic(&cube(), at(1.0, 0.0, TABLE_HEIGHT + 0.1)));
        scene.add(dynamic(&cube(), at(0.61, 0.0, TABLE_HEIGHT + 0.1)));
        scene
    };
    let mut lost = scene();
    assert_eq!(settle("", &mut lost).removed.len(), 2);
    let mut kept = scene();
    let report = settle("respawn_fallen = true", &mut kept);
    assert!(report.removed.is_empty() && report.respawned >= 2, "{report:?}");
    for body in objects(&kept) {
        let place = body.world_from_body.translation.vector;
        assert!(place.x.abs() < 0.6 && place.y.abs() < 0.4 && place.z > TABLE_HEIGHT, "{place:?}");
    }
}

#[test]
fn a_respawned_body_keeps_to_its_placer() {
    let mut scene = caged_cube();
    let handle = scene.bodies().find(|(_, body)| body.role == Role::Object).expect("a cube").0;
    let body = scene.remove(handle).expect("a cube");
    let support = scene.support(None).expect("a table").clone();
    let area = Region::rectangle(support.center().into(), [0.1, 0.16]);
    scene.drop_body(body, DropZone { area, ..DropZone::on(support) });
    let report = settle("", &mut scene);
    assert!(report.removed.is_empty() && report.respawned >= 1, "{report:?}");
    let pose = objects(&scene).next().expect("a cube").world_from_body;
    assert!(pose.translation.x.abs() < 0.051 && pose.translation.y.abs() < 0.081, "{pose:?}");
    let up = pose.rotation * Vector3::z();
    assert!((up - Vector3::z()).norm() < 0.01, "it started upright: {up:?}");
}

#[test]
fn poured_bodies_start_one_after_another() {
    // All start at one place, which only has room for one.
    let scene = || {
        let mut scene = table_scene();
        for _ in 0..8 {
            scene.add(dynamic(&cube(), at(0.0, 0.0, TABLE_HEIGHT + 0.1)));
        }
        scene
    };
    let mut together = scene();
    let report = settle("on_violation = \"keep\"\nremove = \"keep\"\nduration_s = 0.01", &mut together);
    assert!(report.deepest_penetration_m > 0.02, "{report:?}");
    let mut poured = scene();
    let report = settle("pour_interval_s = 0.2\nremove = \"keep\"", &mut poured);
    assert!(report.deepest_penetration_m < 0.002 && report.respawned == 0, "{report:?}");
    assert_eq!(objects(&poured).count(), 8);
    let highest = heights(&poured).into_iter().fold(0.0, f64::max);
    assert!(highest > 1.4 * f64::from(CUBE), "some lie on others: {:?}", heights(&poured));
}

#[test]
fn pouring_takes_no_time_from_respawns() {
    // Twelve bodies are poured for 2.4 s, and respawns end 2 s after.
    let mut scene = table_scene();
    for i in 0..11 {
        scene.add(dynamic(&cube(), at(0.1 * f64::from(i) - 0.5, 0.0, TABLE_HEIGHT + 0.04)));
    }
    scene.add(dynamic(&cube(), at(1.0, 0.0, TABLE_HEIGHT + 0.04)));
    let report = settle("pour_interval_s = 0.2\nduration_s = 0.2\nrespawn_fallen = true", &mut scene);
    assert!(report.removed.is_empty() && report.respawned >= 1, "{report:?}");
    assert_eq!(objects(&scene).count(), 12);
}

#[test]
fn bodies_are_poured_in_the_order_in_which_they_were_placed() {
    for roles in [[Role::Object, Role::Distractor], [Role::Distractor, Role::Object]] {
        let mut scene = table_scene();
        // Objects have numbers of their own; distractors have none.
        scene.add(dynamic(&cube(), at(0.3, 0.0, TABLE_HEIGHT + 0.1)));
        for role in roles {
            scene.add(draft(&cube(), at(0.0, 0.0, TABLE_HEIGHT + 0.1), role, Motion::Dynamic));
        }
        settle("pour_interval_s = 0.5\nremove = \"keep\"", &mut scene);
        let height = |role: Role| {
            let at_start = |body: &BodyDraft| body.role == role && body.world_from_body.translation.x < 0.2;
            let (_, body) = scene.bodies().find(|(_, body)| at_start(body)).expect("it stays");
            body.world_from_body.translation.z - TABLE_HEIGHT
        };
        let [first, second] = roles.map(height);
        let edge = f64::from(CUBE);
        assert!(
            (first - 0.5 * edge).abs() < 0.002 && (second - 1.5 * edge).abs() < 0.002,
            "{roles:?}: {first} {second}"
        );
    }
}

#[test]
fn nothing_rests_on_the_ceiling() {
    let mut scene = table_scene();
    let ceiling = object("ceiling", cuboid([0.0; 3], [4.0, 4.0, 0.1]), 1.0);
    scene.add(draft(&ceiling, at(0.0, 0.0, 1.55), Role::Room, Motion::Fixed));
    scene.add(dynamic(&cube(), at(0.0, 0.0, TABLE_HEIGHT + 0.1)));
    scene.add(dynamic(&cube(), at(0.2, 0.0, 1.7)));
    assert!(
        scene.ceiling_height(scene.support(None).expect("a table")).is_some_and(|height| (height - 1.5).abs() < 1e-6)
    );
    let report = settle("", &mut scene);
    let removed: Vec<(u32, &str)> = report.removed.iter().map(|r| (r.spawn, &r.reason[..])).collect();
    assert_eq!(removed, [(1, "above the ceiling")]);
}

#[test]
fn each_body_is_judged_by_the_support_that_it_is_dropped_on() {
    // A second support is a board of 0.4 m × 0.4 m, 0.2 m above one end of the table, with 0.3 m of space above it.
    let settled = |board: [f64; 2], on_board: bool, options: &str| {
        let mut scene = table_scene();
        let plank = object("plank", cuboid([0.0; 3], [0.4, 0.4, 0.02]), 1.0);
        scene.add(draft(&plank, at(0.3, 0.0, TABLE_HEIGHT + 0.19), Role::Support, Motion::Fixed));
        let surface = Region::rectangle([0.3, 0.0, TABLE_HEIGHT + 0.2], [0.4, 0.4]);
        scene.supports.add(Support::new("board", surface).with_clear_height(0.3)).expect("new");
        let name = on_board.then(|| "board".into());
        let support = scene.support(name.as_ref()).expect("there").clone();
        let zone = DropZone::on(support);
        scene.drop_body(dynamic(&cube(), at(board[0], 0.0, TABLE_HEIGHT + board[1])), zone);
        let report = settle(options, &mut scene);
        report.removed.first().map(|removal| removal.reason.clone())
    };
    let once = "on_violation = \"remove\"";
    assert_eq!(settled([0.3, 0.3], true, once), None, "it lies on the board");
    assert_eq!(settled([-0.3, 0.1], true, once).as_deref(), Some("fell off the board"), "it lies on the table beside");
    assert_eq!(settled([-0.3, 0.1], false, once), None, "where those of the table belong");
    assert_eq!(settled([0.3, 0.1], false, once), None, "and under the board");
    assert_eq!(settled([-0.3, 0.1], true, "respawn_fallen = true"), None, "it starts again above the board");
}

#[test]
fn a_bin_of_one_mesh_keeps_its_walls() {
    // Walls and floor of 0.02 m around a space of 0.36 m × 0.26 m × 0.18 m.
    let mut scene = SceneBuilder::default();
    let bin = object("bin", tray([0.4, 0.3, 0.2], 0.02), 1.0);
    scene.add(draft(&bin, at(0.0, 0.0, 0.0), Role::Support, Motion::Fixed));
    scene.supports.add(Support::new("bin", Region::rectangle([0.0, 0.0, 0.02], [0.36, 0.26]))).expect("new");
    // Pushed towards a wall by the cube that it falls on.
    for (x, z) in [(0.1, 0.1), (0.12, 0.2), (-0.1, 0.1), (-0.12, 0.25)] {
        scene.add(dynamic(&cube(), at(x, 0.05, z)));
    }
    let report = settle("on_violation = \"keep\"", &mut scene);
    assert!(report.removed.is_empty() && report.deepest_penetration_m < 0.005, "{report:?}");
    for body in objects(&scene) {
        let bounds = body.world_bounds();
        assert!(bounds.min.z > 0.015 && bounds.max.x < 0.185 && bounds.min.x > -0.185, "{bounds:?}");
        assert!(bounds.max.y < 0.135 && bounds.min.y > -0.135, "{bounds:?}");
    }
}

#[test]
fn without_a_floor_nothing_hangs_beside_the_table() {
    let settled = |has_floor: bool| {
        let mut scene = table_scene();
        if !has_floor {
            let floor = scene.bodies().find(|(_, body)| body.role == Role::Room).expect("a floor").0;
            scene.remove(floor);
        }
        for x in [0.0, 1.0] {
            scene.add(draft(&cube(), at(x, 0.0, TABLE_HEIGHT + 0.1), Role::Distractor, Motion::Dynamic));
        }
        let report = settle("", &mut scene);
        (report.removed_distractors, scene.bodies().filter(|(_, body)| body.role == Role::Distractor).count())
    };
    assert_eq!(settled(true), (0, 2), "one lies on the floor");
    assert_eq!(settled(false), (1, 1));
}

#[test]
fn a_placer_can_set_friction_and_restitution() {
    // The coefficients of two bodies are averaged. tan 40° = 0.84 is below (0.5 + 2) / 2 and above (0.5 + 0.5) / 2.
    let moved = |friction: f64| slid(40.0, 0.5, friction);
    assert!(moved(2.0) < 0.01 && moved(0.5) > 0.2, "{} {}", moved(2.0), moved(0.5));

    // 0.2 m take 0.2 s. At e = (0 + 1) / 2 the ball comes back at half the speed: a quarter of the height, 0.1 s later.
    let height = |restitution: Option<f64>| {
        let mut scene = table_scene();
        let ball = dynamic(&object("ball", sphere(0.03), 0.1), at(0.0, 0.0, TABLE_HEIGHT + 0.23));
        scene.add(BodyDraft { restitution, ..ball });
        settle("on_violation = \"keep\"\nduration_s = 0.303", &mut scene);
        heights(&scene)[0] - 0.03
    };
    assert!(height(None) < 0.005, "{}", height(None));
    assert!((height(Some(1.0)) - 0.05).abs() < 0.01, "{}", height(Some(1.0)));
}

#[test]
fn the_longest_time_step_lets_nothing_through() {
    let mut scene = table_scene();
    drop_objects(&mut scene, &kit_objects(), 16, 4);
    let before = objects(&scene).count();
    let report = settle("time_step_s = 0.02\non_violation = \"keep\"\nremove = \"keep\"", &mut scene);
    let table = |body: &&BodyDraft| {
        let place = body.world_from_body.translation.vector;
        place.x.abs() < 0.55 && place.y.abs() < 0.35
    };
    for body in objects(&scene).filter(table) {
        let (low, _) = z_range(body);
        assert!(low > TABLE_HEIGHT - 0.02, "{} at {low}: {report:?}", body.object.name);
    }
    assert_eq!(objects(&scene).count(), before);
}

#[test]
fn without_physics_everything_stays() {
    let mut scene = table_scene();
    drop_objects(&mut scene, &kit_objects(), 5, 2);
    let before = pose_bits(&scene);
    let report = settle_with(&*no_physics(), &mut scene, &NoCache).expect("nothing to do");
    assert_eq!((pose_bits(&scene), report), (before, SettleReport::default()));
}

#[test]
fn forty_objects_are_accepted() {
    let mut scene = table_scene();
    drop_objects(&mut scene, &kit_objects(), 40, 11);
    let report = settle("", &mut scene);
    assert!(report.residual_speed_m_s <= 0.01 && report.residual_angular_speed_rad_s <= 0.1, "{report:?}");
    assert!(report.deepest_penetration_m <= 0.005, "{report:?}");
    assert_eq!(objects(&scene).count() + report.removed.len(), 40);
    assert!(objects(&scene).count() >= 25, "{report:?}");
    for body in objects(&scene) {
        // At most 6 mm below the tabletop, measured at the vertices of the mesh, not of the collision shape.
        let (low, _) = z_range(body);
        assert!(low > TABLE_HEIGHT - 0.006, "{} {} at {low}", body.spawn, body.object.name);
    }
}

#[test]
fn too_many_objects_on_a_tiny_tabletop_terminate() {
    let mut scene = table_scene();
    scene.supports = Support::new("table", Region::rectangle([0.0, 0.0, TABLE_HEIGHT], [0.12, 0.12])).into();
    drop_objects(&mut scene, &kit_objects(), 12, 5);
    let report = settle("max_respawns = 2\nduration_s = 1.0\nmax_speed_m_s = 0.0001", &mut scene);
    assert_eq!(objects(&scene).count() + report.removed.len(), 12);
    assert!(report.residual_speed_m_s <= 0.0001 && report.deepest_penetration_m <= 0.005, "{report:?}");
}

#[test]
fn the_same_on_any_thread_and_with_any_cache() {
    let settled =
        |settler: &dyn syntable_model::stage::Settler, cache: &dyn syntable_model::context::Cache, seed: u64| {
            let mut scene = table_scene();
            drop_objects(&mut scene, &kit_objects(), 10, seed);
            let report = settle_with(settler, &mut scene, cache).expect("settles");
            (pose_bits(&scene), report)
        };
    let wanted = [1, 2].map(|seed| settled(&*settler(""), &NoCache, seed));
    assert_ne!(wanted[0].0, wanted[1].0);

    // A cold cache, then a warm one with a new settler, then one that keeps shapes in memory.
    let cache = MemoryCache::default();
    assert_eq!(settled(&*settler(""), &cache, 1), wanted[0]);
    assert_eq!(*cache.hits.lock().expect("a lock"), 0);
    let shared = settler("");
    assert_eq!(settled(&*shared, &cache, 1), wanted[0]);
    assert!(*cache.hits.lock().expect("a lock") > 0);
    // Damaged entries are recomputed.
    cache.entries.lock().expect("a lock").values_mut().for_each(|bytes| bytes.truncate(bytes.len() / 2));
    assert_eq!(settled(&*settler(""), &cache, 1), wanted[0]);

    // Two scenes side by side, and pools of one and two threads around them.
    std::thread::scope(|scope| {
        let jobs = [1, 2].map(|seed| {
            (
                seed,
                scope.spawn({
                    let (shared, settled) = (&shared, &settled);
                    move || settled(&**shared, &NoCache, seed)
                }),
            )
        });
        for (seed, job) in jobs {
            assert_eq!(job.join().expect("no panic"), wanted[seed as usize - 1]);
        }
    });
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        assert_eq!(pool.install(|| settled(&*shared, &NoCache, 2)), wanted[1], "{threads} threads");
    }
}

#[test]
fn degenerate_meshes_settle_or_give_an_error() {
    let soup =
        |positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>| MeshData { positions, triangles, ..Default::default() };
    let fine = [
        ("one triangle", soup(vec![[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]], vec![[0, 1, 2]])),
        ("no area", soup(vec![[0.0; 3], [0.1, 0.0, 0.0], [0.05, 0.0, 0.0]], vec![[0, 1, 2]])),
        ("a point", soup(vec![[0.03; 3]; 3], vec![[0, 1, 2], [2, 1, 0]])),
        ("a sheet", cuboid([0.0; 3], [0.2, 0.1, 0.0])),
        ("thin", cuboid([0.0; 3], [0.2, 0.1, 1e-6])),
        ("a needle", cuboid([0.0; 3], [0.2, 1e-5, 1e-5])),
        ("a grain", cuboid([0.0; 3], [1e-6; 3])),
        ("two pieces", join([cuboid([-0.05, 0.0, 0.0], [0.02; 3]), cuboid([0.05, 0.0, 0.0], [0.02; 3])])),
        ("open", MeshData { triangles: vec![[0, 2, 3], [4, 5, 7]], ..cuboid([0.0; 3], [0.1; 3]) }),
        ("inside out", {
            let data = sphere(0.03);
            MeshData { triangles: data.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(), ..data }
        }),
        ("with a far vertex that no face uses", {
            let mut data = cuboid([0.0; 3], [0.05; 3]);
            data.positions.push([1e30; 3]);
            data
        }),
    ];
    for (name, data) in fine {
        for options in ["", "collision = \"convex_hull\""] {
            let mut scene = table_scene();
            scene.add(dynamic(&object(name, data.clone(), 0.1), at(0.0, 0.0, TABLE_HEIGHT + 0.1)));
            let report = settle(options, &mut scene);
            assert_eq!(objects(&scene).count(), 1, "{name}: {report:?}");
            let (low, _) = z_range(objects(&scene).next().expect("one"));
            assert!((low - TABLE_HEIGHT).abs() < 0.002, "{name}: {low}");
        }
    }
    let mut scene = table_scene();
    scene.add(dynamic(&object("a galaxy", cuboid([0.0; 3], [1e30; 3]), 0.1), at(0.0, 0.0, 2.0)));
    let error = settle_with(&*settler(""), &mut scene, &NoCache).expect_err("no shape").to_string();
    assert!(error.starts_with("kit/a galaxy: "), "{error}");
    let mut scene = table_scene();
    scene.add(dynamic(&object("hollow", cuboid([0.0; 3], [0.1; 3]), 0.0), at(0.0, 0.0, 2.0)));
    let error = settle_with(&*settler(""), &mut scene, &NoCache).expect_err("no mass").to_string();
    assert!(error.starts_with("kit/hollow: its mass is 0 kg"), "{error}");
    settle_with(&*settler("mass = { kg = 1.0 }"), &mut scene, &NoCache).expect("its own mass does not matter");
    let hollow = objects(&scene).next().expect("it stays");
    assert_eq!((hollow.mass.kg, hollow.mass.origin), (1.0, MassOrigin::Assigned), "what was simulated is recorded");
}

#[test]
fn a_body_tips_over_the_edge_as_its_center_of_mass_says() {
    // A bar that lies on the table by a third of its length: alone it falls, with a heavy end on the table it stays.
    for (center_x, stays) in [(0.0, false), (-0.12, true)] {
        let mut scene = table_scene();
        let bar = object("bar", cuboid([0.0; 3], [0.3, 0.03, 0.03]), 0.5);
        let mut body = dynamic(&bar, at(0.65, 0.0, TABLE_HEIGHT + 0.016));
        body.mass.center.x = center_x;
        scene.add(body);
        settle("remove = \"keep\"", &mut scene);
        let z = heights(&scene)[0];
        assert_eq!(z > 0.0, stays, "center at {center_x} m: {z} m above the table");
        assert!(!stays || (z - 0.015).abs() < 0.001, "{z}");
    }
}

#[test]
fn a_scene_without_objects_or_table() {
    let report = settle("", &mut table_scene());
    assert_eq!((report.removed.len(), report.deepest_penetration_m), (0, 0.0));
    let error = settle_with(&*settler(""), &mut SceneBuilder::default(), &NoCache).expect_err("no table");
    assert!(error.to_string().contains("place a table first"), "{error}");
    settle("remove = \"keep\"", &mut SceneBuilder::default());
}

#[test]
fn parts_supplied_by_an_object_are_used() {
    // The mesh is a cube of 6 cm; its collision part is a slab of 2 cm at its center.
    let slab = cuboid([0.0; 3], [0.06, 0.06, 0.02]).positions;
    let body = Object { collision: Some(Arc::new(vec![slab])), ..(*cube()).clone() };
    let check = |options: &str, height: f64| {
        let mut scene = table_scene();
        scene.add(dynamic(&Arc::new(body.clone()), at(0.0, 0.0, TABLE_HEIGHT + 0.05)));
        settle(options, &mut scene);
        assert!((heights(&scene)[0] - height).abs() < 0.001, "{options}: {}", heights(&scene)[0]);
    };
    check("", 0.01);
    check("collision = \"convex_hull\"", 0.03);
}

#[test]
fn a_bowl_holds_a_ball_unless_it_is_a_convex_hull() {
    let bowl = kit_objects().swap_remove(1);
    let ball = object("ball", sphere(0.02), 0.05);
    let check = |options: &str, inside: bool| {
        let mut scene = table_scene();
        scene.add(draft(&bowl, at(0.0, 0.0, TABLE_HEIGHT), Role::Object, Motion::Fixed));
        scene.add(dynamic(&ball, at(0.005, 0.0, TABLE_HEIGHT + 0.12)));
        settle(options, &mut scene);
        let z = heights(&scene)[0];
        assert_eq!(z < 0.04, inside, "{options}: ball at {z}");
    };
    check("", true);
    check("collision = \"convex_hull\"\nduration_s = 0.5\non_violation = \"keep\"", false);
}

/// Distance of the surface of a ball from the mesh of another body, meters; negative where it penetrates.
fn gap(ball: &BodyDraft, radius: f64, other: &BodyDraft) -> f64 {
    let vector = |p: [f64; 3]| Vector::from(p.map(|x| x as f32));
    let data = other.object.mesh.data();
    let mesh = TriMesh::new(data.positions.iter().map(|&p| Vector::from(p)).collect(), data.triangles.clone());
    let center = other.world_from_body.inverse() * Point3::from(ball.world_from_body.translation.vector);
    f64::from(mesh.expect("a mesh").distance_to_local_point(vector(center.into()), false)) - radius
}

/// Winding number of a closed surface around a point: 1 inside, 0 outside. The sum of the solid angles of its triangles
/// (van Oosterom and Strackee, 1983).
fn winding(data: &MeshData, point: &Point3<f64>) -> f64 {
    let solid_angle = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|i| Point3::from(data.positions[i as usize].map(f64::from)) - point);
        let (x, y, z) = (a.norm(), b.norm(), c.norm());
        2.0 * a.dot(&b.cross(&c)).atan2(x * y * z + a.dot(&b) * z + b.dot(&c) * x + c.dot(&a) * y)
    };
    data.triangles.iter().map(solid_angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

/// Depth of one body's mesh inside another's, meters: of its vertices, and of points on its edges and faces.
fn mesh_depth(one: &BodyDraft, other: &BodyDraft) -> f64 {
    let (data, bounds) = (other.object.mesh.data(), other.object.mesh.bounds());
    let points = data.positions.iter().map(|&p| Vector::from(p)).collect();
    let surface = TriMesh::new(points, data.triangles.clone()).expect("a mesh");
    let other_from_one = other.world_from_body.inverse() * one.world_from_body;
    let samples = (0..one.object.mesh.data().triangles.len()).flat_map(|triangle| {
        let [a, b, c] = one.object.mesh.corners(triangle).map(|p| (other_from_one * p).coords);
        [a, (a + b) / 2.0, (b + c) / 2.0, (a + b + c) / 3.0].map(Point3::from)
    });
    let is_near = |p: &Point3<f64>| (0..3).all(|axis| bounds.min[axis] < p[axis] && p[axis] < bounds.max[axis]);
    let inside = samples.filter(is_near).filter(|p| winding(data, p) > 0.5);
    let depth = |p: Point3<f64>| {
        let p = Vector::from([p.x, p.y, p.z].map(|x| x as f32));
        f64::from(surface.distance_to_local_point(p, false))
    };
    inside.map(depth).fold(0.0, f64::max)
}

/// The largest depth of any object's mesh in another object or in a support, meters.
fn deepest_of_meshes(scene: &SceneBuilder) -> f64 {
    let all: Vec<&BodyDraft> = scene.bodies().map(|(_, body)| body).filter(|body| body.role != Role::Room).collect();
    let is_moving = |body: &BodyDraft| body.motion == Motion::Dynamic;
    let pairs = (0..all.len()).flat_map(|i| (0..all.len()).map(move |k| (i, k))).filter(|(i, k)| i != k);
    let moving = pairs.filter(|&(i, k)| is_moving(all[i]) || is_moving(all[k]));
    moving.map(|(i, k)| mesh_depth(all[i], all[k])).fold(0.0, f64::max)
}

#[test]
fn render_meshes_penetrate_as_deeply_as_the_report_says() {
    // Two cubes, one 7 mm in the other and 2 mm in the table.
    let mut scene = table_scene();
    let half = f64::from(CUBE) / 2.0;
    scene.add(dynamic(&cube(), at(0.0, 0.0, TABLE_HEIGHT + half - 0.002)));
    scene.add(dynamic(&cube(), at(0.01, 0.01, TABLE_HEIGHT + 3.0 * half - 0.009)));
    assert!((deepest_of_meshes(&scene) - 0.007).abs() < 1e-6, "{}", deepest_of_meshes(&scene));
    let keep = "on_violation = \"keep\"\nremove = \"keep\"";
    let report = settle(&format!("{keep}\nduration_s = 0.01"), &mut scene);
    let meshes = deepest_of_meshes(&scene);
    assert!(meshes > 0.003 && (meshes - report.deepest_penetration_m).abs() < 1e-4, "{meshes} m, {report:?}");

    // A heap of hollow shapes at rest. The hulls of each may leave out 0.3 mm of its mesh, and 0.03 mm for their grid.
    let mut heap = table_scene();
    drop_objects(&mut heap, &kit_objects(), 16, 4);
    let report = settle("", &mut heap);
    let meshes = deepest_of_meshes(&heap);
    assert!(objects(&heap).count() >= 10 && report.deepest_penetration_m > 0.0, "{report:?}");
    let (report_m, left_out) = (report.deepest_penetration_m, 2.0 * 0.000_33);
    assert!(meshes > 0.0 && meshes <= report_m + left_out, "{meshes} m, not {report_m} m");
    // If the lowest body is moved 4 mm down from its rest, it is as deep in the table.
    let lowest = |body: &BodyDraft| z_range(body).0;
    let moved = objects(&heap).min_by(|a, b| lowest(a).total_cmp(&lowest(b))).expect("a body");
    let lowered = BodyDraft {
        world_from_body: Translation3::new(0.0, 0.0, -0.004) * moved.world_from_body,
        ..dynamic(&moved.object, moved.world_from_body)
    };
    let table = heap.bodies().map(|(_, body)| body).find(|body| body.role == Role::Support).expect("a table");
    let depth = mesh_depth(&lowered, table);
    assert!((0.0035..0.005).contains(&depth), "{depth}");
}

/// A table of 0.75 m with a rim of 3 cm around a board of 2 cm.
fn rimmed_table() -> SceneBuilder {
    let rimmed = tray([1.2, 0.8, 0.05], 0.02);
    let positions = rimmed.positions.iter().map(|&[x, y, z]| [x, y, z + 0.7]).collect();
    let legs = [[-0.55, -0.35], [0.55, -0.35], [-0.55, 0.35], [0.55, 0.35]]
        .map(|[x, y]| cuboid([x, y, 0.35], [0.05, 0.05, 0.7]));
    let table = join([MeshData { positions, ..rimmed }].into_iter().chain(legs));
    let mut scene = SceneBuilder::default();
    scene.add(draft(&object("rimmed", table, 20.0), at(0.0, 0.0, 0.0), Role::Support, Motion::Fixed));
    scene.supports = Support::new("table", Region::rectangle([0.0, 0.0, 0.75], [1.2, 0.8])).into();
    scene
}

#[test]
fn bodies_lie_on_the_board_of_a_rimmed_table() {
    let mut scene = rimmed_table();
    let marble = object("marble", sphere(0.008), 0.005);
    for i in 0..6 {
        let (x, y) = (0.18 * f64::from(i) - 0.45, 0.1 * f64::from(i % 3) - 0.1);
        scene.add(dynamic(&cube(), at(x, y, 0.85)));
        scene.add(dynamic(&marble, at(x, y + 0.12, 0.8)));
    }
    // Beside the rim, and on it.
    scene.add(dynamic(&cube(), at(0.55, 0.0, 0.85)));
    scene.add(dynamic(&cube(), at(0.8, 0.0, 0.85)));
    let report = settle("", &mut scene);
    assert_eq!(report.removed.iter().map(|removal| removal.spawn).collect::<Vec<_>>(), [13], "{report:?}");
    let floor = 0.72;
    for body in objects(&scene).filter(|body| body.spawn < 12) {
        let (low, _) = z_range(body);
        assert!((low - floor).abs() < 0.001, "{} {} mm above the board", body.object.name, (low - floor) * 1e3);
    }
    assert!(report.deepest_penetration_m < 0.001, "{report:?}");
}

#[test]
fn a_marble_lies_on_the_bottom_of_a_dish() {
    // The bowl of the kit is a support here; the top of its bounding box is its rim.
    let bowl = kit_objects().swap_remove(1);
    let mut scene = SceneBuilder::default();
    let size = bowl.mesh.bounds().size();
    scene.add(draft(&bowl, at(0.0, 0.0, 0.0), Role::Support, Motion::Fixed));
    scene.supports = Support::new("table", Region::rectangle([0.0, 0.0, size.z], [size.x, size.y])).into();
    let marble = object("marble", sphere(0.01), 0.01);
    for x in [-0.03, 0.0, 0.03] {
        scene.add(dynamic(&marble, at(x, 0.01, 0.09)));
    }
    let report = settle("", &mut scene);
    assert_eq!(objects(&scene).count(), 3, "{report:?}");
    let dish = scene.bodies().map(|(_, body)| body).find(|body| body.role == Role::Support).expect("a dish");
    for marble in objects(&scene) {
        let gap = gap(marble, 0.01, dish);
        assert!((-0.0005..0.001).contains(&gap), "{} mm above the dish", gap * 1e3);
    }
}

#[test]
fn a_thin_tray_is_not_pressed_through() {
    // The bottom is one millimeter thick, and air is below it.
    let mut scene = SceneBuilder::default();
    let thin = object("tray", tray([0.5, 0.4, 0.02], 0.001), 1.0);
    scene.add(draft(&thin, at(0.0, 0.0, 0.5), Role::Support, Motion::Fixed));
    scene.supports = Support::new("table", Region::rectangle([0.0, 0.0, 0.52], [0.5, 0.4])).into();
    let weight = object("weight", cuboid([0.0; 3], [0.08; 3]), 20.0);
    let card = object("card", cuboid([0.0; 3], [0.09, 0.06, 0.001]), 0.005);
    for i in 0..3 {
        let x = 0.14 * f64::from(i) - 0.14;
        scene.add(dynamic(&card, at(x, 0.0, 0.53)));
        scene.add(dynamic(&weight, at(x, 0.0, 0.7)));
    }
    let report = settle("on_violation = \"keep\"", &mut scene);
    assert_eq!(objects(&scene).count(), 6, "{report:?}");
    for body in objects(&scene) {
        let (low, _) = z_range(body);
        assert!((0.5003..0.5027).contains(&low), "{} at {low}", body.object.name);
    }
}

/// Height above the bottom at which a marble comes to rest in a hollow object on a table, meters.
fn above_the_bottom(hollow: &Arc<Object>, radius: f32) -> f64 {
    let mut scene = table_scene();
    let bounds = hollow.mesh.bounds();
    let center = bounds.center();
    let pose = at(-center.x, -center.y, TABLE_HEIGHT - bounds.min.z);
    scene.add(draft(hollow, pose, Role::Object, Motion::Dynamic));
    scene.add(dynamic(&object("marble", sphere(radius), 0.005), at(0.0, 0.0, TABLE_HEIGHT + bounds.size().z + 0.02)));
    let report = settle("on_violation = \"keep\"\nremove = \"keep\"\nmax_deviation_m = 0.003", &mut scene);
    let bodies: Vec<&BodyDraft> = objects(&scene).collect();
    println!("{}: {report:?}", hollow.name);
    gap(bodies[1], f64::from(radius), bodies[0])
}

#[test]
fn marbles_fall_into_mugs_and_bowls() {
    let kit = kit_objects();
    let real = assets().into_iter().take(1).flat_map(|root| real_objects(&root));
    let hollow = |name: &str| {
        let [lower] = [name.to_lowercase()];
        lower.contains("mug") || lower.contains("bowl") || lower.contains("plate")
    };
    let all = kit.into_iter().chain(real).filter(|object| hollow(&object.name));
    let mut seen = 0;
    for object in all {
        let gap = above_the_bottom(&object, 0.008);
        println!("{}: {} mm", object.name, gap * 1e3);
        assert!((-0.002..0.0035).contains(&gap), "{}: the marble is {} mm above it", object.name, gap * 1e3);
        seen += 1;
    }
    assert!(seen >= 3, "{seen}");
}

#[test]
fn real_tables_carry() {
    let mut files: Vec<_> = assets()
        .iter()
        .flat_map(|root| std::fs::read_dir(root.join("tables")).into_iter().flatten().flatten())
        .flat_map(|folder| std::fs::read_dir(folder.path()).into_iter().flatten().flatten())
        .map(|file| file.path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "obj"))
        .collect();
    files.sort();
    assert!(files.len() >= 2, "{files:?}");
    for path in files {
        let table = object("table", read_obj(&path), 20.0);
        let bounds = table.mesh.bounds();
        let (size, center) = (bounds.size(), bounds.center());
        let mut scene = SceneBuilder::default();
        let pose = at(-center.x, -center.y, -bounds.min.z);
        scene.add(draft(&table, pose, Role::Support, Motion::Fixed));
        scene.supports = Support::new("table", Region::rectangle([0.0, 0.0, size.z], [size.x, size.y])).into();
        let places = [(0.0, 0.0), (0.3, 0.3), (-0.3, 0.3), (0.3, -0.3), (-0.3, -0.3), (0.0, 0.35)];
        for (object, (x, y)) in kit_objects().iter().zip(places) {
            scene.add(dynamic(object, at(x * size.x, y * size.y, size.z + 0.1)));
        }
        let report = settle("", &mut scene);
        println!("{}: {:.3} m high, {report:?}", path.display(), size.z);
        assert_eq!(objects(&scene).count(), 6, "{}: {report:?}", path.display());
        for body in objects(&scene) {
            let (low, _) = z_range(body);
            assert!((low - size.z).abs() < 0.004, "{}: {} at {}", path.display(), body.object.name, low - size.z);
        }
    }
}

#[test]
fn rooms_of_any_shape_contain_their_objects() {
    let ball = object("ball", sphere(0.04), 0.1);
    let rolling = |scene: &mut SceneBuilder| {
        // Ramps send two balls against the walls, one to either side.
        for (sign, y) in [(1.0, 0.0), (-1.0, 0.5)] {
            let tilt = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), sign * 0.5);
            let ramp = object("ramp", cuboid([0.0; 3], [0.8, 0.2, 0.02]), 1.0);
            let pose = Pose::from_parts(Translation3::new(0.0, y, 0.25), tilt);
            scene.add(draft(&ramp, pose, Role::Support, Motion::Fixed));
            let start = pose.translation.vector + tilt * Vector3::new(-0.3 * sign, 0.0, 0.06);
            scene.add(dynamic(&ball, at(start.x, start.y, start.z)));
        }
    };
    let options = "remove = \"keep\"\non_violation = \"keep\"\nduration_s = 3.0\nangular_damping_per_s = 0.0";
    let ends =
        |scene: &SceneBuilder| -> Vec<f64> { objects(scene).map(|body| body.world_from_body.translation.x).collect() };

    let mut open = SceneBuilder::default();
    rolling(&mut open);
    settle(options, &mut open);
    assert!(ends(&open).iter().all(|x| x.abs() > 0.9), "without walls they roll away: {:?}", ends(&open));

    // One mesh for floor, walls and ceiling, its faces towards the inside.
    let shell = cuboid([0.0, 0.0, 0.5], [1.6, 3.0, 1.0]);
    let inward = MeshData { triangles: shell.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(), ..shell };
    let mut closed = SceneBuilder::default();
    closed.add(draft(&object("shell", inward, 1.0), at(0.0, 0.0, 0.0), Role::Room, Motion::Fixed));
    rolling(&mut closed);
    settle(options, &mut closed);
    assert!(ends(&closed).iter().all(|x| x.abs() < 0.8), "{:?}", ends(&closed));

    // A screen with objects on both sides is a wall for both, and traps no object.
    let mut parted = SceneBuilder::default();
    let screen = object("screen", cuboid([0.0; 3], [0.0, 3.0, 0.3]), 1.0);
    parted.add(draft(&screen, at(0.7, 0.0, 0.15), Role::Room, Motion::Fixed));
    parted.add(dynamic(&ball, at(1.2, 1.0, 0.05)));
    rolling(&mut parted);
    settle(options, &mut parted);
    let [behind, right, left] = ends(&parted)[..] else { panic!("three balls") };
    assert!(behind > 0.74 && right < 0.66 && left < -0.9, "{behind} {right} {left}");
}

/// A tray of 0.4 m by 0.3 m by 0.2 m on the floor whose inside is filled to a level by cubes of 50 mm.
fn filled(level: f64, count: usize) -> (SceneBuilder, SettleReport) {
    let mut scene = SceneBuilder::default();
    let tray = object("tray", tray([0.42, 0.32, 0.21], 0.01), 1.0);
    scene.add(draft(&tray, at(0.0, 0.0, 0.0), Role::Support, Motion::Fixed));
    let surface = Region::rectangle([0.0, 0.0, 0.01], [0.4, 0.3]);
    let support = Support::new("tray", surface).with_walls(Walls { height_m: 0.2, draft_m: 0.0 });
    scene.supports.add(support.clone()).expect("new");
    let cube = object("small cube", cuboid([0.0; 3], [0.05; 3]), 0.1);
    let mut stream = syntable_model::random::Stream::root(6);
    for _ in 0..count {
        let place = Translation3::new(stream.uniform(-0.15, 0.15), stream.uniform(-0.1, 0.1), 0.4);
        let zone = DropZone { full_at_m: Some(level), ..DropZone::on(support.clone()) };
        scene.drop_body(dynamic(&cube, Pose::from_parts(place, stream.rotation())), zone);
    }
    let report = settle("respawn_fallen = true", &mut scene);
    (scene, report)
}

#[test]
fn a_tray_is_filled_to_a_level() {
    for (level, count) in [(0.03, 60), (0.06, 80)] {
        let (scene, report) = filled(level, count);
        let stay = objects(&scene).count();
        assert_eq!(stay + report.spare as usize + report.removed.len(), count);
        assert!(report.spare > 0 && report.removed.is_empty(), "{report:?}");
        // The mean height of the pile is at least its volume over the area. Random cubes fill more than half of the space below.
        let solid = stay as f64 * 0.05_f64.powi(3) / (0.4 * 0.3);
        assert!((0.5 * level..1.15 * level).contains(&solid), "{solid} m of solid at {level} m");
    }
    // Too few objects to fill it: all are poured.
    let (scene, report) = filled(0.15, 8);
    assert_eq!((objects(&scene).count(), report.spare), (8, 0));
}

#[test]
fn a_body_respawns_below_the_next_board() {
    // Two boards. A crowd on the upper one must not lift what starts again on the lower one.
    let mut scene = SceneBuilder::default();
    let boards = join([0.4, 0.8].map(|z| cuboid([0.0, 0.0, z - 0.01], [0.8, 0.4, 0.02])));
    scene.add(draft(&object("boards", boards, 5.0), at(0.0, 0.0, 0.0), Role::Support, Motion::Fixed));
    for (name, height) in [("shelf/1", 0.4), ("shelf/2", 0.8)] {
        let support = Support::new(name, Region::rectangle([0.0, 0.0, height], [0.8, 0.4]));
        let support = if height < 0.5 { support.with_clear_height(0.38) } else { support };
        scene.supports.add(support).expect("new");
    }
    let cube = object("small cube", cuboid([0.0; 3], [0.05; 3]), 0.1);
    let [lower, upper] = [0, 1].map(|i| scene.supports.iter().nth(i).expect("a board").clone());
    for i in 0..12 {
        let pose = at(-0.3 + 0.12 * f64::from(i % 6), -0.08 + 0.16 * f64::from(i / 6), 0.83);
        scene.drop_body(dynamic(&cube, pose), DropZone::on(upper.clone()));
    }
    // It starts beyond the edge, and falls.
    scene.drop_body(dynamic(&cube, at(0.5, 0.0, 0.5)), DropZone::on(lower));
    let report = settle("respawn_fallen = true", &mut scene);
    assert!(report.removed.is_empty() && report.respawned >= 1, "{report:?}");
    let on_lower = objects(&scene).filter(|body| (0.4..0.5).contains(&body.world_from_body.translation.z)).count();
    assert_eq!(on_lower, 1);
}
