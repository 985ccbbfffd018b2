//! A scene made ready: trees, surfaces and materials of every body, and what a ray finds at a hit.

use crate::bsdf::Lobe;
use crate::bvh::{Affine, Hit, Instance, Ray, SceneBvh};
use crate::cache::SceneCache;
use crate::light::{Emitter, Glowing};
use crate::material::{Alpha, Component, Coordinates, Mapping, Material, box_axes};
use crate::mesh::{TracedMesh, Triangle, unpack};
use crate::real::{max, min};
use crate::sampler::Sampler;
use crate::vec3::{Rgb, Vec3, vec3};
use std::sync::{Arc, Mutex, PoisonError};
use syntable_model::context::Workers;
use syntable_model::geometry::Pose;
use syntable_model::scene::{self, Body, Scene, TextureMapping, UvTransform};

/// A scene ready to be traced. Body `i` of the scene is instance `i` of the tree.
pub(crate) struct World {
    pub bvh: SceneBvh,
    bodies: Vec<TracedBody>,
    materials: Vec<Material>,
    /// How many of the bodies are objects; they come first.
    pub objects: usize,
    /// How many are objects or distractors, which come next; the rest is table and room.
    pub things: usize,
    /// Whether any body has cut-outs.
    pub has_cutouts: bool,
    /// Whether any material has layers to draw from.
    pub is_layered: bool,
    /// Bodies that glow.
    emitters: Vec<Emitter>,
}

/// A body as shading sees it.
struct TracedBody {
    mesh: Arc<TracedMesh>,
    /// Columns of the rotation, world from body.
    rotation: [Vec3; 3],
    translation: Vec3,
    /// Position of slot 0 in the world's materials.
    first_material: u32,
    last_slot: u16,
    /// Whether any of its materials has cut-outs.
    has_cutouts: bool,
}

/// What a ray finds where it meets a body.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    /// World, on the triangle's plane.
    pub position: Vec3,
    /// Unit normal of the triangle, towards the ray's origin.
    pub face: Vec3,
    /// Unit shading normal, on the same side as `face`, with the ray's origin above its horizon.
    pub normal: Vec3,
    /// Whether `normal` is bent away from `face`.
    pub bent: bool,
    /// The layer that the path meets.
    pub component: Component,
    /// Whether the ray came through the body's filling.
    pub inside: bool,
    /// Share of the light that the filling left on the way.
    pub passage: Rgb,
    /// Colour of the base.
    pub albedo: Rgb,
    /// Emitted radiance towards the ray, nits.
    pub emission: Rgb,
}

impl Surface {
    /// Whether it shows other surfaces rather than its own colour.
    #[inline(always)]
    pub fn is_mirror(&self) -> bool {
        let Component { lobe, substance, .. } = &self.component;
        substance.roughness < 0.15 && (substance.metallic > 0.9 || matches!(lobe, Lobe::Glass | Lobe::Pane))
    }
}

impl World {
    /// Makes a scene ready, body by body over the workers.
    pub fn new(scene: &Scene, cache: &SceneCache, workers: &dyn Workers) -> Self {
        let bodies = scene.bodies();
        // Objects that several bodies share are made once; a worker never waits for one that it makes itself.
        type Made = (Arc<TracedMesh>, Vec<Material>);
        let made: Vec<Mutex<Option<Made>>> = bodies.iter().map(|_| Mutex::new(None)).collect();
        workers.run(bodies.len(), &|i| {
            let part = (cache.mesh(&bodies[i].object), materials(&bodies[i], cache));
            *made[i].lock().unwrap_or_else(PoisonError::into_inner) = Some(part);
        });
        let mut world = Self {
            bvh: SceneBvh::build([]),
            bodies: Vec::with_capacity(bodies.len()),
            materials: Vec::new(),
            objects: scene.objects().len(),
            things: scene.things().len(),
            has_cutouts: false,
            is_layered: false,
            emitters: Vec::new(),
        };
        let mut instances = Vec::with_capacity(bodies.len());
        for (body, part) in bodies.iter().zip(made) {
            let part = part.into_inner().unwrap_or_else(PoisonError::into_inner);
            let (mesh, materials) = part.unwrap_or_else(|| (cache.mesh(&body.object), self::materials(body, cache)));
            let (rotation, translation) = placement(&body.world_from_body);
            let has_cutouts = materials.iter().any(|m| m.alpha != Alpha::Opaque);
            instances.push(Instance {
                world_from_object: affine(rotation, translation),
                mesh: mesh.bvh.clone(),
                id: u32::from(body.id.0),
            });
            world.has_cutouts |= has_cutouts;
            world.is_layered |= materials.iter().any(Material::is_layered);
            world.bodies.push(TracedBody {
                mesh,
                rotation,
                translation,
                first_material: world.materials.len() as u32,
                last_slot: (materials.len() - 1) as u16,
                has_cutouts,
            });
            world.materials.extend(materials);
            world.emitters.extend(world.emitter(body, world.bodies.len() - 1));
        }
        world.bvh = SceneBvh::build(instances);
        world
    }

    /// The glowing triangles of a body.
    fn emitter(&self, body: &Body, instance: usize) -> Option<Emitter> {
        let traced = &self.bodies[instance];
        let materials = &self.materials[traced.first_material as usize..];
        if !materials.iter().any(Material::glows) {
            return None;
        }
        let data = body.object.mesh.data();
        let glowing = |(number, corners): (usize, &[u32; 3])| {
            let triangle = &traced.mesh.triangles[number];
            let material = self.material(traced, triangle.slot);
            if !material.glows() {
                return None;
            }
            let corners = corners.map(|i| traced.to_world(Vec3::from(data.positions[i as usize])) + traced.translation);
            // The triangle as a whole, as far as its textures can tell.
            let middle =
                Hit { t: 0.0, u: 1.0 / 3.0, v: 1.0 / 3.0, primitive: number as u32, instance: instance as u32 };
            let centre = (corners[0] + corners[1] + corners[2]) * (1.0 / 3.0);
            let width = (corners[1] - corners[0]).length().max((corners[2] - corners[0]).length());
            let at = coordinates(material, triangle, &middle, traced.point_to_body(centre), width);
            Some(Glowing { primitive: number as u32, corners, radiance: material.emission(at) })
        };
        let triangles = data.triangles.iter().enumerate().filter_map(glowing).collect();
        Emitter::new(instance as u32, triangles, data.triangles.len())
    }

    /// Bodies that glow.
    pub fn emitters(&self) -> &[Emitter] {
        &self.emitters
    }

    /// Radiance that a body emits at a point, nits.
    pub fn emission(&self, hit: &Hit, position: Vec3) -> Rgb {
        let body = &self.bodies[hit.instance as usize];
        let triangle = &body.mesh.triangles[hit.primitive as usize];
        let material = self.material(body, triangle.slot);
        material.emission(coordinates(material, triangle, hit, body.point_to_body(position), 0.0))
    }

    /// Number of bodies.
    pub fn len(&self) -> usize {
        self.bodies.len()
    }

    /// Whether a body has cut-outs, so that hits on it must be tested.
    pub fn body_has_cutouts(&self, instance: usize) -> bool {
        self.bodies[instance].has_cutouts
    }

    /// The tree of one body alone.
    pub fn alone(&self, instance: usize) -> SceneBvh {
        let body = &self.bodies[instance];
        let world_from_object = affine(body.rotation, body.translation);
        SceneBvh::build([Instance { world_from_object, mesh: body.mesh.bvh.clone(), id: 0 }])
    }

    #[inline(always)]
    fn material(&self, body: &TracedBody, slot: u16) -> &Material {
        &self.materials[body.first_material as usize + usize::from(slot.min(body.last_slot))]
    }

    /// The first surface of a ray; `coin` decides where surfaces cover in part.
    #[inline]
    pub fn closest(&self, ray: &Ray, to: f32, coin: u32) -> Option<Hit> {
        if self.has_cutouts {
            self.bvh.closest_where(ray, 0.0, to, |hit| self.is_solid(hit, ray, hit.instance, chance(coin, hit)))
        } else {
            self.bvh.closest(ray, 0.0, to)
        }
    }

    /// Asks for what [`Self::surface`] will read of a hit.
    #[inline(always)]
    pub fn prefetch(&self, hit: &Hit) {
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
            let triangle = &self.bodies[hit.instance as usize].mesh.triangles[hit.primitive as usize];
            // SAFETY: SSE is part of x86-64, and a prefetch reads nothing.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(triangle).cast()) };
        }
        #[cfg(not(target_arch = "x86_64"))]
        let _ = hit;
    }

    /// Whether a surface is in the way; `coin` as for [`Self::closest`].
    #[inline]
    pub fn occluded(&self, ray: &Ray, to: f32, coin: u32) -> bool {
        if self.has_cutouts {
            self.bvh.any_where(ray, 0.0, to, |hit| self.is_solid(hit, ray, hit.instance, chance(coin, hit)))
        } else {
            self.bvh.any(ray, 0.0, to)
        }
    }

    /// Whether there is a surface at a hit on a body, or a hole; where it covers in part, `u` in [0, 1) decides.
    #[inline]
    pub fn is_solid(&self, hit: &Hit, ray: &Ray, instance: u32, u: f32) -> bool {
        let body = &self.bodies[instance as usize];
        if !body.has_cutouts {
            return true;
        }
        let triangle = &body.mesh.triangles[hit.primitive as usize];
        let material = self.material(body, triangle.slot);
        if material.alpha == Alpha::Opaque {
            return true;
        }
        let p = Vec3::from(ray.origin) + Vec3::from(ray.direction) * hit.t;
        let at = coordinates(material, triangle, hit, body.point_to_body(p), 0.0);
        material.is_solid(at.uv, u)
    }

    /// The surface at a hit. `along` is the ray's unit direction, `width` how wide the ray is there, metres; `draw` in
    /// [0, 1) draws one of its layers.
    #[inline(always)]
    pub fn surface(&self, hit: &Hit, origin: Vec3, along: Vec3, t: f32, width: f32, draw: f32) -> Surface {
        let body = &self.bodies[hit.instance as usize];
        let triangle = &body.mesh.triangles[hit.primitive as usize];
        let material = self.material(body, triangle.slot);

        let outward = body.to_world(triangle.normal);
        let mut position = origin + along * t;
        // Back onto the triangle's plane, so that what is left of the error does not grow with the distance.
        position = position + outward * (triangle.plane + outward.dot(body.translation) - outward.dot(position));
        let side = if outward.dot(along) > 0.0 { -1.0 } else { 1.0 };
        let face = outward * side;

        let mut bent = triangle.smooth;
        let mut normal = face;
        if triangle.smooth {
            let [a, b, c] = triangle.normals.map(unpack);
            let smooth = a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v;
            normal = body.to_world(smooth * side).normalized_or(face);
        }
        let tint = match body.mesh.colors.get(hit.primitive as usize) {
            Some(colors) => {
                let [a, b, c] = colors.map(|c| Rgb::from(c.map(|x| f32::from(x) * (1.0 / 65535.0))));
                a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v
            }
            None => Rgb::ONE,
        };
        let at = if material.is_plain() {
            Coordinates { uv: [0.0; 2], log2_width: 0.0 }
        } else {
            let width = width / max(face.dot(along).abs(), 0.05).sqrt();
            coordinates(material, triangle, hit, body.point_to_body(position), width)
        };
        let base = material.substance(at, tint);
        let mut component = material.component(at, base, normal.dot(along).abs(), draw);
        if material.has_bumps(component.is_coat) {
            let (u, v) = body.texture_frame(material, triangle, hit, side);
            let variance;
            (normal, variance) = material.mapped_normal(at, u, v, normal, component.is_coat);
            bent = true;
            if variance > 0.0 {
                // Bumps that cannot be seen one by one make the surface as much rougher.
                let alpha = component.substance.roughness * component.substance.roughness;
                component.substance.roughness = min((alpha * alpha + 2.0 * variance).sqrt().sqrt(), 1.0);
            }
        }
        if bent {
            normal = above_horizon(normal, face, -along);
        }
        Surface {
            position,
            face,
            normal,
            bent,
            component,
            inside: side < 0.0,
            passage: if side < 0.0 { material.passage(t) } else { Rgb::ONE },
            albedo: base.base_color,
            emission: material.emission(at),
        }
    }
}

/// A number in [0, 1) for a surface that covers in part: one for every ray and triangle.
#[inline]
fn chance(coin: u32, hit: &Hit) -> f32 {
    let sampler = Sampler { seed: coin, index: hit.primitive };
    sampler.coin(hit.instance)
}

impl TracedBody {
    #[inline(always)]
    fn to_world(&self, v: Vec3) -> Vec3 {
        let [x, y, z] = self.rotation;
        x * v.x + y * v.y + z * v.z
    }

    #[inline(always)]
    fn point_to_body(&self, p: Vec3) -> Vec3 {
        let [x, y, z] = self.rotation;
        let p = p - self.translation;
        vec3(p.dot(x), p.dot(y), p.dot(z))
    }

    /// Directions in which u and v grow, world; for a material with a normal map.
    #[inline]
    fn texture_frame(&self, material: &Material, triangle: &Triangle, hit: &Hit, side: f32) -> (Vec3, Vec3) {
        let (u, v) = match material.mapping {
            Mapping::Uv(_) => {
                let Some(tangents) = self.mesh.tangents.get(hit.primitive as usize) else {
                    return (Vec3::ZERO, Vec3::ZERO);
                };
                let [a, b, c] = tangents.map(unpack);
                let u = a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v;
                let v = triangle.normal.cross(u);
                (u, if triangle.mirrored { -v } else { v })
            }
            Mapping::Box { .. } => box_axes(triangle.normal),
        };
        let (u, v) = material.mapping.frame(u, v);
        // Seen from behind, bumps become dents: directions along the surface turn round with the normal.
        (self.to_world(u) * side, self.to_world(v) * side)
    }
}

/// Texture coordinates at a hit; `p_body` is the point in the body's frame.
#[inline(always)]
fn coordinates(material: &Material, triangle: &Triangle, hit: &Hit, p_body: Vec3, width: f32) -> Coordinates {
    match &material.mapping {
        Mapping::Uv(affine) => {
            let [a, b, c] = triangle.uvs;
            let w = 1.0 - hit.u - hit.v;
            let uv = [0, 1].map(|i| a[i] * w + b[i] * hit.u + c[i] * hit.v);
            Mapping::by_uv(affine, uv, triangle.uv_per_m, width)
        }
        Mapping::Box { per_m, laid } => Mapping::by_box(*per_m, laid, p_body, triangle.normal, width),
    }
}

/// Bends a shading normal so that it is on the side of the face and the viewer is above its horizon.
#[inline]
fn above_horizon(normal: Vec3, face: Vec3, wo: Vec3) -> Vec3 {
    let mut n = normal;
    let lean = n.dot(face);
    if lean < 0.05 {
        n = (n + face * (0.05 - lean)).normalized_or(face);
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

/// A body's materials by slot, laid on it.
fn materials(body: &Body, cache: &SceneCache) -> Vec<Material> {
    match &body.surface {
        Some(surface) => vec![Material::new(&surface.material, surface.mapping, cache)],
        None => {
            let own = TextureMapping::Uv(UvTransform::default());
            let plain = Arc::new(scene::Material::plain("none", [0.5; 3], 1.0));
            let materials = &body.object.materials;
            let used = if materials.is_empty() { std::slice::from_ref(&plain) } else { &materials[..] };
            used.iter().map(|material| Material::new(material, own, cache)).collect()
        }
    }
}

fn placement(pose: &Pose) -> ([Vec3; 3], Vec3) {
    let m = pose.rotation.to_rotation_matrix();
    let column = |c: usize| vec3(m[(0, c)] as f32, m[(1, c)] as f32, m[(2, c)] as f32);
    let t = pose.translation.vector;
    ([column(0), column(1), column(2)], vec3(t.x as f32, t.y as f32, t.z as f32))
}

fn affine([x, y, z]: [Vec3; 3], t: Vec3) -> Affine {
    [[x.x, y.x, z.x, t.x], [x.y, y.y, z.y, t.y], [x.z, y.z, z.z, t.z]]
}
