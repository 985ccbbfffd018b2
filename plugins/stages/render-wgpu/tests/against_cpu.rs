//! Compares the GPU's labels and light with the CPU's.
//!
//! Needs an adapter: a card, or Mesa's lavapipe (`mesa-vulkan-drivers`), a software renderer.

use parking_lot::Mutex;
use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_guided::Guided;
use syntable_model::context::Cache;
use syntable_model::digest::Digest;
use syntable_model::prelude::*;
use syntable_model::product::Lighting;
use syntable_model::product::Plane;
use syntable_model::product::standard::*;
use syntable_model::scene::{
    Color, Encoding, EnvironmentLight, EnvironmentMap, Light, Material, Mesh, Recolor, Region, Role, Scalar,
    SettleReport, Support, Texture, Wrap,
};
use syntable_model::stage::{Atlas, Bodies, Window};
use syntable_prepare::labels::BlendedLabels;
use syntable_render_cpu::CpuPathRenderer;
use syntable_render_wgpu::{Adapters, GpuPathRenderer, RayQueries};
use syntable_testing::room::{self, Look};
use syntable_testing::scenes;
use syntable_testing::tools::is_there;
use syntable_testing::workers::Threads;
use syntable_transport::{Dielectrics, PathTracing, PixelFilter};

const LOOKS: [Look; 4] = [Look::Mixed, Look::Glass, Look::Plastic, Look::Metal];

fn has_adapter() -> bool {
    is_there(Adapters::find().used().is_ok(), "a graphics adapter (mesa-vulkan-drivers)")
}

/// Products of a renderer.
fn rendered(renderer: &dyn Renderer, scene: &Arc<Scene>, request: &RenderRequest) -> Products {
    let mut session = renderer.open(0).expect("opens");
    session.load(scene, &Threads(2)).expect("loads");
    let mut frame = Products::new();
    session.render(request, &mut frame).expect("renders");
    frame
}

/// Products of the CPU and of the GPU.
fn both(options: &PathTracing, look: Look, request: &RenderRequest) -> [Products; 2] {
    let scene = room::scene_of(look);
    [
        rendered(&CpuPathRenderer::new(options.clone()), &scene, request),
        rendered(&GpuPathRenderer::new(options.clone()), &scene, request),
    ]
}

fn pair<T: syntable_model::product::Product>(frames: &[Products; 2], key: Key<T>) -> [&T; 2] {
    [0, 1].map(|i| frames[i].get(key).expect("made"))
}

/// Number of pixels that differ.
fn different<T: Copy>([a, b]: [&Plane<T>; 2], differ: impl Fn(T, T) -> bool) -> usize {
    assert_eq!(a.data().len(), b.data().len());
    a.data().iter().zip(b.data()).filter(|&(&a, &b)| differ(a, b)).count()
}

#[test]
fn labels_are_the_cpus() {
    if !has_adapter() {
        return;
    }
    let (width, height) = (480, 360);
    let view = room::view(width, height);
    let before = COVERAGE_BEFORE_SUPPORT;
    let wants = keys![DEPTH, INSTANCE, COVERAGE, before, OBJECT_DEPTHS, NORMAL, ALBEDO];
    let seen = [InstanceId(3), InstanceId(21)];
    let window = Window { x: -37, y: 11, width: 300, height: 200 };
    let image = Window::of(&view.camera.intrinsics);
    let request = RenderRequest::new(&view, &wants, Stream::root(1), &Threads(2));
    let (mut instances, mut bits, mut pixels) = (0, 0, 0);
    let (plain, mut plainly) = (PathTracing::default(), None);
    let through_glass = PathTracing { blended_labels: BlendedLabels::Opaque, ..PathTracing::default() };
    for (options, look, request) in [
        (&plain, Look::Mixed, request.clone()),
        (&plain, Look::Glass, request.clone()),
        (&through_glass, Look::Glass, request.clone()),
        (&plain, Look::Mixed, request.clone().of(window, Bodies::All)),
        (&plain, Look::Mixed, request.clone().of(image, Bodies::Only(&seen))),
        (&plain, Look::Mixed, request.clone().of(image, Bodies::Seen(&seen))),
        (&plain, Look::Mixed, request.clone().of(image, Bodies::Foreground)),
    ] {
        let frames = both(options, look, &request);
        if options == &plain && look == Look::Glass {
            plainly = Some(frames[0].get(INSTANCE).expect("made").clone());
        }
        if options == &through_glass {
            let [through, _] = pair(&frames, INSTANCE);
            let changed = plainly.as_ref().map_or(0, |plainly| different([plainly, through], |a, b| a != b));
            assert!(changed > 100, "labels look through glass at {changed} pixels");
        }
        instances += different(pair(&frames, INSTANCE), |a, b| a != b);
        let depth = different(pair(&frames, DEPTH), |a, b| !(a == b || (a - b).abs() <= 1e-5 * a));
        let off = |a: [f32; 3], b: [f32; 3]| (0..3).any(|c| (a[c] - b[c]).abs() > 2e-3);
        let [normal, albedo] = [NORMAL, ALBEDO].map(|key| different(pair(&frames, key), off));
        for key in [COVERAGE, before] {
            let [a, b] = pair(&frames, key);
            for y in 0..a.height() {
                for x in 0..a.width() {
                    bits += usize::from(a.set(x, y) != b.set(x, y));
                }
            }
        }
        let [a, b] = pair(&frames, OBJECT_DEPTHS);
        let same = |(a, b): (&(InstanceId, f32), &(InstanceId, f32))| a.0 == b.0 && (a.1 - b.1).abs() <= 1e-5 * a.1;
        let alike = |a: &[_], b: &[_]| a.len() == b.len() && a.iter().zip(b).all(same);
        let depths = a.pixels().zip(b.pixels()).filter(|(a, b)| !alike(a, b)).count();
        // All objects of this look are glass.
        let objects = a.pixels().flatten().count();
        assert!(if options == &through_glass { objects == 0 } else { objects > 100 }, "objects on rays: {objects}");
        let all = request.pixels() as usize;
        // As few differences as in the depth of visible surfaces.
        assert!(depths * 2_000 <= all, "{look:?}: {depths} of {all} lists of objects differ");
        pixels += all;
        // Interpolation at grazing faces doubles rounding errors.
        assert!(depth.max(normal).max(albedo) * 2_000 <= all, "{look:?}: {depth} {normal} {albedo} of {all} differ");
    }
    println!("{instances} instances and {bits} coverages of {pixels} pixels differ");
    // One in 100,000, where a ray grazes an edge.
    assert!(instances.max(bits) * 100_000 <= pixels.next_multiple_of(100_000), "{instances} {bits}");
}

/// Mean of z² over the pixels, where z is the difference divided by its standard error as if the images were
/// independent; and the ratio of the means. Where rounding sends a bright path elsewhere, only one of the images has
/// its variance; another test compares the variances.
fn compare(frames: &[Products; 2]) -> (f64, f64) {
    let y = |plane: &Plane<[f32; 3]>| -> Vec<f64> {
        plane.data().iter().map(|p| syntable_model::photometry::luminance(p.map(f64::from))).collect()
    };
    let [a, b] = pair(frames, RADIANCE).map(y);
    let [va, vb] = pair(frames, RADIANCE_VARIANCE);
    let z2 = |i: usize| (a[i] - b[i]).powi(2) / f64::from(va.data()[i] + vb.data()[i]).max(1e-12);
    ((0..a.len()).map(z2).sum::<f64>() / a.len() as f64, b.iter().sum::<f64>() / a.iter().sum::<f64>())
}

#[test]
fn light_and_guides_are_the_cpus() {
    if !has_adapter() {
        return;
    }
    let view = room::view(64, 48);
    let guides = [DENOISE_ALBEDO, DENOISE_NORMAL, RADIANCE_SPECULAR, RADIANCE_DEMODULATED];
    let variances = [RADIANCE_VARIANCE, RADIANCE_SPECULAR_VARIANCE, RADIANCE_DEMODULATED_VARIANCE];
    let mut wants = vec![RADIANCE.id(), RENDER_REPORT.id()];
    wants.extend(guides.map(|key| key.id()));
    wants.extend(variances.map(|key| key.id()));
    let request = RenderRequest::new(&view, &wants, Stream::root(5), &Threads(2));
    for look in LOOKS {
        let options = PathTracing { samples_per_pixel: 32, ..PathTracing::default() };
        let frames = both(&options, look, &request);
        let (z2, ratio) = compare(&frames);
        println!("{look:?}: mean z² {z2:.5}, ratio of means {ratio:.5}");
        // Both use the same random numbers, so noise cancels except where rounding sends a path elsewhere.
        assert!(z2 < 0.05 && (ratio - 1.0).abs() < 5e-3, "{look:?}: {z2} {ratio}");
        for key in guides {
            let sum = |p: &Plane<[f32; 3]>| p.data().iter().flatten().map(|x| f64::from(x.abs())).sum::<f64>();
            let [a, b] = pair(&frames, key).map(sum);
            assert!((b / a - 1.0).abs() < 5e-3, "{look:?}, {:?}: {a} {b}", key.id());
        }
        // Pixel by pixel, except where rounding sends one of the paths elsewhere: one in 600 after polished metal on a
        // card.
        let far = |a: f32, b: f32| (a - b).abs() > 2e-3 + 1e-2 * a.abs();
        let unlike = guides.map(|key| different(pair(&frames, key), |a, b| (0..3).any(|c| far(a[c], b[c]))));
        let varies = |a: f32, b: f32| a.is_finite() != b.is_finite() || a.is_finite() && far(a, b);
        let varying = variances.map(|key| different(pair(&frames, key), varies));
        println!("{look:?}: guides of {unlike:?} pixels differ, variances of {varying:?}");
        let most = 64 * 48 * options.samples_per_pixel as usize / 250;
        assert!(unlike.iter().chain(&varying).all(|&pixels| pixels <= most), "{look:?}: {unlike:?} {varying:?}");
        let rays = pair(&frames, RENDER_REPORT).map(|report| match report {
            Value::Record(fields) => {
                fields.iter().filter(|(name, _)| name == "rays" || name == "shadow_rays").cloned().collect()
            }
            _ => Vec::new(),
        });
        assert!(rays.iter().all(|counts| counts.len() == 2), "{look:?}: {rays:?}");
        for ((name, a), (_, b)) in rays[0].iter().zip(&rays[1]) {
            let (Value::Int(a), Value::Int(b)) = (a, b) else { panic!("{name} is a number") };
            assert!((*a - *b).abs() * 500 < *a, "{look:?}: {a} and {b} {name}");
        }
    }
}

#[test]
fn changed_colors_are_the_cpus() {
    if !has_adapter() {
        return;
    }
    let texels: Vec<u8> = (0..64_u8).flat_map(|i| [i * 4, 255 - i * 3, 40 + i, 255]).collect();
    let digest = Digest::of(&texels);
    let (encoding, wrap) = (Encoding::Srgb, [Wrap::Clamp; 2]);
    let ramp = Color::texture(Arc::new(Texture { width: 8, height: 8, texels, encoding, wrap, digest }));
    let mut builder = SceneBuilder::default();
    builder.supports = Support::new("table", Region::rectangle([0.0; 3], [1.0, 1.0])).into();
    for (number, texture, has_vertex_colors) in [(0, false, false), (1, true, false), (2, false, true), (3, true, true)]
    {
        let mut mesh = scenes::box_mesh([0.2; 3]).into_data();
        if has_vertex_colors {
            mesh.colors = (0..mesh.positions.len()).map(|i| [1.0, 0.2 + 0.03 * i as f32, 0.6]).collect();
        }
        let mut object =
            (*scenes::object(&format!("cube {number}"), Mesh::new(mesh).expect("sound"), [0.7, 0.3, 0.5])).clone();
        if texture {
            let plain = Material::clone(&object.materials[0]);
            object.materials = vec![Arc::new(Material { base_color: ramp.clone(), ..plain }.with_digest())];
        }
        let at = [0.3 * f64::from(number % 2) - 0.15, 0.3 * f64::from(number / 2) - 0.15, 0.0];
        let recolor = Recolor { hue_deg: 40.0 + 60.0 * f64::from(number), saturation: 1.3, brightness: 0.8 };
        builder.add(scenes::body(Arc::new(object), at, Role::Object).with_recolor(Some(recolor)));
    }
    let scene = Arc::new(builder.freeze(SettleReport::default()).expect("sound"));
    let view = scenes::view([0.5, -0.7, 0.6], [0.0; 3], [96, 72], 50.0);
    let wants = keys![ALBEDO, INSTANCE];
    let request = RenderRequest::new(&view, &wants, Stream::root(1), &Threads(2));
    let options = PathTracing::default();
    let frames = [
        rendered(&CpuPathRenderer::new(options.clone()), &scene, &request),
        rendered(&GpuPathRenderer::new(options), &scene, &request),
    ];
    let [instances, _] = pair(&frames, INSTANCE);
    for id in 1..=4 {
        assert!(instances.data().iter().filter(|seen| seen.0 == id).count() > 50, "cube {id} is not seen");
    }
    let off = |a: [f32; 3], b: [f32; 3]| (0..3).any(|c| (a[c] - b[c]).abs() > 2e-3);
    let different = different(pair(&frames, ALBEDO), off);
    assert!(different * 500 <= 96 * 72, "{different} pixels differ");
}

#[test]
fn white_bodies_in_even_light_are_not_seen() {
    if !has_adapter() {
        return;
    }
    // A body that reflects all light looks like its uniform surroundings, whatever its shape: the furnace test.
    let nits = 100.0;
    let mut view = scenes::view([0.5, -0.7, 0.6], [0.0; 3], [32, 24], 40.0);
    let map = Arc::new(EnvironmentMap::constant([1.0; 3]));
    view.lights = vec![Light::Environment(EnvironmentLight { map, scale: [nits; 3], rotation: 0.3 })];
    let wants = [RADIANCE.id(), RADIANCE_VARIANCE.id(), INSTANCE.id()];
    let request = RenderRequest::new(&view, &wants, Stream::root(7), &Threads(2));
    for (metallic, roughness) in [(1.0, 0.4), (1.0, 0.0), (0.0, 0.5), (0.0, 0.1)] {
        let mut builder = SceneBuilder::default();
        builder.supports = Support::new("table", Region::rectangle([0.0; 3], [1.0, 1.0])).into();
        let mut object = (*scenes::object("cube", scenes::box_mesh([0.3; 3]), [1.0; 3])).clone();
        object.materials = vec![Arc::new(Material {
            metallic: Scalar::constant(metallic),
            ..Material::plain("white", [1.0; 3], roughness)
        })];
        builder.add(scenes::body(Arc::new(object), [0.0; 3], Role::Object));
        let scene = Arc::new(builder.freeze(SettleReport::default()).expect("sound"));
        let options = PathTracing { samples_per_pixel: 64, ..PathTracing::default() };
        let frames = [
            rendered(&CpuPathRenderer::new(options.clone()), &scene, &request),
            rendered(&GpuPathRenderer::new(options), &scene, &request),
        ];
        let (z2, ratio) = compare(&frames);
        let [_, gpu] = pair(&frames, RADIANCE);
        let [_, instances] = pair(&frames, INSTANCE);
        let of_cube: Vec<f32> = (gpu.data().iter().zip(instances.data()))
            .filter(|(_, id)| **id == InstanceId(1))
            .flat_map(|(color, _)| *color)
            .collect();
        let mean = of_cube.iter().map(|x| f64::from(*x)).sum::<f64>() / of_cube.len() as f64;
        println!("metallic {metallic}, roughness {roughness}: {mean:.3} nits, mean z² {z2:.5}, ratio {ratio:.6}");
        assert!(of_cube.len() > 300 && (mean / nits - 1.0).abs() < 5e-3, "{metallic} {roughness}: {mean}");
        assert!(z2 < 0.05 && (ratio - 1.0).abs() < 1e-3, "{metallic} {roughness}: {z2} {ratio}");
    }
}

#[test]
fn ray_queries_make_the_images_of_walks() {
    let there = Adapters::with_ray_queries(true).used().is_ok_and(|used| used[0].ray_queries == RayQueries::Used);
    // No ordinary software renderer has ray queries: only a run that asks for them requires them.
    if std::env::var("SYNTABLE_RAY_QUERIES").as_deref() != Ok("1") && !there {
        return eprintln!("skipped: no graphics adapter with ray queries");
    }
    if !is_there(there, "a graphics adapter with ray queries (Mesa's lavapipe 25)") {
        return;
    }
    // With thin glass, and few kernels: a software renderer takes longer to compile than to trace.
    let look = Look::Glass;
    let options = PathTracing { samples_per_pixel: 8, ..PathTracing::default() };
    let view = room::view(40, 30);
    let labels = [DEPTH.id(), INSTANCE.id(), COVERAGE.id(), NORMAL.id(), ALBEDO.id()];
    let light = [RADIANCE.id(), RADIANCE_VARIANCE.id()];
    let wants = [labels.as_slice(), &light].concat();
    let request = RenderRequest::new(&view, &wants, Stream::root(7), &Threads(2));
    let scene = room::scene_of(look);
    let mut sessions = [false, true].map(|queries| {
        let renderer = GpuPathRenderer::new(options.clone()).on(Adapters::with_ray_queries(queries));
        // The lock file of a dataset contains this name.
        assert_eq!(renderer.devices().expect("there")[0].name.contains(", ray queries"), queries);
        let mut session = renderer.open(0).expect("opens");
        session.load(&scene, &Threads(2)).expect("loads");
        session
    });
    let mut both = |request: &RenderRequest| {
        sessions.each_mut().map(|session| {
            let mut frame = Products::new();
            session.render(request, &mut frame).expect("renders");
            frame
        })
    };
    let frames = both(&request);
    let (z2, ratio) = compare(&frames);
    let unlike = different(pair(&frames, RADIANCE), |a, b| a != b);
    println!("mean z² {z2:.5}, ratio of means {ratio:.5}, {unlike} pixels are not the same to the bit");
    assert!(z2 < 0.05 && (ratio - 1.0).abs() < 5e-3, "{z2} {ratio}");
    macro_rules! same {
        ($frames:expr, $($key:ident),*) => {$({
            let [a, b] = pair($frames, $key);
            assert!(a == b, "{}", $key.name());
        })*};
    }
    // Labels always use walks, and so do views of some bodies.
    same!(&frames, DEPTH, INSTANCE, COVERAGE, NORMAL, ALBEDO);
    let (window, seen) = (Window::of(&view.camera.intrinsics), [InstanceId(3), InstanceId(5)]);
    let frames = both(&RenderRequest { wants: &light, ..request }.of(window, Bodies::Seen(&seen)));
    same!(&frames, RADIANCE, RADIANCE_VARIANCE);
}

#[test]
fn parts_of_the_scene_are_the_cpus() {
    if !has_adapter() {
        return;
    }
    let mut view = room::view(64, 48);
    let map = Arc::new(EnvironmentMap::constant([1.0, 1.5, 2.0]));
    view.lights.push(Light::Environment(EnvironmentLight { map, scale: [20.0; 3], rotation: 0.3 }));
    let options = PathTracing { samples_per_pixel: 16, ..PathTracing::default() };
    let scene = room::scene_of(Look::Mixed);
    let furniture: Vec<InstanceId> = scene.furniture().iter().map(|body| body.id).collect();
    let wants = keys![RADIANCE, RADIANCE_VARIANCE, OPACITY];
    let window = Window::of(&view.camera.intrinsics);
    for (bodies, background) in
        [(Bodies::Foreground, false), (Bodies::Seen(&furniture), true), (Bodies::Only(&[]), true)]
    {
        let request = RenderRequest::new(&view, &wants, Stream::root(9), &Threads(2)).of(window, bodies);
        let frames = both(&options, Look::Mixed, &RenderRequest { background, ..request });
        let opacity = different(pair(&frames, OPACITY), |a, b| (a - b).abs() > 1e-6);
        let (z2, ratio) = match bodies {
            // The sky alone, the same in all pixels.
            Bodies::Only(_) => {
                let unlike = different(pair(&frames, RADIANCE), |a, b| a != b || a.iter().any(|nits| *nits < 10.0));
                (unlike as f64, 1.0)
            }
            _ => compare(&frames),
        };
        println!("{bodies:?}: mean z² {z2:.5}, ratio of means {ratio:.5}, {opacity} opacities differ");
        assert!(z2 < 0.05 && (ratio - 1.0).abs() < 5e-3 && opacity <= 2, "{bodies:?}: {z2} {ratio} {opacity}");
        let mean = frames[0].get(OPACITY).expect("made").data().iter().sum::<f32>() / (64.0 * 48.0);
        assert!(background || (0.05..0.95).contains(&mean), "{mean} of the image is foreground");
    }
}

#[test]
fn options_mean_what_they_mean_on_the_cpu() {
    if !has_adapter() {
        return;
    }
    let view = room::view(48, 36);
    let wants = [RADIANCE.id(), RADIANCE_VARIANCE.id()];
    let request = RenderRequest::new(&view, &wants, Stream::root(7), &Threads(2));
    let usual = PathTracing { samples_per_pixel: 16, ..PathTracing::default() };
    for (name, look, options) in [
        ("direct light", Look::Mixed, PathTracing { max_bounces: 1, ..usual.clone() }),
        ("many bounces", Look::Glass, PathTracing { max_bounces: 40, russian_roulette_from: 30, ..usual.clone() }),
        ("a limit", Look::Metal, PathTracing { max_indirect_luminance_nits: Some(5.0), ..usual.clone() }),
        ("regularize", Look::Metal, PathTracing { regularize: 0.3, ..usual.clone() }),
        ("plain", Look::Plastic, PathTracing { dielectrics: Dielectrics::Gltf, ..usual.clone() }),
        ("box filter", Look::Mixed, PathTracing { pixel_filter: PixelFilter::Box, ..usual.clone() }),
        ("noise", Look::Mixed, PathTracing { noise: Some(0.1), samples_per_pixel: 64, ..usual.clone() }),
    ] {
        let (z2, ratio) = compare(&both(&options, look, &request));
        println!("{name}: mean z² {z2:.5}, ratio of means {ratio:.5}");
        assert!(z2 < 0.05 && (ratio - 1.0).abs() < 5e-3, "{name}: {z2} {ratio}");
    }
}

#[test]
fn the_same_device_makes_the_same_bytes() {
    if !has_adapter() {
        return;
    }
    let scene = room::scene_of(Look::Glass);
    let view = room::view(64, 48);
    let wants = [RADIANCE.id()];
    let request = RenderRequest::new(&view, &wants, Stream::root(7), &Threads(2));
    let options = PathTracing { samples_per_pixel: 8, ..PathTracing::default() };
    let images = [0, 1].map(|session| {
        let renderer = GpuPathRenderer::new(options.clone());
        let mut session = renderer.open(session).expect("opens");
        session.load(&scene, &Threads(2)).expect("loads");
        [0, 1].map(|_| {
            let mut frame = Products::new();
            session.render(&request, &mut frame).expect("renders");
            frame.get(RADIANCE).expect("made").clone()
        })
    });
    let all = images.as_flattened();
    assert!(all.iter().all(|image| image.data() == all[0].data()));
}

/// A cache in memory.
#[derive(Default)]
struct Memory(Mutex<BTreeMap<(String, String), Vec<u8>>>);

impl Cache for Memory {
    fn get(&self, purpose: &str, key: Digest) -> Option<Vec<u8>> {
        self.0.lock().get(&(purpose.to_owned(), key.to_string())).cloned()
    }

    fn put(&self, purpose: &str, key: Digest, bytes: &[u8]) {
        self.0.lock().insert((purpose.to_owned(), key.to_string()), bytes.to_vec());
    }
}

#[test]
fn kept_machine_code_makes_the_same_bytes_and_other_bytes_are_compiled_again() {
    if !has_adapter() {
        return;
    }
    let (scene, view, cache) = (room::scene_of(Look::Plastic), room::view(16, 12), Memory::default());
    let (wants, denoiser) = ([RADIANCE.id(), DEPTH.id()], Guided::default());
    let options = PathTracing { samples_per_pixel: 2, ..PathTracing::default() };
    let render = || {
        let request = RenderRequest {
            cache: &cache,
            denoiser: Some(&denoiser),
            ..RenderRequest::new(&view, &wants, Stream::root(7), &Threads(2))
        };
        let mut session = GpuPathRenderer::new(options.clone()).open(0).expect("opens");
        session.load(&scene, &Threads(2)).expect("loads");
        let mut frame = Products::new();
        session.render(&request, &mut frame).expect("renders");
        frame.get(RADIANCE).expect("made").clone()
    };
    let compiled = render();
    let kept = cache.0.lock().clone();
    if kept.is_empty() {
        println!("skipped: the adapter gives no machine code");
        return;
    }
    assert_eq!(render().data(), compiled.data());
    assert!(cache.0.lock().keys().eq(kept.keys()), "the same kernels have the same keys");
    for code in cache.0.lock().values_mut() {
        *code = b"not machine code".to_vec();
    }
    assert_eq!(render().data(), compiled.data());
    assert!(cache.0.lock().values().all(|code| code != b"not machine code"), "new code replaces the old");
}

/// Products of one value per pixel.
const PLANES: [KeyId; 10] = [
    RADIANCE.id(),
    RADIANCE_VARIANCE.id(),
    OPACITY.id(),
    DEPTH.id(),
    INSTANCE.id(),
    NORMAL.id(),
    ALBEDO.id(),
    DENOISE_ALBEDO.id(),
    RADIANCE_SPECULAR.id(),
    RADIANCE_DEMODULATED.id(),
];

/// Pixels of an atlas that are in no tile.
fn nobodys(atlas: &Atlas) -> Vec<usize> {
    let [width, height] = atlas.size;
    let mut free = Plane::from_fn(width, height, |_, _| true);
    for tile in &atlas.tiles {
        free.paste(tile.at, &Plane::from_fn(tile.window.width, tile.window.height, |_, _| false));
    }
    (0..free.data().len()).filter(|&pixel| free.data()[pixel]).collect()
}

#[test]
fn a_tile_is_the_window_of_its_object() {
    if !has_adapter() {
        return;
    }
    let mut curved = room::view(64, 48);
    curved.camera.distortion = Some(syntable_model::scene::Distortion::brown_conrady([-0.1, 0.02, 0.0], [1e-3, -2e-3]));
    let straight = room::view(64, 48);
    // A fixed number of samples, and rounds of them.
    let fixed = PathTracing { samples_per_pixel: 4, max_bounces: 4, ..PathTracing::default() };
    let rounds = PathTracing { noise: Some(1e-9), ..fixed.clone() };
    for (options, view, look, lighting) in [
        (&fixed, &straight, Look::Mixed, Lighting::InScene),
        (&fixed, &straight, Look::Glass, Lighting::Alone),
        (&fixed, &curved, Look::Plastic, Lighting::Alone),
        (&rounds, &straight, Look::Mixed, Lighting::Alone),
    ] {
        let scene = room::scene_of(look);
        let coverage = both(options, look, &RenderRequest::new(view, &[COVERAGE.id()], Stream::root(7), &Threads(2)));
        let atlas = Atlas::of(coverage[1].get(COVERAGE).expect("made"));
        assert!(atlas.tiles.len() >= 4, "{atlas:?}");
        let request = RenderRequest::new(view, &PLANES, Stream::root(7), &Threads(2));
        let frames = both(options, look, &request.clone().of_objects(&atlas, lighting));
        // Equal to the CPU's image, except for rounding.
        let (z2, ratio) = compare(&frames);
        let opacity = different(pair(&frames, OPACITY), |a, b| (a - b).abs() > 1e-6);
        let nothing = different(pair(&frames, DEPTH), |a, b| a.is_finite() != b.is_finite());
        assert!(nothing <= 2, "{nothing} depths");
        println!("{look:?} {lighting:?}: mean z² {z2:.5}, ratio of means {ratio:.5}, {opacity} opacities differ");
        assert!(z2 < 0.05 && (ratio - 1.0).abs() < 5e-3 && opacity <= 2, "{look:?}: {z2} {ratio} {opacity}");
        let between = nobodys(&atlas);
        let variance = frames.each_ref().map(|frame| frame.get(RADIANCE_VARIANCE).expect("made"));
        assert!(between.iter().all(|&pixel| variance.iter().all(|plane| plane.data()[pixel] == 0.0)), "{look:?}");
        let mut session = GpuPathRenderer::new(options.clone()).open(0).expect("opens");
        session.load(&scene, &Threads(2)).expect("loads");
        for tile in &atlas.tiles {
            let ids = [tile.id];
            let bodies = match lighting {
                Lighting::Alone => Bodies::Only(&ids),
                Lighting::InScene => Bodies::Seen(&ids),
            };
            let request = RenderRequest { background: false, ..request.clone().of(tile.window, bodies) };
            let mut alone = Products::new();
            session.render(&request, &mut alone).expect("renders");
            macro_rules! same {
                ($($key:ident),*) => {$({
                    let part = Atlas::cut(frames[1].get($key).expect("made"), tile);
                    assert!(part == *alone.get($key).expect("made"), "{} of {ids:?}, {look:?}", $key.name());
                })*};
            }
            same!(RADIANCE, RADIANCE_VARIANCE, OPACITY, DEPTH, INSTANCE, NORMAL, ALBEDO, DENOISE_ALBEDO);
            same!(RADIANCE_SPECULAR, RADIANCE_DEMODULATED);
        }
    }
}

/// Mean square of the difference between `a` and `b`, divided by the mean square for images with other random numbers.
/// 1 means that they are independent.
fn noise_between(a: &Plane<[f32; 3]>, b: &Plane<[f32; 3]>, other: &Plane<[f32; 3]>) -> f64 {
    let square = |x: &Plane<[f32; 3]>, y: &Plane<[f32; 3]>| -> f64 {
        let pairs = x.data().as_flattened().iter().zip(y.data().as_flattened());
        pairs.map(|(&x, &y)| f64::from(x - y).powi(2)).sum()
    };
    square(a, b) / square(a, other)
}

#[test]
fn components_of_light_match_the_cpu() {
    if !has_adapter() {
        return;
    }
    let wants = [RADIANCE.id(), RADIANCE_DIRECT.id(), RADIANCE_INDIRECT.id(), RADIANCE_UNSHADOWED.id()];
    let fixed = PathTracing { samples_per_pixel: 4, max_bounces: 4, ..PathTracing::default() };
    let rounds = PathTracing { noise: Some(1e-9), ..fixed.clone() };
    for (options, look) in [(&fixed, Look::Mixed), (&fixed, Look::Glass), (&rounds, Look::Plastic)] {
        let view = room::view(64, 48);
        let request = |seed| RenderRequest::new(&view, &wants, Stream::root(seed), &Threads(2));
        let frames = both(options, look, &request(7));
        let other = rendered(&CpuPathRenderer::new(options.clone()), &room::scene_of(look), &request(8));
        let mean = |frame: &Products, key: Key<Plane<[f32; 3]>>| {
            let data = frame.get(key).expect("made").data();
            data.iter().flatten().map(|x| f64::from(*x)).sum::<f64>() / data.len() as f64
        };
        for key in [RADIANCE_DIRECT, RADIANCE_INDIRECT, RADIANCE_UNSHADOWED] {
            let [cpu, gpu] = frames.each_ref().map(|frame| mean(frame, key));
            println!("{look:?} {}: {cpu} {gpu}", key.name());
            assert!((gpu / cpu - 1.0).abs() < 5e-3, "{look:?} {}: {cpu} {gpu}", key.name());
            // Both use the same random numbers, as for the whole light; they differ where rounding sends a path
            // elsewhere.
            let share = noise_between(
                frames[0].get(key).expect("made"),
                frames[1].get(key).expect("made"),
                other.get(key).expect("made"),
            );
            println!("{look:?} {}: {share:.5} of the noise", key.name());
            assert!(share < 0.02, "{look:?} {}: {share}", key.name());
        }
        let [all, direct, unshadowed] =
            [RADIANCE, RADIANCE_DIRECT, RADIANCE_UNSHADOWED].map(|key| mean(&frames[1], key));
        assert!(direct < all && direct < unshadowed, "{look:?}: {all} {direct} {unshadowed}");
    }
}
