//! The walk itself: one ray through one tree, written once for every kind of [`Wide`].
//!
//! Boxes are tested with the plane columns selected by the ray's signs, and grown by the ray's error band. Triangles
//! are tested in the ray's sheared frame (Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", 2013). Shared
//! corners shear to the same point. Products are rounded monotonically and not fused there, so an edge function either
//! has the right sign or is zero. Zeros are decided in `f64`, where the products are exact; a zero there counts as
//! inside. So no ray passes between two triangles that share an edge or a corner.
//!
//! Results do not depend on the order of the walk. A hit's distance is never less than the near distance of its leaf's
//! box (it is raised to it if rounding made it less), so a box is only skipped if no hit in it can win; and of equal
//! distances, the lower number wins.

use super::{
    axes::each_axis,
    ray::{Shear, Slabs},
    wide::{Block, Column, Leaf, Link, Node, Nodes, STACK, WIDTH},
};
use syntable_simd::{Wide, prefetch};

/// Result of one lane of a leaf.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub t: f32,
    pub u: f32,
    pub v: f32,
    pub primitive: u32,
}

/// Receives the hits of a walk.
pub(super) trait Sink {
    /// Hits and boxes farther than this are ignored; equal ones are not.
    fn limit(&self) -> f32;
    /// Takes a hit; true ends the walk.
    fn offer(&mut self, candidate: Candidate) -> bool;
}

impl<L: Wide> Slabs<L> {
    /// Boxes of the node that the ray meets in `[from, to]`, as bits, and the distances at which it enters them.
    #[inline(always)]
    pub fn test(&self, node: &Node, from: L::V, to: f32) -> (u32, L::V) {
        const FAR: usize = size_of::<Column>();
        let planes: *const Column = node.planes.as_ptr();
        let near = each_axis!(a => {
            // SAFETY: `near` holds the offsets of three of the node's six planes.
            let plane = unsafe { L::load(&*planes.byte_add(self.near[a])) };
            L::mul_add(plane, self.inverse[a], self.near_shift[a])
        });
        let far = each_axis!(a => {
            // SAFETY: the offsets of the other three planes differ in one bit.
            let plane = unsafe { L::load(&*planes.byte_add(self.near[a] ^ FAR)) };
            L::mul_add(plane, self.inverse[a], self.far_shift[a])
        });
        let enter = L::max(L::max(near[0], near[1]), L::max(near[2], from));
        let leave = L::min(L::min(far[0], far[1]), L::min(far[2], L::splat(to)));
        (L::bits(L::le(enter, leave)), enter)
    }
}

/// Processes the leaves that a walk reaches. A trait rather than closures: a closure would be compiled without the CPU
/// features of the function around it.
pub(super) trait Visit<L: Wide> {
    /// Whether leaves are in the blocks of the tree.
    const AMONG_NODES: bool;

    /// Boxes farther than this are ignored; equal ones are not.
    fn limit(&self) -> f32;

    /// Visits a leaf, given its number and the near distance of its box; true ends the walk.
    /// Implementations are `#[inline(always)]`.
    ///
    /// # Safety
    /// The leaf is one of the tree the visitor was made for.
    unsafe fn leaf(&mut self, leaf: usize, near: f32) -> bool;
}

/// Visits the leaves of `nodes` that the ray meets in `[from, limit]`; true if the visitor ended the walk. If `SORT`,
/// near leaves come first, with the near distance of their box; otherwise they come in any order, with `from`.
///
/// # Safety
/// `nodes` holds the invariants of [`Nodes::validate`], and `visit` was made for them.
#[inline(always)]
pub(super) unsafe fn leaves<L: Wide, V: Visit<L>, const SORT: bool>(
    nodes: &Nodes,
    slabs: &Slabs<L>,
    from: f32,
    visit: &mut V,
) -> bool {
    if nodes.root == Link::NONE {
        return false;
    }
    // Entries are links, keyed by their near distances if `SORT`. Near distances are at least 0, so entries compare
    // like them. SAFETY of all uses: a walk holds at most STACK entries, see there, and all entries below `height` are
    // written.
    let mut stack = [const { std::mem::MaybeUninit::<u64>::uninit() }; STACK];
    let mut height = 0;
    let blocks = nodes.blocks.as_ptr();
    let start = L::splat(from);
    let (mut link, mut near) = (nodes.root, from.to_bits());
    loop {
        if link.is_leaf() {
            let near = if SORT { f32::from_bits(near) } else { from };
            // SAFETY: the caller's promises.
            if unsafe { visit.leaf(link.index(), near) } {
                return true;
            }
        } else {
            // SAFETY: links lead to nodes by the tree's invariants.
            let node = unsafe { &*blocks.add(link.0 as usize).cast::<Node>() };
            let (mut hits, enter) = slabs.test(node, start, visit.limit());
            if hits != 0 {
                let enter = if SORT { L::store(enter) } else { Column([0.0; WIDTH]) };
                let slot = hits.trailing_zeros() as usize & (WIDTH - 1);
                hits &= hits - 1;
                (link, near) = (node.links[slot], enter.0[slot].to_bits());
                if V::AMONG_NODES {
                    prefetch_node(blocks.wrapping_add(link.index()));
                }
                if hits == 0 {
                    continue;
                }
                let entry = |near: u32, link: Link| if SORT { u64::from(near) << 32 } else { 0 } | u64::from(link.0);
                let mut nearest = entry(near, link);
                let base = height;
                while hits != 0 {
                    let slot = hits.trailing_zeros() as usize & (WIDTH - 1);
                    hits &= hits - 1;
                    let link = node.links[slot];
                    if V::AMONG_NODES {
                        prefetch_node(blocks.wrapping_add(link.index()));
                    }
                    let mut other = entry(enter.0[slot].to_bits(), link);
                    if SORT {
                        (nearest, other) = (nearest.min(other), nearest.max(other));
                    }
                    // SAFETY: see above.
                    unsafe {
                        let mut at = height;
                        // Insert below the nearer entries of this node.
                        while SORT && at > base {
                            let below = stack.get_unchecked(at - 1).assume_init();
                            if below >= other {
                                break;
                            }
                            stack.get_unchecked_mut(at).write(below);
                            at -= 1;
                        }
                        stack.get_unchecked_mut(at).write(other);
                    }
                    height += 1;
                }
                (link, near) = (Link(nearest as u32), (nearest >> 32) as u32);
                continue;
            }
        }
        loop {
            if height == 0 {
                return false;
            }
            height -= 1;
            // SAFETY: see above.
            let entry = unsafe { stack.get_unchecked(height).assume_init() };
            (link, near) = (Link(entry as u32), (entry >> 32) as u32);
            if !SORT || f32::from_bits(near) <= visit.limit() {
                break;
            }
        }
    }
}

/// Prefetches the four cache lines of a node, or the first four of a leaf.
#[inline(always)]
fn prefetch_node(block: *const Block) {
    for line in 0..4 {
        prefetch(block.wrapping_add(line));
    }
}

/// Tests one leaf's triangles in `[from, limit]` and offers the hits in lane order; true if the
/// sink ended the walk. `near` is the near distance of the leaf's box.
#[inline(always)]
pub(super) fn leaf<L: Wide>(leaf: &Leaf, ray: &Shear, from: f32, near: f32, sink: &mut impl Sink) -> bool {
    /// Axes of the sheared frame by the last one's.
    const AXES: [[usize; 3]; 4] = [[1, 2, 0], [2, 0, 1], [0, 1, 2], [0, 1, 2]];
    // SAFETY: axes are below 3.
    unsafe {
        let axes = AXES[ray.along & 3];
        let origin = each_axis!(a => L::splat(*ray.origin.0.get_unchecked(axes[a])));
        // Per unit of z along the ray, with the sign that corners seen backwards need.
        let along = L::sub(L::splat(-0.0), L::splat(*ray.inverse.0.get_unchecked(axes[2])));
        let shear_x = L::mul(L::splat(*ray.direction.0.get_unchecked(axes[0])), along);
        let shear_y = L::mul(L::splat(*ray.direction.0.get_unchecked(axes[1])), along);
        // Relative to the corners: all signs are flipped, so products of two are the same.
        let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = each_axis!(corner => {
            let p = each_axis!(a => {
                let column = leaf.corners[corner].get_unchecked(axes[a]);
                L::sub(origin[a], L::load(column))
            });
            let x = L::mul_add(shear_x, p[2], p[0]);
            let y = L::mul_add(shear_y, p[2], p[1]);
            [x, y, p[2]]
        });
        // Twice the signed area opposite each corner.
        let wa = L::sub(L::mul(cx, by), L::mul(cy, bx));
        let wb = L::sub(L::mul(ax, cy), L::mul(ay, cx));
        let wc = L::sub(L::mul(bx, ay), L::mul(by, ax));
        let sum = L::add(L::add(wa, wb), wc);
        let zero = L::splat(0.0);
        let least = L::min(L::min(wa, wb), wc);
        let most = L::max(L::max(wa, wb), wc);
        let inside = L::and(L::or(L::le(zero, least), L::le(most, zero)), L::differ(sum, zero));
        if L::bits(inside) == 0 {
            return false;
        }
        let on_edge = L::and(inside, L::and(L::le(least, zero), L::le(zero, most)));
        let on_edge = L::bits(on_edge);
        let outside =
            if on_edge == 0 { 0 } else { outside_exactly(on_edge, &[ax, ay, bx, by, cx, cy].map(|v| L::store(v))) };
        let scale = L::div(L::splat(1.0), sum);
        let depth = L::mul_add(wc, cz, L::mul_add(wb, bz, L::mul(wa, az)));
        let t = L::mul(L::mul(depth, scale), along);
        let in_range = L::and(L::le(L::splat(from), t), L::le(t, L::splat(sink.limit())));
        let mut hits = L::bits(L::and(inside, in_range)) & !outside;
        if hits == 0 {
            return false;
        }
        let t = L::store(L::max(t, L::splat(near)));
        let (u, v) = (L::store(L::mul(wb, scale)), L::store(L::mul(wc, scale)));
        while hits != 0 {
            let lane = hits.trailing_zeros() as usize & (WIDTH - 1);
            hits &= hits - 1;
            let primitive = leaf.primitives[lane];
            if sink.offer(Candidate { t: t.0[lane], u: u.0[lane], v: v.0[lane], primitive }) {
                return true;
            }
        }
    }
    false
}

/// Lanes of `doubtful` whose origin is outside the triangle, which is given by the columns ax, ay, bx, by, cx, cy.
/// Exact: products of two `f32` fit an `f64`, so signs are right.
#[cold]
#[inline(never)]
fn outside_exactly(doubtful: u32, corners: &[Column; 6]) -> u32 {
    let mut outside = 0;
    for lane in (0..WIDTH).filter(|lane| doubtful >> lane & 1 == 1) {
        let [ax, ay, bx, by, cx, cy] = corners.map(|column| f64::from(column.0[lane]));
        let weights = [cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax];
        let inside = weights.iter().all(|&w| w >= 0.0) || weights.iter().all(|&w| w <= 0.0);
        outside |= u32::from(!inside) << lane;
    }
    outside
}
