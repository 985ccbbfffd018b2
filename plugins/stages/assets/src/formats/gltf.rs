//! glTF 2.0, text and binary: all nodes of a scene baked into one mesh.
//!
//! Node transforms place meshes, instances are expanded, and y up becomes z up. Skins and morph targets take the pose
//! of nodes and weights; animations are ignored. An unknown extension that the file requires is an error; others are
//! ignored, with a warning if they change the appearance. This module, not the library, resolves the buffers and images
//! that a file names, so no file outside the asset's folder is read, and no memory is allocated unchecked.

use super::{FormatLog, within};
use buffers::GltfBuffers;
use container::GltfFile;
use gltf::json::Root;
use items::get;
use materials::GltfMaterials;
use nodes::MeshInstance;
use primitive::{Deformation, PrimitiveArrays};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;
use syntable_mesh::Model;
use syntable_mesh::format::MeshFormat;
use syntable_mesh::paint::{VertexAlpha, blend_by_vertex};
use syntable_mesh::root::AssetRoot;
use syntable_mesh::text::shorten;
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::scene::MeshData;

mod accessor;
mod buffers;
mod container;
mod draco;
mod items;
mod layers;
mod materials;
mod meshopt;
mod nodes;
mod primitive;
mod specular_glossiness;
mod uses;

/// Extensions that are read, or that change nothing here.
const READ: [&str; 22] = [
    "KHR_texture_transform",
    "KHR_mesh_quantization",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_clearcoat",
    "KHR_materials_sheen",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_materials_specular",
    "KHR_materials_anisotropy",
    "KHR_materials_unlit",
    "KHR_materials_pbrSpecularGlossiness",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    draco::DRACO,
    // A version of an image in another format; a PNG or JPEG is preferred.
    "KHR_texture_basisu",
    "EXT_texture_webp",
    // Lights, animations, licenses and alternative materials are not part of an object.
    "KHR_lights_punctual",
    "KHR_animation_pointer",
    "KHR_materials_variants",
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

/// Extensions that encode meshes, and tools that convert files without plain meshes. A file that does not require the
/// extension has plain meshes, too.
const ENCODED: [(&str, &str); 1] =
    [("KHR_meshopt_compression", "convert it: `gltf-transform copy in.glb out.glb` unpacks meshopt")];

/// Reads a file of `root`, named relative to it: meters, z up.
pub fn read(root: &AssetRoot, file: &Path, log: &dyn Log) -> Result<Model> {
    let path = root.locate(file)?;
    let at = |error: Error| error.in_file(&path);
    let bytes = root.read(&path)?;
    let GltfFile { document, binary, animated } = container::open(&bytes, root.budget()).map_err(at)?;
    check_extensions(&document, &path, log).map_err(at)?;
    if animated {
        log.warn(&at(Error::new("animations are not supported; the object takes its default pose")));
    }
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut buffers = GltfBuffers::new(&document, binary, root, folder, &path, log);
    bake(&document, &mut buffers, &path, log).map_err(at)
}

fn check_extensions(document: &Root, path: &Path, log: &dyn Log) -> Result<()> {
    let unknown = |name: &&String| !READ.contains(&name.as_str());
    if let Some(name) = document.extensions_required.iter().find(unknown) {
        let help = ENCODED.iter().find(|(known, _)| known == name).map(|(_, help)| *help);
        return Err(Error::new(format!("the file requires the extension `{}`, which is not supported", shorten(name)))
            .help(help.unwrap_or("export it without that extension")));
    }
    // Encoded data of an optional extension also exist in plain form.
    if document.extensions_used.iter().any(|name| name == "KHR_materials_variants") {
        let message =
            "material variants (KHR_materials_variants) are not supported; the object gets its default materials";
        log.warn(&Error::new(message).in_file(path));
    }
    let ignored = document.extensions_used.iter().filter(unknown);
    let ignored: Vec<String> =
        ignored.filter(|name| ENCODED.iter().all(|(known, _)| known != name)).map(|name| shorten(name)).collect();
    if !ignored.is_empty() {
        log.warn(
            &Error::new(format!("extensions {} are ignored; the appearance may differ", ignored.join(", ")))
                .in_file(path),
        );
    }
    Ok(())
}

/// The inputs of a mesh's shape: its index, the bits of its weights, and whether a skin poses it.
type ShapeKey = (usize, Vec<u32>, bool);

fn key(instance: &MeshInstance) -> ShapeKey {
    let Deformation { weights, skinned } = instance.shape();
    (instance.mesh.value(), weights.iter().map(|weight| weight.to_bits()).collect(), skinned)
}

fn bake(document: &Root, buffers: &mut GltfBuffers<'_>, path: &Path, log: &dyn Log) -> Result<Model> {
    let instances = nodes::instances(document, buffers)?;
    let mut materials = GltfMaterials::new(document, path, log);
    // Every primitive is read once per shape, however often it is placed. The sum is checked before any is placed.
    let mut primitives: BTreeMap<ShapeKey, Vec<PrimitiveArrays>> = BTreeMap::new();
    let (mut vertices, mut triangles) = (0, 0);
    for instance in &instances {
        let mesh = get(&document.meshes, instance.mesh, "mesh")?;
        let index = instance.mesh.value();
        let found = match primitives.entry(key(instance)) {
            Entry::Occupied(entry) => entry.into_mut(),
            Entry::Vacant(entry) => {
                let (mut found, mut placed) = (Vec::new(), triangles);
                for (i, primitive) in mesh.primitives.iter().enumerate() {
                    let read =
                        PrimitiveArrays::read(document, buffers, primitive, &mut materials, instance.shape(), placed);
                    if let Some(read) = read.map_err(|error| within(error, format!("mesh {index}, primitive {i}")))? {
                        placed += read.triangles.len();
                        found.push(read);
                    }
                }
                entry.insert(found)
            }
        };
        for primitive in found {
            vertices += primitive.positions.len();
            triangles += primitive.triangles.len();
        }
        buffers.budget().triangles(triangles)?;
        buffers.budget().vertices(vertices)?;
    }
    if triangles == 0 {
        return Err(Error::new("no faces").help("check that the scene has a mesh of triangles"));
    }

    let has = |part: fn(&PrimitiveArrays) -> bool| primitives.values().flatten().any(part);
    let (normals, uvs, colors) =
        (has(|p| !p.normals.is_empty()), has(|p| !p.uvs.is_empty()), has(|p| !p.colors.is_empty()));
    let mut mesh = MeshData::default();
    let has_alphas = primitives.values().flatten().any(|primitive| !primitive.alphas.is_empty());
    let mut alphas = Vec::new();
    for instance in &instances {
        for primitive in &primitives[&key(instance)] {
            let base = mesh.positions.len() as u32;
            let count = primitive.positions.len();
            let mut orientation = 0.0;
            for (vertex, &p) in primitive.positions.iter().enumerate() {
                let placement = instance
                    .placement(primitive, vertex)
                    .map_err(|error| within(error, format!("node {}", instance.node)))?;
                let p = placement.point(p);
                if !p.iter().all(|x| x.is_finite()) {
                    return Err(Error::new(format!("node {} gives a non-finite vertex: {p:?}", instance.node)));
                }
                mesh.positions.push(p);
                if normals {
                    // Missing normals are zero; the repair computes them from the faces.
                    let n = primitive.normals.get(vertex).map_or([0.0; 3], |&n| placement.normal(n));
                    mesh.normals.push(n);
                }
                orientation += placement.determinant().signum();
            }
            if uvs {
                mesh.uvs.extend(&primitive.uvs);
                mesh.uvs.resize(mesh.positions.len(), [0.0; 2]);
            }
            if colors {
                mesh.colors.extend(&primitive.colors);
                mesh.colors.resize(mesh.positions.len(), [1.0; 3]);
            }
            if has_alphas {
                alphas.extend(&primitive.alphas);
                alphas.resize(mesh.positions.len(), 1.0);
            }
            debug_assert_eq!(mesh.positions.len(), base as usize + count);
            let mirrored = orientation < 0.0;
            mesh.triangles.extend(primitive.triangles.iter().map(|&[a, b, c]| {
                let [b, c] = if mirrored { [c, b] } else { [b, c] };
                [base + a, base + b, base + c]
            }));
            mesh.slots.resize(mesh.triangles.len(), primitive.slot);
        }
    }
    let meaning = materials.vertex_alpha();
    let is_ignored = |primitive: &PrimitiveArrays| {
        !primitive.alphas.is_empty() && meaning[usize::from(primitive.slot)] == VertexAlpha::Ignored
    };
    if primitives.values().flatten().any(is_ignored) {
        materials.warn("the alpha of COLOR_0 is ignored where `alphaMode` is OPAQUE, as the standard requires");
    }
    let mut model = Model { mesh, materials: materials.into_slots(buffers)? };
    let log = FormatLog { log, path };
    blend_by_vertex(&mut model, &alphas, |slot| meaning.get(slot).copied().unwrap_or(VertexAlpha::Ignored), &log);
    Ok(model)
}

syntable_mesh::register_mesh_format!(
    MeshFormat::new("glTF", &["glb", "gltf"], read).with_stated_up_axis().with_preference(40)
);
