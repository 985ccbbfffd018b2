//! The tree of one mesh, built once and shared by every instance of it.

use super::{
    build::build,
    ray::{BAND, Line, Shear},
    walk::{self, Sink, Visit},
    wide::{Block, Leaf, Nodes, WIDTH},
};
use syntable_prepare::Bounds;
use syntable_simd::Wide;

/// An 8-wide tree over the triangles of a mesh, in the mesh's own frame.
///
/// Triangles with a non-finite coordinate are left out; triangles without area are kept and never hit.
#[derive(Clone, Debug)]
pub struct MeshBvh {
    nodes: Nodes,
    /// Largest absolute coordinate.
    reach: f32,
}

impl MeshBvh {
    /// Builds the tree. `positions` are in meters, `triangles` index into them; a hit's
    /// `primitive` is a position in `triangles`. Takes 1 to 2 µs a triangle.
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
        let nodes = build(&boxes, WIDTH, |nodes, items| {
            let mut leaf = Leaf::EMPTY;
            for (lane, &item) in items.iter().enumerate() {
                let (number, corners) = &kept[item as usize];
                leaf.set(lane, corners, *number);
            }
            nodes.push(leaf)
        });
        let reach = nodes.bounds.reach();
        Self { nodes, reach }
    }

    /// Bytes held by the tree.
    pub fn size(&self) -> usize {
        size_of_val(&self.nodes.blocks[..])
    }

    /// Boxes that together hold the mesh, tighter than a single box: the boxes of the root's children.
    pub(super) fn outline(&self) -> Vec<Bounds> {
        match self.nodes.top() {
            Some(root) => (0..WIDTH).map(|s| root.bounds(s)).filter(|b| !b.is_empty()).collect(),
            None if self.nodes.bounds.is_empty() => Vec::new(),
            None => vec![self.nodes.bounds],
        }
    }

    /// Offers to `sink` the hits of the ray, given in this mesh's frame, in `[from, sink.limit()]`; true if the sink
    /// ended the walk. No reported distance is less than `near`, which is at least `from`.
    #[inline(always)]
    pub(super) fn walk<L: Wide, const SORT: bool, S: Sink>(
        &self,
        line: &Line<L>,
        from: f32,
        near: f32,
        sink: &mut S,
    ) -> bool {
        let Some((slabs, shear)) = line.aim(self.reach, BAND) else { return false };
        let mut visit = Triangles { blocks: self.nodes.blocks.as_ptr(), shear, from, sink };
        // SAFETY: `build` made the tree.
        unsafe { walk::leaves::<L, _, SORT>(&self.nodes, &slabs, near, &mut visit) }
    }

    /// Checks that every finite triangle is in exactly one leaf, inside that leaf's box.
    ///
    /// # Panics
    /// If it does not, or the nodes are malformed.
    pub fn validate(&self) {
        let mut primitives = Vec::new();
        self.nodes.validate(|leaf, bounds| {
            let leaf: &Leaf = self.nodes.get(leaf);
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

/// Tests the triangles of each leaf.
struct Triangles<'a, S> {
    blocks: *const Block,
    shear: Shear,
    from: f32,
    sink: &'a mut S,
}

impl<L: Wide, S: Sink> Visit<L> for Triangles<'_, S> {
    const AMONG_NODES: bool = true;

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.sink.limit()
    }

    #[inline(always)]
    unsafe fn leaf(&mut self, leaf: usize, near: f32) -> bool {
        // SAFETY: a mesh's leaves are in its blocks.
        let leaf = unsafe { &*self.blocks.add(leaf).cast::<Leaf>() };
        walk::leaf::<L>(leaf, &self.shear, self.from, near, self.sink)
    }
}
