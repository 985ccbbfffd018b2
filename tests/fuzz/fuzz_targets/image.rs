//! PNG and JPEG images, known by their content.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| syntable_fuzz::inspect(&[("input.png", data)]));
