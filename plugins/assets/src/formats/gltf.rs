//! glTF 2.0, text and binary: all nodes of a scene baked into one mesh.
//!
//! Meshes are placed by their nodes' transforms, instances are expanded, y up becomes z up. Skins and animations
//! stay in their rest pose. An unknown extension that the file requires is an error; others are ignored, with a
//! warning where they change the appearance. The buffers and images that a file names are resolved here, not by the
//! library, so that nothing is read from outside the asset's folder and nothing is allocated unchecked.

use super::within;
use buffers::Buffers;
use gltf::json::{Index, Root};
use materials::Materials;
use primitive::Primitive;
use std::collections::BTreeMap;
use std::path::Path;
use syntable_mesh::Model;
use syntable_mesh::format::MeshFormat;
use syntable_mesh::limits::check_triangles;
use syntable_mesh::root::{AssetRoot, read_file};
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::scene::MeshData;

mod accessor;
mod buffers;
mod container;
mod layers;
mod materials;
mod nodes;
mod primitive;
mod uses;

/// Extensions that are read, or that change nothing here.
const READ: [&str; 14] = [
    "KHR_texture_transform",
    "KHR_mesh_quantization",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_clearcoat",
    "KHR_materials_sheen",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    // A second version of an image in another format; the PNG or JPEG is read.
    "KHR_texture_basisu",
    "EXT_texture_webp",
    // Lights, licenses and alternative materials are not part of an object.
    "KHR_lights_punctual",
    "KHR_materials_variants",
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

/// Reads a file of `root`, named relative to it: meters, z up.
pub fn read(root: &AssetRoot, file: &Path, log: &dyn Log) -> Result<Model> {
    let path = root.locate(file)?;
    let at = |error: Error| error.in_file(&path);
    let bytes = read_file(&path)?;
    let (document, binary) = container::open(&bytes).map_err(at)?;
    check_extensions(&document, &path, log).map_err(at)?;
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut buffers = Buffers::new(&document, binary, root, folder);
    bake(&document, &mut buffers, &path, log).map_err(at)
}

fn check_extensions(document: &Root, path: &Path, log: &dyn Log) -> Result<()> {
    let unknown = |name: &&String| !READ.contains(&name.as_str());
    if let Some(name) = document.extensions_required.iter().find(unknown) {
        return Err(Error::new(format!("the file requires the extension `{name}`, which is not read"))
            .help("export it without that extension"));
    }
    let ignored: Vec<&str> = document.extensions_used.iter().filter(unknown).map(String::as_str).collect();
    if !ignored.is_empty() {
        log.warn(
            &Error::new(format!("extensions {} are ignored; the appearance may differ", ignored.join(", ")))
                .in_file(path),
        );
    }
    Ok(())
}

/// An item by its index, or an error that names both.
fn get<'a, T>(items: &'a [T], index: Index<T>, what: &str) -> Result<&'a T> {
    items
        .get(index.value())
        .ok_or_else(|| Error::new(format!("{what} {} is named, but there are {}", index.value(), items.len())))
}

fn bake(document: &Root, buffers: &mut Buffers<'_>, path: &Path, log: &dyn Log) -> Result<Model> {
    let warn = |message: &str| log.warn(&Error::new(message).in_file(path));
    let instances = nodes::instances(document)?;
    if !document.animations.is_empty() || !document.skins.is_empty() {
        warn("animations and skins are not read; the mesh stays in its rest pose");
    }
    let mut materials = Materials::new(document, path, log);
    // Every primitive is read once, however often it is placed. The sum is checked before anything is placed.
    let mut primitives: BTreeMap<usize, Vec<Primitive>> = BTreeMap::new();
    let (mut vertices, mut triangles) = (0, 0);
    for instance in &instances {
        let mesh = get(&document.meshes, instance.mesh, "mesh")?;
        let index = instance.mesh.value();
        if let std::collections::btree_map::Entry::Vacant(entry) = primitives.entry(index) {
            let read = |(i, primitive)| {
                Primitive::read(document, buffers, primitive, &mut materials)
                    .map_err(|error| within(error, format!("mesh {index}, primitive {i}")))
            };
            let found: Result<Vec<_>> = mesh.primitives.iter().enumerate().map(read).collect();
            entry.insert(found?.into_iter().flatten().collect());
        }
        for primitive in &primitives[&index] {
            vertices += primitive.positions.len();
            triangles += primitive.triangles.len();
        }
        check_triangles(triangles.max(vertices))?;
    }
    if triangles == 0 {
        return Err(Error::new("no faces").help("is there a scene with a mesh of triangles?"));
    }

    let has = |part: fn(&Primitive) -> bool| primitives.values().flatten().any(part);
    let (normals, uvs, colors) =
        (has(|p| !p.normals.is_empty()), has(|p| !p.uvs.is_empty()), has(|p| !p.colors.is_empty()));
    let mut mesh = MeshData::default();
    for instance in &instances {
        for primitive in &primitives[&instance.mesh.value()] {
            let base = mesh.positions.len() as u32;
            let count = primitive.positions.len();
            for &p in &primitive.positions {
                let p = instance.transform_point(p);
                if !p.iter().all(|x| x.is_finite()) {
                    return Err(Error::new(format!("node {} gives a non-finite vertex: {p:?}", instance.node)));
                }
                mesh.positions.push(p);
            }
            if normals {
                // Missing normals are zero; the repair computes them from the faces.
                mesh.normals.extend(primitive.normals.iter().map(|&n| instance.transform_normal(n)));
                mesh.normals.resize(mesh.positions.len(), [0.0; 3]);
            }
            if uvs {
                mesh.uvs.extend(&primitive.uvs);
                mesh.uvs.resize(mesh.positions.len(), [0.0; 2]);
            }
            if colors {
                mesh.colors.extend(&primitive.colors);
                mesh.colors.resize(mesh.positions.len(), [1.0; 3]);
            }
            debug_assert_eq!(mesh.positions.len(), base as usize + count);
            let mirrored = instance.mirrors();
            mesh.triangles.extend(primitive.triangles.iter().map(|&[a, b, c]| {
                let [b, c] = if mirrored { [c, b] } else { [b, c] };
                [base + a, base + b, base + c]
            }));
            mesh.slots.resize(mesh.triangles.len(), primitive.slot);
        }
    }
    Ok(Model { mesh, materials: materials.into_slots(buffers)? })
}

syntable_mesh::register_mesh_format!(
    MeshFormat::new("glTF", &["glb", "gltf"], read).with_stated_up_axis().with_preference(40)
);
