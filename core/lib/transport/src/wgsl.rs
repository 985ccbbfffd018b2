//! The same functions in WGSL, for GPUs. Each file is next to the Rust code that it mirrors, and each function is
//! tested against it (`plugins/stages/render-wgpu/tests/functions`).
//!
//! The files use each other, and two items of the renderer: a function `lobe_table(at: u32) -> vec4<f32>` returns
//! entries of [`table`](crate::bsdf::table) and [`sheen_table`](crate::bsdf::sheen_table): the cells by halves, then
//! the halves of the means, then the halves of the sheen table. A constant `PLAIN_DIELECTRICS` selects one of
//! [`Dielectrics`](crate::Dielectrics).

/// Elementary functions and vectors.
pub const FUNCTIONS: &str = syntable_simd::functions::WGSL;
/// Random numbers of paths.
pub const SAMPLER: &str = syntable_prepare::SAMPLER_WGSL;
/// The microfacet distribution.
pub const GGX: &str = include_str!("bsdf/ggx.wgsl");
/// Its directional albedo.
pub const ALBEDO: &str = include_str!("bsdf/albedo.wgsl");
/// The base lobes.
pub const BSDF: &str = include_str!("bsdf/bsdf.wgsl");
/// Sheen fibers.
pub const SHEEN: &str = include_str!("bsdf/sheen.wgsl");
/// Attenuation by upper layers.
pub const COATING: &str = include_str!("bsdf/coating.wgsl");
/// Interfaces and thin sheets.
pub const TRANSMISSION: &str = include_str!("bsdf/transmission.wgsl");
/// Layered surfaces.
pub const LAYERED: &str = include_str!("bsdf/layered.wgsl");
/// Lights with a shape.
pub const SHAPES: &str = include_str!("light/shapes.wgsl");

/// All modules, in any order.
pub const MODULES: &[&str] = &[FUNCTIONS, SAMPLER, GGX, ALBEDO, BSDF, SHEEN, COATING, TRANSMISSION, LAYERED, SHAPES];
