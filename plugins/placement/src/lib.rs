//! Placers: room, table, and objects dropped from a box.
//!
//! **Invariants.** Every draw comes from a named child of the stage's stream, one per surface or object, so that what
//! is drawn for one thing does not depend on how many draws another took. Poses put the middle of a mesh's bounding
//! box where it should be, whatever the mesh's own origin.

mod drop_box;
mod oriented_box;
mod room;
mod table;

pub use drop_box::DropBox;
pub use room::Room;
pub use table::Table;

use syntable_model::prelude::*;
use syntable_model::scene::{Surface, TextureMapping};

/// A material drawn from a pool, laid over a body in metres, turned and shifted at random.
fn drawn_surface(
    pool: &MaterialPool,
    rotation_deg: &Dist,
    assets: &dyn syntable_model::context::Assets,
    stream: &Stream,
) -> Result<Surface> {
    let (_, material) = assets.draw_material(pool, &mut stream.child("material"))?;
    let mut texture = stream.child("texture");
    let rotation = rotation_deg.draw(&mut texture).to_radians() as f32;
    let offset = [texture.unit() as f32, texture.unit() as f32];
    Ok(Surface { material, mapping: TextureMapping::Box { rotation, offset } })
}

/// Any angle.
fn any_angle_deg() -> Dist {
    Dist::Uniform(0.0, 360.0)
}
