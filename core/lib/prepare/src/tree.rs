//! Binary trees over boxes, from which renderers build the trees for their hardware.

/// An axis-aligned box; empty iff some `lo > hi`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Lower corner.
    pub lo: [f32; 3],
    /// Upper corner.
    pub hi: [f32; 3],
}

impl Bounds {
    /// The empty box.
    pub const EMPTY: Self = Self { lo: [f32::INFINITY; 3], hi: [f32::NEG_INFINITY; 3] };

    /// The box around some points.
    pub fn of(points: &[[f32; 3]]) -> Self {
        let mut bounds = Self::EMPTY;
        points.iter().for_each(|&p| bounds.include(p));
        bounds
    }

    /// Grows the box to include `p`.
    pub fn include(&mut self, p: [f32; 3]) {
        for (axis, &x) in p.iter().enumerate() {
            self.lo[axis] = self.lo[axis].min(x);
            self.hi[axis] = self.hi[axis].max(x);
        }
    }

    /// The smallest box that contains both; either may be empty.
    pub fn union(&self, other: &Self) -> Self {
        Self {
            lo: [0, 1, 2].map(|axis| self.lo[axis].min(other.lo[axis])),
            hi: [0, 1, 2].map(|axis| self.hi[axis].max(other.hi[axis])),
        }
    }

    /// Largest absolute coordinate; 0 for the empty box.
    pub fn reach(&self) -> f32 {
        let largest = |p: [f32; 3]| p.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
        if self.is_empty() { 0.0 } else { largest(self.lo).max(largest(self.hi)) }
    }

    /// Half the surface area, in `f64` so that large boxes keep their order; 0 for the empty box.
    pub fn half_area(&self) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        let [x, y, z] = [0, 1, 2].map(|a| f64::from(self.hi[a]) - f64::from(self.lo[a]));
        x * y + y * z + z * x
    }

    /// The box around its corners, moved by the rows of a 3×4 matrix, translation last.
    pub fn transformed(&self, m: &[[f32; 4]; 3]) -> Self {
        let mut out = Self::EMPTY;
        for corner in 0..8 {
            let p = [0, 1, 2].map(|axis| if corner >> axis & 1 == 0 { self.lo[axis] } else { self.hi[axis] });
            out.include([0, 1, 2].map(|r| m[r][0] * p[0] + m[r][1] * p[1] + m[r][2] * p[2] + m[r][3]));
        }
        out
    }

    /// Whether the box is empty.
    pub fn is_empty(&self) -> bool {
        (0..3).any(|axis| self.lo[axis] > self.hi[axis])
    }

    /// Whether `other` lies inside, borders included.
    pub fn contains(&self, other: &Self) -> bool {
        (0..3).all(|a| self.lo[a] <= other.lo[a] && other.hi[a] <= self.hi[a])
    }
}

/// A binary tree over boxes; node 0 is the root and children come after their parents.
pub struct BinaryTree {
    /// Nodes; 0 is the root.
    pub nodes: Vec<BinaryNode>,
}

/// A node of a [`BinaryTree`].
pub struct BinaryNode {
    /// Box around all children.
    pub bounds: Bounds,
    /// Content of the node.
    pub kind: TreeNode,
}

/// Content of a node: a box or two children.
#[derive(Clone, Copy)]
pub enum TreeNode {
    /// One box, by its number.
    Item(u32),
    /// Two nodes, by their numbers.
    Pair(usize, usize),
}

impl BinaryTree {
    /// PLOC and reinsertion by obvhs: small areas first. Needs two boxes or more.
    pub fn by_area(boxes: &[Bounds]) -> Self {
        use obvhs::{BvhBuildParams, aabb::Aabb, bvh2::builder::build_bvh2};
        let boxes: Vec<Aabb> = boxes.iter().map(|b| Aabb::new(b.lo.into(), b.hi.into())).collect();
        let params = BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::medium_build() };
        let tree = build_bvh2(&boxes, params, &mut std::time::Duration::default());

        // Renumber in pre-order; reinsertion leaves parents and children in any order.
        let mut nodes: Vec<BinaryNode> = Vec::with_capacity(tree.nodes.len());
        let mut pending = vec![(0, None)];
        while let Some((source, parent)) = pending.pop() {
            let number = nodes.len();
            if let Some((parent, second)) = parent {
                let parent: &mut BinaryNode = &mut nodes[parent];
                if let TreeNode::Pair(a, b) = &mut parent.kind {
                    *(if second { b } else { a }) = number;
                }
            }
            let node = &tree.nodes[source];
            let (min, max) = (node.aabb().min.to_array(), node.aabb().max.to_array());
            let first = node.first_index as usize;
            let kind = if node.is_leaf() {
                TreeNode::Item(tree.primitive_indices[first])
            } else {
                pending.push((first + 1, Some((number, true))));
                pending.push((first, Some((number, false))));
                TreeNode::Pair(0, 0)
            };
            nodes.push(BinaryNode { bounds: Bounds { lo: min, hi: max }, kind });
        }
        Self { nodes }
    }

    /// Halves the list at every level. Slow to trace but always shallow: the fallback for inputs (many equal boxes,
    /// exponential spacing) whose good tree would be too deep for the stack.
    pub fn by_halves(boxes: &[Bounds]) -> Self {
        let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
        let center = |i: u32, axis: usize| {
            let b = &boxes[i as usize];
            b.lo[axis] * 0.5 + b.hi[axis] * 0.5
        };
        let mut nodes: Vec<BinaryNode> = Vec::with_capacity(2 * boxes.len());
        let mut pending = vec![(0..boxes.len(), None)];
        while let Some((range, parent)) = pending.pop() {
            let number = nodes.len();
            if let Some((parent, second)) = parent {
                let parent: &mut BinaryNode = &mut nodes[parent];
                if let TreeNode::Pair(a, b) = &mut parent.kind {
                    *(if second { b } else { a }) = number;
                }
            }
            let items = &mut order[range.clone()];
            let bounds = items.iter().fold(Bounds::EMPTY, |all, &i| all.union(&boxes[i as usize]));
            let kind = if let [item] = items {
                TreeNode::Item(*item)
            } else {
                let size = |axis: usize| bounds.hi[axis] - bounds.lo[axis];
                let axis = (0..3).fold(0, |best, a| if size(a) > size(best) { a } else { best });
                items.sort_unstable_by(|&a, &b| center(a, axis).total_cmp(&center(b, axis)).then(a.cmp(&b)));
                let middle = range.start + range.len() / 2;
                pending.push((middle..range.end, Some((number, true))));
                pending.push((range.start..middle, Some((number, false))));
                TreeNode::Pair(0, 0)
            };
            nodes.push(BinaryNode { bounds, kind });
        }
        Self { nodes }
    }
}
