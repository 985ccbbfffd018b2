//! Random numbers of paths, equal to the bit.

use super::harness::{Function, Row, Tolerance::Exact};
use syntable_prepare::sampler::{SOBOL_PAIRS, Sampler, hash, pascal, scramble_reversed, unit};

/// A sampler and the index of a dimension.
fn dimension(row: &mut Row) {
    row.bits();
    row.bits();
    row.below(2 * SOBOL_PAIRS);
}

pub fn functions() -> Vec<Function> {
    vec![
        Function::new("unit_float", Exact, |row| _ = row.bits(), "put(unit_float(u()));", |x| unit(x.u())),
        Function::new("hash", Exact, |row| _ = row.bits(), "put_u(hash(u()));", |x| hash(x.u())),
        Function::new("pascal", Exact, |row| _ = row.bits(), "put_u(pascal(u()));", |x| pascal(x.u())),
        Function::new(
            "scramble_reversed",
            Exact,
            |row| _ = (row.bits(), row.bits()),
            "put_u(scramble_reversed(u(), u()));",
            |x| scramble_reversed(x.u(), x.u()),
        ),
        Function::new("sample_pair", Exact, dimension, "put2(sample_pair(Sampler(u(), u()), u()));", |x| {
            Sampler { seed: x.u(), index: x.u() }.pair(x.u())
        }),
        Function::new("sample_random", Exact, dimension, "put(sample_random(Sampler(u(), u()), u()));", |x| {
            Sampler { seed: x.u(), index: x.u() }.random(x.u())
        }),
    ]
}
