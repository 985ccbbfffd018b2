//! The walk itself: one ray through one tree, written once for every kind of [`Lanes`].
//!
//! Boxes are tested with the plane columns picked by the ray's signs, and grown by the ray's error
//! band. Triangles are tested in the ray's sheared frame (Woop, Benthin and Wald, "Watertight
//! Ray/Triangle Intersection", 2013): shared corners shear to the same point and, products being
//! rounded monotonically and never fused, an edge function is either right in sign or zero, and
//! zero counts as inside. So no ray passes between two triangles that share an edge or a corner.
//!
//! Results do not depend on the order of the walk. A hit's distance is never less than the near
//! distance of its leaf's box (it is raised to it where rounding says otherwise), so a box is only
//! skipped when nothing in it could win; and equal distances go to the lower number.

use super::{
    lanes::Lanes,
    ray::Prepared,
    wide::{Column, Leaf, Link, Node, Nodes, STACK, WIDTH},
};

/// `[f(0), f(1), f(2)]`, written out: a closure would be compiled without the CPU features of the
/// function around it, and then not be inlined.
macro_rules! each_axis {
    ($a:ident => $body:expr) => {
        [
            {
                let $a = 0_usize;
                $body
            },
            {
                let $a = 1_usize;
                $body
            },
            {
                let $a = 2_usize;
                $body
            },
        ]
    };
}
pub(super) use each_axis;

/// What one lane of a leaf reports.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub t: f32,
    pub u: f32,
    pub v: f32,
    pub primitive: u32,
}

/// Receives what a walk finds.
pub(super) trait Sink {
    /// Hits and boxes farther than this are of no interest; equal ones are.
    fn limit(&self) -> f32;
    /// Takes a hit; true ends the walk.
    fn offer(&mut self, candidate: Candidate) -> bool;
}

/// A ray spread over the lanes, ready to be tested against the boxes of nodes.
pub(super) struct Slabs<L: Lanes> {
    near_origin: [L::V; 3],
    far_origin: [L::V; 3],
    inverse: [L::V; 3],
    from: L::V,
    near: [usize; 3],
}

impl<L: Lanes> Slabs<L> {
    /// # Safety
    /// The CPU has the features of `L`.
    #[inline(always)]
    pub unsafe fn new(ray: &Prepared, from: f32) -> Self {
        // SAFETY: the caller's promise.
        unsafe {
            Self {
                near_origin: each_axis!(a => L::splat(ray.near_origin[a])),
                far_origin: each_axis!(a => L::splat(ray.far_origin[a])),
                inverse: each_axis!(a => L::splat(ray.inverse[a])),
                from: L::splat(from),
                near: ray.near,
            }
        }
    }

    /// Which of the node's boxes the ray meets in `[from, to]`, as bits, and where it enters them.
    ///
    /// # Safety
    /// The CPU has the features of `L`.
    #[inline(always)]
    pub unsafe fn test(&self, node: &Node, to: f32) -> (u32, Column) {
        // SAFETY: the caller's promise; `Prepared::near` is below 6, and so is any of its pairs.
        unsafe {
            let near = each_axis!(a => {
                let plane = L::load(node.planes.get_unchecked(self.near[a]));
                L::mul(L::sub(plane, self.near_origin[a]), self.inverse[a])
            });
            let far = each_axis!(a => {
                let plane = L::load(node.planes.get_unchecked(self.near[a] ^ 1));
                L::mul(L::sub(plane, self.far_origin[a]), self.inverse[a])
            });
            let enter = L::max(L::max(near[0], near[1]), L::max(near[2], self.from));
            let leave = L::min(L::min(far[0], far[1]), L::min(far[2], L::splat(to)));
            (L::bits(L::le(enter, leave)), L::store(enter))
        }
    }
}

/// Visits the leaves of `nodes` that the ray meets in `[from, limit]`, near ones first if `SORT`.
/// `visit` gets the leaf number, the near distance of its box and the current limit's owner, and
/// ends the walk by returning true; so does this function then.
///
/// # Safety
/// The CPU has the features of `L`, and `nodes` is as [`Nodes::validate`] wants it.
#[inline(always)]
pub(super) unsafe fn leaves<L: Lanes, const SORT: bool, S>(
    nodes: &Nodes,
    ray: &Prepared,
    from: f32,
    state: &mut S,
    limit: impl Fn(&S) -> f32,
    mut visit: impl FnMut(&mut S, usize, f32) -> bool,
) -> bool {
    if nodes.root == Link::NONE {
        return false;
    }
    // SAFETY: the caller vouches for the CPU.
    let slabs = unsafe { Slabs::<L>::new(ray, from) };
    // An entry is the near distance in the upper half and the link in the lower; near distances
    // are at least 0, so entries compare like them.
    let mut stack = [const { std::mem::MaybeUninit::<u64>::uninit() }; STACK];
    let mut height = 0;
    let (mut link, mut near) = (nodes.root, from);
    loop {
        if link.is_leaf() {
            if visit(state, link.index(), near) {
                return true;
            }
        } else {
            // SAFETY: links are in range by the tree's invariants; the caller vouches for the CPU.
            let node: &Node = unsafe { nodes.list.get_unchecked(link.index()) };
            // SAFETY: the caller vouches for the CPU.
            let (mut hits, distances) = unsafe { slabs.test(node, limit(state)) };
            if hits != 0 {
                let entry = |hits: u32| {
                    let slot = hits.trailing_zeros() as usize & (WIDTH - 1);
                    u64::from(distances.0[slot].to_bits()) << 32 | u64::from(node.links[slot].0)
                };
                let mut nearest = entry(hits);
                hits &= hits - 1;
                let base = height;
                while hits != 0 {
                    let mut next = entry(hits);
                    hits &= hits - 1;
                    if SORT && next < nearest {
                        std::mem::swap(&mut next, &mut nearest);
                    }
                    // Insert below the nearer ones of this node's entries.
                    // SAFETY: a walk holds at most STACK entries, see there; all below `height`
                    // are written.
                    unsafe {
                        let mut at = height;
                        while SORT && at > base {
                            let below = stack.get_unchecked(at - 1).assume_init();
                            if below >= next {
                                break;
                            }
                            stack.get_unchecked_mut(at).write(below);
                            at -= 1;
                        }
                        stack.get_unchecked_mut(at).write(next);
                    }
                    height += 1;
                }
                (link, near) = (Link(nearest as u32), f32::from_bits((nearest >> 32) as u32));
                continue;
            }
        }
        loop {
            if height == 0 {
                return false;
            }
            height -= 1;
            // SAFETY: entries below the old height are written.
            let entry = unsafe { stack.get_unchecked(height).assume_init() };
            (link, near) = (Link(entry as u32), f32::from_bits((entry >> 32) as u32));
            if near <= limit(state) {
                break;
            }
        }
    }
}

/// Tests one leaf's triangles in `[from, limit]` and offers the hits in lane order; true if the
/// sink ended the walk. `near` is the near distance of the leaf's box.
///
/// # Safety
/// The CPU has the features of `L`.
#[inline(always)]
pub(super) unsafe fn leaf<L: Lanes>(leaf: &Leaf, ray: &Prepared, from: f32, near: f32, sink: &mut impl Sink) -> bool {
    // SAFETY: the caller vouches for the CPU; `Prepared::axes` are below 3.
    unsafe {
        let origin = each_axis!(a => L::splat(*ray.origin.get_unchecked(ray.axes[a])));
        let shear = each_axis!(a => L::splat(ray.shear[a]));
        let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = each_axis!(corner => {
            let p = each_axis!(a => {
                let column = leaf.corners[corner].get_unchecked(ray.axes[a]);
                L::sub(L::load(column), origin[a])
            });
            let x = L::sub(p[0], L::mul(shear[0], p[2]));
            let y = L::sub(p[1], L::mul(shear[1], p[2]));
            [x, y, p[2]]
        });
        // Twice the signed areas opposite each corner.
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
        let scale = L::div(L::splat(1.0), sum);
        let depth = L::add(L::add(L::mul(wa, az), L::mul(wb, bz)), L::mul(wc, cz));
        let t = L::mul(L::mul(depth, scale), shear[2]);
        let in_range = L::and(L::le(L::splat(from), t), L::le(t, L::splat(sink.limit())));
        let mut hits = L::bits(L::and(inside, in_range));
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
