//! Constants of the filter, shared by all implementations. They minimize the error over images of 2 to 16 samples.

/// Maximum radiance, nits, so that its square is finite.
pub const MOST_NITS: f32 = 1e12;

/// Minimum depth of a surface, m.
pub const NEAREST: f32 = 1e-6;

/// Minimum length of the mean normal of a pixel next to the sky or a light that shows only a surface. Samples without a
/// surface have no normal.
pub const WHOLE: f32 = 0.99;

/// Assumed difference between the radiance of a pixel and the product of mean albedo and mean light, as a fraction of
/// the radiance.
pub const RESIDUAL: f32 = 0.2;

/// Relative distance from a pixel's plane that costs one e-fold.
pub const PLANE: f32 = 0.055;

/// At the border of bodies: cost of a squared difference of normals, relative to its cost elsewhere.
pub const BORDER_NORMAL: f32 = 0.37;

/// At the border of bodies: cost of a squared difference of the colors' luminance, e-folds.
pub const BORDER_COLOR: f32 = 17.0;

/// Cost from which a tap has no weight, e-folds.
pub const END: f32 = 8.0;

/// Radius of the window that estimates fireflies and noise, px.
pub const REACH: i32 = 3;

/// Minimum sum of the weights of similar neighbors, in taps, to detect a firefly by comparison with them.
pub const FEWEST: f32 = 3.0;

/// Number of standard deviations below a pixel's own estimate up to which its light is never clamped.
pub const SURE: f32 = 3.0;

/// Weight, in taps, of the window without guides, so that a pixel without similar neighbors does not count as
/// noise-free.
pub const PRIOR: f32 = 0.7;

/// Edge of the squares over which light is summed to restore the energy, px.
pub const CELL: u32 = 32;

/// Weights for summing neighboring squares: a binomial of variance 1.
pub const CELL_WEIGHTS: [f32; 5] = [1.0, 4.0, 6.0, 4.0, 1.0];

/// Limit of a pixel's light in these sums, as a multiple of its light after the filter.
pub const MOST_RESTORED: f32 = 30.0;

/// Minimum of that light after the filter, as a fraction of the mean over the image, so that dark pixels count.
pub const LEAST_RESTORED: f32 = 0.05;

/// Constants for a part of the light.
pub struct Tuning {
    /// Useful levels: distance of the taps, px, and tolerated difference of their light, in standard deviations, for a
    /// strength of 1.
    pub levels: &'static [(u32, f32)],
    /// Tolerated difference of the means that the first level compares, in standard deviations, for a strength of 1.
    pub pilot_sigmas: f32,
    /// Weights of a tap by its distance along an axis.
    pub kernel: [f32; 3],
    /// Squared difference of normals that costs one e-fold if the noise is as strong as the light; and its minimum and
    /// maximum.
    pub normal: (f32, f32, f32),
    /// Cost of a squared difference of normals in the window that estimates fireflies and noise, e-folds.
    pub per_normal: f32,
    /// A pixel is a firefly if it exceeds the mean of its neighbors by this number of their standard deviations.
    pub firefly: f32,
}

/// Light with the surface's color. Divided by that color, it is even over wide areas.
pub const DIFFUSE: Tuning = Tuning {
    levels: &[(1, 12.0), (2, 1.8), (4, 2.0), (8, 1.3), (16, 1.3)],
    pilot_sigmas: 4.2,
    kernel: [1.0, 0.75, 0.25],
    normal: (0.28, 0.007, 1.0),
    per_normal: 32.0,
    firefly: 1.6,
};

/// Light without the surface's color: mirror images of lights and bodies, which move with the normal, and end sharply.
pub const SPECULAR: Tuning = Tuning {
    levels: &[(1, 12.0), (4, 1.9)],
    pilot_sigmas: 2.0,
    kernel: [1.0, 0.92, 0.55],
    normal: (0.12, 0.008, 0.08),
    per_normal: 65.0,
    firefly: 6.0,
};

impl Tuning {
    /// The levels of a filter with `levels` levels: distance of the taps, px, and tolerated difference of their light,
    /// in standard deviations, for a strength of 1.
    pub fn levels(&self, levels: u32) -> impl Iterator<Item = (u32, f32)> {
        self.levels.iter().copied().take_while(move |(step, _)| step.checked_shr(levels).unwrap_or(0) == 0)
    }
}
