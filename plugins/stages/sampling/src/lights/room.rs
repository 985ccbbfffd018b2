//! The free space around a support.

use syntable_model::geometry::{Aabb, space_around};
use syntable_model::scene::{Role, Scene, Support};

/// The inside of the room around the center of a support; infinite in directions without a wall, floor or ceiling.
pub fn inside(scene: &Scene, support: &Support) -> Aabb {
    let parts = scene.bodies().iter().filter(|body| body.role == Role::Room);
    let boxes = parts.map(|body| Aabb::of(body.object.mesh.bounds().corners().map(|p| body.world_from_body * p)));
    space_around(&support.center(), boxes)
}
