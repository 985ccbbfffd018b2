//! The numbers of the filter, for all that run it. They are those of least error over images of 2 to 16 samples.

/// Maximum radiance, nits, so that its square is finite.
pub const MOST_NITS: f32 = 1e12;

/// Depth from which on there is a surface, m.
pub const NEAREST: f32 = 1e-6;

/// Length of the mean normal of a pixel beside the sky or a light from which on it shows a surface alone. Samples without a
/// surface have no normal.
pub const WHOLE: f32 = 0.99;

/// Assumed difference between the radiance of a pixel and the product of mean albedo and mean light, as a fraction of it.
pub const RESIDUAL: f32 = 0.2;

/// Relative distance from a pixel's plane that costs one e-fold.
pub const PLANE: f32 = 0.055;

/// At the border of bodies: what a squared difference of normals costs, as a fraction of what it costs elsewhere.
pub const BORDER_NORMAL: f32 = 0.37;

/// At the border of bodies: e-folds for each squared difference of the colors' luminance.
pub const BORDER_COLOR: f32 = 17.0;

/// E-folds from which on a tap is worth nothing.
pub const END: f32 = 8.0;

/// Radius of the window that estimates fireflies and noise, px.
pub const REACH: i32 = 3;

/// Sum of the weights of similar neighbors, in taps, from which on a firefly is told from them.
pub const FEWEST: f32 = 3.0;

/// Number of standard deviations below a pixel's own estimate up to which its light is never clamped.
pub const SURE: f32 = 3.0;

/// Weight, in taps, of the window without guides, so that a pixel without similar neighbors does not count as noise-free.
pub const PRIOR: f32 = 0.7;

/// Edge of the squares over which light is added up to restore the energy, px.
pub const CELL: u32 = 32;

/// Weights by which sums of neighboring squares are added: a binomial of variance 1.
pub const CELL_WEIGHTS: [f32; 5] = [1.0, 4.0, 6.0, 4.0, 1.0];

/// Light of a pixel that counts at most in these sums, as a multiple of what it is after the filter.
pub const MOST_RESTORED: f32 = 30.0;

/// What a dark pixel counts as in that, as a fraction of the mean.
pub const LEAST_RESTORED: f32 = 0.05;

/// What suits a part of the light.
pub struct Tuning {
    /// The levels that are worth their time: how far apart taps are, px, and how unlike their light may be, in standard
    /// deviations, for a strength of 1.
    pub levels: &'static [(u32, f32)],
    /// The same for the means that the first level compares.
    pub pilot_sigmas: f32,
    /// Weights of a tap by its distance along an axis.
    pub kernel: [f32; 3],
    /// Squared difference of normals that costs one e-fold, for noise as strong as the light; and between which bounds.
    pub normal: (f32, f32, f32),
    /// What a squared difference of normals costs in the window that estimates fireflies and noise.
    pub per_normal: f32,
    /// A pixel is a firefly from so many standard deviations of its neighbors above their mean.
    pub firefly: f32,
}

/// Light with the surface's color: even over wide areas once it is divided by that color.
pub const DIFFUSE: Tuning = Tuning {
    levels: &[(1, 12.0), (2, 1.8), (4, 2.0), (8, 1.3), (16, 1.3)],
    pilot_sigmas: 4.2,
    kernel: [1.0, 0.75, 0.25],
    normal: (0.28, 0.007, 1.0),
    per_normal: 32.0,
    firefly: 1.6,
};

/// Light without: mirror images of lights and bodies, which move with the normal, and end sharply.
pub const SPECULAR: Tuning = Tuning {
    levels: &[(1, 12.0), (4, 1.9)],
    pilot_sigmas: 2.0,
    kernel: [1.0, 0.92, 0.55],
    normal: (0.12, 0.008, 0.08),
    per_normal: 65.0,
    firefly: 6.0,
};

impl Tuning {
    /// The levels of a filter that has `levels` of them: how far apart taps are, px, and how unlike their light may be, in
    /// standard deviations, for a strength of 1.
    pub fn levels(&self, levels: u32) -> impl Iterator<Item = (u32, f32)> {
        self.levels.iter().copied().take_while(move |(step, _)| step.checked_shr(levels).unwrap_or(0) == 0)
    }
}
