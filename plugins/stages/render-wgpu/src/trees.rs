//! Trees as `bvh.wgsl` walks them: nodes of up to eight boxes in 80 bytes, leaves of up to three triangles, as in
//! Ylitie, Karras and Laine, "Efficient incoherent ray traversal on GPUs through compressed wide BVHs" (High
//! Performance Graphics 2017).
//!
//! A node is five vectors: its lower corner, and a word of three exponents and the set of slots with nodes; the index
//! of its first child, the index of its first item, and the set of its items, three bits per slot; and the planes of
//! the boxes, a byte per slot, as multiples of powers of two from the lower corner: lower x, y, z, upper x, y, z. Items
//! are the triangles of a mesh, three vectors each: its corners, and its number with the first. Indices count nodes and
//! items of the tree.
//!
//! Leaves of a top level are bodies, one each, stored like nodes, so that a ray visits them in its order, too. The five
//! vectors of a body are: a column of the matrix, body from world, with the word [`BODY`] where nodes have their
//! exponents; the rows of its rotation, with the root of its tree, its first triangle, and its reach; and the body's
//! number and flags.

use crate::layout::BodyPlace;
use syntable_prepare::{BinaryTree, Bounds, PreparedBody, TreeNode};
use syntable_simd::Vec3;
use syntable_simd::functions::FAR;

/// Children of a node.
const WIDTH: usize = 8;

/// Maximum triangles of a leaf: the three bits of a slot.
const LEAF_SIZE: usize = 3;

/// Cost of testing a triangle, in units of testing a node.
const TRIANGLE_COST: f64 = 0.3;

/// Maximum levels of a tree by area; a deeper tree is rebuilt by halves. A walk through a top level and a mesh keeps a
/// group for each level, at most [`DEEP_STACK`].
const MAX_DEPTH: usize = 22;

/// Groups on the stack of a walk for shallow scenes: the levels of the top level and of the deepest mesh together. A
/// smaller stack is faster to clear for every ray.
pub const STACK: u32 = 16;

/// Groups on the stack of a walk for all other scenes.
pub const DEEP_STACK: u32 = 48;

/// The word that marks a body among nodes; larger than the exponents of any node.
pub const BODY: u32 = 0xff;

/// A vector of a tree.
pub type Vector = [f32; 4];

/// Vectors of a node.
pub const NODE_SIZE: usize = 5;

/// The tree of a mesh.
#[derive(Debug)]
pub struct MeshTree {
    /// [`NODE_SIZE`] per node; the root is the first.
    pub nodes: Vec<Vector>,
    /// Three per triangle, leaf by leaf.
    pub triangles: Vec<Vector>,
    /// Boxes that together hold the mesh: the boxes of the root's children.
    pub outline: Vec<Bounds>,
    /// Largest absolute coordinate.
    pub reach: f32,
    /// Levels of nodes.
    pub depth: usize,
}

impl MeshTree {
    /// Builds the tree. Triangles with a non-finite coordinate are left out.
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
        let tree = WideTree::build(&boxes, &Leaves::Items(LEAF_SIZE));
        let vectors = |item: u32| {
            let (number, corners) = kept[item as usize];
            let mut vectors = corners.map(|[x, y, z]| [x, y, z, 0.0]);
            vectors[0][3] = f32::from_bits(number);
            vectors
        };
        let bounds = boxes.iter().fold(Bounds::EMPTY, |all, b| all.union(b));
        Self {
            nodes: tree.nodes,
            triangles: tree.items.into_iter().flat_map(vectors).collect(),
            outline: tree.outline,
            reach: bounds.reach(),
            depth: tree.depth,
        }
    }

    /// Bytes held.
    pub fn size(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.triangles[..])
    }
}

/// The tree of a top level.
#[derive(Debug)]
pub struct TopLevel {
    /// [`NODE_SIZE`] per node and per body; none without bodies.
    pub nodes: Vec<Vector>,
    /// Levels of nodes.
    pub depth: usize,
}

impl TopLevel {
    /// Builds the tree over the boxes of bodies, with the vectors of each. Bodies with an empty box are left out.
    pub fn build(boxes: &[Bounds], bodies: &[[Vector; NODE_SIZE]]) -> Self {
        let kept: Vec<usize> = (0..boxes.len()).filter(|&body| !boxes[body].is_empty()).collect();
        if kept.is_empty() {
            return Self { nodes: Vec::new(), depth: 0 };
        }
        let boxes: Vec<Bounds> = kept.iter().map(|&body| boxes[body]).collect();
        let bodies = kept.iter().map(|&body| bodies[body]).collect();
        let WideTree { nodes, depth, .. } = WideTree::build(&boxes, &Leaves::Nodes(bodies));
        Self { nodes, depth }
    }

    /// Maximum vectors of the tree of a number of bodies.
    pub fn room(bodies: usize) -> usize {
        2 * NODE_SIZE * bodies.max(1)
    }
}

/// The vectors of the body of an index.
pub fn body_node(number: usize, body: &PreparedBody, place: &BodyPlace) -> [Vector; NODE_SIZE] {
    // The inverse of a rigid placement.
    let rows = body.rotation.map(Vec3::array);
    let shift = rows.map(|row| {
        let products = row.into_iter().zip(body.translation.array()).map(|(a, t)| f64::from(a) * f64::from(t));
        -products.sum::<f64>() as f32
    });
    let word = f32::from_bits;
    let with = |[x, y, z]: [f32; 3], w: f32| [x, y, z, w];
    [
        with(shift, word(BODY)),
        with(rows[0], word(place.root)),
        with(rows[1], word(place.triangles)),
        with(rows[2], place.reach),
        [word(number as u32), word(body.flags), 0.0, 0.0],
    ]
}

/// Content of the leaves of a tree.
enum Leaves {
    /// Items, and the maximum number of items of a leaf.
    Items(usize),
    /// For each box, the vectors of a leaf, which is stored like a node.
    Nodes(Vec<[Vector; NODE_SIZE]>),
}

impl Leaves {
    /// Maximum boxes of a leaf.
    fn size(&self) -> usize {
        match self {
            Self::Items(most) => *most,
            Self::Nodes(_) => 1,
        }
    }
}

/// A tree over boxes.
struct WideTree {
    nodes: Vec<Vector>,
    /// Numbers of the boxes, leaf by leaf.
    items: Vec<u32>,
    /// Boxes of the root's children.
    outline: Vec<Bounds>,
    /// Levels of nodes.
    depth: usize,
}

impl WideTree {
    fn build(boxes: &[Bounds], leaves: &Leaves) -> Self {
        match boxes {
            [] => {
                let nodes = vec![[0.0; 4]; NODE_SIZE];
                Self { nodes, items: Vec::new(), outline: Vec::new(), depth: 1 }
            }
            [only] => {
                let mut tree = Self { nodes: Vec::new(), items: Vec::new(), outline: vec![*only], depth: 1 };
                let items = usize::from(matches!(leaves, Leaves::Items(_)));
                tree.nodes.extend(node(&slots(&[Child { bounds: *only, items }]), 1, 0));
                match leaves {
                    Leaves::Items(_) => tree.items.push(0),
                    Leaves::Nodes(vectors) => tree.nodes.extend(vectors[0]),
                }
                tree
            }
            _ => {
                let tree = Self::from_plan(&Plan::new(BinaryTree::by_area(boxes), leaves.size()), leaves);
                match tree.depth > MAX_DEPTH {
                    true => Self::from_plan(&Plan::new(BinaryTree::by_halves(boxes), leaves.size()), leaves),
                    false => tree,
                }
            }
        }
    }

    fn from_plan(plan: &Plan, leaves: &Leaves) -> Self {
        let mut tree = Self { nodes: vec![[0.0; 4]; NODE_SIZE], items: Vec::new(), outline: Vec::new(), depth: 0 };
        // Depth first, so that near nodes are close in memory.
        let mut pending = vec![(0, 0, 1)];
        while let Some((number, place, depth)) = pending.pop() {
            let children = plan.children(number);
            let has_items = |child: usize| plan.is_leaf(child) && matches!(leaves, Leaves::Items(_));
            let items = |&child: &usize| if has_items(child) { plan.below[child] } else { 0 };
            let boxes: Vec<Child> = (children.iter())
                .map(|child| Child { bounds: plan.tree.nodes[*child].bounds, items: items(child) })
                .collect();
            if number == 0 {
                tree.outline = boxes.iter().map(|child| child.bounds).collect();
            }
            let slots = slots(&boxes);
            let (first_child, first_item) = (tree.nodes.len() / NODE_SIZE, tree.items.len());
            let packed = node(&slots, first_child as u32, first_item as u32);
            tree.nodes[place..place + NODE_SIZE].copy_from_slice(&packed);
            tree.depth = tree.depth.max(depth);
            for (index, _) in slots.iter().flatten() {
                let child = children[*index];
                match leaves {
                    Leaves::Items(_) if plan.is_leaf(child) => tree.items.extend(plan.items(child)),
                    Leaves::Nodes(vectors) if plan.is_leaf(child) => {
                        let items = plan.items(child);
                        tree.nodes.extend(items.into_iter().flat_map(|item| vectors[item as usize]));
                    }
                    _ => {
                        pending.push((child, tree.nodes.len(), depth + 1));
                        tree.nodes.extend([[0.0; 4]; NODE_SIZE]);
                    }
                }
            }
        }
        tree
    }
}

/// A child of a node.
#[derive(Clone, Copy)]
struct Child {
    bounds: Bounds,
    /// Items, if it is a leaf; else 0.
    items: usize,
}

/// The child of every slot, with its index. A ray visits slots in the order of their number, exclusive-or the signs of
/// its direction. So a child gets a slot that comes early for rays that meet it first.
fn slots(children: &[Child]) -> [Option<(usize, Child)>; WIDTH] {
    let middle = |b: &Bounds| [0, 1, 2].map(|axis| f64::from(b.lo[axis]) * 0.5 + f64::from(b.hi[axis]) * 0.5);
    let all = children.iter().fold(Bounds::EMPTY, |all, child| all.union(&child.bounds));
    let center = middle(&all);
    let mut slots = [None; WIDTH];
    let mut free: Vec<usize> = (0..children.len()).collect();
    while !free.is_empty() {
        let mut best = (f64::INFINITY, 0, 0);
        for (at, &index) in free.iter().enumerate() {
            let here = middle(&children[index].bounds);
            for slot in (0..WIDTH).filter(|&slot| slots[slot].is_none()) {
                let along = |axis: usize| {
                    let offset = here[axis] - center[axis];
                    if slot >> (2 - axis) & 1 == 0 { offset } else { -offset }
                };
                let cost = along(0) + along(1) + along(2);
                if cost < best.0 {
                    best = (cost, at, slot);
                }
            }
        }
        let (_, at, slot) = best;
        // If no cost is less, take the next free slot.
        let slot = if slots[slot].is_none() { slot } else { slots.iter().position(Option::is_none).unwrap_or(0) };
        let index = free.remove(at);
        slots[slot] = Some((index, children[index]));
    }
    slots
}

/// The vectors of a node.
fn node(slots: &[Option<(usize, Child)>; WIDTH], first_child: u32, first_item: u32) -> [Vector; NODE_SIZE] {
    let bound = |x: f32| x.clamp(-FAR, FAR);
    let children = || slots.iter().flatten().map(|(_, child)| child);
    let all = children().fold(Bounds::EMPTY, |all, child| all.union(&child.bounds));
    let (lower, upper) = (all.lo.map(bound), all.hi.map(bound));
    let exponents = [0, 1, 2].map(|axis| exponent(f64::from(upper[axis]) - f64::from(lower[axis])));
    let (mut slots_with_nodes, mut items) = (0_u8, 0_u32);
    let mut planes = [[[0_u8; WIDTH]; 3]; 2];
    for (slot, child) in slots.iter().enumerate().filter_map(|(slot, child)| child.map(|(_, child)| (slot, child))) {
        if child.items == 0 {
            slots_with_nodes |= 1 << slot;
        } else {
            items |= ((1 << child.items) - 1) << (LEAF_SIZE * slot);
        }
        for axis in 0..3 {
            let steps = |x: f32| (f64::from(bound(x)) - f64::from(lower[axis])) / power_of_two(exponents[axis]);
            planes[0][axis][slot] = steps(child.bounds.lo[axis]).floor() as u8;
            planes[1][axis][slot] = steps(child.bounds.hi[axis]).ceil() as u8;
        }
    }
    let words = |bytes: [u8; WIDTH]| {
        let [a, b, c, d, e, f, g, h] = bytes;
        [u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h])].map(f32::from_bits)
    };
    let [ex, ey, ez] = exponents.map(|exponent| (exponent + 127) as u8);
    let form = f32::from_bits(u32::from_le_bytes([ex, ey, ez, slots_with_nodes]));
    let links = [first_child, first_item, items, 0].map(f32::from_bits);
    let [[lx, ly, lz], [ux, uy, uz]] = planes.map(|planes| planes.map(words));
    let pair = |a: [f32; 2], b: [f32; 2]| [a[0], a[1], b[0], b[1]];
    [[lower[0], lower[1], lower[2], form], links, pair(lx, ly), pair(lz, ux), pair(uy, uz)]
}

/// 2 to the power of an exponent in the range of single precision.
fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

/// The least exponent of two for which an extent has at most 255 steps.
fn exponent(extent: f64) -> i32 {
    // Exponent of the step's size, rounded down.
    let least = ((extent / 255.0).to_bits() >> 52) as i32 - 1023;
    let mut exponent = least.max(-126);
    while (extent / power_of_two(exponent)).ceil() > 255.0 {
        exponent += 1;
    }
    exponent
}

/// Decides which nodes of the binary tree become nodes and leaves, by the surface-area heuristic (section 3.1 of the
/// paper).
struct Plan {
    tree: BinaryTree,
    leaf_size: usize,
    /// By node of the binary tree: items below.
    below: Vec<usize>,
    /// Minimum cost of the subtree as at most 1, 2, … 7 nodes or leaves.
    cost: Vec<[f64; WIDTH - 1]>,
}

impl Plan {
    fn new(tree: BinaryTree, leaf_size: usize) -> Self {
        let count = tree.nodes.len();
        let mut plan = Self { tree, leaf_size, below: vec![1; count], cost: vec![[0.0; WIDTH - 1]; count] };
        for number in (0..count).rev() {
            let TreeNode::Pair(a, b) = plan.tree.nodes[number].kind else {
                plan.cost[number] = [plan.cost_of_leaf(number); WIDTH - 1];
                continue;
            };
            plan.below[number] = plan.below[a] + plan.below[b];
            let mut least = plan.cost_of_leaf(number).min(plan.cost_of_node(number));
            for roots in 1..WIDTH {
                if roots > 1 {
                    least = least.min(plan.division(number, roots).1);
                }
                plan.cost[number][roots - 1] = least;
            }
        }
        plan
    }

    fn cost_of_leaf(&self, number: usize) -> f64 {
        match self.below[number] <= self.leaf_size {
            true => self.tree.nodes[number].bounds.half_area() * TRIANGLE_COST * self.below[number] as f64,
            false => f64::INFINITY,
        }
    }

    fn cost_of_node(&self, number: usize) -> f64 {
        self.tree.nodes[number].bounds.half_area() + self.division(number, WIDTH).1
    }

    /// The best number of roots for the first half of a node, and the cost.
    fn division(&self, number: usize, roots: usize) -> (usize, f64) {
        let TreeNode::Pair(a, b) = self.tree.nodes[number].kind else { return (0, f64::INFINITY) };
        let divided = |first: usize| (first, self.cost[a][first - 1] + self.cost[b][roots - first - 1]);
        (1..roots).map(divided).fold((1, f64::INFINITY), |best, next| if next.1 < best.1 { next } else { best })
    }

    fn is_leaf(&self, number: usize) -> bool {
        matches!(self.tree.nodes[number].kind, TreeNode::Item(_))
            || number != 0 && self.cost_of_leaf(number) <= self.cost_of_node(number)
    }

    /// The children of a node.
    fn children(&self, number: usize) -> Vec<usize> {
        let mut children = Vec::with_capacity(WIDTH);
        let TreeNode::Pair(a, b) = self.tree.nodes[number].kind else { return children };
        let (first, _) = self.division(number, WIDTH);
        let mut pending = vec![(b, WIDTH - first), (a, first)];
        while let Some((number, mut roots)) = pending.pop() {
            while roots > 1 && self.cost[number][roots - 1] == self.cost[number][roots - 2] {
                roots -= 1;
            }
            match self.tree.nodes[number].kind {
                TreeNode::Pair(a, b) if roots > 1 => {
                    let (first, _) = self.division(number, roots);
                    pending.extend([(b, roots - first), (a, first)]);
                }
                _ => children.push(number),
            }
        }
        children
    }

    /// Items below a node, ascending.
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

    /// Visits every leaf below a node, and checks that decoded boxes hold the items below them. Lists the items, and
    /// returns the box around them.
    fn walk(nodes: &[Vector], number: usize, item_box: &dyn Fn(usize) -> Bounds, found: &mut Vec<usize>) -> Bounds {
        let vectors = &nodes[number * NODE_SIZE..(number + 1) * NODE_SIZE];
        if vectors[0][3].to_bits() == BODY {
            let body = vectors[1][0].to_bits() as usize;
            found.push(body);
            return item_box(body);
        }
        let byte = |vector: usize, at: usize| vectors[vector][at / 4].to_bits().to_le_bytes()[at % 4];
        let [ex, ey, ez, with_nodes] = vectors[0][3].to_bits().to_le_bytes();
        let step = [ex, ey, ez].map(|e| power_of_two(i32::from(e) - 127));
        let [first_child, mut next_item, items] = [0, 1, 2].map(|i| vectors[1][i].to_bits() as usize);
        let mut all = Bounds::EMPTY;
        for slot in 0..WIDTH {
            let in_slot = (items >> (3 * slot) & 7).count_ones() as usize;
            let mut inside = Bounds::EMPTY;
            if with_nodes >> slot & 1 == 1 {
                assert_eq!(in_slot, 0);
                let child = first_child + (with_nodes & ((1 << slot) - 1)).count_ones() as usize;
                inside = walk(nodes, child, item_box, found);
            } else {
                for item in next_item..next_item + in_slot {
                    found.push(item);
                    inside = inside.union(&item_box(item));
                }
                next_item += in_slot;
            }
            let plane = |axis: usize, at: usize| {
                f64::from(vectors[0][axis]) + f64::from(byte(2 + at / 2, 8 * (at % 2) + slot)) * step[axis]
            };
            for axis in (0..3).filter(|_| !inside.is_empty()) {
                let (lower, upper) = (plane(axis, axis), plane(axis, 3 + axis));
                let [lo, hi] = [inside.lo[axis], inside.hi[axis]].map(f64::from);
                assert!(lower <= lo && hi <= upper, "{lower} to {upper} does not hold {lo} to {hi}");
                assert!(upper - hi < 2.0 * step[axis] && lo - lower < 2.0 * step[axis], "the box is too large");
            }
            all = all.union(&inside);
        }
        all
    }

    #[test]
    fn every_triangle_is_in_one_leaf_and_in_all_boxes_above() {
        for edge in [2, 3, 30] {
            let (positions, triangles) = sheet(edge);
            let tree = MeshTree::build(&positions, &triangles);
            let item_box = |item: usize| {
                let mut own = Bounds::EMPTY;
                tree.triangles[3 * item..3 * item + 3].iter().for_each(|&[x, y, z, _]| own.include([x, y, z]));
                own
            };
            let mut items = Vec::new();
            walk(&tree.nodes, 0, &item_box, &mut items);
            let mut found: Vec<u32> = items.iter().map(|&item| tree.triangles[3 * item][3].to_bits()).collect();
            found.sort_unstable();
            assert_eq!(found, (0..triangles.len() as u32).collect::<Vec<_>>());
        }
        assert!(MeshTree::build(&[], &[]).outline.iter().all(Bounds::is_empty));
        // With equal boxes, the tree by area would degenerate to a list.
        let same = MeshTree::build(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]; 5000]);
        assert_eq!(same.triangles.len(), 15_000);
        assert!(same.depth <= MAX_DEPTH, "{} levels", same.depth);
    }

    #[test]
    fn the_top_level_leads_to_bodies_that_have_a_box() {
        let cube = |x: f32| Bounds { lo: [x, 0.0, 0.0], hi: [x + 1.0, 1.0, 1.0] };
        let boxes = [cube(0.0), Bounds::EMPTY, cube(2.0), cube(9.0)];
        let number = |number: usize| f32::from_bits(number as u32);
        let bodies: Vec<_> = (0..boxes.len())
            .map(|body| [[0.0, 0.0, 0.0, number(BODY as usize)], [number(body); 4], [0.0; 4], [0.0; 4], [0.0; 4]])
            .collect();
        for kept in [vec![0, 2, 3], vec![3]] {
            let boxes: Vec<Bounds> =
                (0..4).map(|body| if kept.contains(&body) { boxes[body] } else { Bounds::EMPTY }).collect();
            let tree = TopLevel::build(&boxes, &bodies);
            assert!(tree.nodes.len() <= TopLevel::room(4));
            let mut found = Vec::new();
            walk(&tree.nodes, 0, &|body| boxes[body], &mut found);
            found.sort_unstable();
            assert_eq!(found, kept);
        }
        assert!(TopLevel::build(&[Bounds::EMPTY], &[bodies[0]]).nodes.is_empty());
    }
}
