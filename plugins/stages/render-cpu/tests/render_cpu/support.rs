//! Small scenes, workers and images for tests.

use std::path::PathBuf;
use std::sync::Arc;
use syntable_model::context::{Serial, Workers};
use syntable_model::digest::Hasher;
use syntable_model::geometry::{Point3, Pose, Translation3, UnitQuaternion, Vector3, look_at};
use syntable_model::prelude::*;
use syntable_model::scene::{
    AssetRef, BodyDraft, Camera, EnvironmentLight, EnvironmentMap, Exposure, Intrinsics, Light, MassOrigin,
    MassProperties, Material, MaterialOverride, Mesh, MeshData, Moment, Motion, Object, Region, Role, Scalar,
    SettleReport, SourceModel, Support, Transmission, ViewId, Volume,
};
use syntable_render_cpu::CpuPathRenderer;
use syntable_render_cpu::Strategy;
use syntable_transport::PixelFilter;

use syntable_model::stage::{Bodies, Window};
pub use syntable_testing::workers::Threads;
use syntable_transport::PathTracing;

/// A box of half-sizes around the origin, faces outwards, with uvs 0..1 on every face.
pub fn cuboid(half: [f32; 3]) -> MeshData {
    let mut data = MeshData::default();
    for axis in 0..3 {
        for sign in [-1.0_f32, 1.0] {
            let start = data.positions.len() as u32;
            for (u, v) in [(-1.0_f32, -1.0_f32), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                let mut p = [0.0; 3];
                p[axis] = sign * half[axis];
                p[(axis + 1) % 3] = u * sign * half[(axis + 1) % 3];
                p[(axis + 2) % 3] = v * half[(axis + 2) % 3];
                data.positions.push(p);
                data.uvs.push([(u + 1.0) / 2.0, (v + 1.0) / 2.0]);
            }
            data.triangles.extend([[start, start + 1, start + 2], [start, start + 2, start + 3]]);
        }
    }
    data
}

/// A level rectangle of half-sizes, facing up, uvs 0..1.
pub fn sheet(half: [f32; 2]) -> MeshData {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    MeshData {
        positions: corners.iter().map(|&(x, y)| [x * half[0], y * half[1], 0.0]).collect(),
        uvs: corners.iter().map(|&(x, y)| [(x + 1.0) / 2.0, (y + 1.0) / 2.0]).collect(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..MeshData::default()
    }
}

/// A sphere with smooth normals; `around` × `around / 2` quads.
pub fn ball(radius: f32, around: u32) -> MeshData {
    let mut data = MeshData::default();
    let rows = around / 2;
    for row in 0..=rows {
        for column in 0..=around {
            let (v, u) = (row as f32 / rows as f32, column as f32 / around as f32);
            let (sin, cos) = (std::f32::consts::PI * v).sin_cos();
            let (s, c) = (std::f32::consts::TAU * u).sin_cos();
            let n = [sin * c, sin * s, cos];
            data.positions.push(n.map(|x| x * radius));
            data.normals.push(n);
            data.uvs.push([u, 1.0 - v]);
        }
    }
    for row in 0..rows {
        for column in 0..around {
            let a = row * (around + 1) + column;
            let (b, c, d) = (a + 1, a + around + 1, a + around + 2);
            data.triangles.extend([[a, c, d], [a, d, b]]);
        }
    }
    data
}

/// The same mesh with flat faces.
pub fn flat(data: MeshData) -> MeshData {
    MeshData { normals: Vec::new(), ..data }
}

/// The same mesh turned inside out.
pub fn inside_out(mut data: MeshData) -> MeshData {
    data.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    data.normals.iter_mut().flatten().for_each(|x| *x = -*x);
    data
}

/// An object of a mesh and a material.
pub fn object(name: &str, data: MeshData, material: Material) -> Arc<Object> {
    let digest = Hasher::new(name)
        .floats(data.positions.iter().flatten().copied().collect::<Vec<_>>().into_iter())
        .floats(data.normals.iter().flatten().copied().collect::<Vec<_>>().into_iter())
        .digest(material.digest)
        .finish();
    let mesh = Mesh::new(data).expect("sound");
    Arc::new(Object {
        name: name.into(),
        category: "test".into(),
        mass: MassProperties::of_mesh(&mesh, 1.0, MassOrigin::Known),
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

/// A diffuse gray with almost no gloss.
pub fn matte(albedo: f32) -> Material {
    Material { ior: 1.0, ..Material::plain("matte", [albedo; 3], 1.0) }
}

/// Uniform light of one nit from all directions.
pub fn furnace() -> Light {
    let map = Arc::new(EnvironmentMap::constant([1.0; 3]));
    Light::Environment(EnvironmentLight { map, scale: [1.0; 3], rotation: 0.0 })
}

/// Clear glass of index 1.5: a thin sheet, or filled with a medium.
pub fn clear(roughness: f32, volume: Option<Volume>) -> Material {
    Material {
        transmission: Some(Transmission { fraction: Scalar::constant(1.0), volume }),
        ..Material::plain("clear", [1.0; 3], roughness)
    }
}

/// A medium without color.
pub const AIRY: Volume = Volume { attenuation_color: [1.0; 3], attenuation_distance_m: f32::INFINITY };

/// Unpolarized Fresnel reflectance at an index of refraction.
pub fn fresnel(degrees: f64, index: f64) -> f64 {
    let ci = degrees.to_radians().cos();
    let ct = (1.0 - (1.0 - ci * ci) / (index * index)).sqrt();
    let (rp, rs) = ((index * ci - ct) / (index * ci + ct), (ci - index * ct) / (ci + index * ct));
    (rp * rp + rs * rs) / 2.0
}

/// A position without rotation.
pub fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose::from_parts(Translation3::new(x, y, z), UnitQuaternion::identity())
}

/// A body.
pub fn body(object: &Arc<Object>, pose: Pose, role: Role) -> BodyDraft {
    let asset = AssetRef { pool: "test".into(), name: object.name.clone() };
    BodyDraft::new(asset, object.clone(), pose, role, Motion::Fixed)
}

/// A body with another surface.
pub fn covered(object: &Arc<Object>, pose: Pose, role: Role, surface: MaterialOverride) -> BodyDraft {
    body(object, pose, role).with_material_override(Some(surface))
}

/// A scene of bodies. It must hold an object.
pub fn scene(bodies: impl IntoIterator<Item = BodyDraft>) -> Arc<Scene> {
    let mut builder = SceneBuilder::default();
    builder.supports = Support::new("table", Region::rectangle([0.0; 3], [1.0; 2])).into();
    bodies.into_iter().for_each(|body| {
        builder.add(body);
    });
    Arc::new(builder.freeze(SettleReport::default()).expect("sound"))
}

/// A view of width × height with square pixels.
pub fn view(width: u32, height: u32, focal: f64, eye: [f64; 3], target: [f64; 3], lights: Vec<Light>) -> View {
    let intrinsics =
        Intrinsics { width, height, fx: focal, fy: focal, cx: f64::from(width) / 2.0, cy: f64::from(height) / 2.0 };
    let world_from_camera = look_at(Point3::from(eye), Point3::from(target), Vector3::z());
    let camera = Camera::pinhole(intrinsics, world_from_camera);
    View { id: ViewId(0), moment: Moment::START, camera, exposure: Exposure::Fixed { ev100: 8.0 }, lights, rig: None }
}

/// Products of most tests.
pub const LIGHT: [KeyId; 1] = [syntable_model::product::standard::RADIANCE.id()];

/// Options for tests. Pixels are means over their areas, as in closed forms.
pub fn options(samples_per_pixel: u32, max_bounces: u32) -> PathTracing {
    PathTracing { samples_per_pixel, max_bounces, pixel_filter: PixelFilter::Box, ..PathTracing::default() }
}

/// Renders products of a view.
pub fn render_with(
    options: PathTracing,
    strategy: Strategy,
    scene: &Arc<Scene>,
    view: &View,
    wants: &[KeyId],
    workers: &dyn Workers,
) -> Result<Products> {
    let mut session = CpuPathRenderer::new(options).session().with_strategy(strategy);
    session.load(scene, workers)?;
    let mut frame = Products::new();
    let stream = Stream::root(7);
    session.render(&RenderRequest::new(view, wants, stream, workers), &mut frame)?;
    Ok(frame)
}

/// Renders a window of a view, or some of its bodies, on one thread.
pub fn render_part(
    options: PathTracing,
    scene: &Arc<Scene>,
    view: &View,
    wants: &[KeyId],
    window: Window,
    bodies: Bodies,
) -> Products {
    let mut session = CpuPathRenderer::new(options).session();
    session.load(scene, &Serial).expect("loads");
    let mut frame = Products::new();
    let request = RenderRequest::new(view, wants, Stream::root(7), &Serial);
    session.render(&request.of(window, bodies), &mut frame).expect("renders");
    frame
}

/// Renders products of a view on one thread.
pub fn render(options: PathTracing, scene: &Arc<Scene>, view: &View, wants: &[KeyId]) -> Products {
    render_with(options, Strategy::Combined, scene, view, wants, &Serial).expect("renders")
}

/// Writes planes of gray or color as PPM images, each scaled to its own largest value, and returns their location, for
/// messages of failed tests.
pub fn keep(test: &str, planes: &[(&str, &Plane<[f32; 3]>)]) -> String {
    let folder: PathBuf = std::env::temp_dir().join("syntable-render-cpu").join(test);
    let write = || -> std::io::Result<()> {
        std::fs::create_dir_all(&folder)?;
        for (name, plane) in planes {
            let top = plane.data().iter().flatten().filter(|x| x.is_finite()).fold(1e-12_f32, |a, &b| a.max(b));
            let mut bytes = format!("P6 {} {} 255\n", plane.width(), plane.height()).into_bytes();
            bytes.extend(plane.data().iter().flatten().map(|x| ((x / top).max(0.0).powf(0.4545) * 255.0) as u8));
            std::fs::write(folder.join(format!("{name}.ppm")), bytes)?;
        }
        Ok(())
    };
    match write() {
        Ok(()) => format!("images are in {}", folder.display()),
        Err(error) => format!("images could not be written to {}: {error}", folder.display()),
    }
}
