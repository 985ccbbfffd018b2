//! What the tests of writers share.

#![allow(unused_imports, dead_code)]

use std::path::{Path, PathBuf};
pub use syntable_testing::takes::*;
pub use syntable_testing::tools::{python, python_with};
use syntable_write as _;

pub fn own_script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(name)
}

pub fn shared_script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../tests").join(name)
}
