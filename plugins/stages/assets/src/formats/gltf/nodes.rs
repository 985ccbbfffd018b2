//! The node tree: the transform of every mesh.

use super::accessor::{count, vectors};
use super::buffers::GltfBuffers;
use super::items::get;
use super::primitive::{Deformation, PrimitiveArrays};
use crate::formats::within;
use gltf::json::mesh::Mesh;
use gltf::json::scene::Node;
use gltf::json::skin::Skin;
use gltf::json::{Index, Root};
use nalgebra::{Matrix4, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::Deserialize;
use std::rc::Rc;
use syntable_mesh::placement::Placement;
use syntable_model::error::{Error, Result};

/// The extension that places a mesh many times by one node.
const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// A mesh placed by a node.
pub struct MeshInstance {
    /// The mesh.
    pub mesh: Index<Mesh>,
    /// Number of the node.
    pub node: usize,
    /// Weights of the morph targets.
    weights: Rc<[f32]>,
    /// Placement without a skin.
    placement: Placement,
    /// From the mesh's frame to the body's by joint, if a skin poses it.
    skin: Option<Rc<[Matrix4<f64>]>>,
}

impl MeshInstance {
    /// Weights and skinning that shape the mesh.
    pub fn shape(&self) -> Deformation<'_> {
        Deformation { weights: &self.weights, skinned: self.skin.is_some() }
    }

    /// The placement of a vertex: of the whole mesh, or the weighted mean of its joints' placements.
    pub fn placement(&self, primitive: &PrimitiveArrays, vertex: usize) -> Result<Placement> {
        let Some(joints) = &self.skin else { return Ok(self.placement) };
        let (mut sum, mut total) = (Matrix4::zeros(), 0.0);
        for set in &primitive.influences {
            let Some((indices, weights)) = set.get(vertex) else { continue };
            for (&index, &weight) in indices.iter().zip(weights) {
                if weight > 0.0 {
                    let joint = joints.get(index as usize).ok_or_else(|| {
                        Error::new(format!("vertex {vertex} follows joint {index}, but the skin has {}", joints.len()))
                    })?;
                    sum += joint * f64::from(weight);
                    total += f64::from(weight);
                }
            }
        }
        // Weights that were rounded add up to nearly one.
        Ok(if total > 0.0 { Placement::new(sum / total) } else { self.placement })
    }
}

/// All meshes of the first scene: the default scene of the file, or else its first scene, or else all nodes.
pub fn instances(document: &Root, buffers: &mut GltfBuffers<'_>) -> Result<Vec<MeshInstance>> {
    let parents = parents(document);
    let roots: Vec<Index<Node>> = match (document.scene, document.scenes.first()) {
        (Some(scene), _) => get(&document.scenes, scene, "scene")?.nodes.clone(),
        (None, Some(scene)) => scene.nodes.clone(),
        (None, None) => {
            (0..document.nodes.len()).filter(|&i| parents[i].is_none()).map(|i| Index::new(i as u32)).collect()
        }
    };
    let mut seen = vec![false; document.nodes.len()];
    let mut instances = Vec::new();
    // An explicit stack, so that a deep tree cannot overflow the call stack; reversed to keep the order of the file.
    let mut stack: Vec<(Index<Node>, Matrix4<f64>)> = roots.into_iter().rev().map(|node| (node, z_up())).collect();
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
            let weights = node.weights.as_ref().or(get(&document.meshes, mesh, "mesh")?.weights.as_ref());
            let weights: Rc<[f32]> = weights.map_or(&[][..], Vec::as_slice).into();
            let skin = match node.skin {
                Some(skin) => Some(pose(document, buffers, skin, &parents)?),
                None => None,
            };
            let within_node = |error| within(error, format!("node {}", index.value()));
            for copy in copies(document, buffers, node).map_err(within_node)? {
                let placement = Placement::new(body_from_node * copy);
                let (weights, skin) = (weights.clone(), skin.clone());
                instances.push(MeshInstance { mesh, node: index.value(), weights, placement, skin });
            }
        }
        stack.extend(node.children.iter().flatten().rev().map(|&child| (child, body_from_node)));
    }
    Ok(instances)
}

/// glTF is y up: (x, y, z) becomes (x, -z, y).
fn z_up() -> Matrix4<f64> {
    Matrix4::new(1., 0., 0., 0., 0., 0., -1., 0., 0., 1., 0., 0., 0., 0., 0., 1.)
}

/// The parent of every node.
fn parents(document: &Root) -> Vec<Option<usize>> {
    let mut parents = vec![None; document.nodes.len()];
    for (i, node) in document.nodes.iter().enumerate() {
        for child in node.children.iter().flatten() {
            if let Some(parent) = parents.get_mut(child.value()) {
                *parent = Some(i);
            }
        }
    }
    parents
}

/// A node's own transform: a matrix, or scale, then rotation, then translation.
fn local(node: &Node) -> Matrix4<f64> {
    if let Some(matrix) = node.matrix {
        return Matrix4::from_column_slice(&matrix.map(f64::from));
    }
    transform(
        node.translation.unwrap_or_default(),
        node.rotation.map_or([0.0, 0.0, 0.0, 1.0], |rotation| rotation.0),
        node.scale.unwrap_or([1.0; 3]),
    )
}

/// Scale, then rotation (x, y, z, w), then translation.
fn transform(translation: [f32; 3], rotation: [f32; 4], scale: [f32; 3]) -> Matrix4<f64> {
    let translation = Translation3::from(translation.map(f64::from));
    let [x, y, z, w] = rotation.map(f64::from);
    let rotation = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 0.0).unwrap_or_default();
    let scale = Vector3::from(scale.map(f64::from));
    translation.to_homogeneous() * rotation.to_homogeneous() * Matrix4::new_nonuniform_scaling(&scale)
}

/// Transforms of the copies that a node places: one, unless the node has instances.
fn copies(document: &Root, buffers: &mut GltfBuffers<'_>, node: &Node) -> Result<Vec<Matrix4<f64>>> {
    #[derive(Deserialize)]
    struct Instancing {
        attributes: InstancingAttributes,
    }
    #[derive(Deserialize)]
    #[serde(rename_all = "UPPERCASE")]
    struct InstancingAttributes {
        translation: Option<u32>,
        rotation: Option<u32>,
        scale: Option<u32>,
    }
    let Some(json) = node.extensions.as_ref().and_then(|extensions| extensions.others.get(INSTANCING)) else {
        return Ok(vec![Matrix4::identity()]);
    };
    let Instancing { attributes: InstancingAttributes { translation, rotation, scale } } =
        Instancing::deserialize(json).map_err(|error| within(Error::new(error.to_string()), INSTANCING))?;
    let mut total = None;
    for (accessor, components) in [(translation, 3), (rotation, 4), (scale, 3)] {
        let Some(accessor) = accessor else { continue };
        let found = count(document, buffers, Index::new(accessor), components)?;
        let first = *total.get_or_insert(found);
        if found != first {
            return Err(Error::new(format!("{INSTANCING} has attributes of {first} and of {found} instances")));
        }
    }
    let Some(total) = total else { return Ok(vec![Matrix4::identity()]) };
    buffers.budget().bytes(total.saturating_mul(size_of::<MeshInstance>() as u64))?;
    fn rows<const N: usize>(
        document: &Root,
        buffers: &mut GltfBuffers<'_>,
        accessor: Option<u32>,
    ) -> Result<Vec<[f32; N]>> {
        accessor.map_or(Ok(Vec::new()), |index| vectors(document, buffers, Index::new(index), None, INSTANCING))
    }
    let translations = rows::<3>(document, buffers, translation)?;
    let rotations = rows::<4>(document, buffers, rotation)?;
    let scales = rows::<3>(document, buffers, scale)?;
    let copy = |i: usize| {
        transform(
            translations.get(i).copied().unwrap_or_default(),
            rotations.get(i).copied().unwrap_or([0.0, 0.0, 0.0, 1.0]),
            scales.get(i).copied().unwrap_or([1.0; 3]),
        )
    };
    Ok((0..total as usize).map(copy).collect())
}

/// The transforms from a skinned mesh to the body by joint. The node that places the mesh has no effect.
fn pose(
    document: &Root,
    buffers: &mut GltfBuffers<'_>,
    skin: Index<Skin>,
    parents: &[Option<usize>],
) -> Result<Rc<[Matrix4<f64>]>> {
    let within_skin = |error| within(error, format!("skin {}", skin.value()));
    let skin = get(&document.skins, skin, "skin")?;
    let inverse = match skin.inverse_bind_matrices {
        Some(accessor) => {
            vectors::<16>(document, buffers, accessor, None, "inverse bind matrices").map_err(within_skin)?
        }
        None => Vec::new(),
    };
    let joint = |(i, &joint): (usize, &Index<Node>)| {
        get(&document.nodes, joint, "node").map_err(within_skin)?;
        let mut world = Matrix4::identity();
        let mut node = Some(joint.value());
        // A cycle of parents has at most all nodes.
        for _ in 0..=document.nodes.len() {
            let Some(at) = node else { break };
            world = local(&document.nodes[at]) * world;
            node = parents[at];
        }
        let bind = match inverse.get(i) {
            Some(matrix) => Matrix4::from_column_slice(&matrix.map(f64::from)),
            None => Matrix4::identity(),
        };
        Ok(z_up() * world * bind)
    };
    skin.joints.iter().enumerate().map(joint).collect()
}
