//! Cameras, view samplers and light samplers.

pub mod ceiling_light;
pub mod fixed_poses;
pub mod hemisphere_shell;
pub mod pinhole;
pub mod sphere_lights;

mod colour;
mod dome;
