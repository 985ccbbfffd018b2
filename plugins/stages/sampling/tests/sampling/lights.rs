//! Windows, environments, suns and downlights, and the units of brightness.

use super::*;
use std::f64::consts::{PI, TAU};
use syntable_model::geometry::look_at;
use syntable_testing::assets::Pools;
use syntable_testing::scenes;

fn total(lights: &[Light], point: Point3<f64>, normal: Vector3<f64>) -> f64 {
    lights.iter().map(|light| illuminance(light, point, normal)).sum()
}

#[test]
fn downlights_give_the_requested_illuminance() {
    let scene = scene(Some(2.5));
    for options in [
        "shape = \"disk\"\nsize_m = [0.3, 0.3]\ncount = 9\nspacing_m = 0.8\nbrightness = { illuminance_lx = 400 }",
        "shape = \"disk\"\nsize_m = [2.0, 2.0]\ncount = 1\nshift_m = 1.0\nbrightness = { illuminance_lx = 400 }",
    ] {
        let lights = draw(&*lights("ceiling_light", options), &scene, 5).expect("lights");
        let middle = lights.iter().fold(Vector3::zeros(), |sum, light| match light {
            Light::Disk(disk) => sum + disk.center.coords / lights.len() as f64,
            other => panic!("{other:?}"),
        });
        let facing = (middle - scene.support(None).expect("there").center().coords).normalize();
        let got = total(&lights, scene.support(None).expect("there").center(), facing);
        assert!((got / 400.0 - 1.0).abs() < 0.02, "{options}: {got} lx from {lights:?}");
    }
    let refusal = refused(Slot::Lights, "ceiling_light", "shape = \"disk\"\nsize_m = [1.0, 2.0]");
    assert!(refusal.contains("an ellipse"), "{refusal}");
}

#[test]
fn lights_are_sampled_per_view_or_per_scene() {
    for kind in ["sphere_lights", "ceiling_light", "window_light", "environment", "sun"] {
        assert!(!lights(kind, "").once_per_scene(), "{kind}");
        assert!(lights(kind, "per = \"scene\"").once_per_scene(), "{kind}");
    }
}

#[test]
fn lumens_become_nits() {
    let scene = scene(Some(2.5));
    let nits = |light: &Light| match light {
        Light::Sphere(sphere) => luminance(sphere.radiance),
        Light::Rect(rect) => luminance(rect.radiance),
        Light::Disk(disk) => luminance(disk.radiance),
        other => panic!("{other:?}"),
    };
    // A bulb of 806 lm (an old 60 W one) and radius 3 cm has Φ = 4π² r² L.
    let bulb =
        draw(&*lights("sphere_lights", "count = 1\nsize_m = 0.03\nbrightness = { luminous_flux_lm = 806 }"), &scene, 1);
    assert!((nits(&bulb.expect("a bulb")[0]) / (806.0 / (4.0 * PI * PI * 9e-4)) - 1.0).abs() < 1e-9);
    let panels = "count = 2\nsize_m = [0.6, 1.2]\nbrightness = { luminous_flux_lm = 3600 }";
    let panels = draw(&*lights("ceiling_light", panels), &scene, 1).expect("panels");
    assert!(panels.iter().all(|panel| (nits(panel) / (3600.0 / (PI * 0.72)) - 1.0).abs() < 1e-9));
    let spots = "shape = \"disk\"\nsize_m = [0.1, 0.1]\nbrightness = { luminous_flux_lm = 500 }";
    let spots = draw(&*lights("ceiling_light", spots), &scene, 1).expect("spots");
    assert!((nits(&spots[0]) / (500.0 / (PI * PI * 0.0025)) - 1.0).abs() < 1e-9);
}

#[test]
fn a_resolved_recipe_shows_the_brightness_and_the_source() {
    let registry = Registry::linked().expect("no clash");
    let shown = |kind: &str, options: &str| {
        let options = registry.find(Slot::Lights, kind).expect(kind).construct_str(options).expect(options).options;
        let keys = |name: &str| options[name].as_table().expect("a table").keys().cloned().collect::<Vec<_>>();
        (keys("brightness"), if kind == "environment" { keys("source") } else { Vec::new() })
    };
    let one = |key: &str| vec![key.to_owned()];
    assert_eq!(shown("ceiling_light", "").0, one("illuminance_lx"));
    assert_eq!(shown("ceiling_light", "brightness = { luminous_flux_lm = 900 }").0, one("luminous_flux_lm"));
    assert_eq!(shown("sphere_lights", "brightness = { luminance_nits = 7 }").0, one("luminance_nits"));
    assert_eq!(shown("window_light", "brightness = { luminance_nits = 7 }").0, one("luminance_nits"));
    assert_eq!(shown("environment", ""), (one("illuminance_lx"), one("constant")));
    let map = "source = { map = { from = [\"skies\"] } }\nbrightness = { luminance_scale = 1 }";
    assert_eq!(shown("environment", map), (one("luminance_scale"), one("map")));
    for (kind, options, want) in [
        ("sphere_lights", "brightness = { luminous_flux_lm = 5, illuminance_lx = 7 }", "brightness"),
        ("ceiling_light", "brightness = { luminous_flux_lm = -1 }", "brightness.luminous_flux_lm"),
        ("ceiling_light", "brightness = {}", "brightness"),
        ("ceiling_light", "brightness = 3", "brightness"),
        ("ceiling_light", "illuminance_lx = 3", "illuminance_lx"),
        ("window_light", "brightness = { luminous_flux_lm = 5 }", "luminous_flux_lm"),
        ("environment", "brightness = { luminance_nits = 7 }", "luminance_nits"),
        ("environment", "source = { map = { from = [\"skies\"], temperature_k = 5000 } }", "temperature_k"),
        ("environment", "source = { constant = { temperature_k = 5 } }", "source.constant.temperature_k"),
        ("sun", "elevation_deg = 100", "elevation_deg"),
        ("sun", "angular_diameter_deg = 0", "angular_diameter_deg"),
        ("window_light", "walls = 5", "walls"),
        ("window_light", "width_m = 0", "width_m"),
    ] {
        let error = refused(Slot::Lights, kind, options);
        assert!(error.contains(want), "{options}: {error}");
    }
}

/// The scene of the other tests in a room with these inner dimensions, built of slabs.
fn room(size: [f32; 3]) -> Scene {
    room_around(size, [0.0, 0.0, 0.75])
}

/// Like [`room`], with the center of the tabletop elsewhere.
fn room_around(size: [f32; 3], center: [f64; 3]) -> Scene {
    let [x, y, z] = size.map(f64::from);
    let mut scene = SceneBuilder::default();
    scene.supports = Support::new("table", Region::rectangle(center, [1.4, 0.8])).into();
    let object = scenes::object("box", scenes::box_mesh([0.1; 3]), [0.5; 3]);
    scene.add(scenes::body(object, [0.0, 0.0, 0.8], Role::Object));
    for (at, edges) in [
        ([0.0, 0.0, -0.05], [size[0], size[1], 0.1]),
        ([0.0, 0.0, z + 0.05], [size[0], size[1], 0.1]),
        ([x / 2.0 + 0.05, 0.0, z / 2.0], [0.1, size[1], size[2]]),
        ([-x / 2.0 - 0.05, 0.0, z / 2.0], [0.1, size[1], size[2]]),
        ([0.0, y / 2.0 + 0.05, z / 2.0], [size[0], 0.1, size[2]]),
        ([0.0, -y / 2.0 - 0.05, z / 2.0], [size[0], 0.1, size[2]]),
    ] {
        scene.add(scenes::body(scenes::object("slab", scenes::box_mesh(edges), [0.5; 3]), at, Role::Room));
    }
    scene.freeze(SettleReport::default()).expect("frozen")
}

#[test]
fn windows_are_in_the_walls_and_give_the_requested_illuminance() {
    let scene = room([6.0, 4.0, 2.6]);
    let inner = [3.0, 2.0, 2.6];
    let mut sides = [0; 4];
    for seed in 0..60 {
        let options = "pattern = \"plain\"\nwalls = { integers = [1, 2] }\nbrightness = { illuminance_lx = 600 }";
        let windows = draw(&*lights("window_light", options), &scene, seed).expect("windows");
        assert!((1..=6).contains(&windows.len()), "{windows:?}");
        for window in &windows {
            let Light::Rect(rect) = window else { panic!("{window:?}") };
            for corner in rect.corners() {
                assert!((0..2).all(|k| corner[k].abs() < inner[k]) && (0.05..2.55).contains(&corner.z), "{corner}");
            }
            // One centimeter in front of its wall, facing the room.
            let normal = rect.normal();
            let axis = if normal.x.abs() > 0.5 { 0 } else { 1 };
            assert!((rect.center[axis].abs() - (inner[axis] - 0.01)).abs() < 1e-6, "{rect:?}");
            assert!(normal[axis] * rect.center[axis] < 0.0 && normal.z.abs() < 1e-12);
            sides[2 * axis + usize::from(normal[axis] > 0.0)] += 1;
        }
        if seed < 4 {
            let got = total(&windows, scene.support(None).expect("there").center(), Vector3::z());
            assert!((got / 600.0 - 1.0).abs() < 0.02, "{got} lx from {windows:?}");
        }
    }
    assert!(sides.iter().all(|count| *count > 10), "{sides:?}");
    // Windows that do not fit are fewer, lower, smaller.
    let many = "count = 40\nwidth_m = 1.5\nheight_m = 9\nspacing_m = 0.5";
    let windows = draw(&*lights("window_light", many), &scene, 1).expect("windows");
    assert!((2..=3).contains(&windows.len()), "{windows:?}");
    let low = draw(&*lights("window_light", "sill_m = 0\nheight_m = 0.3"), &scene, 1).expect_err("low").to_string();
    assert!(low.contains("no window reaches above the table"), "{low}");
    let none = draw(&*lights("window_light", ""), &super::scene(None), 1).expect_err("no wall").to_string();
    assert!(none.contains("no wall") && none.contains("environment"), "{none}");
    assert!(draw(&*lights("window_light", "walls = 0"), &scene, 1).expect("none").is_empty());
}

#[test]
fn windows_need_a_wall_only_where_one_is_wanted() {
    let mut open = SceneBuilder::default();
    open.supports = Support::new("table", Region::rectangle([0.0, 0.0, 0.75], [1.4, 0.8])).into();
    let object = scenes::object("box", scenes::box_mesh([0.1; 3]), [0.5; 3]);
    open.add(scenes::body(object, [0.0, 0.0, 0.8], Role::Object));
    let open = open.freeze(SettleReport::default()).expect("frozen");
    let floor = super::scene(None);
    let outside = room_around([6.0, 4.0, 2.6], [0.0, 0.0, 5.25]);
    for scene in [&open, &floor, &outside] {
        for options in ["walls = 0", "brightness = { illuminance_lx = 0 }", "brightness = { luminance_nits = 0 }"] {
            assert!(draw(&*lights("window_light", options), scene, 1).expect(options).is_empty());
        }
    }
    // Every draw of 0 walls succeeds; every other draw fails because the scene has no room.
    let sometimes = lights("window_light", "walls = { integers = [0, 1] }");
    let drawn: Vec<_> = (0..40).map(|seed| draw(&*sometimes, &open, seed)).collect();
    assert!(drawn.iter().filter(|lights| lights.is_ok()).count() > 8);
    let errors: Vec<_> = drawn.into_iter().filter_map(Result::err).collect();
    assert!(errors.len() > 8);
    assert!(errors.iter().all(|error| error.is_permanent() && error.to_string().contains("the scene has no room")));
    // A floor is never a wall, so its error is permanent; a table outside its room may be inside it at the next
    // attempt.
    let floor = draw(&*lights("window_light", ""), &floor, 1).expect_err("a floor only");
    assert!(floor.is_permanent() && floor.to_string().contains("a floor without walls"), "{floor}");
    let error = draw(&*lights("window_light", ""), &outside, 1).expect_err("above the room");
    let text = error.to_string();
    assert!(!error.is_permanent() && !text.contains("place a room"), "{text}");
    assert!(text.contains("its center is at (0.00, 0.00, 5.25) m") && text.contains("(3.10, 2.10, 2.60) m"), "{text}");
    assert!(text.contains("make the table smaller or the room larger"), "{text}");
}

#[test]
fn windows_with_a_view_give_the_same_illuminance_as_plain_ones() {
    let scene = room([6.0, 4.0, 2.6]);
    let drawn = |options: &str, seed: u64| draw(&*lights("window_light", options), &scene, seed).expect("windows");
    for (seed, pattern) in [(1, "view"), (2, "view"), (3, "view"), (4, "panes")] {
        let options = format!("pattern = \"{pattern}\"\nbrightness = {{ illuminance_lx = 600 }}");
        let windows = drawn(&options, seed);
        let got = total(&windows, scene.support(None).expect("there").center(), Vector3::z());
        assert!((got / 600.0 - 1.0).abs() < 0.01, "{pattern}: {got} lx");
        // The same rectangles, with any pattern.
        let plain = drawn("pattern = \"plain\"\nbrightness = { illuminance_lx = 600 }", seed);
        assert_eq!(windows.len(), plain.len());
        for (window, plain) in windows.iter().zip(&plain) {
            let (Light::Window(window), Light::Rect(plain)) = (window, plain) else { panic!("{window:?}") };
            assert_eq!(window.rect(plain.radiance), *plain);
            if pattern == "panes" {
                assert!((0.5..0.97).contains(&(window.mean().radiance[1] / window.view.scale[1])), "{window:?}");
            }
            assert!(luminance(window.frame_radiance) < 0.35 / PI * 600.0);
        }
    }
    let options =
        "pattern = \"panes\"\ncount = 1\nwidth_m = 1.5\nheight_m = 1.0\npane_m = 0.6\nframe_m = 0.06\nbar_m = 0.04";
    let nits = format!("{options}\nbrightness = {{ luminance_nits = 5000 }}");
    let [Light::Window(window)] = &drawn(&nits, 7)[..] else { panic!("a window") };
    assert_eq!((window.panes, window.frame_m, window.bar_m), ([3, 2], 0.06, 0.04));
    assert!((luminance(window.view.scale) - 5000.0).abs() < 1e-6);
    // Frame and bars narrow where the window is small.
    let small = drawn("count = 1\nwidth_m = 0.2\nheight_m = 1.5\nframe_m = 1\nbar_m = 1", 7);
    let [Light::Window(small)] = &small[..] else { panic!("a window") };
    assert!(small.frame_m <= 0.04 + 1e-12 && !small.glass().is_empty());
    let refusal = refused(Slot::Lights, "window_light", "pattern = \"plain\"\nfrom = [\"skies\"]");
    assert!(refusal.contains("from") && refusal.contains("view"), "{refusal}");
}

#[test]
fn windows_show_maps_of_a_pool() {
    let pools = Pools::default().environment("skies", sky("a")).environment("dark", EnvironmentMap::constant([0.0; 3]));
    let log = Collected::default();
    let context = Context { stream: Stream::root(3), assets: &pools, cache: &NoCache, workers: &Serial, log: &log };
    let camera = Camera::pinhole(intrinsics("").0, Pose::identity());
    let scene = room([6.0, 4.0, 2.6]);
    let shell = views("hemisphere_shell", "").shell(&scene).expect("a support");
    let drawn = |pool: &str| {
        let options = format!("from = [\"{pool}\"]\nbrightness = {{ illuminance_lx = 900 }}");
        lights("window_light", &options).lights(&scene, &camera, &shell, &context)
    };
    let windows = drawn("skies").expect("windows");
    let Light::Window(window) = &windows[0] else { panic!("{windows:?}") };
    assert!(window.view.map.name == "a" && window.view.scale[0] == window.view.scale[2], "the map keeps its hues");
    let got = total(&windows, scene.support(None).expect("there").center(), Vector3::z());
    assert!((got / 900.0 - 1.0).abs() < 0.02, "{got} lx");
    let error = drawn("dark").expect_err("dark").to_string();
    assert!(error.contains("no light above the horizon"), "{error}");
}

fn sky(name: &str) -> EnvironmentMap {
    let (width, height) = (64, 32);
    let mut stream = Stream::root(7).child(name);
    let texels = (0..width * height).map(|_| std::array::from_fn(|_| stream.unit().powi(4) as f32)).collect();
    EnvironmentMap::new(name, width, height, texels).expect("sound")
}

fn under_skies(options: &str, seed: u64) -> Result<Vec<Light>> {
    let dark = EnvironmentMap::constant([0.0; 3]);
    let pools = Pools::default().environment("skies", sky("a")).environment("skies", sky("b"));
    let pools = pools.environment("dark", dark);
    let log = Collected::default();
    let stream = Stream::root(seed);
    let context = Context { stream, assets: &pools, cache: &NoCache, workers: &Serial, log: &log };
    let camera = Camera::pinhole(intrinsics("").0, Pose::identity());
    let scene = scene(None);
    lights("environment", options).lights(
        &scene,
        &camera,
        &views("hemisphere_shell", "").shell(&scene).expect("a support"),
        &context,
    )
}

#[test]
fn environment_maps_give_the_requested_illuminance() {
    let (mut names, mut rotations) = (std::collections::BTreeMap::<String, u32>::new(), Vec::new());
    for seed in 0..400 {
        let lights =
            under_skies("source = { map = { from = [\"skies\"] } }\nbrightness = { illuminance_lx = 5000 }", seed)
                .expect("a sky");
        let [Light::Environment(sky)] = &lights[..] else { panic!("{lights:?}") };
        *names.entry(sky.map.name.clone()).or_default() += 1;
        rotations.push(sky.rotation / TAU);
        if seed < 4 {
            let got = illuminance(&lights[0], Point3::origin(), Vector3::z());
            assert!((got / 5000.0 - 1.0).abs() < 0.01, "{got} lx");
            assert!(sky.scale[0] == sky.scale[1] && sky.scale[1] == sky.scale[2], "the map keeps its hues");
        }
    }
    // 200 ± 4 standard deviations of a binomial.
    assert!(names.len() == 2 && names.values().all(|count| (160..=240).contains(count)), "{names:?}");
    assert!(kolmogorov_smirnov(rotations) < bound(400));
    let raw = under_skies(
        "brightness = { luminance_scale = 3 }\nsource = { map = { from = [\"skies\"], rotation_deg = 90 } }",
        1,
    )
    .expect("a sky");
    let Light::Environment(sky) = &raw[0] else { panic!("{raw:?}") };
    assert_eq!((sky.scale, sky.rotation), ([3.0; 3], PI / 2.0));
    // Even light: E = π L.
    let even =
        under_skies("brightness = { illuminance_lx = 1000 }\nsource = { constant = { temperature_k = 3000 } }", 1)
            .expect("a sky");
    let Light::Environment(light) = &even[0] else { panic!("{even:?}") };
    assert!((luminance(light.scale) - 1000.0 / PI).abs() < 1e-6 && light.scale[0] > light.scale[2]);
    let error = under_skies("source = { map = { from = [\"dark\"] } }", 1).expect_err("dark").to_string();
    assert!(error.contains("no light above the horizon"), "{error}");
    assert!(under_skies("brightness = { illuminance_lx = 0 }", 1).expect("none").is_empty());
}

#[test]
fn a_map_has_its_sun_where_it_is_brightest() {
    // A bright patch of 4 × 4 texels around 33.75° of elevation, to the left of +x; the rest is even.
    let (width, height) = (64_usize, 32_usize);
    let mut texels = vec![[1.0; 3]; width * height];
    for (row, column) in (8..12).flat_map(|row| (20..24).map(move |column| (row, column))) {
        texels[row * width + column] = [50.0; 3];
    }
    let map = EnvironmentMap::new("sunny", width as u32, height as u32, texels).expect("sound");
    let pools = Pools::default().environment("skies", map);
    let log = Collected::default();
    let context = Context { stream: Stream::root(1), assets: &pools, cache: &NoCache, workers: &Serial, log: &log };
    let camera = Camera::pinhole(intrinsics("").0, Pose::identity());
    let scene = scene(None);
    let options = "brightness = { illuminance_lx = 1000 }\nsource = { map = { from = [\"skies\"], rotation_deg = 90, sun = { ratio = 3 } } }";
    let shell = views("hemisphere_shell", "").shell(&scene).expect("a support");
    let drawn = lights("environment", options).lights(&scene, &camera, &shell, &context).expect("lights");
    let [sun @ Light::Directional(disk), sky @ Light::Environment(_)] = &drawn[..] else { panic!("{drawn:?}") };
    assert!((illuminance(sun, Point3::origin(), disk.towards) / 3000.0 - 1.0).abs() < 0.05, "{disk:?}");
    assert!((luminance(disk.irradiance) - 3000.0).abs() < 1e-6);
    // The sky is bright just where its sun is.
    let at = luminance(seen(sky, Point3::origin(), disk.towards));
    let aside = luminance(seen(sky, Point3::origin(), Vector3::new(0.6, -0.6, 0.5).normalize()));
    assert!((at / aside - 50.0).abs() < 1e-3, "{at} {aside}");
    assert!((disk.towards.z - 33.75_f64.to_radians().sin()).abs() < 0.01, "{disk:?}");
    let refusal = refused(Slot::Lights, "environment", "source = { constant = { sun = { ratio = 2 } } }");
    assert!(refusal.contains("has no option `sun`"), "{refusal}");
}

#[test]
fn the_sun_has_its_elevation_and_azimuth() {
    let scene = scene(None);
    let options = "elevation_deg = 30\nazimuth_deg = 90\nilluminance_lx = 50000\nangular_diameter_deg = 20";
    let drawn = draw(&*lights("sun", options), &scene, 1).expect("a sun");
    let [Light::Directional(sun)] = &drawn[..] else { panic!("{drawn:?}") };
    assert!((sun.towards - Vector3::new(0.0, 0.75_f64.sqrt(), 0.5)).norm() < 1e-12, "{sun:?}");
    let facing = illuminance(&drawn[0], Point3::origin(), sun.towards);
    assert!((facing / 50_000.0 - 1.0).abs() < 0.01, "{facing} lx");
    let level = illuminance(&drawn[0], Point3::origin(), Vector3::z());
    assert!((level / 25_000.0 - 1.0).abs() < 0.02, "{level} lx");
    let usual = draw(&*lights("sun", ""), &scene, 3).expect("a sun");
    let [Light::Directional(sun)] = usual[..] else { panic!("{usual:?}") };
    assert!(
        (sun.half_angle - 0.00465).abs() < 5e-5 && sun.towards.z > 0.25 && (sun.towards.norm() - 1.0).abs() < 1e-12
    );
}

#[test]
fn a_flash_is_beside_the_lens_and_fires_sometimes() {
    let scene = scene(None);
    let support = scene.support(None).expect("there").center();
    let intrinsics = Intrinsics { width: 64, height: 48, fx: 60.0, fy: 60.0, cx: 32.0, cy: 24.0 };
    let camera = Camera::pinhole(intrinsics, look_at(Point3::new(0.0, -1.0, 1.5), support, Vector3::z()));
    let flash = lights(
        "flash",
        "probability = 0.5\noffset_m = [0.04, 0.03]\nsize_m = 0.1\nbrightness = { illuminance_lx = 900 }",
    );
    let mut fired = 0;
    for seed in 0..100 {
        let shell = Shell { center: support, radius: [1.0, 2.0] };
        let drawn = with_context(seed, |context| flash.lights(&scene, &camera, &shell, context)).expect("lights");
        let Some(light) = drawn.first() else { continue };
        fired += 1;
        let Light::Sphere(sphere) = light else { panic!("{light:?}") };
        // Camera frame: x right, y down.
        let at = camera.world_from_camera.inverse() * sphere.center;
        assert!((at - Point3::new(0.04, -0.03, 0.0)).norm() < 1e-9, "{at}");
        let got = total(&drawn, support, (sphere.center - support).normalize());
        assert!((got / 900.0 - 1.0).abs() < 0.01, "{got} lx");
    }
    assert!((35..65).contains(&fired), "{fired}");
}

#[test]
fn windows_avoid_furniture_and_are_behind_blinds() {
    let furnished = |bodies: &[(&str, [f64; 3], [f32; 3])]| {
        let mut builder = SceneBuilder::default();
        builder.supports = Support::new("table", Region::rectangle([0.0, 0.0, 0.75], [1.4, 0.8])).into();
        for body in room([6.0, 4.0, 2.6]).bodies() {
            let object = Arc::clone(&body.object);
            let at = body.world_from_body.translation.vector;
            builder.add(scenes::body(object, at.into(), body.role));
        }
        for (pool, at, edges) in bodies {
            let mut body =
                scenes::body(scenes::object("piece", scenes::box_mesh(*edges), [0.5; 3]), *at, Role::Fixture);
            body.asset.pool = (*pool).to_owned();
            builder.add(body);
        }
        builder.freeze(SettleReport::default()).expect("frozen")
    };
    // A cupboard of 1.5 m at the middle of each wall; a window of 1 m fits beside it.
    let cupboards = [
        ("furniture", [0.0, 1.75, 1.0], [1.5, 0.5, 2.0]),
        ("furniture", [0.0, -1.75, 1.0], [1.5, 0.5, 2.0]),
        ("furniture", [2.75, 0.0, 1.0], [0.5, 1.5, 2.0]),
        ("furniture", [-2.75, 0.0, 1.0], [0.5, 1.5, 2.0]),
    ];
    let options = "pattern = \"plain\"\ncount = 1\nwidth_m = 1\nbrightness = { illuminance_lx = 600 }";
    let (bare, full) = (furnished(&[]), furnished(&cupboards));
    let mut hidden = [0; 2];
    for seed in 0..60 {
        for (scene, hidden) in [&bare, &full].into_iter().zip(&mut hidden) {
            let drawn = draw(&*lights("window_light", options), scene, seed).expect("windows");
            let Light::Rect(window) = &drawn[0] else { panic!("{drawn:?}") };
            let along = if window.normal().x.abs() > 0.5 { window.center.y } else { window.center.x };
            *hidden += usize::from(along.abs() < 1.25);
        }
    }
    assert!(hidden[0] > 30 && hidden[1] < 8, "{hidden:?}");
    let blind = ("blinds", [1.0, 1.95, 1.6], [1.2, 0.06, 1.4]);
    let scene = furnished(&[blind, cupboards[1]]);
    let drawn = draw(&*lights("window_light", &format!("{options}\nbehind = \"blinds\"")), &scene, 1);
    let drawn = drawn.expect("a window");
    let [Light::Rect(window)] = &drawn[..] else { panic!("{drawn:?}") };
    for corner in window.corners() {
        assert!((0.4..1.6).contains(&corner.x) && (0.9..2.3).contains(&corner.z), "{corner}");
        assert!((corner.y - 1.99).abs() < 1e-6, "{corner}");
    }
    assert!(window.normal().y < -0.99);
}
