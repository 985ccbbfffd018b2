//! Compares lights with closed forms.

use super::*;
use std::f64::consts::PI;
use std::sync::Arc;
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::photometry::{polygon_illuminance, sphere_luminance};
use syntable_model::random::Stream;
use syntable_model::scene::{
    DirectionalLight, DiskLight, EnvironmentLight, EnvironmentMap, Light, RectLight, SphereLight, WindowLight,
};
use syntable_simd::vec3;

fn sphere(center: [f64; 3], radius: f64, nits: f64) -> Light {
    Light::Sphere(SphereLight { center: center.into(), radius, radiance: [nits; 3] })
}

fn rect(center: [f64; 3], half_u: [f64; 3], half_v: [f64; 3], nits: f64) -> RectLight {
    RectLight { center: center.into(), half_u: half_u.into(), half_v: half_v.into(), radiance: [nits; 3] }
}

/// Irradiance at a point by sampling the lights, with its standard error.
fn illuminance(lights: &Lights, p: Vec3, n: Vec3) -> (f64, f64) {
    let (mut sum, mut square, count) = (0.0, 0.0, 20_000);
    let mut stream = Stream::root(3);
    for _ in 0..count {
        let (s, radiance) = lights.sample(p, n, [stream.unit() as f32, stream.unit() as f32]);
        let e = f64::from(radiance.x) * f64::from(n.dot(s.direction).max(0.0)) / f64::from(s.pdf);
        let e = if s.valid { e } else { 0.0 };
        sum += e;
        square += e * e;
    }
    let mean = sum / f64::from(count);
    (mean, ((square / f64::from(count) - mean * mean).max(0.0) / f64::from(count)).sqrt())
}

fn vec64(x: [f64; 3]) -> Vec3 {
    Vec3::from(x.map(|x| x as f32))
}

fn check(lights: &[Light], p: [f64; 3], n: [f64; 3], want: f64) {
    let lights = Lights::alone(lights).expect("sound");
    let (got, error) = illuminance(&lights, vec64(p), vec64(n));
    assert!((got - want).abs() <= 4.0 * error + 2e-4 * want, "{p:?}: {got} ± {error}, not {want}");
}

#[test]
fn a_sphere_gives_the_closed_form_at_any_distance() {
    for (height, radius) in [(2.0, 0.1), (0.5, 0.45), (30.0, 0.05), (1.0, 0.99)] {
        let want = 800.0;
        let nits = sphere_luminance(want, height, radius);
        check(&[sphere([0.3, 0.1, height], radius, nits)], [0.3, 0.1, 0.0], [0.0, 0.0, 1.0], want);
    }
    // From inside the sphere, the light covers a hemisphere above the plane.
    check(&[sphere([0.1, 0.0, 0.2], 1.0, 50.0)], [0.0; 3], [0.0, 0.6, 0.8], 50.0 * PI);
}

#[test]
fn a_rectangle_gives_lamberts_form_near_and_far() {
    for (half, height, tilt) in [(0.3, 2.0, 0.0), (1.0, 0.4, 0.2), (2.0, 0.05, 0.0), (0.2, 0.8, 0.5), (0.05, 9.0, 0.3)]
    {
        let (s, c) = f64::sin_cos(tilt);
        let light = rect([0.2, -0.1, height], [0.0, half, 0.0], [1.7 * half * c, 0.0, 1.7 * half * s], 100.0);
        if light.corners().iter().any(|corner| corner.z <= 0.0) {
            continue;
        }
        let want = 100.0 * polygon_illuminance(&light.corners(), Point3::origin(), Vector3::z());
        check(&[Light::Rect(light)], [0.0; 3], [0.0, 0.0, 1.0], want);
    }
}

#[test]
fn several_lights_add_up() {
    let light = rect([1.0, 0.0, 2.0], [0.0, 0.3, 0.0], [0.3, 0.0, 0.0], 300.0);
    let want = 300.0 * polygon_illuminance(&light.corners(), Point3::origin(), Vector3::z()) + 500.0 + 20.0;
    let up = sphere([0.0, 0.0, 2.0], 0.2, sphere_luminance(500.0, 2.0, 0.2));
    let other = sphere([0.0, 0.0, 1.0], 0.1, sphere_luminance(20.0, 1.0, 0.1));
    // One light never shines here, because its lit side faces away.
    let away = Light::Rect(rect([0.0, 0.0, 1.0], [0.3, 0.0, 0.0], [0.0, 0.3, 0.0], 1e4));
    check(&[Light::Rect(light), up, away, other], [0.0; 3], [0.0, 0.0, 1.0], want);
}

#[test]
fn densities_belong_to_the_samples() {
    // Every sampled direction meets the light at the sampled distance, with the density that a hit reports.
    let lights = Lights::alone(&[
        sphere([0.4, 0.2, 1.0], 0.3, 100.0),
        sphere([0.0, 0.0, 8.0], 9.0, 1.0),
        Light::Rect(rect([-0.5, 0.0, 0.9], [0.0, 0.4, 0.0], [0.2, 0.0, 0.0], 80.0)),
        Light::Rect(rect([0.0, -30.0, 9.0], [0.0, 0.0, 0.5], [0.5, 0.0, 0.0], 1e5)),
    ]);
    let lights = lights.expect("sound");
    let mut stream = Stream::root(8);
    let (p, n) = (vec3(0.1, 0.0, 0.0), vec3(0.1, -0.5, 0.8).normalized());
    let mut seen = [0; 4];
    for _ in 0..4000 {
        let (s, _) = lights.sample(p, n, [stream.unit() as f32, stream.unit() as f32]);
        assert!(s.valid, "all shine here");
        let hits = (0..4_u32).map(|index| {
            let distance = Shape(&lights.table.area[index as usize]).intersect(p, s.direction);
            LightHit { is_hit: distance.is_finite(), distance, index }
        });
        let near = hits.min_by(|a, b| (a.distance - s.distance).abs().total_cmp(&(b.distance - s.distance).abs()));
        // Rounding may lose a sample on the very edge.
        let Some(hit) = near.filter(|hit| (hit.distance - s.distance).abs() < 1e-2 * s.distance) else { continue };
        seen[hit.index as usize] += 1;
        let (pdf, radiance) = lights.pdf(p, n, s.direction, &hit);
        assert_eq!(radiance, lights.table.area[hit.index as usize].radiance());
        assert!((pdf - s.pdf).abs() < 2e-3 * s.pdf, "light {}: {pdf} {}", hit.index, s.pdf);
    }
    assert!(seen.iter().sum::<i32>() > 3990 && seen.iter().all(|&count| count > 30), "{seen:?}");
}

#[test]
fn one_sided_and_opaque() {
    let lights = Lights::alone(&[
        Light::Rect(rect([0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], 7.0)),
        sphere([0.0, 0.0, 0.5], 0.1, 9.0),
    ]);
    let lights = lights.expect("sound");
    let (up, down) = (vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, -1.0));
    let first = |o: Vec3, d: Vec3| {
        let hit = lights.intersect(o, d, 100.0);
        hit.is_hit.then(|| (lights.table.area[hit.index as usize].radiance().x, hit.distance))
    };
    assert_eq!(first(Vec3::ZERO, up), Some((9.0, 0.4)));
    assert_eq!(first(vec3(0.5, 0.0, 0.0), up), Some((7.0, 1.0)));
    assert_eq!(first(vec3(0.5, 0.0, 2.0), down), None);
    assert_eq!(first(vec3(0.0, 0.0, 0.5), up), Some((9.0, 0.1)), "from within");
    assert!(lights.occlude(Vec3::ZERO, up, 1.0) && !lights.occlude(Vec3::ZERO, up, 0.4));
    assert!(!lights.occlude(vec3(0.5, 0.0, 0.0), up, 1.0));
}

#[test]
fn unsound_lights_are_named() {
    let check = |light: Light, want: &str| {
        let error = Lights::alone(&[sphere([0.0; 3], 1.0, 1.0), light]).map(|_| ()).expect_err(want).to_string();
        assert!(error.contains("light 1") && error.contains(want), "{error}");
    };
    check(sphere([0.0; 3], 0.0, 1.0), "radius 0 m");
    check(sphere([0.0; 3], 1.0, f64::NAN), "NaN");
    check(sphere([0.0; 3], 1.0, -1.0), "non-negative");
    check(Light::Rect(rect([0.0; 3], [0.0; 3], [1.0, 0.0, 0.0], 1.0)), "right angles");
    check(Light::Rect(rect([0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], 1.0)), "right angles");
    assert!(Lights::alone(&[sphere([0.0; 3], 1.0, 0.0)]).expect("dark").is_empty());
}

#[test]
fn a_disk_gives_the_closed_form_on_its_axis_and_hides_its_back() {
    for (height, radius) in [(1.0, 0.3), (0.2, 1.0), (5.0, 0.1)] {
        let disk = |down: f64| {
            let normal = Vector3::new(0.0, 0.0, -down);
            Light::Disk(DiskLight { center: Point3::new(0.4, -0.2, height), normal, radius, radiance: [70.0; 3] })
        };
        let want = PI * 70.0 * radius * radius / (radius * radius + height * height);
        check(&[disk(1.0)], [0.4, -0.2, 0.0], [0.0, 0.0, 1.0], want);
        check(&[disk(-1.0)], [0.4, -0.2, 0.0], [0.0, 0.0, 1.0], 0.0);
    }
}

#[test]
fn the_sun_gives_its_illuminance_times_the_cosine() {
    for (half_angle, height) in [(0.004_65, 0.5), (0.2, 0.8)] {
        let height: f64 = height;
        let towards = Vector3::new((1.0 - height * height).sqrt(), 0.0, height);
        let sun = Light::Directional(DirectionalLight { towards, half_angle, irradiance: [90_000.0; 3] });
        // Over a cone that is completely above the plane, the mean cosine equals the cosine of its axis.
        check(&[sun], [3.0, 1.0, 2.0], [0.0, 0.0, 1.0], 90_000.0 * height);
    }
}

/// A map with a bright patch on a gradient.
fn map() -> Arc<EnvironmentMap> {
    let texel = |x: u32, y: u32| if (20..23).contains(&x) && y == 5 { [900.0; 3] } else { [y as f32 * 0.1; 3] };
    let texels = (0..16).flat_map(|y| (0..32).map(move |x| texel(x, y))).collect();
    Arc::new(EnvironmentMap::new("test", 32, 16, texels).expect("sound"))
}

#[test]
fn a_sky_gives_what_a_sum_over_directions_gives() {
    let constant = EnvironmentMap::constant([20.0, 20.0, 20.0]);
    let sky = |map: Arc<EnvironmentMap>, rotation: f64| {
        Light::Environment(EnvironmentLight { map, scale: [2.0; 3], rotation })
    };
    check(&[sky(Arc::new(constant), 1.0)], [0.0; 3], [0.6, 0.0, 0.8], 40.0 * PI);
    // By brute force over directions, with the radiance that a camera would see.
    let rotation = 0.7;
    let lights = [sky(map(), rotation)];
    let made = Lights::alone(&lights).expect("sound");
    let n = Vector3::new(0.0, 0.6, 0.8);
    let (rows, mut want) = (1500, 0.0);
    for i in 0..rows {
        let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(rows);
        for j in 0..rows {
            let phi = 2.0 * PI * (f64::from(j) + 0.5) / f64::from(rows);
            let r = (1.0 - z * z).sqrt();
            let d = Vector3::new(r * phi.cos(), r * phi.sin(), z);
            if d.dot(&n) > 0.0 {
                let seen = made.distant(Vec3::ZERO, vec64(n.into()), vec64(d.into()), |_| 1.0);
                want += f64::from(seen.x) * d.dot(&n) * 4.0 * PI / f64::from(rows * rows);
            }
        }
    }
    check(&lights, [0.0; 3], n.into(), want);
    // The map's own convention, rotated: a direction and its texel.
    let d = EnvironmentMap::direction([21.5 / 32.0, 5.5 / 16.0]);
    let (s, c) = f64::sin_cos(rotation);
    let turned = [c * d.x - s * d.y, s * d.x + c * d.y, d.z];
    assert!((made.distant(Vec3::ZERO, Vec3::ZERO, vec64(turned), |_| 1.0).x - 1800.0).abs() < 1.0);
}

#[test]
fn densities_of_distant_lights_match_their_samples() {
    let sun = DirectionalLight { towards: Vector3::new(0.0, 0.6, 0.8), half_angle: 0.3, irradiance: [1000.0; 3] };
    let sky = EnvironmentLight { map: map(), scale: [1.0; 3], rotation: 2.0 };
    let lights = Lights::alone(&[Light::Directional(sun), Light::Environment(sky)]).expect("sound");
    let mut stream = Stream::root(5);
    for distant in &lights.table.distant {
        let mut differing = 0;
        for _ in 0..4000 {
            let (direction, pdf) = distant.sample([stream.unit() as f32, stream.unit() as f32]);
            let (_, again) = distant.radiance(direction);
            differing += u32::from((again / pdf - 1.0).abs() > 1e-3);
        }
        // At the edge of a texel or of the cone, rounding may choose the other side.
        assert!(differing < 8, "{differing} of 4000");
    }
}

/// A window of 2 × 3 panes over one corner of the origin, with a view of strong contrast.
fn window(view: EnvironmentLight) -> WindowLight {
    WindowLight {
        center: Point3::new(1.2, 0.3, 0.9),
        half_u: Vector3::new(0.0, -0.7, 0.0),
        half_v: Vector3::new(0.2, 0.0, 0.8),
        view,
        panes: [2, 3],
        frame_m: 0.08,
        bar_m: 0.05,
        frame_radiance: [3.0; 3],
    }
}

#[test]
fn all_estimates_of_a_window_agree_with_a_sum_over_its_points() {
    let light = window(EnvironmentLight { map: map(), scale: [2.0; 3], rotation: -1.9 });
    let lights = Lights::alone(&[Light::Window(light.clone())]).expect("sound");
    // Points before the frame, close to a pane, beside it, and from where rectangles are sampled by area.
    for (p, n) in [
        ([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
        ([1.0, 0.2, 0.8], [0.8, 0.0, 0.6]),
        ([0.9, -1.5, 0.2], [0.6, 0.8, 0.0]),
        ([-9.0, 1.0, -2.0], [1.0, 0.0, 0.0]),
    ] {
        // By brute force over the points of the window, with the model's own radiance: E = ∫ L cos θ cos θ' / r² dA.
        let (cells, mut want) = (1500, 0.0);
        let normal = light.half_u.cross(&light.half_v).normalize();
        let (origin, up) = (Point3::from(p), Vector3::from(n));
        for i in 0..cells {
            for j in 0..cells {
                let [a, b] = [i, j].map(|k| (2.0 * f64::from(k) + 1.0) / f64::from(cells) - 1.0);
                let point = light.center + light.half_u * a + light.half_v * b;
                let to = point - origin;
                let direction = to.normalize();
                let (here, there) = (direction.dot(&up), -direction.dot(&normal));
                if here > 0.0 && there > 0.0 {
                    want += light.radiance(&point, &direction)[0] * here * there / to.norm_squared();
                }
            }
        }
        want *= 4.0 * light.half_u.norm() * light.half_v.norm() / f64::from(cells * cells);
        let (p, n) = (vec64(p), vec64(n));
        let near = |name: &str, (got, error): (f64, f64)| {
            assert!((got - want).abs() <= 4.0 * error + 2e-3 * want, "{name}, {p:?}: {got} ± {error}, not {want}");
        };
        near("light sampling", illuminance(&lights, p, n));
        // Directions sampled by their cosine have the density cos / π.
        let around = syntable_simd::Basis::around(n);
        let mut stream = Stream::root(11);
        let mut cosine = || {
            let (r, turn) = (stream.unit().sqrt(), stream.unit() * 2.0 * PI);
            let local = [r * turn.cos(), r * turn.sin(), (1.0 - r * r).sqrt()];
            around.to_world(vec64(local)).normalized()
        };
        let count = 200_000;
        let (mut sums, mut squares) = ([0.0; 2], [0.0; 2]);
        let mut numbers = Stream::root(12);
        for _ in 0..count {
            let direction = cosine();
            let hit = lights.intersect(p, direction, f32::INFINITY);
            let (mut alone, mut combined) = (0.0, 0.0);
            if hit.is_hit {
                let (pdf, radiance) = lights.pdf(p, n, direction, &hit);
                let own = f64::from(n.dot(direction)) / PI;
                alone = f64::from(radiance.x) * PI;
                combined = alone * own / (own + f64::from(pdf));
            }
            let (s, radiance) = lights.sample(p, n, [numbers.unit() as f32, numbers.unit() as f32]);
            let cos = f64::from(n.dot(s.direction));
            if s.valid && cos > 0.0 {
                combined += f64::from(radiance.x) * cos / (f64::from(s.pdf) + cos / PI);
            }
            for (k, value) in [alone, combined].into_iter().enumerate() {
                sums[k] += value;
                squares[k] += value * value;
            }
        }
        for (k, name) in ["BSDF sampling", "both combined"].into_iter().enumerate() {
            let mean = sums[k] / f64::from(count);
            let variance = (squares[k] / f64::from(count) - mean * mean).max(0.0);
            near(name, (mean, (variance / f64::from(count)).sqrt()));
        }
    }
}

#[test]
fn a_window_onto_an_even_sky_without_a_frame_is_a_rectangle() {
    let sky = EnvironmentLight { map: Arc::new(EnvironmentMap::constant([0.5; 3])), scale: [90.0; 3], rotation: 1.0 };
    let bare = WindowLight { panes: [1, 1], frame_m: 0.0, bar_m: 0.3, ..window(sky) };
    let plain = bare.rect([45.0; 3]);
    let (bare, plain) = (Lights::alone(&[Light::Window(bare)]), Lights::alone(&[Light::Rect(plain)]));
    let (bare, plain) = (bare.expect("sound"), plain.expect("sound"));
    let mut stream = Stream::root(5);
    let (mut compared, mut on_edge) = (0, 0);
    for _ in 0..2000 {
        let p = Vec3::from([0, 1, 2].map(|_| stream.uniform(-1.0, 0.9) as f32));
        let n = vec3(0.0, 0.0, 1.0);
        let uv = [stream.unit() as f32, stream.unit() as f32];
        let ((a, radiance), (b, even)) = (bare.sample(p, n, uv), plain.sample(p, n, uv));
        assert_eq!((a.direction, a.distance, a.pdf, a.valid), (b.direction, b.distance, b.pdf, b.valid));
        if !a.valid || n.dot(a.direction) <= 0.0 {
            continue;
        }
        compared += 1;
        // Points on the very edge may round to the frame, which has no width.
        on_edge += u32::from(radiance.x == 3.0);
        assert!((radiance.x - even.x).abs() <= 1e-6 * even.x || radiance.x == 3.0);
    }
    assert!(compared > 1000 && on_edge < 5, "{compared}, {on_edge}");
}
