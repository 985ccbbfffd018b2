//! A scene ready to be traced: the prepared scene with its trees, and the surface at a hit.

use std::cell::Cell;
use std::sync::{Arc, OnceLock};
use syntable_bvh::{Hit, Instance, MeshBvh, Ray, SceneBvh};
use syntable_model::context::Workers;
use syntable_model::error::Result;
use syntable_model::scene::Scene;
use syntable_model::stage::Bodies;
use syntable_prepare::labels::{BlendedLabels, instance_id};
use syntable_prepare::{AssetCache, PreparedScene, Sampler, SceneCache, SurfacePoint};
use syntable_simd::{Rgb, Vec3};
use syntable_transport::surface::transmittance_of_pane;

/// Maximum bytes of trees that are kept though no scene uses them.
const CAPACITY: u64 = 256 << 20;

/// Caches that sessions of a renderer share between scenes.
pub(crate) struct Caches {
    pub scene: SceneCache,
    trees: AssetCache<MeshBvh>,
}

impl Default for Caches {
    fn default() -> Self {
        Self { scene: SceneCache::default(), trees: AssetCache::new(CAPACITY) }
    }
}

/// A scene ready to be traced. Body `i` of the scene is instance `i` of the tree.
#[derive(Clone)]
pub(crate) struct World {
    pub scene: PreparedScene,
    bvh: SceneBvh,
    /// Bodies that camera rays meet, if not the whole scene.
    seen: Option<Seen>,
    /// Whether camera rays end without light at bodies that are not in the foreground.
    holds_out: bool,
    /// Trees of the bodies.
    trees: Vec<Arc<MeshBvh>>,
}

/// Bodies that camera rays meet.
#[derive(Clone)]
struct Seen {
    bvh: SceneBvh,
    /// For every body of the scene, whether camera rays meet it.
    bodies: Vec<bool>,
}

/// Panes on a straight line, and their transmittance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Passed {
    /// Transmittance of all panes.
    pub transmittance: Rgb,
    pub panes: u32,
}

impl World {
    /// Prepares a scene, body by body over the workers.
    pub fn new(scene: &Scene, caches: &Caches, workers: &dyn Workers) -> Self {
        Self::posed(scene, caches, None, workers)
    }

    /// Prepares a scene. Trees of an earlier pose of the same scene are used again: then only the top level is rebuilt.
    pub fn posed(scene: &Scene, caches: &Caches, before: Option<&Self>, workers: &dyn Workers) -> Self {
        let bodies = scene.bodies();
        let prepared = PreparedScene::new(scene, &caches.scene, workers);
        let build = |i: usize| {
            if let Some(tree) = before.and_then(|world| world.trees.get(i)) {
                return Arc::clone(tree);
            }
            let object = &bodies[i].object;
            let data = object.mesh.data();
            let build = || MeshBvh::build(&data.positions, &data.triangles);
            caches.trees.get(object.digest, build, MeshBvh::size)
        };
        let trees: Vec<OnceLock<Arc<MeshBvh>>> = bodies.iter().map(|_| OnceLock::new()).collect();
        workers.run(bodies.len(), &|i| {
            trees[i].get_or_init(|| build(i));
        });
        let trees: Vec<_> =
            trees.into_iter().enumerate().map(|(i, tree)| tree.into_inner().unwrap_or_else(|| build(i))).collect();
        let bvh = top_level(&prepared, &trees, |_| true);
        Self { bvh, scene: prepared, seen: None, holds_out: false, trees }
    }

    /// The world with some of its bodies. They keep their indices.
    pub fn with_bodies(&self, bodies: &Bodies) -> Result<Self> {
        if let Bodies::All = bodies {
            return Ok(self.clone());
        }
        if let Bodies::Foreground = bodies {
            return Ok(Self { holds_out: true, ..self.clone() });
        }
        let chosen = bodies.chosen(self.scene.bodies.len())?;
        let bvh = top_level(&self.scene, &self.trees, |body| chosen[body]);
        let mut world = self.clone();
        if let Bodies::Only(_) = bodies {
            world.scene.emitters.retain(|emitter| chosen[emitter.instance as usize]);
            world.bvh = bvh.clone();
        }
        world.seen = Some(Seen { bvh, bodies: chosen });
        Ok(world)
    }

    /// A tree of one body only.
    pub fn alone(&self, instance: usize) -> SceneBvh {
        let world_from_object = self.scene.bodies[instance].world_from_body();
        SceneBvh::build([Instance { world_from_object, mesh: self.trees[instance].clone(), id: 0 }])
    }

    /// The tree of the bodies that camera rays meet.
    pub fn seen(&self) -> &SceneBvh {
        self.seen.as_ref().map_or(&self.bvh, |seen| &seen.bvh)
    }

    /// Whether camera rays meet a body.
    pub fn is_seen(&self, instance: usize) -> bool {
        self.seen.as_ref().is_none_or(|seen| seen.bodies[instance])
    }

    /// Whether camera rays end without light at a body.
    pub fn is_held_out(&self, instance: u32) -> bool {
        self.holds_out && instance as usize >= self.scene.foreground
    }

    /// The first surface of a ray beyond the distance `from`. `from_camera` selects the bodies that camera rays meet, none if one
    /// of them holds the ray out;
    /// `seed` decides at surfaces with partial coverage.
    #[inline]
    pub fn closest(&self, ray: &Ray, from: f32, seed: u32, from_camera: bool) -> Option<Hit> {
        let bvh = if from_camera { self.seen() } else { &self.bvh };
        let closest = if self.scene.has_cutouts {
            bvh.closest_where(ray, from, f32::INFINITY, |hit| {
                self.is_solid(hit, ray, hit.instance, alpha_random(seed, hit))
            })
        } else {
            bvh.closest(ray, from, f32::INFINITY)
        };
        closest.filter(|hit| !from_camera || !self.is_held_out(hit.instance))
    }

    /// Prefetches the data that [`Self::surface`] reads for a hit.
    #[inline(always)]
    pub fn prefetch(&self, hit: &Hit) {
        let (_, triangle) = self.scene.at(&hit.point());
        syntable_simd::prefetch(triangle);
    }

    /// The panes along a shadow ray; `None` if another surface occludes it. `seed` is as for [`Self::closest`].
    #[inline]
    pub fn visibility(&self, ray: &Ray, to: f32, seed: u32) -> Option<Passed> {
        let occluded = if self.scene.has_panes {
            return self.visibility_through_panes(ray, to, seed);
        } else if self.scene.has_cutouts {
            self.bvh.any_where(ray, 0.0, to, |hit| self.is_solid(hit, ray, hit.instance, alpha_random(seed, hit)))
        } else {
            self.bvh.any(ray, 0.0, to)
        };
        (!occluded).then_some(Passed { transmittance: Rgb::ONE, panes: 0 })
    }

    #[inline(never)]
    fn visibility_through_panes(&self, ray: &Ray, to: f32, seed: u32) -> Option<Passed> {
        let passed = Cell::new(Passed { transmittance: Rgb::ONE, panes: 0 });
        let occluded = self.bvh.any_where(ray, 0.0, to, |hit| {
            if !self.is_solid(hit, ray, hit.instance, alpha_random(seed, hit)) {
                return false;
            }
            let transmittance = match self.scene.bodies[hit.instance as usize].has_panes() {
                true => {
                    transmittance_of_pane(&self.scene, &hit.point(), ray.origin.into(), ray.direction.into(), hit.t)
                }
                false => Rgb::ZERO,
            };
            let before = passed.get();
            passed.set(Passed { transmittance: before.transmittance * transmittance, panes: before.panes + 1 });
            transmittance.is_black()
        });
        (!occluded).then(|| passed.get())
    }

    /// Whether a hit on a body is on a surface and not in a hole; `u` in [0, 1) decides at partial coverage.
    #[inline]
    pub fn is_solid(&self, hit: &Hit, ray: &Ray, instance: u32, u: f32) -> bool {
        if !self.scene.bodies[instance as usize].has_cutouts() {
            return true;
        }
        let position = Vec3::from(ray.origin) + Vec3::from(ray.direction) * hit.t;
        self.scene.is_solid(&SurfacePoint { instance, ..hit.point() }, position, u)
    }

    /// Whether labels count a hit on a body as a surface.
    pub fn is_labeled(&self, hit: &Hit, ray: &Ray, instance: u32, blended: BlendedLabels) -> bool {
        let position = Vec3::from(ray.origin) + Vec3::from(ray.direction) * hit.t;
        self.scene.is_labeled(&SurfacePoint { instance, ..hit.point() }, position, blended)
    }
}

/// The top level over the bodies to keep; the others keep their index, and are never hit.
fn top_level(scene: &PreparedScene, trees: &[Arc<MeshBvh>], keep: impl Fn(usize) -> bool) -> SceneBvh {
    let nothing = Arc::new(MeshBvh::build(&[], &[]));
    SceneBvh::build(scene.bodies.iter().zip(trees).enumerate().map(|(i, (body, tree))| Instance {
        world_from_object: body.world_from_body(),
        mesh: if keep(i) { tree.clone() } else { nothing.clone() },
        id: u32::from(instance_id(i as u32).0),
    }))
}

/// A random number in [0, 1) for a surface with partial coverage: one for every ray and triangle.
#[inline]
fn alpha_random(seed: u32, hit: &Hit) -> f32 {
    let sampler = Sampler { seed, index: hit.primitive };
    sampler.random(hit.instance)
}
