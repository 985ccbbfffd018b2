//! All stock plugins. Naming this crate links every one of them: `use syntable_standard as _;`

use syntable_annotate as _;
use syntable_assets as _;
use syntable_denoise as _;
use syntable_evaluate as _;
#[cfg(feature = "hdf5")]
use syntable_hdf5 as _;
use syntable_household as _;
use syntable_interchange as _;
#[cfg(feature = "parquet")]
use syntable_parquet as _;
use syntable_physics as _;
use syntable_placement as _;
use syntable_render_cpu as _;
#[cfg(feature = "gpu")]
use syntable_render_wgpu as _;
use syntable_report as _;
use syntable_sampling as _;
use syntable_sensor as _;
use syntable_write as _;
