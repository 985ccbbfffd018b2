//! Components of light, compared with closed forms.

use super::support::*;
use std::f64::consts::PI;
use syntable_model::photometry::sphere_luminance;
use syntable_model::prelude::*;
use syntable_model::product::standard::{RADIANCE, RADIANCE_DIRECT, RADIANCE_INDIRECT, RADIANCE_UNSHADOWED};
use syntable_model::scene::{Light, Role, SphereLight};
use syntable_transport::PathTracing;

const COMPONENTS: [KeyId; 3] = [RADIANCE_DIRECT.id(), RADIANCE_INDIRECT.id(), RADIANCE_UNSHADOWED.id()];

fn plane(frame: &Products, key: Key<Plane<[f32; 3]>>) -> &[[f32; 3]] {
    frame.get(key).expect("made").data()
}

fn mean(frame: &Products, key: Key<Plane<[f32; 3]>>) -> f64 {
    let data = plane(frame, key);
    data.iter().map(|p| f64::from(p[1])).sum::<f64>() / data.len() as f64
}

/// A table in the complete shadow of a block under a light of 1000 lux, seen from near in a few pixels around the
/// origin.
fn table_in_shadow() -> (std::sync::Arc<Scene>, View) {
    let scene = scene([
        body(&object("table", sheet([3.0, 3.0]), matte(0.5)), at(0.0, 0.0, 0.0), Role::Object),
        body(&object("block", cuboid([0.5, 0.5, 0.01]), matte(0.5)), at(0.0, 0.0, 1.0), Role::Object),
    ]);
    let (height, radius) = (2.0, 0.1);
    let radiance = [sphere_luminance(1000.0, height, radius); 3];
    let light = Light::Sphere(SphereLight { center: [0.0, 0.0, height].into(), radius, radiance });
    (scene, view(4, 4, 4000.0, [2.0, 1.0, 0.5], [0.0; 3], vec![light]))
}

#[test]
fn the_shade_of_a_block_has_indirect_light_alone() {
    let (scene, view) = table_in_shadow();
    // One at a time, all at once, and with adaptive sampling of the whole.
    let adaptive = PathTracing { noise: Some(0.5), ..options(256, 8) };
    let wanted = COMPONENTS.map(|key| vec![key]).into_iter().chain([COMPONENTS.to_vec()]);
    for (options, wants) in wanted.map(|wants| (options(256, 8), wants)).chain([(adaptive, COMPONENTS.to_vec())]) {
        let frame = render(options.clone(), &scene, &view, &wants);
        for want in &wants {
            let (key, least, most) = match want {
                it if *it == RADIANCE_DIRECT.id() => (RADIANCE_DIRECT, 0.0, 0.0),
                it if *it == RADIANCE_INDIRECT.id() => (RADIANCE_INDIRECT, 0.1, 30.0),
                // L = ρ E / π.
                _ => (RADIANCE_UNSHADOWED, 0.996 * 0.5 * 1000.0 / PI, 1.004 * 0.5 * 1000.0 / PI),
            };
            let got = mean(&frame, key);
            assert!((least..=most).contains(&got), "{}: {got}, {wants:?}", key.name());
        }
        assert!(frame.get(RADIANCE).is_err(), "what nobody wants is not put");
    }
}

#[test]
fn components_add_up_to_the_whole() {
    let ball = object("ball", ball(0.2, 24), matte(0.7));
    let table = object("table", sheet([1.0, 1.0]), matte(0.6));
    let wants = [&COMPONENTS[..], &LIGHT].concat();
    let view = view(24, 16, 30.0, [1.0, 0.4, 0.8], [0.0; 3], vec![furnace()]);
    let both = [body(&ball, at(0.0, 0.0, 0.3), Role::Object), body(&table, at(0.0, 0.0, 0.0), Role::Object)];
    let frame = render(options(16, 6), &scene(both), &view, &wants);
    let parts = plane(&frame, RADIANCE_DIRECT).iter().zip(plane(&frame, RADIANCE_INDIRECT));
    for (whole, (direct, indirect)) in plane(&frame, RADIANCE).iter().zip(parts) {
        for c in 0..3 {
            assert!((whole[c] - direct[c] - indirect[c]).abs() < 1e-5 && indirect[c] > -1e-5);
        }
    }
    assert!(mean(&frame, RADIANCE_INDIRECT) > 0.02);
    // A table under the open sky only is as bright as its albedo times the sky; it has no shadow and no indirect light.
    let down = super::support::view(8, 8, 80.0, [0.01, 0.0, 2.0], [0.0; 3], vec![furnace()]);
    let frame = render(options(64, 6), &scene([body(&table, at(0.0, 0.0, 0.0), Role::Object)]), &down, &wants);
    assert!(plane(&frame, RADIANCE_INDIRECT).iter().all(|light| *light == [0.0; 3]));
    for key in [RADIANCE_DIRECT, RADIANCE_UNSHADOWED] {
        let got = mean(&frame, key);
        assert!((got - 0.6).abs() < 0.005, "{}: {got}", key.name());
    }
}
