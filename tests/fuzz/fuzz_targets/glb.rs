//! Binary glTF.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| syntable_fuzz::inspect(&[("input.glb", data)]));
