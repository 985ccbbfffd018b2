//! Elementary functions and vectors.

use super::harness::{Function, Row, Tolerance::Exact, Tolerance::Within};
use syntable_simd::Basis;
use syntable_simd::functions::{acos, atan2_turns, log2_rough, sin_cos_turns};

/// Angles in turns: quarters and eighths, where quadrants change, and large ones.
fn turns(row: &mut Row) {
    row.within(-2.0, 2.0, &[0.0, 0.125, 0.25, 0.375, 0.5, 0.75, 1.0, -0.125, -0.25, -0.5, 0.999_999_94, 1000.3, -0.0]);
}

fn coordinate(row: &mut Row) -> f32 {
    row.within(-3.0, 3.0, &[0.0, 1.0, -1.0, -0.0, 1e-20, 1e6])
}

pub fn functions() -> Vec<Function> {
    vec![
        Function::new(
            "copysign",
            Exact,
            |row| _ = (coordinate(row), coordinate(row)),
            "put(copysign(f(), f()));",
            |x| x.f().copysign(x.f()),
        ),
        Function::new(
            "is_negative",
            Exact,
            |row| _ = coordinate(row),
            "put_b(is_negative(f()));",
            |x| x.f().is_sign_negative(),
        ),
        Function::new("sin_cos_turns", Within(1e-6, 2e-7), turns, "put2(sin_cos_turns(f()));", |x| {
            sin_cos_turns(x.f())
        }),
        Function::new(
            "arc_cosine",
            Within(1e-6, 2e-7),
            |row| _ = row.within(-1.0, 1.0, &[0.0, 1.0, -1.0, 1.000_001, -1.1, 1e-7, 0.999_999_94]),
            "put(arc_cosine(f()));",
            |x| acos(x.f()),
        ),
        Function::new(
            "atan2_turns",
            Within(1e-6, 1e-8),
            |row| _ = (coordinate(row), coordinate(row)),
            "put(atan2_turns(f(), f()));",
            |x| atan2_turns(x.f(), x.f()),
        ),
        Function::new(
            "log2_rough",
            Within(1e-6, 2e-7),
            |row| _ = row.positive(30.0),
            "put(log2_rough(f()));",
            |x| log2_rough(x.f()),
        ),
        Function::new(
            "luminance",
            Within(1e-6, 0.0),
            |row| _ = row.color(),
            "put(luminance(v3()));",
            |x| x.v3().luminance(),
        ),
        Function::new(
            "max_component",
            Exact,
            |row| _ = row.vector(3.0),
            "put(max_component(v3()));",
            |x| x.v3().max_component(),
        ),
        Function::new("is_black", Exact, |row| _ = row.vector(3.0), "put_b(is_black(v3()));", |x| x.v3().is_black()),
        Function::new(
            "normalized_or",
            Within(1e-6, 0.0),
            |row| _ = (row.vector(3.0), row.direction()),
            "put3(normalized_or(v3(), v3()));",
            |x| x.v3().normalized_or(x.v3()),
        ),
        Function::new(
            "basis_around",
            Within(1e-6, 1e-6),
            |row| _ = row.direction(),
            "let basis = basis_around(v3()); put3(basis[0]); put3(basis[1]); put3(basis[2]);",
            |x| {
                let basis = Basis::around(x.v3());
                [basis.x, basis.y, basis.z]
            },
        ),
        Function::new(
            "to_local",
            Within(1e-6, 1e-6),
            |row| _ = (row.direction(), row.direction(), row.direction(), row.vector(2.0)),
            "let x = v3(); let y = v3(); let z = v3(); put3(to_local(mat3x3(x, y, z), v3()));",
            |x| Basis { x: x.v3(), y: x.v3(), z: x.v3() }.to_local(x.v3()),
        ),
    ]
}
