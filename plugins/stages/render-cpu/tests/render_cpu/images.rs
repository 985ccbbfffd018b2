//! Properties of images as a whole.

use super::support::*;
use std::sync::Arc;
use syntable_model::context::Serial;
use syntable_model::digest::Digest;
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::prelude::*;
use syntable_model::product::standard::*;
use syntable_model::scene::{
    Alpha, Color, Encoding, Light, Material, MaterialOverride, MeshData, Moment, NormalMap, Recolor, RectLight, Role,
    Scalar, SphereLight, Texture, TextureMapping, Trajectory, UvTransform, Wrap,
};
use syntable_render_cpu::CpuPathRenderer;
use syntable_render_cpu::Strategy;
use syntable_transport::PathTracing;

pub fn texture(width: u32, height: u32, encoding: Encoding, f: impl Fn(u32, u32) -> [u8; 4]) -> Arc<Texture> {
    let texels: Vec<u8> =
        (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| f(x, y)).collect();
    let digest = Digest::of(&texels);
    Arc::new(Texture { width, height, texels, encoding, wrap: [Wrap::Repeat; 2], digest })
}

/// A scene with all features: textures, cut-outs, bumps, metal, smooth meshes, two lights.
pub fn busy_scene() -> (Arc<Scene>, View) {
    let checks =
        texture(
            16,
            16,
            Encoding::Srgb,
            |x, y| if (x / 4 + y / 4) % 2 == 0 { [230, 200, 40, 255] } else { [30, 60, 160, 0] },
        );
    let bumps = texture(8, 8, Encoding::Linear, |x, y| [(90 + 10 * x) as u8, (160 - 8 * y) as u8, 235, 255]);
    let lattice = Material {
        alpha: Alpha::Mask { cutoff: 0.5 },
        base_color: Color::texture(checks.clone()),
        ..Material::plain("lattice", [1.0; 3], 0.5)
    };
    let bumpy = Arc::new(Material {
        base_color: Color::texture(checks),
        normal: Some(NormalMap { map: bumps.into(), strength: 1.0 }),
        tile_m: 0.4,
        ..Material::plain("bumpy", [1.0; 3], 0.4)
    });
    let metal = Material { metallic: Scalar::constant(1.0), ..Material::plain("metal", [0.9, 0.8, 0.7], 0.2) };
    let boxed = MaterialOverride {
        material: bumpy.clone(),
        mapping: TextureMapping::Box { rotation: 0.3, offset: [0.1, 0.2] },
    };
    let by_uv = MaterialOverride {
        material: bumpy,
        mapping: TextureMapping::Uv(UvTransform { scale: [2.0, 3.0], rotation: 0.7, offset: [0.0, 0.5] }),
    };
    let block = object("block", cuboid([0.2, 0.15, 0.25]), lattice);
    let round = object("round", ball(0.2, 40), metal);
    let scene = scene([
        body(&block, at(-0.3, 0.1, 0.25), Role::Object),
        body(&round, at(0.3, 0.0, 0.2), Role::Object),
        covered(&round, at(0.0, 0.5, 0.2), Role::Object, by_uv),
        covered(&object("floor", sheet([1.5, 1.5]), matte(0.5)), at(0.0, 0.0, 0.0), Role::Support, boxed),
    ]);
    let panel = RectLight {
        center: Point3::new(0.0, 0.0, 2.0),
        half_u: Vector3::new(0.0, 0.4, 0.0),
        half_v: Vector3::new(0.4, 0.0, 0.0),
        radiance: [40.0; 3],
    };
    let globe = SphereLight { center: Point3::new(0.8, -0.8, 0.8), radius: 0.1, radiance: [90.0, 70.0, 40.0] };
    (scene, view(45, 37, 40.0, [0.7, -1.2, 1.0], [0.0, 0.1, 0.15], vec![Light::Rect(panel), Light::Sphere(globe)]))
}

pub const ALL: [KeyId; 13] = [
    RADIANCE.id(),
    DEPTH.id(),
    INSTANCE.id(),
    COVERAGE.id(),
    COVERAGE_BEFORE_SUPPORT.id(),
    NORMAL.id(),
    ALBEDO.id(),
    DENOISE_NORMAL.id(),
    DENOISE_ALBEDO.id(),
    RADIANCE_VARIANCE.id(),
    RADIANCE_SPECULAR.id(),
    RADIANCE_DEMODULATED.id(),
    RENDER_REPORT.id(),
];

pub fn bits(plane: &Plane<[f32; 3]>) -> Vec<[u32; 3]> {
    plane.data().iter().map(|p| p.map(f32::to_bits)).collect()
}

#[test]
fn a_session_at_another_moment_is_as_one_that_loaded_it() {
    let floor = body(&object("floor", sheet([1.5, 1.5]), matte(0.5)), at(0.0, 0.0, 0.0), Role::Support);
    let emissive =
        Material { emission: Color::constant([60.0, 50.0, 30.0]), ..Material::plain("emissive", [0.2; 3], 0.9) };
    let lantern = object("lantern", cuboid([0.1, 0.1, 0.1]), emissive.with_digest());
    let second = Moment::from_seconds(1.0).expect("finite");
    let way = vec![(Moment::START, at(-0.3, 0.1, 0.1)), (second, at(0.3, 0.2, 0.4))];
    let lantern = body(&lantern, at(0.0, 0.0, 0.0), Role::Object).scripted(Trajectory::new(way).expect("sound"));
    let block = body(&object("block", cuboid([0.1; 3]), matte(0.7)), at(0.0, -0.2, 0.1), Role::Object);
    let start = scene([lantern, block, floor]);
    let later = start.at(second);
    assert!(Arc::ptr_eq(&start, &start.at(Moment::START)) && later.moment == second);
    let view = view(32, 24, 30.0, [0.7, -1.2, 1.0], [0.0, 0.1, 0.15], Vec::new());
    let mut session = CpuPathRenderer::new(options(4, 3)).session();
    session.load(&start, &Serial).expect("loads");
    for moment in [&later, &start] {
        session.pose(moment, &Serial).expect("poses");
        let mut posed = Products::new();
        session.render(&RenderRequest::new(&view, &ALL, Stream::root(7), &Serial), &mut posed).expect("renders");
        let loaded = render(options(4, 3), moment, &view, &ALL);
        assert!(bits(posed.get(RADIANCE).expect("made")) == bits(loaded.get(RADIANCE).expect("made")));
        assert!(posed.get(INSTANCE).expect("made") == loaded.get(INSTANCE).expect("made"));
    }
    let [first, second] = [&start, &later].map(|scene| render(options(4, 3), scene, &view, &[DEPTH.id()]));
    assert!(first.get(DEPTH).expect("made") != second.get(DEPTH).expect("made"), "the lantern moved");
}

#[test]
fn any_number_of_workers_gives_the_same_bits() {
    let (scene, view) = busy_scene();
    let one = render(options(5, 4), &scene, &view, &ALL);
    assert!(one.get(RADIANCE).expect("made").data().iter().flatten().all(|x| x.is_finite() && *x >= 0.0));
    for threads in [2, 3] {
        let many =
            render_with(options(5, 4), Strategy::Combined, &scene, &view, &ALL, &Threads(threads)).expect("renders");
        for key in [RADIANCE, NORMAL, ALBEDO, RADIANCE_SPECULAR, RADIANCE_DEMODULATED, DENOISE_ALBEDO, DENOISE_NORMAL] {
            let (a, b) = (one.get(key).expect("made"), many.get(key).expect("made"));
            assert!(bits(a) == bits(b), "{} differs; {}", key.name(), keep("workers", &[("one", a), ("many", b)]));
        }
        assert!(one.get(DEPTH).expect("made") == many.get(DEPTH).expect("made"));
        assert!(one.get(INSTANCE).expect("made") == many.get(INSTANCE).expect("made"));
        for key in [COVERAGE, COVERAGE_BEFORE_SUPPORT] {
            assert!(one.get(key).expect("made") == many.get(key).expect("made"), "{}", key.id());
        }
    }
}

#[test]
fn any_number_of_lanes_gives_the_same_bits() {
    let (scene, view) = busy_scene();
    let many = render(options(5, 4), &scene, &view, &[RADIANCE.id()]);
    let mut session = syntable_render_cpu::CpuPathRenderer::new(options(5, 4)).session().portable();
    session.load(&scene, &Serial).expect("loads");
    let mut one = Products::new();
    let request = RenderRequest::new(&view, &LIGHT, Stream::root(7), &Serial);
    session.render(&request, &mut one).expect("renders");
    let (a, b) = (many.get(RADIANCE).expect("made"), one.get(RADIANCE).expect("made"));
    assert!(bits(a) == bits(b), "{}", keep("lanes", &[("many", a), ("one", b)]));
}

#[test]
fn exactly_what_is_wanted_is_made_and_does_not_depend_on_the_rest() {
    let (scene, view) = busy_scene();
    let all = render(options(2, 2), &scene, &view, &ALL);
    for want in ALL {
        let alone = render(options(2, 2), &scene, &view, &[want]);
        assert_eq!(alone.keys(), [want]);
        assert!(alone.value(&want).expect("made") == all.value(&want).expect("made"), "{want:?}");
    }
}

#[test]
fn the_seed_matters_and_sessions_can_be_used_again() {
    let (scene, view) = busy_scene();
    let mut session = syntable_render_cpu::CpuPathRenderer::new(options(2, 2)).session();
    let mut image = |seed: u64| {
        session.load(&scene, &Serial).expect("loads");
        let mut frame = Products::new();
        let request = RenderRequest::new(&view, &LIGHT, Stream::root(seed), &Serial);
        session.render(&request, &mut frame).expect("renders");
        bits(frame.get(RADIANCE).expect("made"))
    };
    let first = image(1);
    assert!(first != image(2));
    assert!(first == image(1));
}

#[test]
fn a_session_without_a_scene_says_so() {
    let (_, view) = busy_scene();
    let mut session = syntable_render_cpu::CpuPathRenderer::new(options(1, 1)).session();
    for want in ALL {
        let wants = [want];
        let request = RenderRequest::new(&view, &wants, Stream::root(1), &Serial);
        let error = session.render(&request, &mut Products::new()).expect_err("no scene");
        assert!(error.to_string().contains("no scene was loaded"), "{error}");
    }
}

#[test]
fn textures_are_the_right_way_up_on_every_mapping() {
    // Red top left, green top right, blue bottom left, gray bottom right.
    let quarters = texture(16, 16, Encoding::Linear, |x, y| match (x / 8, y / 8) {
        (0, 0) => [255, 0, 0, 255],
        (1, 0) => [0, 255, 0, 255],
        (0, 1) => [0, 0, 255, 255],
        _ => [128, 128, 128, 255],
    });
    let painted = Arc::new(Material { base_color: Color::texture(quarters), tile_m: 1.0, ..matte(1.0) });
    let table = object("table", sheet([0.5, 0.5]), matte(0.5));
    // Seen from above, with world y up in the image.
    let looking = view(4, 4, 4.0, [0.0, 0.0, 1.0], [0.0; 3], vec![]);
    let check = |mapping: TextureMapping, want: [[u8; 3]; 4]| {
        let surface = MaterialOverride { material: painted.clone(), mapping };
        let scene = scene([covered(&table, at(0.0, 0.0, 0.0), Role::Object, surface)]);
        let frame = render(options(1, 1), &scene, &looking, &[ALBEDO.id()]);
        let albedo = frame.get(ALBEDO).expect("made");
        let corners = [(0, 0), (3, 0), (0, 3), (3, 3)];
        for ((x, y), want) in corners.into_iter().zip(want) {
            let got = albedo.at(x, y).map(|c| (c * 255.0).round() as i32);
            assert_eq!(got, want.map(i32::from), "{mapping:?} at ({x}, {y})");
        }
    };
    let (red, green, blue, gray) = ([255, 0, 0], [0, 255, 0], [0, 0, 255], [128; 3]);
    check(TextureMapping::Uv(UvTransform::default()), [red, green, blue, gray]);
    let half = std::f32::consts::PI;
    // Rotating coordinates by half a turn about the corner rotates the tiled image.
    check(TextureMapping::Uv(UvTransform { rotation: half, ..Default::default() }), [gray, blue, green, red]);
    check(TextureMapping::Box { rotation: 0.0, offset: [0.5, 0.5] }, [red, green, blue, gray]);
    check(TextureMapping::Box { rotation: 0.0, offset: [0.0, 0.5] }, [green, red, gray, blue]);
}

#[test]
fn changed_colors_are_the_matrix_of_texture_and_vertex_color() {
    let recolor = Recolor { hue_deg: 75.0, saturation: 0.8, brightness: 0.9 };
    let halves = texture(16, 16, Encoding::Linear, |x, _| if x < 8 { [200, 100, 40, 255] } else { [30, 180, 90, 255] });
    let tinted = |tint: [f32; 3]| MeshData { colors: vec![tint; 4], ..sheet([0.5, 0.5]) };
    let (factor, tint) = ([0.8, 0.9, 1.0], [0.9, 0.5, 0.7]);
    let textured = Material { base_color: Color { factor, texture: Some(halves.into()) }, ..matte(1.0) };
    let constant = Material { base_color: Color::constant(factor), ..matte(1.0) };
    let texels = [[200.0, 100.0, 40.0], [30.0, 180.0, 90.0]].map(|texel| texel.map(|x: f32| x / 255.0));
    let looking = view(4, 4, 4.0, [0.0, 0.0, 1.0], [0.0; 3], vec![]);
    for (name, mesh, material, texels, tint) in [
        ("constant", sheet([0.5, 0.5]), &constant, [[1.0; 3]; 2], [1.0; 3]),
        ("vertex colors", tinted(tint), &constant, [[1.0; 3]; 2], tint),
        ("texture", sheet([0.5, 0.5]), &textured, texels, [1.0; 3]),
        ("both", tinted(tint), &textured, texels, tint),
    ] {
        let table = object(name, mesh, material.clone());
        let scene = scene([body(&table, at(0.0, 0.0, 0.0), Role::Object).with_recolor(Some(recolor))]);
        let frame = render(options(1, 1), &scene, &looking, &[ALBEDO.id()]);
        for (x, texel) in [0, 3].into_iter().zip(texels) {
            let got = frame.get(ALBEDO).expect("made").at(x, 1);
            let color = std::array::from_fn(|c| factor[c] * texel[c] * tint[c]);
            let want = recolor.matrix().apply(color);
            assert!((0..3).all(|c| (got[c] - want[c]).abs() < 2e-3), "{name}: {got:?}, not {want:?}");
            assert!((0..3).any(|c| (got[c] - color[c]).abs() > 0.05), "{name}: {got:?} is unchanged");
        }
    }
}

#[test]
fn normal_maps_tilt_towards_growing_u_and_v() {
    // A map that tilts the normal towards +u (red) and +v (green).
    let tilt = texture(1, 1, Encoding::Linear, |_, _| [192, 166, 230, 255]);
    let bumpy = Arc::new(Material { normal: Some(NormalMap { map: tilt.into(), strength: 1.0 }), ..matte(0.5) });
    let table = object("table", sheet([0.5, 0.5]), matte(0.5));
    let check = |mapping: TextureMapping, eye: f64, want: [f32; 2]| {
        let surface = MaterialOverride { material: bumpy.clone(), mapping };
        let scene = scene([covered(&table, at(0.0, 0.0, 0.0), Role::Object, surface)]);
        let looking = view(1, 1, 4.0, [0.0, 0.0, eye], [0.0; 3], vec![]);
        let frame = render(options(1, 1), &scene, &looking, &[NORMAL.id()]);
        let [x, y, z] = *frame.get(NORMAL).expect("made").at(0, 0);
        // Seen from above, the camera's x is world x and its y is −world y; z points away from it.
        assert!((x - want[0]).abs() < 0.02 && (y - want[1]).abs() < 0.02 && z < -0.7, "{mapping:?}: {x} {y} {z}");
    };
    let length = (0.506_f32.powi(2) + 0.302_f32.powi(2) + 0.804_f32.powi(2)).sqrt();
    let (a, b) = (0.506 / length, 0.302 / length);
    check(TextureMapping::Uv(UvTransform::default()), 1.0, [a, -b]);
    check(TextureMapping::Box { rotation: 0.0, offset: [0.0; 2] }, 1.0, [a, -b]);
    // Coordinates rotated by a quarter: u now grows along −y, v along x.
    let quarter = std::f32::consts::FRAC_PI_2;
    check(TextureMapping::Box { rotation: quarter, offset: [0.0; 2] }, 1.0, [b, a]);
    // From below, the relief is seen from behind, and the camera's x is −world x.
    check(TextureMapping::Uv(UvTransform::default()), -1.0, [a, b]);
}

#[test]
fn options_are_checked_and_the_example_builds() {
    let registry = syntable_model::registry::Registry::linked().expect("one kind of each name");
    let entry = registry.find(syntable_model::registry::Slot::Render, "cpu_path").expect("registered");
    entry.construct_str(entry.example).expect("builds");
    let built = entry.construct_str("samples_per_pixel = 8\nmax_indirect_luminance_nits = 1e4").expect("builds");
    assert_eq!(built.options["russian_roulette_from"].as_integer(), Some(3));
    assert!(entry.construct_str("").expect("builds").options.get("max_indirect_luminance_nits").is_none());
    for wrong in [
        "max_indirect_luminance_nits = 0",
        "max_indirect_luminance_nits = nan",
        "samples_per_pixel = 0",
        "time_s = inf",
        "noise = 0",
    ] {
        assert!(entry.construct_str(wrong).is_err(), "{wrong}");
    }
}

#[test]
fn rounds_give_the_same_image_as_one_go_and_quiet_tiles_stop_early() {
    let (scene, view) = busy_scene();
    let wants = [RADIANCE.id(), DENOISE_ALBEDO.id(), DENOISE_NORMAL.id(), RENDER_REPORT.id()];
    let whole = render(options(40, 4), &scene, &view, &wants);
    let never = PathTracing { noise: Some(1e-9), ..options(40, 4) };
    let rounds = render(never, &scene, &view, &wants);
    for key in [RADIANCE, DENOISE_ALBEDO, DENOISE_NORMAL] {
        assert_eq!(whole.get(key).expect("made"), rounds.get(key).expect("made"), "{}", key.name());
    }
    let samples = |frame: &Products| {
        let Value::Record(fields) = frame.get(RENDER_REPORT).expect("made").clone() else { panic!("a record") };
        let field = |name: &str| fields.iter().find(|(key, _)| key == name).expect("there").1.clone();
        (field("samples_min"), field("samples_max"))
    };
    assert_eq!(samples(&rounds), (40_u32.into(), 40_u32.into()));
    let early = render(PathTracing { noise: Some(0.08), ..options(256, 4) }, &scene, &view, &wants);
    let (fewest, most) = samples(&early);
    assert_eq!(fewest, 16_u32.into(), "the plain background needs no more");
    assert_ne!(most, 16_u32.into(), "the objects do");
    // The difference from another image has the promised noise.
    let other = render(PathTracing { noise: Some(1e-9), ..options(2048, 4) }, &scene, &view, &wants);
    let (a, b) = (early.get(RADIANCE).expect("made"), other.get(RADIANCE).expect("made"));
    let mean = b.data().iter().map(|p| f64::from(p[1])).sum::<f64>() / b.data().len() as f64;
    let error = |(a, b): (&[f32; 3], &[f32; 3])| f64::from((a[1] - b[1]).abs()) / (f64::from(b[1]) + 0.1 * mean);
    let error = a.data().iter().zip(b.data()).map(error).sum::<f64>() / a.data().len() as f64;
    assert!(error < 0.08, "{error}");
}

#[test]
fn bumps_too_fine_to_see_make_a_surface_rougher() {
    // A metal sheet has normals that alternate by ±20 degrees from texel to texel. If a texel is a twentieth of a
    // pixel, it mirrors as much of a panel's light to the camera as if the texels were large.
    let tilt = 20.0_f64.to_radians();
    let code = |x: f64| (127.5 + 127.5 * x).round() as u8;
    let bumps = texture(16, 16, Encoding::Linear, |x, y| {
        let sign = |i: u32| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let lean = tilt.sin() * std::f64::consts::FRAC_1_SQRT_2;
        [code(lean * sign(x)), code(lean * sign(y)), code(tilt.cos()), 255]
    });
    let seen = |tile_m: f32, strength: f32| {
        let metal = Arc::new(Material {
            metallic: Scalar::constant(1.0),
            normal: Some(NormalMap { map: bumps.clone().into(), strength }),
            tile_m,
            ..Material::plain("metal", [1.0; 3], 0.4)
        });
        let surface =
            MaterialOverride { material: metal, mapping: TextureMapping::Box { rotation: 0.0, offset: [0.0; 2] } };
        let sheet = object("sheet", sheet([1.0, 1.0]), matte(0.5));
        let scene = scene([covered(&sheet, at(0.0, 0.0, 0.0), Role::Object, surface)]);
        let panel = RectLight {
            center: Point3::new(0.0, 0.0, 1.5),
            half_u: Vector3::new(0.0, 0.4, 0.0),
            half_v: Vector3::new(0.4, 0.0, 0.0),
            radiance: [100.0; 3],
        };
        let view = view(8, 8, 40.0, [0.3, 0.0, 2.0], [0.0; 3], vec![Light::Rect(panel)]);
        let frame = render(options(1024, 1), &scene, &view, &[RADIANCE.id()]);
        let data = frame.get(RADIANCE).expect("made").data();
        data.iter().map(|p| f64::from(p[1])).sum::<f64>() / data.len() as f64
    };
    // 1024 samples resolve a quarter of a pixel, 1.3 cm: texels of 10 cm are resolved, texels of 0.6 mm are not. Two
    // slopes are not quite a rougher surface, but far from an even one.
    let (coarse, fine, even) = (seen(1.6, 1.0), seen(0.01, 1.0), seen(0.01, 0.0));
    assert!((fine / coarse - 1.0).abs() < 0.25 && even / coarse > 1.6, "{fine}, not {coarse}; even: {even}");
}
