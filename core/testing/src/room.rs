//! A scene for measurements: a closed room of 6 × 6 × 2.8 m, a table, and 20 rippled balls and rings of 16 384
//! triangles each, textured, glossy and metallic, under a ceiling panel and a globe.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;
use syntable_model::digest::{Digest, Hasher};
use syntable_model::geometry::{Point3, Pose, Translation3, UnitQuaternion, Vector3, look_at};
use syntable_model::prelude::*;
use syntable_model::scene::{
    AssetRef, BodyDraft, Camera, Color, Encoding, Exposure, Intrinsics, Light, MassOrigin, MassProperties, Material,
    MaterialOverride, Mesh, MeshData, Moment, Motion, NormalMap, Object, RectLight, Region, Role, Scalar, SettleReport,
    SourceModel, SphereLight, Support, Texture, TextureMapping, Transmission, ViewId, Volume, Wrap,
};

/// A view of the table from above one corner, with a focal length of 600 px. The image is 640 × 480 px or a central
/// part of that.
pub fn view(width: u32, height: u32) -> View {
    let intrinsics =
        Intrinsics { width, height, fx: 600.0, fy: 600.0, cx: f64::from(width) / 2.0, cy: f64::from(height) / 2.0 };
    let world_from_camera = look_at(Point3::new(0.75, -1.0, 1.5), Point3::new(0.0, 0.0, 0.76), Vector3::z());
    let panel = RectLight {
        center: Point3::new(0.3, 0.5, 2.79),
        half_u: Vector3::new(0.0, 0.4, 0.0),
        half_v: Vector3::new(0.6, 0.0, 0.0),
        radiance: [900.0, 870.0, 800.0],
    };
    let globe = SphereLight { center: Point3::new(-1.0, -0.4, 1.9), radius: 0.1, radiance: [9000.0, 6500.0, 4000.0] };
    View {
        moment: Moment::START,
        id: ViewId(0),
        camera: Camera::pinhole(intrinsics, world_from_camera),
        exposure: Exposure::Auto { compensation_ev: 0.0 },
        lights: vec![Light::Rect(panel), Light::Sphere(globe)],
        rig: None,
    }
}

/// Material of the objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// Matte, textured, glossy and metallic objects.
    Mixed,
    /// Tumblers, bodies and thin shells of clear and tinted glass.
    Glass,
    /// Smooth plastic in bright colors.
    Plastic,
    /// Polished and brushed metal.
    Metal,
}

/// The room with its mixed objects.
pub fn scene() -> Arc<Scene> {
    scene_of(Look::Mixed)
}

/// The room with objects of one look, at the same places.
pub fn scene_of(look: Look) -> Arc<Scene> {
    let mut random = Stream::root(3);
    let mut builder = SceneBuilder::default();
    builder.supports = Support::new("table", Region::rectangle([0.0, 0.0, 0.75], [1.2, 0.8])).into();
    let mut add = |object: &Arc<Object>, pose: Pose, role: Role, surface: Option<MaterialOverride>| {
        let asset = AssetRef { pool: "bench".into(), name: object.name.clone() };
        builder.add(BodyDraft::new(asset, object.clone(), pose, role, Motion::Fixed).with_material_override(surface));
    };
    for number in 0..20 {
        let (base, mix) = (random.uniform(0.1, 0.8), [0, 1, 2].map(|_| random.uniform(0.3, 1.0)));
        let mut material = Material::plain("object", mix.map(|m| (base * m) as f32), random.uniform(0.15, 0.8) as f32);
        let mut mesh = blob(&mut random, number % 2 == 0);
        match (look, number % 4) {
            (Look::Mixed, 0) => material.metallic = Scalar::constant(1.0),
            (Look::Mixed, 1 | 2) => material.base_color = Color::texture(stripes(1024, number)),
            (Look::Mixed, _) => {}
            (Look::Glass, kind) => {
                let tint = if kind == 2 { mix.map(|m| m as f32) } else { [1.0; 3] };
                let volume = Volume { attenuation_color: [0.95; 3], attenuation_distance_m: 0.05 };
                material = Material {
                    transmission: Some(Transmission {
                        fraction: Scalar::constant(1.0),
                        volume: (kind != 3).then_some(volume),
                    }),
                    ..Material::plain("glass", tint, 0.0)
                };
                if kind < 2 {
                    mesh = tumbler();
                }
            }
            (Look::Plastic, kind) => {
                material.roughness = Scalar::constant([0.05, 0.12, 0.2, 0.3][kind as usize]);
                material.base_color = Color::constant(mix.map(|m| m as f32));
            }
            (Look::Metal, kind) => {
                material.roughness = Scalar::constant([0.0, 0.1, 0.2, 0.35][kind as usize]);
                material.base_color = Color::constant(mix.map(|m| (0.6 + 0.4 * m) as f32));
                material.metallic = Scalar::constant(1.0);
            }
        }
        let object = object(&format!("object {number}"), mesh, material);
        let place = Translation3::new(
            (number % 5) as f64 * 0.18 - 0.36,
            (number / 5) as f64 * 0.17 - 0.255,
            0.75 + 0.07 + random.uniform(0.0, 0.04),
        );
        add(&object, Pose::from_parts(place, random.rotation()), Role::Object, None);
    }
    let wood = Arc::new(Material {
        base_color: Color::texture(stripes(2048, 99)),
        normal: Some(NormalMap { map: bumps(1024).into(), strength: 0.5 }),
        tile_m: 0.8,
        ..Material::plain("wood", [0.8; 3], 0.4)
    });
    let boxed = |material: &Arc<Material>| {
        Some(MaterialOverride {
            material: material.clone(),
            mapping: TextureMapping::Box { rotation: 0.2, offset: [0.0; 2] },
        })
    };
    let place = |x: f64, y: f64, z: f64| Pose::from_parts(Translation3::new(x, y, z), UnitQuaternion::identity());
    let slab = |name: &str, half: [f32; 3]| object(name, cuboid(half), Material::plain("gray", [0.6; 3], 0.9));
    add(&slab("top", [0.6, 0.4, 0.015]), place(0.0, 0.0, 0.735), Role::Support, boxed(&wood));
    for (x, y) in [(-0.55, -0.35), (0.55, -0.35), (-0.55, 0.35), (0.55, 0.35)] {
        add(&slab("leg", [0.025, 0.025, 0.36]), place(x, y, 0.36), Role::Support, boxed(&wood));
    }
    let tiles = Arc::new(Material {
        base_color: Color::texture(stripes(1024, 7)),
        tile_m: 1.5,
        ..Material::plain("tiles", [0.9; 3], 0.5)
    });
    let paint = Arc::new(Material::plain("paint", [0.75, 0.72, 0.66], 0.9));
    for (name, half, center, material) in [
        ("floor", [3.0, 3.0, 0.05], [0.0, 0.0, -0.05], &tiles),
        ("ceiling", [3.0, 3.0, 0.05], [0.0, 0.0, 2.85], &paint),
        ("west", [0.05, 3.0, 1.5], [-3.05, 0.0, 1.4], &paint),
        ("east", [0.05, 3.0, 1.5], [3.05, 0.0, 1.4], &paint),
        ("south", [3.0, 0.05, 1.5], [0.0, -3.05, 1.4], &paint),
        ("north", [3.0, 0.05, 1.5], [0.0, 3.05, 1.4], &paint),
    ] {
        add(&slab(name, half), place(center[0], center[1], center[2]), Role::Room, boxed(material));
    }
    Arc::new(builder.freeze(SettleReport::default()).expect("sound"))
}

fn object(name: &str, data: MeshData, material: Material) -> Arc<Object> {
    let mesh = Mesh::new(data).expect("sound");
    Arc::new(Object {
        name: name.into(),
        category: "bench".into(),
        digest: Hasher::new(name).finish(),
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
    })
}

/// A box around the origin with these half-sizes.
fn cuboid(half: [f32; 3]) -> MeshData {
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
            }
            data.triangles.extend([[start, start + 1, start + 2], [start, start + 2, start + 3]]);
        }
    }
    data
}

/// A smooth, rippled ball or ring of 64 × 128 quads with texture coordinates, about 14 cm across.
fn blob(random: &mut Stream, ring: bool) -> MeshData {
    let (rows, columns) = (64_u32, 128_u32);
    let waves: [(f32, f32); 3] = std::array::from_fn(|i| ((i + 2) as f32, random.uniform(0.0, f64::from(TAU)) as f32));
    let mut data = MeshData::default();
    for row in 0..=rows {
        for column in 0..=columns {
            let (u, v) = (column as f32 / columns as f32, row as f32 / rows as f32);
            let swell = 1.0 + 0.05 * waves.iter().map(|(k, phase)| (k * TAU * u + phase + 5.0 * v).sin()).sum::<f32>();
            let (r, z) = if ring {
                (0.05 + 0.02 * swell * (TAU * v).cos(), -0.02 * swell * (TAU * v).sin())
            } else {
                (0.06 * swell * (PI * v).sin(), 0.07 * swell * (PI * v).cos())
            };
            data.positions.push([r * (TAU * u).cos(), r * (TAU * u).sin(), z]);
            data.uvs.push([u, 1.0 - v]);
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let a = row * (columns + 1) + column;
            let (b, c, d) = (a + 1, a + columns + 1, a + columns + 2);
            data.triangles.extend([[a, c, d], [a, d, b]]);
        }
    }
    let mut normals = vec![Vector3::<f32>::zeros(); data.positions.len()];
    let p = |i: u32| Vector3::from(data.positions[i as usize]);
    for &[a, b, c] in &data.triangles {
        let normal = (p(b) - p(a)).cross(&(p(c) - p(a)));
        [a, b, c].into_iter().for_each(|i| normals[i as usize] += normal);
    }
    data.normals = normals.iter().map(|n| n.try_normalize(0.0).unwrap_or(Vector3::z()).into()).collect();
    data
}

/// A tumbler around the origin, 14 cm high, with walls of 3 mm; closed, smooth around its axis, with sharp rims.
fn tumbler() -> MeshData {
    const COLUMNS: u32 = 96;
    // Radius and height, m: outward from the center of the bottom, up, over the rim and down inside.
    const PROFILE: [(f32, f32); 6] =
        [(0.0, -0.07), (0.032, -0.07), (0.04, 0.07), (0.037, 0.07), (0.029, -0.06), (0.0, -0.06)];
    let mut data = MeshData::default();
    for ends in PROFILE.windows(2) {
        let (dr, dz) = (ends[1].0 - ends[0].0, ends[1].1 - ends[0].1);
        let length = dr.hypot(dz);
        let first = data.positions.len() as u32;
        for column in 0..=COLUMNS {
            let (sin, cos) = (TAU * column as f32 / COLUMNS as f32).sin_cos();
            for (r, z) in [ends[0], ends[1]] {
                data.positions.push([r * cos, r * sin, z]);
                data.normals.push([dz / length * cos, dz / length * sin, -dr / length]);
                data.uvs.push([column as f32 / COLUMNS as f32, 0.5 + z]);
            }
        }
        for column in 0..COLUMNS {
            let a = first + 2 * column;
            // At the axis, one of the two triangles has no area.
            if ends[0].0 > 0.0 {
                data.triangles.push([a, a + 2, a + 1]);
            }
            if ends[1].0 > 0.0 {
                data.triangles.push([a + 2, a + 3, a + 1]);
            }
        }
    }
    data
}

fn texture(size: u32, encoding: Encoding, name: &str, texel: impl Fn(f32, f32) -> [u8; 3]) -> Arc<Texture> {
    let at = |i: u32| i as f32 / size as f32;
    let texels = (0..size).flat_map(|y| (0..size).map(move |x| (x, y))).flat_map(|(x, y)| {
        let [r, g, b] = texel(at(x), at(y));
        [r, g, b, 255]
    });
    let texels = texels.collect();
    let digest = Digest::of(name.as_bytes());
    Arc::new(Texture { width: size, height: size, texels, encoding, wrap: [Wrap::Repeat; 2], digest })
}

fn stripes(size: u32, seed: u64) -> Arc<Texture> {
    let mut random = Stream::root(seed);
    let [a, b] = [0, 1].map(|_| [0, 1, 2].map(|_| random.uniform(40.0, 230.0) as f32));
    let k = random.integer(2, 6) as f32;
    texture(size, Encoding::Srgb, &format!("stripes {seed}"), move |u, v| {
        let t = 0.5 + 0.5 * (TAU * k * (u + 0.15 * (TAU * 2.0 * v).sin())).sin();
        [0, 1, 2].map(|i| (a[i] + (b[i] - a[i]) * t * t) as u8)
    })
}

fn bumps(size: u32) -> Arc<Texture> {
    texture(size, Encoding::Linear, "bumps", |u, v| {
        let lean = |x: f32| (127.5 + 40.0 * (TAU * 24.0 * x).sin()) as u8;
        [lean(u), lean(v), 240]
    })
}
