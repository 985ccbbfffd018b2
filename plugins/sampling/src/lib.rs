//! Cameras, view samplers and light samplers.
//!
//! - Camera: [`Pinhole`].
//! - Views: [`HemisphereShell`] (the paper's), [`Orbit`], [`FixedPoses`].
//! - Lights: [`SphereLights`] (the paper's), [`CeilingLight`], [`WindowLight`], [`Environment`], [`Sun`].
//!
//! **Invariants.** A view's pose and lights are functions of the scene, the view's number and the stream. Distances
//! are metres, light is photometric: an option in lux is the illuminance that a light alone gives, unoccluded, at the
//! middle of the tabletop: on a plane that faces a lamp, on the level plane for windows and the sky.

mod brightness;
mod ceiling_light;
mod environment;
mod exposure;
mod fixed_poses;
mod hemisphere_shell;
mod lens;
mod orbit;
mod per;
mod pinhole;
mod radius;
mod room;
mod shell;
mod sphere_lights;
mod sun;
mod window_light;

pub use ceiling_light::CeilingLight;
pub use environment::Environment;
pub use fixed_poses::FixedPoses;
pub use hemisphere_shell::HemisphereShell;
pub use orbit::Orbit;
pub use pinhole::Pinhole;
pub use sphere_lights::SphereLights;
pub use sun::Sun;
pub use window_light::WindowLight;
