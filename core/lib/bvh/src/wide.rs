//! The 8-wide tree: nodes and leaves as columns, one lane per child or triangle. A node has up to `WIDTH` children, a
//! leaf up to `WIDTH` triangles.

use syntable_prepare::Bounds;

pub(super) use syntable_simd::{Column, WIDTH};

/// Deepest node level a tree may have, the root being level 1; keeps [`STACK`] sufficient.
pub(super) const MAX_DEPTH: usize = 32;

/// Stack entries a walk may need: every node on the path leaves at most seven siblings behind,
/// and the deepest one pushes all eight of its children.
pub(super) const STACK: usize = MAX_DEPTH * (WIDTH - 1) + 1;

/// Target of a child slot: a node, a leaf (or an instance, in the top-level tree), or nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Link(pub u32);

impl Link {
    /// No child; its box is empty, so no ray follows it.
    pub const NONE: Self = Self(u32::MAX);
    const LEAF: u32 = 1 << 31;

    pub fn node(index: usize) -> Self {
        assert!(index < Self::LEAF as usize, "tree has 2^31 blocks");
        Self(index as u32)
    }

    pub fn leaf(index: usize) -> Self {
        assert!(index < (u32::MAX ^ Self::LEAF) as usize, "tree has 2^31 blocks");
        Self(index as u32 | Self::LEAF)
    }

    #[inline(always)]
    pub fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// First block of the node or leaf; in the top-level tree, the index of the instance.
    #[inline(always)]
    pub fn index(self) -> usize {
        (self.0 & !Self::LEAF) as usize
    }
}

/// Eight child boxes and their links: four cache lines.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(super) struct Node {
    /// Planes in the order x lo, x hi, y lo, y hi, z lo, z hi.
    pub planes: [Column; 6],
    pub links: [Link; WIDTH],
}

impl Node {
    pub const EMPTY: Self = Self {
        planes: {
            let (lo, hi) = (Column([f32::INFINITY; WIDTH]), Column([f32::NEG_INFINITY; WIDTH]));
            [lo, hi, lo, hi, lo, hi]
        },
        links: [Link::NONE; WIDTH],
    };

    pub fn set(&mut self, slot: usize, bounds: &Bounds, link: Link) {
        for axis in 0..3 {
            self.planes[2 * axis].0[slot] = bounds.lo[axis];
            self.planes[2 * axis + 1].0[slot] = bounds.hi[axis];
        }
        self.links[slot] = link;
    }

    pub fn bounds(&self, slot: usize) -> Bounds {
        Bounds {
            lo: [0, 2, 4].map(|plane| self.planes[plane].0[slot]),
            hi: [1, 3, 5].map(|plane| self.planes[plane].0[slot]),
        }
    }
}

/// Up to eight triangles. Unused lanes hold a zero triangle, which no ray hits.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(super) struct Leaf {
    /// `corners[c][axis]` is one coordinate of corner `c` of all eight triangles.
    pub corners: [[Column; 3]; 3],
    /// Triangle numbers, ascending; `u32::MAX` in unused lanes.
    pub primitives: [u32; WIDTH],
}

impl Leaf {
    pub const EMPTY: Self = Self { corners: [[Column([0.0; WIDTH]); 3]; 3], primitives: [u32::MAX; WIDTH] };

    pub fn set(&mut self, lane: usize, triangle: &[[f32; 3]; 3], primitive: u32) {
        for (columns, corner) in self.corners.iter_mut().zip(triangle) {
            for axis in 0..3 {
                columns[axis].0[lane] = corner[axis];
            }
        }
        self.primitives[lane] = primitive;
    }

    pub fn bounds(&self) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        for lane in (0..WIDTH).filter(|&lane| self.primitives[lane] != u32::MAX) {
            for columns in &self.corners {
                bounds.include([0, 1, 2].map(|axis| columns[axis].0[lane]));
            }
        }
        bounds
    }
}

/// A cache line of a tree.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(super) struct Block([u8; 64]);

/// Types that blocks can hold.
///
/// # Safety
/// The size is a multiple of the size of a [`Block`], the alignment at most as large, the type has no padding, and any
/// bits are a valid value.
pub(super) unsafe trait Blocks: Sized {
    const COUNT: usize = size_of::<Self>() / size_of::<Block>();
}

// SAFETY: columns of numbers.
unsafe impl Blocks for Node {}
// SAFETY: columns of numbers.
unsafe impl Blocks for Leaf {}

/// Nodes and leaves, close to where they are needed. Invariants, which [`Nodes::validate`] checks and the walks rely
/// on: every link leads to a whole node or leaf, each is reached only once, no node is deeper than [`MAX_DEPTH`], and a
/// child's box lies inside its parent's.
#[derive(Clone, Debug)]
pub(super) struct Nodes {
    pub blocks: Vec<Block>,
    /// Where every walk begins; [`Link::NONE`] for an empty tree.
    pub root: Link,
    pub bounds: Bounds,
}

impl Nodes {
    /// Makes room for another node or leaf and returns its place.
    pub fn push<T: Blocks>(&mut self, value: T) -> usize {
        let place = self.blocks.len();
        self.blocks.extend((0..T::COUNT).map(|_| Block([0; 64])));
        *self.get_mut(place) = value;
        place
    }

    pub fn get<T: Blocks>(&self, place: usize) -> &T {
        let blocks = &self.blocks[place..place + T::COUNT];
        // SAFETY: the blocks are long and aligned enough, and any bits are a valid value.
        unsafe { &*blocks.as_ptr().cast() }
    }

    pub fn get_mut<T: Blocks>(&mut self, place: usize) -> &mut T {
        let blocks = &mut self.blocks[place..place + T::COUNT];
        // SAFETY: as above.
        unsafe { &mut *blocks.as_mut_ptr().cast() }
    }

    /// The root, if it is a node.
    pub fn top(&self) -> Option<&Node> {
        (!self.root.is_leaf()).then(|| self.get(self.root.index()))
    }

    /// Checks the invariants and calls `leaf` with every reached leaf and its box.
    ///
    /// # Panics
    /// If an invariant does not hold.
    pub fn validate(&self, mut leaf: impl FnMut(usize, &Bounds)) {
        if self.root == Link::NONE {
            assert!(self.blocks.is_empty() && self.bounds.is_empty());
            return;
        }
        let mut seen = std::collections::BTreeSet::new();
        let mut pending = vec![(self.root, self.bounds, 1)];
        while let Some((link, bounds, depth)) = pending.pop() {
            assert!(seen.insert(link.0), "{link:?} reached twice");
            if link.is_leaf() {
                leaf(link.index(), &bounds);
                continue;
            }
            assert!(depth <= MAX_DEPTH, "node {} at depth {depth}", link.index());
            let node: &Node = self.get(link.index());
            for slot in 0..WIDTH {
                let child = node.bounds(slot);
                if node.links[slot] == Link::NONE {
                    assert_eq!(child, Bounds::EMPTY);
                } else {
                    assert!(bounds.contains(&child), "{child:?} sticks out of {bounds:?}");
                    pending.push((node.links[slot], child, depth + 1));
                }
            }
        }
    }
}
