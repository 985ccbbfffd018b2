//! Rays that find the surface of a pixel.

use super::opaque::is_opaque;
use crate::materials::{materials, slot};
use std::sync::{Arc, OnceLock};
use syntable_model::context::Workers;
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::prelude::*;
use syntable_model::scene::{Body, Camera, Mesh};
use syntable_prepare::labels::BlendedLabels;
use syntable_prepare::{AssetCache, BinaryTree, Bounds, PreparedScene, SceneCache, SurfacePoint, TreeNode};

/// Maximum bytes of trees that are kept though no scene uses them.
const CAPACITY: u64 = 128 << 20;

/// Minimum fraction of the entering light that glass transmits.
const GLASS: f32 = 0.5;

/// Rows of an image per job.
const BAND: usize = 16;

/// Caches between views.
pub(super) struct Trees {
    trees: AssetCache<MeshTree>,
    scenes: SceneCache,
}

impl Default for Trees {
    fn default() -> Self {
        Self { trees: AssetCache::new(CAPACITY), scenes: SceneCache::default() }
    }
}

/// Finds surfaces of a view.
pub(super) struct Caster<'a> {
    workers: &'a dyn Workers,
    scene: &'a Scene,
    camera: &'a Camera,
    kept: &'a Trees,
    through_glass: bool,
    /// Whether all materials of a body are opaque, by its index.
    opaque: Vec<bool>,
    /// Built for bodies that rays are tested against.
    trees: Vec<OnceLock<Arc<MeshTree>>>,
    /// Built if textures are needed.
    prepared: OnceLock<PreparedScene>,
}

/// A point of a triangle.
#[derive(Clone, Copy)]
struct Hit {
    /// Depth.
    t: f64,
    triangle: usize,
    u: f64,
    v: f64,
}

/// A ray; its parameter is the depth.
#[derive(Clone, Copy)]
struct Ray {
    origin: Point3<f64>,
    direction: Vector3<f64>,
}

impl<'a> Caster<'a> {
    pub fn new(cx: &'a ViewContext, kept: &'a Trees, through_glass: bool) -> Result<Self> {
        let (scene, camera) = (cx.scene, &cx.view.camera);
        let bodies = scene.bodies();
        let opaque = bodies.iter().map(|body| materials(body).into_iter().all(is_opaque)).collect();
        let trees = bodies.iter().map(|_| OnceLock::new()).collect();
        Ok(Self { workers: cx.workers, scene, camera, kept, through_glass, opaque, trees, prepared: OnceLock::new() })
    }

    /// Whether all materials of a body are opaque.
    pub fn is_opaque(&self, index: usize) -> bool {
        self.opaque[index] || !self.through_glass
    }

    /// The rows of an image, computed by the workers.
    pub fn rows(&self, height: u32, row: &(dyn Fn(u32) -> Vec<u16> + Sync)) -> Vec<Vec<u16>> {
        let rows: Vec<OnceLock<Vec<u16>>> = (0..height).map(|_| OnceLock::new()).collect();
        self.workers.run(rows.len().div_ceil(BAND), &|band| {
            for y in (band * BAND..rows.len()).take(BAND) {
                rows[y].get_or_init(|| row(y as u32));
            }
        });
        rows.into_iter().filter_map(OnceLock::into_inner).collect()
    }

    /// Index and material slot of the surface that a pixel shows; `first` is the index of the pixel's first body.
    pub fn surface(&self, first: usize, [x, y]: [u32; 2]) -> Option<(usize, usize)> {
        let camera = self.camera;
        let in_camera = camera.unproject(f64::from(x) + 0.5, f64::from(y) + 0.5)?;
        let pose = &camera.world_from_camera;
        let ray = Ray { origin: pose.translation.vector.into(), direction: pose.rotation * in_camera };
        let of = |index: usize, far| Some((self.closest(index, &ray, far)?, index));
        let found = if self.is_opaque(first) {
            of(first, f64::INFINITY)
        } else {
            // Of bodies at equal depth, the body with the lower index is in front.
            (0..self.trees.len()).fold(None, |best: Option<(Hit, usize)>, index| {
                of(index, best.map_or(f64::INFINITY, |(hit, _)| hit.t)).or(best)
            })
        };
        let (triangle, index) = match found {
            Some((hit, index)) => (hit.triangle, index),
            // The renderer's ray grazes a body that this one misses.
            None if self.is_opaque(first) => (0, first),
            None => return None,
        };
        Some((index, slot(&self.scene.bodies()[index], triangle)))
    }

    /// The nearest surface of a body that ends the ray, nearer than `far`.
    fn closest(&self, index: usize, ray: &Ray, far: f64) -> Option<Hit> {
        let body = &self.scene.bodies()[index];
        let tree = self.trees[index].get_or_init(|| {
            self.kept.trees.get(body.object.digest, || MeshTree::new(&body.object.mesh), MeshTree::size)
        });
        let local = Ray {
            origin: body.world_from_body.inverse_transform_point(&ray.origin),
            direction: body.world_from_body.inverse_transform_vector(&ray.direction),
        };
        let is_there = |hit: &Hit| self.opaque[index] || self.is_there(index, body, ray, hit);
        tree.closest(&body.object.mesh, &local, far, is_there)
    }

    /// Whether labels count a hit as a surface, and the surface ends the ray.
    fn is_there(&self, index: usize, body: &Body, ray: &Ray, hit: &Hit) -> bool {
        let slot = slot(body, hit.triangle);
        if materials(body).get(slot).is_none_or(|material| is_opaque(material)) {
            return true;
        }
        let scene = self.prepared.get_or_init(|| PreparedScene::new(self.scene, &self.kept.scenes, self.workers));
        let (u, v) = (hit.u as f32, hit.v as f32);
        let point = SurfacePoint { instance: index as u32, primitive: hit.triangle as u32, u, v };
        let (prepared, triangle) = scene.at(&point);
        let (material, table) = (scene.material(prepared, triangle), &scene.materials);
        let position: [f64; 3] = (ray.origin + ray.direction * hit.t).into();
        let at = scene.texture_coordinates(material, &point, position.map(|x| x as f32).into(), 0.0);
        let blended = if self.through_glass { BlendedLabels::Coverage } else { BlendedLabels::Shape };
        let metallic = material.metallic.at(&table.textures, at);
        let passes = |layers: &syntable_prepare::MaterialLayers| {
            layers.transmitted_fraction(&table.textures, at, metallic) >= GLASS
        };
        let is_glass = self.through_glass && table.layers(material).is_some_and(passes);
        !is_glass && material.is_labeled(&table.textures, at.uv, blended)
    }
}

/// Triangles of a mesh in a binary tree.
struct MeshTree {
    /// Box, and the triangle or the two nodes below.
    nodes: Vec<(Bounds, TreeNode)>,
}

impl MeshTree {
    fn new(mesh: &Mesh) -> Self {
        let bounds = |triangle: &[u32; 3]| {
            let mut bounds = Bounds::EMPTY;
            triangle.iter().for_each(|&corner| bounds.include(mesh.data().positions[corner as usize]));
            bounds
        };
        let boxes: Vec<Bounds> = mesh.data().triangles.iter().map(bounds).collect();
        let nodes = match &boxes[..] {
            [] => Vec::new(),
            [only] => vec![(*only, TreeNode::Item(0))],
            boxes => BinaryTree::by_area(boxes).nodes.into_iter().map(|node| (node.bounds, node.kind)).collect(),
        };
        Self { nodes }
    }

    /// Bytes held.
    fn size(&self) -> usize {
        size_of_val(&self.nodes[..])
    }

    /// The nearest hit of a ray of the body frame, nearer than `far`, that is accepted.
    fn closest(&self, mesh: &Mesh, ray: &Ray, far: f64, accept: impl Fn(&Hit) -> bool) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        let reach = |best: &Option<Hit>| best.map_or(far, |hit| hit.t);
        let mut pending = Vec::with_capacity(64);
        let entry = |node: usize| Some((enters(&self.nodes[node].0, ray)?, node));
        pending.extend(self.nodes.first().and_then(|_| entry(0)));
        while let Some((enters_at, node)) = pending.pop() {
            if enters_at >= reach(&best) {
                continue;
            }
            match self.nodes[node].1 {
                TreeNode::Item(triangle) => {
                    let hit = meet(mesh.corners(triangle as usize), ray).map(|[t, u, v]| Hit {
                        t,
                        triangle: triangle as usize,
                        u,
                        v,
                    });
                    best = hit.filter(|hit| hit.t < reach(&best) && accept(hit)).or(best);
                }
                TreeNode::Pair(a, b) => {
                    let (a, b) = (entry(a), entry(b));
                    // Visit the nearer node first.
                    let swapped = a.zip(b).is_some_and(|(a, b)| a.0 < b.0);
                    let order = if swapped { [b, a] } else { [a, b] };
                    pending.extend(order.into_iter().flatten());
                }
            }
        }
        best
    }
}

/// Distance at which a ray enters a box, if it does; 0 from inside.
fn enters(bounds: &Bounds, ray: &Ray) -> Option<f64> {
    // Enlarged by a millionth, for rays in the plane of a face.
    let slack = 1e-6 * f64::from(bounds.reach());
    let (mut near, mut far) = (0.0_f64, f64::INFINITY);
    for axis in 0..3 {
        let [lo, hi] = [f64::from(bounds.lo[axis]) - slack, f64::from(bounds.hi[axis]) + slack];
        let (origin, direction) = (ray.origin[axis], ray.direction[axis]);
        if direction == 0.0 {
            if !(lo..=hi).contains(&origin) {
                return None;
            }
            continue;
        }
        let (a, b) = ((lo - origin) / direction, (hi - origin) / direction);
        (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
    }
    (near <= far).then_some(near)
}

/// Distance at which a ray meets a triangle, and the weights of its second and third corner (Möller and Trumbore,
/// 1997).
fn meet([a, b, c]: [Point3<f64>; 3], ray: &Ray) -> Option<[f64; 3]> {
    let (ab, ac) = (b - a, c - a);
    let across = ray.direction.cross(&ac);
    let determinant = ab.dot(&across);
    if determinant == 0.0 {
        return None;
    }
    let from = ray.origin - a;
    let u = from.dot(&across) / determinant;
    let along = from.cross(&ab);
    let v = ray.direction.dot(&along) / determinant;
    let t = ac.dot(&along) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some([t, u, v])
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::scene::MeshData;

    #[test]
    fn the_nearest_of_all_triangles() {
        let mut stream = Stream::root(5);
        let mut point = |reach: f64| [(); 3].map(|()| stream.uniform(-reach, reach));
        let mut data = MeshData::default();
        for first in (0..600).step_by(3) {
            let center = point(1.0);
            let corner = |_| std::array::from_fn(|axis| center[axis] as f32 + point(0.2)[axis] as f32);
            data.positions.extend([0, 1, 2].map(corner));
            data.triangles.push([first, first + 1, first + 2]);
        }
        let mesh = Mesh::new(data).expect("sound");
        let tree = MeshTree::new(&mesh);
        let mut hits = 0;
        for _ in 0..500 {
            let (origin, target) = (Point3::from(point(2.0)), Point3::from(point(0.8)));
            let ray = Ray { origin, direction: target - origin };
            for (far, odd) in [(f64::INFINITY, false), (f64::INFINITY, true), (0.7, false)] {
                let accept = |hit: &Hit| !odd || hit.triangle % 2 == 1;
                let all = (0..200).filter_map(|triangle| {
                    let [t, u, v] = meet(mesh.corners(triangle), &ray)?;
                    Some(Hit { t, triangle, u, v }).filter(|hit| accept(hit) && t < far)
                });
                let want = all.min_by(|a, b| a.t.total_cmp(&b.t)).map(|hit| hit.triangle);
                let got = tree.closest(&mesh, &ray, far, accept).map(|hit| hit.triangle);
                assert_eq!(got, want);
                hits += usize::from(want.is_some());
            }
        }
        assert!((300..1400).contains(&hits), "{hits} of 1500 rays meet something");
    }
}
