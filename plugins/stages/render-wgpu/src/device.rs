//! A device: its limits, its kernels, and how its errors reach the caller.

use crate::adapters::{AdapterInfo, Adapters, RayQueries, required_limits};
use crate::constants::declared;
use crate::guided::kernels::{Kernels as GuidedKernels, source as guided_source};
use crate::layout::{self, BODY_SIZE, EMITTER_SIZE, NONE, STORAGE_BUFFERS};
use crate::{planes, trees};
use bytemuck::Pod;
use parking_lot::Mutex;
use std::collections::HashMap;
use std::num::NonZeroU64;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, OnceLock, mpsc};
use std::time::Duration;
use syntable_model::context::{Cache, NoCache, Workers};
use syntable_model::digest::Hasher;
use syntable_model::error::{Error, Result};
use syntable_model::product::standard::DEMODULATION_EPSILON;
use syntable_prepare::labels::{BASE_LAYER, GLASS};
use syntable_prepare::{FINEST, PANE_ROUGHNESS, PreparedBody};
use syntable_transport::{film, path};

/// WGSL that intersects rays of paths with the scene: by walks of trees, and by ray queries.
const RAYS: [&str; 2] = [include_str!("shaders/rays.wgsl"), include_str!("shaders/queries.wgsl")];

/// WGSL of all other kernels, in order: the renderer's own modules, with the modules that mirror the reference
/// functions between them.
const SHADERS: &[&[&str]] = &[
    &[include_str!("shaders/scene.wgsl")],
    syntable_transport::wgsl::MODULES,
    &[
        include_str!("shaders/material.wgsl"),
        include_str!("shaders/surface.wgsl"),
        include_str!("shaders/lights.wgsl"),
        include_str!("shaders/bvh.wgsl"),
        include_str!("shaders/camera.wgsl"),
        include_str!("shaders/path.wgsl"),
        include_str!("shaders/labels.wgsl"),
    ],
];

/// Maximum time that a session waits for submitted work.
const PATIENCE: Duration = Duration::from_secs(120);

/// Binding of the acceleration structure of ray queries.
const QUERIED: u32 = 10;

/// An entry point of the shaders.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kernel {
    /// Camera rays, first surfaces of rays, and shadow rays.
    Trace,
    /// Scattering and light sampling.
    Shade,
    /// Paths that gather guides alone.
    Guide,
    /// Sums of pixels.
    Accumulate,
    /// Labels.
    Labels,
    /// Pixels that need more samples of the guides.
    Choose,
    /// Planes of an image.
    Resolve,
}

/// Features that kernels are compiled with. A feature that a scene does not need costs no time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Variant {
    /// Any material has layers.
    pub layered: bool,
    /// Any body has cut-outs.
    pub cutouts: bool,
    /// Any body has panes.
    pub panes: bool,
    /// Guides are gathered.
    pub guides: bool,
    /// Paths gather guides alone, and no light.
    pub only_guides: bool,
    /// Dielectrics are glTF's plain mix.
    pub plain_dielectrics: bool,
    /// The trees have many levels.
    pub deep: bool,
    /// Several windows with bodies of their own are side by side.
    pub tiles: bool,
    /// The opacity of pixels is counted.
    pub opacity: bool,
    /// Rays of paths use ray queries, on a device that has them.
    pub queries: bool,
}

impl Variant {
    /// Kernels for labels never gather guides or opacity, and never use ray queries.
    pub fn of_labels(self) -> Self {
        Self { guides: false, opacity: false, queries: false, ..self }
    }
}

/// A kernel, as soon as a session has compiled it.
type Compiled = Arc<OnceLock<wgpu::ComputePipeline>>;

/// A device and its kernels; shared by sessions.
pub struct Device {
    device: wgpu::Device,
    queue: wgpu::Queue,
    info: AdapterInfo,
    limits: wgpu::Limits,
    layout: wgpu::BindGroupLayout,
    pipeline_layout: wgpu::PipelineLayout,
    module: wgpu::ShaderModule,
    pipelines: Mutex<HashMap<(Kernel, Variant), Compiled>>,
    /// Maximum time that a session waits for submitted work.
    patience: Mutex<Duration>,
    #[cfg(test)]
    poll_panics: Mutex<bool>,
    /// The first error. It stays, because later contents of buffers are undefined.
    failure: Arc<OnceLock<String>>,
    guided: OnceLock<Arc<GuidedKernels>>,
}

/// Constants of the shaders, in WGSL.
fn constants() -> String {
    declared(&[
        ("NONE", NONE.into()),
        ("BODY_SIZE", BODY_SIZE.into()),
        ("NODE_SIZE", (trees::NODE_SIZE as u32).into()),
        ("BODY_NODE", trees::BODY.into()),
        ("STACK", trees::STACK.into()),
        ("DEEP_STACK", trees::DEEP_STACK.into()),
        ("EMITTER_SIZE", EMITTER_SIZE.into()),
        ("WARPED", layout::WARPED.into()),
        ("TENT", layout::TENT.into()),
        ("BLENDED_BY_COVERAGE", layout::BLENDED_BY_COVERAGE.into()),
        ("WITHOUT_BACKGROUND", layout::WITHOUT_BACKGROUND.into()),
        ("WITHOUT_SHADOWS", layout::WITHOUT_SHADOWS.into()),
        ("HOLDS_OUT", layout::HOLDS_OUT.into()),
        ("GUIDE_BOUNCES", path::GUIDE_BOUNCES.into()),
        ("LABELS_THROUGH_GLASS", layout::LABELS_THROUGH_GLASS.into()),
        ("SHADOW_COUNTERS", layout::SHADOW_COUNTERS.into()),
        ("RAYS_COUNTED", layout::RAYS_COUNTED.into()),
        ("SHADOWS_COUNTED", layout::SHADOWS_COUNTED.into()),
        ("CHOSEN", layout::CHOSEN.into()),
        ("GROUPS", layout::GROUPS_COUNTED.into()),
        ("GROUP", (layout::GROUP as u32).into()),
        ("ROW", (layout::GROUPS_ALONG_X * layout::GROUP as u32).into()),
        ("SUMS_OF_LIGHT", (planes::SUMS[0] as u32).into()),
        ("SUMS_WITH_GUIDES", (planes::SUMS[1] as u32).into()),
        ("SUM_SAMPLES", planes::SUM_SAMPLES.into()),
        ("SUM_GUIDES", planes::SUM_GUIDES.into()),
        ("SUM_SPECULAR", planes::SUM_SPECULAR.into()),
        ("SUM_DEMODULATED", planes::SUM_DEMODULATED.into()),
        ("AT_RADIANCE", planes::AT_RADIANCE.into()),
        ("AT_SPECULAR", planes::AT_SPECULAR.into()),
        ("AT_DEMODULATED", planes::AT_DEMODULATED.into()),
        ("AT_ALBEDO", planes::AT_ALBEDO.into()),
        ("AT_NORMAL", planes::AT_NORMAL.into()),
        ("AT_OPACITY", planes::AT_OPACITY[0].into()),
        ("AT_OPACITY_AFTER_GUIDES", planes::AT_OPACITY[1].into()),
        ("GUIDE_SAMPLES", (film::GUIDE_SAMPLES as f32).into()),
        ("DIFFERENT", film::DIFFERENT.into()),
        ("DEMODULATION_EPSILON", DEMODULATION_EPSILON.into()),
        ("BASE_LAYER", BASE_LAYER.into()),
        ("PANE_ROUGHNESS", PANE_ROUGHNESS.into()),
        ("FINEST", FINEST.into()),
        ("GLASS", GLASS.into()),
        ("BODY_CUTOUTS", PreparedBody::CUTOUTS.into()),
        ("BODY_PANES", PreparedBody::PANES.into()),
        ("BODY_GLASS", PreparedBody::GLASS.into()),
        ("TOUCHING", path::TOUCHING.into()),
        ("LENS", path::LENS.into()),
        ("LAYER_DIMENSION", path::LAYER_DIMENSION.into()),
        ("PASSAGE", path::PASSAGE.into()),
        ("ALPHA_OF_SAMPLE", path::ALPHA_OF_SAMPLE.into()),
        ("ALPHA_OF_BOUNCE", path::ALPHA_OF_BOUNCE.into()),
        ("ALPHA_OF_SHADOW", path::ALPHA_OF_SHADOW.into()),
        ("GLOSS", path::GLOSS.into()),
        ("DIFFUSE_SPREAD", path::DIFFUSE_SPREAD.into()),
        ("PAST", path::PAST.into()),
        ("SPLIT_FIRST", path::SPLIT[0].into()),
        ("SPLIT_NEXT", path::SPLIT[1].into()),
        ("ROUGH", path::ROUGH.into()),
    ])
}

/// The buffers of a bind group, in the order of their bindings.
pub struct Bindings<'a> {
    /// Storage buffers.
    pub storage: [&'a wgpu::Buffer; STORAGE_BUFFERS as usize],
    /// Uniforms of the view.
    pub view: &'a wgpu::Buffer,
    /// Uniforms of passes, [`PASS_STRIDE`](layout::PASS_STRIDE) apart.
    pub passes: &'a wgpu::Buffer,
    /// The acceleration structure of ray queries, on a device that has them.
    pub queried: Option<&'a wgpu::Tlas>,
}

/// The WGSL of all kernels, with ray queries or with walks of trees.
fn source(queries: bool) -> String {
    // `enable` directives must come first in a module.
    let enabled = if queries { "enable wgpu_ray_query;\n" } else { "" };
    let modules = SHADERS.concat().join("\n");
    format!("{enabled}{}{modules}\n{}", constants(), RAYS[usize::from(queries)])
}

impl Device {
    /// Opens an adapter that renders, by its index among these.
    pub fn open(adapters: &Adapters, number: usize) -> Result<Self> {
        let (adapter, info) = adapters.get(number)?;
        let offered = adapter.limits();
        let queries = info.ray_queries == RayQueries::Used;
        let mut limits = wgpu::Limits {
            max_buffer_size: offered.max_buffer_size,
            max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
            ..required_limits()
        };
        let mut required_features = adapter.features() & wgpu::Features::PIPELINE_CACHE;
        let mut experimental_features = wgpu::ExperimentalFeatures::disabled();
        if queries {
            limits = limits.using_acceleration_structure_values(offered);
            required_features |= wgpu::Features::EXPERIMENTAL_RAY_QUERY;
            // SAFETY: structures are built from buffers that stay unchanged until the build ends, and queries keep the
            // rules of `ShaderRuntimeChecks::ray_query_initialization_tracking`.
            experimental_features = unsafe { wgpu::ExperimentalFeatures::enabled() };
        }
        let request = wgpu::DeviceDescriptor {
            label: Some("syntable"),
            required_features,
            required_limits: limits.clone(),
            experimental_features,
            memory_hints: wgpu::MemoryHints::Performance,
            ..wgpu::DeviceDescriptor::default()
        };
        let failed =
            |error: wgpu::RequestDeviceError| Error::device(format!("{} cannot be opened: {error}", info.name));
        let (device, queue) = pollster::block_on(adapter.request_device(&request)).map_err(failed)?;
        let failure = Arc::new(OnceLock::new());
        let (of_loss, of_error) = (failure.clone(), failure.clone());
        device.set_device_lost_callback(move |reason, message| {
            let _ = of_loss.set(format!("the device was lost ({reason:?}): {message}"));
        });
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let one_line = error.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
            let _ = of_error.set(one_line);
        }));

        let storage = |binding: u32, read_only: bool| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let uniform = |binding: u32, has_dynamic_offset: bool| wgpu::BindGroupLayoutEntry {
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset,
                min_binding_size: None,
            },
            ..storage(binding, true)
        };
        let entries: Vec<_> = (0..STORAGE_BUFFERS)
            .map(|binding| storage(binding, binding < 4))
            .chain([uniform(8, false), uniform(9, true)])
            .chain(queries.then(|| wgpu::BindGroupLayoutEntry {
                ty: wgpu::BindingType::AccelerationStructure { vertex_return: false },
                ..storage(QUERIED, true)
            }))
            .collect();
        let layout = device
            .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("kernels"), entries: &entries });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("kernels"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let source = wgpu::ShaderSource::Wgsl(source(queries).into());
        let descriptor = wgpu::ShaderModuleDescriptor { label: Some("syntable"), source };
        // SAFETY: loops of the shaders end, their indices follow from tables and counts that this crate writes, and
        // they query finite rays, in the order that the checks demand.
        let module = unsafe { device.create_shader_module_trusted(descriptor, wgpu::ShaderRuntimeChecks::unchecked()) };
        let opened = Self {
            device,
            queue,
            info,
            limits,
            layout,
            pipeline_layout,
            module,
            pipelines: Mutex::default(),
            patience: PATIENCE.into(),
            #[cfg(test)]
            poll_panics: Mutex::default(),
            failure,
            guided: OnceLock::new(),
        };
        opened.check()?;
        Ok(opened)
    }

    /// Refuses an image if a part of it needs more bytes than a buffer can hold: then no scene can be rendered.
    pub fn check_image(&self, what: &str, bytes: u64) -> Result<()> {
        if bytes <= self.max_buffer() {
            return Ok(());
        }
        let (name, mib, most) = (self.name(), bytes >> 20, self.max_buffer() >> 20);
        Err(Error::new(format!("{what} needs {mib} MiB, and a buffer of {name} holds {most}"))
            .help("lower the resolution, or render with `cpu_path`"))
    }

    /// Whether the device traces rays by queries.
    pub fn has_queries(&self) -> bool {
        self.info.ray_queries == RayQueries::Used
    }

    /// Name of the card.
    pub fn name(&self) -> &str {
        &self.info.name
    }

    /// Maximum paths of a pass.
    pub fn most_paths(&self) -> u64 {
        self.info.most_paths()
    }

    /// Bytes that the paths of a session leave free: for the other sessions, for other buffers of frames and for later scenes.
    pub fn reserve(&self) -> u64 {
        const OF_A_SESSION: u64 = 256 << 20;
        (OF_A_SESSION * (self.info.sessions() as u64 - 1)).min(self.max_buffer())
    }

    /// Whether the device failed: its driver gave it up, it ran out of memory, or it did not finish in time. No session
    /// can use it then.
    pub fn has_failed(&self) -> bool {
        self.failure.get().is_some()
    }

    /// Bytes of the largest buffer that kernels can read.
    pub fn max_buffer(&self) -> u64 {
        self.info.max_buffer
    }

    /// Reports the first error of the device, to every later caller as well.
    ///
    /// # Errors
    /// If the device failed; the error is [of the device](Error::is_device).
    pub fn check(&self) -> Result<()> {
        match self.failure.get() {
            None => Ok(()),
            Some(message) => Err(Error::device(format!("{}: {message}", self.info.name))
                .help("if it stays so, update the driver, or render with `cpu_path`")),
        }
    }

    /// Gives the device up, unless it failed before. Returns the error.
    fn fail(&self, message: impl Into<String>) -> Error {
        let _ = self.failure.set(message.into());
        self.check().expect_err("it failed")
    }

    fn buffer(&self, label: &str, size: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer> {
        let size = size.max(256).next_multiple_of(256);
        let limit =
            if usage.contains(wgpu::BufferUsages::STORAGE) { self.max_buffer() } else { self.limits.max_buffer_size };
        if size > limit {
            let (name, mib, most) = (&self.info.name, size >> 20, limit >> 20);
            return Err(Error::exceeds_device(format!(
                "the buffer `{label}` needs {mib} MiB, and one of {name} holds {most} MiB"
            ))
            .help("use fewer or smaller assets or a lower resolution, or render with `cpu_path`"));
        }
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage,
            mapped_at_creation: false,
        });
        self.check()?;
        Ok(buffer)
    }

    /// A buffer for kernels, of at least `size` bytes.
    pub fn storage(&self, label: &str, size: u64) -> Result<wgpu::Buffer> {
        use wgpu::BufferUsages as Usage;
        // Acceleration structures are built from the triangles of trees.
        let input = if self.has_queries() { Usage::BLAS_INPUT } else { Usage::empty() };
        self.buffer(label, size, Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC | input)
    }

    /// Like [`Self::storage`], but of `roomy` bytes if the device has memory for them.
    pub fn roomy_storage(&self, label: &str, size: u64, roomy: u64) -> Result<wgpu::Buffer> {
        let roomy = roomy.min(self.max_buffer());
        if roomy > size
            && let Some(buffer) = self.storage_if_there_is_room(label, roomy)?
        {
            return Ok(buffer);
        }
        self.storage(label, size)
    }

    /// Like [`Self::storage`], but `None` if the device has too little free memory.
    pub fn storage_if_there_is_room(&self, label: &str, size: u64) -> Result<Option<wgpu::Buffer>> {
        // Frees dropped buffers.
        let _ = self.poll(wgpu::PollType::Poll)?;
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let buffer = self.storage(label, size)?;
        Ok(pollster::block_on(scope.pop()).is_none().then_some(buffer))
    }

    /// A buffer of uniforms.
    pub fn uniforms(&self, label: &str, size: u64) -> Result<wgpu::Buffer> {
        self.buffer(label, size, wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST)
    }

    /// A buffer of numbers of workgroups, for indirect dispatches.
    pub fn indirect(&self, label: &str, size: u64) -> Result<wgpu::Buffer> {
        self.buffer(label, size, wgpu::BufferUsages::INDIRECT | wgpu::BufferUsages::COPY_DST)
    }

    /// A buffer that the host reads.
    pub fn readable(&self, label: &str, size: u64) -> Result<wgpu::Buffer> {
        self.buffer(label, size, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST)
    }

    /// Writes to a buffer before the next submission.
    pub fn write(&self, buffer: &wgpu::Buffer, offset: u64, bytes: &[u8]) {
        if !bytes.is_empty() {
            self.queue.write_buffer(buffer, offset, bytes);
        }
    }

    /// Binds buffers to the kernels.
    pub fn bind(&self, bindings: &Bindings) -> wgpu::BindGroup {
        let entry = |binding: usize, resource| wgpu::BindGroupEntry { binding: binding as u32, resource };
        let pass = wgpu::BufferBinding {
            buffer: bindings.passes,
            offset: 0,
            size: NonZeroU64::new(size_of::<layout::Pass>() as u64),
        };
        let entries: Vec<_> = (bindings.storage.iter().enumerate())
            .map(|(binding, buffer)| entry(binding, buffer.as_entire_binding()))
            .chain([entry(8, bindings.view.as_entire_binding()), entry(9, wgpu::BindingResource::Buffer(pass))])
            .chain(bindings.queried.map(|queried| entry(QUERIED as usize, queried.as_binding())))
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("kernels"),
            layout: &self.layout,
            entries: &entries,
        })
    }

    /// A kernel, compiled at first use.
    pub fn kernel(&self, kernel: Kernel, variant: Variant) -> wgpu::ComputePipeline {
        self.kept_kernel(kernel, variant, &NoCache)
    }

    /// A kernel, compiled at first use, with machine code that an earlier run kept.
    fn kept_kernel(&self, kernel: Kernel, variant: Variant, cache: &dyn Cache) -> wgpu::ComputePipeline {
        let make = || {
            let entry_point = match kernel {
                Kernel::Trace => "trace",
                Kernel::Shade => "shade",
                Kernel::Guide => "guide",
                Kernel::Accumulate => "accumulate",
                Kernel::Labels => "labels",
                Kernel::Choose => "choose",
                Kernel::Resolve => "resolve",
            };
            let of_kernel = |key: Hasher| key.text(entry_point).text(&format!("{variant:?}"));
            self.with_kept_code(&source(self.has_queries()), of_kernel, cache, |kept| {
                self.compiled(&self.module, entry_point, variant, kept)
            })
        };
        // Other kernels compile meanwhile.
        let place = self.pipelines.lock().entry((kernel, variant)).or_default().clone();
        place.get_or_init(make).clone()
    }

    /// Compiles kernels at the same time, and the kernels of the denoiser if it runs on the device: a driver takes more
    /// than a second for some. The cache keeps their machine code between runs.
    pub fn compile(&self, kernels: &[(Kernel, Variant)], guided: bool, cache: &dyn Cache, workers: &dyn Workers) {
        let is_compiled = {
            let pipelines = self.pipelines.lock();
            kernels.iter().all(|kernel| pipelines.get(kernel).is_some_and(|place| place.get().is_some()))
        };
        if is_compiled && (!guided || self.guided.get().is_some()) {
            return;
        }
        workers.run(kernels.len() + usize::from(guided), &|job| match kernels.get(job) {
            Some(&(kernel, variant)) => drop(self.kept_kernel(kernel, variant, cache)),
            None => drop(self.kept_guided(cache)),
        });
    }

    fn compiled(
        &self,
        module: &wgpu::ShaderModule,
        entry_point: &str,
        variant: Variant,
        kept: Option<&wgpu::PipelineCache>,
    ) -> wgpu::ComputePipeline {
        let on = |flag: bool| if flag { 1.0 } else { 0.0 };
        let mut constants = vec![
            ("LAYERED", on(variant.layered)),
            ("CUTOUTS", on(variant.cutouts)),
            ("PANES", on(variant.panes)),
            ("GUIDES", on(variant.guides)),
            ("ONLY_GUIDES", on(variant.only_guides)),
            ("PLAIN_DIELECTRICS", on(variant.plain_dielectrics)),
            ("DEEP", on(variant.deep)),
            ("TILES", on(variant.tiles)),
            ("OPACITY", on(variant.opacity)),
        ];
        if self.has_queries() {
            constants.push(("QUERIES", on(variant.queries)));
        }
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry_point),
            layout: Some(&self.pipeline_layout),
            module,
            entry_point: Some(entry_point),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &constants,
                zero_initialize_workgroup_memory: false,
            },
            cache: kept,
        })
    }

    /// Whether the device is a card and not a software renderer.
    #[cfg(test)]
    pub(crate) fn is_hardware(&self) -> bool {
        self.info.is_hardware()
    }

    /// Replaces a compiled kernel.
    #[cfg(test)]
    pub(crate) fn replace(&self, kernel: Kernel, by: &wgpu::ComputePipeline) {
        let mut pipelines = self.pipelines.lock();
        let compiled: Vec<_> = pipelines.keys().filter(|(of, _)| *of == kernel).copied().collect();
        assert!(!compiled.is_empty());
        pipelines.extend(compiled.into_iter().map(|key| (key, Arc::new(OnceLock::from(by.clone())))));
    }

    /// A kernel in WGSL that can call all functions of the other kernels, compiled like them.
    #[cfg(test)]
    pub(crate) fn kernel_of(&self, added: &str, entry_point: &str, variant: Variant) -> wgpu::ComputePipeline {
        let source = wgpu::ShaderSource::Wgsl((source(self.has_queries()) + added).into());
        let descriptor = wgpu::ShaderModuleDescriptor { label: Some(entry_point), source };
        // SAFETY: as for the other kernels; the loops of the added source end, and its indices stay below the sizes of
        // buffers.
        let module =
            unsafe { self.device.create_shader_module_trusted(descriptor, wgpu::ShaderRuntimeChecks::unchecked()) };
        self.compiled(&module, entry_point, variant, None)
    }

    /// Records work.
    pub fn encoder(&self) -> wgpu::CommandEncoder {
        self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: None })
    }

    /// Starts work.
    pub fn submit(&self, encoder: wgpu::CommandEncoder) -> wgpu::SubmissionIndex {
        self.queue.submit([encoder.finish()])
    }

    /// Waits until work is done.
    ///
    /// # Errors
    /// If it takes longer than [`PATIENCE`]. The device has failed then.
    pub fn wait(&self, submission: wgpu::SubmissionIndex) -> Result<()> {
        let (submission_index, patience) = (Some(submission), self.patience());
        let waited = self.poll(wgpu::PollType::Wait { submission_index, timeout: Some(patience) })?;
        self.check()?;
        let late = |error| {
            self.abandon();
            self.fail(format!("it did not finish within {} s: {error}", patience.as_secs_f32()))
        };
        waited.map(drop).map_err(late)
    }

    /// Polls the device. If the driver gave the device up, wgpu panics; this function returns an error instead.
    pub(crate) fn poll(&self, how: wgpu::PollType) -> Result<Result<wgpu::PollStatus, wgpu::PollError>> {
        let poll = || {
            #[cfg(test)]
            if std::mem::take(&mut *self.poll_panics.lock()) {
                panic!("as wgpu does where a driver gave its device up");
            }
            self.device.poll(how)
        };
        catch_unwind(AssertUnwindSafe(poll)).map_err(|_| self.fail("its driver gave it up"))
    }

    /// Makes the next wait panic.
    #[cfg(test)]
    pub(crate) fn panic_in_poll(&self) {
        *self.poll_panics.lock() = true;
    }

    fn patience(&self) -> Duration {
        *self.patience.lock()
    }

    /// Sets the maximum time of later waits.
    #[cfg(test)]
    pub(crate) fn be_patient_for(&self, time: Duration) {
        *self.patience.lock() = time;
    }

    /// Never drops the queue: when its last handle is dropped, wgpu waits for it without a limit, and this queue may
    /// never finish.
    fn abandon(&self) {
        std::mem::forget(self.queue.clone());
    }

    /// Submits work that ends with a copy to a readable buffer, waits for it, and passes the first elements to `read`.
    pub fn read<T: Pod, R>(
        &self,
        encoder: wgpu::CommandEncoder,
        through: &wgpu::Buffer,
        count: u64,
        read: impl FnOnce(&[T]) -> R,
    ) -> Result<R> {
        let bytes = count * size_of::<T>() as u64;
        // Other sessions of the device continue meanwhile.
        let submission = self.submit(encoder);
        let (answer, mapped) = mpsc::channel();
        // Sending fails if the wait was given up: the receiver is gone.
        through.map_async(wgpu::MapMode::Read, 0..bytes, move |result| drop(answer.send(result)));
        self.wait(submission)?;
        let unreadable = |error: String| self.fail(format!("results cannot be read: {error}"));
        // The callback may run in another session's wait, slightly later.
        match mapped.recv_timeout(self.patience()) {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(unreadable(error.to_string())),
            Err(error) => {
                self.abandon();
                return Err(unreadable(error.to_string()));
            }
        }
        let result = {
            let view = through.get_mapped_range(0..bytes).map_err(|error| unreadable(error.to_string()))?;
            read(bytemuck::cast_slice(&view))
        };
        through.unmap();
        Ok(result)
    }

    /// The wgpu device.
    pub(crate) fn wgpu(&self) -> &wgpu::Device {
        &self.device
    }

    /// The kernels of the denoiser, compiled at first use.
    pub(crate) fn guided(&self) -> Arc<GuidedKernels> {
        self.kept_guided(&NoCache)
    }

    /// Like [`Self::guided`], with machine code that an earlier run kept.
    fn kept_guided(&self, cache: &dyn Cache) -> Arc<GuidedKernels> {
        let make = || {
            let source = guided_source();
            let kernels = |kept: Option<&_>| GuidedKernels::new(&self.device, &source, kept);
            Arc::new(self.with_kept_code(&source, |key| key, cache, kernels))
        };
        self.guided.get_or_init(make).clone()
    }

    /// Compiles kernels with their machine code, if a cache has it for this source, adapter and driver. Otherwise the cache
    /// keeps it afterwards. Some drivers keep it themselves, but often in folders that containers lose.
    fn with_kept_code<T>(
        &self,
        source: &str,
        of_kernel: impl FnOnce(Hasher) -> Hasher,
        cache: &dyn Cache,
        compile: impl FnOnce(Option<&wgpu::PipelineCache>) -> T,
    ) -> T {
        const PURPOSE: &str = "kernels";
        if !self.device.features().contains(wgpu::Features::PIPELINE_CACHE) {
            return compile(None);
        }
        let AdapterInfo { name, driver, backend, model, .. } = &self.info;
        let of_adapter = Hasher::new(PURPOSE).text(name).text(driver).text(backend).bytes(bytemuck::bytes_of(model));
        let key = of_kernel(of_adapter.text(source)).finish();
        let before = cache.get(PURPOSE, key);
        let descriptor =
            wgpu::PipelineCacheDescriptor { label: Some(PURPOSE), data: before.as_deref(), fallback: true };
        // SAFETY: a cache returns the bytes that were stored under the key, and `get_data` made them for this driver.
        let kept = unsafe { self.device.create_pipeline_cache(&descriptor) };
        let compiled = compile(Some(&kept));
        // The same source compiles to other code after an update of its compiler: then the driver adds the new code.
        if let Some(code) = kept.get_data().filter(|code| before.is_none_or(|before| before.len() < code.len())) {
            cache.put(PURPOSE, key, &code);
        }
        compiled
    }
}
