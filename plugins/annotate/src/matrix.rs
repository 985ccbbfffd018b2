//! Matrices as products.

use syntable_model::geometry::Pose;
use syntable_model::product::{DType, Tensor, Value};

/// A matrix given row by row, as a tensor `[row, column]` of f64.
pub fn matrix<const R: usize, const C: usize>(rows: [[f64; C]; R]) -> Value {
    Value::Tensor(Tensor {
        dtype: DType::F64,
        axes: vec!["row", "column"],
        shape: vec![R, C],
        bytes: rows.iter().flatten().flat_map(|x| x.to_le_bytes()).collect(),
    })
}

/// A pose `target_from_source` as the 4 × 4 matrix that takes column vectors (x, y, z, 1).
pub fn pose(pose: &Pose) -> Value {
    let m = pose.to_homogeneous();
    matrix::<4, 4>(std::array::from_fn(|row| std::array::from_fn(|column| m[(row, column)])))
}
