//! The recipe parser, from text to stages or diagnostics. Rendering, settling and writing are not linked, so that tables of
//! those slots end in a diagnostic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use syntable_annotate as _;
use syntable_assets as _;
use syntable_model::registry::Registry;
use syntable_placement as _;
use syntable_runtime::recipe::{self, Overrides};
use syntable_sampling as _;
use syntable_sensor as _;

fuzz_target!(|text: &str| {
    let registry = Registry::linked().expect("no clash");
    let overrides = Overrides {
        set: Vec::new(),
        variable: &|_| Some("value".to_owned()),
        read: &|_| Err(std::io::ErrorKind::NotFound.into()),
        exists: &|_| true,
        current_folder: "/".into(),
        choose: false,
        wanted: Vec::new(),
    };
    let _ = recipe::load(&registry, recipe::Source::embedded("fuzz", text), &overrides);
});
