//! Cameras, views and lights against the paper's numbers, closed forms and brute force.

mod lens;
mod lights;

use nalgebra::{Point3, UnitQuaternion, Vector3};
use std::sync::Arc;
use syntable_model::context::{Collected, NoCache, Serial};
use syntable_model::digest::Digest;
use syntable_model::photometry::luminance;
use syntable_model::prelude::*;
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_model::scene::{
    AssetRef, BodyDraft, Camera, EnvironmentMap, Exposure, Intrinsics, Light, MassOrigin, MassProperties, Material,
    Mesh, MeshData, Motion, Object, Optics, Region, Role, SettleReport, SourceModel, Support, Supports, ViewId,
};
use syntable_sampling as _;
use syntable_testing::assets::NoAssets;

fn stage(slot: Slot, kind: &str, options: &str) -> Stage {
    let registry = Registry::linked().expect("no clash");
    let entry = registry.find(slot, kind).expect(kind);
    entry.construct_str(options).unwrap_or_else(|error| panic!("{options}: {error:?}")).stage
}

fn refused(slot: Slot, kind: &str, options: &str) -> String {
    let registry = Registry::linked().expect("no clash");
    let error = registry.find(slot, kind).expect(kind).construct_str(options).map(|_| ()).expect_err(options);
    format!("{error:?}")
}

fn views(kind: &str, options: &str) -> Box<dyn ViewSampler> {
    match stage(Slot::Views, kind, options) {
        Stage::Views(views) => views,
        _ => panic!("{kind}"),
    }
}

fn lights(kind: &str, options: &str) -> Box<dyn LightSampler> {
    match stage(Slot::Lights, kind, options) {
        Stage::Lights(lights) => lights,
        _ => panic!("{kind}"),
    }
}

fn with_context<T>(seed: u64, work: impl FnOnce(&Context) -> T) -> T {
    let log = Collected::default();
    let stream = Stream::root(seed);
    work(&Context { stream, assets: &NoAssets, cache: &NoCache, workers: &Serial, log: &log })
}

/// A level triangle of some extent.
fn sheet(half: f32) -> Arc<Object> {
    let mesh = Mesh::new(MeshData {
        positions: vec![[-half, -half, 0.0], [3.0 * half, -half, 0.0], [-half, 3.0 * half, 0.0]],
        triangles: vec![[0, 1, 2]],
        ..MeshData::default()
    })
    .expect("sound");
    Arc::new(Object {
        name: "sheet".into(),
        category: "sheet".into(),
        mass: MassProperties::of_mesh(&mesh, 1.0, MassOrigin::Known),
        mesh: Arc::new(mesh),
        materials: vec![Arc::new(Material::plain("gray", [0.5; 3], 0.5))],
        collision: None,
        keypoints: Vec::new(),
        support_areas: Vec::new(),
        restitution: None,
        model: SourceModel::default(),
        friction: 0.5,
        license: String::new(),
        digest: Digest::of(b"sheet"),
    })
}

/// A tabletop of 1.4 m × 0.8 m at 0.75 m, one object, and a ceiling if one is wanted.
fn scene(ceiling: Option<f64>) -> Scene {
    let mut scene = SceneBuilder::default();
    scene.supports = Support::new("table", Region::rectangle([0.0, 0.0, 0.75], [1.4, 0.8])).into();
    let mut add = |z: f64, half: f32, role: Role| {
        let asset = AssetRef { pool: "test".into(), name: "sheet".into() };
        scene.add(BodyDraft::new(asset, sheet(half), Pose::translation(0.0, 0.0, z), role, Motion::Fixed));
    };
    add(0.8, 0.05, Role::Object);
    add(0.0, 5.0, Role::Room);
    if let Some(z) = ceiling {
        add(z, 5.0, Role::Room);
    }
    scene.freeze(SettleReport::default()).expect("frozen")
}

fn optics(options: &str) -> Optics {
    match stage(Slot::Camera, "pinhole", options) {
        Stage::Camera(camera) => {
            with_context(1, |context| camera.optics(&scene(None), &Pose::identity(), context)).expect("a camera")
        }
        _ => panic!("no camera"),
    }
}

fn intrinsics(options: &str) -> (Intrinsics, Exposure) {
    let Optics { intrinsics, exposure, .. } = optics(options);
    (intrinsics, exposure)
}

#[test]
fn intrinsics_are_the_released_ones() {
    let exact = "intrinsics = { physical = { focal_length_mm = 1.88, sensor_size_mm = [2.6327803436685087, 1.9573321100745658] } }";
    let (k, exposure) = intrinsics(exact);
    assert!((k.fx - 457.01).abs() < 0.005 && (k.fy - 461.04).abs() < 0.005, "{k:?}");
    assert_eq!((k.width, k.height, k.cx, k.cy), (640, 480, 320.0, 240.0));
    assert_eq!(exposure, Exposure::Auto { compensation_ev: 0.0 });
    // 70° × 55°, as the data sheet says.
    let degrees = |edge: u32, f: f64| (2.0 * (f64::from(edge) / 2.0 / f).atan()).to_degrees();
    assert!((degrees(640, k.fx) - 70.0).abs() < 0.1 && (degrees(480, k.fy) - 55.0).abs() < 0.1);
    // The default is the same camera with the paper's rounded apertures.
    let (default, _) = intrinsics("");
    assert!((default.fx - 640.0 * 1.88 / 2.63).abs() < 1e-9 && (default.fy - 480.0 * 1.88 / 1.96).abs() < 1e-9);
}

#[test]
fn intrinsics_come_from_pixels_or_a_field_of_view() {
    let (k, exposure) = intrinsics(
        "resolution = [800, 600]\nintrinsics = { pixels = { fx = 700, fy = 710, cx = 390.5, cy = 310.25 } }\nexposure = { ev100 = 9 }",
    );
    assert_eq!((k.fx, k.fy, k.cx, k.cy, k.width, k.height), (700.0, 710.0, 390.5, 310.25, 800, 600));
    assert_eq!(exposure, Exposure::Fixed { ev100: 9.0 });
    let (k, exposure) = intrinsics("intrinsics = { fov_deg = 90 }\nexposure = { auto = { compensation_ev = 0.5 } }");
    assert!((k.fx - 320.0).abs() < 1e-9 && k.fx == k.fy, "{k:?}");
    assert_eq!(exposure, Exposure::Auto { compensation_ev: 0.5 });
    for (options, want) in [
        ("intrinsics = { physical = { focal_length_mm = 2 } }", "sensor_size_mm"),
        ("intrinsics = { physical = { sensor_size_mm = [2, 2] } }", "focal_length_mm"),
        ("intrinsics = { fov_deg = 60, pixels = { fx = 1, fy = 1, cx = 0, cy = 0 } }", "intrinsics"),
        ("intrinsics = 60", "intrinsics"),
        ("intrinsics = { fov = 60 }", "fov_deg"),
        ("intrinsics = { pixels = { fx = 1, fy = 1, cx = 0 } }", "cy"),
        ("fov_deg = 60", "fov_deg"),
        ("exposure = \"bright\"", "auto"),
        ("exposure = { ev = 1 }", "ev100"),
    ] {
        let error = refused(Slot::Camera, "pinhole", options);
        assert!(error.contains(want), "{options}: {error}");
    }
}

/// Largest distance between the empirical distribution of some numbers in [0, 1] and the uniform one.
fn kolmogorov_smirnov(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len() as f64;
    (0..values.len())
        .map(|i| (values[i] - i as f64 / n).abs().max((values[i] - (i + 1) as f64 / n).abs()))
        .fold(0.0, f64::max)
}

/// The 1e-4 quantile of Kolmogorov's statistic for `n` values.
fn bound(n: usize) -> f64 {
    2.23 / (n as f64).sqrt()
}

#[test]
fn paper_views_are_uniform_in_the_shell_and_look_at_the_tabletop() {
    let scene = scene(None);
    let sampler = views("hemisphere_shell", "");
    let shell = sampler.shell(&scene).expect("a support");
    assert_eq!((shell.center, shell.radius), (Point3::new(0.0, 0.0, 0.95), [0.7, 0.7 * 1.7]));
    assert_eq!(sampler.count(), None);
    let (k, _) = intrinsics("");
    let n = 4000;
    let [mut radius, mut polar, mut azimuth] = [Vec::new(), Vec::new(), Vec::new()];
    for seed in 0..n {
        let pose = with_context(seed, |context| sampler.pose(&scene, ViewId(0), context)).expect("a pose");
        let from_center = pose.translation.vector - shell.center.coords;
        let r = from_center.norm();
        radius.push((r - 0.7) / (0.7 * 0.7));
        polar.push(from_center.z / r);
        azimuth.push((from_center.y.atan2(from_center.x) / std::f64::consts::TAU).rem_euclid(1.0));
        // The center of the tabletop is seen at the principal point, and up is up.
        let p = pose.inverse_transform_point(&scene.support(None).expect("there").center());
        let [u, v] = k.project(&p);
        assert!(p.z > 0.0 && (u - 320.0).abs() < 1e-6 && (v - 240.0).abs() < 1e-6, "{u} {v}");
        assert!((pose * Vector3::y()).z < 1e-9 && (pose * Vector3::x()).z.abs() < 1e-9);
    }
    for (name, values) in [("radius", radius), ("cos polar", polar), ("azimuth", azimuth)] {
        let d = kolmogorov_smirnov(values);
        assert!(d < bound(n as usize), "{name}: {d}");
    }
}

#[test]
fn views_of_a_shelf_take_its_boards_in_turn_from_the_front() {
    let mut scene = scene(None);
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 30.0_f64.to_radians());
    for (name, height) in [("shelf/1", 0.4), ("shelf/2", 0.8)] {
        let region = Region::rectangle([0.0, 0.0, height], [0.8, 0.3])
            .moved(&Pose::from_parts(Vector3::new(1.0, 2.0, 0.0).into(), turn));
        scene.supports.add(Support::new(name, region)).expect("new");
    }
    let sampler = views(
        "hemisphere_shell",
        "support = \"shelf\"\nradius = { meters = [0.9, 1.2] }\nelevation_deg = [0, 30]\nazimuth_deg = [-120, -60]",
    );
    for seed in 0..400 {
        let view = ViewId(seed as u32 % 4);
        let pose = with_context(seed, |context| sampler.pose(&scene, view, context)).expect("a pose");
        let board = Point3::new(1.0, 2.0, if view.0.is_multiple_of(2) { 0.4 } else { 0.8 });
        assert_eq!(sampler.target(&scene, view), Some(board));
        // Against the shelf's own front, which is turned by 30 degrees.
        let from_shelf = turn.inverse() * (pose.translation.vector - board.coords);
        let azimuth = from_shelf.y.atan2(from_shelf.x).to_degrees();
        assert!((-120.0 - 1e-9..=-60.0 + 1e-9).contains(&azimuth), "{azimuth}");
    }
    // The shell of the lights is around the cameras of all boards.
    let shell = sampler.shell(&scene).expect("a shell");
    let cameras = (0..400).map(|seed| {
        let pose = with_context(seed, |context| sampler.pose(&scene, ViewId(seed as u32), context)).expect("a pose");
        (pose.translation.vector - shell.center.coords).norm()
    });
    let [low, high] = cameras.fold([f64::INFINITY, 0.0], |[low, high], r| [low.min(r), high.max(r)]);
    assert!(shell.radius[0] <= low && high <= shell.radius[1], "{:?}, not {low} to {high}", shell.radius);
    assert!(refused(Slot::Views, "hemisphere_shell", "azimuth_deg = [10, -10]").contains("azimuth_deg"));
}

#[test]
fn views_follow_their_options() {
    let scene = scene(None);
    let options = "radius = { meters = [0.7, 1.4] }\nelevation_deg = [30, 60]\ncenter_offset_m = 0.1\nlook_at = \"shell_center\"\nroll_deg = 90";
    let sampler = views("hemisphere_shell", options);
    let center = Point3::new(0.0, 0.0, 0.85);
    assert_eq!(
        (sampler.shell(&scene).expect("a support").center, sampler.shell(&scene).expect("a support").radius),
        (center, [0.7, 1.4])
    );
    let mut sines = Vec::new();
    for seed in 0..2000 {
        let pose = with_context(seed, |context| sampler.pose(&scene, ViewId(0), context)).expect("a pose");
        let from_center = pose.translation.vector - center.coords;
        sines.push((from_center.z / from_center.norm() - 0.5) / (0.75_f64.sqrt() - 0.5));
        assert!((0.7..=1.4).contains(&from_center.norm()));
        assert!((pose * Vector3::z() + from_center.normalize()).norm() < 1e-9, "looks at the center of the shell");
        // Rolled by a quarter turn: the camera's right is now up, so its x axis points down in the world.
        assert!((pose * Vector3::x()).z < 0.0 && (pose * Vector3::y()).z.abs() < 1e-9);
    }
    let d = kolmogorov_smirnov(sines);
    assert!(d < bound(2000), "{d}");
    // The one object of the scene is a triangle in a box of 0.2 m from (-0.05, -0.05), at 0.8 m.
    let objects = views("hemisphere_shell", "look_at = \"objects_center\"");
    let pose = with_context(1, |context| objects.pose(&scene, ViewId(0), context)).expect("a pose");
    let seen = pose.inverse_transform_point(&Point3::new(0.05, 0.05, 0.8));
    assert!(seen.z > 0.0 && seen.x.abs() < 1e-6 && seen.y.abs() < 1e-6, "{seen}");
    let released = views("hemisphere_shell", "radius = { of_table = [0.8, 1.36] }");
    let [low, high] = released.shell(&scene).expect("a support").radius;
    assert!((low - 0.8 * 0.7).abs() < 1e-12 && (high - 1.7 * 0.8 * 0.7).abs() < 1e-12);
    for (options, want) in [
        ("radius = { of_table = [1.7, 1.0] }", "smaller bound first"),
        ("radius = { miles = [1, 2] }", "meters"),
        ("radius = { meters = [1, 1e30] }", "radius.meters[1]"),
        ("radius = { of_table = [1, 1001] }", "radius.of_table[1]"),
        ("elevation_deg = [60, 30]", "smaller bound first"),
        ("look_at = \"table\"", "tabletop_center"),
    ] {
        let error = refused(Slot::Views, "hemisphere_shell", options);
        assert!(error.contains(want), "{options}: {error}");
    }
}

#[test]
fn a_target_is_on_the_optical_axis() {
    let scene = scene(None);
    let listed = "poses = [{ look_at = { eye_m = [1, 0, 0.5], target_m = [0.1, 0.2, 0.3] } }, \
                  { world_from_camera = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] }]";
    for (kind, options) in [
        ("hemisphere_shell", "look_at = \"objects_center\"\nroll_deg = 30"),
        ("hemisphere_shell", "look_at = \"shell_center\""),
        ("orbit", "center_offset_m = 0.4"),
        ("fixed_poses", listed),
    ] {
        let sampler = views(kind, options);
        let target = sampler.target(&scene, ViewId(0)).expect("a target");
        let pose = with_context(3, |context| sampler.pose(&scene, ViewId(0), context)).expect("a pose");
        let seen = pose.inverse() * target;
        assert!(seen.x.abs() < 1e-9 && seen.y.abs() < 1e-9 && seen.z > 0.1, "{kind}: {seen}");
    }
    assert_eq!(views("fixed_poses", listed).target(&scene, ViewId(1)), None);
}

#[test]
fn an_orbit_goes_round() {
    let scene = scene(None);
    let sampler = views("orbit", "distance = { meters = 2 }\nelevation_deg = 30\nstart_deg = 90\nstep_deg = 90");
    for (view, want) in [(0, [0.0, 1.0]), (1, [-1.0, 0.0]), (2, [0.0, -1.0]), (3, [1.0, 0.0])] {
        let pose = with_context(0, |context| sampler.pose(&scene, ViewId(view), context)).expect("a pose");
        let flat = 2.0 * 30_f64.to_radians().cos();
        let want = Vector3::new(flat * want[0], flat * want[1], 0.95 + 1.0);
        assert!((pose.translation.vector - want).norm() < 1e-9, "{view}: {pose}");
        let to_table = (scene.support(None).expect("there").center().coords - want).normalize();
        assert!((pose * Vector3::z() - to_table).norm() < 1e-9);
    }
    assert_eq!(sampler.shell(&scene).expect("a support").radius, [2.0, 2.0]);
}

#[test]
fn listed_poses_are_used_unchanged() {
    let scene = scene(None);
    let options = "poses = [
        { look_at = { eye_m = [1.0, 0.0, 0.5] } },
        { look_at = { eye_m = [0.0, 0.0, 1.2], up = [0.0, 1.0, 0.0], roll_deg = 180 } },
        { world_from_camera = [[0, 0, -1, 2], [1, 0, 0, 3], [0, -1, 0, 4], [0, 0, 0, 1]] },
    ]";
    let sampler = views("fixed_poses", options);
    assert_eq!(sampler.count(), Some(3));
    let pose = |sampler: &dyn ViewSampler, view: u32| {
        with_context(u64::from(view), |context| sampler.pose(&scene, ViewId(view), context))
    };
    let first = pose(&*sampler, 0).expect("a pose");
    assert!((first.translation.vector - Vector3::new(1.0, 0.0, 1.25)).norm() < 1e-12, "relative to the tabletop");
    assert!((first * Vector3::z() - Vector3::new(-1.0, 0.0, -0.5).normalize()).norm() < 1e-9);
    let second = pose(&*sampler, 1).expect("a pose");
    // Rolled by half a turn: world +y, which was up, points down in the image.
    assert!((second * Vector3::y() - Vector3::y()).norm() < 1e-9, "{second}");
    let third = pose(&*sampler, 2).expect("a pose");
    assert!((third * Vector3::z() + Vector3::x()).norm() < 1e-9 && (third * Vector3::x() - Vector3::y()).norm() < 1e-9);
    assert!((third.translation.vector - Vector3::new(2.0, 3.0, 4.75)).norm() < 1e-12);
    let shell = sampler.shell(&scene).expect("a support");
    assert!(
        (shell.radius[0] - 1.25_f64.sqrt()).abs() < 1e-9 && (shell.radius[1] - 29_f64.sqrt()).abs() < 1e-9,
        "{shell:?}"
    );
    let error = pose(&*sampler, 3).expect_err("no fourth").to_string();
    assert!(error.contains("view 3 has no pose; 3 are listed"), "{error}");
    let world = views(
        "fixed_poses",
        "relative_to = \"world\"\nposes = [{ look_at = { eye_m = [1, 0, 2], target_m = [0, 0, 0.7] } }]",
    );
    assert!((pose(&*world, 0).expect("a pose").translation.vector.z - 2.0).abs() < 1e-12);
    // Poses in the world need no support, and their shell is around the points that they look at.
    let mut open = scene.clone();
    open.supports = Supports::default();
    assert!((world.needs(), sampler.needs()) == (None, Some(Part::MainSupport)));
    let shell = world.shell(&open).expect("a target");
    assert!(
        (shell.center - Point3::new(0.0, 0.0, 0.7)).norm() < 1e-12 && (shell.radius[1] - 2.69_f64.sqrt()).abs() < 1e-9
    );
    assert!(sampler.shell(&open).is_err());
    for (options, want) in [
        ("", "poses"),
        ("poses = [{ look_at = { target_m = [0, 0, 0] } }]", "eye_m"),
        ("poses = [{ eye_m = [1, 0, 0] }]", "look_at"),
        ("poses = [{ look_at = { eye_m = [1, 0, 0] } }, { look_at = { eye_m = [0, 0, 1] } }]", "poses[1].look_at"),
        ("poses = [{ look_at = { eye_m = [0, 0, 1] } }]", "parallel"),
        ("poses = [{ look_at = { eye_m = [0, 0, 0] } }]", "same point"),
        ("poses = [{ look_at = { eye_m = [0, 0, 1e30] } }]", "eye_m[2]"),
        (
            "poses = [{ world_from_camera = [[1, 0, 0, -1e30], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] }]",
            "world_from_camera[0][3]",
        ),
        (
            "poses = [{ world_from_camera = [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] }]",
            "not a rigid transform",
        ),
        (
            "poses = [{ world_from_camera = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]] }]",
            "not a rigid transform",
        ),
        (
            "poses = [{ world_from_camera = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 2]] }]",
            "poses[0].world_from_camera[3]",
        ),
    ] {
        let error = refused(Slot::Views, "fixed_poses", options);
        assert!(error.contains(want), "{options}: {error}");
    }
}

fn draw(sampler: &dyn LightSampler, scene: &Scene, seed: u64) -> Result<Vec<Light>> {
    let (intrinsics, _) = intrinsics("");
    let camera = Camera::pinhole(intrinsics, Pose::identity());
    let shell = views("hemisphere_shell", "").shell(scene).expect("a support");
    with_context(seed, |context| sampler.lights(scene, &camera, &shell, context))
}

/// Illuminance of a light at a point on a plane with a normal, by brute force: the light's luminance seen in each of
/// many directions of the hemisphere, weighted by the cosine.
fn illuminance(light: &Light, point: Point3<f64>, normal: Vector3<f64>) -> f64 {
    let u = normal.cross(&Vector3::new(0.3, 0.5, 0.8)).normalize();
    let v = normal.cross(&u);
    let n = 1200;
    // Uniform in the disk is uniform in cos θ dω: every direction has the weight π / N.
    let mut sum = 0.0;
    for i in 0..n {
        for j in 0..n {
            let (a, b) = ((f64::from(2 * i + 1) / f64::from(n)) - 1.0, (f64::from(2 * j + 1) / f64::from(n)) - 1.0);
            if a * a + b * b >= 1.0 {
                continue;
            }
            let ray = u * a + v * b + normal * (1.0 - a * a - b * b).sqrt();
            sum += luminance(seen(light, point, ray));
        }
    }
    sum * 4.0 / f64::from(n * n)
}

fn seen(light: &Light, origin: Point3<f64>, ray: Vector3<f64>) -> [f64; 3] {
    let hit = match light {
        Light::Sphere(sphere) => {
            let to_center = sphere.center - origin;
            let along = to_center.dot(&ray);
            along > 0.0 && to_center.norm_squared() - along * along < sphere.radius * sphere.radius
        }
        Light::Rect(rect) => {
            let normal = rect.half_u.cross(&rect.half_v).normalize();
            let t = (rect.center - origin).dot(&normal) / ray.dot(&normal);
            let at = origin + ray * t - rect.center;
            let inside = |half: Vector3<f64>| at.dot(&half).abs() <= half.norm_squared();
            t > 0.0 && ray.dot(&normal) < 0.0 && inside(rect.half_u) && inside(rect.half_v)
        }
        Light::Disk(disk) => {
            let t = (disk.center - origin).dot(&disk.normal) / ray.dot(&disk.normal);
            t > 0.0 && ray.dot(&disk.normal) < 0.0 && (origin + ray * t - disk.center).norm() < disk.radius
        }
        Light::Directional(sun) => ray.dot(&sun.towards) > sun.half_angle.cos(),
        Light::Environment(_) => true,
        Light::Window(window) => {
            let normal = window.half_u.cross(&window.half_v).normalize();
            let t = (window.center - origin).dot(&normal) / ray.dot(&normal);
            let at = origin + ray * t;
            let inside = |half: Vector3<f64>| (at - window.center).dot(&half).abs() <= half.norm_squared();
            if t > 0.0 && ray.dot(&normal) < 0.0 && inside(window.half_u) && inside(window.half_v) {
                return window.radiance(&at, &ray);
            }
            false
        }
    };
    match light {
        Light::Sphere(sphere) if hit => sphere.radiance,
        Light::Rect(rect) if hit => rect.radiance,
        Light::Disk(disk) if hit => disk.radiance,
        Light::Directional(sun) if hit => sun.radiance(),
        Light::Environment(sky) => {
            let rotated = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), -sky.rotation) * ray;
            let [u, v] = EnvironmentMap::coordinates(&rotated);
            let (width, height) = (sky.map.width() as usize, sky.map.height() as usize);
            let (x, y) = ((u * width as f64) as usize % width, ((v * height as f64) as usize).min(height - 1));
            let texel = sky.map.texels()[y * width + x];
            std::array::from_fn(|k| sky.scale[k] * f64::from(texel[k]))
        }
        _ => [0.0; 3],
    }
}

#[test]
fn sphere_lights_give_the_requested_illuminance() {
    let scene = scene(None);
    let sampler =
        lights("sphere_lights", "count = 1\nbrightness = { illuminance_lx = 800 }\nsize_m = { uniform = [0.2, 0.6] }");
    for seed in 0..4 {
        let lights = draw(&*sampler, &scene, seed).expect("lights");
        let [light @ Light::Sphere(sphere)] = &lights[..] else { panic!("{lights:?}") };
        let tabletop = scene.support(None).expect("there").center();
        let got = illuminance(light, tabletop, (sphere.center - tabletop).normalize());
        assert!((got / 800.0 - 1.0).abs() < 0.005, "{got} lx from {sphere:?}");
    }
}

#[test]
fn ceiling_lights_give_the_requested_illuminance() {
    for (options, ceiling, count, height) in [
        ("brightness = { illuminance_lx = 500 }", Some(15.0), 1, 14.99),
        ("brightness = { illuminance_lx = 500 }\nsize_m = [1.5, 0.4]\nheight_m = 2.4", Some(3.0), 1, 2.4),
        (
            "brightness = { illuminance_lx = 500 }\ncount = 4\nsize_m = [0.6, 0.6]\nspacing_m = 1.2\nheight_m = 9",
            Some(2.6),
            4,
            2.59,
        ),
        ("brightness = { illuminance_lx = 500 }\nshift_m = 1.5", None, 1, 3.75),
    ] {
        let scene = scene(ceiling);
        let lights = draw(&*lights("ceiling_light", options), &scene, 3).expect("lights");
        assert_eq!(lights.len(), count, "{options}");
        let middle = lights.iter().fold(Vector3::zeros(), |sum, light| match light {
            Light::Rect(rect) => sum + rect.center.coords / lights.len() as f64,
            other => panic!("{other:?}"),
        });
        let facing = (middle - scene.support(None).expect("there").center().coords).normalize();
        let mut sum = 0.0;
        for light in &lights {
            let Light::Rect(rect) = light else { panic!("{light:?}") };
            assert!((rect.center.z - height).abs() < 1e-9 && rect.normal().z < -0.999, "{rect:?}");
            sum += illuminance(light, scene.support(None).expect("there").center(), facing);
        }
        assert!((sum / 500.0 - 1.0).abs() < 0.01, "{options}: {sum} lx");
    }
    let low =
        draw(&*lights("ceiling_light", "height_m = 0.5"), &scene(None), 1).expect_err("under the table").to_string();
    assert!(low.contains("not above the table"), "{low}");
}

#[test]
fn sphere_lights_are_where_the_paper_has_them() {
    let scene = scene(None);
    let sampler = lights("sphere_lights", "");
    let mut counts = [0; 3];
    let [mut radius, mut polar, mut warmth] = [Vec::new(), Vec::new(), Vec::new()];
    for seed in 0..3000 {
        let lights = draw(&*sampler, &scene, seed).expect("lights");
        counts[lights.len()] += 1;
        for light in lights {
            let Light::Sphere(sphere) = light else { panic!("{light:?}") };
            let from_center = sphere.center - Point3::new(0.0, 0.0, 0.95);
            radius.push(from_center.norm() - (0.7 * 1.7 + 0.1));
            polar.push(from_center.z / from_center.norm());
            warmth.push(sphere.radiance[0] / sphere.radiance[2]);
            // Never among the cameras, never through the tabletop.
            assert!(from_center.norm() - sphere.radius >= 0.7 * 1.7 && sphere.center.z - sphere.radius > 0.75);
        }
    }
    let n = radius.len();
    // χ² with 2 degrees of freedom: 18.4 is the 1e-4 tail.
    let chi2: f64 = counts.iter().map(|&n| f64::from(n - 1000_i32).powi(2) / 1000.0).sum();
    assert!(chi2 < 18.4, "{counts:?}");
    assert!(kolmogorov_smirnov(radius) < bound(n));
    assert!(kolmogorov_smirnov(polar) < bound(n));
    // 2000 K is red, 6500 K is white.
    let (low, high) = warmth.iter().fold((f64::MAX, 0.0_f64), |(low, high), w| (low.min(*w), high.max(*w)));
    assert!(low > 0.9 && low < 1.15 && high > 20.0, "{low} {high}");
}

#[test]
fn the_released_lights_can_be_configured() {
    let scene = scene(Some(15.0));
    let spheres = lights(
        "sphere_lights",
        "count = 1\nsize_m = { uniform = [0.3, 0.7] }\ntemperature_k = 6500\nbrightness = { luminance_nits = { uniform = [0, 30000] } }",
    );
    let ceiling = lights(
        "ceiling_light",
        "size_m = [15, 15]\nheight_m = 5\ntemperature_k = 6500\nbrightness = { luminance_nits = { uniform = [100, 1500] } }",
    );
    for seed in 0..50 {
        let drawn = draw(&*spheres, &scene, seed).expect("lights");
        let [Light::Sphere(sphere)] = drawn[..] else { panic!("{drawn:?}") };
        assert!((0.3..0.7).contains(&sphere.radius) && luminance(sphere.radiance) < 30000.0);
        let drawn = draw(&*ceiling, &scene, seed).expect("lights");
        let [Light::Rect(rect)] = drawn[..] else { panic!("{drawn:?}") };
        assert!((100.0..1500.0).contains(&luminance(rect.radiance)) && rect.center.z == 5.0);
    }
    let none = lights("sphere_lights", "count = 2\nbrightness = { illuminance_lx = 0 }");
    assert!(draw(&*none, &scene, 1).expect("lights").is_empty(), "a light of 0 lx is none");
    let engulfing = lights("sphere_lights", "count = 1\nsize_m = 5");
    let error = draw(&*engulfing, &scene, 1).expect_err("too large").to_string();
    assert!(error.contains("reaches the center of the table"), "{error}");
}

#[test]
fn light_options_are_checked_and_examples_build() {
    for (kind, options, want) in [
        ("sphere_lights", "count = -1", "count"),
        ("sphere_lights", "radius = { meters = [2, 1] }", "smaller bound first"),
        ("sphere_lights", "radius = { meters = [1, 1e30] }", "radius.meters[1]"),
        ("sphere_lights", "radius = { beyond_views_m = [0, 1e30] }", "radius.beyond_views_m[1]"),
        ("sphere_lights", "temperature_k = 100", "temperature_k"),
        ("sphere_lights", "size_m = 0", "size_m"),
        ("sphere_lights", "brightness = { illuminance_lx = { uniform = [-1, 5] } }", "can become -1"),
        ("ceiling_light", "brightness = { luminance_nits = -1 }", "brightness.luminance_nits"),
    ] {
        let error = refused(Slot::Lights, kind, options);
        assert!(error.contains(want), "{options}: {error}");
    }
    let registry = Registry::linked().expect("no clash");
    assert_eq!(registry.entries().len(), 13);
    for entry in registry.entries() {
        let built = entry.construct_str(entry.example).unwrap_or_else(|error| panic!("{}: {error:?}", entry.kind));
        let text = built.options.to_string();
        let again = entry.construct_str(&text).unwrap_or_else(|error| panic!("{text}: {error:?}"));
        assert_eq!(again.options, built.options, "{}", entry.kind);
    }
}

#[test]
fn values_outside_the_limits_of_the_schema_are_rejected() {
    use Slot::{Camera, Lights, Views};
    for (slot, kind, options, want) in [
        (Camera, "pinhole", "resolution = [0, 480]", "resolution"),
        (Camera, "pinhole", "intrinsics = { fov_deg = 180 }", "fov_deg"),
        (Camera, "pinhole", "intrinsics = { pixels = { fx = 0, fy = 1, cx = 0, cy = 0 } }", "fx"),
        (
            Camera,
            "pinhole",
            "intrinsics = { physical = { focal_length_mm = 0, sensor_size_mm = [2, 2] } }",
            "focal_length_mm",
        ),
        (
            Camera,
            "pinhole",
            "intrinsics = { physical = { focal_length_mm = 2, sensor_size_mm = [2, 0] } }",
            "sensor_size_mm",
        ),
        (Camera, "pinhole", "exposure = { ev100 = 100 }", "ev100"),
        (Camera, "pinhole", "exposure = { auto = { compensation_ev = -41 } }", "compensation_ev"),
        (
            Camera,
            "pinhole",
            "intrinsics = { fov_deg = 60 }\nlens = { f_number = 2, focal_length_mm = -1 }",
            "focal_length_mm",
        ),
        (Views, "hemisphere_shell", "radius = { meters = [0, 1.0] }", "meters"),
        (Views, "hemisphere_shell", "elevation_deg = [60, 95]", "elevation_deg"),
        (Views, "hemisphere_shell", "center_offset_m = -1", "center_offset_m"),
        (Views, "orbit", "distance = { of_table = 0 }", "of_table"),
        (Views, "orbit", "elevation_deg = -1", "elevation_deg"),
        (Views, "fixed_poses", "poses = []", "poses"),
        (Lights, "ceiling_light", "size_m = [0, 1]", "size_m"),
        (Lights, "ceiling_light", "shift_m = -1", "shift_m"),
        (Lights, "ceiling_light", "height_m = 0", "height_m"),
        (Lights, "sphere_lights", "radius = { beyond_views_m = [-1, 1] }", "beyond_views_m"),
        (Lights, "environment", "source = { map = { from = [] } }", "from"),
    ] {
        let error = refused(slot, kind, options);
        assert!(error.contains(want), "{options}: {error}");
    }
}

#[test]
fn draws_repeat() {
    let scene = scene(Some(15.0));
    let sampler = views("hemisphere_shell", "");
    let pose = |seed| with_context(seed, |context| sampler.pose(&scene, ViewId(0), context)).expect("a pose");
    assert_eq!(pose(1), pose(1));
    assert_ne!(pose(1), pose(2));
    let spheres = lights("sphere_lights", "count = 2");
    assert_eq!(draw(&*spheres, &scene, 1), draw(&*spheres, &scene, 1));
    assert_ne!(draw(&*spheres, &scene, 1), draw(&*spheres, &scene, 2));
    // The second light does not change the first.
    let one = lights("sphere_lights", "count = 1");
    assert_eq!(draw(&*spheres, &scene, 1).expect("lights")[0], draw(&*one, &scene, 1).expect("lights")[0]);
}
