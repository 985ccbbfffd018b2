//! Single rays against the bodies of a scene, on the processor: for stages that ask about a scene before it is rendered.
//! Surfaces are opaque, whatever their materials.

use crate::tree::{BinaryNode, BinaryTree, Bounds, TreeNode};
use std::sync::Arc;
use syntable_model::geometry::{Point3, Pose, Vector3};
use syntable_model::scene::{Mesh, Object, Scene};

/// Relative margin around boxes, so that rounding loses no flat triangle.
const BOX_MARGIN: f64 = 1e-6;

/// Directions in which a point is tested to be inside a mesh. They are not parallel to axes or diagonals, along which
/// meshes have their edges. Most must agree, because a mesh can have holes.
const DIRECTIONS: [[f64; 3]; 5] = [
    [0.531, 0.271, 0.803],
    [-0.733, 0.419, 0.536],
    [0.233, -0.877, 0.419],
    [-0.347, -0.613, -0.709],
    [0.821, 0.453, -0.347],
];

/// A mesh as a tree of triangles.
pub struct RayMesh {
    tree: BinaryTree,
    triangles: Vec<[[f32; 3]; 3]>,
    margin: f64,
}

impl RayMesh {
    /// The tree of a mesh.
    pub fn new(mesh: &Mesh) -> Self {
        let data = mesh.data();
        let triangles: Vec<[[f32; 3]; 3]> =
            data.triangles.iter().map(|corners| corners.map(|i| data.positions[i as usize])).collect();
        let boxes: Vec<Bounds> = triangles.iter().map(|corners| Bounds::of(corners)).collect();
        let tree = match boxes.as_slice() {
            [] => BinaryTree { nodes: Vec::new() },
            [only] => BinaryTree { nodes: vec![BinaryNode { bounds: *only, kind: TreeNode::Item(0) }] },
            several => BinaryTree::by_area(several),
        };
        let reach = tree.nodes.first().map_or(0.0, |root| root.bounds.reach());
        Self { tree, triangles, margin: f64::from(reach) * BOX_MARGIN }
    }

    /// Size, bytes.
    pub fn size(&self) -> usize {
        size_of_val(&self.triangles[..]) + size_of_val(&self.tree.nodes[..])
    }

    /// Calls `visit` with the ray parameter of every hit beyond zero, in any order, and whether the ray leaves the mesh
    /// there: it goes along the triangle's normal. `visit` returns the largest parameter that is still wanted.
    fn hits(&self, ray: &Ray, mut visit: impl FnMut(f64, bool) -> f64) {
        let mut end = f64::INFINITY;
        let mut pending: Vec<usize> = if self.tree.nodes.is_empty() { Vec::new() } else { vec![0] };
        while let Some(number) = pending.pop() {
            let BinaryNode { bounds, kind } = &self.tree.nodes[number];
            if !ray.meets(bounds, self.margin, end) {
                continue;
            }
            match *kind {
                TreeNode::Pair(a, b) => pending.extend([b, a]),
                TreeNode::Item(triangle) => {
                    if let Some((t, leaves)) = ray.hit(&self.triangles[triangle as usize]).filter(|(t, _)| *t <= end) {
                        end = visit(t, leaves);
                    }
                }
            }
        }
    }

    /// Parameter of the first hit, up to `end`.
    fn first(&self, ray: &Ray, end: f64) -> Option<f64> {
        let mut nearest = None;
        self.hits(ray, |t, _| {
            if t <= nearest.unwrap_or(end) {
                nearest = Some(t);
            }
            nearest.unwrap_or(end)
        });
        nearest
    }

    /// How often the surface winds around the point at which a ray begins: 1 inside, 0 outside, −1 inside a mesh that is
    /// turned inside out.
    fn winding(&self, ray: &Ray) -> i32 {
        let mut sum = 0;
        self.hits(ray, |_, leaves| {
            sum += if leaves { 1 } else { -1 };
            f64::INFINITY
        });
        sum
    }
}

/// A ray in the frame of a body.
struct Ray {
    origin: Vector3<f64>,
    direction: Vector3<f64>,
}

impl Ray {
    /// Whether the ray meets a box with a margin before `end`.
    fn meets(&self, bounds: &Bounds, margin: f64, end: f64) -> bool {
        let (mut first, mut last) = (0.0_f64, end);
        for axis in 0..3 {
            let [low, high] = [f64::from(bounds.lo[axis]) - margin, f64::from(bounds.hi[axis]) + margin];
            let (from, along) = (self.origin[axis], self.direction[axis]);
            if along == 0.0 {
                if !(low..=high).contains(&from) {
                    return false;
                }
                continue;
            }
            let (a, b) = ((low - from) / along, (high - from) / along);
            (first, last) = (first.max(a.min(b)), last.min(a.max(b)));
        }
        first <= last
    }

    /// Parameter of the hit of a triangle, and whether the ray goes along its normal (Möller and Trumbore 1997).
    fn hit(&self, corners: &[[f32; 3]; 3]) -> Option<(f64, bool)> {
        let [a, b, c] = corners.map(|p| Vector3::from(p.map(f64::from)));
        let (ab, ac) = (b - a, c - a);
        let p = self.direction.cross(&ac);
        let determinant = ab.dot(&p);
        if determinant == 0.0 {
            return None;
        }
        let from_a = self.origin - a;
        let u = from_a.dot(&p) / determinant;
        let q = from_a.cross(&ab);
        let v = self.direction.dot(&q) / determinant;
        let t = ac.dot(&q) / determinant;
        // The determinant is −direction · (ab × ac).
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some((t, determinant < 0.0))
    }
}

/// The bodies of a scene, by their index in [`Scene::bodies`].
pub struct RayScene(Vec<(Pose, Arc<RayMesh>)>);

impl RayScene {
    /// A scene at its moment. `tree` gives the tree of an object, which bodies and scenes can share.
    pub fn new(scene: &Scene, tree: impl Fn(&Object) -> Arc<RayMesh>) -> Self {
        let body = |body: &syntable_model::scene::Body| (body.world_from_body.inverse(), tree(&body.object));
        Self(scene.bodies().iter().map(body).collect())
    }

    /// Where a ray first hits a body, as the multiple of the direction's length.
    pub fn hit(&self, body: usize, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        let (ray, mesh) = self.ray(body, origin, direction);
        mesh.first(&ray, f64::INFINITY)
    }

    /// The first body that a ray hits up to `end`, of the bodies that `counts` accepts, and where, as a multiple of the
    /// direction's length.
    pub fn first(
        &self,
        origin: &Point3<f64>,
        direction: &Vector3<f64>,
        end: f64,
        counts: impl Fn(usize) -> bool,
    ) -> Option<(usize, f64)> {
        let mut found: Option<(usize, f64)> = None;
        for body in (0..self.0.len()).filter(|body| counts(*body)) {
            let (ray, mesh) = self.ray(body, origin, direction);
            let end = found.map_or(end, |(_, t)| t);
            if let Some(t) = mesh.first(&ray, end).filter(|t| found.is_none_or(|(_, nearest)| *t < nearest)) {
                found = Some((body, t));
            }
        }
        found
    }

    /// How often the surface of a body winds around a point: 1 inside, 0 outside, −1 inside a mesh that is turned inside
    /// out. The most frequent answer of some directions, because a mesh can have holes.
    pub fn winding(&self, body: usize, point: &Point3<f64>) -> i32 {
        let mut answers: Vec<i32> = DIRECTIONS
            .iter()
            .map(|direction| {
                let (ray, mesh) = self.ray(body, point, &Vector3::from(*direction));
                mesh.winding(&ray)
            })
            .collect();
        answers.sort_unstable();
        answers[answers.len() / 2]
    }

    fn ray(&self, body: usize, origin: &Point3<f64>, direction: &Vector3<f64>) -> (Ray, &RayMesh) {
        let (body_from_world, mesh) = &self.0[body];
        (Ray { origin: (body_from_world * origin).coords, direction: body_from_world * direction }, mesh)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::random::Stream;
    use syntable_model::scene::MeshData;

    /// A closed soup: tetrahedra at random places, disjoint by construction on a grid.
    fn soup(stream: &mut Stream, count: usize) -> Mesh {
        let mut data = MeshData::default();
        for k in 0..count {
            let at = [k % 3, k / 3 % 3, k / 9].map(|i| i as f64 * 2.5);
            let first = data.positions.len() as u32;
            let rotation = stream.rotation();
            for corner in [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]] {
                let p = rotation * Vector3::from(corner) * 0.6 + Vector3::from(at);
                data.positions.push([p.x as f32, p.y as f32, p.z as f32]);
            }
            data.triangles.extend([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]].map(|t| t.map(|i| first + i)));
        }
        Mesh::new(data).expect("sound")
    }

    #[test]
    fn rays_agree_with_every_triangle() {
        let mut stream = Stream::root(5);
        for count in [1, 20] {
            let mesh = soup(&mut stream, count);
            let tree = RayMesh::new(&mesh);
            let mut hits = 0;
            for _ in 0..500 {
                let origin = Vector3::from_fn(|_, _| stream.uniform(-2.0, 7.0));
                let bounds = mesh.bounds();
                let target = Vector3::from_fn(|axis, _| stream.uniform(bounds.min[axis], bounds.max[axis]));
                let ray = Ray { origin, direction: target - origin };
                // The plane of each triangle, and the signs of the areas around the point in it.
                let brute = (0..mesh.data().triangles.len()).filter_map(|t| {
                    let [a, b, c] = mesh.corners(t).map(|p| p.coords);
                    let normal = (b - a).cross(&(c - a));
                    let t = (a - ray.origin).dot(&normal) / ray.direction.dot(&normal);
                    let p = ray.origin + ray.direction * t;
                    let is_left = |a: Vector3<f64>, b: Vector3<f64>| (b - a).cross(&(p - a)).dot(&normal) > 0.0;
                    (t > 0.0 && is_left(a, b) && is_left(b, c) && is_left(c, a)).then_some(t)
                });
                let brute = brute.reduce(f64::min);
                let found = tree.first(&ray, f64::INFINITY);
                assert_eq!(found.is_some(), brute.is_some());
                if let (Some(found), Some(brute)) = (found, brute) {
                    assert!((found - brute).abs() < 1e-5, "{found} {brute}");
                    assert_eq!(tree.first(&ray, found * 0.999), None);
                    hits += 1;
                }
            }
            assert!(hits > 10, "{hits} hits of {count} tetrahedra");
        }
    }

    #[test]
    fn a_point_is_inside_where_barycentric_coordinates_are_positive() {
        let mut stream = Stream::root(6);
        let mesh = soup(&mut stream, 1);
        let corners: Vec<Vector3<f64>> =
            mesh.data().positions.iter().map(|p| Vector3::from(p.map(f64::from))).collect();
        let volume = |a: &Vector3<f64>, b: &Vector3<f64>, c: &Vector3<f64>, d: &Vector3<f64>| {
            (b - a).cross(&(c - a)).dot(&(d - a))
        };
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| &corners[i]);
        let scene = RayScene(vec![(Pose::identity(), Arc::new(RayMesh::new(&mesh)))]);
        let mut inside = 0;
        for _ in 0..500 {
            let p = Vector3::from_fn(|_, _| stream.uniform(-1.0, 1.0));
            let whole = volume(a, b, c, d);
            let parts = [volume(&p, b, c, d), volume(a, &p, c, d), volume(a, b, &p, d), volume(a, b, c, &p)];
            let is_inside = parts.iter().all(|part| part * whole > 0.0);
            assert_eq!(scene.winding(0, &p.into()) != 0, is_inside, "{p}");
            inside += u32::from(is_inside);
        }
        assert!(inside > 20, "{inside}");
    }
}
