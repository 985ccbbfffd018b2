//! One program for all tests of the crate: each program takes seconds to compile.

mod facts;
mod index;
mod pycocotools;
mod shards;
