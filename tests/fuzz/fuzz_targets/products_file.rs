#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| syntable_fuzz::targets::products_file(input));
