//! Scenes whose labels can be worked out on paper.

use std::sync::Arc;
use syntable_model::digest::Hasher;
use syntable_model::geometry::{Point3, Pose, Vector3, look_at};
use syntable_model::scene::{
    AssetRef, BodyDraft, Camera, Exposure, Intrinsics, Light, MassOrigin, MassProperties, Material, Mesh, MeshData,
    Moment, Motion, Object, Region, Role, Scene, SceneBuilder, SettleReport, SourceModel, SphereLight, Support, View,
    ViewId,
};
use syntable_model::stage::DatasetInfo;

/// A closed box around the origin with flat faces, edge lengths in meters.
pub fn box_mesh(size: [f32; 3]) -> Mesh {
    let mut data = MeshData::default();
    for axis in 0..3 {
        for sign in [-1.0_f32, 1.0] {
            let first = data.positions.len() as u32;
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for [a, b] in [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]] {
                let (mut p, mut n) = ([0.0; 3], [0.0; 3]);
                (p[axis], p[u], p[v]) = (sign * 0.5 * size[axis], a * size[u], b * size[v]);
                n[axis] = sign;
                data.positions.push(p);
                data.normals.push(n);
                data.uvs.push([a + 0.5, b + 0.5]);
            }
            let quad = if sign > 0.0 { [[0, 1, 2], [0, 2, 3]] } else { [[0, 2, 1], [0, 3, 2]] };
            data.triangles.extend(quad.map(|t| t.map(|i: u32| i + first)));
        }
    }
    Mesh::new(data).expect("a box is sound")
}

/// An object of a mesh with one plain material.
pub fn object(name: &str, mesh: Mesh, color: [f32; 3]) -> Arc<Object> {
    let material = Material::plain(name, color, 0.5);
    let digest = Hasher::new("test object")
        .digest(material.digest)
        .floats(mesh.data().positions.iter().flatten().copied().collect::<Vec<_>>().into_iter())
        .finish();
    Arc::new(Object {
        name: name.to_owned(),
        category: "test".to_owned(),
        mass: MassProperties::of_mesh(&mesh, 0.2, MassOrigin::Known),
        mesh: Arc::new(mesh),
        materials: vec![Arc::new(material)],
        collision: None,
        keypoints: Vec::new(),
        support_areas: Vec::new(),
        restitution: None,
        model: SourceModel::default(),
        friction: 0.5,
        license: String::new(),
        digest,
    })
}

/// A body of an object at a place, not rotated.
pub fn body(object: Arc<Object>, at: [f64; 3], role: Role) -> BodyDraft {
    let motion = if role == Role::Object { Motion::Dynamic } else { Motion::Fixed };
    let asset = AssetRef { pool: "test".to_owned(), name: object.name.clone() };
    BodyDraft::new(asset, object, Pose::translation(at[0], at[1], at[2]), role, motion)
}

/// A builder with a table ([`add_table`]), and no room.
pub fn table() -> SceneBuilder {
    let mut builder = SceneBuilder::default();
    add_table(&mut builder);
    builder
}

/// Adds a table: a slab of 2 m × 2 m × 0.1 m whose top is at z = 0, the scene's support.
pub fn add_table(builder: &mut SceneBuilder) {
    let slab = object("table", box_mesh([2.0, 2.0, 0.1]), [0.5; 3]);
    builder.add(body(slab, [0.0, 0.0, -0.05], Role::Support));
    builder.supports = Support::new("table", Region::rectangle([0.0; 3], [2.0, 2.0])).into();
}

/// Boxes (center, edge lengths, meters) on the [`table`]; box `i` has the instance id `i + 1`.
pub fn boxes(boxes: &[([f64; 3], [f32; 3])]) -> Scene {
    let mut builder = table();
    for (i, &(at, size)) in boxes.iter().enumerate() {
        let shade = 0.3 + 0.4 * (i as f32 / boxes.len() as f32);
        builder.add(body(object(&format!("box_{i}"), box_mesh(size), [shade, 0.5, 0.5]), at, Role::Object));
    }
    builder.freeze(SettleReport::default()).expect("a scene of boxes is sound")
}

/// A view from `eye` towards `target`: square pixels, principal point in the center, the given horizontal field of
/// view, one sphere light above.
pub fn view(eye: [f64; 3], target: [f64; 3], size: [u32; 2], fov_deg: f64) -> View {
    let focal = f64::from(size[0]) / 2.0 / (fov_deg.to_radians() / 2.0).tan();
    let [width, height] = size;
    let intrinsics =
        Intrinsics { width, height, fx: focal, fy: focal, cx: f64::from(width) / 2.0, cy: f64::from(height) / 2.0 };
    let world_from_camera = look_at(Point3::from(eye), Point3::from(target), Vector3::z());
    View {
        moment: Moment::START,
        id: ViewId(0),
        camera: Camera::pinhole(intrinsics, world_from_camera),
        exposure: Exposure::Auto { compensation_ev: 0.0 },
        rig: None,
        lights: vec![Light::Sphere(SphereLight {
            center: Point3::new(0.5, -1.0, 3.0),
            radius: 0.2,
            radiance: [5000.0; 3],
        })],
    }
}

/// A dataset of one scene and one view.
pub fn dataset() -> DatasetInfo {
    DatasetInfo {
        name: "test".to_owned(),
        seed: 0,
        scenes: 1,
        views_per_scene: 1,
        recipe: String::new(),
        program: "test".to_owned(),
        classes: Vec::new(),
        own_categories: Vec::new(),
        label_surface: syntable_model::stage::LabelSurface::First,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::scene::Topology;

    #[test]
    fn a_box_is_closed_and_faces_outwards() {
        let mesh = box_mesh([0.2, 0.3, 0.4]);
        let topology = Topology::of(&mesh);
        assert!(topology.is_closed() && topology.is_oriented());
        assert!((mesh.signed_volume() - 0.024).abs() < 1e-8);
        // Normals agree with the winding.
        for (t, triangle) in mesh.data().triangles.iter().enumerate() {
            let [a, b, c] = mesh.corners(t);
            let normal = mesh.data().normals[triangle[0] as usize].map(f64::from);
            assert!((b - a).cross(&(c - a)).dot(&Vector3::from(normal)) > 0.0);
        }
    }
}
