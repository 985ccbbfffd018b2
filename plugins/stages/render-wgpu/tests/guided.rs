//! Compares the denoiser on the GPU with the same denoiser on the CPU.
//!
//! Needs an adapter, as the tests of the renderer do.

mod common;

use common::{Card, FAR, Rgb, render};
use std::sync::Arc;
use syntable_guided::Guided;
use syntable_model::prelude::*;
use syntable_model::product::standard::*;
use syntable_model::product::{Lighting, Plane};
use syntable_model::scene::{EnvironmentLight, EnvironmentMap, Light};
use syntable_render_wgpu::{Adapters, GpuPathRenderer, Sections};
use syntable_testing::room::{self, Look};
use syntable_testing::scenes;
use syntable_testing::tools::is_there;
use syntable_testing::workers::Threads;
use syntable_transport::PathTracing;

/// The filter on the first adapter, if any adapter exists.
fn find_card() -> Option<Card> {
    is_there(Adapters::find().used().is_ok(), "a graphics adapter (mesa-vulkan-drivers)").then(|| Card::open(0))
}

fn reference(options: &Guided, products: &Products) -> Vec<Rgb> {
    common::reference(options, products, &Threads(2))
}

/// Boxes on a slab under the open sky, seen from so low that its far edge is against the sky.
fn open_air(width: u32, height: u32) -> (Arc<Scene>, View) {
    let scene = scenes::boxes(&[([0.0, 0.0, 0.25], [0.5; 3]), ([0.5, 0.3, 0.1], [0.2; 3])]);
    let mut view = scenes::view([0.4, -2.0, 0.6], [0.0, 0.0, 0.3], [width, height], 60.0);
    let map = Arc::new(EnvironmentMap::constant([1.0, 1.2, 1.6]));
    view.lights.push(Light::Environment(EnvironmentLight { map, scale: [20.0; 3], rotation: 0.0 }));
    (Arc::new(scene), view)
}

fn luminance(c: Rgb) -> f64 {
    syntable_model::photometry::luminance(c.map(f64::from))
}

/// Number of pixels that differ by more than a thousandth, and the relative difference of the means.
fn compare(a: &[Rgb], b: &[Rgb]) -> (usize, f64) {
    assert_eq!(a.len(), b.len());
    let differ = |(a, b): &(&Rgb, &Rgb)| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-3 * a[c].abs().max(b[c].abs()));
    let sum = |image: &[Rgb]| image.iter().map(|&p| luminance(p)).sum::<f64>();
    (a.iter().zip(b).filter(differ).count(), sum(b) / sum(a) - 1.0)
}

/// Compares the image of the card with the image of the processor.
fn assert_alike(name: &str, card: &mut Card, options: &Guided, products: &Products) {
    let (a, b) = (reference(options, products), card.filtered(options, products));
    let (differ, off) = compare(&a, &b);
    println!("{name}: {differ} of {} pixels differ, the mean by {off:.1e}", a.len());
    assert!(b.iter().flatten().all(|x| x.is_finite()), "{name}");
    assert!(differ * 1000 <= a.len() && off.abs() < 1e-4, "{name}: {differ} of {} pixels, mean {off}", a.len());
    // The comparison would not see a filter that does nothing.
    let before = products.get(RADIANCE_NOISY).expect("put").data();
    assert!(a.len() < 100 || compare(&a, before).0 * 2 > a.len(), "{name}: the filter changes little");
}

#[test]
fn rooms_are_the_processors() {
    let Some(mut card) = find_card() else { return };
    for (look, samples) in [(Look::Mixed, 2), (Look::Mixed, 8), (Look::Glass, 2), (Look::Glass, 8), (Look::Metal, 4)] {
        let products = render(&room::scene_of(look), &room::view(160, 120), samples);
        assert_alike(&format!("{look:?}, {samples} samples"), &mut card, &Guided::default(), &products);
    }
}

#[test]
fn the_edge_of_the_sky_is_the_processors() {
    let Some(mut card) = find_card() else { return };
    let (scene, view) = open_air(150, 110);
    for samples in [1, 2, 8] {
        let products = render(&scene, &view, samples);
        let sky = products.get(INSTANCE).expect("put").data().iter().filter(|id| id.0 == 0).count();
        assert!((1_000..15_000).contains(&sky), "{sky} pixels of sky");
        let (a, b) = (reference(&Guided::default(), &products), card.filtered(&Guided::default(), &products));
        let (differ, off) = compare(&a, &b);
        println!("open air, {samples} samples: {differ} of {} pixels differ, the mean by {off:.1e}", a.len());
        assert!(differ * 1000 <= a.len() && off.abs() < 1e-4, "{samples} samples: {differ} pixels, mean {off}");
    }
}

#[test]
fn options_mean_what_they_mean_on_the_processor() {
    let Some(mut card) = find_card() else { return };
    let products = render(&room::scene(), &room::view(96, 72), 4);
    for (strength, levels) in [(0.1, 4), (10.0, 4), (1.0, 1), (1.0, 2), (1.0, 3), (2.0, 5)] {
        let name = format!("strength {strength}, {levels} levels");
        assert_alike(&name, &mut card, &Guided { strength, levels }, &products);
    }
}

#[test]
fn any_size_and_unknown_variance() {
    let Some(mut card) = find_card() else { return };
    for (width, height) in [(37, 23), (1, 1), (640, 3), (3, 200), (129, 65), (32, 33)] {
        for samples in [1, 3] {
            let products = render(&room::scene(), &room::view(width, height), samples);
            let name = format!("{width} × {height}, {samples} samples");
            assert_alike(&name, &mut card, &Guided::default(), &products);
        }
    }
}

#[test]
fn the_same_device_makes_the_same_bytes() {
    let (Some(mut card), Some(mut other)) = (find_card(), find_card()) else { return };
    let products = render(&room::scene_of(Look::Glass), &room::view(131, 77), 2);
    let small = render(&room::scene(), &room::view(20, 10), 2);
    let one = card.filtered(&Guided::default(), &products);
    // Filtering another image before changes nothing.
    card.filtered(&Guided { strength: 3.0, levels: 5 }, &small);
    assert!(
        one == card.filtered(&Guided::default(), &products) && one == other.filtered(&Guided::default(), &products)
    );
}

#[test]
fn odd_pixels_are_the_processors() {
    let Some(mut card) = find_card() else { return };
    let mut stream = Stream::root(1);
    let plain = |_: u32, _: u32| [10.0_f32 * (0.5 + stream.uniform(0.0, 1.0) as f32); 3];
    let mut radiance = Plane::from_fn(40, 40, plain);
    let mut albedo = Plane::from_fn(40, 40, |x, _| [0.2 + 0.01 * x as f32; 3]);
    let mut normal = Plane::from_fn(40, 40, |_, _| [0.0, 0.0, -1.0_f32]);
    let mut depth = Plane::from_fn(40, 40, |x, y| 2.0 + 0.01 * (x + y) as f32);
    let mut instance = Plane::from_fn(40, 40, |x, _| InstanceId(1 + (x / 17) as u16));
    let mut variance = Plane::from_fn(40, 40, |_, _| 8.0_f32);
    let at = |x: usize, y: usize| y * 40 + x;
    radiance.data_mut()[at(20, 5)] = [f32::INFINITY, 1.0, 1.0];
    radiance.data_mut()[at(37, 37)] = [2e38; 3];
    radiance.data_mut()[at(12, 12)] = [1e15; 3];
    radiance.data_mut()[at(25, 9)] = [0.0; 3];
    radiance.data_mut()[at(27, 9)] = [4000.0; 3];
    radiance.data_mut()[at(20, 20)] = [5e4; 3];
    (depth.data_mut()[at(20, 20)], instance.data_mut()[at(20, 20)]) = (f32::INFINITY, InstanceId(0));
    // Beside the light: a surface in part, and a whole one.
    normal.data_mut()[at(21, 20)] = [0.0, 0.0, -0.5];
    normal.data_mut()[at(5, 30)] = [0.0, 0.0, -0.5];
    normal.data_mut()[at(30, 30)] = [f32::INFINITY, 3.0, -1.0];
    albedo.data_mut()[at(10, 30)] = [f32::INFINITY, 2.0, -1.0];
    variance.data_mut()[at(10, 30)] = f32::INFINITY;
    variance.data_mut()[at(11, 30)] = -1.0;
    depth.data_mut()[at(35, 10)] = 0.0;
    let mut products = Products::new();
    let over = |x: u32, y: u32| {
        let (light, albedo) = (radiance.at(x, y), albedo.at(x, y));
        std::array::from_fn(|c| 0.8 * light[c] / (albedo[c].clamp(0.0, 1.0) + DEMODULATION_EPSILON))
    };
    products.put(RADIANCE_DEMODULATED, Plane::from_fn(40, 40, over)).expect("new");
    products.put(RADIANCE_DEMODULATED_VARIANCE, variance.clone()).expect("new");
    products.put(RADIANCE_SPECULAR, radiance.map(|light| light.map(|x| 0.2 * x))).expect("new");
    products.put(RADIANCE_SPECULAR_VARIANCE, variance).expect("new");
    products.put(RADIANCE_NOISY, radiance).expect("new");
    products.put(DENOISE_ALBEDO, albedo).expect("new");
    products.put(DENOISE_NORMAL, normal).expect("new");
    products.put(DEPTH, depth).expect("new");
    products.put(INSTANCE, instance).expect("new");
    let (a, b) = (reference(&Guided::default(), &products), card.filtered(&Guided::default(), &products));
    for (number, (a, b)) in a.iter().zip(&b).enumerate() {
        let (x, y) = (number % 40, number / 40);
        // Infinite numbers stay infinite; the device writes them as `FAR`.
        let same = |c: usize| a[c].min(FAR) == b[c] || (a[c] - b[c]).abs() <= 1e-3 * a[c].min(FAR);
        assert!((0..3).all(same), "pixel {x}, {y}: {a:?} on the processor, {b:?}");
    }
    assert_eq!(b[at(20, 20)], [5e4; 3], "a light passes");
}

#[test]
fn planes_beyond_their_buffer_are_an_error() {
    let Some(mut card) = find_card() else { return };
    let [input, output] = ["input", "output"].map(|label| card.device.storage(label, 4 * 17 * 64).expect("room"));
    let sections = Sections {
        radiance: 0,
        specular: 3 * 64,
        specular_variance: None,
        demodulated: 6 * 64,
        demodulated_variance: Some(16 * 64),
        albedo: 9 * 64,
        normal: 12 * 64,
        depth: 15 * 64,
        instance: 15 * 64,
    };
    let options = Guided::default();
    let mut record = |sections, first| {
        let mut encoder = card.device.encoder();
        card.filter.record(&mut encoder, [8, 8], &input, sections, &options, (&output, first))
    };
    record(sections, 14 * 64).expect("fits");
    assert!(record(sections, 14 * 64 + 1).is_err());
    assert!(record(Sections { demodulated_variance: Some(16 * 64 + 1), ..sections }, 0).is_err());
    assert!(record(Sections { normal: u32::MAX - 3, ..sections }, 0).is_err());
}

#[test]
fn the_denoiser_sees_what_was_rendered() {
    if find_card().is_none() {
        return;
    }
    // The same image, denoised on the device, denoised on the processor from its products, and denoised alone. Then the
    // same for all objects side by side.
    let (view, guided) = (room::view(60, 44), Guided::default());
    let (mut wants, provides) = (guided.reads(), guided.provides());
    wants.extend(provides.iter().copied());
    for (samples, look, of_objects) in [(1, Look::Mixed, false), (4, Look::Glass, false), (4, Look::Mixed, true)] {
        let renderer = GpuPathRenderer::new(PathTracing { samples_per_pixel: samples, ..PathTracing::default() });
        assert!(renderer.denoises(&guided));
        let mut session = renderer.open(0).expect("opens");
        session.load(&room::scene_of(look), &Threads(2)).expect("loads");
        let mut covered = Products::new();
        let coverage = [COVERAGE.id()];
        let request = RenderRequest::new(&view, &coverage, Stream::root(5), &Threads(2));
        session.render(&request, &mut covered).expect("renders");
        let atlas = Atlas::of(covered.get(COVERAGE).expect("made"));
        let mut render = |wants: &[KeyId]| {
            let request = RenderRequest::new(&view, wants, Stream::root(5), &Threads(2));
            let request = if of_objects { request.of_objects(&atlas, Lighting::InScene) } else { request };
            let mut frame = Products::new();
            session.render(&RenderRequest { denoiser: Some(&guided), ..request }, &mut frame).expect("renders");
            frame
        };
        let (all, alone) = (render(&wants), render(&[RADIANCE.id()]));
        let on_device = all.get(RADIANCE).expect("made");
        assert_eq!(alone.get(RADIANCE).expect("made"), on_device);
        assert!(!alone.contains(&RADIANCE_NOISY.id()) && all.contains(&DENOISER.id()));
        let read: Vec<_> = guided.reads().iter().map(|key| key.product_id()).collect();
        let on_processor = reference(&guided, &all.only(&read));
        let differ = |a: [f32; 3], b: [f32; 3]| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-3 * (b[c] + 1e-3));
        let count = on_device.data().iter().zip(&on_processor).filter(|&(&a, &b)| differ(a, b)).count();
        assert!(count <= 2, "{count} pixels of {samples} samples of {look:?} differ");
        assert!(on_device != all.get(RADIANCE_NOISY).expect("made"), "it was denoised");
    }
    let adaptive = GpuPathRenderer::new(PathTracing { noise: Some(0.1), ..PathTracing::default() });
    assert!(!adaptive.denoises(&guided), "rounds of samples end on the processor");
}
