//! Trees as `bvh.wgsl` walks them: nodes of two boxes, leaves of a few triangles.
//!
//! A node is four vectors: the planes of both boxes along x, y and z (lower, upper, lower, upper), and the links of the
//! children. A link is the index of a node's first vector, or has its highest bit set and is a leaf: of a mesh, the number
//! of its triangles (four bits) and the first of them; of the top level, the index of a body. A triangle is three vectors:
//! its corners, and its number with the first.

use syntable_prepare::{BinaryTree, Bounds, TreeNode};

/// Maximum triangles of a leaf.
const LEAF_SIZE: usize = 4;

/// Cost of testing a triangle, in units of testing a node's two boxes.
const TRIANGLE_COST: f64 = 0.6;

/// Levels from which on a tree is built anew by halves: with a top level, a walk keeps at most 64 links.
const MAX_DEPTH: usize = 40;

/// Bit of links to leaves.
const LEAF: u32 = 1 << 31;

/// Largest finite box; `bvh.wgsl` counts larger numbers as infinite.
const FAR: f32 = 3.0e38;

/// A vector of a tree.
pub type Vector = [f32; 4];

/// The tree of a mesh. Links count from its first node.
#[derive(Debug)]
pub struct MeshTree {
    /// Four per node; the root is the first.
    pub nodes: Vec<Vector>,
    /// Three per triangle, leaf by leaf.
    pub triangles: Vec<Vector>,
    /// Boxes that together hold the mesh: those of the root's children.
    pub outline: [Bounds; 2],
    /// Largest absolute coordinate.
    pub reach: f32,
}

impl MeshTree {
    /// Builds the tree. Triangles with a coordinate that is not finite are left out.
    pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Self {
        let (mut kept, mut boxes) = (Vec::new(), Vec::new());
        for (number, triangle) in triangles.iter().enumerate() {
            let corners = triangle.map(|index| positions[index as usize]);
            if corners.iter().flatten().all(|x| x.is_finite()) {
                let mut bounds = Bounds::EMPTY;
                corners.iter().for_each(|&corner| bounds.include(corner));
                boxes.push(bounds);
                kept.push((number as u32, corners));
            }
        }
        let mut ordered = Vec::with_capacity(3 * kept.len());
        let nodes = nodes(&boxes, LEAF_SIZE, |items| {
            let first = ordered.len() / 3;
            for &item in items {
                let (number, corners) = kept[item as usize];
                for (corner, [x, y, z]) in corners.into_iter().enumerate() {
                    ordered.push([x, y, z, if corner == 0 { f32::from_bits(number) } else { 0.0 }]);
                }
            }
            LEAF | (items.len() as u32) << 27 | first as u32
        });
        let bounds = boxes.iter().fold(Bounds::EMPTY, |all, b| all.union(b));
        Self { outline: children(&nodes), nodes, triangles: ordered, reach: bounds.reach() }
    }

    /// Bytes held.
    pub fn size(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.triangles[..])
    }

    /// The nodes with links that count from elsewhere.
    pub fn nodes_at(&self, first: u32) -> impl Iterator<Item = Vector> {
        let moved = move |link: f32| match link.to_bits() {
            leaf if leaf & LEAF != 0 => link,
            node => f32::from_bits(node + first),
        };
        self.nodes.iter().enumerate().map(move |(number, &[a, b, c, d])| match number % 4 {
            3 => [moved(a), moved(b), c, d],
            _ => [a, b, c, d],
        })
    }
}

/// The top level over the boxes of bodies; links count from `first`. Bodies with an empty box are left out.
pub fn top_level(bodies: &[Bounds], first: u32) -> Vec<Vector> {
    let kept: Vec<u32> = (0..bodies.len() as u32).filter(|&body| !bodies[body as usize].is_empty()).collect();
    if kept.is_empty() {
        return Vec::new();
    }
    let boxes: Vec<Bounds> = kept.iter().map(|&body| bodies[body as usize]).collect();
    let nodes = nodes(&boxes, 1, |items| LEAF | kept[items[0] as usize]);
    let tree = MeshTree { nodes, triangles: Vec::new(), outline: [Bounds::EMPTY; 2], reach: 0.0 };
    tree.nodes_at(first).collect()
}

/// Nodes over boxes; `emit` takes the items of a leaf, and gives its link.
fn nodes(boxes: &[Bounds], leaf_size: usize, mut emit: impl FnMut(&[u32]) -> u32) -> Vec<Vector> {
    if boxes.len() <= leaf_size {
        let all: Vec<u32> = (0..boxes.len() as u32).collect();
        let bounds = boxes.iter().fold(Bounds::EMPTY, |all, b| all.union(b));
        let link = if all.is_empty() { LEAF } else { emit(&all) };
        return node([(bounds, link), (Bounds::EMPTY, LEAF)]).to_vec();
    }
    let mut plan = Plan::new(BinaryTree::by_area(boxes), leaf_size);
    if plan.depth() > MAX_DEPTH {
        plan = Plan::new(BinaryTree::by_halves(boxes), leaf_size);
    }
    let mut nodes: Vec<Vector> = vec![[0.0; 4]; 4];
    // Depth first, so that near nodes are close in memory.
    let mut pending = vec![(0, 0)];
    while let Some((number, place)) = pending.pop() {
        let TreeNode::Pair(a, b) = plan.tree.nodes[number].kind else { continue };
        let mut child = |number: usize, nodes: &mut Vec<Vector>| {
            let bounds = plan.tree.nodes[number].bounds;
            if plan.leaf[number] {
                return (bounds, emit(&plan.items(number)));
            }
            let below = nodes.len();
            nodes.extend([[0.0; 4]; 4]);
            pending.push((number, below));
            (bounds, below as u32)
        };
        let pair = [child(a, &mut nodes), child(b, &mut nodes)];
        nodes[place..place + 4].copy_from_slice(&node(pair));
    }
    nodes
}

/// The vectors of a node.
fn node([(a, link_a), (b, link_b)]: [(Bounds, u32); 2]) -> [Vector; 4] {
    let bound = |x: f32| x.clamp(-FAR, FAR);
    let planes = |axis: usize| [a.lo[axis], a.hi[axis], b.lo[axis], b.hi[axis]].map(bound);
    [planes(0), planes(1), planes(2), [f32::from_bits(link_a), f32::from_bits(link_b), 0.0, 0.0]]
}

/// Boxes of the root's children.
fn children(nodes: &[Vector]) -> [Bounds; 2] {
    [0, 2].map(|at| {
        let plane = |high: usize| [0, 1, 2].map(|axis| nodes[axis][at + high]);
        Bounds { lo: plane(0), hi: plane(1) }
    })
}

/// Which subtrees become leaves.
struct Plan {
    tree: BinaryTree,
    leaf: Vec<bool>,
}

impl Plan {
    /// Leaves where testing their triangles costs less than walking on, by the surface-area heuristic.
    fn new(tree: BinaryTree, leaf_size: usize) -> Self {
        let count = tree.nodes.len();
        let (mut leaf, mut items, mut cost) = (vec![true; count], vec![1_usize; count], vec![0.0; count]);
        for (number, node) in tree.nodes.iter().enumerate().rev() {
            let area = node.bounds.half_area();
            if let TreeNode::Pair(a, b) = node.kind {
                items[number] = items[a] + items[b];
                let walked = area + cost[a] + cost[b];
                let tested = area * TRIANGLE_COST * items[number] as f64;
                leaf[number] = items[number] <= leaf_size && tested <= walked;
                cost[number] = if leaf[number] { tested } else { walked };
            } else {
                cost[number] = area * TRIANGLE_COST;
            }
        }
        leaf[0] = false;
        Self { tree, leaf }
    }

    /// Levels of nodes, the root being one.
    fn depth(&self) -> usize {
        let (mut deepest, mut pending) = (0, vec![(0, 1)]);
        while let Some((number, depth)) = pending.pop() {
            deepest = deepest.max(depth);
            if let TreeNode::Pair(a, b) = self.tree.nodes[number].kind {
                pending.extend([a, b].into_iter().filter(|&child| !self.leaf[child]).map(|child| (child, depth + 1)));
            }
        }
        deepest
    }

    /// Items below a subtree, ascending.
    fn items(&self, number: usize) -> Vec<u32> {
        let (mut items, mut pending) = (Vec::with_capacity(LEAF_SIZE), vec![number]);
        while let Some(number) = pending.pop() {
            match self.tree.nodes[number].kind {
                TreeNode::Item(item) => items.push(item),
                TreeNode::Pair(a, b) => pending.extend([a, b]),
            }
        }
        items.sort_unstable();
        items
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Triangles of a bumpy sheet.
    fn sheet(edge: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let position = |i: u32| {
            let (x, y) = ((i % edge) as f32, (i / edge) as f32);
            [x * 0.1, y * 0.1, ((i * 7919) % 13) as f32 * 0.01]
        };
        let quad = |i: u32| {
            let a = i / (edge - 1) * edge + i % (edge - 1);
            [[a, a + 1, a + edge], [a + 1, a + edge + 1, a + edge]]
        };
        ((0..edge * edge).map(position).collect(), (0..(edge - 1) * (edge - 1)).flat_map(quad).collect())
    }

    /// Visits every leaf, checking that boxes hold what is below them; gives the triangles found.
    fn walk(tree: &MeshTree, node: usize, within: &Bounds, found: &mut Vec<u32>) {
        let links = tree.nodes[node + 3];
        for (bounds, link) in children(&tree.nodes[node..node + 4]).into_iter().zip(links).take(2) {
            if bounds.is_empty() {
                continue;
            }
            assert!(within.contains(&bounds), "{bounds:?} is not in {within:?}");
            let link = link.to_bits();
            if link & LEAF == 0 {
                walk(tree, link as usize, &bounds, found);
                continue;
            }
            let (count, first) = ((link >> 27 & 15) as usize, (link & 0x07ff_ffff) as usize);
            for triangle in tree.triangles[3 * first..3 * (first + count)].chunks(3) {
                found.push(triangle[0][3].to_bits());
                let mut own = Bounds::EMPTY;
                triangle.iter().for_each(|&[x, y, z, _]| own.include([x, y, z]));
                assert!(bounds.contains(&own));
            }
        }
    }

    #[test]
    fn every_triangle_is_in_one_leaf_and_in_all_boxes_above() {
        for edge in [2, 3, 30] {
            let (positions, triangles) = sheet(edge);
            let tree = MeshTree::build(&positions, &triangles);
            let mut found = Vec::new();
            walk(&tree, 0, &Bounds { lo: [-FAR; 3], hi: [FAR; 3] }, &mut found);
            found.sort_unstable();
            assert_eq!(found, (0..triangles.len() as u32).collect::<Vec<_>>());
        }
        assert!(MeshTree::build(&[], &[]).outline.iter().all(Bounds::is_empty));
        // Equal boxes would make a list of a tree.
        let same = MeshTree::build(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]; 5000]);
        assert_eq!(same.triangles.len(), 15_000);
    }

    #[test]
    fn the_top_level_leads_to_bodies_that_have_a_box() {
        let cube = |x: f32| Bounds { lo: [x, 0.0, 0.0], hi: [x + 1.0, 1.0, 1.0] };
        let nodes = top_level(&[cube(0.0), Bounds::EMPTY, cube(2.0), cube(9.0)], 100);
        let links = nodes.iter().skip(3).step_by(4).flat_map(|&[a, b, ..]| [a.to_bits(), b.to_bits()]);
        let mut bodies: Vec<u32> = links.clone().filter(|link| link & LEAF != 0).map(|link| link & !LEAF).collect();
        bodies.sort_unstable();
        assert_eq!(bodies, [0, 2, 3]);
        assert!(links.filter(|link| link & LEAF == 0).all(|link| link == 104), "moved to their place");
        assert!(top_level(&[Bounds::EMPTY], 0).is_empty());
    }
}
