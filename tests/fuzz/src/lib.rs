//! The fuzz targets, and the plugins that they use for reading. Rendering, settling and writing are not linked.

use syntable_annotate as _;
use syntable_assets as _;
use syntable_placement as _;
use syntable_sampling as _;
use syntable_sensor as _;

pub mod targets;
