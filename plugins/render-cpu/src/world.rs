//! A scene ready to be traced: the prepared scene with its trees, and the surface at a hit.

use crate::bsdf::{Lobe, pane_transmittance};
use crate::bvh::{Hit, Instance, MeshBvh, Ray, SceneBvh};
use crate::layer::{LayerSample, base_parameters, mapped_normal, normal_map, sample_layer};
use std::cell::Cell;
use std::sync::{Arc, OnceLock};
use syntable_model::context::Workers;
use syntable_model::error::{Error, Result};
use syntable_model::scene::Scene;
use syntable_model::stage::Bodies;
use syntable_prepare::labels::{BlendedLabels, instance_id};
use syntable_prepare::{
    AssetCache, PreparedScene, ProjectedEnvironment, Sampler, SceneCache, SurfacePoint, TextureCoordinates, unpack_unit,
};
use syntable_simd::{Rgb, Vec3, max, min};

/// Bytes of trees that are kept though no scene uses them.
const CAPACITY: u64 = 256 << 20;

/// What sessions of a renderer share between scenes.
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
    /// What camera rays meet, if not the whole scene.
    seen: Option<Seen>,
    /// Trees of the bodies.
    trees: Vec<Arc<MeshBvh>>,
}

/// Bodies that camera rays meet.
#[derive(Clone)]
struct Seen {
    bvh: SceneBvh,
    /// For every body of the scene, whether it is one.
    bodies: Vec<bool>,
}

/// What light passes on a straight way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Passed {
    /// Transmittance of all panes.
    pub transmittance: Rgb,
    pub panes: u32,
}

/// The surface at a hit.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    /// World, on the plane of the triangle.
    pub position: Vec3,
    /// Unit normal of the triangle, towards the ray's origin.
    pub face: Vec3,
    /// Unit shading normal, on the same side as `face`, with the ray's origin above its horizon.
    pub normal: Vec3,
    /// Whether `normal` differs from `face`.
    pub is_perturbed: bool,
    /// The selected layer.
    pub layer: LayerSample,
    /// Whether the ray came through the body's interior medium.
    pub inside: bool,
    /// Whether it is a pane: light that it transmits goes straight on.
    pub is_pane: bool,
    /// Transmittance of the interior medium along the ray.
    pub transmittance: Rgb,
    /// Color of the base.
    pub albedo: Rgb,
    /// Emitted radiance towards the ray, nits.
    pub emission: Rgb,
}

/// The normals at a hit.
struct Frame {
    /// Unit normal of the triangle, out of the body.
    outward: Vec3,
    /// 1 if the ray comes from there, else −1.
    side: f32,
    /// As [`Surface::face`].
    face: Vec3,
    /// Interpolated normal, on the same side.
    normal: Vec3,
    /// Whether `normal` is that of a smooth mesh.
    is_smooth: bool,
}

impl Surface {
    /// Whether it shows other surfaces rather than its own color.
    #[inline(always)]
    pub fn is_mirror(&self) -> bool {
        let LayerSample { lobe, parameters, .. } = &self.layer;
        parameters.roughness < 0.15
            && (parameters.metallic > 0.9 || matches!(lobe, Lobe::Refraction | Lobe::ThinWalled))
    }
}

impl World {
    /// Prepares a scene, body by body over the workers.
    pub fn new(scene: &Scene, caches: &Caches, workers: &dyn Workers) -> Self {
        let bodies = scene.bodies();
        let prepared = PreparedScene::new(scene, &caches.scene, workers);
        let build = |i: usize| {
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
        Self { bvh, scene: prepared, seen: None, trees }
    }

    /// The world with some of its bodies. They keep their indices.
    pub fn with_bodies(&self, bodies: &Bodies) -> Result<Self> {
        let (Bodies::Only(ids) | Bodies::Seen(ids)) = *bodies else { return Ok(self.clone()) };
        let mut chosen = vec![false; self.scene.bodies.len()];
        for id in ids {
            let body = usize::from(id.0).checked_sub(1).and_then(|index| chosen.get_mut(index));
            let unknown = || Error::new(format!("there is no body {} to render", id.0)).permanent();
            *body.ok_or_else(unknown)? = true;
        }
        let bvh = top_level(&self.scene, &self.trees, |body| chosen[body]);
        let mut world = self.clone();
        if let Bodies::Only(_) = bodies {
            world.scene.emitters.retain(|emitter| chosen[emitter.instance as usize]);
            world.bvh = bvh.clone();
        }
        world.seen = Some(Seen { bvh, bodies: chosen });
        Ok(world)
    }

    /// The tree of one body alone.
    pub fn alone(&self, instance: usize) -> SceneBvh {
        let world_from_object = self.scene.bodies[instance].world_from_body();
        SceneBvh::build([Instance { world_from_object, mesh: self.trees[instance].clone(), id: 0 }])
    }

    /// The tree of what camera rays meet.
    pub fn seen(&self) -> &SceneBvh {
        self.seen.as_ref().map_or(&self.bvh, |seen| &seen.bvh)
    }

    /// Whether camera rays meet a body.
    pub fn is_seen(&self, instance: usize) -> bool {
        self.seen.as_ref().is_none_or(|seen| seen.bodies[instance])
    }

    /// The first surface of a ray beyond the distance `from`, from the camera or later; `seed` decides where surfaces cover
    /// in part.
    #[inline]
    pub fn closest(&self, ray: &Ray, from: f32, seed: u32, from_camera: bool) -> Option<Hit> {
        let bvh = if from_camera { self.seen() } else { &self.bvh };
        if self.scene.has_cutouts {
            bvh.closest_where(ray, from, f32::INFINITY, |hit| {
                self.is_solid(hit, ray, hit.instance, alpha_random(seed, hit))
            })
        } else {
            bvh.closest(ray, from, f32::INFINITY)
        }
    }

    /// Asks for what [`Self::surface`] will read of a hit.
    #[inline(always)]
    pub fn prefetch(&self, hit: &Hit) {
        let (_, triangle) = self.scene.at(&hit.point());
        syntable_simd::prefetch(triangle);
    }

    /// The panes on the way of a shadow ray; nothing if another surface occludes it. `seed` is as for [`Self::closest`].
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
                true => self.pane_transmittance(hit, ray),
                false => Rgb::ZERO,
            };
            let before = passed.get();
            passed.set(Passed { transmittance: before.transmittance * transmittance, panes: before.panes + 1 });
            transmittance.is_black()
        });
        (!occluded).then(|| passed.get())
    }

    /// Fraction of the light that a pane transmits along a ray: the mean of what its layers do to paths. Black for other
    /// surfaces.
    fn pane_transmittance(&self, hit: &Hit, ray: &Ray) -> Rgb {
        let (scene, point, along) = (&self.scene, hit.point(), Vec3::from(ray.direction));
        let (body, triangle) = scene.at(&point);
        let material = scene.material(body, triangle);
        let Some(layers) = scene.materials.pane(material) else { return Rgb::ZERO };
        let frame = self.frame(&point, along);
        let at = scene.texture_coordinates(material, &point, Vec3::from(ray.origin) + along * hit.t, 0.0);
        if !scene.materials.is_pane(material, at) {
            return Rgb::ZERO;
        }
        let textures = &scene.materials.textures[..];
        let base = base_parameters(textures, material, at, scene.vertex_color(&point));
        let normal = if frame.is_smooth { above_horizon(frame.normal, frame.face, -along) } else { frame.normal };
        let fraction = layers.transmitted_fraction(textures, at, base.metallic);
        base.base_color * (fraction * pane_transmittance(normal.dot(along).abs(), layers.ior))
    }

    /// The normals of a point, towards the origin of a ray along `along`.
    #[inline(always)]
    fn frame(&self, point: &SurfacePoint, along: Vec3) -> Frame {
        let (body, triangle) = self.scene.at(point);
        let outward = body.direction_to_world(triangle.normal);
        let side = if outward.dot(along) > 0.0 { -1.0 } else { 1.0 };
        let face = outward * side;
        let mut normal = face;
        if triangle.smooth {
            let [a, b, c] = triangle.normals.map(unpack_unit);
            let [wa, wb, wc] = point.weights();
            let smooth = a * wa + b * wb + c * wc;
            normal = body.direction_to_world(smooth * side).normalized_or(face);
        }
        Frame { outward, side, face, normal, is_smooth: triangle.smooth }
    }

    /// Whether there is a surface at a hit on a body, or a hole; where it covers in part, `u` in [0, 1) decides.
    #[inline]
    pub fn is_solid(&self, hit: &Hit, ray: &Ray, instance: u32, u: f32) -> bool {
        if !self.scene.bodies[instance as usize].has_cutouts() {
            return true;
        }
        let position = Vec3::from(ray.origin) + Vec3::from(ray.direction) * hit.t;
        self.scene.is_solid(&SurfacePoint { instance, ..hit.point() }, position, u)
    }

    /// Whether there is a surface for labels at a hit on a body.
    pub fn is_labeled(&self, hit: &Hit, ray: &Ray, instance: u32, blended: BlendedLabels) -> bool {
        let position = Vec3::from(ray.origin) + Vec3::from(ray.direction) * hit.t;
        self.scene.is_labeled(&SurfacePoint { instance, ..hit.point() }, position, blended)
    }

    /// The surface at a hit. `along` is the ray's unit direction, `width` that of its cone at the hit, meters; `u` in [0, 1)
    /// selects one of the layers. `projection` is for materials that show the environment.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the ray in parts, as batches hold it")]
    pub fn surface(
        &self,
        hit: &Hit,
        origin: Vec3,
        along: Vec3,
        t: f32,
        width: f32,
        u: f32,
        projection: Option<&ProjectedEnvironment>,
    ) -> Surface {
        let scene = &self.scene;
        let point = hit.point();
        let (body, triangle) = scene.at(&point);
        let material = scene.material(body, triangle);
        let textures = &scene.materials.textures[..];

        let Frame { outward, side, face, mut normal, is_smooth: mut is_perturbed } = self.frame(&point, along);
        let mut position = origin + along * t;
        // Back onto the plane of the triangle, so that the error left does not grow with the distance.
        position = position + outward * (triangle.plane + outward.dot(body.translation) - outward.dot(position));
        let at = if material.is_untextured() {
            TextureCoordinates { uv: [0.0; 2], log2_width: 0.0 }
        } else {
            let width = width / max(face.dot(along).abs(), 0.05).sqrt();
            scene.texture_coordinates(material, &point, position, width)
        };
        let mut base = base_parameters(textures, material, at, scene.vertex_color(&point));
        if let (Some(projection), Some(height)) = (projection, material.projection_height) {
            base.base_color = projection.albedo(height, position);
        }
        let mut layer = sample_layer(&scene.materials, material, at, base, normal.dot(along).abs(), u);
        if let Some(map) = normal_map(&scene.materials, material, layer.is_clearcoat) {
            let frame = scene.texture_frame(material, &point, side);
            let variance;
            (normal, variance) = mapped_normal(textures, map, at, frame, normal);
            is_perturbed = true;
            if variance > 0.0 {
                // Bumps that are too fine to be resolved make the surface rougher by their variance.
                let alpha = layer.parameters.roughness * layer.parameters.roughness;
                layer.parameters.roughness = min((alpha * alpha + 2.0 * variance).sqrt().sqrt(), 1.0);
            }
        }
        if is_perturbed {
            normal = above_horizon(normal, face, -along);
        }
        let medium = scene.materials.layers(material).filter(|_| side < 0.0);
        let is_pane = layer.lobe == Lobe::ThinWalled
            && scene.materials.pane(material).is_some()
            && scene.materials.is_pane(material, at);
        if is_pane {
            layer.parameters.roughness = 0.0;
        }
        Surface {
            position,
            face,
            normal,
            is_perturbed,
            layer,
            inside: side < 0.0,
            is_pane,
            transmittance: medium.map_or(Rgb::ONE, |layers| layers.transmittance(t)),
            albedo: base.base_color,
            emission: scene.materials.emission(material, at),
        }
    }
}

/// The top level over the bodies to keep; the others keep their place, and are never hit.
fn top_level(scene: &PreparedScene, trees: &[Arc<MeshBvh>], keep: impl Fn(usize) -> bool) -> SceneBvh {
    let nothing = Arc::new(MeshBvh::build(&[], &[]));
    SceneBvh::build(scene.bodies.iter().zip(trees).enumerate().map(|(i, (body, tree))| Instance {
        world_from_object: body.world_from_body(),
        mesh: if keep(i) { tree.clone() } else { nothing.clone() },
        id: u32::from(instance_id(i as u32).0),
    }))
}

/// A random number in [0, 1) for a surface that covers in part: one for every ray and triangle.
#[inline]
fn alpha_random(seed: u32, hit: &Hit) -> f32 {
    let sampler = Sampler { seed, index: hit.primitive };
    sampler.random(hit.instance)
}

impl Hit {
    /// The point without its distance.
    #[inline(always)]
    pub(crate) fn point(&self) -> SurfacePoint {
        SurfacePoint { instance: self.instance, primitive: self.primitive, u: self.u, v: self.v }
    }
}

/// Moves a shading normal to the side of the face, so that the viewer is above its horizon.
#[inline]
fn above_horizon(normal: Vec3, face: Vec3, wo: Vec3) -> Vec3 {
    let mut n = normal;
    let cosine = n.dot(face);
    if cosine < 0.05 {
        n = (n + face * (0.05 - cosine)).normalized_or(face);
    }
    let height = n.dot(wo);
    // Never steeper than the face itself allows.
    let least = min(0.02, 0.9 * face.dot(wo));
    if height < least {
        n = (n + (wo - n * height).normalized_or(Vec3::ZERO) * (least - height + 1e-4)).normalized_or(face);
        if n.dot(wo) <= 0.0 || n.dot(face) <= 0.0 {
            return face;
        }
    }
    n
}
