//! A scene as tables: shading meshes, materials and emissive triangles of every body.

use crate::cache::SceneCache;
use crate::emitter::{EmissiveBody, EmissiveTriangle};
use crate::labels::BlendedLabels;
use crate::mapping::{BoxSide, Mapping, TextureCoordinates};
use crate::material::{AlphaMode, Material, MaterialTable, TableBuilder};
use crate::mesh::{ShadingMesh, ShadingTriangle, unpack_unit};
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};
use syntable_model::context::Workers;
use syntable_model::geometry::Pose;
use syntable_model::scene::{self, Body, Scene, TextureMapping};
use syntable_simd::{Rgb, Vec3, vec3};

/// Tables of a scene. Body `i` of the scene has index `i` in [`Self::bodies`].
#[derive(Clone)]
pub struct PreparedScene {
    /// Meshes; bodies of the same object share one.
    pub meshes: Vec<Arc<ShadingMesh>>,
    /// Bodies, in the order of the scene.
    pub bodies: Vec<PreparedBody>,
    /// Materials of all bodies.
    pub materials: MaterialTable,
    /// Emissive bodies.
    pub emitters: Vec<EmissiveBody>,
    /// Number of objects; they come first.
    pub objects: usize,
    /// Number of objects and distractors, which come next; the rest is table and room.
    pub foreground: usize,
    /// Whether any body has cut-outs.
    pub has_cutouts: bool,
    /// Whether any material has layers.
    pub is_layered: bool,
    /// Whether any body has panes.
    pub has_panes: bool,
    /// Whether any body transmits light.
    pub has_glass: bool,
}

/// Shading data of a body.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct PreparedBody {
    /// Index in [`PreparedScene::meshes`].
    pub mesh: u32,
    /// Index of the material of slot 0 in the material table.
    pub first_material: u32,
    /// Last slot; higher slots of a mesh use it.
    pub last_slot: u32,
    /// Sum of [`Self::CUTOUTS`], [`Self::PANES`] and [`Self::GLASS`], if any of its materials has them.
    pub flags: u32,
    /// Columns of the rotation, world from body.
    pub rotation: [Vec3; 3],
    /// Position of the body frame, world, meters.
    pub translation: Vec3,
}

/// A point on a triangle of a body.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct SurfacePoint {
    /// Index of the body.
    pub instance: u32,
    /// Index of the triangle in the body's mesh.
    pub primitive: u32,
    /// Weight of the triangle's second corner.
    pub u: f32,
    /// Weight of the triangle's third corner.
    pub v: f32,
}

impl SurfacePoint {
    /// Weights of the corners.
    #[inline(always)]
    pub fn weights(&self) -> [f32; 3] {
        [1.0 - self.u - self.v, self.u, self.v]
    }
}

impl PreparedScene {
    /// Prepares a scene: meshes and textures in parallel, then the tables.
    pub fn new(scene: &Scene, cache: &SceneCache, workers: &dyn Workers) -> Self {
        let bodies = scene.bodies();
        // Bodies that share an asset wait for the body that prepares it.
        let loaded: Vec<OnceLock<(Arc<ShadingMesh>, Vec<_>)>> = bodies.iter().map(|_| OnceLock::new()).collect();
        workers.run(bodies.len(), &|i| {
            let textures = |(material, _): &(Arc<scene::Material>, _)| {
                material.textures().map(|used| (used.texture.digest, cache.texture(&used.texture))).collect::<Vec<_>>()
            };
            let textures = materials(&bodies[i]).iter().flat_map(textures).collect();
            loaded[i].get_or_init(|| (cache.mesh(&bodies[i].object), textures));
        });
        let mut prepared = Self {
            meshes: Vec::new(),
            bodies: Vec::with_capacity(bodies.len()),
            materials: MaterialTable::default(),
            emitters: Vec::new(),
            objects: scene.objects().len(),
            foreground: scene.foreground().len(),
            has_cutouts: false,
            is_layered: false,
            has_panes: false,
            has_glass: false,
        };
        let textures =
            loaded.iter().filter_map(|loaded| loaded.get()).flat_map(|(_, textures)| textures.iter().cloned());
        let (mut numbers, mut table) = (BTreeMap::new(), TableBuilder::new(cache, textures.collect()));
        for (body, loaded) in bodies.iter().zip(&loaded) {
            let mesh = *numbers.entry(body.object.digest).or_insert_with(|| {
                prepared.meshes.push(loaded.get().map_or_else(|| cache.mesh(&body.object), |(mesh, _)| mesh.clone()));
                prepared.meshes.len() as u32 - 1
            });
            let first_material = table.len() as u32;
            let mut flags = 0;
            for (material, mapping) in materials(body) {
                let material = table.push(&material, mapping);
                let (cutouts, layered) = (material.alpha != AlphaMode::Opaque, material.is_layered());
                let (panes, glass) = (table.has_panes(), table.has_glass());
                flags |= if cutouts { PreparedBody::CUTOUTS } else { 0 };
                flags |= if panes { PreparedBody::PANES } else { 0 };
                flags |= if glass { PreparedBody::GLASS } else { 0 };
                prepared.is_layered |= layered;
            }
            prepared.has_cutouts |= flags & PreparedBody::CUTOUTS != 0;
            prepared.has_panes |= flags & PreparedBody::PANES != 0;
            prepared.has_glass |= flags & PreparedBody::GLASS != 0;
            let last_slot = table.len() as u32 - first_material - 1;
            let (rotation, translation) = placement(&body.world_from_body);
            prepared.bodies.push(PreparedBody { mesh, first_material, last_slot, flags, rotation, translation });
        }
        prepared.materials = table.finish();
        prepared.emitters =
            bodies.iter().enumerate().filter_map(|(instance, body)| prepared.emissive_body(body, instance)).collect();
        prepared
    }

    /// The emissive triangles of a body.
    fn emissive_body(&self, body: &Body, instance: usize) -> Option<EmissiveBody> {
        let prepared = &self.bodies[instance];
        let first = prepared.first_material as usize;
        if !self.materials.materials[first..=first + prepared.last_slot as usize].iter().any(Material::is_emissive) {
            return None;
        }
        let data = body.object.mesh.data();
        let emissive = |(number, corners): (usize, &[u32; 3])| {
            let triangle = &self.mesh(prepared).triangles[number];
            let material = self.material(prepared, triangle);
            if !material.is_emissive() {
                return None;
            }
            let corners = corners
                .map(|i| prepared.direction_to_world(Vec3::from(data.positions[i as usize])) + prepared.translation);
            // One look-up at the centroid, as wide as the triangle.
            let (instance, third) = (instance as u32, 1.0 / 3.0);
            let point = SurfacePoint { instance, primitive: number as u32, u: third, v: third };
            let centroid = (corners[0] + corners[1] + corners[2]) * (1.0 / 3.0);
            let width = (corners[1] - corners[0]).length().max((corners[2] - corners[0]).length());
            let at = texture_coordinates(material, triangle, &point, prepared.point_to_body(centroid), width);
            let radiance = self.materials.emission(material, at);
            Some(EmissiveTriangle { primitive: number as u32, corners, radiance })
        };
        let triangles = data.triangles.iter().enumerate().filter_map(emissive).collect();
        EmissiveBody::new(instance as u32, triangles, data.triangles.len())
    }

    /// Mesh of a body.
    #[inline(always)]
    pub fn mesh(&self, body: &PreparedBody) -> &ShadingMesh {
        &self.meshes[body.mesh as usize]
    }

    /// The body and the triangle at a point.
    #[inline(always)]
    pub fn at(&self, point: &SurfacePoint) -> (&PreparedBody, &ShadingTriangle) {
        let body = &self.bodies[point.instance as usize];
        (body, &self.mesh(body).triangles[point.primitive as usize])
    }

    /// Material of a triangle of a body.
    #[inline(always)]
    pub fn material(&self, body: &PreparedBody, triangle: &ShadingTriangle) -> &Material {
        let slot = u32::from(triangle.slot).min(body.last_slot);
        &self.materials.materials[(body.first_material + slot) as usize]
    }

    /// Radiance that a body emits at a point, nits; `position` is the point in the world.
    pub fn emission(&self, point: &SurfacePoint, position: Vec3) -> Rgb {
        let (body, triangle) = self.at(point);
        let material = self.material(body, triangle);
        let at = texture_coordinates(material, triangle, point, body.point_to_body(position), 0.0);
        self.materials.emission(material, at)
    }

    /// Whether the surface exists at a point, or has a hole. If coverage is partial, it exists if `u` in [0, 1) is
    /// below the coverage. `position` is the point in the world.
    #[inline]
    pub fn is_solid(&self, point: &SurfacePoint, position: Vec3, u: f32) -> bool {
        let (body, triangle) = self.at(point);
        let material = self.material(body, triangle);
        if material.alpha == AlphaMode::Opaque {
            return true;
        }
        let at = texture_coordinates(material, triangle, point, body.point_to_body(position), 0.0);
        material.is_solid(&self.materials.textures, at.uv, u)
    }

    /// Whether the surface exists at a point for labels. `position` is the point in the world.
    pub fn is_labeled(&self, point: &SurfacePoint, position: Vec3, blended: BlendedLabels) -> bool {
        let (body, triangle) = self.at(point);
        let material = self.material(body, triangle);
        let at = texture_coordinates(material, triangle, point, body.point_to_body(position), 0.0);
        let is_seen_through = blended == BlendedLabels::Opaque && self.materials.is_glass(material, at.uv);
        !is_seen_through && material.is_labeled(&self.materials.textures, at.uv, blended)
    }

    /// Vertex color at a point; white if the mesh has none.
    #[inline(always)]
    pub fn vertex_color(&self, point: &SurfacePoint) -> Rgb {
        match self.mesh(&self.bodies[point.instance as usize]).colors.get(point.primitive as usize) {
            Some(colors) => {
                let [a, b, c] = colors.map(|c| Rgb::from(c.map(|x| f32::from(x) * (1.0 / 65535.0))));
                let [wa, wb, wc] = point.weights();
                a * wa + b * wb + c * wc
            }
            None => Rgb::ONE,
        }
    }

    /// Directions of increasing u and v of the material at a point, world, of any length; reversed for the back (`side`
    /// = −1). Zero if a normal map finds no tangents.
    #[inline]
    pub fn texture_frame(&self, material: &Material, point: &SurfacePoint, side: f32) -> (Vec3, Vec3) {
        let (body, triangle) = self.at(point);
        let (u, v) = match material.mapping {
            Mapping::Uv(_) => {
                let Some(tangents) = self.mesh(body).tangents.get(point.primitive as usize) else {
                    return (Vec3::ZERO, Vec3::ZERO);
                };
                let [a, b, c] = tangents.map(unpack_unit);
                let [wa, wb, wc] = point.weights();
                let u = a * wa + b * wb + c * wc;
                let v = triangle.normal.cross(u);
                (u, if triangle.mirrored { -v } else { v })
            }
            Mapping::Box { .. } => BoxSide::frame(triangle.normal),
        };
        let (u, v) = material.mapping.frame(u, v);
        // From behind, bumps become dents: directions along the surface are reversed with the normal.
        (body.direction_to_world(u) * side, body.direction_to_world(v) * side)
    }

    /// Texture coordinates of a material at a point. `position` is the point in the world, `width` the width of the
    /// look-up on the surface, meters.
    #[inline(always)]
    pub fn texture_coordinates(
        &self,
        material: &Material,
        point: &SurfacePoint,
        position: Vec3,
        width: f32,
    ) -> TextureCoordinates {
        let (body, triangle) = self.at(point);
        texture_coordinates(material, triangle, point, body.point_to_body(position), width)
    }
}

impl PreparedBody {
    /// Some of its materials have cut-outs: hits must be tested.
    pub const CUTOUTS: u32 = 1;
    /// Some of its materials are panes, which do not end shadow rays.
    pub const PANES: u32 = 2;
    /// Some of its materials transmit light: labels may look through.
    pub const GLASS: u32 = 4;

    /// Whether hits must be tested for cut-outs.
    #[inline(always)]
    pub fn has_cutouts(&self) -> bool {
        self.flags & Self::CUTOUTS != 0
    }

    /// Whether hits must be tested for labels.
    #[inline]
    pub fn is_tested(&self, blended: BlendedLabels) -> bool {
        self.has_cutouts() || blended == BlendedLabels::Opaque && self.flags & Self::GLASS != 0
    }

    /// Whether some of its surfaces transmit light straight.
    #[inline(always)]
    pub fn has_panes(&self) -> bool {
        self.flags & Self::PANES != 0
    }

    /// Rotates a direction from the body frame to the world.
    #[inline(always)]
    pub fn direction_to_world(&self, v: Vec3) -> Vec3 {
        let [x, y, z] = self.rotation;
        x * v.x + y * v.y + z * v.z
    }

    /// A point of the world in the body frame.
    #[inline(always)]
    pub fn point_to_body(&self, p: Vec3) -> Vec3 {
        let [x, y, z] = self.rotation;
        let p = p - self.translation;
        vec3(p.dot(x), p.dot(y), p.dot(z))
    }

    /// Rows of the 3×4 matrix, world from body, translation last.
    pub fn world_from_body(&self) -> [[f32; 4]; 3] {
        let ([x, y, z], t) = (self.rotation, self.translation);
        [[x.x, y.x, z.x, t.x], [x.y, y.y, z.y, t.y], [x.z, y.z, z.z, t.z]]
    }
}

/// Texture coordinates at a point; `p_body` is the point in the body frame.
#[inline(always)]
fn texture_coordinates(
    material: &Material,
    triangle: &ShadingTriangle,
    point: &SurfacePoint,
    p_body: Vec3,
    width: f32,
) -> TextureCoordinates {
    match &material.mapping {
        Mapping::Uv(affine) => {
            let [a, b, c] = triangle.uvs;
            let [wa, wb, wc] = point.weights();
            let uv = [0, 1].map(|i| a[i] * wa + b[i] * wb + c[i] * wc);
            Mapping::by_uv(affine, uv, triangle.uv_per_m, width)
        }
        Mapping::Box { per_m, transform } => Mapping::by_box(*per_m, transform, p_body, triangle.normal, width),
    }
}

/// Materials of a body by slot, with the placement of their textures.
fn materials(body: &Body) -> Vec<(Arc<scene::Material>, TextureMapping)> {
    let (mut materials, mapping) = (body.materials(), body.texture_mapping());
    if materials.is_empty() {
        materials.push(Arc::new(scene::Material::plain("none", [0.5; 3], 1.0)));
    }
    materials.into_iter().map(|material| (material, mapping)).collect()
}

fn placement(pose: &Pose) -> ([Vec3; 3], Vec3) {
    let m = pose.rotation.to_rotation_matrix();
    let column = |c: usize| vec3(m[(0, c)] as f32, m[(1, c)] as f32, m[(2, c)] as f32);
    let t = pose.translation.vector;
    ([column(0), column(1), column(2)], vec3(t.x as f32, t.y as f32, t.z as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::context::Serial;
    use syntable_model::digest::Digest;
    use syntable_model::geometry::{Translation3, UnitQuaternion, Vector3};
    use syntable_model::scene::{
        AssetRef, BodyDraft, Color, MassOrigin, MassProperties, Mesh, MeshData, Motion, Object, Region, Role,
        SceneBuilder, SettleReport, SourceModel, Support,
    };

    /// A triangle with legs of 1 m along x and y.
    fn object(name: &str, materials: Vec<Arc<scene::Material>>) -> Arc<Object> {
        let data = MeshData {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            triangles: vec![[0, 1, 2]],
            ..MeshData::default()
        };
        let mesh = Mesh::new(data).expect("sound");
        Arc::new(Object {
            name: name.into(),
            category: "test".into(),
            mass: MassProperties::of_mesh(&mesh, 1.0, MassOrigin::Known),
            mesh: Arc::new(mesh),
            materials,
            collision: None,
            keypoints: Vec::new(),
            support_areas: Vec::new(),
            restitution: None,
            model: SourceModel::default(),
            friction: 0.5,
            license: String::new(),
            digest: Digest::of(name.as_bytes()),
        })
    }

    #[test]
    fn bodies_share_meshes_and_emit_in_the_world() {
        let emissive = scene::Material {
            emission: Color::constant([4.0; 3]),
            ..scene::Material::plain("emissive", [0.5; 3], 1.0)
        };
        let (plain, lit) = (object("plain", Vec::new()), object("lit", vec![Arc::new(emissive)]));
        let mut builder = SceneBuilder::default();
        builder.supports = Support::new("table", Region::rectangle([0.0; 3], [1.0; 2])).into();
        let quarter = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
        for (object, x, role) in [(&plain, 0.0, Role::Object), (&lit, 2.0, Role::Object), (&plain, 5.0, Role::Support)]
        {
            let asset = AssetRef { pool: "test".into(), name: object.name.clone() };
            let pose = Pose::from_parts(Translation3::new(x, 0.0, 3.0), quarter);
            builder.add(BodyDraft::new(asset, object.clone(), pose, role, Motion::Fixed));
        }
        let scene = builder.freeze(SettleReport::default()).expect("sound");
        let prepared = PreparedScene::new(&scene, &SceneCache::default(), &Serial);
        assert_eq!((prepared.meshes.len(), prepared.bodies.len()), (2, 3));
        assert_eq!(prepared.bodies.iter().map(|body| body.mesh).collect::<Vec<_>>(), [0, 1, 0]);
        assert_eq!((prepared.objects, prepared.foreground), (2, 2));
        assert!(!prepared.has_cutouts && !prepared.is_layered);
        let [emitter] = &prepared.emitters[..] else { panic!("one emissive body") };
        // Luminance 4 over half a square meter; a quarter turn takes x to y and y to −x.
        assert!(emitter.instance == 1 && (emitter.power() - 2.0).abs() < 1e-5);
        let corners = emitter.triangles()[0].corners;
        for (corner, want) in corners.iter().zip([[2.0, 0.0, 3.0], [2.0, 1.0, 3.0], [1.0, 0.0, 3.0]]) {
            assert!((*corner - Vec3::from(want)).length() < 1e-6, "{corner:?}, not {want:?}");
        }
        let body = &prepared.bodies[1];
        assert!((body.point_to_body(corners[1]) - vec3(1.0, 0.0, 0.0)).length() < 1e-6);
        let rows = body.world_from_body();
        assert!((rows[1][0] - 1.0).abs() < 1e-6 && rows[0][3] == 2.0 && rows[2][3] == 3.0, "{rows:?}");
    }
}
