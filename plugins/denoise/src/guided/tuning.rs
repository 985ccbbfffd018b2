//! How the two parts of the light are filtered. The numbers are those of least error over images of 2 to 16 samples.

/// What suits a part.
pub(super) struct Tuning {
    /// The levels that are worth their time: how far apart taps are, px, and how unlike their light may be, in standard
    /// deviations, for a strength of 1.
    pub levels: &'static [(usize, f32)],
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
pub(super) const DIFFUSE: Tuning = Tuning {
    levels: &[(1, 12.0), (2, 1.8), (4, 2.0), (8, 1.3), (16, 1.3)],
    pilot_sigmas: 4.2,
    kernel: [1.0, 0.75, 0.25],
    normal: (0.28, 0.007, 1.0),
    per_normal: 32.0,
    firefly: 1.6,
};

/// Light without: mirror images of lights and bodies, which move with the normal, and end sharply.
pub(super) const SPECULAR: Tuning = Tuning {
    levels: &[(1, 12.0), (4, 1.9)],
    pilot_sigmas: 2.0,
    kernel: [1.0, 0.92, 0.55],
    normal: (0.12, 0.008, 0.08),
    per_normal: 65.0,
    firefly: 6.0,
};
