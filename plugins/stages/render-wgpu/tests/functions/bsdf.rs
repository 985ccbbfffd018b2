//! The microfacet distribution, its albedo, and the base lobes.

use super::harness::{Call, Function, Row, Tolerance::Exact, Tolerance::Within};
use syntable_simd::Rgb;
use syntable_transport::bsdf::albedo::{Albedo, Row as AlbedoRow, cell};
use syntable_transport::bsdf::ggx::{Ggx, MIN_ALPHA, schlick, stretch};
use syntable_transport::bsdf::{Bsdf, BsdfParameters, BsdfSample, Interface, multiple_reflectance, table};

/// Absolute tolerance of lobes, per steradian. Multiple scattering is the product of 1 minus the albedo for both
/// directions, over its mean. For smooth surfaces, this is the rounding error of the albedo from above, times the loss
/// of a grazing direction, over a mean loss of 1e-4.
pub const LOBE_SLACK: f32 = 4e-5;

/// From a mirror to chalk.
fn alpha(row: &mut Row) {
    row.within(MIN_ALPHA, 1.0, &[MIN_ALPHA, 1.0, 0.04, 0.25]);
}

fn distribution(row: &mut Row) {
    alpha(row);
    row.upper();
}

fn ggx(x: &mut Call) -> Ggx<f32> {
    Ggx::new(x.f(), x.v3())
}

/// Parameters and the outgoing direction.
pub fn surface(row: &mut Row) {
    row.color();
    row.fraction();
    row.fraction();
    row.within(0.0, 0.2, &[0.04, 0.0, 0.01, 1.0]);
    row.upper();
}

pub fn parameters(x: &mut Call) -> BsdfParameters {
    BsdfParameters { base_color: x.v3(), roughness: x.f(), metallic: x.f(), dielectric_f0: x.f() }
}

fn bsdf(x: &mut Call) -> Bsdf {
    Bsdf::new(&parameters(x), x.v3(), table(), x.dielectrics)
}

/// Flags and values of a sample if it is valid.
pub fn sampled(s: &BsdfSample<f32>) -> ([bool; 4], ([Rgb; 2], f32)) {
    if s.valid {
        ([true, s.specular, s.transmitted, s.reflected], ([s.wi, s.weight * s.pdf.min(1.0)], s.pdf))
    } else {
        ([false; 4], ([Rgb::ZERO; 2], 0.0))
    }
}

pub fn functions() -> Vec<Function> {
    vec![
        Function::new(
            "ggx_stretch",
            Within(1e-6, 0.0),
            |row| _ = (row.fraction(), row.cosine()),
            "put(ggx_stretch(f(), f()));",
            |x| stretch(x.f(), x.f()),
        ),
        Function::new(
            "ggx_density",
            Within(4e-6, 0.0),
            |row| _ = (distribution(row), row.upper()),
            "put(ggx_density(ggx_new(f(), v3()), v3()));",
            |x| ggx(x).density(x.v3()),
        )
        .covers(&["ggx_new"]),
        Function::new(
            "ggx_visibility",
            Within(4e-6, 0.0),
            |row| _ = (distribution(row), row.cosine()),
            "put(ggx_visibility(ggx_new(f(), v3()), f()));",
            |x| ggx(x).visibility(x.f()),
        ),
        Function::new(
            "ggx_sample",
            Within(1e-6, 4e-6),
            |row| _ = (distribution(row), row.unit(), row.unit()),
            "put3(ggx_sample(ggx_new(f(), v3()), v2()));",
            |x| ggx(x).sample(x.v2()),
        ),
        Function::new(
            "ggx_pdf",
            Within(4e-6, 0.0),
            |row| _ = (distribution(row), row.positive(5.0)),
            "put(ggx_pdf(ggx_new(f(), v3()), f()));",
            |x| ggx(x).pdf(x.f()),
        ),
        Function::new("schlick", Within(2e-6, 0.0), |row| _ = row.fraction(), "put(schlick(f()));", |x| schlick(x.f())),
        Function::new(
            "table_cell",
            Within(0.0, 4e-6),
            |row| _ = row.within(-0.1, 1.1, &[0.0, 1.0, 0.05, 0.95, 0.5, -1.0, 2.0, 0.999_999_94]),
            "let cell = table_cell(f()); put_u(cell.number); put(cell.weight);",
            |x| cell(x.f()),
        ),
        Function::new(
            "albedo_at",
            Within(1e-6, 1e-6),
            |row| _ = (row.fraction(), row.fraction()),
            "put2(albedo_at(table_cell(f()), f()));",
            |x| {
                let Albedo { facing, grazing } = AlbedoRow::new(x.f()).at(table(), x.f());
                [facing, grazing]
            },
        ),
        Function::new(
            "row_mean",
            Within(1e-6, 1e-6),
            |row| _ = row.fraction(),
            "put2(row_mean(table_cell(f())));",
            |x| {
                let Albedo { facing, grazing } = AlbedoRow::new(x.f()).mean(table());
                [facing, grazing]
            },
        ),
        Function::new(
            "albedo_white",
            Exact,
            |row| _ = (row.fraction(), row.fraction()),
            "put(albedo_white(v2()));",
            |x| Albedo { facing: x.f(), grazing: x.f() }.white(),
        ),
        Function::new(
            "interface_albedo",
            Within(1e-6, 1e-7),
            |row| _ = [0; 5].map(|_| row.fraction()),
            "put(interface_albedo(Interface(f(), f(), f()), v2()));",
            |x| {
                let interface = Interface { f0: x.f(), f90: x.f(), multiple: x.f() };
                interface.albedo(Albedo { facing: x.f(), grazing: x.f() })
            },
        ),
        Function::new(
            "multiple_reflectance",
            Within(2e-6, 0.0),
            |row| _ = (row.fraction(), row.fraction(), row.within(0.3, 1.0, &[1.0, 0.5])),
            "put(multiple_reflectance(f(), f(), f()));",
            |x| multiple_reflectance(x.f(), x.f(), x.f()),
        ),
        Function::new(
            "bsdf_lobes",
            Within(1e-5, LOBE_SLACK),
            |row| _ = (surface(row), row.upper()),
            "let lobes = bsdf_lobes(bsdf_new(BsdfParameters(v3(), f(), f(), f()), v3()), v3());
             put3(lobes.glossy); put3(lobes.matte); put(lobes.pdf);",
            |x| bsdf(x).lobes(x.v3()),
        )
        .covers(&["bsdf_new"])
        .with_both_dielectrics(),
        Function::new(
            "bsdf_direction",
            Within(1e-5, 1e-5),
            |row| _ = (surface(row), row.unit(), row.unit()),
            "let drawn = bsdf_direction(bsdf_new(BsdfParameters(v3(), f(), f(), f()), v3()), v2());
             put3(drawn.wi); put_b(drawn.specular);",
            |x| bsdf(x).direction(x.v2()),
        )
        .with_both_dielectrics(),
        Function::new(
            "bsdf_sample",
            Within(1e-5, LOBE_SLACK),
            |row| _ = (surface(row), row.unit(), row.unit()),
            "put_sample(bsdf_sample(bsdf_new(BsdfParameters(v3(), f(), f(), f()), v3()), v2()));",
            |x| sampled(&bsdf(x).sample(x.v2())),
        )
        .covers(&["is_sound"])
        .with_both_dielectrics(),
    ]
}
