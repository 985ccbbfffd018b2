//! Camera models, view samplers and light samplers.
//!
//! - [`camera`]: `pinhole`, `fisheye`, `recorded`.
//! - [`views`]: `hemisphere_shell` (the paper's), `orbit`, `fixed_poses`, `recorded`.
//! - [`lights`]: `sphere_lights` (the paper's), `ceiling_light`, `window_light`, `flash`, `sun`, `environment`.
//!
//! Every kind is in a file of its name; `common` holds the geometry that views and lights share.
//!
//! **Invariants.** The pose and the lights of a view are functions of the scene, the view's number and the random
//! stream. Lengths are in meters. Light is photometric: an option in lux is the unoccluded illuminance of the light
//! alone at the center of a support such as the tabletop, on a plane that faces the light, or on the horizontal plane
//! for windows and environments.

pub mod camera;
mod common;
pub mod lights;
pub mod views;
