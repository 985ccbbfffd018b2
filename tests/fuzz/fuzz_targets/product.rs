//! Values of products that files have, arrays or JSON: each is the product of a key, or refused.
#![no_main]

use libfuzzer_sys::fuzz_target;
use syntable_formats::decode::Content;
use syntable_model::product::{Products, Stored, Value, linked};
use syntable_model::scene::InstanceId;

fuzz_target!(|bytes: &[u8]| {
    let content = Content::new(bytes.to_vec(), "fuzz".into());
    let values = [content.npy().map(Value::Tensor), content.json()];
    let ids = [InstanceId(1), InstanceId(2)];
    for value in values.into_iter().flatten() {
        for key in linked() {
            let mut products = Products::new();
            let stored = Stored { value: &value, ids: &ids, missing: f64::INFINITY };
            if products.put_stored(key, stored).is_ok() {
                // What is taken for a product is one.
                let _ = products.value(&key.name.to_string()).expect("there");
            }
        }
    }
});
