//! `KHR_draco_mesh_compression`: primitives whose triangles and attributes Draco packs together.

use super::accessor::{bytes_of, component_size, width};
use super::buffers::{GltfBuffers, UnpackedArrays};
use super::items::get;
use crate::formats::within;
use draco_core::{DecodeLimits, DecoderBuffer, DracoError, ErrorKind, Mesh, MeshDecoder};
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Index, Root};
use serde::Deserialize;
use std::collections::BTreeMap;
use syntable_model::error::{Error, Result};
use syntable_model::panics::guarded;

/// The extension that packs primitives.
pub const DRACO: &str = "KHR_draco_mesh_compression";

/// The extension of a primitive.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct PackedPrimitive {
    /// The view with the packed bytes.
    buffer_view: u32,
    /// Attributes of the packed mesh by the names of the primitive's attributes.
    attributes: BTreeMap<String, u32>,
}

/// Unpacks a primitive: its attributes go into the buffers, which then give them instead of the accessors' views, and the corners of its
/// triangles are returned. `None` if the primitive is not packed, or has plain arrays as well. `placed` is the number of
/// triangles of the model so far.
pub fn unpack(
    document: &Root,
    buffers: &mut GltfBuffers<'_>,
    primitive: &Primitive,
    placed: usize,
) -> Result<Option<Vec<u32>>> {
    buffers.unpacked_arrays = UnpackedArrays::default();
    let Some(json) = primitive.extensions.as_ref().and_then(|extensions| extensions.others.get(DRACO)) else {
        return Ok(None);
    };
    if let Some(&position) = primitive.attributes.get(&Checked::Valid(Semantic::Positions))
        && get(&document.accessors, position, "accessor")?.buffer_view.is_some()
    {
        return Ok(None);
    }
    let of_extension = |error: Error| within(error, DRACO);
    let packed = PackedPrimitive::deserialize(json).map_err(|error| of_extension(Error::new(error.to_string())))?;
    if let Some(indices) = primitive.indices {
        let stated = get(&document.accessors, indices, "accessor")?.count.0 / 3;
        buffers.budget().triangles(placed.saturating_add(usize::try_from(stated).unwrap_or(usize::MAX)))?;
    }
    let mesh = decode(buffers, &packed, placed).map_err(of_extension)?;
    let budget = buffers.budget();
    let vertices = mesh.num_points();
    budget.bytes(mesh.num_faces() as u64 * size_of::<[u32; 3]>() as u64)?;
    let mut arrays = UnpackedArrays { count: vertices as u64, bytes: BTreeMap::new() };
    for (semantic, &index) in &primitive.attributes {
        let name = semantic.to_string();
        let Some(&id) = packed.attributes.get(&name).filter(|_| name != "TANGENT") else { continue };
        let (accessor, width) = (get(&document.accessors, index, "accessor")?, width(document, index)?);
        let wrong = |what: String| of_extension(Error::new(format!("{name}: {what}")));
        let attribute = mesh.attribute_by_unique_id(id).ok_or_else(|| wrong(format!("no packed attribute {id}")))?;
        if usize::from(attribute.num_components()) != width {
            let found = attribute.num_components();
            return Err(wrong(format!("{found} packed numbers per vertex, but the accessor has {width}")));
        }
        let numbers = (vertices as u64).saturating_mul(width as u64);
        // Numbers are held as floats before they get the accessor's type.
        budget.bytes(numbers.saturating_mul(size_of::<f32>() as u64 + component_size(accessor)? as u64))?;
        arrays.bytes.insert(index.value(), bytes_of(accessor, &attribute.read_f32s(vertices, width))?);
    }
    buffers.unpacked_arrays = arrays;
    Ok(Some(mesh.faces().iter().flatten().map(|point| point.0).collect()))
}

fn decode(buffers: &mut GltfBuffers<'_>, packed: &PackedPrimitive, placed: usize) -> Result<Mesh> {
    let (budget, file) = (buffers.budget(), buffers.file());
    let limits = DecodeLimits::default()
        .with_max_faces(budget.triangles_left(placed) as u64)
        .with_max_decoded_bytes(budget.bytes_left());
    let (bytes, _) = buffers.view(Index::new(packed.buffer_view))?;
    let refuse = |error: DracoError| match error.kind() {
        ErrorKind::LimitExceeded => Error::new(format!("the packed mesh is too large: {error}"))
            .help("raise `triangles` or `megabytes` in the pool's `limits`, or simplify the mesh"),
        _ => Error::new(format!("not valid Draco data: {error}")),
    };
    guarded("the library that reads Draco", file, || {
        let mut mesh = Mesh::new();
        MeshDecoder::new().decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh).map_err(refuse)?;
        Ok(mesh)
    })
}
