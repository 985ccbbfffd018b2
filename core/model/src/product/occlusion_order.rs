//! The occlusion order of a view.

use crate::scene::InstanceId;

/// Who occludes whom in a view: SynTable's occlusion order adjacency matrix (OOAM), Algorithm 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OcclusionOrder {
    ids: Vec<InstanceId>,
    matrix: Vec<bool>,
}

impl OcclusionOrder {
    /// No occlusion between the given instances, which must be in id order.
    pub fn new(ids: Vec<InstanceId>) -> Self {
        let matrix = vec![false; ids.len() * ids.len()];
        Self { ids, matrix }
    }

    /// The instances of rows and columns, in id order.
    pub fn ids(&self) -> &[InstanceId] {
        &self.ids
    }

    /// Whether the instance of row `i` occludes the instance of column `j`.
    pub fn occludes(&self, i: usize, j: usize) -> bool {
        self.matrix[i * self.ids.len() + j]
    }

    /// Sets that row `i` occludes column `j`.
    pub fn set(&mut self, i: usize, j: usize) {
        let n = self.ids.len();
        self.matrix[i * n + j] = true;
    }

    /// The matrix, row by row.
    pub fn matrix(&self) -> &[bool] {
        &self.matrix
    }
}
