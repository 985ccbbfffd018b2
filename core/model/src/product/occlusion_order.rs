//! The occlusion order of a view.

use crate::scene::InstanceId;
use std::sync::OnceLock;

/// Who occludes whom in a view: SynTable's occlusion order adjacency matrix (OOAM), Algorithm 1.
///
/// Each object occludes few others, so that memory holds the pairs, and the matrix only for code that asks for it.
#[derive(Debug, Clone)]
pub struct OcclusionOrder {
    ids: Vec<InstanceId>,
    /// For each row, the columns that are set, ascending. Rows are at most as many as ids of 16 bits.
    behind: Vec<Vec<u16>>,
    /// The matrix of `behind`, from its first use to the next change.
    matrix: OnceLock<Vec<bool>>,
}

impl PartialEq for OcclusionOrder {
    fn eq(&self, other: &Self) -> bool {
        (&self.ids, &self.behind) == (&other.ids, &other.behind)
    }
}

impl Eq for OcclusionOrder {}

impl OcclusionOrder {
    /// No occlusion between the given instances, which must be in id order.
    pub fn new(ids: Vec<InstanceId>) -> Self {
        let behind = vec![Vec::new(); ids.len()];
        Self { ids, behind, matrix: OnceLock::new() }
    }

    /// The instances of rows and columns, in id order.
    pub fn ids(&self) -> &[InstanceId] {
        &self.ids
    }

    /// Whether the instance of row `i` occludes the instance of column `j`.
    pub fn occludes(&self, i: usize, j: usize) -> bool {
        self.behind[i].binary_search(&(j as u16)).is_ok()
    }

    /// Sets that row `i` occludes column `j`.
    pub fn set(&mut self, i: usize, j: usize) {
        assert!(j < self.ids.len(), "a column of the matrix");
        self.matrix.take();
        let (row, column) = (&mut self.behind[i], j as u16);
        if row.last().is_none_or(|last| *last < column) {
            row.push(column);
        } else if let Err(place) = row.binary_search(&column) {
            row.insert(place, column);
        }
    }

    /// The columns that row `i` occludes, ascending.
    pub fn behind(&self, i: usize) -> impl ExactSizeIterator<Item = usize> + Clone {
        self.behind[i].iter().map(|column| usize::from(*column))
    }

    /// The matrix, row by row.
    pub fn matrix(&self) -> &[bool] {
        self.matrix.get_or_init(|| {
            let n = self.ids.len();
            let mut matrix = vec![false; n * n];
            (0..n).for_each(|i| self.behind(i).for_each(|j| matrix[i * n + j] = true));
            matrix
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    #[test]
    fn pairs_are_those_of_the_matrix_in_any_order() {
        let mut stream = Stream::root(6);
        let n = 9;
        let mut order = OcclusionOrder::new((1..=n as u16).map(InstanceId).collect());
        let mut matrix = vec![false; n * n];
        for _ in 0..40 {
            let [i, j] = [0; 2].map(|_| stream.below(n as u64) as usize);
            order.set(i, j);
            matrix[i * n + j] = true;
            assert_eq!(order.matrix(), matrix);
        }
        for i in 0..n {
            assert!(order.behind(i).eq((0..n).filter(|j| matrix[i * n + j])));
            assert!((0..n).all(|j| order.occludes(i, j) == matrix[i * n + j]));
        }
    }
}
