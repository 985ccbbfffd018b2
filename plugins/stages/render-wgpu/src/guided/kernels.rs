//! The kernels of the filter: their source, with the constants of `syntable-guided`, and their bindings.

use crate::constants::{Constant, declared};
use std::num::NonZeroU64;
use syntable_guided::tuning;
use syntable_model::photometry::luminance;
use syntable_model::product::standard::DEMODULATION_EPSILON;
use syntable_simd::functions::FAR;

/// The WGSL below [`constants`].
const SHADERS: [&str; 5] = [
    include_str!("../shaders/guided/bindings.wgsl"),
    include_str!("../shaders/guided/surfaces.wgsl"),
    include_str!("../shaders/guided/noise.wgsl"),
    include_str!("../shaders/guided/level.wgsl"),
    include_str!("../shaders/guided/join.wgsl"),
];

/// Storage buffers of the bind group, in the order of their bindings: the input, then those that kernels write.
pub(super) const STORAGE_BUFFERS: u32 = 8;

/// The pipelines; compiled once per device.
pub(crate) struct Kernels {
    layout: wgpu::BindGroupLayout,
    pub(super) surfaces: wgpu::ComputePipeline,
    pub(super) borders: wgpu::ComputePipeline,
    pub(super) noise: wgpu::ComputePipeline,
    pub(super) level: wgpu::ComputePipeline,
    pub(super) join: wgpu::ComputePipeline,
    pub(super) average: wgpu::ComputePipeline,
    pub(super) brightness: wgpu::ComputePipeline,
    pub(super) factors: wgpu::ComputePipeline,
    pub(super) restore: wgpu::ComputePipeline,
}

impl Kernels {
    /// Compiles the kernels from their [`source`].
    pub(crate) fn new(device: &wgpu::Device, source: &str, kept: Option<&wgpu::PipelineCache>) -> Self {
        let entry = |binding, ty, has_dynamic_offset| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset, min_binding_size: None },
            count: None,
        };
        let storage = |binding| entry(binding, wgpu::BufferBindingType::Storage { read_only: binding == 0 }, false);
        let mut entries: Vec<_> = (0..STORAGE_BUFFERS).map(storage).collect();
        entries.push(entry(STORAGE_BUFFERS, wgpu::BufferBindingType::Uniform, true));
        let layout = device
            .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("guided"), entries: &entries });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("guided"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let descriptor =
            wgpu::ShaderModuleDescriptor { label: Some("guided"), source: wgpu::ShaderSource::Wgsl(source.into()) };
        // SAFETY: loops of the shaders have bounds, and indices stay below the sizes that `GuidedFilter::record`
        // allocates or checks.
        let module = unsafe { device.create_shader_module_trusted(descriptor, wgpu::ShaderRuntimeChecks::unchecked()) };
        let pipeline = |entry_point| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry_point),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some(entry_point),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &[],
                    zero_initialize_workgroup_memory: false,
                },
                cache: kept,
            })
        };
        Self {
            surfaces: pipeline("surfaces"),
            borders: pipeline("borders"),
            noise: pipeline("noise"),
            level: pipeline("level"),
            join: pipeline("join"),
            average: pipeline("average"),
            brightness: pipeline("brightness"),
            factors: pipeline("factors"),
            restore: pipeline("restore"),
            layout,
        }
    }

    /// Binds buffers, and the bytes of uniforms that a dispatch reads.
    pub(super) fn bind(
        &self,
        device: &wgpu::Device,
        storage: [&wgpu::Buffer; STORAGE_BUFFERS as usize],
        uniforms: &wgpu::Buffer,
        bytes: u64,
    ) -> wgpu::BindGroup {
        let resources = storage.into_iter().map(wgpu::Buffer::as_entire_binding);
        let work = wgpu::BufferBinding { buffer: uniforms, offset: 0, size: NonZeroU64::new(bytes) };
        let resources = resources.chain([wgpu::BindingResource::Buffer(work)]);
        let entries: Vec<_> =
            (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("guided"),
            layout: &self.layout,
            entries: &entries,
        })
    }
}

/// The WGSL of the kernels.
pub(crate) fn source() -> String {
    constants() + &SHADERS.join("\n")
}

/// Constants of the shaders, in WGSL.
fn constants() -> String {
    let weight = |color| luminance(color) as f32;
    let numbers: &[(&str, Constant)] = &[
        ("FAR", FAR.into()),
        ("DEMODULATION_EPSILON", DEMODULATION_EPSILON.into()),
        ("LUMINANCE_R", weight([1.0, 0.0, 0.0]).into()),
        ("LUMINANCE_G", weight([0.0, 1.0, 0.0]).into()),
        ("LUMINANCE_B", weight([0.0, 0.0, 1.0]).into()),
        ("MOST_NITS", tuning::MOST_NITS.into()),
        ("NEAREST", tuning::NEAREST.into()),
        ("WHOLE", tuning::WHOLE.into()),
        ("RESIDUAL", tuning::RESIDUAL.into()),
        ("PLANE", tuning::PLANE.into()),
        ("BORDER_NORMAL", tuning::BORDER_NORMAL.into()),
        ("BORDER_COLOR", tuning::BORDER_COLOR.into()),
        ("END", tuning::END.into()),
        ("FEWEST", tuning::FEWEST.into()),
        ("SURE", tuning::SURE.into()),
        ("PRIOR", tuning::PRIOR.into()),
        ("MOST_RESTORED", tuning::MOST_RESTORED.into()),
        ("LEAST_RESTORED", tuning::LEAST_RESTORED.into()),
        ("DIFFUSE_PER_NORMAL", tuning::DIFFUSE.per_normal.into()),
        ("SPECULAR_PER_NORMAL", tuning::SPECULAR.per_normal.into()),
        ("DIFFUSE_FIREFLY", tuning::DIFFUSE.firefly.into()),
        ("SPECULAR_FIREFLY", tuning::SPECULAR.firefly.into()),
        ("CELL", tuning::CELL.into()),
        ("REACH", tuning::REACH.into()),
    ];
    let weights = tuning::CELL_WEIGHTS.map(|weight| format!("{weight:e}f")).join(", ");
    let cells = format!("const CELL_WEIGHTS = array<f32, {}>({weights});\n", tuning::CELL_WEIGHTS.len());
    declared(numbers) + &cells
}
