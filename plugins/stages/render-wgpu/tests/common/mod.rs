//! Images with all guides, and the denoiser on a card.

use std::sync::Arc;
use syntable_guided::Guided;
use syntable_model::context::{Collected, DatasetContext, Workers};
use syntable_model::prelude::*;
use syntable_model::product::Plane;
use syntable_model::product::standard::*;
use syntable_render_cpu::CpuPathRenderer;
use syntable_render_wgpu::{Adapters, Device, GuidedFilter, Sections};
use syntable_testing::scenes;
use syntable_testing::workers::Threads;
use syntable_transport::PathTracing;

pub type Rgb = [f32; 3];

/// The kernels treat this number as infinity.
pub const FAR: f32 = 3.0e38;

/// The filter on an adapter.
pub struct Card {
    pub device: Arc<Device>,
    pub filter: GuidedFilter,
}

/// An image on a card.
pub struct Uploaded {
    pub size: [u32; 2],
    pub input: wgpu::Buffer,
    pub sections: Sections,
}

impl Card {
    /// Opens an adapter by its index.
    pub fn open(adapter: usize) -> Self {
        let device = Arc::new(Device::open(&Adapters::find(), adapter).expect("opens"));
        let filter = GuidedFilter::new(device.clone()).expect("compiles");
        Self { device, filter }
    }

    /// Writes the planes of an image; no plane starts at the start of the buffer.
    pub fn upload(&self, products: &Products) -> Uploaded {
        let radiance = products.get(RADIANCE_NOISY).expect("put");
        let size = [radiance.width(), radiance.height()];
        let mut words = vec![7_u32; 5];
        let mut section = |plane: &mut dyn Iterator<Item = u32>| {
            let first = words.len() as u32;
            words.extend(plane);
            words.push(9);
            first
        };
        let bounded = |x: &f32| if x.abs() < FAR { x.to_bits() } else { FAR.copysign(*x).to_bits() };
        let mut colors = |key: Key<Plane<Rgb>>| {
            section(&mut products.get(key).expect("put").data().as_flattened().iter().map(bounded))
        };
        let [radiance, specular, demodulated] =
            [RADIANCE_NOISY, RADIANCE_SPECULAR, RADIANCE_DEMODULATED].map(&mut colors);
        let [albedo, normal] = [DENOISE_ALBEDO, DENOISE_NORMAL].map(colors);
        let [specular_variance, demodulated_variance] = [RADIANCE_SPECULAR_VARIANCE, RADIANCE_DEMODULATED_VARIANCE]
            .map(|key| {
                let plane = products.get(key).expect("put").data();
                plane.iter().any(|v| v.is_finite()).then(|| section(&mut plane.iter().map(bounded)))
            });
        let depth = section(&mut products.get(DEPTH).expect("put").data().iter().map(bounded));
        let instance = section(&mut products.get(INSTANCE).expect("put").data().iter().map(|id| u32::from(id.0)));
        let sections = Sections {
            radiance,
            specular,
            specular_variance,
            demodulated,
            demodulated_variance,
            albedo,
            normal,
            depth,
            instance,
        };

        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let input = self.device.storage("planes", bytes.len() as u64).expect("room");
        self.device.write(&input, 0, &bytes);
        Uploaded { size, input, sections }
    }

    /// The filtered image of products.
    pub fn filtered(&mut self, options: &Guided, products: &Products) -> Vec<Rgb> {
        let Uploaded { size, input, sections } = self.upload(products);
        let device = &self.device;
        let before = 3_u32;
        let count = u64::from(before) + 3 * u64::from(size[0]) * u64::from(size[1]) + 1;
        let output = device.storage("image", 4 * count).expect("room");
        let through = device.readable("image", 4 * count).expect("room");
        device.write(&output, 0, &vec![0x42; 4 * count as usize]);
        let mut encoder = device.encoder();
        self.filter.record(&mut encoder, size, &input, sections, options, (&output, before)).expect("records");
        encoder.copy_buffer_to_buffer(&output, 0, &through, 0, 4 * count);
        device
            .read(encoder, &through, count, |words: &[f32]| {
                let around = f32::from_bits(0x4242_4242);
                let (head, image) = words.split_at(before as usize);
                let (image, tail) = image.split_at(image.len() - 1);
                assert!(head.iter().chain(tail).all(|&word| word == around), "it writes beside the image");
                image.as_chunks().0.to_vec()
            })
            .expect("runs")
    }
}

/// The same image, filtered on the CPU.
pub fn reference(options: &Guided, products: &Products, workers: &dyn Workers) -> Vec<Rgb> {
    let (dataset, scene) = (scenes::dataset(), scenes::boxes(&[([0.0, 0.0, 0.5], [1.0; 3])]));
    let (view, log) = (scenes::view([0.0, -1.0, 1.0], [0.0; 3], [8, 8], 60.0), Collected::default());
    let cx = DatasetContext::new(&dataset, workers, &log).scene(&scene).view(&view);
    let mut products = products.clone();
    options.clone().build().expect("sound options").denoise(&cx, &mut products).expect("denoises");
    products.get(RADIANCE).expect("provided").data().to_vec()
}

/// The noisy image with all guides.
pub fn render(scene: &Arc<Scene>, view: &View, samples_per_pixel: u32) -> Products {
    // Inputs of the filter, under the renderer's names.
    let of_renderer = |key: KeyId| if key == RADIANCE_NOISY.id() { RADIANCE.id() } else { key };
    let wants: Vec<KeyId> = Guided::default().reads().into_iter().map(of_renderer).collect();
    let options = PathTracing { samples_per_pixel, regularize: 0.3, ..PathTracing::default() };
    let mut session = CpuPathRenderer::new(options).session();
    session.load(scene, &Threads(2)).expect("loads");
    let mut products = Products::new();
    session.render(&RenderRequest::new(view, &wants, Stream::root(5), &Threads(2)), &mut products).expect("renders");
    products.rename(RADIANCE.id(), RADIANCE_NOISY.id()).expect("not there yet");
    products
}
