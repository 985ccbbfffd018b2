//! Constants of a path tracer, for any device: both renderers trace the same paths with them.

/// A light is visible unless a surface is closer by more than this fraction of its distance: lights may be flat on a
/// ceiling.
pub const TOUCHING: f32 = 1e-4;

/// Sampler pair of the position in the aperture. Pair 0 is the position in the pixel; later pairs alternate between
/// lights and directions.
pub const LENS: u32 = 1;

/// Sampler dimension for layer selection; lower dimensions are for Russian roulette.
pub const LAYER_DIMENSION: u32 = 0x1000;

/// Changes the seed of the sampler for reflection or transmission.
pub const PASSAGE: u32 = 0x2c1b_3c6d;

/// Factor of a sample's index in the seed of a ray's random numbers for surfaces with partial coverage.
pub const ALPHA_OF_SAMPLE: u32 = 0x9e37_79b1;

/// Factor of the bounce, counted from 1, in the same seed.
pub const ALPHA_OF_BOUNCE: u32 = 0x85eb_ca77;

/// Offset of the bounce number for a shadow ray.
pub const ALPHA_OF_SHADOW: u32 = 0x1000;

/// Number of mirrors and surfaces of glass that denoising guides look through: two tumblers have eight surfaces.
pub const GUIDE_BOUNCES: u32 = 8;

/// Minimum albedo of guides in mirrors or through glass: the reflectance of a dielectric at normal incidence.
pub const GLOSS: f32 = 0.04;

/// Growth of a path's cone after a diffuse bounce, meters per meter: textures seen by bounced light are read coarsely,
/// which keeps their mean and removes their noise.
pub const DIFFUSE_SPREAD: f32 = 0.25;

/// Minimum distance between a pane and the next surface, meters, and meters per meter of distance to the pane.
pub const PAST: f32 = 1e-5;

/// Minimum probability of reflection and of transmission at the first surfaces of glass that a camera sees. Without it,
/// improbable highlights would be rare and very bright, and one of the two images would get too few samples.
pub const SPLIT: [f32; 2] = [0.25, 0.15];

/// Minimum α of a rough bounce.
pub const ROUGH: f32 = 0.1;
