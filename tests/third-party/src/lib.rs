//! Examples of all additions to SynTable from another crate, one file each.
//!
//! The modules with a path are the templates of `syntable new plugin`.

mod at_run_time;
mod centroid;
mod headroom;
mod mean_area;
mod object_positions;
mod open_bin;
mod rival_boxes;
mod seen_in;
mod shift;
mod slider;
mod time_lapse;
mod travel;

pub use at_run_time::program;

#[path = "../../../core/cli/src/verbs/scaffold/plugins/write/src/lib.rs"]
pub mod area_table;
#[path = "../../../core/cli/src/verbs/scaffold/plugins/denoise/src/lib.rs"]
pub mod box_filter;
#[path = "../../../core/cli/src/verbs/scaffold/plugins/dataset-format/src/lib.rs"]
pub mod box_table;
#[path = "../../../core/cli/src/verbs/scaffold/plugins/metric/src/lib.rs"]
pub mod count_error;
#[path = "../../../core/cli/src/verbs/scaffold/plugins/sensor/src/lib.rs"]
pub mod dead_pixels;
#[path = "../../../core/cli/src/verbs/scaffold/plugins/render/src/lib.rs"]
pub mod first_hit;
#[path = "../../../core/cli/src/verbs/scaffold/plugins/lights/src/lib.rs"]
pub mod head_light;
#[path = "../../../core/cli/src/verbs/scaffold/plugins/topic/src/lib.rs"]
pub mod linked_crates;
#[path = "../../../core/cli/src/verbs/scaffold/plugins/place/src/lib.rs"]
pub mod object_tower;
#[path = "../../../core/cli/src/verbs/scaffold/plugins/mesh-format/src/lib.rs"]
pub mod off_mesh;
#[path = "../../../core/cli/src/verbs/scaffold/plugins/assets/src/lib.rs"]
pub mod plain_cubes;
#[path = "../../../core/cli/src/verbs/scaffold/plugins/image-format/src/lib.rs"]
pub mod plain_ppm;
#[path = "../../../core/cli/src/verbs/scaffold/plugins/check/src/lib.rs"]
pub mod sane_sizes;
#[path = "../../../core/cli/src/verbs/scaffold/plugins/verb/src/lib.rs"]
pub mod slot_kinds;
#[path = "../../../core/cli/src/verbs/scaffold/plugins/camera/src/lib.rs"]
pub mod square_camera;
#[path = "../../../core/cli/src/verbs/scaffold/plugins/settle/src/lib.rs"]
pub mod straight_drop;
#[path = "../../../core/cli/src/verbs/scaffold/plugins/views/src/lib.rs"]
pub mod top_view;
#[path = "../../../core/cli/src/verbs/scaffold/plugins/annotate/src/lib.rs"]
pub mod visible_area;
