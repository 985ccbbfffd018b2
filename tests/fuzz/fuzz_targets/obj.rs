//! OBJ with its MTL: what follows a line `--` is the material library.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let split = data.windows(4).position(|bytes| bytes == b"\n--\n");
    let (obj, mtl) = split.map_or((data, &[][..]), |at| (&data[..=at], &data[at + 4..]));
    syntable_fuzz::inspect(&[("model.obj", obj), ("model.mtl", mtl)]);
});
