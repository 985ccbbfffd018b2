//! Digests of meshes.

use syntable_model::digest::{Digest, Hasher};
use syntable_model::scene::Mesh;

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
