//! The tests of the templates of `syntable new plugin`, unchanged, in one binary. A module replaces the crate of each
//! template.

use syntable_program as _;

/// Includes a test of a template, and the functions that it shares with others.
macro_rules! tests_of {
    ($($name:ident: $folder:literal $(with $samples:literal)?,)+) => {$(
        // `use name as _` links a crate, and has no effect for a module.
        #[allow(unused_imports)]
        mod $name {
            use outside::$name;
            include!(concat!("../../../core/cli/src/verbs/scaffold/plugins/", $folder, "/tests/plugin.rs"));
            $(include!(concat!("../../../core/cli/src/verbs/scaffold/", $samples));)?
        }
    )+};
}

tests_of! {
    area_table: "write" with "plugin_samples.rs",
    box_filter: "denoise" with "plugin_samples.rs",
    box_table: "dataset-format",
    count_error: "metric",
    dead_pixels: "sensor" with "plugin_samples.rs",
    first_hit: "render" with "plugin_samples.rs",
    head_light: "lights" with "plugin_samples.rs",
    linked_crates: "topic",
    object_tower: "place" with "plugin_samples.rs",
    off_mesh: "mesh-format",
    plain_cubes: "assets" with "plugin_samples.rs",
    plain_ppm: "image-format",
    sane_sizes: "check",
    slot_kinds: "verb",
    square_camera: "camera" with "plugin_samples.rs",
    straight_drop: "settle" with "plugin_samples.rs",
    top_view: "views" with "plugin_samples.rs",
    visible_area: "annotate" with "plugin_samples.rs",
}

mod rules {
    include!("../../../core/cli/src/verbs/scaffold/plugin_rules.rs");
}
