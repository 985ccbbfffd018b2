//! PFM files: one plane of 32-bit floats.

use syntable_model::product::Plane;

/// The bytes of a PFM file: a text header, then the rows from the bottom up, little-endian.
pub fn encode(plane: &Plane<f32>) -> Vec<u8> {
    let mut file = format!("Pf\n{} {}\n-1.000000\n", plane.width(), plane.height()).into_bytes();
    for row in plane.data().chunks_exact(plane.width() as usize).rev() {
        file.extend(row.iter().flat_map(|value| value.to_le_bytes()));
    }
    file
}
