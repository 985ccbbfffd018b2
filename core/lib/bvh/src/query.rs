//! The queries of a scene, each as a task that runs on lanes of the processor.

use super::{
    Hit, Ray,
    frustum::Frustum,
    ray::{Line, PLACED_BAND},
    scene::SceneBvh,
    walk::{self, Candidate, Sink, Visit},
    wide::{Link, Node, WIDTH},
};
use syntable_simd::{Simd, Task, Wide};

impl SceneBvh {
    /// The first hit of a ray.
    #[inline]
    pub fn closest(&self, ray: &Ray, from: f32, to: f32) -> Option<Hit> {
        self.closest_where(ray, from, to, |_| true)
    }

    /// The first hit that `keep` accepts, for alpha tests. `keep` may be called for hits farther than the result, in
    /// any order.
    #[inline]
    pub fn closest_where(&self, ray: &Ray, from: f32, to: f32, keep: impl Fn(&Hit) -> bool) -> Option<Hit> {
        self.processor.run(Closest { scene: self, ray, from: forward(from), to, keep })
    }

    /// Whether anything occludes the ray: a shadow ray.
    #[inline]
    pub fn any(&self, ray: &Ray, from: f32, to: f32) -> bool {
        self.any_where(ray, from, to, |_| true)
    }

    /// Whether anything that `keep` accepts occludes the ray.
    #[inline]
    pub fn any_where(&self, ray: &Ray, from: f32, to: f32, keep: impl Fn(&Hit) -> bool) -> bool {
        self.processor.run(Any { scene: self, ray, from: forward(from), to, keep })
    }

    /// Calls `visit` with the first hit in each instance, at any depth behind the others, in no
    /// particular order of instances.
    #[inline]
    pub fn all_instances(&self, ray: &Ray, from: f32, to: f32, visit: impl FnMut(Hit)) {
        self.processor.run(All { scene: self, ray, from: forward(from), to, visit });
    }

    /// [`Self::all_instances`] for every ray of a tile: `visit` also gets the ray's position in
    /// `rays`. A little faster than ray by ray when the rays share an origin and are close together.
    #[inline]
    pub fn all_instances_tile(&self, rays: &[Ray], from: f32, to: f32, visit: impl FnMut(usize, Hit)) {
        self.processor.run(Tile { scene: self, rays, from: forward(from), to, visit });
    }
}

/// Rays only go forward. Also turns NaN and -0 into 0.
#[inline(always)]
fn forward(from: f32) -> f32 {
    if from > 0.0 { from } else { 0.0 }
}

/// First hit that `keep` accepts.
pub(super) struct Closest<'a, F> {
    pub scene: &'a SceneBvh,
    pub ray: &'a Ray,
    pub from: f32,
    pub to: f32,
    pub keep: F,
}

impl<F: Fn(&Hit) -> bool> Task for Closest<'_, F> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Option<Hit> {
        let Self { scene, ray, from, to, keep } = self;
        let mut sink = Nearest::new(to, keep);
        walk_scene::<S::Wide, true, _>(scene, ray, from, &mut sink);
        sink.found()
    }
}

/// Whether `keep` accepts any hit.
pub(super) struct Any<'a, F> {
    pub scene: &'a SceneBvh,
    pub ray: &'a Ray,
    pub from: f32,
    pub to: f32,
    pub keep: F,
}

impl<F: Fn(&Hit) -> bool> Task for Any<'_, F> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        let Self { scene, ray, from, to, keep } = self;
        walk_scene::<S::Wide, false, _>(scene, ray, from, &mut First { to, instance: 0, keep })
    }
}

/// Offers to `sink` the hits of the ray in any instance; true if the sink ended the walk.
#[inline(always)]
fn walk_scene<L: Wide, const SORT: bool, S: SceneSink>(scene: &SceneBvh, ray: &Ray, from: f32, sink: &mut S) -> bool {
    let line = Line::<L>::new(ray);
    let mut visit = Instances::<L, S, SORT> { scene, line, from, sink };
    if scene.nodes.root.is_leaf() {
        // No instance or one: its mesh has its own box. SAFETY: `SceneBvh::build` made the tree.
        return scene.nodes.root != Link::NONE && unsafe { visit.leaf(scene.nodes.root.index(), from) };
    }
    let Some((slabs, _)) = line.aim(scene.reach, PLACED_BAND) else { return false };
    // SAFETY: as above.
    unsafe { walk::leaves::<L, _, SORT>(&scene.nodes, &slabs, from, &mut visit) }
}

/// Walks every instance that the ray meets, all with one sink.
struct Instances<'a, L: Wide, S, const SORT: bool> {
    scene: &'a SceneBvh,
    line: Line<L>,
    from: f32,
    sink: &'a mut S,
}

impl<L: Wide, S: SceneSink, const SORT: bool> Visit<L> for Instances<'_, L, S, SORT> {
    const AMONG_NODES: bool = false;

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.sink.limit()
    }

    #[inline(always)]
    unsafe fn leaf(&mut self, instance: usize, near: f32) -> bool {
        self.sink.enter(instance as u32);
        // SAFETY: leaves of the top level are instances.
        let placed = unsafe { self.scene.instances.get_unchecked(instance) };
        let line = self.line.seen_from(&placed.object_from_world);
        placed.mesh.walk::<L, SORT, S>(&line, self.from, near, self.sink)
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
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { scene, ray, from, to, visit } = self;
        let line = Line::<S::Wide>::new(ray);
        let Some((slabs, _)) = line.aim(scene.reach, PLACED_BAND) else { return };
        let mut each = Each { scene, line, from, to, visit };
        // SAFETY: `SceneBvh::build` made the tree.
        unsafe { walk::leaves::<S::Wide, _, true>(&scene.nodes, &slabs, from, &mut each) };
    }
}

/// Walks every instance that the ray meets, each on its own.
struct Each<'a, L: Wide, F> {
    scene: &'a SceneBvh,
    line: Line<L>,
    from: f32,
    to: f32,
    visit: F,
}

impl<L: Wide, F: FnMut(Hit)> Visit<L> for Each<'_, L, F> {
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
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { scene, rays, from, to, mut visit } = self;
        let Some(frustum) = Frustum::around(rays, scene.reach) else {
            for (number, ray) in rays.iter().enumerate() {
                let visit = |hit| visit(number, hit);
                All { scene, ray, from, to, visit }.run::<S>();
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
            let (line, start) = (Line::<S::Wide>::new(ray), S::Wide::splat(from));
            let Some((slabs, _)) = line.aim(scene.reach, PLACED_BAND) else { continue };
            for node in &nodes {
                let (mut hits, near) = slabs.test(node, start, to);
                let near = S::Wide::store(near);
                while hits != 0 {
                    let slot = hits.trailing_zeros() as usize & (WIDTH - 1);
                    hits &= hits - 1;
                    let instance = node.links[slot].index();
                    // SAFETY: a link that a ray meets is an instance.
                    let hit = unsafe { within::<S::Wide>(scene, instance, &line, from, to, near.0[slot]) };
                    if let Some(hit) = hit {
                        visit(number, hit);
                    }
                }
            }
        }
    }
}

/// The first hit in one instance.
///
/// # Safety
/// `instance` is in range.
#[inline(always)]
unsafe fn within<L: Wide>(
    scene: &SceneBvh,
    instance: usize,
    line: &Line<L>,
    from: f32,
    to: f32,
    near: f32,
) -> Option<Hit> {
    let mut nearest = Nearest::new(to, |_: &Hit| true);
    nearest.instance = instance as u32;
    // SAFETY: the caller's promise.
    let placed = unsafe { scene.instances.get_unchecked(instance) };
    let line = line.seen_from(&placed.object_from_world);
    placed.mesh.walk::<L, true, _>(&line, from, near, &mut nearest);
    nearest.found()
}

/// A sink that the walk informs about the instance of the next hits.
trait SceneSink: Sink {
    fn enter(&mut self, instance: u32);
}

/// Keeps the best hit.
struct Nearest<F> {
    /// Its numbers are the largest until a hit is found, so that a hit at the limit still wins.
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
