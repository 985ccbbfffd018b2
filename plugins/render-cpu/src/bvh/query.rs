//! The questions a scene answers, each as a task to run on some lanes.

use super::{
    Hit, Ray,
    frustum::Frustum,
    kernel::Task,
    lanes::Lanes,
    ray::{PLACED_BAND, Slab, transform_ray},
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
        let slab = Slab::new(ray, scene.reach, PLACED_BAND)?;
        let mut visit = Instances::<_, true> { scene, ray, from, sink: Nearest::new(to, keep) };
        // SAFETY: the caller vouches for the CPU, `SceneBvh::build` for the tree.
        unsafe { walk::leaves::<L, true>(&scene.nodes, &slab, from, &mut visit) };
        visit.sink.found()
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
        let Some(slab) = Slab::new(ray, scene.reach, PLACED_BAND) else { return false };
        let mut visit = Instances::<_, false> { scene, ray, from, sink: First { to, instance: 0, keep } };
        // SAFETY: as in `Closest`.
        unsafe { walk::leaves::<L, false>(&scene.nodes, &slab, from, &mut visit) }
    }
}

/// Walks every instance met, all into one sink.
struct Instances<'a, S, const SORT: bool> {
    scene: &'a SceneBvh,
    ray: &'a Ray,
    from: f32,
    sink: S,
}

impl<S: SceneSink, const SORT: bool> Visit for Instances<'_, S, SORT> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.sink.limit()
    }

    #[inline(always)]
    unsafe fn leaf<L: Lanes>(&mut self, instance: usize, near: f32) -> bool {
        self.sink.enter(instance as u32);
        // SAFETY: leaves of the top level are instances; the caller vouches for the CPU.
        unsafe {
            let placed = self.scene.instances.get_unchecked(instance);
            let ray = transform_ray(&placed.object_from_world, self.ray);
            placed.mesh.walk::<L, SORT, S>(&ray, self.from, near, &mut self.sink)
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
        let Some(slab) = Slab::new(self.ray, self.scene.reach, PLACED_BAND) else { return };
        let (nodes, from) = (&self.scene.nodes, self.from);
        // SAFETY: as in `Closest`.
        unsafe { walk::leaves::<L, false>(nodes, &slab, from, &mut { self }) };
    }
}

impl<F: FnMut(Hit)> Visit for All<'_, F> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.to
    }

    #[inline(always)]
    unsafe fn leaf<L: Lanes>(&mut self, instance: usize, near: f32) -> bool {
        // SAFETY: as in `Instances`.
        let hit = unsafe { within::<L>(self.scene, instance, self.ray, self.from, self.to, near) };
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
            let Some(slab) = Slab::new(ray, scene.reach, PLACED_BAND) else { continue };
            // SAFETY: the caller vouches for the CPU.
            let slabs = unsafe { walk::Slabs::<L>::new(&slab, from) };
            for node in &nodes {
                // SAFETY: as above; a link that a ray meets is an instance.
                unsafe {
                    let (mut hits, near) = slabs.test(node, to);
                    while hits != 0 {
                        let slot = hits.trailing_zeros() as usize & (WIDTH - 1);
                        hits &= hits - 1;
                        let instance = node.links[slot].index();
                        let hit = within::<L>(scene, instance, ray, from, to, near.0[slot]);
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
unsafe fn within<L: Lanes>(scene: &SceneBvh, instance: usize, ray: &Ray, from: f32, to: f32, near: f32) -> Option<Hit> {
    let mut nearest = Nearest::new(to, |_: &Hit| true);
    nearest.instance = instance as u32;
    // SAFETY: the caller's promises.
    unsafe {
        let placed = scene.instances.get_unchecked(instance);
        let ray = transform_ray(&placed.object_from_world, ray);
        placed.mesh.walk::<L, true, _>(&ray, from, near, &mut nearest);
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
