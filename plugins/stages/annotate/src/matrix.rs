//! Matrices as products.

use syntable_model::geometry::Pose;

/// A pose `target_from_source` as the 4 × 4 matrix, row by row, that maps column vectors (x, y, z, 1).
pub fn pose(pose: &Pose) -> [[f64; 4]; 4] {
    let m = pose.to_homogeneous();
    std::array::from_fn(|row| std::array::from_fn(|column| m[(row, column)]))
}
