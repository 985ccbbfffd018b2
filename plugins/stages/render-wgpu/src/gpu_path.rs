//! `gpu_path`: the path tracer of a graphics card as a stage.

use crate::adapters::{AdapterInfo, Adapters};
use crate::device::Device;
use crate::guided::guided_of;
use crate::session::{Caches, GpuSession};
use parking_lot::Mutex;
use std::sync::{Arc, OnceLock};
use syntable_model::context::Workers;
use syntable_model::prelude::*;
use syntable_model::stage::RenderDevice;
use syntable_transport::components::{self, Light};
use syntable_transport::{PathTracing, path_tracing_kind};

path_tracing_kind! {
    /// Path tracing on a graphics card, by Vulkan, Metal or DirectX 12: the images of `cpu_path` up to rounding, and its
    /// labels. The same card and driver make the same bytes.
    GpuPath
}

impl Config for GpuPath {
    type Stage = dyn Renderer;
    const KIND: &'static str = "gpu_path";
    const EXAMPLE: &'static str = "samples_per_pixel = 64\nmax_bounces = 8";

    fn build(self) -> Result<Box<dyn Renderer>, ConfigError> {
        Ok(Box::new(GpuPathRenderer::new(self.0)))
    }
}

/// The renderer of [`GpuPath`].
pub struct GpuPathRenderer {
    options: PathTracing,
    caches: Arc<Caches>,
    /// The adapters, looked for once.
    adapters: OnceLock<Adapters>,
    /// Opened devices, by index of the adapter.
    devices: Mutex<Vec<Option<Arc<Device>>>>,
}

impl GpuPathRenderer {
    /// Builds the renderer; opens no device. The options must be within the limits of their schema.
    pub fn new(options: PathTracing) -> Self {
        Self { options, caches: Arc::default(), adapters: OnceLock::new(), devices: Mutex::default() }
    }

    /// Renders on adapters that were found before.
    pub fn on(self, adapters: Adapters) -> Self {
        Self { adapters: adapters.into(), ..self }
    }

    fn adapters(&self) -> &Adapters {
        self.adapters.get_or_init(Adapters::find)
    }

    /// Number of adapters that render; at least one. If none exists, opening it fails.
    fn number_of_adapters(&self) -> usize {
        self.adapters().used().map_or(1, |used| used.len())
    }

    /// The device of an adapter.
    fn device(&self, number: usize) -> Result<Arc<Device>> {
        let mut devices = self.devices.lock();
        if devices.len() <= number {
            devices.resize(number + 1, None);
        }
        // A failed device stays failed for its sessions; the next session opens a new one.
        if let Some(device) = devices[number].as_ref().filter(|device| !device.has_failed()) {
            return Ok(device.clone());
        }
        let device = Arc::new(Device::open(self.adapters(), number)?);
        devices[number] = Some(device.clone());
        Ok(device)
    }

    /// Opens a session of the concrete type on the adapter of an index.
    pub(crate) fn session(&self, adapter: usize) -> Result<GpuSession> {
        GpuSession::new(self.device(adapter)?, self.options.clone(), self.caches.clone())
    }
}

impl Renderer for GpuPathRenderer {
    fn offers(&self) -> Vec<KeyId> {
        components::offers()
    }

    fn max_sessions(&self) -> Option<usize> {
        let sessions = |used: Vec<AdapterInfo>| used.iter().map(AdapterInfo::sessions).sum();
        Some(self.adapters().used().map_or(1, sessions))
    }

    fn devices(&self) -> Result<Vec<RenderDevice>> {
        self.adapters().devices()
    }

    fn unused_devices(&self) -> Vec<String> {
        self.adapters().unused()
    }

    fn denoises(&self, denoiser: &dyn Denoiser) -> bool {
        // The host decides when rounds of samples end.
        self.options.budget(Light::All).is_fixed() && guided_of(Some(denoiser)).is_some()
    }

    fn open(&self, index: usize) -> Result<Box<dyn RenderSession>> {
        Ok(Box::new(self.session(index % self.number_of_adapters())?))
    }

    fn label_surface(&self) -> LabelSurface {
        self.options.blended_labels.surface()
    }

    fn samples_per_pixel(&self) -> Option<u32> {
        Some(self.options.samples_per_pixel)
    }

    fn cost(&self) -> String {
        self.options.cost()
    }
}

impl RenderSession for GpuSession {
    fn load(&mut self, scene: &Arc<Scene>, workers: &dyn Workers) -> Result<()> {
        Self::load(self, scene, workers)
    }

    fn render(&mut self, request: &RenderRequest, frame: &mut Products) -> Result<()> {
        Self::render(self, request, frame).map(|_| ())
    }
}

register!(GpuPath);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{Kernel, Variant};
    use std::time::{Duration, Instant};
    use syntable_model::product::standard::RADIANCE;
    use syntable_testing::room::{self, Look};
    use syntable_testing::tools::is_there;
    use syntable_testing::workers::Threads;

    /// A kernel that runs for `turns` turns, and ends. Turns are long, since software renderers end a loop after
    /// 65,535.
    fn long_kernel(device: &Device, turns: u32) -> wgpu::ComputePipeline {
        let turn = "word = (word ^ (word >> 15u)) * 0x2c1b3c6du + i;\n".repeat(512);
        let added = format!(
            "
@compute @workgroup_size(GROUP)
fn long(@builtin(global_invocation_id) id: vec3<u32>) {{
    var word = id.x;
    for (var i = 0u; i < {turns}u; i++) {{
        {turn}
    }}
    if word == 0u {{
        output[0] = 1u;
    }}
}}"
        );
        device.kernel_of(&added, "long", Variant::default())
    }

    #[test]
    fn a_kernel_that_hangs_fails_its_scene_and_the_next_one_renders() {
        let renderer = GpuPathRenderer::new(PathTracing { samples_per_pixel: 4, ..PathTracing::default() });
        if !is_there(renderer.devices().is_ok(), "a graphics adapter") {
            return;
        }
        let (scene, view, wants) = (room::scene_of(Look::Mixed), room::view(48, 40), [RADIANCE.id()]);
        let request = RenderRequest::new(&view, &wants, Stream::root(3), &Threads(2));
        let open = || {
            let mut session = renderer.session(0).expect("opens");
            session.load(&scene, &Threads(2)).expect("loads");
            session
        };
        let render = |session: &mut GpuSession| {
            let mut products = Products::new();
            session.render(&request, &mut products).and_then(|_| Ok(products.get(RADIANCE)?.data().to_vec()))
        };
        let mut session = open();
        let image = render(&mut session).expect("renders");
        let device = session.device.clone();
        // Replaces the last kernel of an image. Measures its time here; the first run also compiles it.
        let mut took = Duration::ZERO;
        const TURNS: u32 = 4000;
        device.replace(Kernel::Resolve, &long_kernel(&device, TURNS));
        for _ in 0..2 {
            let start = Instant::now();
            render(&mut session).expect("it takes no longer than sessions wait");
            took = start.elapsed();
        }
        let hangs = Duration::from_secs(8);
        let turns = (f64::from(TURNS) * hangs.as_secs_f64() / took.as_secs_f64()).ceil() as u32;
        device.replace(Kernel::Resolve, &long_kernel(&device, turns));

        device.be_patient_for(Duration::from_millis(500));
        let start = Instant::now();
        let error = render(&mut session).map(drop).expect_err("the device hangs");
        assert!(error.is_passing() && error.to_string().contains("did not finish within 0.5 s"), "{error}");
        assert!(start.elapsed() < hangs * 3 / 4, "{:?}", start.elapsed());
        // Other sessions of the device get the same error, and a scene that is tried again gets another device.
        assert_eq!(render(&mut session).map(drop).expect_err("given up"), error);
        drop(session);
        assert!(render(&mut open()).expect("renders") == image, "another image");
        // A software renderer must not be dropped while it works. The driver of a card may have given it up.
        let _ = device.poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(2 * hangs) });
    }

    #[test]
    fn a_device_that_failed_is_given_up_by_all_sessions_and_opened_anew() {
        let renderer = GpuPathRenderer::new(PathTracing { samples_per_pixel: 4, ..PathTracing::default() });
        if !is_there(renderer.devices().is_ok(), "a graphics adapter") {
            return;
        }
        let (scene, view, wants) = (room::scene_of(Look::Mixed), room::view(24, 20), [RADIANCE.id()]);
        let request = RenderRequest::new(&view, &wants, Stream::root(3), &Threads(2));
        let open = || {
            let mut session = renderer.open(0).expect("opens");
            session.load(&scene, &Threads(2)).expect("loads");
            session
        };
        let render = |session: &mut Box<dyn RenderSession>| {
            let mut products = Products::new();
            session.render(&request, &mut products).and_then(|()| products.get(RADIANCE).cloned())
        };
        let image = render(&mut open()).expect("renders");
        for says in ["the device was lost", "greater than the maximum", "its driver gave it up"] {
            let mut sessions = [open(), open()];
            let device = renderer.device(0).expect("open");
            if says == "the device was lost" {
                device.wgpu().destroy();
            } else if says == "its driver gave it up" {
                device.panic_in_poll();
            } else {
                let (label, size, usage) = (None, u64::MAX / 512 * 256, wgpu::BufferUsages::STORAGE);
                let descriptor = wgpu::BufferDescriptor { label, size, usage, mapped_at_creation: false };
                drop(device.wgpu().create_buffer(&descriptor));
            }
            // Twice, as both sessions of the device must get the same error each time.
            let mut errors = Vec::new();
            for number in [0, 1, 0, 1] {
                errors.push(render(&mut sessions[number]).expect_err("the device failed"));
            }
            assert!(errors.iter().all(|error| error.is_passing() && *error == errors[0]), "{errors:?}");
            assert!(errors[0].to_string().contains(says), "{}", errors[0]);
            assert!(device.has_failed());
            let mut fresh = open();
            assert!(render(&mut fresh).expect("renders").data() == image.data(), "another image");
            assert!(!Arc::ptr_eq(&device, &renderer.device(0).expect("open")));
        }
    }
}
