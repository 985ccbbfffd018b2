//! The lights of a view: which light is sampled, where, and its radiance.

use super::{call, compare, session, show, whole};
use crate::device::Variant;
use std::sync::Arc;
use syntable_model::digest::Digest;
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::prelude::*;
use syntable_model::scene::{
    Color, DirectionalLight, DiskLight, EnvironmentLight, EnvironmentMap, Light, Material, Mesh, RectLight, Role,
    SettleReport, SphereLight, WindowLight,
};
use syntable_prepare::{PreparedScene, SceneCache, SurfacePoint};
use syntable_simd::{Vec3, vec3};
use syntable_testing::scenes;
use syntable_testing::workers::Threads;
use syntable_transport::light::Lights;

/// Points of each function.
const POINTS: usize = 6000;

/// Two emissive bodies, and a table.
fn scene(random: &mut Stream) -> Scene {
    let mut builder = scenes::table();
    for number in 0..2 {
        let mesh: Mesh = scenes::box_mesh([0.2, 0.1, 0.3]);
        let mut object = (*scenes::object("emitter", mesh, [0.5; 3])).clone();
        object.digest = Digest::of(&[number]);
        let factor = [0, 1, 2].map(|_| random.uniform(10.0, 90.0) as f32);
        object.materials =
            vec![Arc::new(Material { emission: Color::constant(factor), ..Material::plain("", [0.5; 3], 0.5) })];
        builder.add(scenes::body(Arc::new(object), [f64::from(number) - 0.5, 0.2, 0.4], Role::Object));
    }
    builder.freeze(SettleReport::default()).expect("sound")
}

/// Lights of every kind.
fn lights(random: &mut Stream) -> Vec<Light> {
    let texels = (0..24 * 12).map(|_| [0, 1, 2].map(|_| random.uniform(0.0, 2.0).powi(5) as f32)).collect();
    let map = Arc::new(EnvironmentMap::new("noise", 24, 12, texels).expect("sound"));
    let sky = |rotation| EnvironmentLight { map: map.clone(), scale: [3.0, 4.0, 5.0], rotation };
    vec![
        Light::Sphere(SphereLight {
            center: Point3::new(0.5, -1.0, 2.0),
            radius: 0.3,
            radiance: [500.0, 400.0, 300.0],
        }),
        Light::Rect(RectLight {
            center: Point3::new(-0.4, 0.3, 2.2),
            half_u: Vector3::new(0.0, 0.5, 0.0),
            half_v: Vector3::new(0.3, 0.0, 0.0),
            radiance: [200.0, 250.0, 300.0],
        }),
        Light::Disk(DiskLight {
            center: Point3::new(-1.2, -0.8, 1.5),
            normal: Vector3::new(0.6, 0.0, -0.8),
            radius: 0.4,
            radiance: [900.0, 100.0, 100.0],
        }),
        Light::Window(WindowLight {
            center: Point3::new(0.0, 2.0, 1.2),
            half_u: Vector3::new(0.8, 0.0, 0.0),
            half_v: Vector3::new(0.0, 0.0, 0.6),
            view: sky(0.3),
            panes: [3, 2],
            frame_m: 0.05,
            bar_m: 0.04,
            frame_radiance: [3.0; 3],
        }),
        Light::Directional(DirectionalLight {
            towards: Vector3::new(0.36, 0.48, 0.8),
            half_angle: 0.05,
            irradiance: [900.0, 800.0, 700.0],
        }),
        Light::Environment(sky(1.1)),
    ]
}

fn unit(random: &mut Stream) -> Vec3 {
    let d = random.direction();
    vec3(d.x as f32, d.y as f32, d.z as f32)
}

/// A point, its normal, a direction, two numbers, a distance.
fn row(random: &mut Stream) -> [f32; 12] {
    let [x, y, z] = [-1.5, -1.5, 0.0].map(|low| random.uniform(low, low + 3.0) as f32);
    let ([nx, ny, nz], [dx, dy, dz]) = (unit(random).array(), unit(random).array());
    [x, y, z, nx, ny, nz, dx, dy, dz, random.unit() as f32, random.unit() as f32, random.uniform(0.1, 5.0) as f32]
}

/// The parts of a row.
fn parts(row: &[f32; 12]) -> (Vec3, Vec3, Vec3, [f32; 2], f32) {
    let [x, y, z, nx, ny, nz, dx, dy, dz, u, v, to] = *row;
    (vec3(x, y, z), vec3(nx, ny, nz), vec3(dx, dy, dz), [u, v], to)
}

const READ: &str = "let p = v3(); let n = v3(); let d = v3(); let uv = v2(); let to = f();";

#[test]
fn lights_are_selected_sampled_and_met_as_on_the_cpu() {
    let Some(mut session) = session() else { return };
    let mut random = Stream::root(23);
    let scene = scene(&mut random);
    let mut view = scenes::view([0.0, -2.0, 1.0], [0.0; 3], [8, 8], 60.0);
    view.lights = lights(&mut random);
    show(&mut session, &scene, &view);
    let cache = SceneCache::default();
    let prepared = PreparedScene::new(&scene, &cache, &Threads(2));
    let lights = Lights::new(&view.lights, &prepared, &cache).expect("sound");
    let rows: Vec<[f32; 12]> = (0..POINTS).map(|_| row(&mut random)).collect();
    let variant = Variant { layered: true, ..Variant::default() };

    let statements = format!(
        "{READ} let i = sample_lights(p, n, uv); let s = i.sample; put_b(s.valid);
        put3(select(vec3(0.0), s.direction, s.valid)); put3(select(vec3(0.0), i.radiance, s.valid));
        put(select(0.0, s.distance, s.valid)); put(select(0.0, s.pdf, s.valid));"
    );
    let results: Vec<[u32; 9]> = call(&mut session, &statements, variant, &rows);
    let sampled = |number: usize| {
        let (p, n, _, uv, _) = parts(&rows[number]);
        let (s, radiance) = lights.sample::<f32>(p, n, uv);
        let there = |x: f32| if s.valid { x } else { 0.0 };
        let ([a, b, c], [d, e, f]) = (s.direction.map(there).array(), radiance.map(there).array());
        [whole(s.valid), a, b, c, d, e, f, there(s.distance), there(s.pdf)]
    };
    compare("samples", &results, sampled, [5e-5, 5e-4], 100);
    let far = results.iter().filter(|result| f32::from_bits(result[7]) >= 3e38).count();
    let near = results.iter().filter(|result| f32::from_bits(result[0]) == 1.0).count() - far;
    assert!(near > POINTS / 20 && far > POINTS / 20, "{near} {far}");

    let statements = format!(
        "{READ} let met = intersect_lights(p, d, to); let is_met = met.number != NONE;
        put_b(is_met); put(select(0.0, met.distance, is_met)); put_b(lights_occlude(p, d, to));
        var pdf = 0.0; var radiance = vec3(0.0);
        if is_met {{
            let shape = shape_at(met.number);
            pdf = selection_probability(p, n, met.number) * shape_pdf(shape, p, met.distance);
            radiance = shape_radiance(shape, p + d * met.distance, d);
        }}
        put(pdf); put3(radiance);"
    );
    let results: Vec<[u32; 7]> = call(&mut session, &statements, variant, &rows);
    let met = |number: usize| {
        let (p, n, d, _, to) = parts(&rows[number]);
        let hit = lights.intersect::<f32>(p, d, to);
        let (pdf, radiance) = lights.pdf::<f32>(p, n, d, &hit);
        let there = |x: f32| if hit.is_hit { x } else { 0.0 };
        let [a, b, c] = radiance.map(there).array();
        [whole(hit.is_hit), there(hit.distance), whole(lights.occlude::<f32>(p, d, to)), there(pdf), a, b, c]
    };
    compare("lights that rays meet", &results, met, [5e-5, 5e-4], 500);
    assert!(results.iter().filter(|result| f32::from_bits(result[0]) == 1.0).count() > POINTS / 50);

    // A weight that depends on the density, so that each counts.
    let statements = format!(
        "{READ} var sum = vec3(0.0);
        for (var i = 0u; i < view.distant_count; i++) {{
            let far = distant_radiance(i, d);
            let pdf = far.pdf * selection_probability(p, n, view.area_count + emitter_count() + i);
            sum += far.radiance * (pdf / (1.0 + pdf));
        }}
        put3(sum);"
    );
    let results: Vec<[u32; 3]> = call(&mut session, &statements, variant, &rows);
    let distant = |number: usize| {
        let (p, n, d, ..) = parts(&rows[number]);
        lights.distant(p, n, d, |pdf| pdf / (1.0 + pdf)).array()
    };
    compare("distant lights", &results, distant, [5e-5, 5e-4], 500);

    // Two bodies emit, the table does not.
    let point =
        |number: usize| SurfacePoint { instance: number as u32 % 3, primitive: number as u32 % 12, u: 0.2, v: 0.3 };
    let statements = format!("{READ} put(body_pdf(p, n, Hit(to, 0.2, 0.3, number % 12u, number % 3u), d.x));");
    let results: Vec<[u32; 1]> = call(&mut session, &statements, variant, &rows);
    let density = |number: usize| {
        let (p, n, d, _, to) = parts(&rows[number]);
        [lights.body_pdf(p, n, &point(number), to, d.x)]
    };
    compare("densities of bodies", &results, density, [1e-6, 2e-4], 500);
    assert!(results.iter().filter(|result| result[0] != 0).count() > POINTS / 3);
}
