//! Procedural environment maps: the stated illuminance, the standard's own figures, determinism.

use std::f64::consts::{PI, TAU};
use syntable_household::procedural_environments::EnvironmentFamily;
use syntable_household::procedural_environments::sky::{Sky, Weather};
use syntable_household::procedural_environments::studio::StudioRoom;
use syntable_model::geometry::Vector3;
use syntable_model::photometry::luminance;
use syntable_model::random::Stream;
use syntable_model::scene::EnvironmentMap;

/// Illuminance on a plane that faces up (1) or down (-1): a midpoint rule over many points of the upper hemisphere,
/// with texels looked up where they fall.
fn illuminance(map: &EnvironmentMap, up: f64) -> f64 {
    let (polar, around) = (600, 1200);
    let mut sum = 0.0;
    for i in 0..polar {
        let theta = PI / 2.0 * (i as f64 + 0.5) / polar as f64;
        for j in 0..around {
            let phi = TAU * (j as f64 + 0.5) / around as f64;
            let direction = Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), up * theta.cos());
            let [u, v] = EnvironmentMap::coordinates(&direction);
            let column = ((u * f64::from(map.width())) as usize).min(map.width() as usize - 1);
            let row = ((v * f64::from(map.height())) as usize).min(map.height() as usize - 1);
            let texel = map.texels()[row * map.width() as usize + column].map(f64::from);
            sum += luminance(texel) * theta.cos() * theta.sin();
        }
    }
    sum * (PI / 2.0 / polar as f64) * (TAU / around as f64)
}

const WEATHERS: [Weather; 5] = [Weather::Clear, Weather::Hazy, Weather::Cloudy, Weather::Overcast, Weather::Sunset];

#[test]
fn skies_give_the_illuminance_that_they_state() {
    for weather in WEATHERS {
        for variant in 0..3 {
            let sky = Sky::draw(weather, &Stream::root(7).at(variant));
            let map = sky.map("sky", 256).expect("a map");
            let got = illuminance(&map, 1.0);
            assert!((got / sky.illuminance_lx - 1.0).abs() < 3e-3, "{sky:?}: {got} lx");
            // The ground reflects the light that falls on it: E = π L, L = ρ E / π.
            let ground = illuminance(&map, -1.0);
            assert!((ground / (luminance(sky.ground) * got) - 1.0).abs() < 0.01, "{sky:?}: {ground} lx from below");
        }
    }
    for variant in 0..3 {
        let studio = StudioRoom::draw(&Stream::root(7).at(variant));
        let got = illuminance(&studio.map("studio", 256).expect("a map"), 1.0);
        assert!((got / studio.illuminance_lx - 1.0).abs() < 5e-3, "{studio:?}: {got} lx");
    }
}

fn of_type(kind: usize, elevation_deg: f64) -> Sky {
    let mut sky = Sky::draw(Weather::Clear, &Stream::root(1));
    sky.kind = kind;
    sky.sun_elevation = elevation_deg.to_radians();
    sky
}

#[test]
fn luminances_match_the_standard() {
    let at = |elevation: f64, azimuth: f64| {
        let (e, a) = (elevation.to_radians(), azimuth.to_radians());
        Vector3::new(e.cos() * a.cos(), e.cos() * a.sin(), e.sin())
    };
    // Type 5 is uniform. Type 1 is close to Moon and Spencer's overcast sky (1 + 2 sin h) / 3, type 1's forerunner.
    for elevation in [5.0, 30.0, 60.0, 90.0] {
        assert!((of_type(5, 40.0).relative_luminance(&at(elevation, 77.0)) - 1.0).abs() < 1e-12);
        let moon_and_spencer = (1.0 + 2.0 * f64::to_radians(elevation).sin()) / 3.0;
        let got = of_type(1, 40.0).relative_luminance(&at(elevation, 77.0));
        assert!((got - moon_and_spencer).abs() < 0.06, "{elevation}: {got} {moon_and_spencer}");
    }
    // By hand for type 12 with the sun at 45°, towards the sun and opposite it at 45°: φ cancels to φ(45°) / φ(0).
    let sky = of_type(12, 45.0);
    let phi = |z: f64| 1.0 - (-0.32 / z.to_radians().cos()).exp();
    let f = |chi: f64| {
        let chi = chi.to_radians();
        1.0 + 10.0 * ((-3.0 * chi).exp() - (-1.5 * PI).exp()) + 0.45 * chi.cos().powi(2)
    };
    let scale = phi(45.0) / (f(45.0) * phi(0.0));
    for (azimuth, chi) in [(0.0, 0.0), (180.0, 90.0)] {
        let got = sky.relative_luminance(&at(45.0, azimuth));
        assert!((got / (f(chi) * scale) - 1.0).abs() < 1e-9, "{azimuth}: {got}");
    }
    for kind in 1..=15 {
        assert!((of_type(kind, 30.0).relative_luminance(&Vector3::z()) - 1.0).abs() < 1e-12, "{kind}");
    }
}

#[test]
fn the_sun_is_over_the_middle_column_and_the_sky_is_blue_opposite() {
    let sky = Sky::draw(Weather::Hazy, &Stream::root(2));
    let map = sky.map("sky", 128).expect("a map");
    let (brightest, _) = map.texels().iter().enumerate().max_by(|a, b| a.1[1].total_cmp(&b.1[1])).expect("texels");
    let column = brightest % 128;
    assert!((62..=65).contains(&column), "column {column}");
    let clear = Sky::draw(Weather::Clear, &Stream::root(2)).map("sky", 128).expect("a map");
    // A quarter of the way round, halfway up.
    let [r, _, b] = clear.texels()[16 * 128 + 96];
    assert!(b > 1.2 * r, "{r} {b}");
    let overcast = Sky::draw(Weather::Overcast, &Stream::root(2)).map("sky", 128).expect("a map");
    let [r, _, b] = overcast.texels()[16 * 128 + 96];
    assert!((b / r - 1.0).abs() < 0.25, "{r} {b}");
}

#[test]
fn variants_differ_and_come_back() {
    let mut seen = std::collections::BTreeSet::new();
    for family in EnvironmentFamily::ALL {
        for variant in 0..4 {
            let make = |width| family.map(&Stream::root(3).at(variant), "map", width).expect("a map");
            let map = make(64);
            assert_eq!(map.digest, make(64).digest);
            assert!(map.texels().as_flattened().iter().all(|x| x.is_finite() && *x >= 0.0 && *x < 1e6), "{family:?}");
            assert!(seen.insert(map.digest.to_string()), "{family:?} {variant}");
            // Any size works, odd ones too.
            make(17);
        }
    }
}
