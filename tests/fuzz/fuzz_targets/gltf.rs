//! glTF with embedded buffers.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| syntable_fuzz::inspect(&[("input.gltf", data)]));
