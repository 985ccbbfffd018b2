//! The questions a scene answers, each as a task to run on some lanes.

use super::{
    Hit, Ray,
    frustum::Frustum,
    kernel::Task,
    lanes::Lanes,
    ray::{Line, PLACED_BAND},
    scene::SceneBvh,
    walk::{self, Candidate, Sink, Visit},
    wide::{Link, Node, WIDTH},
};

/// First hit that `keep` accepts.
pub(super) struct Closest<'a, F> {
    pub scene: &'a SceneBvh,
    pub ray: &'a Ray,
    pub from: f32,
    pub to: f32,
    pub keep: F,
}

impl<F: Fn(&Hit) -> bool> Task for Closest<'_, F> {
    type Out = Option<Hit>;

    #[inline(always)]
    unsafe fn run<L: Lanes>(self) -> Option<Hit> {
        let Self { scene, ray, from, to, keep } = self;
        let mut sink = Nearest::new(to, keep);
        // SAFETY: the caller vouches for the CPU.
        unsafe { walk_scene::<L, true, _>(scene, ray, from, &mut sink) };
        sink.found()
    }
}

/// Whether there is a hit that `keep` accepts.
pub(super) struct Any<'a, F> {
    pub scene: &'a SceneBvh,
    pub ray: &'a Ray,
    pub from: f32,
    pub to: f32,
    pub keep: F,
}

impl<F: Fn(&Hit) -> bool> Task for Any<'_, F> {
    type Out = bool;

    #[inline(always)]
    unsafe fn run<L: Lanes>(self) -> bool {
        let Self { scene, ray, from, to, keep } = self;
        // SAFETY: as in `Closest`.
        unsafe { walk_scene::<L, false, _>(scene, ray, from, &mut First { to, instance: 0, keep }) }
    }
}

/// Offers to `sink` what the ray meets, in any instance; true if the sink ended it.
///
/// # Safety
/// The CPU has the features of `L`.
#[inline(always)]
unsafe fn walk_scene<L: Lanes, const SORT: bool, S: SceneSink>(
    scene: &SceneBvh,
    ray: &Ray,
    from: f32,
    sink: &mut S,
) -> bool {
    // SAFETY: the caller vouches for the CPU, `SceneBvh::build` for the tree.
    unsafe {
        let line = Line::<L>::new(ray);
        let mut visit = Instances::<L, S, SORT> { scene, line, from, sink };
        if scene.nodes.root.is_leaf() {
            // No instance or one: its mesh has its own box.
            return scene.nodes.root != Link::NONE && visit.leaf(scene.nodes.root.index(), from);
        }
        let Some((slabs, _)) = line.aim(scene.reach, PLACED_BAND) else { return false };
        walk::leaves::<L, _, SORT>(&scene.nodes, &slabs, from, &mut visit)
    }
}

/// Walks every instance met, all into one sink.
struct Instances<'a, L: Lanes, S, const SORT: bool> {
    scene: &'a SceneBvh,
    line: Line<L>,
    from: f32,
    sink: &'a mut S,
}

impl<L: Lanes, S: SceneSink, const SORT: bool> Visit<L> for Instances<'_, L, S, SORT> {
    const AMONG_NODES: bool = false;

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.sink.limit()
    }

    #[inline(always)]
    unsafe fn leaf(&mut self, instance: usize, near: f32) -> bool {
        self.sink.enter(instance as u32);
        // SAFETY: leaves of the top level are instances; the caller vouches for the CPU.
        unsafe {
            let placed = self.scene.instances.get_unchecked(instance);
            let line = self.line.seen_from(&placed.object_from_world);
            placed.mesh.walk::<L, SORT, S>(&line, self.from, near, self.sink)
        }
    }
}

/// First hit in every instance.
pub(super) struct All<'a, F> {
    pub scene: &'a SceneBvh,
    pub ray: &'a Ray,
    pub from: f32,
    pub to: f32,
    pub visit: F,
}

impl<F: FnMut(Hit)> Task for All<'_, F> {
    type Out = ();

    #[inline(always)]
    unsafe fn run<L: Lanes>(self) {
        let Self { scene, ray, from, to, visit } = self;
        // SAFETY: as in `Closest`.
        unsafe {
            let line = Line::<L>::new(ray);
            let Some((slabs, _)) = line.aim(scene.reach, PLACED_BAND) else { return };
            walk::leaves::<L, _, true>(&scene.nodes, &slabs, from, &mut Each { scene, line, from, to, visit });
        }
    }
}

/// Walks every instance met, each for itself.
struct Each<'a, L: Lanes, F> {
    scene: &'a SceneBvh,
    line: Line<L>,
    from: f32,
    to: f32,
    visit: F,
}

impl<L: Lanes, F: FnMut(Hit)> Visit<L> for Each<'_, L, F> {
    const AMONG_NODES: bool = false;

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.to
    }

    #[inline(always)]
    unsafe fn leaf(&mut self, instance: usize, near: f32) -> bool {
        // SAFETY: as in `Instances`.
        let hit = unsafe { within::<L>(self.scene, instance, &self.line, self.from, self.to, near) };
        if let Some(hit) = hit {
            (self.visit)(hit);
        }
        false
    }
}

/// First hit in every instance, for rays that are close together: the instances near the tile are
/// found once, and each ray then tests only their boxes.
pub(super) struct Tile<'a, F> {
    pub scene: &'a SceneBvh,
    pub rays: &'a [Ray],
    pub from: f32,
    pub to: f32,
    pub visit: F,
}

impl<F: FnMut(usize, Hit)> Task for Tile<'_, F> {
    type Out = ();

    #[inline(always)]
    unsafe fn run<L: Lanes>(self) {
        let Self { scene, rays, from, to, mut visit } = self;
        let Some(frustum) = Frustum::around(rays, scene.reach) else {
            for (number, ray) in rays.iter().enumerate() {
                let visit = |hit| visit(number, hit);
                // SAFETY: the caller vouches for the CPU.
                unsafe { All { scene, ray, from, to, visit }.run::<L>() };
            }
            return;
        };
        let mut nodes: Vec<Node> = Vec::new();
        let mut slot = WIDTH;
        for (number, placed) in scene.instances.iter().enumerate() {
            if frustum.meets(&placed.bounds) {
                if slot == WIDTH {
                    nodes.push(Node::EMPTY);
                    slot = 0;
                }
                let node = nodes.len() - 1;
                nodes[node].set(slot, &placed.bounds, Link::leaf(number));
                slot += 1;
            }
        }
        if nodes.is_empty() {
            return;
        }
        for (number, ray) in rays.iter().enumerate() {
            // SAFETY: the caller vouches for the CPU.
            let (line, start) = unsafe { (Line::<L>::new(ray), L::splat(from)) };
            // SAFETY: as above.
            let Some((slabs, _)) = (unsafe { line.aim(scene.reach, PLACED_BAND) }) else { continue };
            for node in &nodes {
                // SAFETY: as above; a link that a ray meets is an instance.
                unsafe {
                    let (mut hits, near) = slabs.test(node, start, to);
                    let near = L::store(near);
                    while hits != 0 {
                        let slot = hits.trailing_zeros() as usize & (WIDTH - 1);
                        hits &= hits - 1;
                        let instance = node.links[slot].index();
                        let hit = within::<L>(scene, instance, &line, from, to, near.0[slot]);
                        if let Some(hit) = hit {
                            visit(number, hit);
                        }
                    }
                }
            }
        }
    }
}

/// The first hit in one instance.
///
/// # Safety
/// The CPU has the features of `L`; `instance` is in range.
#[inline(always)]
unsafe fn within<L: Lanes>(
    scene: &SceneBvh,
    instance: usize,
    line: &Line<L>,
    from: f32,
    to: f32,
    near: f32,
) -> Option<Hit> {
    let mut nearest = Nearest::new(to, |_: &Hit| true);
    nearest.instance = instance as u32;
    // SAFETY: the caller's promises.
    unsafe {
        let placed = scene.instances.get_unchecked(instance);
        let line = line.seen_from(&placed.object_from_world);
        placed.mesh.walk::<L, true, _>(&line, from, near, &mut nearest);
    }
    nearest.found()
}

/// A sink that is told which instance the next hits are in.
trait SceneSink: Sink {
    fn enter(&mut self, instance: u32);
}

/// Keeps the best hit.
struct Nearest<F> {
    /// Numbers at their largest while nothing is found, so that a hit at the limit still wins.
    best: Hit,
    instance: u32,
    keep: F,
}

impl<F: Fn(&Hit) -> bool> Nearest<F> {
    #[inline(always)]
    fn new(to: f32, keep: F) -> Self {
        let best = Hit { t: to, u: 0.0, v: 0.0, primitive: u32::MAX, instance: u32::MAX };
        Self { best, instance: 0, keep }
    }

    #[inline(always)]
    fn found(self) -> Option<Hit> {
        (self.best.instance != u32::MAX).then_some(self.best)
    }
}

impl<F: Fn(&Hit) -> bool> Sink for Nearest<F> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.best.t
    }

    #[inline(always)]
    fn offer(&mut self, candidate: Candidate) -> bool {
        let Candidate { t, u, v, primitive } = candidate;
        let best = &self.best;
        let nearer = t < best.t || (t == best.t && (self.instance, primitive) < (best.instance, best.primitive));
        if nearer {
            let hit = Hit { t, u, v, primitive, instance: self.instance };
            if (self.keep)(&hit) {
                self.best = hit;
            }
        }
        false
    }
}

impl<F: Fn(&Hit) -> bool> SceneSink for Nearest<F> {
    #[inline(always)]
    fn enter(&mut self, instance: u32) {
        self.instance = instance;
    }
}

/// Stops at any hit.
struct First<F> {
    to: f32,
    instance: u32,
    keep: F,
}

impl<F: Fn(&Hit) -> bool> Sink for First<F> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.to
    }

    #[inline(always)]
    fn offer(&mut self, candidate: Candidate) -> bool {
        let Candidate { t, u, v, primitive } = candidate;
        (self.keep)(&Hit { t, u, v, primitive, instance: self.instance })
    }
}

impl<F: Fn(&Hit) -> bool> SceneSink for First<F> {
    #[inline(always)]
    fn enter(&mut self, instance: u32) {
        self.instance = instance;
    }
}
