//! Readers of file formats, one per module.
//!
//! Every reader checks sizes before it allocates, follows no name out of the asset's folder, and names the file and the
//! line or byte in its errors. Mesh readers produce a [`Model`](syntable_mesh::Model) in the file's own unit.

pub mod dae;
pub mod exr;
pub mod gltf;
pub mod hdr;
pub mod jpeg;
pub mod ktx2;
pub mod mtl;
pub mod obj;
pub mod ply;
pub mod png;
mod raster;
pub mod stl;
mod uncommon;
pub mod urdf;
pub mod webp;
mod xml;

use std::path::Path;
use syntable_model::context::Log;
use syntable_model::error::{Error, Place};

/// A log that names a file in warnings.
struct FormatLog<'a> {
    log: &'a dyn Log,
    path: &'a Path,
}

impl Log for FormatLog<'_> {
    fn warn(&self, warning: &Error) {
        self.log.warn(&warning.clone().in_file(self.path));
    }
}

/// Prefixes an error's message with the part of the file that it occurred in; file and place are kept.
fn within(error: Error, what: impl std::fmt::Display) -> Error {
    let message = format!("{what}: {}", error.message());
    let mut outer = if error.is_unsupported() { Error::unsupported(message) } else { Error::new(message) };
    if let Some(file) = error.file() {
        outer = outer.in_file(file);
    }
    outer = match error.place() {
        Some(Place::Line(line)) => outer.at_line(line),
        Some(Place::Byte(byte)) => outer.at_byte(byte),
        None => outer,
    };
    match error.help_text() {
        Some(help) => outer.help(help),
        None => outer,
    }
}
