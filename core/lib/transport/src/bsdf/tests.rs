//! Checks the conditions of the model over roughness, metalness and direction.

use super::*;
use syntable_model::random::Stream;

fn parameters(base: f32, roughness: f32, metallic: f32) -> BsdfParameters {
    BsdfParameters { base_color: Rgb::all(base), roughness, metallic, dielectric_f0: 0.04 }
}

fn bsdf(parameters: &BsdfParameters, wo: Vec3) -> Bsdf {
    Bsdf::new(parameters, wo, table(), Dielectrics::EnergyConserving)
}

fn towards(mu: f32, turn: f32) -> Vec3 {
    let r = (1.0 - mu * mu).sqrt();
    let (s, c) = sin_cos_turns(turn);
    vec3(r * c, r * s, mu)
}

const ROUGHNESSES: [f32; 6] = [0.0, 0.1, 0.25, 0.5, 0.8, 1.0];
const COSINES: [f32; 5] = [0.05, 0.2, 0.5, 0.8, 1.0];

/// Mean weight of sampled directions, which is the directional albedo.
fn albedo(bsdf: &Bsdf, n: u32) -> f64 {
    let mut sum = 0.0;
    for i in 0..n {
        let u = [(i as f32 + 0.5) / n as f32, (i.reverse_bits() >> 8) as f32 / (1 << 24) as f32];
        let scattered = bsdf.sample(u);
        sum += if scattered.valid { f64::from(scattered.weight.x) } else { 0.0 };
    }
    sum / f64::from(n)
}

#[test]
fn white_furnace() {
    for roughness in ROUGHNESSES {
        for metallic in [0.0, 0.5, 1.0] {
            for mu in COSINES {
                let bsdf = bsdf(&parameters(1.0, roughness, metallic), towards(mu, 0.3));
                let got = albedo(&bsdf, 16384);
                assert!((got - 1.0).abs() < 0.008, "roughness {roughness} metallic {metallic} cos {mu}: {got}");
            }
        }
    }
}

#[test]
fn a_black_dielectric_reflects_fresnel_alone() {
    // Smooth: Schlick's formula itself.
    for mu in [0.3, 0.6, 1.0] {
        let bsdf = bsdf(&parameters(0.0, 0.0, 0.0), towards(mu, 0.0));
        let want = f64::from(0.04 + 0.96 * (1.0 - mu).powi(5));
        assert!((albedo(&bsdf, 4096) - want).abs() < 3e-3, "cos {mu}");
    }
}

#[test]
fn reciprocity() {
    let mut stream = Stream::root(4);
    for _ in 0..2000 {
        let mut unit = || stream.unit() as f32;
        let s = parameters(unit(), unit(), unit());
        let (a, b) = (towards(0.02 + 0.98 * unit(), unit()), towards(0.02 + 0.98 * unit(), unit()));
        let there = bsdf(&s, a).evaluate(b).0.x / b.z;
        let back = bsdf(&s, b).evaluate(a).0.x / a.z;
        assert!((there - back).abs() <= 2e-4 * there.max(1e-3), "{s:?} {a:?} {b:?}: {there} {back}");
    }
}

#[test]
fn samples_follow_their_density() {
    // χ² over 16 × 24 cells of (cos, turn), expected counts by 8 × 8 midpoints a cell.
    let (rows, columns, n) = (16, 24, 60_000_u32);
    for (roughness, metallic, mu) in
        [(0.3, 0.0, 0.3), (0.45, 1.0, 0.9), (0.6, 0.5, 0.1), (0.8, 1.0, 0.5), (1.0, 0.0, 0.7), (1.0, 1.0, 0.15)]
    {
        let bsdf = bsdf(&parameters(0.6, roughness, metallic), towards(mu, 0.6));
        let mut stream = Stream::root(11);
        let mut counts = vec![0_u32; rows * columns];
        let mut below = 0;
        for _ in 0..n {
            let s = bsdf.sample([stream.unit() as f32, stream.unit() as f32]);
            if s.valid {
                let turn = (f64::from(s.wi.y).atan2(f64::from(s.wi.x)) / std::f64::consts::TAU).rem_euclid(1.0);
                let row = ((s.wi.z * rows as f32) as usize).min(rows - 1);
                counts[row * columns + ((turn * columns as f64) as usize).min(columns - 1)] += 1;
            } else {
                below += 1;
            }
        }
        let fine = 8;
        let mut expected = vec![0.0_f64; rows * columns];
        for (cell, value) in expected.iter_mut().enumerate() {
            for k in 0..fine * fine {
                let z = ((cell / columns * fine + k / fine) as f32 + 0.5) / (rows * fine) as f32;
                let turn = ((cell % columns * fine + k % fine) as f32 + 0.5) / (columns * fine) as f32;
                *value += f64::from(bsdf.evaluate(towards(z, turn)).1);
            }
            *value *= std::f64::consts::TAU * f64::from(n) / (rows * columns * fine * fine) as f64;
        }
        let lost = f64::from(n) - expected.iter().sum::<f64>();
        assert!(
            (lost - f64::from(below)).abs() < 5.0 * f64::from(below.max(25)).sqrt() + 0.004 * f64::from(n),
            "{lost} {below}"
        );
        let (mut chi2, mut cells, mut rest) = (0.0, 0, (0.0, 0.0));
        for (&count, &want) in counts.iter().zip(&expected) {
            if want < 8.0 {
                rest = (rest.0 + f64::from(count), rest.1 + want);
            } else {
                chi2 += (f64::from(count) - want).powi(2) / want;
                cells += 1;
            }
        }
        if rest.1 > 8.0 {
            chi2 += (rest.0 - rest.1).powi(2) / rest.1;
        }
        // Mean and deviation of χ²; five deviations, and slack for the midpoint rule in steep cells.
        let limit = f64::from(cells) + 5.0 * (2.0 * f64::from(cells)).sqrt() + 10.0;
        assert!(chi2 < limit, "roughness {roughness} metallic {metallic} cos {mu}: χ² {chi2} of {cells} cells");
    }
}

#[test]
fn narrow_lobes_have_unit_density() {
    // The lobe is too narrow for cells. Compares the integral of the specular lobe's density with the fraction of
    // samples above the horizon.
    for roughness in [0.03, 0.1, 0.2] {
        for mu in [0.2, 0.7, 1.0] {
            let s = BsdfParameters { base_color: Rgb::ONE, roughness, metallic: 1.0, dielectric_f0: 0.04 };
            let wo = towards(mu, 0.0);
            let bsdf = bsdf(&s, wo);
            assert!(bsdf.specular_probability > 0.9);
            // Integrates over half vectors in polar coordinates of the slope, where the lobe is wide.
            let (mut sum, n) = (0.0_f64, 400);
            let alpha = f64::from(roughness * roughness).max(1e-3);
            for i in 0..n {
                // tan θ = α √(u / (1 - u)) spreads D evenly.
                let u = (f64::from(i) + 0.5) / f64::from(n);
                let tan2 = alpha * alpha * u / (1.0 - u);
                let cos = 1.0 / (1.0 + tan2).sqrt();
                for j in 0..64 {
                    let (s, c) = sin_cos_turns(j as f32 / 64.0);
                    let sin = (1.0 - cos * cos).sqrt() as f32;
                    let h = vec3(sin * c, sin * s, cos as f32);
                    let wi = h * (2.0 * wo.dot(h)) - wo;
                    if wi.z > 0.0 && wo.dot(h) > 0.0 {
                        let d = f64::from(bsdf.ggx.density(h));
                        let pdf = f64::from(bsdf.ggx.pdf(d as f32));
                        // dωᵢ = 4 (wo·h) dωₕ, and u is uniform under D cos θ dωₕ.
                        sum += pdf * 4.0 * f64::from(wo.dot(h)) / (d * cos);
                    }
                }
            }
            let got = sum / f64::from(n * 64);
            assert!((got - 1.0).abs() < 0.02, "roughness {roughness} cos {mu}: {got}");
        }
    }
}

#[test]
fn index_one_is_lamberts_law() {
    let s = BsdfParameters { dielectric_f0: 0.0, ..parameters(0.7, 0.5, 0.0) };
    for (o, i) in [(1.0, 1.0), (0.1, 0.9), (0.3, 0.02)] {
        let (value, pdf) = bsdf(&s, towards(o, 0.0)).evaluate(towards(i, 0.4));
        assert!(
            (value.x / i - 0.7 * FRAC_1_PI).abs() < 1e-5 && (pdf / i - FRAC_1_PI).abs() < 1e-6,
            "{o} {i}: {value:?}"
        );
    }
}

/// A base under clearcoat and sheen fibers, or one of these, with numbers from a stream.
fn layered(wo: Vec3, lobe: Lobe, unit: &mut dyn FnMut() -> f32) -> (Layered, Bsdf) {
    let s = parameters(unit(), unit(), unit());
    let coating =
        CoatingParameters { clearcoat: unit(), clearcoat_roughness: unit(), sheen: unit(), sheen_roughness: unit() };
    (Layered::new(&LayerInputs { lobe: lobe as u32 as f32, coating, eta: 1.5 }, &s, wo), bsdf(&s, wo))
}

#[test]
fn layers_are_reciprocal() {
    for number in 0..2000 {
        let mut stream = Stream::root(6).at(number);
        let mut unit = || stream.unit() as f32;
        let lobe = if number % 2 == 0 { Lobe::Base } else { Lobe::Sheen };
        let (a, b) = (towards(0.02 + 0.98 * unit(), unit()), towards(0.02 + 0.98 * unit(), unit()));
        let at = |wo: Vec3, wi: Vec3| {
            let mut stream = Stream::root(7).at(number);
            let (layers, base) = layered(wo, lobe, &mut || stream.unit() as f32);
            layers.evaluate(&base, wi).0.x / wi.z
        };
        let (there, back) = (at(a, b), at(b, a));
        assert!((there - back).abs() <= 3e-4 * there.max(1e-3), "{a:?} {b:?}: {there} {back}");
    }
}

#[test]
fn sheen_is_sampled_by_its_density_and_never_gives_more_than_it_gets() {
    // The density covers the whole hemisphere. So do the samples, by a χ² over 10 × 12 cells of equal angle.
    let mut stream = Stream::root(8);
    let (n, mut counts) = (60_000, [0_u32; 120]);
    for _ in 0..n {
        let wi = Sheen::sample([stream.unit() as f32, stream.unit() as f32]);
        let turn = (f64::from(wi.y).atan2(f64::from(wi.x)) / std::f64::consts::TAU).rem_euclid(1.0);
        counts[((wi.z * 10.0) as usize).min(9) * 12 + ((turn * 12.0) as usize).min(11)] += 1;
    }
    let want = f64::from(n) / 120.0;
    let chi2: f64 = counts.iter().map(|&count| (f64::from(count) - want).powi(2) / want).sum();
    assert!(chi2 < 119.0 + 5.0 * (2.0_f64 * 119.0).sqrt(), "χ² {chi2} of 119");
    for roughness in [0.0, 0.2, 0.5, 1.0] {
        for mu in COSINES {
            let sheen = Sheen::new(roughness, towards(mu, 0.1));
            let mean: f32 = (0..64 * 64)
                .map(|i| {
                    let wi = towards(((i / 64) as f32 + 0.5) / 64.0, ((i % 64) as f32 + 0.5) / 64.0);
                    let (value, pdf) = sheen.evaluate(wi);
                    value / pdf
                })
                .sum::<f32>()
                / 4096.0;
            assert!(mean > 0.0 && mean < 1.005, "roughness {roughness} cos {mu}: {mean}");
            assert!((mean - sheen_albedo(roughness, mu).min(1.0)).abs() < 0.12, "{roughness} {mu}: {mean}");
        }
    }
}

#[test]
fn glass_reflects_and_bends_as_snell_and_fresnel_say() {
    let no = false;
    for (mu, eta) in [(1.0_f32, 1.5_f32), (0.5, 1.5), (0.9, 1.0 / 1.5), (0.4, 1.0 / 1.5)] {
        let wo = towards(mu, 0.0);
        let transmission = Transmission::new(wo, 0.0, eta, no, Rgb::ONE);
        let sin_t = (1.0 - mu * mu).sqrt() / eta;
        let (ci, ct) = (f64::from(mu), (1.0 - f64::from(sin_t).powi(2)).max(0.0).sqrt());
        let eta = f64::from(eta);
        let want =
            ((eta * ci - ct) / (eta * ci + ct)).powi(2) / 2.0 + ((ci - eta * ct) / (ci + eta * ct)).powi(2) / 2.0;
        for least in [0.0, 0.3] {
            let (mut reflected, mut passed, mut count) = (0.0, 0.0, 0);
            for i in 0..1000 {
                let random = (i as f32 + 0.5) / 1000.0;
                let sample = transmission.sample([0.37, (i as f32 * 0.618).fract()], random, least);
                assert!(sample.valid && (least > 0.0 || (sample.weight.x - 1.0).abs() < 1e-5));
                if sample.wi.z > 0.0 {
                    reflected += f64::from(sample.weight.x) / 1000.0;
                    count += 1;
                    assert!((sample.wi - vec3(-wo.x, -wo.y, wo.z)).length() < 0.05, "{sample:?}");
                } else {
                    passed += f64::from(sample.weight.x) / 1000.0;
                    assert!((sample.wi.x + sin_t).abs() < 0.05 && sample.wi.y.abs() < 0.05, "{sample:?}");
                }
            }
            assert!((reflected - want).abs() < 0.01, "cos {mu}: {reflected}, not {want}");
            assert!((reflected + passed - 1.0).abs() < 0.01, "cos {mu}: {reflected} and {passed}");
            let total = want > 0.999;
            assert!(total || f64::from(least) - 0.002 < f64::from(count) / 1000.0, "cos {mu}: {count} reflections");
            assert!(total || f64::from(count) / 1000.0 < 1.002 - f64::from(least), "cos {mu}: {count} reflections");
        }
    }
}

/// BRDF times cosine by the equations of glTF 2.0, appendix B.2 and B.3, in a channel of base color `base`.
fn gltf(base: f64, roughness: f64, metallic: f64, wo: Vec3, wi: Vec3) -> f64 {
    let [v, l] = [wo, wi].map(|w| [w.x, w.y, w.z].map(f64::from));
    let sum: [f64; 3] = std::array::from_fn(|c| v[c] + l[c]);
    let length = sum.iter().map(|x| x * x).sum::<f64>().sqrt();
    let h = sum.map(|x| x / length);
    let (nv, nl, nh, vh) = (v[2], l[2], h[2], (0..3).map(|c| v[c] * h[c]).sum::<f64>());
    let a2 = roughness.powi(4);
    let d = a2 / (std::f64::consts::PI * (nh * nh * (a2 - 1.0) + 1.0).powi(2));
    let smith = |own: f64, other: f64| own * (other * other * (1.0 - a2) + a2).sqrt();
    let specular = d * 0.5 / (smith(nl, nv) + smith(nv, nl));
    let rise = (1.0 - vh).powi(5);
    let fresnel = 0.04 + 0.96 * rise;
    let dielectric = base / std::f64::consts::PI * (1.0 - fresnel) + specular * fresnel;
    let metal = specular * (base + (1.0 - base) * rise);
    (dielectric + (metal - dielectric) * metallic) * nl
}

#[test]
fn the_plain_mix_matches_gltf() {
    let mut stream = Stream::root(12);
    for _ in 0..2000 {
        let mut direction = || towards(stream.uniform(0.05, 1.0) as f32, stream.uniform(0.0, 1.0) as f32);
        let (wo, wi) = (direction(), direction());
        let [base, metallic] = [0, 1].map(|_| stream.uniform(0.0, 1.0) as f32);
        let roughness = stream.uniform(0.15, 1.0) as f32;
        let bsdf = Bsdf::new(&parameters(base, roughness, metallic), wo, table(), Dielectrics::Gltf);
        let (got, want) =
            (f64::from(bsdf.evaluate(wi).0.x), gltf(base.into(), roughness.into(), metallic.into(), wo, wi));
        assert!(
            (got - want).abs() < 1e-3 * want + 1e-6,
            "{base} {roughness} {metallic} {wo:?} {wi:?}: {got}, not {want}"
        );
    }
}

/// Figures of the book for the two models: brightness of a gray of 0.5 seen from straight above, relative to glTF's
/// formula, by roughness and elevation of the light, degrees.
#[test]
fn at_grazing_light_the_models_differ() {
    let ratio = |roughness: f32, degrees: f32| {
        let (wo, wi) = (towards(1.0, 0.0), towards(degrees.to_radians().sin(), 0.25));
        let parameters = parameters(0.5, roughness, 0.0);
        let [own, plain] = [Dielectrics::EnergyConserving, Dielectrics::Gltf]
            .map(|model| Bsdf::new(&parameters, wo, table(), model).evaluate(wi).0.x);
        f64::from(own / plain)
    };
    for roughness in [0.1, 0.3, 0.6, 1.0] {
        let row = [5.0, 10.0, 20.0, 30.0, 45.0, 60.0, 90.0].map(|degrees| (100.0 * ratio(roughness, degrees)).round());
        println!("roughness {roughness}: {row:?}");
        assert!(row[2..].iter().all(|percent| (85.0..=107.0).contains(percent)), "{row:?}");
        assert!(row[0] < row[1] && row[1] < row[2], "{row:?}");
    }
}
