//! The node tree: the transform of every mesh.

use super::get;
use gltf::json::mesh::Mesh;
use gltf::json::scene::Node;
use gltf::json::{Index, Root};
use nalgebra::{Matrix3, Matrix4, Quaternion, Translation3, UnitQuaternion, Vector3};
use syntable_model::error::{Error, Result};

/// A mesh placed by a node.
pub struct Instance {
    /// The mesh.
    pub mesh: Index<Mesh>,
    /// Number of the node.
    pub node: usize,
    /// From the mesh's frame to the body's: meters, z up.
    body_from_mesh: Matrix4<f64>,
    /// Transforms normals: the cofactors of the linear part, with its sign.
    normals: Matrix3<f64>,
    determinant: f64,
}

impl Instance {
    fn new(mesh: Index<Mesh>, node: usize, body_from_mesh: Matrix4<f64>) -> Self {
        let linear = body_from_mesh.fixed_view::<3, 3>(0, 0).into_owned();
        let [x, y, z] = [0, 1, 2].map(|i| Vector3::from(linear.column(i)));
        let determinant = linear.determinant();
        let cofactors = Matrix3::from_columns(&[y.cross(&z), z.cross(&x), x.cross(&y)]);
        let normals = cofactors * if determinant < 0.0 { -1.0 } else { 1.0 };
        Self { mesh, node, body_from_mesh, normals, determinant }
    }

    /// A point of the mesh in the body frame.
    pub fn transform_point(&self, p: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = p.map(f64::from);
        let p = self.body_from_mesh * nalgebra::Vector4::new(x, y, z, 1.0);
        [p.x as f32, p.y as f32, p.z as f32]
    }

    /// A normal of the mesh in the body frame, a unit vector; zero if it has no direction.
    pub fn transform_normal(&self, n: [f32; 3]) -> [f32; 3] {
        let n = self.normals * Vector3::from(n.map(f64::from));
        n.try_normalize(0.0).unwrap_or_default().map(|x| x as f32).into()
    }

    /// Whether faces change their winding.
    pub fn mirrors(&self) -> bool {
        self.determinant < 0.0
    }
}

/// All meshes of the first scene: the one that the file names, or else its first, or else all nodes.
pub fn instances(document: &Root) -> Result<Vec<Instance>> {
    let roots: Vec<Index<Node>> = match (document.scene, document.scenes.first()) {
        (Some(scene), _) => get(&document.scenes, scene, "scene")?.nodes.clone(),
        (None, Some(scene)) => scene.nodes.clone(),
        (None, None) => {
            let mut child = vec![false; document.nodes.len()];
            for index in document.nodes.iter().flat_map(|node| node.children.iter().flatten()) {
                if let Some(child) = child.get_mut(index.value()) {
                    *child = true;
                }
            }
            (0..document.nodes.len()).filter(|&i| !child[i]).map(|i| Index::new(i as u32)).collect()
        }
    };
    // glTF is y up: (x, y, z) becomes (x, -z, y).
    let z_up = Matrix4::new(1., 0., 0., 0., 0., 0., -1., 0., 0., 1., 0., 0., 0., 0., 0., 1.);
    let mut seen = vec![false; document.nodes.len()];
    let mut instances = Vec::new();
    // An explicit stack, so that a deep tree cannot overflow the call stack; reversed to keep the order of the file.
    let mut stack: Vec<(Index<Node>, Matrix4<f64>)> = roots.into_iter().rev().map(|node| (node, z_up)).collect();
    while let Some((index, parent)) = stack.pop() {
        let node = get(&document.nodes, index, "node")?;
        if std::mem::replace(&mut seen[index.value()], true) {
            return Err(Error::new(format!(
                "node {} is reached twice: the node tree has a cycle, or a node has two parents",
                index.value()
            )));
        }
        let body_from_node = parent * local(node);
        if let Some(mesh) = node.mesh {
            instances.push(Instance::new(mesh, index.value(), body_from_node));
        }
        stack.extend(node.children.iter().flatten().rev().map(|&child| (child, body_from_node)));
    }
    Ok(instances)
}

/// A node's own transform: a matrix, or scale, then rotation, then translation.
fn local(node: &Node) -> Matrix4<f64> {
    if let Some(matrix) = node.matrix {
        return Matrix4::from_column_slice(&matrix.map(f64::from));
    }
    let translation = Translation3::from(node.translation.unwrap_or_default().map(f64::from));
    let [x, y, z, w] = node.rotation.map_or([0.0, 0.0, 0.0, 1.0], |rotation| rotation.0).map(f64::from);
    let rotation = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 0.0).unwrap_or_default();
    let scale = Vector3::from(node.scale.unwrap_or([1.0; 3]).map(f64::from));
    translation.to_homogeneous() * rotation.to_homogeneous() * Matrix4::new_nonuniform_scaling(&scale)
}
