//! The tree of one mesh, built once and shared by every instance of it.

use super::{
    build::build,
    lanes::Lanes,
    ray::Prepared,
    walk::{self, Sink},
    wide::{Bounds, Leaf, Nodes, WIDTH},
};

/// An 8-wide tree over the triangles of a mesh, in the mesh's own frame.
///
/// Triangles with a coordinate that is not finite are left out; those without area are kept and
/// never hit.
#[derive(Clone, Debug)]
pub struct MeshBvh {
    pub(super) nodes: Nodes,
    leaves: Vec<Leaf>,
    /// Largest absolute coordinate.
    pub(super) reach: f32,
}

impl MeshBvh {
    /// Builds the tree. `positions` are in metres, `triangles` index into them; a hit's
    /// `primitive` is a position in `triangles`. About 0.6 s for a million triangles.
    ///
    /// # Panics
    /// If an index is not below `positions.len()`.
    pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Self {
        let mut kept = Vec::with_capacity(triangles.len());
        let mut boxes = Vec::with_capacity(triangles.len());
        for (number, triangle) in triangles.iter().enumerate() {
            let corners = triangle.map(|index| positions[index as usize]);
            if corners.iter().flatten().all(|x| x.is_finite()) {
                let mut bounds = Bounds::EMPTY;
                corners.iter().for_each(|&corner| bounds.include(corner));
                boxes.push(bounds);
                kept.push((number as u32, corners));
            }
        }
        let mut leaves = Vec::new();
        let nodes = build(&boxes, std::env::var("LS").map_or(WIDTH, |s| s.parse().unwrap()), |items| {
            let mut leaf = Leaf::EMPTY;
            for (lane, &item) in items.iter().enumerate() {
                let (number, corners) = &kept[item as usize];
                leaf.set(lane, corners, *number);
            }
            leaves.push(leaf);
            leaves.len() - 1
        });
        let reach = nodes.bounds.reach();
        Self { nodes, leaves, reach }
    }

    /// Bytes held by the tree.
    pub fn size(&self) -> usize {
        size_of_val(&self.nodes.list[..]) + size_of_val(&self.leaves[..])
    }

    /// Boxes that together hold the mesh, tighter than one: those of the root's children.
    pub(super) fn outline(&self) -> Vec<Bounds> {
        match self.nodes.list.first() {
            Some(root) => (0..WIDTH).map(|s| root.bounds(s)).filter(|b| !b.is_empty()).collect(),
            None if self.nodes.bounds.is_empty() => Vec::new(),
            None => vec![self.nodes.bounds],
        }
    }

    /// Offers to `sink` what the ray meets in `[from, sink.limit()]`; true if the sink ended it.
    /// No reported distance is less than `near`, which is at least `from`.
    ///
    /// # Safety
    /// The CPU has the features of `L`; `ray` was prepared with this mesh's reach.
    #[inline(always)]
    pub(super) unsafe fn walk<L: Lanes, const SORT: bool, S: Sink>(
        &self,
        ray: &Prepared,
        from: f32,
        near: f32,
        sink: &mut S,
    ) -> bool {
        let visit = |sink: &mut S, leaf: usize, near: f32| {
            // SAFETY: leaf links are in range; the caller vouches for the CPU.
            unsafe { walk::leaf::<L>(self.leaves.get_unchecked(leaf), ray, from, near, sink) }
        };
        // SAFETY: the caller vouches for the CPU, `build` for the tree.
        unsafe { walk::leaves::<L, SORT, S>(&self.nodes, ray, near, sink, S::limit, visit) }
    }

    /// Checks that every finite triangle sits in exactly one leaf, inside that leaf's box.
    ///
    /// # Panics
    /// If it does not, or the nodes are malformed.
    pub fn validate(&self) {
        let mut primitives = Vec::new();
        self.nodes.validate(self.leaves.len(), |leaf, bounds| {
            let leaf = &self.leaves[leaf];
            assert!(bounds.contains(&leaf.bounds()), "triangles stick out of {bounds:?}");
            let used = leaf.primitives.iter().take_while(|&&p| p != u32::MAX);
            primitives.extend(used.copied());
            assert!(leaf.primitives.is_sorted());
        });
        let count = primitives.len();
        primitives.sort_unstable();
        primitives.dedup();
        assert_eq!(primitives.len(), count, "a triangle in two leaves");
    }
}
