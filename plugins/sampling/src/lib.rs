//! Cameras, view samplers and light samplers.
//!
//! - Camera: [`Pinhole`].
//! - Views: [`HemisphereShell`] (the paper's), [`Orbit`], [`FixedPoses`].
//! - Lights: [`SphereLights`] (the paper's), [`CeilingLight`].
//!
//! **Invariants.** A view's pose and lights are functions of the scene, the view's number and the stream. Distances
//! are metres, light is photometric: an option in lux is the illuminance that a light alone gives, unoccluded, at the
//! middle of the tabletop.

mod ceiling_light;
mod exposure;
mod fixed_poses;
mod hemisphere_shell;
mod orbit;
mod pinhole;
mod radius;
mod shell;
mod sphere_lights;

pub use ceiling_light::CeilingLight;
pub use fixed_poses::FixedPoses;
pub use hemisphere_shell::HemisphereShell;
pub use orbit::Orbit;
pub use pinhole::Pinhole;
pub use sphere_lights::SphereLights;
