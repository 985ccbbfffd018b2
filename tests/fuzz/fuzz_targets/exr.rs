//! OpenEXR environment maps.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| syntable_fuzz::inspect(&[("input.exr", data)]));
