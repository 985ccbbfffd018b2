//! From boxes to an 8-wide tree: obvhs builds the binary tree, and this module collapses it to a wide tree.
//!
//! The collapse is optimal under the surface-area cost: for every binary subtree it works out the
//! cheapest way to fill one to eight slots of a parent node, then reads the choices back.

use super::wide::{Link, MAX_DEPTH, Node, Nodes, WIDTH};
use syntable_prepare::{BinaryTree, Bounds, TreeNode};

/// Cost of testing a leaf's triangles, in units of testing a node's eight boxes. From 0.5 to 2
/// the speed does not change measurably; the tree is smallest near 0.5.
const LEAF_COST: f64 = 0.5;

/// Builds a tree over boxes. `emit` stores the items of one leaf (at most `leaf_size`, ascending),
/// in the tree or elsewhere, and returns its place.
pub(super) fn build(boxes: &[Bounds], leaf_size: usize, mut emit: impl FnMut(&mut Nodes, &[u32]) -> usize) -> Nodes {
    let bounds = boxes.iter().fold(Bounds::EMPTY, |all, b| all.union(b));
    if boxes.len() <= leaf_size {
        let all: Vec<u32> = (0..boxes.len() as u32).collect();
        let mut nodes = Nodes { blocks: Vec::new(), root: Link::NONE, bounds };
        if !all.is_empty() {
            nodes.root = Link::leaf(emit(&mut nodes, &all));
        }
        return nodes;
    }
    let mut plan = Plan::new(BinaryTree::by_area(boxes), leaf_size);
    if plan.depth() > MAX_DEPTH {
        plan = Plan::new(BinaryTree::by_halves(boxes), leaf_size);
    }
    let mut nodes = Nodes { blocks: Vec::new(), root: Link::node(0), bounds };
    plan.write(&mut nodes, &mut emit);
    nodes.blocks.shrink_to_fit();
    nodes
}

/// The best way to spread one binary subtree over a number of slots.
#[derive(Clone, Copy)]
struct Choice {
    /// `cost[i - 1]`: cheapest cost when at most `i` slots may be used.
    cost: [f64; WIDTH],
    /// `split[i - 1]`: slots for the first child when `i ≥ 2` slots are used, or 0 to use `i - 1`.
    split: [u8; WIDTH],
    /// Slots for the first child when this subtree becomes a node of its own.
    own_split: u8,
    leaf: bool,
}

struct Plan {
    binary: BinaryTree,
    choices: Vec<Choice>,
}

impl Plan {
    fn new(binary: BinaryTree, leaf_size: usize) -> Self {
        let empty = Choice { cost: [0.0; WIDTH], split: [0; WIDTH], own_split: 0, leaf: true };
        let mut choices = vec![empty; binary.nodes.len()];
        let mut counts = vec![1_usize; binary.nodes.len()];
        for (number, node) in binary.nodes.iter().enumerate().rev() {
            let area = node.bounds.half_area();
            let as_leaf = area * LEAF_COST;
            let TreeNode::Pair(a, b) = node.kind else {
                choices[number].cost = [as_leaf; WIDTH];
                continue;
            };
            counts[number] = counts[a] + counts[b];
            let spread = |slots: usize| {
                (1..slots)
                    .map(|k| (choices[a].cost[k - 1] + choices[b].cost[slots - k - 1], k as u8))
                    .fold((f64::INFINITY, 1), |best, next| if next.0 < best.0 { next } else { best })
            };
            let spreads: [(f64, u8); WIDTH + 1] =
                std::array::from_fn(|slots| if slots < 2 { (f64::INFINITY, 0) } else { spread(slots) });
            let as_node = area + spreads[WIDTH].0;
            let leaf = counts[number] <= leaf_size && as_leaf <= as_node;
            let mut choice = Choice { own_split: spreads[WIDTH].1, leaf, ..empty };
            choice.cost[0] = if leaf { as_leaf } else { as_node };
            for (slots, &(cost, k)) in spreads.iter().enumerate().skip(2) {
                let fewer = choice.cost[slots - 2];
                (choice.cost[slots - 1], choice.split[slots - 1]) = if cost < fewer { (cost, k) } else { (fewer, 0) };
            }
            choices[number] = choice;
        }
        // The root is always a node here: `build` handles what fits into one leaf.
        choices[0].leaf = false;
        Self { binary, choices }
    }

    /// The subtrees that fill the slots of the node made from `number`.
    fn children(&self, number: usize) -> Vec<usize> {
        let TreeNode::Pair(a, b) = self.binary.nodes[number].kind else { unreachable!("one item") };
        let first = usize::from(self.choices[number].own_split);
        let mut slots = Vec::with_capacity(WIDTH);
        let mut pending = vec![(b, WIDTH - first), (a, first)];
        while let Some((number, mut allowed)) = pending.pop() {
            let choice = &self.choices[number];
            while allowed > 1 && choice.split[allowed - 1] == 0 {
                allowed -= 1;
            }
            match self.binary.nodes[number].kind {
                TreeNode::Pair(a, b) if allowed > 1 => {
                    let first = usize::from(choice.split[allowed - 1]);
                    pending.push((b, allowed - first));
                    pending.push((a, first));
                }
                _ => slots.push(number),
            }
        }
        slots
    }

    /// Levels of nodes, including the root.
    fn depth(&self) -> usize {
        let (mut deepest, mut pending) = (0, vec![(0, 1)]);
        while let Some((number, depth)) = pending.pop() {
            deepest = deepest.max(depth);
            let inner = self.children(number).into_iter().filter(|&c| !self.choices[c].leaf);
            pending.extend(inner.map(|child| (child, depth + 1)));
        }
        deepest
    }

    /// Items below a subtree, ascending.
    fn items(&self, number: usize) -> Vec<u32> {
        let (mut items, mut pending) = (Vec::with_capacity(WIDTH), vec![number]);
        while let Some(number) = pending.pop() {
            match self.binary.nodes[number].kind {
                TreeNode::Item(item) => items.push(item),
                TreeNode::Pair(a, b) => pending.extend([a, b]),
            }
        }
        items.sort_unstable();
        items
    }

    /// Writes the nodes in depth-first order, the children of a node side by side. Leaves take the first slots, so that
    /// a walk that stops at any hit reaches them first.
    fn write(&self, nodes: &mut Nodes, emit: &mut impl FnMut(&mut Nodes, &[u32]) -> usize) {
        let mut pending = vec![(0, nodes.push(Node::EMPTY))];
        while let Some((number, place)) = pending.pop() {
            let (leaves, inner): (Vec<usize>, Vec<usize>) =
                self.children(number).into_iter().partition(|&child| self.choices[child].leaf);
            for (slot, &child) in (leaves.len()..).zip(&inner) {
                let below = nodes.push(Node::EMPTY);
                pending.push((child, below));
                nodes.get_mut::<Node>(place).set(slot, &self.binary.nodes[child].bounds, Link::node(below));
            }
            for (slot, &child) in leaves.iter().enumerate() {
                let link = Link::leaf(emit(nodes, &self.items(child)));
                nodes.get_mut::<Node>(place).set(slot, &self.binary.nodes[child].bounds, link);
            }
        }
    }
}

/// Levels of the tree that halving builds over `count` equal boxes.
#[cfg(test)]
pub(super) fn depth_by_halves(count: usize) -> usize {
    let boxes = vec![Bounds { lo: [0.0; 3], hi: [1.0; 3] }; count];
    Plan::new(BinaryTree::by_halves(&boxes), WIDTH).depth()
}
