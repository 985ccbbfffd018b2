//! The functions of the path tracer's WGSL, each compared with the Rust function that it mirrors.
//!
//! Needs an adapter, as the tests of the renderer do.

mod bsdf;
mod elementary;
mod harness;
mod layers;
mod lights;
mod sampler;

use harness::{Function, compare};
use std::collections::BTreeSet;
use syntable_transport::wgsl;

#[test]
fn elementary_functions_are_the_cpus() {
    compare(&elementary::functions());
}

#[test]
fn numbers_of_paths_are_the_cpus() {
    compare(&sampler::functions());
}

#[test]
fn base_lobes_are_the_cpus() {
    compare(&bsdf::functions());
}

#[test]
fn layers_are_the_cpus() {
    compare(&layers::functions());
}

#[test]
fn lights_are_the_cpus() {
    compare(&lights::functions());
}

#[test]
fn no_function_is_left_out() {
    let all = [elementary::functions, sampler::functions, bsdf::functions, layers::functions, lights::functions];
    let line = |line: &'static str| line.trim_start().strip_prefix("fn ")?.split_once('(').map(|(name, _)| name);
    let written: BTreeSet<&str> = wgsl::MODULES.iter().flat_map(|text| text.lines().filter_map(line)).collect();
    let mut tested = BTreeSet::new();
    for Function { name, through, .. } in all.iter().flat_map(|functions| functions()) {
        assert!(tested.insert(name), "`{name}` is tested twice");
        tested.extend(through);
    }
    assert!(written.len() > 60, "only {} functions found", written.len());
    assert_eq!(written.difference(&tested).collect::<Vec<_>>(), [&""; 0], "functions without a test");
    assert_eq!(tested.difference(&written).collect::<Vec<_>>(), [&""; 0], "tests of functions that do not exist");
}
