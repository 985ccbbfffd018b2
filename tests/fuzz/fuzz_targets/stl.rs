//! STL, text and binary.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| syntable_fuzz::inspect(&[("input.stl", data)]));
