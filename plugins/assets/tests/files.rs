//! Assets in files: bad and odd input, real collections, and formats against each other.

#[path = "files/broken.rs"]
mod broken;
#[path = "files/common.rs"]
mod common;
#[path = "files/made.rs"]
mod made;
#[path = "files/real.rs"]
mod real;

// The crate registers its sources and inspectors only where it is linked.
use syntable_assets as _;
