//! Readers of file formats, one a module.
//!
//! Every reader checks before it allocates, follows no name out of the asset's folder, and names the file and the
//! line or byte in its errors. Mesh readers give a [`Model`] in the file's own unit, z up.

mod base64;
pub mod environment;
pub mod exr;
pub mod gltf;
pub mod hdr;
pub mod mtl;
pub mod obj;
pub mod picture;
pub mod ply;
pub mod polygon;
pub mod stl;
mod text;

use syntable_model::error::{Error, Place};
use syntable_model::scene::{Material, MeshData};

/// Most triangles that a model may have, after instances are counted out.
pub const MAX_TRIANGLES: usize = 16_000_000;

/// A shape and its materials as a file gives them: not yet cleaned, weighed or checked.
#[derive(Debug, Clone)]
pub struct Model {
    /// The shape, z up, in the file's unit.
    pub mesh: MeshData,
    /// Materials by slot; never empty.
    pub materials: Vec<Material>,
}

impl Model {
    /// The model in another unit: positions times a factor.
    pub fn scaled(mut self, factor: f64) -> Self {
        for p in &mut self.mesh.positions {
            *p = p.map(|x| (f64::from(x) * factor) as f32);
        }
        self
    }

    /// The model with y up turned to z up: (x, y, z) becomes (x, -z, y).
    pub fn y_up_to_z_up(mut self) -> Self {
        for p in self.mesh.positions.iter_mut().chain(&mut self.mesh.normals) {
            *p = [p[0], -p[2], p[1]];
        }
        self
    }
}

/// Says within what an error was found, ahead of its message and after the file.
fn within(error: Error, what: impl std::fmt::Display) -> Error {
    let mut outer = Error::new(format!("{what}: {}", error.message()));
    if let Some(file) = error.file() {
        outer = outer.in_file(file);
    }
    outer = match error.place() {
        Some(Place::Line(line)) => outer.at_line(line),
        Some(Place::Byte(byte)) => outer.at_byte(byte),
        None => outer,
    };
    match error.way_out() {
        Some(help) => outer.help(help),
        None => outer,
    }
}

/// The error for a model with more than [`MAX_TRIANGLES`].
fn too_many_triangles() -> Error {
    Error::new(format!("the model has more than {MAX_TRIANGLES} triangles")).help("simplify the mesh before use")
}

/// The material of surfaces that name none, neither shiny nor dull: light grey, or white where vertices have colours of
/// their own.
fn default_material(coloured: bool) -> Material {
    Material::plain("default", if coloured { [1.0; 3] } else { [0.6; 3] }, 0.5)
}
