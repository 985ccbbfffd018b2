//! Digests of meshes, materials and objects.

use syntable_model::digest::{Digest, Hasher};
use syntable_model::scene::{Alpha, Color, Material, Mesh, Scalar, TextureRef};

/// Sets a material's digest from everything but its name and licence.
pub fn seal(mut material: Material) -> Material {
    let mut hasher = Hasher::new("material");
    hasher = color(hasher, &material.base_color);
    hasher = scalar(hasher, &material.roughness);
    hasher = scalar(hasher, &material.metallic);
    hasher = match &material.normal {
        Some(normal) => texture(hasher.text("normal"), &normal.map).number(normal.strength.into()),
        None => hasher.text("flat"),
    };
    hasher = color(hasher, &material.emission).number(material.ior.into());
    hasher = match material.alpha {
        Alpha::Opaque => hasher.text("opaque"),
        Alpha::Mask { cutoff } => hasher.text("mask").number(cutoff.into()),
    };
    material.digest = hasher.number(material.tile_m.into()).finish();
    material
}

/// Digest of all arrays of a mesh.
pub fn mesh_digest(mesh: &Mesh) -> Digest {
    let data = mesh.data();
    let mut hasher = Hasher::new("mesh");
    hasher = array(hasher, &data.positions, f32::to_le_bytes);
    hasher = array(hasher, &data.normals, f32::to_le_bytes);
    hasher = array(hasher, &data.uvs, f32::to_le_bytes);
    hasher = array(hasher, &data.colors, f32::to_le_bytes);
    hasher = array(hasher, &data.triangles, u32::to_le_bytes);
    let slots: Vec<u8> = data.slots.iter().flat_map(|slot| slot.to_le_bytes()).collect();
    hasher.bytes(&slots).finish()
}

fn array<T: Copy, const N: usize>(mut hasher: Hasher, rows: &[[T; N]], bytes: fn(T) -> [u8; 4]) -> Hasher {
    hasher = hasher.number(rows.len() as f64);
    let mut block = Vec::with_capacity(4096 * N * 4);
    for rows in rows.chunks(4096) {
        block.clear();
        block.extend(rows.iter().flatten().flat_map(|&value| bytes(value)));
        hasher = hasher.bytes(&block);
    }
    hasher
}

fn color(hasher: Hasher, color: &Color) -> Hasher {
    let hasher = hasher.floats(color.factor.into_iter());
    match &color.texture {
        Some(reference) => texture(hasher, reference),
        None => hasher.text("constant"),
    }
}

fn scalar(hasher: Hasher, scalar: &Scalar) -> Hasher {
    let hasher = hasher.number(scalar.factor.into());
    match &scalar.texture {
        Some((reference, channel)) => texture(hasher, reference).bytes(&[*channel]),
        None => hasher.text("constant"),
    }
}

fn texture(hasher: Hasher, reference: &TextureRef) -> Hasher {
    let transform = &reference.transform;
    let [a, b] = transform.scale;
    let [c, d] = transform.offset;
    hasher.digest(reference.texture.digest).floats([a, b, transform.rotation, c, d].into_iter())
}
