//! Clearcoat, sheen and transmission, and surfaces layered of them.

use super::bsdf::{LOBE_SLACK, parameters, sampled, surface};
use super::harness::{Call, Function, Row, Tolerance::Exact, Tolerance::Within};
use syntable_simd::Vec3;
use syntable_transport::bsdf::coating::CoatingAttenuation;
use syntable_transport::bsdf::sheen::{Sheen, SheenRow, lobe};
use syntable_transport::bsdf::transmission::{Transmission, dielectric, of_two_faces};
use syntable_transport::bsdf::{
    Bsdf, CoatingParameters, LayerInputs, Layered, Lobe, clearcoat_albedo, pane_transmittance, sheen_albedo, table,
};

const LOBES: [Lobe; 4] = [Lobe::Base, Lobe::Sheen, Lobe::ThinWalled, Lobe::Refraction];

fn two_fractions(row: &mut Row) {
    row.fraction();
    row.fraction();
}

fn four_fractions(row: &mut Row) {
    two_fractions(row);
    two_fractions(row);
}

fn coating(x: &mut Call) -> CoatingParameters {
    CoatingParameters { clearcoat: x.f(), clearcoat_roughness: x.f(), sheen: x.f(), sheen_roughness: x.f() }
}

/// The sampled lobe, layers above it, the index of refraction, and the surface.
fn layered_surface(row: &mut Row) {
    row.below(LOBES.len() as u32);
    four_fractions(row);
    row.eta();
    surface(row);
}

fn layered(x: &mut Call) -> (Layered, Bsdf) {
    let inputs = LayerInputs { lobe: x.u() as f32, coating: coating(x), eta: x.f() };
    let (parameters, wo) = (parameters(x), x.v3());
    (Layered::new(&inputs, &parameters, wo), Bsdf::new(&parameters, wo, table(), x.dielectrics))
}

pub fn functions() -> Vec<Function> {
    vec![
        Function::new("sheen_raw", Within(1e-6, 1e-6), two_fractions, "put(sheen_raw(table_cell(f()), f()));", |x| {
            SheenRow::new(x.f()).raw(x.f())
        }),
        Function::new(
            "sheen_row_albedo",
            Within(1e-6, 1e-6),
            two_fractions,
            "put(sheen_row_albedo(table_cell(f()), f()));",
            |x| SheenRow::new(x.f()).albedo(x.f()),
        ),
        Function::new(
            "sheen_lobe",
            Within(2e-5, 1e-6),
            |row| _ = (row.upper(), row.upper(), row.within(1.0, 25.0, &[1.0, 25.0, 4.0])),
            "put(sheen_lobe(v3(), v3(), f()));",
            |x| lobe(x.v3(), x.v3(), x.f()),
        ),
        Function::new(
            "sheen_evaluate",
            Within(2e-5, 1e-6),
            |row| _ = (row.fraction(), row.upper(), row.upper()),
            "put2(sheen_evaluate(sheen_new(f(), v3()), v3()));",
            |x| Sheen::new(x.f(), x.v3()).evaluate(x.v3()),
        )
        .covers(&["sheen_new"]),
        Function::new(
            "sheen_sample",
            Within(1e-6, 1e-6),
            |row| _ = (row.unit(), row.unit()),
            "put3(sheen_sample(v2()));",
            |x| Sheen::sample(x.v2()),
        ),
        Function::new(
            "coating_factors",
            Within(4e-6, 1e-6),
            |row| _ = (four_fractions(row), row.cosine(), row.cosine()),
            "put2(coating_factors(coating_new(CoatingParameters(f(), f(), f(), f()), f()), f()));",
            |x| CoatingAttenuation::new(coating(x), x.f(), table()).factors(x.f()),
        )
        .covers(&["coating_new"]),
        Function::new("clearcoat_albedo", Within(4e-6, 1e-6), two_fractions, "put(clearcoat_albedo(f(), f()));", |x| {
            clearcoat_albedo(x.f(), x.f(), table())
        }),
        Function::new("sheen_albedo", Within(1e-6, 1e-6), two_fractions, "put(sheen_albedo(f(), f()));", |x| {
            sheen_albedo(x.f(), x.f())
        }),
        Function::new(
            "fresnel_dielectric",
            Within(1e-5, 1e-7),
            |row| _ = (row.cosine(), row.eta()),
            "put2(fresnel_dielectric(f(), f()));",
            |x| dielectric(x.f(), x.f()),
        ),
        Function::new(
            "of_two_faces",
            Within(1e-6, 0.0),
            |row| _ = row.fraction(),
            "put(of_two_faces(f()));",
            |x| of_two_faces(x.f()),
        ),
        Function::new(
            "pane_transmittance",
            Within(1e-5, 1e-6),
            |row| _ = (row.cosine(), row.eta()),
            "put(pane_transmittance(f(), f()));",
            |x| pane_transmittance(x.f(), x.f()),
        ),
        Function::new(
            "transmission_sample",
            Within(1e-5, 1e-5),
            |row| {
                row.upper();
                row.fraction();
                row.eta();
                row.below(2);
                row.color();
                row.unit();
                row.unit();
                row.unit();
                row.within(0.0, 0.5, &[0.0, 0.25, 0.5]);
            },
            "let t = transmission_sample(transmission_new(v3(), f(), f(), u() == 1u, v3()), v2(), f(), f());
             put_b(t.valid); put_b(t.reflected && t.valid);
             put3(select(vec3(0.0), t.wi, t.valid)); put3(select(vec3(0.0), t.weight, t.valid));",
            |x| {
                let t = Transmission::new(x.v3(), x.f(), x.f(), x.u() == 1, x.v3()).sample(x.v2(), x.f(), x.f());
                let zero = Vec3::ZERO;
                let directions = if t.valid { [t.wi, t.weight] } else { [zero; 2] };
                (t.valid, t.reflected && t.valid, directions)
            },
        )
        .covers(&["transmission_new"]),
        Function::new(
            "is_transmission",
            Exact,
            |row| _ = row.below(LOBES.len() as u32),
            "put_b(is_transmission(u()));",
            |x| matches!(LOBES[x.u() as usize], Lobe::ThinWalled | Lobe::Refraction),
        ),
        Function::new(
            "layered_lobes",
            Within(2e-5, LOBE_SLACK),
            |row| _ = (layered_surface(row), row.upper()),
            "let lobe = u(); let coating = CoatingParameters(f(), f(), f(), f()); let eta = f();
             let parameters = BsdfParameters(v3(), f(), f(), f()); let wo = v3();
             let layers = layered_new(lobe, coating, eta, parameters, wo);
             let lobes = layered_lobes(layers, bsdf_new(parameters, wo), v3());
             put3(lobes.glossy); put3(lobes.matte); put(lobes.pdf);",
            |x| {
                let (layered, bsdf) = layered(x);
                layered.lobes(&bsdf, x.v3())
            },
        )
        .covers(&["layered_new"])
        .with_both_dielectrics(),
        Function::new(
            "layered_sample",
            Within(2e-5, LOBE_SLACK),
            |row| {
                layered_surface(row);
                row.unit();
                row.unit();
                row.unit();
                row.within(0.0, 0.5, &[0.0, 0.25, 0.5]);
            },
            "let lobe = u(); let coating = CoatingParameters(f(), f(), f(), f()); let eta = f();
             let parameters = BsdfParameters(v3(), f(), f(), f()); let wo = v3();
             let layers = layered_new(lobe, coating, eta, parameters, wo);
             put_sample(layered_sample(layers, bsdf_new(parameters, wo), v2(), f(), f()));",
            |x| {
                let (layered, bsdf) = layered(x);
                sampled(&layered.sample(&bsdf, x.v2(), x.f(), x.f()))
            },
        )
        .with_both_dielectrics(),
    ]
}
