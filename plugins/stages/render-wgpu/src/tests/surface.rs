//! Surfaces at hits: textures, materials, layers and normals.

use super::soups::lattice;
use super::{call, compare, session, show, whole};
use crate::device::Variant;
use std::sync::Arc;
use syntable_model::digest::Digest;
use syntable_model::geometry::{Pose, Translation3};
use syntable_model::prelude::*;
use syntable_model::scene::{
    Alpha, Clearcoat, Color, Encoding, EnvironmentLight, EnvironmentMap, Light, Material, MaterialOverride, Mesh,
    MeshData, NormalMap, Role, Scalar, SettleReport, Sheen, Texture, TextureMapping, TextureRef, Transmission,
    UvTransform, Volume, Wrap,
};
use syntable_prepare::labels::BlendedLabels;
use syntable_prepare::{LightTable, PreparedScene, ProjectedEnvironment, SceneCache, SurfacePoint};
use syntable_simd::{Rgb, Vec3, vec3};
use syntable_testing::scenes;
use syntable_testing::workers::Threads;
use syntable_transport::surface::{Surface, surface, transmittance_of_pane};

/// Points of each function.
const POINTS: usize = 6000;

/// An image of random texels.
fn noise(random: &mut Stream, size: [u32; 2], encoding: Encoding, wrap: [Wrap; 2], low: u64) -> Arc<Texture> {
    let texels: Vec<u8> = (0..4 * size[0] * size[1]).map(|_| (low + random.below(256 - low)) as u8).collect();
    let digest = Digest::of(&texels);
    Arc::new(Texture { width: size[0], height: size[1], texels, encoding, wrap, digest })
}

/// Materials that together cover every property of a material.
fn materials(random: &mut Stream) -> Vec<Material> {
    let wraps = [[Wrap::Repeat; 2], [Wrap::Mirror, Wrap::Clamp], [Wrap::Clamp, Wrap::Repeat]];
    let mut image = |encoding| {
        let wrap = wraps[random.below(3) as usize];
        let size = [1 + random.below(40) as u32, 1 + random.below(40) as u32];
        let transform = UvTransform {
            scale: [random.uniform(0.5, 3.0) as f32, random.uniform(-2.0, -0.5) as f32],
            rotation: random.uniform(-3.0, 3.0) as f32,
            offset: [random.unit() as f32, random.unit() as f32],
        };
        TextureRef { texture: noise(random, size, encoding, wrap, 0), transform }
    };
    let color = |texture| Color { factor: [0.9, 0.8, 0.7], texture: Some(texture) };
    let scalar = |texture, channel| Scalar { factor: 0.9, texture: Some((texture, channel)) };
    let plain = Material::plain("", [0.2, 0.5, 0.8], 0.4);
    let glass = |volume| Some(Transmission { fraction: Scalar::constant(0.7), volume });
    let volume = Volume { attenuation_color: [0.9, 0.5, 0.2], attenuation_distance_m: 0.1 };
    vec![
        plain.clone(),
        Material { base_color: color(image(Encoding::Srgb)), ior: 1.3, ..plain.clone() },
        Material {
            roughness: scalar(image(Encoding::Linear), 1),
            metallic: scalar(image(Encoding::Linear), 2),
            normal: Some(NormalMap { map: image(Encoding::Linear), strength: 0.8 }),
            ..plain.clone()
        },
        Material {
            emission: Color { factor: [50.0, 20.0, 5.0], texture: Some(image(Encoding::Srgb)) },
            ..plain.clone()
        },
        Material {
            clearcoat: Some(Clearcoat {
                strength: scalar(image(Encoding::Linear), 0),
                roughness: Scalar::constant(0.1),
                normal: Some(NormalMap { map: image(Encoding::Linear), strength: 0.5 }),
            }),
            sheen: Some(Sheen { color: color(image(Encoding::Srgb)), roughness: scalar(image(Encoding::Linear), 3) }),
            normal: Some(NormalMap { map: image(Encoding::Linear), strength: 1.5 }),
            ..plain.clone()
        },
        Material { transmission: glass(Some(volume)), roughness: Scalar::constant(0.0), ..plain.clone() },
        Material { transmission: glass(None), roughness: Scalar::constant(0.0), ..plain.clone() },
        Material { transmission: glass(None), roughness: scalar(image(Encoding::Linear), 1), ..plain.clone() },
        Material { base_color: Color::texture(lattice()), alpha: Alpha::Mask { cutoff: 0.4 }, ..plain.clone() },
        Material { base_color: Color::texture(lattice()), alpha: Alpha::Blend { factor: 0.7 }, ..plain.clone() },
        Material { projection_height_m: Some(1.2), ..plain },
    ]
}

/// A ball of few triangles, smooth or flat, with vertex colors or without.
fn ball(random: &mut Stream, smooth: bool, colors: bool) -> MeshData {
    let mut data = MeshData::default();
    const ROWS: u32 = 5;
    const COLUMNS: u32 = 8;
    for row in 0..=ROWS {
        for column in 0..=COLUMNS {
            let (theta, phi) = (f64::from(row) / f64::from(ROWS), f64::from(column) / f64::from(COLUMNS));
            let (st, ct) = (std::f64::consts::PI * theta).sin_cos();
            let (sp, cp) = (std::f64::consts::TAU * phi).sin_cos();
            let n = [st * cp, st * sp, ct].map(|x| x as f32);
            data.positions.push(n.map(|x| 0.1 * x));
            if smooth {
                data.normals.push(n);
            }
            data.uvs.push([1.3 * phi as f32, 0.9 * theta as f32]);
            if colors {
                data.colors.push([0, 1, 2].map(|_| random.unit() as f32));
            }
        }
    }
    for row in 0..ROWS {
        for column in 0..COLUMNS {
            let a = row * (COLUMNS + 1) + column;
            let (b, c, d) = (a + 1, a + COLUMNS + 1, a + COLUMNS + 2);
            data.triangles.extend(if row == 0 {
                vec![[a, c, d]]
            } else if row == ROWS - 1 {
                vec![[a, c, b]]
            } else {
                vec![[a, c, d], [a, d, b]]
            });
        }
    }
    data
}

/// Balls of all materials, with uv coordinates and with box mapping.
fn scene(random: &mut Stream) -> Scene {
    let mut builder = scenes::table();
    let all = materials(random);
    for (number, material) in all.iter().enumerate() {
        for form in 0..3 {
            let mesh = Mesh::new(ball(random, form > 0, form == 2)).expect("sound");
            let mut object = (*scenes::object("ball", mesh, [0.5; 3])).clone();
            object.digest = Digest::of(format!("{number} {form}").as_bytes());
            object.materials = vec![Arc::new(material.clone())];
            let boxed = MaterialOverride {
                material: Arc::new(Material { tile_m: 0.07, ..material.clone() }),
                mapping: TextureMapping::Box { rotation: 0.4, offset: [0.3, 0.1] },
            };
            let mut body = scenes::body(Arc::new(object), [0.0; 3], Role::Object);
            body.world_from_body = Pose::from_parts(
                Translation3::new(0.25 * number as f64 - 1.0, 0.3 * f64::from(form), 0.3),
                random.rotation(),
            );
            builder.add(body.with_material_override((form == 0 && number % 2 == 0).then_some(boxed)));
        }
    }
    builder.freeze(SettleReport::default()).expect("sound")
}

/// A point of a body that a ray meets.
struct Reached {
    point: SurfacePoint,
    origin: Vec3,
    along: Vec3,
    distance: f32,
    cone: f32,
    layer: f32,
}

impl Reached {
    fn new(random: &mut Stream, scene: &Scene) -> Self {
        let number = random.below(scene.bodies().len() as u64) as usize;
        let body = &scene.bodies()[number];
        let primitive = random.below(body.object.mesh.data().triangles.len() as u64) as usize;
        let (mut u, mut v) = (random.unit(), random.unit());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let [a, b, c] = body.object.mesh.corners(primitive);
        let place = body.world_from_body * (a + (b - a) * u + (c - a) * v);
        let (d, distance) = (random.direction(), random.uniform(0.05, 3.0));
        let origin = place - d * distance;
        Self {
            point: SurfacePoint { instance: number as u32, primitive: primitive as u32, u: u as f32, v: v as f32 },
            origin: vec3(origin.x as f32, origin.y as f32, origin.z as f32),
            along: vec3(d.x as f32, d.y as f32, d.z as f32),
            distance: distance as f32,
            cone: random.uniform(0.0, 1.0).powi(6) as f32,
            layer: random.unit() as f32,
        }
    }

    /// Hit, origin, direction, width of the cone, index of the layer.
    fn row(&self) -> [f32; 13] {
        let SurfacePoint { instance, primitive, u, v } = self.point;
        let ([x, y, z], [dx, dy, dz]) = (self.origin.array(), self.along.array());
        [self.distance, u, v, primitive as f32, instance as f32, x, y, z, dx, dy, dz, self.cone, self.layer]
    }

    fn position(&self) -> Vec3 {
        self.origin + self.along * self.distance
    }
}

/// Reads a row.
const READ: &str =
    "let t = f(); let weights = v2(); let primitive = u(); let hit = Hit(t, weights.x, weights.y, primitive, u());
    let origin = v3(); let along = v3(); let cone = f(); let layer = f();";

/// Numbers that the shaders write for a surface.
fn written(s: &Surface) -> [f32; 33] {
    let mut all = Vec::new();
    let mut put = |v: Vec3| all.extend(v.array());
    put(s.position);
    put(s.face);
    put(s.normal);
    put(s.albedo);
    put(s.emission);
    put(s.transmittance);
    let l = &s.layer;
    put(l.parameters.base_color);
    all.extend([l.parameters.roughness, l.parameters.metallic, l.parameters.dielectric_f0, l.weight, l.ior]);
    let c = &l.coating;
    all.extend([c.clearcoat, c.clearcoat_roughness, c.sheen, c.sheen_roughness]);
    let flags = [s.is_perturbed, s.inside, s.is_pane].map(u32::from);
    let bits = flags[0] | flags[1] << 1 | flags[2] << 2;
    all.extend([whole(bits), whole(l.lobe as u32), whole(l.is_clearcoat)]);
    all.try_into().expect("33 numbers")
}

#[test]
fn surfaces_are_the_cpus() {
    let Some(mut session) = session() else { return };
    let mut random = Stream::root(17);
    let scene = scene(&mut random);
    let mut view = scenes::view([0.0, -2.0, 1.0], [0.0; 3], [8, 8], 60.0);
    let texels = (0..16 * 8).map(|_| [0, 1, 2].map(|_| random.uniform(0.0, 4.0) as f32)).collect();
    let map = Arc::new(EnvironmentMap::new("noise", 16, 8, texels).expect("sound"));
    view.lights.push(Light::Environment(EnvironmentLight { map, scale: [800.0, 700.0, 900.0], rotation: 0.7 }));
    show(&mut session, &scene, &view);
    let cache = SceneCache::default();
    let prepared = PreparedScene::new(&scene, &cache, &Threads(2));
    let lights = LightTable::new(&view.lights, &cache).expect("sound");
    let projection = ProjectedEnvironment::new(&view.lights, &lights).expect("an environment");
    let points: Vec<Reached> = (0..POINTS).map(|_| Reached::new(&mut random, &scene)).collect();
    let rows: Vec<[f32; 13]> = points.iter().map(Reached::row).collect();
    let variant = Variant { layered: true, cutouts: true, panes: true, ..Variant::default() };

    let statements = format!(
        "{READ}
        let s = surface_at(hit, origin, along, t, cone, layer);
        put3(s.position); put3(s.face); put3(s.normal); put3(s.albedo); put3(s.emission); put3(s.transmittance);
        let l = s.layer;
        put3(l.parameters.base_color); put(l.parameters.roughness); put(l.parameters.metallic);
        put(l.parameters.dielectric_f0); put(l.weight); put(l.ior);
        put(l.coating.clearcoat); put(l.coating.clearcoat_roughness); put(l.coating.sheen); put(l.coating.sheen_roughness);
        put(f32(u32(s.is_perturbed) | u32(s.inside) << 1u | u32(s.is_pane) << 2u)); put(f32(l.lobe)); put_b(l.is_clearcoat);"
    );
    let of =
        |p: &Reached| surface(&prepared, &p.point, p.origin, p.along, p.distance, p.cone, p.layer, Some(&projection));
    let surfaces: Vec<Surface> = points.iter().map(of).collect();
    let results = call(&mut session, &statements, variant, &rows);
    compare("surfaces", &results, |number| written(&surfaces[number]), [2e-5, 2e-4], 200);
    // Every property occurred, so the comparison covers it.
    let count = |what: &dyn Fn(&Surface) -> bool| surfaces.iter().filter(|surface| what(surface)).count();
    let seen = [
        count(&|s| s.is_perturbed),
        count(&|s| s.inside),
        count(&|s| s.is_pane),
        count(&|s| s.layer.is_clearcoat),
        count(&|s| s.emission.x > 0.0),
        count(&|s| s.transmittance.z < 0.9),
        count(&|s| s.layer.coating.sheen > 0.0),
    ];
    assert!(seen.iter().all(|&seen| seen > POINTS / 200), "{seen:?}");

    let statements = format!(
        "{READ} let p = origin + along * t;
        put3(emission_at(hit, p)); put3(transmittance_of_pane(hit, origin, along));
        put_b(is_solid(hit, p, layer));"
    );
    let results = call(&mut session, &statements, variant, &rows);
    let mut holes = 0;
    let wanted: Vec<[f32; 7]> = points
        .iter()
        .map(|p| {
            let (emission, at) = (prepared.emission(&p.point, p.position()), p.position());
            let pane: Rgb = transmittance_of_pane(&prepared, &p.point, p.origin, p.along, p.distance);
            let solid = prepared.is_solid(&p.point, at, p.layer);
            holes += usize::from(!solid);
            let ([a, b, c], [d, e, f]) = (emission.array(), pane.array());
            [a, b, c, d, e, f, whole(solid)]
        })
        .collect();
    compare("emission, panes and holes", &results, |number| wanted[number], [2e-5, 2e-4], 500);
    assert!(holes > POINTS / 100, "{holes}");

    let statements = format!("{READ} put_b(is_labeled(hit, origin + along * t));");
    let mut seen_through = Vec::new();
    for blended in [BlendedLabels::Shape, BlendedLabels::Coverage, BlendedLabels::Opaque] {
        session.options.blended_labels = blended;
        show(&mut session, &scene, &view);
        let results: Vec<[u32; 1]> = call(&mut session, &statements, variant, &rows);
        let labeled = |number: usize| prepared.is_labeled(&points[number].point, points[number].position(), blended);
        compare(&format!("labels by {blended:?}"), &results, |number| [whole(labeled(number))], [0.0; 2], 500);
        seen_through.push((0..POINTS).filter(|&number| !labeled(number)).count());
    }
    assert!(seen_through.is_sorted_by(|a, b| b - a > POINTS / 100), "{seen_through:?}");
}
